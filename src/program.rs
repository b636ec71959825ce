//! A model under a recipe, as the numbers that one draw computes with.
//!
//! Everything that does not depend on the random words is folded here, in f64. A spectrum is linear in the k standard
//! normals z of a candidate, and so is all that is linear in a spectrum: weights, tristimulus values, luminous
//! reflectance. Each is an [`Affine`] map of z, with the weights' mean in its offset and the covariance's factor and
//! scale in its gains. What is left of a draw is one rule that the spectrum must obey, and one factor that scales it.
//! The shader and the CPU engine both work from this, and round it once.

use std::collections::HashMap;
use std::iter;

use crate::cover::{Cover, Proposal};
use crate::dataset::Kind;
use crate::model::Model;
use crate::quantity::{Format, Interval};

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

/// offset + gain . z: m values of k standard normals.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Affine {
    /// The values at z = 0, m of them.
    pub(crate) offset: Vec<f64>,
    /// What each standard normal adds, k rows of m values.
    pub(crate) gain: Vec<Vec<f64>>,
}

impl Affine {
    /// The products of the values with each row of `weights`.
    pub(crate) fn project(&self, weights: &[impl AsRef<[f64]>]) -> Affine {
        let product = |values: &[f64]| {
            let dot = |row: &[f64]| row.iter().zip(values).map(|(w, v)| w * v).sum::<f64>();
            weights.iter().map(|row| dot(row.as_ref())).collect()
        };
        Affine { offset: product(&self.offset), gain: self.gain.iter().map(|g| product(g)).collect() }
    }

    /// One of the values alone.
    pub(crate) fn value(&self, number: usize) -> Affine {
        let gain = self.gain.iter().map(|gain| vec![gain[number]]).collect();
        Affine { offset: vec![self.offset[number]], gain }
    }

    /// Always `value`.
    pub(crate) fn constant(value: f64, components: usize) -> Affine {
        Affine { offset: vec![value], gain: vec![vec![0.0]; components] }
    }

    fn scaled(self, by: f64) -> Affine {
        let scaled = |values: Vec<f64>| values.into_iter().map(|v| v * by).collect();
        Affine { offset: scaled(self.offset), gain: self.gain.into_iter().map(scaled).collect() }
    }
}

/// A target luminous reflectance.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Target {
    /// The luminous reflectance value (LRV) of every draw, in (0, 1).
    pub(crate) lrv: f64,
    /// The weights of the bands in a reflectance's LRV; they sum to 1. Draws are scaled by sums over their bands as
    /// they were rounded, so that it is the spectrum that comes out which has the target; a map of z would be off
    /// where a candidate is dark.
    pub(crate) weights: Vec<f64>,
    pub(crate) bounds: Bounds,
}

impl Target {
    /// The same for these spectra, with the weights of bands that are alike on the first of them. A driver may take
    /// v s + w s for (v + w) s, which rounds otherwise.
    pub(crate) fn of_unlike_bands(mut self, spectrum: &Affine) -> Target {
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

/// An intensity that differs from draw to draw: a function of one uniform word of the draw.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Level {
    /// Uniform in its logarithm: low x 2^(u octaves).
    LogUniform { low: f64, octaves: f64 },
    /// One of these, each as likely.
    OneOf(Vec<f64>),
}

/// What a map of z is multiplied by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Unit {
    /// 1.
    One,
    /// What the spectrum is scaled by.
    Scale,
    /// The reciprocal of the first value of another map.
    Over(Affine),
}

/// Where a quantity comes from.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Source {
    /// The spectrum, scaled.
    Spectrum,
    /// A map of z, and what multiplies it.
    Map(Affine, Unit),
    /// The level of the draw.
    Level,
    /// The word of the draw's [`Tally`].
    Tally,
}

/// A quantity that comes out.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Output {
    pub(crate) format: Format,
    pub(crate) source: Source,
}

/// What one draw computes. n bands, k components.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Program {
    pub(crate) kind: Kind,
    /// The spectrum before it is scaled, n values.
    pub(crate) spectrum: Affine,
    pub(crate) target: Option<Target>,
    pub(crate) level: Option<Level>,
    /// What proposes candidates, where it is not plain rejection: z is then what it gives, and all maps are of that.
    pub(crate) proposal: Option<Proposal<f64>>,
    /// How many candidates a draw may take, at least 1 and less than 2^31.
    pub(crate) max_attempts: u32,
    /// What comes out, in the order of [`Quantity`](crate::Quantity), each once.
    pub(crate) outputs: Vec<Output>,
}

impl Program {
    /// Draws of a model with these weights that are physical, of which nothing comes out yet.
    pub(crate) fn new(model: &Model, weights: &Affine) -> Program {
        let parts = model.parts();
        let columns: Vec<_> =
            parts.basis.column_iter().map(|c| c.iter().copied().collect::<Vec<_>>()).collect();
        let mut spectrum = weights.project(&columns);
        spectrum.offset.iter_mut().zip(&parts.mean).for_each(|(s, mean)| *s += mean);
        Program {
            kind: parts.kind,
            spectrum,
            target: None,
            level: None,
            proposal: None,
            max_attempts: 1,
            outputs: Vec::new(),
        }
    }

    /// The same with every spectrum multiplied by `intensity`.
    pub(crate) fn brightened(self, intensity: f64) -> Program {
        Program { spectrum: self.spectrum.scaled(intensity), ..self }
    }

    /// The same draws from the candidates of a cover.
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
        Program { spectrum, outputs, proposal: Some(cover.proposal().clone()), ..self }
    }

    /// The same with tallies among what comes out.
    pub(crate) fn tallied(&self) -> Program {
        let format = Format::tally();
        let mut outputs = self.outputs.clone();
        if outputs.iter().all(|output| output.source != Source::Tally) {
            outputs.push(Output { format, source: Source::Tally });
            outputs.sort_by_key(|output| output.format.quantity);
        }
        Program { outputs, ..self.clone() }
    }

    /// The same with nothing but spectra coming out.
    pub(crate) fn spectra_alone(&self) -> Program {
        let format = Format::spectra(self.bands());
        Program { outputs: vec![Output { format, source: Source::Spectrum }], ..self.clone() }
    }

    pub(crate) fn bands(&self) -> usize {
        self.spectrum.offset.len()
    }

    pub(crate) fn components(&self) -> usize {
        self.spectrum.gain.len()
    }

    /// Whether spectra are scaled, by a target or a level.
    pub(crate) fn scales(&self) -> bool {
        self.target.is_some() || self.level.is_some()
    }

    /// What the values of spectra that come out are between.
    pub(crate) fn interval(&self) -> Interval {
        match self.kind {
            Kind::Reflectance if !self.may_exceed_one() => Interval::Unit,
            _ => Interval::Positive,
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

/// The weights of a model as a map of z.
pub(crate) fn weights(model: &Model, covariance_scale: f64) -> Affine {
    let factor = model.weight_factor() * covariance_scale.sqrt();
    Affine {
        offset: model.parts().weight_mean.as_slice().to_vec(),
        gain: factor.column_iter().map(|column| column.iter().copied().collect()).collect(),
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

    /// No candidate was accepted within the attempts allowed; all quantities are 0.
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
