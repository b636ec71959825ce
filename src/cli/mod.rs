//! The command line: a module a command. Each takes its arguments and returns an error, which is printed here, once,
//! with the exit code that its kind has.

/// Prints a line on standard error. Unlike `eprintln` it does not panic where nobody can read that: what was done is
/// done.
macro_rules! tell {
    ($($arguments:tt)*) => {{
        use std::io::Write as _;
        let _ = writeln!(std::io::stderr(), $($arguments)*);
    }};
}

mod adapters;
mod bench;
mod config;
mod dry_run;
mod fit;
mod generate;
mod inspect;
mod picture;
mod picture_file;
mod preview;
mod progress;
mod report;
mod request;
mod run;
mod sample;
mod scene;
mod scene_rows;
mod shader;
mod shard;
mod sink;
mod verify;

use std::num::NonZeroUsize;
use std::path::Path;
use std::process::ExitCode;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

use clap::{CommandFactory, Parser, Subcommand, ValueEnum};
use spectroll::output::{IfExists, OutputError};
use spectroll::scene::SceneError;
use spectroll::{
    DatasetError, EngineChoice, EngineError, FitError, Model, ModelError, RecipeError, WgslError,
};

/// Draws random, physically valid natural spectra on the GPU.
#[derive(Parser)]
#[command(version, after_help = EXAMPLES)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Take flags from a TOML file, as in `count = 1000`; those on the command line win over it
    #[arg(long, global = true, value_name = "FILE.toml")]
    config: Option<String>,
}

const EXAMPLES: &str = "\
Examples:
  spectroll sample munsell-vrhel -n 1000000 -o reflectances.npy
  spectroll sample granada -n 1000 -o - --seed 7 > daylights.csv
  spectroll sample munsell-vrhel -n 10000 --lrv 0.4 --bounds scaled -o targets.npy
  spectroll sample munsell-vrhel -n 1000000 -o reflectances.zarr --zstd
  spectroll verify reflectances.zarr
  spectroll scene --example condition3 --scenes 0..10 -o scenes.npz --preview scenes.png
  spectroll fit munsell vrhel --wavelengths 400:5:700 -k 8 -o surfaces.json
  spectroll shader granada --quantities srgb --prefix sun > sun.wgsl
  spectroll inspect munsell-vrhel -o munsell-vrhel.png
  spectroll report munsell-vrhel -o report --quick

Exit codes: 0 done, 1 failed while running, 2 wrong usage or impossible request, 3 no such adapter,
4 bad input data, 5 a data set is not what was written, 130 interrupted.";

#[derive(Subcommand)]
enum Command {
    Fit(fit::Arguments),
    Sample(sample::Arguments),
    Scene(scene::Arguments),
    Verify(verify::VerifyArguments),
    Merge(verify::MergeArguments),
    Inspect(inspect::Arguments),
    Shader(shader::Arguments),
    Adapters(adapters::Arguments),
    Bench(bench::Arguments),
    Report(report::Arguments),
    Completions(generate::CompletionsArguments),
    Man(generate::ManArguments),
}

/// Where to draw.
#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum EngineName {
    /// The best graphics hardware; the CPU where there is none
    Auto,
    /// The best graphics adapter, be it software
    Gpu,
    /// The CPU, without any driver
    Cpu,
}

/// The choice of what draws, for the commands that do.
#[derive(clap::Args)]
struct EngineArguments {
    /// What draws [default: auto]
    #[arg(long, value_enum, conflicts_with = "adapter")]
    engine: Option<EngineName>,
    /// Draw on the adapter of this index or name (see `spectroll adapters`)
    #[arg(long, value_name = "NAME|INDEX")]
    adapter: Option<String>,
    /// How many threads the CPU draws with [default: one a core]
    #[arg(short, long, value_name = "N", value_parser = threads, allow_negative_numbers = true)]
    threads: Option<NonZeroUsize>,
}

impl EngineArguments {
    /// What was asked for; nothing where it was not.
    fn choice(&self) -> Option<EngineChoice> {
        let named = self.engine.map(|engine| match engine {
            EngineName::Auto => EngineChoice::Auto,
            EngineName::Gpu => EngineChoice::Gpu,
            EngineName::Cpu => EngineChoice::Cpu,
        });
        self.adapter.clone().map(EngineChoice::Adapter).or(named)
    }
}

/// Somebody pressed Ctrl-C.
#[derive(Debug, thiserror::Error)]
#[error("interrupted; {0}")]
struct Interrupted(String);

/// A data set is not what was written.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Unverified(String);

/// Whether somebody asked for an end. Nothing until [`watch_interrupts`].
static INTERRUPTED: OnceLock<Arc<AtomicBool>> = OnceLock::new();

/// From here on Ctrl-C and the like are for [`check_interrupt`] to see; before, they end the program. The end of its
/// terminal stays ignored where whoever started it ignores that, as `nohup` does. (Shells ignore SIGINT for whatever
/// scripts start with `&`, and mean nothing by it.)
fn watch_interrupts() {
    let flag = INTERRUPTED.get_or_init(Arc::default);
    let register = |signal| {
        signal_hook::flag::register(signal, flag.clone()).expect("it is a signal that can be handled");
    };
    register(signal_hook::consts::SIGINT);
    register(signal_hook::consts::SIGTERM);
    #[cfg(unix)]
    if !is_ignored(signal_hook::consts::SIGHUP) {
        register(signal_hook::consts::SIGHUP);
    }
}

