//! Numerical error against cost: draws of each engine, and of alternative implementations, compared with draws in f64
//! of the same words.

use std::ops::{Add, Div, Mul};

use half::f16;
use nalgebra::DVector;
use rayon::prelude::*;
use serde::Serialize;

use super::convergence::{Convergence, Source};
use super::engines::Values;
use super::estimate::quantile;
use super::functions::{self, Functions};
use super::{Bench, ReportError};
use crate::colorimetry;
use crate::dataset::SpectrumKind;
use crate::draw_status::DrawStatus;
use crate::model::Model;
use crate::random::real::{DrawOperations, Real};
use crate::random::stream::{DrawRange, Stream};
use crate::recipe::Recipe;

/// Numerical error against cost.
#[derive(Clone, Debug, Serialize)]
pub struct Accuracy {
    /// Number of draws that were compared.
    pub draws: u64,
    /// Engines, and variants of them.
    pub variants: Vec<Variant>,
    /// Functions of Box-Muller, ours and built-in.
    pub functions: Vec<Functions>,
}

/// Variant of drawing, compared with f64.
#[derive(Clone, Debug, Serialize)]
pub struct Variant {
    /// Name of the variant: its difference.
    pub name: String,
    /// Nanoseconds per draw, where the variant is an engine.
    pub nanoseconds: Option<f64>,
    /// Bytes per value.
    pub bytes: u32,
    /// Draws that took another candidate, per million.
    pub flips_per_million: f64,
    /// Largest error of a band's value in each draw, in units of reflectance or relative power.
    pub spectra: Errors,
    /// Largest error of a band's value in each draw, in units in the last place of the f32 value.
    pub ulps: Errors,
    /// Largest error of a weight in each draw.
    pub weights: Errors,
    /// The error of the luminous reflectance, or for lights of the relative luminance, in each draw.
    pub luminance: Errors,
    /// Largest error of X, Y and Z in each draw, where a perfect white, or the mean light, has Y = 1.
    pub xyz: Errors,
    /// Mean over draws of the error of a band, root mean square over bands: no number of draws averages it away.
    pub bias: f64,
    /// Standard error of the bias: a bias below twice that is not told from none.
    pub bias_error: f64,
}

/// Errors over all draws.
#[derive(Clone, Copy, Debug, Default, Serialize)]
pub struct Errors {
    /// Largest error.
    pub max: f64,
    /// Error that one draw in a thousand exceeds.
    pub p999: f64,
    /// Root mean square error.
    pub rms: f64,
}

pub(super) fn measure(
    bench: &Bench,
    recipe: &Recipe,
    convergence: &Convergence,
) -> Result<Accuracy, ReportError> {
    let draws = Stream::named(bench.seed, "accuracy").draws(0..bench.effort.pick(50_000, 200_000, 1_000_000));
    bench.agenda.say(&format!("{} draws beside those in f64", draws.count))?;
    let judge = Judge::new(recipe, draws);
    let mut variants = Vec::new();
    for (engine, target) in bench.targets.iter().enumerate() {
        if target.engine().is_none() {
            continue;
        }
        bench.agenda.say(&format!("the values of {}", target.facts.name))?;
        let (mut values, mut statuses) = (Vec::new(), Vec::new());
        target.runner(recipe)?.draw(bench, draws, &mut |part, took| {
            let Values::Single(part) = part else { return };
            values.extend_from_slice(part);
            statuses.extend_from_slice(took);
        })?;
        let variant = judge.variant(&target.facts.name, &values, &statuses);
        let curve = convergence.curves.iter().find(|curve| curve.source == Source::Engine(engine));
        variants.push(Variant { nanoseconds: curve.map(|curve| curve.merit.nanoseconds.median), ..variant });
    }
    bench.agenda.say("variants")?;
    let (ours, statuses) = judge.scalar::<f32>();
    let half: Vec<f32> = ours.iter().map(|&v| f16::from_f32(v).to_f32()).collect();
    variants.push(Variant { bytes: 2, ..judge.variant("CPU, f32 rounded to f16", &half, &statuses) });
    let (coarse, statuses) = judge.scalar::<Coarse>();
    variants.push(judge.variant("CPU, f32, uniforms of 24 bits", &coarse, &statuses));
    let (platform, statuses) = judge.scalar::<Platform>();
    variants.push(judge.variant("CPU, f32, log, sin and cos of the system", &platform, &statuses));
    let functions = functions::measure(bench, recipe)?;
    Ok(Accuracy { draws: draws.count, variants, functions })
}

