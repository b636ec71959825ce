//! `spectroll sample`: draws of a model, into a file.

use std::fmt;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use clap::ValueEnum;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use serde::Serialize;
use spectroll::output::{Format, Pending};
use spectroll::{Bounds, Choice, DEFAULT_MAX_ATTEMPTS, Draws, Engine, Recipe, Stream, Summary};

use super::{EngineArguments, Usage, check_interrupt, existing, grouped, model, watch_interrupts};

/// Draw spectra from a model
///
/// Draw i depends on the model, the options below, the seed, the stream and i alone: any part of a data set can be
/// made again, or on another machine, with --start.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file, or munsell-vrhel, granada, munsell-vrhel-5nm, granada-5nm
    #[arg(value_name = "MODEL")]
    model: String,
    /// How many spectra (1000000 and 1e6 are the same)
    #[arg(short = 'n', long, value_name = "COUNT", value_parser = count)]
    count: u64,
    /// The file, .npy (float32, spectra in rows) or .csv; - is CSV on standard output
    #[arg(short, long, value_name = "OUT")]
    output: PathBuf,
    /// The seed of the random numbers
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The index of the first draw
    #[arg(long, default_value_t = 0, value_parser = count)]
    start: u64,
    /// A name that sets these draws apart from others of the same seed
    #[arg(long, value_name = "NAME")]
    stream: Option<String>,
    /// Scale every reflectance to this luminous reflectance value (0 to 1)
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    lrv: Option<f64>,
    /// What must be between 0 and 1 where there is an --lrv
    #[arg(long, value_enum, default_value = "base", requires = "lrv")]
    bounds: BoundsName,
    /// Multiply the covariance of the weights
    #[arg(long, default_value_t = 1.0, value_name = "C", allow_negative_numbers = true)]
    cov_scale: f64,
    #[command(flatten)]
    engine: EngineArguments,
    /// How many candidates a draw may take
    #[arg(long, default_value_t = DEFAULT_MAX_ATTEMPTS, value_name = "N")]
    max_attempts: u32,
    /// The format of the file [default: what its name says]
    #[arg(long, value_enum)]
    format: Option<FormatName>,
    /// Replace the file if it exists
    #[arg(long)]
    force: bool,
    /// Print the summary as JSON on standard output
    #[arg(long)]
    json: bool,
    /// Print neither progress nor summary
    #[arg(short, long)]
    quiet: bool,
}

#[derive(Clone, Copy, ValueEnum)]
enum BoundsName {
    /// The spectrum before scaling
    Base,
    /// The spectrum after scaling
    Scaled,
    /// Both
    Both,
}

#[derive(Clone, Copy, ValueEnum)]
enum FormatName {
    /// NumPy, float32
    Npy,
    /// Text
    Csv,
}

/// What a run made and how, for people and programs.
#[derive(Serialize)]
struct Outcome {
    model: String,
    output: String,
    bands: usize,
    wavelengths: String,
    seed: u64,
    stream: Option<String>,
    start: u64,
    #[serde(flatten)]
    summary: Summary,
    acceptance: Option<f64>,
    seconds: f64,
    draws_per_second: f64,
    engine: String,
    version: &'static str,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let choice = arguments.engine.choice().unwrap_or_default();
    let to_stdout = arguments.output == Path::new("-");
    let format = format(arguments, to_stdout)?;
    let model = model(&arguments.model)?;
    let grid = model.grid();
    check_size(arguments, grid.len())?;

    let mut recipe =
        Recipe::new(&model).covariance_scale(arguments.cov_scale).max_attempts(arguments.max_attempts);
    if let Some(lrv) = arguments.lrv {
        recipe = recipe.lrv(lrv).bounds(match arguments.bounds {
            BoundsName::Base => Bounds::Base,
            BoundsName::Scaled => Bounds::Scaled,
            BoundsName::Both => Bounds::Both,
        });
    }
    let recipe = recipe.build()?;
    let stream = match &arguments.stream {
        Some(name) => Stream::named(arguments.seed, name),
        None => Stream::new(arguments.seed),
    };
    let draws = Draws { stream, first: arguments.start, count: arguments.count };

    let engine = Engine::with_threads(&choice, arguments.engine.threads)?;
    let why = match (&choice, engine.adapter()) {
        (Choice::Auto, None) => ", no graphics hardware was found",
        _ => "",
    };

    watch_interrupts();
    let start = Instant::now();
    let mut sink = Sink::create(arguments, to_stdout)?;
    let progress = Progress::new(arguments, to_stdout);
    format.begin(sink.writer(), grid, draws.count).map_err(|e| sink.failed(e))?;
    let summary = engine.draw(&recipe, draws, |batch| {
        check_interrupt()?;
        format.write(sink.writer(), &batch).map_err(|e| sink.failed(e))?;
        progress.advance(batch.draws.count);
        anyhow::Ok(())
    });
    progress.end();
    let summary = summary?;
    check_interrupt()?;
    sink.finish()?;

    let seconds = start.elapsed().as_secs_f64();
    report(
        arguments,
        &Outcome {
            model: arguments.model.clone(),
            output: arguments.output.display().to_string(),
            bands: grid.len(),
            wavelengths: grid.to_string(),
            seed: arguments.seed,
            stream: arguments.stream.clone(),
            start: arguments.start,
            summary,
            acceptance: summary.acceptance(),
            seconds,
            draws_per_second: summary.draws as f64 / seconds,
            engine: format!("{engine}{why}"),
            version: env!("CARGO_PKG_VERSION"),
        },
    )
}

