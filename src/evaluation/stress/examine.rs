//! Tools that the cases share: models made by hand, and comparisons of draws with those in f64 of the same words.

use std::f64::consts::PI;

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use super::{Answer, within};
use crate::dataset::SpectrumKind;
use crate::draw_status::DrawStatus;
use crate::engine::{Engine, EngineError};
use crate::evaluation::statistics::rows;
use crate::grid::Grid;
use crate::model::{Distribution, Model, ModelParts, Normalization};
use crate::program::Bounds;
use crate::random::stream::{DrawRange, Stream};
use crate::recipe::{Recipe, RecipeBuilder, RecipeError};

/// Number of draws per case.
pub(super) const DRAWS: u64 = 10_000;

/// Largest error of a value, relative to the size of its recipe: some ten roundings, and normals good to 4e-7.
pub(super) const ERROR: f64 = 1e-6;

/// Largest error relative to the spectrum's peak, where there is a target LRV: the darkest candidates are scaled up
/// tenfold and more, and their errors with them.
pub(super) const SCALED_ERROR: f64 = 1e-5;

/// Largest number of draws of a case that may take another candidate than in f64 (once in 10^6 is expected).
const FLIPS: usize = 1;

/// Number of standard errors that an estimate may be off: a sound one is once in 10^9 times.
pub(super) const SIGMAS: f64 = 6.1;

pub(super) fn builtin(name: &str) -> Model {
    Model::builtin(name).expect("it is built in")
}

/// Returns k orthonormal rows of n values: cosines of 0, 1/2, 1, ... periods.
pub(super) fn cosines(k: usize, n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(k, n, |j, b| {
        let norm = if j == 0 { 1.0 } else { 2.0 } / n as f64;
        norm.sqrt() * (PI * (b as f64 + 0.5) * j as f64 / n as f64).cos()
    })
}

/// Makes a model of spectra around `mean` with the weights' covariance, on cosines.
pub(super) fn model(kind: SpectrumKind, mean: Vec<f64>, covariance: DMatrix<f64>) -> Model {
    let basis = cosines(covariance.nrows(), mean.len());
    Model::new(parts(kind, mean, basis, covariance)).expect("the parts are a model")
}

pub(super) fn parts(
    kind: SpectrumKind,
    mean: Vec<f64>,
    basis: DMatrix<f64>,
    covariance: DMatrix<f64>,
) -> ModelParts {
    let k = basis.nrows();
    let step = if mean.len() > 100 { 300.0 / mean.len() as f64 } else { 5.0 };
    ModelParts {
        kind,
        grid: Grid::new(400.0, step, mean.len()).expect("it is a grid"),
        mean: mean.into(),
        basis,
        weight_mean: DVector::zeros(k),
        weight_covariance: covariance,
        explained_variance: vec![1.0 / k as f64; k],
        normalization: Normalization::None,
        powers: Vec::new(),
        distribution: Distribution::Gaussian,
        sources: Vec::new(),
    }
}

pub(super) fn diagonal(variances: impl IntoIterator<Item = f64>) -> DMatrix<f64> {
    DMatrix::from_diagonal(&DVector::from_vec(variances.into_iter().collect()))
}

/// Draws with an engine: the spectra one after another, and the statuses.
pub(super) fn draw(
    engine: &Engine,
    recipe: &Recipe,
    draws: DrawRange,
) -> Result<(Vec<f32>, Vec<DrawStatus>), String> {
    let (mut spectra, mut statuses) = (Vec::new(), Vec::new());
    let drawn = engine.draw(recipe, draws, |batch| {
        for (row, status) in rows(&batch) {
            spectra.extend_from_slice(row);
            statuses.push(status);
        }
        Ok::<_, EngineError>(())
    });
    drawn.map_err(|e| format!("refused while drawing: {e}"))?;
    match statuses.len() as u64 {
        found if found == draws.count => Ok((spectra, statuses)),
        found => Err(format!("{found} draws came of {}", draws.count)),
    }
}

/// Comparison of draws with those in f64.
pub(super) struct Examined {
    /// Largest error of a value, relative to the size of the recipe, or to the spectrum's peak where there is a
    /// target.
    pub(super) error: f64,
    /// Largest error of the LRV, where there is a target.
    pub(super) lrv_error: f64,
    /// Largest number of candidates that a draw took.
    pub(super) most_attempts: u32,
    /// Share of candidates that were accepted.
    pub(super) acceptance: f64,
}