/// Draws in f64 that others are compared with.
struct Judge<'a> {
    recipe: &'a Recipe,
    draws: DrawRange,
    exact: Vec<(Vec<f64>, DrawStatus)>,
    /// Weights of X, Y and Z.
    xyz: [Vec<f64>; 3],
}

/// Spectra and statuses of draws on the CPU.
fn scalar_draws<R: Real>(recipe: &Recipe, draws: DrawRange) -> Vec<(Vec<R>, DrawStatus)> {
    let session = recipe.scalar_sampler::<R>();
    let draw = |i| {
        let drawn = session.draw(draws.stream, draws.first + i);
        (drawn.spectrum().to_vec(), drawn.status())
    };
    (0..draws.count).into_par_iter().map(draw).collect()
}

/// Errors of a draw.
struct Difference {
    spectrum: f64,
    ulps: f64,
    weights: f64,
    luminance: f64,
    xyz: f64,
}

impl<'a> Judge<'a> {
    fn new(recipe: &'a Recipe, draws: DrawRange) -> Judge<'a> {
        Judge { recipe, draws, exact: scalar_draws(recipe, draws), xyz: xyz_weights(recipe.model()) }
    }

    /// Makes the judged draws in another arithmetic on the CPU.
    fn scalar<R: Real + Into<f32>>(&self) -> (Vec<f32>, Vec<DrawStatus>) {
        let (spectra, statuses): (Vec<_>, Vec<_>) =
            scalar_draws::<R>(self.recipe, self.draws).into_iter().unzip();
        (spectra.into_iter().flatten().map(Into::into).collect(), statuses)
    }

    fn variant(&self, name: &str, values: &[f32], statuses: &[DrawStatus]) -> Variant {
        let bands = self.recipe.model().bands();
        let pairs = values.par_chunks_exact(bands).zip(statuses).zip(&self.exact);
        let same: Vec<(&[f32], &[f64])> = pairs
            .filter(|((_, ours), (_, exact))| ours.attempts() == exact.attempts())
            .map(|((row, _), (spectrum, _))| (row, spectrum.as_slice()))
            .collect();
        let differences: Vec<_> = same.par_iter().map(|(row, exact)| self.difference(row, exact)).collect();
        let errors = |of: fn(&Difference) -> f64| Errors::of(&differences.iter().map(of).collect::<Vec<_>>());
        let (bias, bias_error) = bias(&same, bands);
        Variant {
            name: name.to_owned(),
            nanoseconds: None,
            bytes: 4,
            flips_per_million: 1e6 * (statuses.len() - same.len()) as f64 / statuses.len() as f64,
            spectra: errors(|d| d.spectrum),
            ulps: errors(|d| d.ulps),
            weights: errors(|d| d.weights),
            luminance: errors(|d| d.luminance),
            xyz: errors(|d| d.xyz),
            bias,
            bias_error,
        }
    }

    fn difference(&self, row: &[f32], exact: &[f64]) -> Difference {
        let errors: Vec<f64> = row.iter().zip(exact).map(|(&a, b)| f64::from(a) - b).collect();
        let largest = |values: &mut dyn Iterator<Item = f64>| values.fold(0.0, |a: f64, v| a.max(v.abs()));
        let ulp = |v: f64| f64::from((v as f32).next_up() - v as f32);
        let weights = &self.recipe.model().parts().basis * DVector::from_column_slice(&errors);
        let xyz = self.xyz.each_ref().map(|w| w.iter().zip(&errors).map(|(w, e)| w * e).sum::<f64>());
        Difference {
            spectrum: largest(&mut errors.iter().copied()),
            ulps: largest(&mut errors.iter().zip(exact).map(|(e, &v)| e / ulp(v))),
            weights: largest(&mut weights.iter().copied()),
            luminance: xyz[1].abs(),
            xyz: largest(&mut xyz.into_iter()),
        }
    }
}

/// Root mean square over bands of the mean error, and its standard error.
fn bias(pairs: &[(&[f32], &[f64])], bands: usize) -> (f64, f64) {
    let n = pairs.len() as f64;
    let (mut square, mut variance) = (0.0, 0.0);
    for b in 0..bands {
        let errors = || pairs.iter().map(|(row, exact)| f64::from(row[b]) - exact[b]);
        let mean = errors().sum::<f64>() / n;
        square += mean * mean;
        variance += errors().map(|e| (e - mean).powi(2)).sum::<f64>() / n / n;
    }
    ((square / bands as f64).sqrt(), (variance / bands as f64).sqrt())
}

impl Errors {
    fn of(values: &[f64]) -> Errors {
        if values.is_empty() {
            return Errors::default();
        }
        Errors {
            max: values.iter().copied().fold(0.0, f64::max),
            p999: quantile(values, 0.999),
            rms: super::estimate::root_mean_square(values),
        }
    }
}

/// Weights of X, Y and Z: of reflectances under D65, where a perfect white has Y = 1, and of lights where the model's
/// mean has. All zero where there is no visible light.
fn xyz_weights(model: &Model) -> [Vec<f64>; 3] {
    let grid = model.grid();
    let none = || [(); 3].map(|()| vec![0.0; grid.len()]);
    match model.kind() {
        SpectrumKind::Reflectance => colorimetry::xyz_weights(grid).unwrap_or_else(none),
        SpectrumKind::Illuminant => {
            let cmf = colorimetry::emitted_xyz_weights(grid);
            let mean: f64 = cmf[1].iter().zip(&model.parts().mean).map(|(y, m)| y * m).sum();
            if mean > 0.0 { cmf.map(|f| f.iter().map(|v| v / mean).collect()) } else { none() }
        }
    }
}

/// Defines an f32 whose normals are made in another way.
macro_rules! altered {
    ($(#[$doc:meta])* $name:ident, $normals:expr) => {
        $(#[$doc])*
        #[derive(Clone, Copy, PartialEq, PartialOrd)]
        pub(super) struct $name(f32);

        impl Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                $name(self.0 + other.0)
            }
        }

        impl Mul for $name {
            type Output = Self;
            fn mul(self, other: Self) -> Self {
                $name(self.0 * other.0)
            }
        }

        impl Div for $name {
            type Output = Self;
            fn div(self, other: Self) -> Self {
                $name(self.0 / other.0)
            }
        }

        impl From<$name> for f32 {
            fn from(value: $name) -> f32 {
                value.0
            }
        }

        impl Real for $name {
            fn normal_pair(x: u32, y: u32) -> [Self; 2] {
                let normals: fn(u32, u32) -> [f32; 2] = $normals;
                normals(x, y).map($name)
            }
        }

        impl DrawOperations for $name {
            const ZERO: Self = $name(f32::ZERO);
            const ONE: Self = $name(f32::ONE);
            const INFINITY: Self = $name(f32::INFINITY);
            const FLOOR: Self = $name(f32::FLOOR);

            fn from_f64(value: f64) -> Self {
                $name(value as f32)
            }

            fn uniform(x: u32) -> Self {
                $name(f32::uniform(x))
            }

            fn exp2(self) -> Self {
                $name(DrawOperations::exp2(self.0))
            }

            fn truncated(axis: [Self; 4], word: u32) -> [Self; 2] {
                f32::truncated(axis.map(|v| v.0), word).map($name)
            }

            fn chi_square(word: u32) -> Self {
                $name(f32::chi_square(word))
            }
        }
    };
}

altered!(
    /// f32 with uniforms of 24 bits, as generators of f32 usually have them.
    Coarse,
    |x, y| f32::normal_pair(x & !0xFF | 0x80, y & !0xFF | 0x80)
);

altered!(
    /// f32 with Box-Muller as textbooks have it, with the logarithm, sine and cosine of the system's library.
    Platform,
    |x, y| {
        let radius = (-2.0 * f32::uniform(x).ln()).max(0.0).sqrt();
        let (sine, cosine) = (std::f32::consts::TAU * f32::uniform(y)).sin_cos();
        [radius * cosine, radius * sine]
    }
);

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn coarse_uniforms_err_more_than_ours() {
        let recipe = Recipe::builder(&Model::builtin("munsell-vrhel").unwrap()).build().unwrap();
        let judge = Judge::new(&recipe, Stream::new(1).draws(0..10_000));
        let [ours, coarse] = [judge.scalar::<f32>(), judge.scalar::<Coarse>()]
            .map(|(values, statuses)| judge.variant("", &values, &statuses).spectra.max);
        assert!(ours < 1e-6 && coarse > 2.0 * ours, "{ours:e} {coarse:e}");
    }
}
