//! Bounds that a spectrum must meet, and the factor that scales it.

use std::collections::HashMap;
use std::iter;

use serde::{Deserialize, Serialize};

use crate::affine::Affine;

/// Choice of the spectrum that must lie between 0 and 1 where a reflectance is scaled to a target luminous reflectance
/// (LRV).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
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
pub(crate) struct LrvTarget {
    pub(crate) lrv: LrvLaw,
    /// The weights of the bands in a reflectance's LRV; they sum to 1. Draws are scaled by sums over their bands as
    /// they were rounded, so that it is the spectrum that comes out which has the target; a map of z would be off
    /// where a candidate is dark.
    pub(crate) weights: Vec<f64>,
    pub(crate) bounds: Bounds,
}

impl LrvTarget {
    /// Returns the target for these spectra, with the weights of bands that are alike on the first of them. A driver
    /// may take v s + w s for (v + w) s, which rounds otherwise.
    pub(crate) fn of_unlike_bands(mut self, spectrum: &Affine) -> LrvTarget {
        let mut first = HashMap::new();
        for (band, offset) in spectrum.offset.iter().enumerate() {
            let numbers = iter::once(offset).chain(spectrum.gain.iter().map(|gain| &gain[band]));
            let rounded: Vec<u32> = numbers.map(|&number| (number as f32).to_bits()).collect();
            let like = *first.entry(rounded).or_insert(band);
            if like < band {
                self.weights[like] += std::mem::take(&mut self.weights[band]);
            }
        }
        self
    }
}

/// The luminous reflectance value (LRV) that a draw is scaled to, in (0, 1).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum LrvLaw<R = f64> {
    /// One target for every draw.
    Fixed(R),
    /// A function of one uniform word u of the draw: low + span u, or `high` where rounding takes that above it.
    Uniform { low: R, span: R, high: R },
}

impl LrvLaw {
    pub(crate) fn uniform(low: f64, high: f64) -> LrvLaw {
        LrvLaw::Uniform { low, span: high - low, high }
    }

    /// The smallest target.
    pub(crate) fn least(&self) -> f64 {
        match *self {
            LrvLaw::Fixed(lrv) => lrv,
            LrvLaw::Uniform { low, .. } => low,
        }
    }

    /// The largest target, which is the hardest to meet: a spectrum that is below 1 at one is below 1 at every lower.
    pub(crate) fn largest(&self) -> f64 {
        match *self {
            LrvLaw::Fixed(lrv) => lrv,
            LrvLaw::Uniform { high, .. } => high,
        }
    }
}

/// An intensity that differs from draw to draw: a function of one uniform word of the draw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum IntensityLaw<R = f64> {
    /// Uniform in its logarithm: low x 2^(u octaves).
    LogUniform { low: R, octaves: R },
    /// One of these, each as likely.
    OneOf(Vec<R>),
}

impl IntensityLaw {
    /// The smallest intensity.
    pub(crate) fn least(&self) -> f64 {
        match self {
            IntensityLaw::LogUniform { low, .. } => *low,
            IntensityLaw::OneOf(values) => values.iter().fold(f64::INFINITY, |a, &b| a.min(b)),
        }
    }
}
