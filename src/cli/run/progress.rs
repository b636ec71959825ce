//! Progress of a long run: a bar on a terminal, a line every ten seconds elsewhere.

use std::cell::Cell;
use std::fmt;
use std::io::{self, IsTerminal};
use std::time::{Duration, Instant};

use indicatif::{HumanDuration, ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};
use spectroll::wording::grouped;

/// Time between lines where there is no terminal.
const LINES: Duration = Duration::from_secs(10);

/// Display of progress.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Shown {
    /// As a bar, but not before a second has passed.
    Later,
    Bar,
    Lines,
    Never,
}

impl Shown {
    /// Chooses the display of progress for a run that is quiet or not, and whose data go to standard output or not.
    pub(super) fn to(quiet: bool, to_stdout: bool) -> Shown {
        match (io::stderr().is_terminal(), to_stdout && io::stdout().is_terminal()) {
            _ if quiet => Shown::Never,
            (_, true) => Shown::Never, // with data on the same terminal it would only be in the way
            (true, false) => Shown::Later,
            (false, false) => Shown::Lines,
        }
    }
}

pub(super) struct Progress {
    bar: ProgressBar,
    shown: Cell<Shown>,
    last_line: Cell<Instant>,
}

impl Progress {
    /// Progress towards `count` rows.
    pub(super) fn new(count: u64, shown: Shown) -> Progress {
        let style = "{bar:40} {percent:>3} %  {human_pos} of {human_len}  {rate}  {eta} left";
        let rate = |state: &ProgressState, to: &mut dyn fmt::Write| {
            let _ = write!(to, "{:.1} million/s", state.per_sec() / 1e6);
        };
        let bar = ProgressBar::with_draw_target(Some(count), ProgressDrawTarget::hidden());
        bar.set_style(
            ProgressStyle::with_template(style).expect("the template is right").with_key("rate", rate),
        );
        Progress { bar, shown: shown.into(), last_line: Instant::now().into() }
    }

    pub(super) fn advance(&self, draws: u64) {
        self.bar.inc(draws);
        match self.shown.get() {
            Shown::Later if self.bar.elapsed() > Duration::from_secs(1) => {
                self.bar.set_draw_target(ProgressDrawTarget::stderr());
                self.shown.set(Shown::Bar);
            }
            Shown::Lines if self.last_line.get().elapsed() > LINES => {
                self.last_line.set(Instant::now());
                self.line();
            }
            _ => {}
        }
    }

    fn line(&self) {
        let (done, all) = (self.bar.position(), self.bar.length().unwrap_or(0));
        tell!(
            "{:.1} %  {} of {}  {:.1} million/s  {} left",
            100.0 * done as f64 / all.max(1) as f64,
            grouped(done),
            grouped(all),
            done as f64 / self.bar.elapsed().as_secs_f64() / 1e6,
            HumanDuration(self.bar.eta()),
        );
    }

    pub(super) fn end(&self) {
        self.bar.finish_and_clear();
    }
}
