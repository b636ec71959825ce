//! `spectroll sample`: draws of a model, into a data set.

use std::io::{self, Write};
use std::ops::Range;
use std::path::Path;
use std::time::Instant;

use serde::Serialize;
use spectroll::output::{Schema, SetStatus};
use spectroll::{DrawRange, DrawSummary, Engine, EngineChoice, EngineError, Recipe, Session, Stream};

use super::dry_run::DryRun;
use super::request::{self, Request};
use super::run::{Run, Source, Window};
use super::sink::OutputArguments;
use super::{EngineArguments, Usage, count, grouped, model};

/// Draw spectra from a model
///
/// Draw i depends on the model, the options below, the seed, the stream and i alone: any part of a data set can be
/// made again, or on another machine, with --start or --shard.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file, or munsell-vrhel, granada, munsell-vrhel-5nm, granada-5nm
    #[arg(value_name = "MODEL")]
    model: String,
    /// How many spectra (1000000 and 1e6 are the same)
    #[arg(short = 'n', long, value_name = "COUNT", value_parser = count, allow_negative_numbers = true)]
    count: u64,
    /// The seed of the random numbers
    #[arg(long, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// The index of the first draw
    #[arg(long, default_value_t = 0, value_parser = count, allow_negative_numbers = true)]
    start: u64,
    /// A name that sets these draws apart from others of the same seed
    #[arg(long, value_name = "NAME")]
    stream: Option<String>,
    #[command(flatten)]
    request: Request,
    #[command(flatten)]
    pub(super) output: OutputArguments,
    #[command(flatten)]
    engine: EngineArguments,
    /// Say what would be made, how large it would be and how long it would take, and make nothing
    #[arg(long)]
    dry_run: bool,
    /// Print the summary as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Do not print progress and summary
    #[arg(short, long)]
    quiet: bool,
}

/// What a run made and how, for people and programs.
#[derive(Serialize)]
struct Report {
    model: String,
    output: String,
    bands: usize,
    wavelengths: String,
    seed: u64,
    stream: Option<String>,
    start: u64,
    #[serde(flatten)]
    summary: DrawSummary,
    acceptance: Option<f64>,
    /// Whether the data set is there; not as long as other processes have parts of it to make.
    complete: bool,
    seconds: f64,
    draws_per_second: f64,
    engine: String,
    version: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let choice = arguments.engine.choice().unwrap_or_default();
    let target = arguments.output.target()?;
    let model = model(&arguments.model)?;
    check_size(arguments, model.bands())?;
    let recipe = arguments.request.recipe(&model)?;
    let stream = match &arguments.stream {
        Some(name) => Stream::named(arguments.seed, name),
        None => Stream::new(arguments.seed),
    };
    let draws = DrawRange { stream, first: arguments.start, count: arguments.count };
    let schema = schema(arguments, &recipe, draws);
    arguments.output.check(target, &schema)?;

    let engine = Engine::with_threads(&choice, arguments.engine.threads)?;
    if arguments.dry_run {
        let dry_run = DryRun::new(&arguments.output, target, &schema, &recipe, &engine)?;
        return dry_run.print(arguments.json);
    }
    let why = match (&choice, engine.adapter()) {
        (EngineChoice::Auto, None) => ", no graphics hardware was found",
        _ => "",
    };

    let start = Instant::now();
    let mut rows = Rows::new(&recipe, &engine, draws)?;
    let run = Run {
        output: &arguments.output,
        target,
        schema,
        spd: (request::spd_name(&arguments.request, model.kind()), draws.first),
        companions: &[("model.json", &model.to_json())],
        engine: &engine,
        quiet: arguments.quiet,
    };
    let outcome = run.open(&mut rows)?.make(&mut rows)?;
    let summary = rows.summary;
    let seconds = start.elapsed().as_secs_f64();
    report(
        arguments,
        outcome,
        &Report {
            model: arguments.model.clone(),
            output: arguments.output.output.display().to_string(),
            bands: model.bands(),
            wavelengths: model.grid().to_string(),
            seed: arguments.seed,
            stream: arguments.stream.clone(),
            start: arguments.start,
            summary,
            acceptance: summary.acceptance(),
            complete: outcome == SetStatus::Sealed,
            seconds,
            draws_per_second: summary.draws as f64 / seconds,
            engine: format!("{engine}{why}"),
            version: env!("CARGO_PKG_VERSION"),
        },
    )
}