/// Whether a signal is ignored, as far as Linux tells.
#[cfg(unix)]
fn is_ignored(signal: i32) -> bool {
    let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
    let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
    let mask = mask.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok()).unwrap_or(0);
    mask >> (signal - 1) & 1 == 1
}

/// An error once Ctrl-C was pressed: long work asks from time to time.
fn check_interrupt() -> Result<(), Interrupted> {
    match INTERRUPTED.get().is_some_and(|flag| flag.load(Ordering::Relaxed)) {
        true => Err(Interrupted("nothing was left behind".to_owned())),
        false => Ok(()),
    }
}

/// Runs the program.
pub(crate) fn main() -> ExitCode {
    let result = config::expand(&Arguments::command(), std::env::args_os().collect());
    let result =
        result.map_err(anyhow::Error::from).and_then(|words| run(Arguments::parse_from(words).command));
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) if is_broken_pipe(&error) => ExitCode::SUCCESS, // the reader has what it wanted
        Err(error) => {
            tell!("error: {error}"); // our messages hold their causes
            ExitCode::from(exit_code(&error))
        }
    }
}

fn run(command: Command) -> anyhow::Result<()> {
    match &command {
        Command::Fit(arguments) => fit::run(arguments),
        Command::Sample(arguments) => sample::run(arguments),
        Command::Scene(arguments) => scene::run(arguments),
        Command::Verify(arguments) => verify::run(arguments),
        Command::Merge(arguments) => verify::join(arguments),
        Command::Inspect(arguments) => inspect::run(arguments),
        Command::Shader(arguments) => shader::run(arguments),
        Command::Adapters(arguments) => adapters::run(arguments),
        Command::Bench(arguments) => bench::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        Command::Completions(arguments) => generate::completions(Arguments::command(), arguments),
        Command::Man(arguments) => generate::man(Arguments::command(), arguments),
    }
}

fn exit_code(error: &anyhow::Error) -> u8 {
    let is_request = |e: &OutputError| {
        use OutputError::{Cannot, NotBuilt, UnknownFormat};
        matches!(e, UnknownFormat { .. } | Cannot { .. } | NotBuilt { .. })
    };
    let is_missing = |e: &EngineError| matches!(e, EngineError::NoAdapter { .. } | EngineError::NoAdapters);
    if error.is::<Interrupted>() {
        130
    } else if error.downcast_ref::<EngineError>().is_some_and(is_missing) {
        3
    } else if error.is::<DatasetError>() || error.is::<FitError>() || error.is::<ModelError>() {
        4
    } else if error.is::<Unverified>() || matches!(error.downcast_ref(), Some(OutputError::Damaged { .. })) {
        5
    } else if error.is::<RecipeError>()
        || error.is::<SceneError>()
        || error.is::<WgslError>()
        || error.is::<Usage>()
        || error.downcast_ref::<OutputError>().is_some_and(is_request)
    {
        2
    } else {
        1
    }
}

fn is_broken_pipe(error: &anyhow::Error) -> bool {
    let broken = |e: &std::io::Error| e.kind() == std::io::ErrorKind::BrokenPipe;
    error.chain().any(|cause| cause.downcast_ref().is_some_and(broken))
}

/// A request that cannot be meant, beyond what the argument parser can tell.
#[derive(Debug, thiserror::Error)]
#[error("{0}")]
struct Usage(String);

/// The model of a name: a built-in one, or a file.
fn model(name: &str) -> anyhow::Result<Model> {
    if Model::BUILTIN.contains(&name) {
        return Ok(Model::builtin(name)?);
    }
    if !Path::new(name).exists() {
        let builtin = Model::BUILTIN.join(", ");
        anyhow::bail!(Usage(format!(
            "{name:?} is neither a file nor a built-in model ({builtin}); `spectroll fit` makes models"
        )));
    }
    Ok(Model::load(Path::new(name))?)
}

/// The folder that a path names something in.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// What `--force` says of a file that exists.
fn existing(force: bool) -> IfExists {
    if force { IfExists::Replace } else { IfExists::Refuse }
}

/// How many threads: more than any machine has cores would only take long to start.
fn threads(text: &str) -> Result<NonZeroUsize, String> {
    let threads = text.parse().ok().filter(|threads| (1..=1024).contains(threads));
    threads.and_then(NonZeroUsize::new).ok_or_else(|| "expected 1 to 1024".to_owned())
}

/// A count: digits, with `_` between them as one likes, or a whole number like 1e6.
fn count(text: &str) -> Result<u64, String> {
    let digits = text.replace('_', "");
    if let Ok(count) = digits.parse() {
        return Ok(count);
    }
    match digits.parse::<f64>() {
        Ok(value) if value >= 0.0 && value.fract() == 0.0 && value < 2f64.powi(64) => Ok(value as u64),
        _ => Err("expected a whole number, like 1000000 or 1e6".to_owned()),
    }
}

/// A number with its thousands set apart.
fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(|g| String::from_utf8_lossy(g)).collect();
    groups.join(",")
}
