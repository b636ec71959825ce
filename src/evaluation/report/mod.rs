//! Report on the cost of draws, their quality, and their behaviour in extreme cases, on one machine and for its
//! models.
//!
//! [`measure`] makes the numbers, which are a document of their own ([`Report`], as JSON); [`page()`] makes of them one
//! page that needs nothing else, and [`figures()`] its plots. Every engine is judged by a reference in f64 that shares no
//! random word with it, and, value by value, by the f64 draw of the same words.

mod accuracy;
mod chart;
mod convergence;
mod difficulty;
mod engines;
mod estimate;
mod fidelity;
mod figures;
mod functions;
mod page;
mod randomness;
mod summary;

use std::time::Instant;

use chrono::Utc;
use serde::Serialize;

pub use accuracy::{Accuracy, Errors, Variant};
pub use convergence::{Convergence, Merit, Point, Reference};
pub use difficulty::{Difficult, Difficulty, Task};
pub use engines::EngineFacts;
pub use estimate::Confidence;
pub use fidelity::{AboveOne, Fidelity, Shrinkage, Spread};
pub use figures::{Figure, figures};
pub use functions::Functions;
pub use page::page;
pub use randomness::{CheckRow, GroupRow, Randomness};
pub use summary::Verdict;

use crate::engine::{Engine, EngineChoice, EngineError};
use crate::evaluation::stress::{self, Outcome};
use crate::model::Model;
use crate::recipe::{Recipe, RecipeError};
use engines::Subject;

/// Amount of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Up to 10^6 draws: under a minute on 2 cores.
    Quick,
    /// Up to 10^7: minutes.
    Usual,
    /// Up to 10^8: the better part of an hour.
    Full,
}

impl Effort {
    /// Chooses one of three values.
    fn pick<T>(self, quick: T, usual: T, full: T) -> T {
        match self {
            Effort::Quick => quick,
            Effort::Usual => usual,
            Effort::Full => full,
        }
    }
}

/// Subjects of a report.
#[derive(Clone, Debug)]
pub struct Options {
    /// Models, with their names.
    pub models: Vec<(String, Model)>,
    /// Engines that draw in f32; the CPU in f64 is always there beside them.
    pub engines: Vec<EngineChoice>,
    /// Amount of measurement.
    pub effort: Effort,
    /// Seed of all random numbers.
    pub seed: u64,
}

/// Error returned where a report cannot be made.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReportError {
    /// An engine cannot be opened, or failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A model has no plain draws.
    #[error(transparent)]
    Recipe(#[from] RecipeError),
    /// The caller's watch asked for an end.
    #[error("stopped")]
    Stopped,
    /// A plot cannot be drawn.
    #[error("cannot draw {0}")]
    Plot(String),
}

/// Callback that hears from time to time what is being done; `false` from it ends the work with
/// [`ReportError::Stopped`].
pub type Watch<'a> = &'a dyn Fn(&str) -> bool;

/// All measurements.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of the program.
    pub version: &'static str,
    /// Time at which the measurements began, UTC.
    pub date: String,
    /// Duration of the measurements, seconds.
    pub seconds: f64,
    /// Amount of measurement.
    pub effort: Effort,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Number of cores that the operating system gives.
    pub cores: usize,
    /// Engines that drew.
    pub engines: Vec<EngineFacts>,
    /// Results for each model.
    pub models: Vec<ModelReport>,
    /// Tests of the generator, and of the distribution of draws.
    pub randomness: Randomness,
    /// Stiff and extreme cases, for each engine that ran them.
    pub stress: Vec<StressRun>,
}

/// Results for a model.
#[derive(Clone, Debug, Serialize)]
pub struct ModelReport {
    /// Name of the model.
    pub name: String,
    /// Kind of its spectra: illuminants or reflectances.
    pub kind: crate::SpectrumKind,
    /// Wavelengths, nm.
    pub grid: String,
    /// Number of bands.
    pub bands: usize,
    /// Number of components.
    pub components: usize,
    /// Statistical error against run time.
    pub convergence: Convergence,
    /// Numerical error against cost.
    pub accuracy: Accuracy,
    /// Cost against difficulty.
    pub difficulty: Difficulty,
    /// Fidelity to the method.
    pub fidelity: Fidelity,
}

/// Stiff and extreme cases on an engine.
#[derive(Clone, Debug, Serialize)]
pub struct StressRun {
    /// The engine, as an index into [`Report::engines`].
    pub engine: usize,
    /// Outcome of each case.
    pub outcomes: Vec<Outcome>,
}

/// State that all measurements share.
struct Bench<'a> {
    targets: Vec<Subject>,
    effort: Effort,
    seed: u64,
    watch: Watch<'a>,
}

impl Bench<'_> {
    fn say(&self, what: &str) -> Result<(), ReportError> {
        if (self.watch)(what) { Ok(()) } else { Err(ReportError::Stopped) }
    }
}

/// Makes all measurements.
pub fn measure(options: &Options, watch: Watch) -> Result<Report, ReportError> {
    let (start, date) = (Instant::now(), Utc::now().format("%Y-%m-%d %H:%M UTC").to_string());
    let mut targets = Vec::new();
    for choice in &options.engines {
        targets.push(Subject::single(Engine::new(choice)?));
    }
    targets.push(Subject::double());
    let bench = Bench { targets, effort: options.effort, seed: options.seed, watch };
    let mut models = Vec::new();
    for (name, model) in &options.models {
        models.push(report_model(&bench, name, model)?);
    }
    let randomness = randomness::measure(&bench, &options.models)?;
    let stress = stress(&bench)?;
    Ok(Report {
        version: env!("CARGO_PKG_VERSION"),
        date,
        seconds: start.elapsed().as_secs_f64(),
        effort: options.effort,
        seed: options.seed,
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        engines: bench.targets.iter().map(|target| target.facts.clone()).collect(),
        models,
        randomness,
        stress,
    })
}

fn report_model(bench: &Bench, name: &str, model: &Model) -> Result<ModelReport, ReportError> {
    let recipe = Recipe::builder(model).build()?;
    let convergence = convergence::measure(bench, name, &recipe)?;
    Ok(ModelReport {
        name: name.to_owned(),
        kind: model.kind(),
        grid: model.grid().to_string(),
        bands: model.bands(),
        components: model.components(),
        accuracy: accuracy::measure(bench, name, &recipe, &convergence)?,
        difficulty: difficulty::measure(bench, name, model)?,
        fidelity: fidelity::measure(bench, name, model)?,
        convergence,
    })
}

/// Runs the stiff and extreme cases: on the CPU alone in a quick report, of which compiling some forty shaders would
/// take most of the time.
fn stress(bench: &Bench) -> Result<Vec<StressRun>, ReportError> {
    let mut runs = Vec::new();
    for (index, target) in bench.targets.iter().enumerate() {
        let Some(engine) = target.engine() else { continue };
        if bench.effort == Effort::Quick && engine.adapter().is_some() {
            continue;
        }
        let mut outcomes = Vec::new();
        for case in stress::cases() {
            bench.say(&format!("{}: {}", target.facts.name, case.name))?;
            outcomes.push(case.run(engine));
        }
        runs.push(StressRun { engine: index, outcomes });
    }
    Ok(runs)
}