fn report(arguments: &Arguments, outcome: &Outcome) -> anyhow::Result<()> {
    if arguments.json {
        writeln!(io::stdout(), "{}", serde_json::to_string_pretty(outcome)?)?;
    } else if !arguments.quiet {
        let Summary { draws, attempts, above_one } = outcome.summary;
        let accepted =
            outcome.acceptance.map_or(String::new(), |a| format!(" ({:.4} % accepted)", 100.0 * a));
        eprintln!("{}: {} spectra of {} bands", outcome.output, grouped(draws), outcome.bands);
        eprintln!("  {} candidates{accepted}", grouped(attempts));
        if above_one > 0 {
            let share = 100.0 * above_one as f64 / draws as f64;
            eprintln!("  {} spectra ({share:.2} %) reach 1 or more after scaling", grouped(above_one));
        }
        let rate = match draws {
            ..100_000 => String::new(), // starting up is most of so short a run
            _ => format!("{:.2} million a second, ", outcome.draws_per_second / 1e6),
        };
        eprintln!("  {:.2} s, {rate}{}", outcome.seconds, outcome.engine);
    }
    Ok(())
}

fn format(arguments: &Arguments, to_stdout: bool) -> anyhow::Result<Format> {
    match arguments.format {
        Some(FormatName::Npy) if to_stdout => anyhow::bail!(Usage("standard output is CSV only".to_owned())),
        Some(FormatName::Npy) => Ok(Format::Npy),
        Some(FormatName::Csv) => Ok(Format::Csv),
        None if to_stdout => Ok(Format::Csv),
        None => Ok(Format::of(&arguments.output)?),
    }
}

/// Refuses what no index and no disk can hold, and two things on one output.
fn check_size(arguments: &Arguments, bands: usize) -> Result<(), Usage> {
    if arguments.json && arguments.output == Path::new("-") {
        return Err(Usage("--json and -o - would both write to standard output".to_owned()));
    }
    let past_the_end = arguments.count > 0 && arguments.start.checked_add(arguments.count - 1).is_none();
    if past_the_end {
        return Err(Usage(format!(
            "{} draws from index {} on pass the last, 2^64 - 1",
            arguments.count, arguments.start
        )));
    }
    let bytes = arguments.count.checked_mul(4 * bands as u64);
    if bytes.is_none_or(|bytes| bytes > 1 << 60) {
        return Err(Usage(format!(
            "{} spectra of {bands} bands are more than any disk holds",
            arguments.count
        )));
    }
    Ok(())
}

/// A count: digits, with `_` between them as one likes, or a whole number like 1e6.
fn count(text: &str) -> Result<u64, String> {
    let digits = text.replace('_', "");
    if let Ok(count) = digits.parse() {
        return Ok(count);
    }
    match digits.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.fract() == 0.0 && value < 9e15 => Ok(value as u64),
        _ => Err("expected a whole number, like 1000000 or 1e6".to_owned()),
    }
}

/// Where the bytes go.
enum Sink {
    File(Pending),
    Stdout(io::BufWriter<io::Stdout>),
}

impl Sink {
    fn create(arguments: &Arguments, to_stdout: bool) -> anyhow::Result<Sink> {
        Ok(match to_stdout {
            true => Sink::Stdout(io::BufWriter::new(io::stdout())),
            false => Sink::File(Pending::create(&arguments.output, existing(arguments.force))?),
        })
    }

    fn writer(&mut self) -> &mut dyn Write {
        match self {
            Sink::File(pending) => pending,
            Sink::Stdout(out) => out,
        }
    }

    fn failed(&self, error: io::Error) -> anyhow::Error {
        match self {
            Sink::File(pending) => pending.failed(error).into(),
            Sink::Stdout(_) => error.into(),
        }
    }

    fn finish(self) -> anyhow::Result<()> {
        match self {
            Sink::File(pending) => Ok(pending.finish()?),
            Sink::Stdout(mut out) => Ok(out.flush()?),
        }
    }
}

/// A bar on a terminal, for what takes more than a second.
struct Progress {
    bar: ProgressBar,
    /// Whether the bar has been decided upon: shown, or never to be.
    settled: std::cell::Cell<bool>,
}

impl Progress {
    fn new(arguments: &Arguments, to_stdout: bool) -> Progress {
        let style = "{bar:40} {percent:>3} %  {human_pos} of {human_len}  {rate}  {eta} left";
        let rate = |state: &ProgressState, to: &mut dyn fmt::Write| {
            let _ = write!(to, "{:.1} million/s", state.per_sec() / 1e6);
        };
        let bar = ProgressBar::with_draw_target(Some(arguments.count), ProgressDrawTarget::hidden());
        bar.set_style(
            ProgressStyle::with_template(style).expect("the template is right").with_key("rate", rate),
        );
        // With data on the same terminal a bar would only be in the way.
        let never = arguments.quiet || (to_stdout && io::stdout().is_terminal());
        Progress { bar, settled: never.into() }
    }

    fn advance(&self, draws: u64) {
        self.bar.inc(draws);
        if !self.settled.get() && self.bar.elapsed() > Duration::from_secs(1) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr()); // which is hidden where it is no terminal
            self.settled.set(true);
        }
    }

    fn end(&self) {
        self.bar.finish_and_clear();
    }
}
