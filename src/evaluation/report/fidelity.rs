//! Fidelity to the method: the variance that components explain, the effect of rejection on the covariance, and the
//! share of draws that scaling to a luminous reflectance takes out of the physical range.

use nalgebra::DMatrix;
use serde::Serialize;

use super::estimate::Moments;
use super::{Bench, ReportError};
use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
use crate::evaluation::comparison::determinant_ratio;
use crate::grid::Extrapolation;
use crate::model::Model;
use crate::program::Bounds;
use crate::random::stream::Stream;
use crate::recipe::Recipe;

/// Fidelity to the method.
#[derive(Clone, Debug, Serialize)]
pub struct Fidelity {
    /// Share of the data's variance that each component explains.
    pub explained: Vec<f64>,
    /// Spreads of the weights: of the data, of the Gaussian and of accepted draws.
    pub spreads: Vec<Spread>,
    /// Effect of rejection on the covariance.
    pub shrinkage: Vec<Shrinkage>,
    /// Share of draws that exceed 1 under the bounds `base`.
    pub above_one: Vec<AboveOne>,
}

/// Spread of weights.
#[derive(Clone, Debug, Serialize)]
pub struct Spread {
    /// Source of the weights.
    pub name: String,
    /// Number of spectra; `None` for a formula.
    pub count: Option<u64>,
    /// Standard deviation of each weight.
    pub deviations: Vec<f64>,
    /// Largest correlation of two weights.
    pub correlation: f64,
}

/// Covariance of accepted draws relative to that of all candidates.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Shrinkage {
    /// Factor of the covariance.
    pub scale: f64,
    /// Number of draws.
    pub draws: u64,
    /// Share of candidates that were accepted.
    pub acceptance: f64,
    /// det(covariance of accepted weights) / det(covariance of candidates).
    pub determinant_ratio: f64,
    /// Standard error of the ratio, were the accepted weights normal.
    pub error: f64,
}

/// Draws of a target LRV under the bounds `base`.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct AboveOne {
    /// Target LRV.
    pub lrv: f64,
    /// Number of draws.
    pub draws: u64,
    /// Share of draws that scaling takes to 1 or above in some band.
    pub share: f64,
}

pub(super) fn measure(bench: &Bench, name: &str, model: &Model) -> Result<Fidelity, ReportError> {
    let draws = bench.effort.pick(50_000, 500_000, 2_000_000);
    let gaussian = &model.parts().weight_covariance;
    let mut spreads: Vec<Spread> = data(name, model).into_iter().collect();
    spreads.push(spread("the Gaussian", None, gaussian));
    let mut shrinkage = Vec::new();
    for step in 0..bench.effort.pick(7, 13, 13) {
        let scale = 10f64.powf(-3.0 + 3.0 * f64::from(step) / f64::from(bench.effort.pick(6, 12, 12)));
        bench.say(&format!("{name}: the covariance of draws of covariance × {scale:.3}"))?;
        let Ok(recipe) = Recipe::builder(model).covariance_scale(scale).build() else { continue };
        let moments = accepted(bench, &recipe, draws)?;
        let estimate = moments.estimate();
        let ratio = determinant_ratio(&estimate.covariance, &(gaussian * scale));
        if step + 1 == bench.effort.pick(7, 13, 13) {
            spreads.push(spread("accepted draws", Some(draws), &estimate.covariance));
        }
        shrinkage.push(Shrinkage {
            scale,
            draws,
            acceptance: estimate.acceptance,
            determinant_ratio: ratio,
            error: ratio * (2.0 * model.components() as f64 / draws as f64).sqrt(),
        });
    }
    Ok(Fidelity {
        explained: model.parts().explained_variance.clone(),
        spreads,
        shrinkage,
        above_one: above_one(bench, name, model, draws)?,
    })
}

/// Draws with the first engine.
fn accepted<'a>(bench: &Bench, recipe: &'a Recipe, draws: u64) -> Result<Moments<'a>, ReportError> {
    let mut moments = Moments::new(recipe.model());
    let range = Stream::named(bench.seed, "fidelity").draws(0..draws);
    moments.attempts =
        bench.targets[0].runner(recipe)?.draw(bench, range, &mut |values, _| moments.add(values))?;
    Ok(moments)
}

fn above_one(bench: &Bench, name: &str, model: &Model, draws: u64) -> Result<Vec<AboveOne>, ReportError> {
    let mut all = Vec::new();
    if model.kind() == SpectrumKind::Illuminant {
        return Ok(all);
    }
    for step in 1..=9 {
        let lrv = 0.1 * f64::from(step);
        bench.say(&format!("{name}: LRV {lrv:.1} under the bounds base"))?;
        let Ok(recipe) = Recipe::builder(model).lrv(lrv).bounds(Bounds::Base).build() else { continue };
        let range = Stream::named(bench.seed, "above one").draws(0..draws);
        let mut count = 0;
        bench.targets[0].runner(&recipe)?.draw(bench, range, &mut |_, statuses| {
            count += statuses.iter().filter(|t| t.above_one()).count();
        })?;
        all.push(AboveOne { lrv, draws, share: count as f64 / draws as f64 });
    }
    Ok(all)
}

fn spread(name: &str, count: Option<u64>, covariance: &DMatrix<f64>) -> Spread {
    let deviations: Vec<f64> = covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
    let pairs = (0..deviations.len()).flat_map(|i| (0..i).map(move |j| (i, j)));
    let correlation = |(i, j)| (covariance[(i, j)] / deviations[i] / deviations[j]).abs();
    Spread {
        name: name.to_owned(),
        count,
        correlation: pairs.map(correlation).fold(0.0, f64::max),
        deviations,
    }
}

/// Spread of the data that a built-in model was fitted to, where those are built in too.
fn data(name: &str, model: &Model) -> Option<Spread> {
    if !name.starts_with("munsell-vrhel") {
        return None;
    }
    let tables = [BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()];
    let data = Dataset::new(&tables, model.grid(), Extrapolation::Error).ok()?;
    let count = data.spectra().ncols();
    let weights = DMatrix::from_columns(
        &data.spectra().column_iter().map(|s| model.project(s.into_owned().as_slice())).collect::<Vec<_>>(),
    );
    let mean = weights.column_mean();
    let centred = DMatrix::from_fn(weights.nrows(), count, |i, j| weights[(i, j)] - mean[i]);
    let covariance = &centred * centred.transpose() / count as f64;
    Some(spread("the data", Some(count as u64), &covariance))
}
