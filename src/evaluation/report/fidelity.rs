//! Fidelity to the method: the variance that components explain, the effect of rejection on the covariance, how far
//! draws are from the data, and the share of draws that scaling to a luminous reflectance takes out of the physical range.

use nalgebra::DMatrix;
use serde::Serialize;

use super::estimate::Moments;
use super::{Bench, Effort, ReportError};
use crate::dataset::{Dataset, SpectrumKind, Table};
use crate::evaluation::comparison::{Comparison, ComparisonFigures, determinant_ratio};
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
    /// Spreads of the weights: of the Gaussian and of accepted draws.
    pub spreads: Vec<Spread>,
    /// Comparison of draws with the data, for models whose data are built in.
    pub data: Option<DataComparison>,
    /// Effect of rejection on the covariance.
    pub shrinkage: Vec<Shrinkage>,
    /// Share of draws that exceed 1 under the bounds `base`.
    pub above_one: Vec<AboveOne>,
}

/// Comparison of accepted draws with the data that a model was fitted to.
#[derive(Clone, Debug, Serialize)]
pub struct DataComparison {
    /// Names of the built-in tables.
    pub sources: Vec<&'static str>,
    /// Figures of the comparison.
    pub figures: ComparisonFigures,
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
    let precision = Precision::of(bench.effort);
    let gaussian = &model.parts().weight_covariance;
    let mut spreads = vec![spread("the Gaussian", None, gaussian)];
    let mut shrinkage = Vec::new();
    // The ratio's relative standard error is sqrt(2 k / n).
    let draws = (2.0 * model.components() as f64 / precision.ratio.powi(2)).ceil() as u64;
    for step in 0..=precision.scales {
        let scale = 10f64.powf(-3.0 + 3.0 * f64::from(step) / f64::from(precision.scales));
        bench.agenda.say(&format!("the covariance of draws of covariance × {scale:.3}"))?;
        let Ok(recipe) = Recipe::builder(model).covariance_scale(scale).build() else { continue };
        let moments = accepted(bench, &recipe, draws)?;
        let estimate = moments.estimate();
        let ratio = determinant_ratio(&estimate.covariance, &(gaussian * scale));
        if step == precision.scales {
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
    bench.agenda.say("draws beside the data")?;
    Ok(Fidelity {
        explained: model.parts().explained_variance.clone(),
        spreads,
        shrinkage,
        above_one: above_one(bench, model, (0.25 / precision.share.powi(2)).ceil() as u64)?,
        data: data(bench, name, model),
    })
}

/// Standard errors that decide how much is drawn.
struct Precision {
    /// Standard error of a ratio of determinants, relative to it.
    ratio: f64,
    /// Largest standard error of a share of draws.
    share: f64,
    /// Number of steps between the smallest and the largest covariance.
    scales: u32,
}

impl Precision {
    fn of(effort: Effort) -> Precision {
        Precision {
            ratio: effort.pick(0.02, 0.01, 0.003),
            share: effort.pick(0.005, 0.0025, 0.001),
            scales: effort.pick(6, 9, 12),
        }
    }
}

/// Draws with the first engine.
fn accepted<'a>(bench: &Bench, recipe: &'a Recipe, draws: u64) -> Result<Moments<'a>, ReportError> {
    let mut moments = Moments::new(recipe.model());
    let range = Stream::named(bench.seed, "fidelity").draws(0..draws);
    let attempts =
        bench.targets[0].runner(recipe)?.draw(bench, range, &mut |values, _| moments.add(values))?;
    moments.attempts = attempts as f64;
    Ok(moments)
}

fn above_one(bench: &Bench, model: &Model, draws: u64) -> Result<Vec<AboveOne>, ReportError> {
    let mut all = Vec::new();
    if model.kind() == SpectrumKind::Illuminant {
        return Ok(all);
    }
    for step in 1..=9 {
        let lrv = 0.1 * f64::from(step);
        bench.agenda.say(&format!("LRV {lrv:.1} under the bounds base"))?;
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

/// Comparison of draws with the data that a built-in model was fitted to, where those are built in too.
fn data(bench: &Bench, name: &str, model: &Model) -> Option<DataComparison> {
    let sources = Model::builtin_data(name).ok()?.tables;
    let tables: Vec<Table> = sources.iter().map(|table| table.table()).collect();
    let data = Dataset::new(&tables, model.grid().clone(), Extrapolation::Error).ok()?;
    let recipe = Recipe::builder(model).build().ok()?;
    let draws = bench.effort.pick(10_000, 50_000, 200_000);
    let comparison = Comparison::new(&recipe, &data, Stream::named(bench.seed, "data"), draws).ok()?;
    Some(DataComparison {
        sources: sources.iter().map(|table| table.name()).collect(),
        figures: comparison.figures(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::report::{Agenda, Effort};

    fn fidelity(name: &str, model: &str) -> Fidelity {
        let watch = |_: &_| true;
        let bench = Bench {
            targets: vec![crate::evaluation::report::engines::Subject::double()],
            effort: Effort::Quick,
            seed: 1,
            python: None,
            agenda: Agenda::new(&[name.to_owned()], Effort::Quick, false, &watch),
        };
        measure(&bench, name, &Model::builtin(model).unwrap()).unwrap()
    }

    #[test]
    fn builtin_models_are_held_beside_their_data() {
        let data = fidelity("granada", "granada").data.unwrap();
        assert_eq!((data.sources, data.figures.spectra, data.figures.draws), (vec!["granada"], 2600, 10_000));
        assert!(data.figures.candidates.determinant_ratio.is_some());
        assert_eq!(data.figures.colours.len(), 2);
    }

    /// The name of a file says nothing about its data.
    #[test]
    fn other_models_have_no_data() {
        let fidelity = fidelity("munsell-vrhel.json", "granada");
        assert!(fidelity.data.is_none() && fidelity.above_one.is_empty());
        // 2 k / n is the square of the relative error.
        assert!(fidelity.shrinkage.iter().all(|s| s.draws == 30_000));
    }
}
