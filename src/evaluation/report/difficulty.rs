//! Cost against difficulty: time per draw where few candidates are accepted.

use std::fmt;

use serde::Serialize;

use super::engines::Runner;
use super::estimate::Quartiles;
use super::{Bench, ReportError};
use crate::dataset::SpectrumKind;
use crate::model::Model;
use crate::program::Bounds;
use crate::random::stream::Stream;
use crate::recipe::{ProposalKind, Recipe, RecipeBuilder, RecipeError};

/// Number of runs of a recipe on an engine.
const RUNS: usize = 3;

/// Smallest number of draws of a run.
const LEAST_DRAWS: u64 = 200;

/// Cost against difficulty.
#[derive(Clone, Debug, Serialize)]
pub struct Difficulty {
    /// An entry for each recipe and engine.
    pub tasks: Vec<Task>,
    /// Recipes that were refused, and why.
    pub refused: Vec<String>,
    /// Settings that the time did not suffice for.
    pub left_out: Vec<String>,
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
    /// Number of draws of each run.
    pub draws: u64,
    /// Whether candidates came from a cover.
    pub covered: bool,
    /// Probability that a spectrum of the model is accepted.
    pub probability: f64,
    /// Share of candidates that were accepted.
    pub acceptance: f64,
    /// Nanoseconds per accepted draw, of 3 runs: their median, least and most.
    pub nanoseconds: Quartiles,
}

impl Task {
    /// Candidates per draw.
    pub fn attempts(&self) -> f64 {
        1.0 / self.acceptance
    }
}

pub(super) fn measure(bench: &Bench, model: &Model) -> Result<Difficulty, ReportError> {
    let both = |setting: Difficult| [ProposalKind::Plain, ProposalKind::Cover].map(|kind| (setting, kind));
    let all: Vec<_> = settings(bench, model).into_iter().flat_map(both).collect();
    let mut difficulty = Difficulty { tasks: Vec::new(), refused: Vec::new(), left_out: Vec::new() };
    for (done, &(setting, proposal)) in all.iter().enumerate() {
        bench.agenda.note(done, all.len());
        bench.agenda.say(&setting.to_string())?;
        if bench.agenda.left() < 0.0 {
            let name = setting.to_string();
            if !difficulty.left_out.contains(&name) {
                difficulty.left_out.push(name);
            }
            continue;
        }
        let recipe = match setting.recipe(model).proposal(proposal).build() {
            Ok(recipe) => recipe,
            // Of what plain rejection cannot reach, and models too large for a cover, the other tells.
            Err(RecipeError::Hopeless { .. } | RecipeError::NoCover { .. }) => continue,
            Err(e) => {
                difficulty.refused.push(format!("{setting}: {e}"));
                continue;
            }
        };
        // Half of the time is for shaders, trials and what cannot be divided.
        let share = 0.5 * bench.agenda.left() / (all.len() - done) as f64;
        let seconds = share / (bench.targets.len() * RUNS) as f64;
        for (engine, target) in bench.targets.iter().enumerate() {
            let mut runner = target.runner(&recipe)?;
            let covered = proposal == ProposalKind::Cover;
            difficulty.tasks.push(task(bench, &recipe, &mut runner, seconds, (setting, engine, covered))?);
        }
    }
    Ok(difficulty)
}

/// Times runs of so many seconds each.
fn task(
    bench: &Bench,
    recipe: &Recipe,
    runner: &mut Runner,
    seconds: f64,
    (setting, engine, covered): (Difficult, usize, bool),
) -> Result<Task, ReportError> {
    let stream = Stream::named(bench.seed, &setting.to_string());
    let draws_of = |candidates: f64| ((candidates * recipe.acceptance()) as u64).max(LEAST_DRAWS);
    runner.time(bench, stream.draws(0..LEAST_DRAWS))?; // compiles
    let trial = draws_of(3e4);
    let pace = runner.time(bench, stream.draws(0..trial))?.0 / trial as f64;
    let most = draws_of(bench.effort.pick(3e5, 1e7, 3e7));
    let draws = ((seconds / pace) as u64).clamp(LEAST_DRAWS, most);
    let (mut times, mut attempts) = (Vec::new(), 0);
    for run in 1..=RUNS as u64 {
        let (time, took) = runner.time(bench, stream.draws(run * draws..(run + 1) * draws))?;
        times.push(time);
        attempts += took;
    }
    Ok(Task {
        setting,
        engine,
        draws,
        covered,
        probability: recipe.probability(),
        acceptance: (RUNS as u64 * draws) as f64 / attempts as f64,
        nanoseconds: Quartiles::of(&times).times(1e9 / draws as f64),
    })
}

/// Settings from easy ones to those that no plain rejection reaches, of both kinds in turn: where the time ends, it ends
/// for both.
fn settings(bench: &Bench, model: &Model) -> Vec<Difficult> {
    let scales = bench.effort.pick(
        vec![1.0, 4.0, 25.0, 100.0, 1e4],
        vec![0.01, 1.0, 4.0, 25.0, 100.0, 1e4, 1e6],
        vec![0.01, 0.1, 1.0, 2.0, 4.0, 10.0, 25.0, 50.0, 100.0, 150.0, 250.0, 1e3, 1e4, 1e5, 1e6],
    );
    let targets = match model.kind() {
        SpectrumKind::Illuminant => vec![],
        SpectrumKind::Reflectance => bench.effort.pick(
            vec![0.2, 0.6, 0.9, 0.95, 0.992],
            vec![0.2, 0.6, 0.9, 0.95, 0.992],
            vec![0.1, 0.2, 0.4, 0.6, 0.8, 0.9, 0.95, 0.97, 0.98, 0.985, 0.99, 0.992],
        ),
    };
    let mut targets = targets.into_iter().map(Difficult::Lrv);
    let both = |scale| [Some(Difficult::CovarianceScale(scale)), targets.next()];
    scales.into_iter().flat_map(both).flatten().collect()
}
