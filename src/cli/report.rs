//! `spectroll report`: the cost of draws, their quality and extreme cases, as a page to keep.

use std::cell::RefCell;
use std::io::Write;
use std::path::PathBuf;
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use spectroll::evaluation::report::{Effort, Options, Report, ReportError, Verdict, figures, measure, page};
use spectroll::output::{FolderMark, PendingFolder};
use spectroll::{EngineChoice, adapters};

use super::exit::Usage;
use super::interrupt::{self, Interrupted};
use super::options::EngineArguments;
use super::parse::number;
use super::{if_exists, model};

/// Measure error against run time, accuracy, randomness and extreme cases, as a page with plots
///
/// Writes a folder: report.html, which needs nothing else, report.json with all numbers, and the plots as SVG.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Model files, or names of built-in models
    #[arg(value_name = "MODEL", default_value = "munsell-vrhel")]
    models: Vec<String>,
    /// The folder to make
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Up to 10^6 draws: under a minute on 2 cores
    #[arg(long, conflicts_with = "full")]
    quick: bool,
    /// Up to 10^8 draws: the better part of an hour
    #[arg(long)]
    full: bool,
    /// The seed of all random numbers
    #[arg(long, default_value_t = 0, value_parser = number, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    engine: EngineArguments,
    /// Replace the folder if it exists
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let models = arguments.models.iter().map(|name| Ok((name.clone(), model(name)?)));
    let models = models.collect::<anyhow::Result<_>>()?;
    if arguments.engine.threads.is_some() {
        return Err(Usage("a report uses all cores: leave out --threads".to_owned()).into());
    }
    let folder = PendingFolder::create(&arguments.output, if_exists(arguments.force), REPORT)?;
    let options = Options {
        models,
        engines: engines(arguments.engine.choice()),
        effort: match (arguments.quick, arguments.full) {
            (true, _) => Effort::Quick,
            (_, true) => Effort::Full,
            _ => Effort::Usual,
        },
        seed: arguments.seed,
    };
    interrupt::watch();
    let report = watched(&options)?;
    write(&folder, &report)?;
    interrupt::check()?;
    folder.finish()?;
    let mut out = std::io::stdout().lock();
    write!(out, "{}", report.summary())?;
    writeln!(out, "{}, {:.0} s", arguments.output.join("report.html").display(), report.seconds)?;
    if report.verdict().is_good() {
        return Ok(());
    }
    anyhow::bail!("{}; {:?} has them all", failures(report.verdict()), arguments.output.join("report.html"))
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
fn engines(choice: Option<EngineChoice>) -> Vec<EngineChoice> {
    match choice {
        Some(choice) => vec![choice],
        None => {
            let adapters = (0..adapters().len()).map(|i| EngineChoice::Adapter(i.to_string()));
            [EngineChoice::Cpu].into_iter().chain(adapters).collect()
        }
    }
}

/// Measures, and says on a terminal what is being measured.
fn watched(options: &Options) -> anyhow::Result<Report> {
    let style =
        ProgressStyle::with_template("{spinner} {elapsed} {wide_msg}").expect("the template is right");
    let bar = ProgressBar::new_spinner().with_style(style);
    bar.enable_steady_tick(Duration::from_millis(200));
    let last = RefCell::new(String::new());
    let result = measure(options, &|what| {
        if !what.is_empty() && *last.borrow() != what {
            bar.set_message(what.to_owned());
            last.replace(what.to_owned());
        }
        interrupt::check().is_ok()
    });
    bar.finish_and_clear();
    match result {
        Err(ReportError::Stopped) => Err(Interrupted("nothing was left behind".to_owned()).into()),
        Err(ReportError::Engine(e)) => Err(e.into()), // with its exit code
        Err(ReportError::Recipe(e)) => Err(e.into()),
        other => Ok(other?),
    }
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
    fn what_failed_is_named() {
        let verdict = Verdict { cases: [34, 36], checks: [500, 500], answers: [2, 3] };
        assert_eq!(
            failures(verdict),
            "2 of 36 stiff and extreme cases have a wrong answer; 1 of 3 known answers of the generator are missed"
        );
    }
}
