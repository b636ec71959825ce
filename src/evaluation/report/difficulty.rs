//! Cost against difficulty: time per draw where few candidates are accepted.

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

/// A recipe on an engine.
#[derive(Clone, Debug, Serialize)]
pub struct Task {
    /// Name of the recipe: the setting that makes it difficult.
    pub name: String,
    /// Whether that setting is the covariance's scale; else it is the target LRV.
    pub by_scale: bool,
    /// The engine, as an index into the report's.
    pub engine: usize,
    /// Number of draws of each run.
    pub draws: u64,
    /// Whether candidates came from a cover.
    pub covered: bool,
    /// Probability that a spectrum of the model is accepted.
    pub probability: f64,
    /// Share of candidates that were accepted.
    pub acceptance: f64,
    /// Nanoseconds per accepted draw, the median of 3 runs.
    pub nanoseconds: f64,
}

impl Task {
    /// Candidates per draw.
    pub fn attempts(&self) -> f64 {
        1.0 / self.acceptance
    }
}

pub(super) fn measure(bench: &Bench, name: &str, model: &Model) -> Result<Difficulty, ReportError> {
    let (mut tasks, mut refused) = (Vec::new(), Vec::new());
    let candidates = bench.effort.pick(3e5, 1e7, 3e7);
    let both = |(task, by_scale, builder): (String, bool, RecipeBuilder)| {
        [ProposalKind::Plain, ProposalKind::Cover]
            .map(|p| (task.clone(), by_scale, p, builder.clone().proposal(p)))
    };
    for (task, by_scale, proposal, builder) in recipes(bench, model).into_iter().flat_map(both) {
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
                name: task.clone(),
                by_scale,
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

/// Makes recipes from easy ones to those that no plain rejection reaches.
fn recipes(bench: &Bench, model: &Model) -> Vec<(String, bool, RecipeBuilder)> {
    let scales = bench.effort.pick(
        vec![0.01, 1.0, 4.0, 25.0, 100.0, 1e4, 1e6],
        vec![0.01, 0.1, 1.0, 2.0, 4.0, 10.0, 25.0, 50.0, 100.0, 250.0, 1e3, 1e4, 1e5, 1e6],
        vec![0.01, 0.1, 1.0, 2.0, 4.0, 10.0, 25.0, 50.0, 100.0, 150.0, 250.0, 1e3, 1e4, 1e5, 1e6],
    );
    let scaled = |c: f64| (format!("covariance × {c}"), true, Recipe::builder(model).covariance_scale(c));
    let targets = match model.kind() {
        SpectrumKind::Illuminant => vec![],
        SpectrumKind::Reflectance => bench.effort.pick(
            vec![0.2, 0.6, 0.9, 0.95, 0.99, 0.992],
            vec![0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.99, 0.992],
            vec![0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.985, 0.99, 0.992],
        ),
    };
    let target =
        |y: f64| (format!("LRV {y}, scaled"), false, Recipe::builder(model).lrv(y).bounds(Bounds::Scaled));
    scales.into_iter().map(scaled).chain(targets.into_iter().map(target)).collect()
}