/// What the data set is to hold, and what it is made from.
fn schema(arguments: &Arguments, recipe: &Recipe, draws: DrawRange) -> Schema {
    // A folder on this machine is nobody else's business.
    let name = Path::new(&arguments.model).file_name().unwrap_or_default().to_string_lossy();
    let stream = (&arguments.stream, draws.stream);
    Schema {
        attributes: request::attributes(&name, &arguments.request, recipe, stream, draws.first),
        ..request::schema(recipe, draws.count, arguments.output.element())
    }
}

/// Draws of a recipe as rows of a data set.
pub(super) struct Rows<'a> {
    recipe: &'a Recipe,
    session: Session<'a>,
    draws: DrawRange,
    /// What those took that were drawn.
    pub(super) summary: DrawSummary,
}

impl<'a> Rows<'a> {
    pub(super) fn new(
        recipe: &'a Recipe,
        engine: &'a Engine,
        draws: DrawRange,
    ) -> Result<Rows<'a>, EngineError> {
        Ok(Rows { recipe, session: engine.session(recipe)?, draws, summary: DrawSummary::default() })
    }
}

impl Source for Rows<'_> {
    fn rounding(&mut self) -> Result<String, EngineError> {
        request::rounding(self.recipe, &mut self.session)
    }

    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> anyhow::Result<()> {
        let first = self.draws.first.wrapping_add(rows.start);
        let draws = DrawRange { first, count: rows.end - rows.start, ..self.draws };
        self.summary += self.session.draw(draws, |batch| {
            let columns = request::columns(self.recipe, &batch);
            window(&columns.iter().map(|column| &**column).collect::<Vec<_>>(), batch.draws.count)
        })?;
        Ok(())
    }
}

fn report(arguments: &Arguments, outcome: SetStatus, made: &Report) -> anyhow::Result<()> {
    if arguments.json {
        writeln!(io::stdout(), "{}", serde_json::to_string_pretty(made)?)?;
    } else if !arguments.quiet {
        let DrawSummary { draws, attempts, above_one } = made.summary;
        let accepted = made.acceptance.map_or(String::new(), |a| format!(" ({:.4} % accepted)", 100.0 * a));
        tell!("{}: {} spectra of {} bands", made.output, grouped(draws), made.bands);
        tell!("  {} candidates{accepted}", grouped(attempts));
        if above_one > 0 {
            let share = 100.0 * above_one as f64 / draws as f64;
            tell!("  {} spectra ({share:.2} %) reach 1 or more after scaling", grouped(above_one));
        }
        let rate = match draws {
            ..100_000 => String::new(), // starting up is most of so short a run
            _ => format!("{:.2} million a second, ", made.draws_per_second / 1e6),
        };
        tell!("  {:.2} s, {rate}{}", made.seconds, made.engine);
        if let SetStatus::Waiting { done, chunks } = outcome {
            tell!(
                "  {} of {} chunks are finished: the set gets its name with the last",
                grouped(done),
                grouped(chunks)
            );
        }
    }
    Ok(())
}

/// Refuses what no index and no disk can hold, and two things on one output.
fn check_size(arguments: &Arguments, bands: usize) -> Result<(), Usage> {
    if arguments.json && arguments.output.to_stdout() {
        return Err(Usage("--json and -o - would both write to standard output".to_owned()));
    }
    let past_the_end = arguments.count > 0 && arguments.start.checked_add(arguments.count - 1).is_none();
    if past_the_end {
        return Err(Usage(format!(
            "{} draws from index {} on pass the last, 2^64 - 1",
            arguments.count, arguments.start
        )));
    }
    let bytes = arguments.count.checked_mul(8 * bands as u64);
    if bytes.is_none_or(|bytes| bytes > 1 << 60) {
        return Err(Usage(format!(
            "{} spectra of {bands} bands are more than any disk holds",
            arguments.count
        )));
    }
    Ok(())
}
