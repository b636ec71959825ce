//! A model under a recipe, as the numbers that one draw computes with.
//!
//! Everything that does not depend on the random words is folded here, in f64. A spectrum is linear in the k standard
//! normals z of a candidate, and so is all that is linear in a spectrum: weights, tristimulus values, luminous
//! reflectance. Each is an [`Affine`] map of z, with the weights' mean in its offset and the covariance's factor and
//! scale in its gains. All else in a draw is one pair of bounds that the spectrum must meet, and one factor that
//! scales it. The shader and the CPU engine both work from this, and round it once.

pub(crate) mod condition;
pub(crate) mod feasibility;
pub(crate) mod mode;
mod proposal;
mod rule;

pub(crate) use proposal::Proposal;
pub use rule::Bounds;
pub(crate) use rule::{IntensityLaw, LrvLaw, LrvTarget};

use crate::affine::Affine;
use crate::cover::Cover;
use crate::dataset::SpectrumKind;
use crate::model::Model;
use crate::quantity::{ArrayFormat, ValueRange};

/// Factor of a map of z.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unit {
    /// One.
    One,
    /// The scale of the spectrum.
    Scale,
    /// The reciprocal of the first value of another map.
    Over(Affine),
}

/// Source of a quantity's values.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Source {
    /// The spectrum, scaled.
    Spectrum,
    /// A map of z, and its factor.
    Map(Affine, Unit),
    /// The intensity of the draw.
    Intensity,
    /// The draw's own target.
    TargetLrv,
    /// The word of the draw's [`DrawStatus`](crate::DrawStatus).
    Status,
}

/// A quantity that a draw gives.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Output {
    pub(crate) format: ArrayFormat,
    pub(crate) source: Source,
}

/// Everything that one draw computes, for n bands and k components. n bands, k components.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Program {
    pub(crate) kind: SpectrumKind,
    /// The spectrum before it is scaled, n values.
    pub(crate) spectrum: Affine,
    pub(crate) target: Option<LrvTarget>,
    pub(crate) intensity: Option<IntensityLaw>,
    /// Source of candidates, where they are not plain normals: z is then in its coordinates, and so are all maps.
    pub(crate) proposal: Option<Proposal<f64>>,
    /// Largest number of candidates of a draw, at least 1 and less than 2^31.
    pub(crate) max_attempts: u32,
    /// Outputs, in the order of [`Quantity`](crate::Quantity), each once.
    pub(crate) outputs: Vec<Output>,
    /// Number of components that are given to each draw, its responses, and come before those that are drawn.
    pub(crate) given: usize,
}

impl Program {
    /// Makes a program for physical draws of a model with these weights, without outputs.
    pub(crate) fn new(model: &Model, weights: &Affine) -> Program {
        Program::of(model.kind(), model.spectrum_map(weights))
    }

    /// Makes a program for physical draws of spectra of this map, without outputs.
    pub(crate) fn of(kind: SpectrumKind, spectrum: Affine) -> Program {
        Program {
            kind,
            spectrum,
            target: None,
            intensity: None,
            proposal: None,
            max_attempts: 1,
            outputs: Vec::new(),
            given: 0,
        }
    }

    /// Returns the program with every spectrum multiplied by `intensity`.
    pub(crate) fn brightened(self, intensity: f64) -> Program {
        Program { spectrum: self.spectrum.scaled(intensity), ..self }
    }

    /// Returns the program of draws that are all given these responses.
    pub(crate) fn at(&self, responses: &[f64]) -> Program {
        let fixed = |source: &Source| match source {
            Source::Map(map, Unit::Over(over)) => {
                Source::Map(map.at(responses), Unit::Over(over.at(responses)))
            }
            Source::Map(map, unit) => Source::Map(map.at(responses), unit.clone()),
            other => other.clone(),
        };
        let output = |output: &Output| Output { format: output.format, source: fixed(&output.source) };
        let outputs = self.outputs.iter().map(output).collect();
        Program { spectrum: self.spectrum.at(responses), outputs, given: 0, ..self.clone() }
    }

