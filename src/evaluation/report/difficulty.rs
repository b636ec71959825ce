//! Cost against difficulty: what a draw costs where few candidates are accepted.

use std::fmt;

use serde::Serialize;

use super::estimate::median;
use super::{Bench, ReportError};
use crate::dataset::SpectrumKind;
use crate::model::Model;
use crate::program::Bounds;
use crate::random::stream::Stream;
use crate::recipe::{ProposalKind, Recipe, RecipeBuilder, RecipeError};

/// Cost against difficulty.
#[derive(Clone, Debug, Serialize)]
pub struct Difficulty {
    /// An entry for each recipe and engine.
    pub tasks: Vec<Task>,
    /// Recipes that were refused, and why.
    pub refused: Vec<String>,
}

/// Setting that makes acceptable spectra unlikely.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Difficult {
    /// Factor of the weights' covariance.
    CovarianceScale(f64),
    /// Target luminous reflectance, with bounds on the scaled spectrum.
    Lrv(f64),
}

impl Difficult {
    fn recipe(self, model: &Model) -> RecipeBuilder {
        match self {
            Difficult::CovarianceScale(factor) => Recipe::builder(model).covariance_scale(factor),
            Difficult::Lrv(lrv) => Recipe::builder(model).lrv(lrv).bounds(Bounds::Scaled),
        }
    }
}

impl fmt::Display for Difficult {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Difficult::CovarianceScale(factor) => write!(f, "covariance × {factor}"),
            Difficult::Lrv(lrv) => write!(f, "LRV {lrv}, scaled"),
        }
    }
}

/// A recipe on an engine.
#[derive(Clone, Debug, Serialize)]
pub struct Task {
    /// The setting that makes it difficult.
    pub setting: Difficult,
    /// The engine, as an index into the report's.
    pub engine: usize,
    /// How many draws each run made.
    pub draws: u64,
    /// Whether candidates came from a cover.
    pub covered: bool,
    /// The probability that a spectrum of the model is accepted.
    pub probability: f64,
    /// The share of candidates that were accepted.
    pub acceptance: f64,
    /// Nanoseconds an accepted draw, the median of 3 runs.
    pub nanoseconds: f64,
}

impl Task {
    /// Candidates for each draw.
    pub fn attempts(&self) -> f64 {
        1.0 / self.acceptance
    }
}

pub(super) fn measure(bench: &Bench, name: &str, model: &Model) -> Result<Difficulty, ReportError> {
    let (mut tasks, mut refused) = (Vec::new(), Vec::new());
    let candidates = bench.effort.pick(3e5, 1e7, 3e7);
    let both = |setting: Difficult| [ProposalKind::Plain, ProposalKind::Cover].map(|kind| (setting, kind));
    for (setting, proposal) in settings(bench, model).into_iter().flat_map(both) {
        let (task, builder) = (setting.to_string(), setting.recipe(model).proposal(proposal));
        let recipe = match builder.build() {
            Ok(recipe) => recipe,
            // Of what plain rejection cannot reach, and models too large for a cover, the other tells.
            Err(RecipeError::Hopeless { .. } | RecipeError::NoCover { .. }) => continue,
            Err(e) => {
                refused.push(format!("{task}: {e}"));
                continue;
            }
        };
        let covered = proposal == ProposalKind::Cover;
        bench.say(&format!("{name}: {task}"))?;
        for (engine, target) in bench.targets.iter().enumerate() {
            // f64 is ten times as slow, and no one draws with it.
            let share = if target.engine().is_some() { 1.0 } else { 0.1 };
            let draws = ((share * candidates * recipe.acceptance()) as u64).max(200);
            let mut runner = target.runner(&recipe)?;
            let stream = Stream::named(bench.seed, &task);
            runner.time(bench, stream.draws(0..draws))?; // compiles
            let (mut seconds, mut attempts) = (Vec::new(), 0);
            for run in 1..=3 {
                let (time, took) = runner.time(bench, stream.draws(run * draws..(run + 1) * draws))?;
                seconds.push(time);
                attempts += took;
            }
            tasks.push(Task {
                setting,
                engine,
                draws,
                covered,
                probability: recipe.probability(),
                acceptance: 3.0 * draws as f64 / attempts as f64,
                nanoseconds: 1e9 * median(&seconds) / draws as f64,
            });
        }
    }
    Ok(Difficulty { tasks, refused })
}

/// Settings from easy ones to those that no plain rejection reaches.
fn settings(bench: &Bench, model: &Model) -> Vec<Difficult> {
    let scales = bench.effort.pick(
        vec![0.01, 1.0, 4.0, 25.0, 100.0, 1e4, 1e6],
        vec![0.01, 0.1, 1.0, 2.0, 4.0, 10.0, 25.0, 50.0, 100.0, 250.0, 1e3, 1e4, 1e5, 1e6],
        vec![0.01, 0.1, 1.0, 2.0, 4.0, 10.0, 25.0, 50.0, 100.0, 150.0, 250.0, 1e3, 1e4, 1e5, 1e6],
    );
    let targets = match model.kind() {
        SpectrumKind::Illuminant => vec![],
        SpectrumKind::Reflectance => bench.effort.pick(
            vec![0.2, 0.6, 0.9, 0.95, 0.99, 0.992],
            vec![0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.992],
            vec![0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.985, 0.99, 0.992],
        ),
    };
    let targets = targets.into_iter().map(Difficult::Lrv);
    scales.into_iter().map(Difficult::CovarianceScale).chain(targets).collect()
}
