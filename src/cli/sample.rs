//! `spectroll sample`: draws of a model, into a data set.

use std::path::Path;
use std::time::Instant;

use serde::Serialize;
use spectroll::export::{DrawExport, Output, Writing};
use spectroll::output::SetStatus;
use spectroll::wording::counted;
use spectroll::{ArithmeticVerdict, DrawRange, DrawSummary, EngineChoice, Recipe, Stream, wanted_backends};

use super::exit::Usage;
use super::interrupt;
use super::options::{
    EngineArguments, ModelArguments, OutputArguments, Purpose, RecipeArguments, SummaryArguments,
};
use super::parse::{count, seed};
use super::run::{self, DryRun, Waiting};

/// Draw spectra from a model
///
/// Draw i depends on the model, the options below, the seed, the stream and i alone: any part of a data set can be
/// made again, or on another machine, with --start or --shard.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    model: ModelArguments,
    /// Number of spectra (1000000, 1e6 and 1M are the same; k, M, G and T are powers of 1000)
    #[arg(short = 'n', long, value_name = "COUNT", value_parser = count, allow_negative_numbers = true)]
    count: u64,
    /// The seed of the random numbers, or random for one that the summary and the data set tell
    #[arg(long, default_value_t = 0, value_name = "SEED|random", value_parser = seed, allow_negative_numbers = true)]
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
    #[command(flatten)]
    summary: SummaryArguments,
}

/// Result of a run, for people and programs.
#[derive(Serialize)]
struct Report {
    model: String,
    output: String,
    /// Number of text files, in a folder.
    files: Option<u64>,
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
    /// Arithmetic of an adapter's shaders, and whether its draws are those of the CPU.
    #[serde(skip_serializing_if = "Option::is_none")]
    arithmetic: Option<ArithmeticVerdict>,
    /// Number of draws that were made again on the CPU, and were the same.
    rechecked: u64,
    /// The engine, with why it is not another one only where a variable is to blame.
    #[serde(skip)]
    drawn_by: String,
    version: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let output = arguments.output.resolve(Purpose::of(arguments.dry_run))?;
    let waiting = Waiting::begin("preparing the draws", arguments.summary.quiet);
    let model = arguments.model.load()?;
    check_size(arguments, model.bands())?;
    let recipe = arguments.request.recipe(&model)?;
    drop(waiting);
    let unnamed = Stream::new(arguments.seed);
    let stream = arguments.stream.as_ref().map_or(unnamed, |name| Stream::named(arguments.seed, name));
    if let (true, Some(name)) = (stream == unnamed, &arguments.stream) {
        let text = format!(
            "--stream {name:?} has by its hash the draws of stream 0, as without --stream: choose another name"
        );
        return Err(Usage(text).into());
    }
    let draws = DrawRange { stream, first: arguments.start, count: arguments.count };
    // A folder on this machine is nobody else's business.
    let name = Path::new(&arguments.model.name).file_name().unwrap_or_default().to_string_lossy();
    let export = DrawExport::new(&recipe, draws).model_name(&name).stream_name(arguments.stream.as_deref());
    let schema = export.schema(&output);
    let companions = export.companions();
    output.check(&schema, &companions)?;

    let engine = arguments.engine.open()?;
    if arguments.dry_run {
        DryRun::new(&output, (&schema, &companions), &recipe, &engine)?.print(arguments.summary.json)?;
        return Ok(output.check_space(&schema, &companions)?);
    }
    output.check_space(&schema, &companions)?;
    // Who has no graphics hardware knows; who hides it may not, and is told.
    let is_fallback =
        arguments.engine.choice().unwrap_or_default() == EngineChoice::Auto && engine.adapter().is_none();
    let hidden = wanted_backends()
        .filter(|_| is_fallback)
        .map_or_else(String::new, |value| format!(" with WGPU_BACKEND={value}"));
    let why = if is_fallback { format!(", no graphics hardware was found{hidden}") } else { String::new() };

    let files = output.text_files(&schema, &companions);
    let start = Instant::now();
    let mut rows = export.rows(&engine)?;
    let writing = interrupt::around(&output, || {
        Writing::open(&output, schema, &companions, &engine, &mut rows).map_err(run::failed)
    })?;
    let outcome = run::make(writing, &mut rows, (arguments.summary.quiet, arguments.output.to_stdout()))?;
    let summary = rows.summary;
    let seconds = start.elapsed().as_secs_f64();
    report(
        arguments,
        &output,
        (&recipe, outcome),
        &Report {
            model: arguments.model.name.clone(),
            output: arguments.output.output.display().to_string(),
            files,
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
            arithmetic: engine.verdict(),
            rechecked: engine.rechecked(),
            drawn_by: run::drawn_by(&engine) + if hidden.is_empty() { "" } else { &why },
            version: env!("CARGO_PKG_VERSION"),
        },
    )
}

fn report(
    arguments: &Arguments,
    output: &Output,
    (recipe, outcome): (&Recipe, SetStatus),
    made: &Report,
) -> anyhow::Result<()> {
    arguments.summary.tell(made, || {
        let DrawSummary { draws, attempts, above_one } = made.summary;
        let kind = run::kind(output, made.files);
        let spectra = counted(draws, "spectrum", "spectra");
        let above = run::above_one(above_one, draws, "--bounds both");
        let above = above.map_or_else(String::new, |above| format!("; {above}"));
        tell!("{}: {kind}{spectra} of {}{above}", made.output, counted(made.bands as u64, "band", "bands"));
        let accepted = made.acceptance.map_or(String::new(), |a| format!(" ({:.4} % accepted)", 100.0 * a));
        tell!("  {}{accepted}, seed {}", counted(attempts, "candidate", "candidates"), made.seed);
        for warning in run::doubts(recipe.model()).chain(run::left_out(recipe)) {
            tell!("  {warning}");
        }
        let rate = match draws {
            ..100_000 => String::new(), // starting up is most of so short a run
            _ => format!("{:.2} million a second, ", made.draws_per_second / 1e6),
        };
        tell!("  {:.2} s, {rate}{}", made.seconds, made.drawn_by);
        if let Some(rechecked) = run::rechecked(made.rechecked) {
            tell!("  {rechecked}");
        }
        if let Some(status) = run::status(output, outcome) {
            tell!("  {status}");
        }
    })
}

/// Refuses what no index and no disk can hold, and two things on one output.
fn check_size(arguments: &Arguments, bands: usize) -> Result<(), Usage> {
    arguments.summary.check(&arguments.output)?;
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
