//! `spectroll report`: the cost of draws, their quality and extreme cases, as a page to keep.

use std::io::{self, IsTerminal, Write};
use std::path::PathBuf;
use std::sync::Mutex;
use std::time::Duration;

use indicatif::{HumanDuration, ProgressBar, ProgressStyle};
use spectroll::evaluation::adapter::{self, AdapterError};
use spectroll::evaluation::report::{
    Effort, Options, Progress, Report, ReportError, Verdict, figures, measure, page,
};
use spectroll::output::{FolderMark, PendingFolder};
use spectroll::{EngineChoice, EngineError, adapters};

use super::exit::Usage;
use super::interrupt::{self, Interrupted};
use super::options::EngineArguments;
use super::parse::number;
use super::{if_exists, model};

/// Measure error against run time, accuracy, randomness and extreme cases, as a page with plots
///
/// Writes a folder: report.html, which needs nothing else, report.json with all numbers, and the plots as SVG. Ctrl-C
/// writes what is done by then, marked as unfinished; a second Ctrl-C ends at once. With --adapter there are also adapter.json
/// and adapter.md: draws of every kind beside those of the CPU, costs, and the bandwidth that draws reach.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Model files, or names of built-in models
    #[arg(value_name = "MODEL", default_value = "munsell-vrhel")]
    models: Vec<String>,
    /// The folder to make
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Up to half a minute for a model [default: up to 3 minutes for two]
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Narrow intervals, which may take half an hour for a model
    #[arg(long)]
    full: bool,
    /// Draw with NumPy and Numba too, where the Python of SPECTROLL_PYTHON, or python3, has them
    #[arg(long)]
    peers: bool,
    /// The seed of all random numbers
    #[arg(long, default_value_t = 0, value_parser = number, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    engine: EngineArguments,
    /// Replace the folder if it exists
    #[arg(long)]
    force: bool,
    /// Print no progress
    #[arg(short, long)]
    quiet: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let models = arguments.models.iter().map(|name| Ok((name.clone(), model(name)?)));
    let models = models.collect::<anyhow::Result<_>>()?;
    if arguments.engine.threads.is_some() {
        return Err(Usage("a report uses all cores: leave out --threads".to_owned()).into());
    }
    if arguments.engine.checks_or_chooses_arithmetic() {
        let text = "a report tries each adapter as it is: leave out --arithmetic and --verify-draws";
        return Err(Usage(text.to_owned()).into());
    }
    // Only to learn now whether it can be made: a second Ctrl-C leaves nothing behind.
    let folder = || PendingFolder::create(&arguments.output, if_exists(arguments.force), REPORT);
    drop(folder()?);
    let options = Options {
        models,
        engines: engines(arguments.engine.choice())?,
        effort: match (arguments.quick, arguments.full) {
            (true, _) => Effort::Quick,
            (_, true) => Effort::Full,
            _ => Effort::Usual,
        },
        seed: arguments.seed,
        python: arguments.peers.then(python),
    };
    interrupt::watch_once();
    let report = watched(&options, Shown::to(arguments.quiet))?;
    let path = arguments.output.join("report.html");
    let [measured, all] = report.measured();
    if measured == 0 {
        return Err(Interrupted("no section was finished, and nothing was left behind".to_owned()).into());
    }
    let folder = folder()?;
    write(&folder, &report)?;
    if let (Some(choice @ EngineChoice::Adapter(_)), true) = (arguments.engine.choice(), report.finished) {
        let watch = |step: &str| {
            if !arguments.quiet {
                tell!("the adapter: {step}");
            }
            interrupt::check().is_ok()
        };
        let measured = adapter::measure(&choice, &watch).map_err(|error| match error {
            AdapterError::Stopped => Interrupted("nothing was left behind".to_owned()).into(),
            AdapterError::Engine(e) => e.into(), // with its exit code
            other => anyhow::Error::from(other),
        })?;
        folder.write("adapter.json", serde_json::to_string_pretty(&measured)?.as_bytes())?;
        folder.write("adapter.md", adapter::rows(&measured).as_bytes())?;
    }
    folder.finish()?;
    if !report.finished {
        let kept = format!("{} is unfinished: it has {measured} of {all} sections", path.display());
        return Err(Interrupted(kept).into());
    }
    let mut out = io::stdout().lock();
    write!(out, "{}", report.summary())?;
    writeln!(out, "{}, {:.0} s", path.display(), report.seconds)?;
    if report.verdict().is_good() {
        return Ok(());
    }
    anyhow::bail!("{}; {path:?} has them all", failures(report.verdict()))
}

