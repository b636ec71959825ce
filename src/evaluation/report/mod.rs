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
mod format;
mod functions;
mod page;
mod peers;
mod progress;
mod randomness;
mod reference;
mod stopping;
mod summary;
mod tables;

use std::time::Instant;

use chrono::Utc;
use serde::Serialize;

pub use accuracy::{Accuracy, Errors, Variant};
pub use convergence::{Convergence, Curve, Merit, Point, Source};
pub use difficulty::{Difficult, Difficulty, Task};
pub use engines::EngineFacts;
pub use estimate::{Confidence, Quartiles};
pub use fidelity::{AboveOne, DataComparison, Fidelity, Shrinkage, Spread};
pub use figures::{Figure, figures};
pub use functions::Functions;
pub use page::page;
pub use peers::PeerFacts;
pub use progress::{Progress, Section, SectionTime, Watch};
pub use randomness::{CheckRow, GroupRow, Randomness};
pub use reference::Reference;
pub use stopping::{Rule, Stop};
pub use summary::Verdict;

use crate::engine::{Engine, EngineChoice, EngineError};
use crate::evaluation::stress::{self, Outcome};
use crate::model::Model;
use crate::recipe::{Recipe, RecipeError};
use crate::threads;
use engines::Subject;
use progress::Agenda;

/// Amount of measurement.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Effort {
    /// Under half a minute for a model.
    Quick,
    /// Under 3 minutes for two models.
    Usual,
    /// As long as narrow intervals take, up to half an hour for a model.
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
    /// The Python that NumPy and Numba draw with beside the engines; `None` leaves them out.
    pub python: Option<String>,
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

/// All measurements.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// Version of the program.
    pub version: &'static str,
    /// Time at which the measurements began, UTC.
    pub date: String,
    /// Duration of the measurements, seconds.
    pub seconds: f64,
    /// Whether all sections were measured. Those of an interrupted report that were not are missing from it.
    pub finished: bool,
    /// Names of the sections that are missing.
    pub missing: Vec<String>,
    /// All sections, in order, with the time that each took.
    pub sections: Vec<SectionTime>,
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
    pub randomness: Option<Randomness>,
    /// Stiff and extreme cases, for each engine that ran them.
    pub stress: Option<Vec<StressRun>>,
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
    pub convergence: Option<Convergence>,
    /// Numerical error against cost.
    pub accuracy: Option<Accuracy>,
    /// Cost against difficulty.
    pub difficulty: Option<Difficulty>,
    /// Fidelity to the method.
    pub fidelity: Option<Fidelity>,
}

/// Stiff and extreme cases on an engine.
#[derive(Clone, Debug, Serialize)]
pub struct StressRun {
    /// The engine, as an index into [`Report::engines`].
    pub engine: usize,
    /// Number of all cases.
    pub cases: usize,
    /// Outcome of each case that the time sufficed for.
    pub outcomes: Vec<Outcome>,
}

/// State that all measurements share.
struct Bench<'a> {
    targets: Vec<Subject>,
    effort: Effort,
    seed: u64,
    python: Option<String>,
    agenda: Agenda<'a>,
}

/// Makes all measurements. Where `watch` asks for an end, the report has the sections that were finished by then.
pub fn measure(options: &Options, watch: Watch) -> Result<Report, ReportError> {
    let pool = threads::pool(None).map_err(EngineError::from)?;
    pool.install(|| measure_all(options, watch))
}

