//! A model under a recipe, as the numbers that one draw computes with.
//!
//! Everything that does not depend on the random words is folded here, in f64: the weights' mean into the offset, the
//! covariance's factor and scale into the gains. What is left of a candidate is `offset + gain . z` for k standard
//! normals z, one rule that it must obey, and one factor that scales it. The shader and the CPU engine both work from
//! this, and round it once.

use crate::dataset::Kind;
use crate::model::Model;

/// What must lie between 0 and 1 where a reflectance is scaled to a target luminous reflectance.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Bounds {
    /// The spectrum before scaling, as in the appendix. Scaled values can then exceed 1; draws that do are counted.
    #[default]
    Base,
    /// The spectrum after scaling, as in the authors' published code.
    Scaled,
    /// Both.
    Both,
}

/// A target luminous reflectance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Target {
    /// The luminous reflectance value (LRV) of every draw, in (0, 1).
    pub(crate) lrv: f64,
    /// The weights of the bands in a reflectance's LRV; they sum to 1.
    pub(crate) weights: Vec<f64>,
    pub(crate) bounds: Bounds,
}

/// What one draw computes. n bands, k components.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Program {
    pub(crate) kind: Kind,
    /// The spectrum at z = 0, n values.
    pub(crate) offset: Vec<f64>,
    /// What each standard normal adds, k rows of n values.
    pub(crate) gain: Vec<Vec<f64>>,
    pub(crate) target: Option<Target>,
    /// How many candidates a draw may take, at least 1 and less than 2^31.
    pub(crate) max_attempts: u32,
}

impl Program {
    pub(crate) fn new(
        model: &Model,
        covariance_scale: f64,
        target: Option<Target>,
        max_attempts: u32,
    ) -> Program {
        let parts = model.parts();
        let gain = model.weight_factor().transpose() * &parts.basis * covariance_scale.sqrt();
        Program {
            kind: parts.kind,
            offset: model.reconstruct(parts.weight_mean.as_slice()).as_slice().to_vec(),
            gain: gain.row_iter().map(|row| row.iter().copied().collect()).collect(),
            target,
            max_attempts,
        }
    }

    pub(crate) fn bands(&self) -> usize {
        self.offset.len()
    }

    pub(crate) fn components(&self) -> usize {
        self.gain.len()
    }

    /// Whether the spectrum before scaling must be physical.
    pub(crate) fn tests_base(&self) -> bool {
        self.target.as_ref().is_none_or(|t| t.bounds != Bounds::Scaled)
    }

    /// Whether the spectrum after scaling must be physical.
    pub(crate) fn tests_scaled(&self) -> bool {
        self.target.as_ref().is_some_and(|t| t.bounds != Bounds::Base)
    }

    /// Whether scaling may take an accepted spectrum to 1 or above.
    pub(crate) fn may_exceed_one(&self) -> bool {
        self.target.as_ref().is_some_and(|t| t.bounds == Bounds::Base)
    }
}

/// What a draw took: the number of candidates up to and including the accepted one, 0 where none was accepted, and
/// whether scaling took the spectrum to 1 or above. One word, as the shader writes it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(transparent)]
pub struct Tally(u32);

impl Tally {
    pub(crate) const ABOVE_ONE: u32 = 1 << 31;

    pub(crate) fn accepted(attempts: u32, above_one: bool) -> Tally {
        Tally(attempts | if above_one { Self::ABOVE_ONE } else { 0 })
    }

    /// No candidate was accepted within the attempts allowed; the spectrum is all zeros.
    pub(crate) const FAILED: Tally = Tally(0);

    /// The number of candidates up to and including the accepted one; 0 where none was.
    pub fn attempts(self) -> u32 {
        self.0 & !Self::ABOVE_ONE
    }

    /// Whether scaling to the target took a value of the spectrum to 1 or above (possible under [`Bounds::Base`]).
    pub fn above_one(self) -> bool {
        self.0 & Self::ABOVE_ONE != 0
    }
}