    /// Returns the program in normals of another unit, in standard deviations.
    pub(crate) fn in_units(self, unit: f64) -> Program {
        let scaled = |map: Affine| {
            let gain =
                map.gain.into_iter().map(|gain| gain.into_iter().map(|g| unit * g).collect()).collect();
            Affine { gain, ..map }
        };
        let source = |source| match source {
            Source::Map(map, Unit::Over(over)) => Source::Map(scaled(map), Unit::Over(scaled(over))),
            Source::Map(map, unit) => Source::Map(scaled(map), unit),
            other => other,
        };
        let outputs = self.outputs.into_iter().map(|o| Output { source: source(o.source), ..o }).collect();
        Program { spectrum: scaled(self.spectrum), outputs, ..self }
    }

    /// Returns the program with candidates from a cover.
    pub(crate) fn covered(self, cover: &Cover) -> Program {
        let frame = cover.frame();
        let turned = |source| match source {
            Source::Map(map, Unit::Over(over)) => {
                Source::Map(frame.turned(&map), Unit::Over(frame.turned(&over)))
            }
            Source::Map(map, unit) => Source::Map(frame.turned(&map), unit),
            other => other,
        };
        let outputs = self.outputs.into_iter().map(|o| Output { source: turned(o.source), ..o }).collect();
        let spectrum = frame.turned(&self.spectrum);
        Program { spectrum, outputs, proposal: Some(Proposal::Boxes(cover.proposal().clone())), ..self }
    }

    /// Returns the program with statuses among its outputs.
    pub(crate) fn with_status(&self) -> Program {
        let format = ArrayFormat::status();
        let mut outputs = self.outputs.clone();
        if outputs.iter().all(|output| output.source != Source::Status) {
            outputs.push(Output { format, source: Source::Status });
            outputs.sort_by_key(|output| output.format.quantity);
        }
        Program { outputs, ..self.clone() }
    }

    /// Returns the program with spectra as its only output.
    pub(crate) fn spectra_alone(&self) -> Program {
        let format = ArrayFormat::spectra(self.bands());
        Program { outputs: vec![Output { format, source: Source::Spectrum }], ..self.clone() }
    }

    pub(crate) fn bands(&self) -> usize {
        self.spectrum.offset.len()
    }

    /// Whether candidates come from a cover.
    pub(crate) fn is_covered(&self) -> bool {
        matches!(self.proposal, Some(Proposal::Boxes(_)))
    }

    /// Number of components, those that are given included.
    pub(crate) fn components(&self) -> usize {
        self.spectrum.gain.len()
    }

    /// Number of normals of a candidate.
    pub(crate) fn normals(&self) -> usize {
        self.components() - self.given
    }

    /// Whether spectra are scaled, by a target or an intensity.
    pub(crate) fn scales(&self) -> bool {
        self.target.is_some() || self.intensity.is_some()
    }

    /// Whether each draw has a target of its own.
    pub(crate) fn has_own_targets(&self) -> bool {
        self.target.as_ref().is_some_and(|t| matches!(t.lrv, LrvLaw::Uniform { .. }))
    }

    /// Whether what is accepted depends on a draw's own target, so that no cover serves all draws.
    pub(crate) fn tests_own_targets(&self) -> bool {
        self.tests_scaled() && self.has_own_targets()
    }

    /// Whether a word of a draw's own, rather than of an attempt, has a part in it.
    pub(crate) fn reads_draw_block(&self) -> bool {
        self.intensity.is_some() || self.has_own_targets()
    }

    /// Returns the program with every draw at the largest target.
    pub(crate) fn at_largest_target(&self) -> Program {
        let fixed = |target: LrvTarget| LrvTarget { lrv: LrvLaw::Fixed(target.lrv.largest()), ..target };
        Program { target: self.target.clone().map(fixed), ..self.clone() }
    }

    /// Range of values that the spectra may take.
    pub(crate) fn value_range(&self) -> ValueRange {
        match self.kind {
            SpectrumKind::Reflectance if !self.may_exceed_one() => ValueRange::Unit,
            _ => ValueRange::Positive,
        }
    }

    /// Whether the spectrum before scaling must be below 1.
    pub(crate) fn tests_base(&self) -> bool {
        self.target.as_ref().is_none_or(|t| t.bounds != Bounds::Scaled)
    }

    /// Whether the spectrum after scaling must be below 1.
    pub(crate) fn tests_scaled(&self) -> bool {
        self.target.as_ref().is_some_and(|t| t.bounds != Bounds::Base)
    }

    /// Whether scaling may take an accepted spectrum to 1 or above.
    pub(crate) fn may_exceed_one(&self) -> bool {
        self.target.as_ref().is_some_and(|t| t.bounds == Bounds::Base)
    }
}