/// The Python that draws beside the engines.
fn python() -> String {
    std::env::var("SPECTROLL_PYTHON").unwrap_or_else(|_| "python3".to_owned())
}

/// Describes what is wrong in a verdict that is not good.
fn failures(Verdict { cases, checks, answers }: Verdict) -> String {
    let parts = [
        (cases, "stiff and extreme cases have a wrong answer"),
        (checks, "checks of distributions raise an alarm"),
        (answers, "known answers of the generator are missed"),
    ];
    let failed = parts.iter().filter(|([good, all], _)| good < all);
    failed.map(|([good, all], what)| format!("{} of {all} {what}", all - good)).collect::<Vec<_>>().join("; ")
}

/// Every adapter and the CPU, unless one was asked for.
fn engines(choice: Option<EngineChoice>) -> Result<Vec<EngineChoice>, EngineError> {
    Ok(match choice {
        Some(choice) => vec![choice],
        None => {
            let adapters = (0..adapters()?.len()).map(|i| EngineChoice::Adapter(i.to_string()));
            [EngineChoice::Cpu].into_iter().chain(adapters).collect()
        }
    })
}

/// Display of progress.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Shown {
    Bar,
    /// A line a section.
    Lines,
    Never,
}

impl Shown {
    fn to(quiet: bool) -> Shown {
        match io::stderr().is_terminal() {
            _ if quiet => Shown::Never,
            true => Shown::Bar,
            false => Shown::Lines,
        }
    }
}

/// Measures, and says what is being measured.
fn watched(options: &Options, shown: Shown) -> anyhow::Result<Report> {
    let style = ProgressStyle::with_template("{bar:24} {percent:>3} %  {prefix} left  {wide_msg}");
    let bar = match shown {
        Shown::Bar => ProgressBar::new(1000),
        _ => ProgressBar::hidden(),
    };
    let bar = bar.with_style(style.expect("the template is right"));
    if shown == Shown::Bar {
        bar.enable_steady_tick(Duration::from_millis(200));
    }
    let last = Mutex::new(String::new());
    let result = measure(options, &|progress: &Progress| {
        bar.set_position((1000.0 * progress.done) as u64);
        bar.set_prefix(HumanDuration(progress.left).to_string());
        let message = match progress.step.as_str() {
            "" => progress.section.clone(),
            step => format!("{}: {step}", progress.section),
        };
        bar.set_message(message);
        let mut last = last.lock().expect("no holder panics");
        if shown == Shown::Lines && *last != progress.section {
            last.clone_from(&progress.section);
            tell!("{}", line(progress));
        }
        interrupt::check().is_ok()
    });
    bar.finish_and_clear();
    match result {
        Err(ReportError::Engine(e)) => Err(e.into()), // with its exit code
        Err(ReportError::Recipe(e)) => Err(e.into()),
        other => Ok(other?),
    }
}

/// A line for the section that begins.
fn line(progress: &Progress) -> String {
    let (done, left) = (100.0 * progress.done, HumanDuration(progress.left));
    format!("{done:3.0} % done, about {left} left: {}", progress.section)
}

fn write(folder: &PendingFolder, report: &Report) -> anyhow::Result<()> {
    let figures = figures(report);
    folder.write("report.html", page(report, &figures).as_bytes())?;
    folder.write("report.json", serde_json::to_string_pretty(report)?.as_bytes())?;
    for figure in figures {
        folder.write(format!("{}.svg", figure.name), figure.svg.as_bytes())?;
    }
    Ok(())
}

/// Mark that tells a folder of ours from others, which `--force` must not remove.
const REPORT: FolderMark =
    FolderMark { name: "a report", is_ours: |path| path.join("report.json").is_file() };

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_say_what_is_measured_and_what_is_left() {
        let progress = Progress {
            section: "granada: 4. Fidelity to the method".to_owned(),
            step: "any".to_owned(),
            done: 0.256,
            left: Duration::from_secs(61),
        };
        assert_eq!(line(&progress), " 26 % done, about 61 seconds left: granada: 4. Fidelity to the method");
    }

    #[test]
    fn what_failed_is_named() {
        let verdict = Verdict { cases: [34, 36], checks: [500, 500], answers: [2, 3] };
        assert_eq!(
            failures(verdict),
            "2 of 36 stiff and extreme cases have a wrong answer; 1 of 3 known answers of the generator are missed"
        );
    }
}