fn measure_all(options: &Options, watch: Watch) -> Result<Report, ReportError> {
    let (start, date) = (Instant::now(), Utc::now().format("%Y-%m-%d %H:%M UTC").to_string());
    let mut targets = Vec::new();
    for choice in &options.engines {
        targets.push(Subject::single(Engine::new(choice)?));
    }
    targets.push(Subject::double());
    let names: Vec<String> = options.models.iter().map(|(name, _)| name.clone()).collect();
    let bench = Bench {
        targets,
        effort: options.effort,
        seed: options.seed,
        python: options.python.clone(),
        agenda: Agenda::new(&names, options.effort, options.python.is_some(), watch),
    };
    let mut models: Vec<ModelReport> =
        options.models.iter().map(|(name, model)| ModelReport::new(name, model)).collect();
    let mut shared = Shared::default();
    // It is left at the first section that is not measured.
    let _ = measure_sections(&bench, &options.models, (&mut models, &mut shared))?;
    let engines = bench.targets.iter().map(|target| target.facts.clone()).collect();
    let sections = bench.agenda.into_sections();
    let missing: Vec<String> =
        sections.iter().filter(|section| section.seconds.is_none()).map(SectionTime::name).collect();
    Ok(Report {
        version: env!("CARGO_PKG_VERSION"),
        date,
        seconds: start.elapsed().as_secs_f64(),
        finished: missing.is_empty(),
        missing,
        sections,
        effort: options.effort,
        seed: options.seed,
        cores: std::thread::available_parallelism().map_or(1, usize::from),
        engines,
        models,
        randomness: shared.randomness,
        stress: shared.stress,
    })
}

impl Report {
    /// Name of a maker of draws.
    fn source_name<'a>(&'a self, convergence: &'a Convergence, source: Source) -> &'a str {
        match source {
            Source::Engine(index) => &self.engines[index].name,
            Source::Peer(index) => &convergence.peers[index].name,
        }
    }
}

/// Results of all models together.
#[derive(Default)]
struct Shared {
    randomness: Option<Randomness>,
    stress: Option<Vec<StressRun>>,
}

impl ModelReport {
    /// A model of which nothing is measured yet.
    fn new(name: &str, model: &Model) -> ModelReport {
        ModelReport {
            name: name.to_owned(),
            kind: model.kind(),
            grid: model.grid().to_string(),
            bands: model.bands(),
            components: model.components(),
            convergence: None,
            accuracy: None,
            difficulty: None,
            fidelity: None,
        }
    }
}

/// Measures section by section, in the order of the agenda, until `None` says that somebody asked for an end.
fn measure_sections(
    bench: &Bench,
    models: &[(String, Model)],
    (reports, shared): (&mut [ModelReport], &mut Shared),
) -> Result<Option<()>, ReportError> {
    /// Measures a section into its place, or returns.
    macro_rules! section {
        ($place:expr, $measure:expr) => {
            $place = bench.agenda.section(|| $measure)?;
            if $place.is_none() {
                return Ok(None);
            }
        };
    }
    for ((name, model), report) in models.iter().zip(reports) {
        let recipe = Recipe::builder(model).build()?;
        section!(report.convergence, convergence::measure(bench, &recipe));
        let convergence = report.convergence.as_ref().expect("it was just measured");
        section!(report.accuracy, accuracy::measure(bench, &recipe, convergence));
        section!(report.difficulty, difficulty::measure(bench, model));
        section!(report.fidelity, fidelity::measure(bench, name, model));
    }
    section!(shared.randomness, randomness::measure(bench, models));
    section!(shared.stress, stress(bench));
    Ok(Some(()))
}

/// Runs the stiff and extreme cases: all on the CPU, and on adapters, of which compiling some forty shaders takes most of
/// the time, as many as the time suffices for.
fn stress(bench: &Bench) -> Result<Vec<StressRun>, ReportError> {
    let mut runs = Vec::new();
    let cases: Vec<_> = stress::cases().collect();
    let engines: Vec<_> =
        bench.targets.iter().enumerate().filter_map(|(i, t)| Some((i, t.engine()?))).collect();
    for (done, &(index, engine)) in engines.iter().enumerate() {
        let mut outcomes = Vec::new();
        let share = bench.agenda.left() / (engines.len() - done) as f64;
        let start = Instant::now();
        for (number, case) in cases.iter().enumerate() {
            bench.agenda.note(done * cases.len() + number, engines.len() * cases.len());
            bench.agenda.say(&format!("{}: {}", bench.targets[index].facts.name, case.name))?;
            if engine.adapter().is_some() && start.elapsed().as_secs_f64() > share {
                break;
            }
            outcomes.push(case.run(engine));
        }
        if !outcomes.is_empty() {
            runs.push(StressRun { engine: index, cases: cases.len(), outcomes });
        }
    }
    Ok(runs)
}
