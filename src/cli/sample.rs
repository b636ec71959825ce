//! `spectroll sample`: draws of a model, into a data set.

use std::io::{self, Write};
use std::path::Path;
use std::time::Instant;

use serde::Serialize;
use spectroll::export::{DrawExport, Writing};
use spectroll::output::SetStatus;
use spectroll::{DrawRange, DrawSummary, EngineChoice, Grid, Stream};

use super::exit::Usage;
use super::options::{EngineArguments, OutputArguments, RecipeArguments};
use super::parse::{count, grouped};
use super::run::{self, DryRun};
use super::{interrupt, model_at};

/// Draw spectra from a model
///
/// Draw i depends on the model, the options below, the seed, the stream and i alone: any part of a data set can be
/// made again, or on another machine, with --start or --shard.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file, or munsell-vrhel, granada, munsell-vrhel-5nm, granada-5nm
    #[arg(value_name = "MODEL")]
    model: String,
    /// Fit a built-in model at these wavelengths first, start:step:stop in nm
    #[arg(long, value_name = "GRID")]
    wavelengths: Option<Grid>,
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
    request: RecipeArguments,
    #[command(flatten)]
    output: OutputArguments,
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
    let output = arguments.output.resolve()?;
    let model = model_at(&arguments.model, arguments.wavelengths)?;
    check_size(arguments, model.bands())?;
    let recipe = arguments.request.recipe(&model)?;
    let stream = match &arguments.stream {
        Some(name) => Stream::named(arguments.seed, name),
        None => Stream::new(arguments.seed),
    };
    let draws = DrawRange { stream, first: arguments.start, count: arguments.count };
    // A folder on this machine is nobody else's business.
    let name = Path::new(&arguments.model).file_name().unwrap_or_default().to_string_lossy();
    let export = DrawExport::new(&recipe, draws).model_name(&name).stream_name(arguments.stream.as_deref());
    let schema = export.schema(&output);
    output.check(&schema)?;

    let engine = arguments.engine.open()?;
    if arguments.dry_run {
        return DryRun::new(&output, &schema, &recipe, &engine)?.print(arguments.json);
    }
    let why = match (arguments.engine.choice().unwrap_or_default(), engine.adapter()) {
        (EngineChoice::Auto, None) => ", no graphics hardware was found",
        _ => "",
    };

    let start = Instant::now();
    let mut rows = export.rows(&engine)?;
    let writing = interrupt::around(&output, || {
        Writing::open(&output, schema, &export.companions(), &engine, &mut rows).map_err(run::failed)
    })?;
    let outcome = run::make(writing, &mut rows, (arguments.quiet, arguments.output.to_stdout()))?;
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
