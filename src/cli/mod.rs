//! The command line: a module a command. Each takes its arguments and returns an error, which is printed here, once,
//! with the exit code that its kind has.

#![allow(rustdoc::invalid_html_tags)] // what documents the commands is their help, as it stands

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
mod exit;
mod fit;
mod image;
mod inspect;
mod interrupt;
mod look;
mod metamers;
mod models;
mod options;
mod packaging;
mod parse;
mod picture;
mod report;
mod run;
mod sample;
mod scene;
mod shader;
mod verify;
mod wavelengths;

use std::ffi::OsString;
use std::path::Path;

use clap::{CommandFactory, Parser, Subcommand};
use spectroll::output::IfExists;
use spectroll::suggestion::closest;
use spectroll::{BuiltinTable, Grid, Model, ModelError};

use exit::Usage;

/// The version, with the commit where whoever builds names it, as the release workflow does. No build script asks git:
/// each commit would build the program and its tests anew.
const VERSION: &str = match option_env!("SPECTROLL_VERSION") {
    Some(version) => version,
    None => env!("CARGO_PKG_VERSION"),
};

/// Draws random, physically valid natural spectra on the GPU.
#[derive(Parser)]
#[command(version = VERSION, after_help = EXAMPLES)]
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
  spectroll sample munsell-vrhel -n 10000 --sensors ss2 --quantities spectra,responses -o cones.npz
  spectroll look mine.csv -o mine.png
  spectroll fit munsell vrhel --wavelengths 400:5:700 -k 8 -o surfaces.json
  spectroll shader granada --quantities linear_srgb --prefix sun > sun.wgsl
  spectroll inspect munsell-vrhel -o munsell-vrhel.png
  spectroll report munsell-vrhel -o report --quick

Exit codes: 0 done, 1 failed while running, 2 wrong usage or impossible request, 3 no such adapter,
4 bad input data, 5 a data set is not what was written, 130 interrupted.";

#[derive(Subcommand)]
enum Command {
    Fit(fit::Arguments),
    Look(look::Arguments),
    Sample(sample::Arguments),
    Scene(scene::Arguments),
    Metamers(metamers::Arguments),
    Verify(verify::VerifyArguments),
    Merge(verify::MergeArguments),
    Inspect(inspect::Arguments),
    #[command(visible_alias = "list")]
    Models(models::Arguments),
    Shader(shader::Arguments),
    Adapters(adapters::Arguments),
    Bench(bench::Arguments),
    Report(report::Arguments),
    Completions(packaging::CompletionsArguments),
    Man(packaging::ManArguments),
}

/// Runs the program with the words of a command line, the first of which is its own name. Returns the exit code, but for
/// help and mistakes in the words, which end the process.
pub fn main(words: Vec<OsString>) -> u8 {
    let result = options::config::expand(&Arguments::command(), words);
    let mut looks = false;
    let result = result.map_err(anyhow::Error::from).and_then(|words| {
        let command = Arguments::parse_from(words).command;
        looks = matches!(command, Command::Look(_));
        run(command)
    });
    match result {
        Ok(()) => 0,
        Err(error) if exit::is_broken_pipe(&error) => 0, // the reader has what it wanted
        Err(error) => {
            // Our messages hold their causes.
            match exit::data_remedy(&error) {
                Some(options) if looks => tell!("error: {error}{options}"),
                Some(options) => {
                    tell!("error: {error}{options}; `spectroll look FILE` shows how a file is read")
                }
                None => tell!("error: {error}{}", exit::remedy(&error)),
            }
            exit::code(&error)
        }
    }
}

/// Whether the words of a command line, with the configuration that they may name, say what is to be done. Nothing is.
pub fn understands(words: Vec<OsString>) -> bool {
    let words = options::config::expand(&Arguments::command(), words);
    words.is_ok_and(|words| Arguments::try_parse_from(words).is_ok())
}

fn run(command: Command) -> anyhow::Result<()> {
    match &command {
        Command::Fit(arguments) => fit::run(arguments),
        Command::Look(arguments) => look::run(arguments),
        Command::Sample(arguments) => sample::run(arguments),
        Command::Scene(arguments) => scene::run(arguments),
        Command::Metamers(arguments) => metamers::run(arguments),
        Command::Verify(arguments) => verify::run(arguments),
        Command::Merge(arguments) => verify::join(arguments),
        Command::Inspect(arguments) => inspect::run(arguments),
        Command::Models(arguments) => models::run(arguments),
        Command::Shader(arguments) => shader::run(arguments),
        Command::Adapters(arguments) => adapters::run(arguments),
        Command::Bench(arguments) => bench::run(arguments),
        Command::Report(arguments) => report::run(arguments),
        Command::Completions(arguments) => packaging::completions(Arguments::command(), arguments),
        Command::Man(arguments) => packaging::man(Arguments::command(), arguments),
    }
}

/// The model of a name: a built-in one, or a file.
fn model(name: &str) -> anyhow::Result<Model> {
    model_at(name, None)
}

/// The model of a name, where a built-in one is fitted at the grid that is asked for.
fn model_at(name: &str, grid: Option<&Grid>) -> anyhow::Result<Model> {
    if Model::BUILTIN.contains(&name) {
        return Ok(match grid {
            Some(grid) => Model::builtin_at(name, grid.clone())?,
            None => Model::builtin(name)?,
        });
    }
    if !Path::new(name).exists() {
        anyhow::bail!(Usage(no_model(name)));
    }
    let model = Model::load(Path::new(name)).map_err(|error| match error {
        ModelError::Data { .. } => {
            let kind = if has_extension(name, "mat") { "a MATLAB file of data" } else { "a file of data" };
            let advice =
                format!("{name} is {kind}: fit a model to it first: spectroll fit {name} -o MODEL.json");
            anyhow::Error::from(error).context(advice)
        }
        other => other.into(),
    })?;
    if let Some(grid) = grid.filter(|&grid| grid != model.grid()) {
        anyhow::bail!(Usage(format!(
            "--wavelengths {grid}: the grid belongs to the model {name:?}, and is {}: fit it with spectroll fit \
             --wavelengths",
            model.grid()
        )));
    }
    Ok(model)
}

/// Says what a name that is no model's may have meant.
fn no_model(name: &str) -> String {
    let builtin = Model::BUILTIN.join(", ");
    let meant = match (BuiltinTable::named(name), closest(name, Model::BUILTIN.iter().copied())) {
        (Some(BuiltinTable::Munsell | BuiltinTable::Vrhel), _) => Some("munsell-vrhel".to_owned()),
        (_, None) if closest(name, ["munsell", "vrhel"]).is_some() => Some("munsell-vrhel".to_owned()),
        (_, closest) => closest,
    };
    let meant = meant.map_or(String::new(), |meant| format!(", did you mean {meant}?"));
    let end = if meant.is_empty() { "; `spectroll fit` makes models" } else { "" };
    format!("{name:?} is neither a file nor a built-in model ({builtin}){meant}{end}")
}

fn has_extension(path: impl AsRef<Path>, extension: &str) -> bool {
    path.as_ref().extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
}

/// The folder that a path names something in.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Treatment of an existing file under `--force`.
fn if_exists(force: bool) -> IfExists {
    if force { IfExists::Replace } else { IfExists::Refuse }
}