/// Compares draws with those in f64. An error where one is not finite, not physical, or too many took another
/// candidate.
pub(super) fn examine(engine: &Engine, recipe: &Recipe, draws: DrawRange) -> Result<Examined, String> {
    let (spectra, statuses) = draw(engine, recipe, draws)?;
    let program = recipe.program();
    let bounded = program.kind == SpectrumKind::Reflectance && !program.may_exceed_one();
    let limit = if bounded { 1.0 } else { f32::INFINITY };
    if let Some(value) = spectra.iter().find(|&&v| !(v > 0.0 && v < limit)) {
        return Err(format!("a value of {value:e}, which is not physical"));
    }
    let size = size(recipe);
    let oracle = recipe.scalar_sampler::<f64>();
    let rows = spectra.par_chunks_exact(recipe.model().bands()).zip(&statuses).enumerate();
    let errors: Vec<_> = rows
        .map(|(i, (row, status))| {
            let index = draws.first.wrapping_add(i as u64);
            let exact = oracle.draw(draws.stream, index);
            if exact.status().attempts() != status.attempts() {
                return None;
            }
            let spectrum = exact.spectrum();
            let peak = || spectrum.iter().copied().fold(0.0, f64::max);
            let size = if program.target.is_some() { peak() } else { size };
            let errors = row.iter().zip(spectrum).map(|(&a, b)| (f64::from(a) - b).abs() / size);
            let lrv = program.target.as_ref().map_or(0.0, |target| {
                let lrv: f64 = target.weights.iter().zip(row).map(|(w, &s)| w * f64::from(s)).sum();
                (lrv / target.lrv.largest() - 1.0).abs()
            });
            Some((errors.fold(0.0, f64::max), lrv))
        })
        .collect();
    let flips = errors.iter().filter(|e| e.is_none()).count();
    if flips > FLIPS {
        return Err(format!("{flips} of {} draws took another candidate than in f64", statuses.len()));
    }
    let (error, lrv_error) =
        errors.into_iter().flatten().fold((0f64, 0f64), |(a, b), (c, d)| (a.max(c), b.max(d)));
    let attempts: u64 = statuses.iter().map(|t| u64::from(t.attempts())).sum();
    Ok(Examined {
        error,
        lrv_error,
        most_attempts: statuses.iter().map(|t| t.attempts()).max().unwrap_or(0),
        acceptance: statuses.len() as f64 / attempts as f64,
    })
}

/// Typical size of the largest term of a spectrum: a band's mean, and one deviation.
fn size(recipe: &Recipe) -> f64 {
    let program = recipe.program();
    let deviation = |b: usize| program.spectrum.gain.iter().map(|gain| gain[b] * gain[b]).sum::<f64>().sqrt();
    (0..program.bands()).map(|b| program.spectrum.offset[b].abs() + deviation(b)).fold(0.0, f64::max)
}

/// Builds a recipe that must be accepted.
pub(super) fn build(builder: RecipeBuilder) -> Result<Recipe, String> {
    builder.build().map_err(|e| format!("refused: {e}"))
}

/// Checks a recipe whose draws must be those in f64 to within `bound`.
pub(super) fn drawn(engine: &Engine, builder: RecipeBuilder, bound: f64) -> Answer {
    let recipe = build(builder)?;
    let examined = examine(engine, &recipe, Stream::named(1, "stress").draws(0..DRAWS))?;
    within(format!("{DRAWS} draws, {}", attempts(&examined)), examined.error, bound)
}

/// Describes the candidates that draws took.
pub(super) fn attempts(examined: &Examined) -> String {
    match examined.most_attempts {
        1 => "each at the first attempt".to_owned(),
        most => format!("{:.4} of candidates accepted, at most {most} attempts", examined.acceptance),
    }
}

/// Checks a recipe that must be refused for a reason.
pub(super) fn refused(builder: RecipeBuilder, reason: fn(&RecipeError) -> bool) -> Answer {
    match builder.build() {
        Err(e) if reason(&e) => super::good(format!("refused: {}", first_sentence(&e.to_string()))),
        Err(e) => Err(format!("refused for another reason: {e}")),
        Ok(recipe) => Err(format!("built, with an acceptance of {:.1e}", recipe.acceptance())),
    }
}

/// Part of a message before its advice.
pub(super) fn first_sentence(message: &str) -> &str {
    message.split("; ").next().unwrap_or(message)
}

/// Joins the answers of several parts: their results, once where they are equal, and the error closest to its bound.
pub(super) fn all(parts: impl IntoIterator<Item = (String, Answer)>) -> Answer {
    let mut whole = super::Good::default();
    let mut results: Vec<(String, String)> = Vec::new();
    for (name, answer) in parts {
        let part = answer.map_err(|e| format!("{name}: {e}"))?;
        match results.iter_mut().find(|(_, result)| *result == part.result) {
            Some((names, _)) => *names += &format!(", {name}"),
            None => results.push((name, part.result)),
        }
        let closeness = |error: &Option<(f64, f64)>| error.map_or(-1.0, |(error, bound)| error / bound);
        if closeness(&part.error) > closeness(&whole.error) {
            whole.error = part.error;
        }
    }
    let results = results.into_iter().map(|(names, result)| format!("{names}: {result}"));
    whole.result = results.collect::<Vec<_>>().join("; ");
    Ok(whole)
}

/// Builds a recipe with bounds and a target.
pub(super) fn target(model: &Model, lrv: f64, bounds: Bounds) -> RecipeBuilder {
    Recipe::builder(model).lrv(lrv).bounds(bounds)
}
