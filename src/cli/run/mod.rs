//! A run: rows that are drawn into an output, for the commands that make data sets.

mod dry_run;
mod progress;
mod summary;
mod waiting;

use spectroll::export::{ExportError, Rows, Writing};
use spectroll::output::SetStatus;

use super::interrupt::{self, Interrupted};
pub(super) use dry_run::{DryRun, folder_of};
use progress::{Progress, Shown};
pub(super) use summary::{above_one, doubts, drawn_by, kind, left_out, part, rechecked, room, status};
pub(super) use waiting::Waiting;

/// Draws the rows that are missing, shows how far that is, and completes the output.
pub(super) fn make(
    writing: Writing,
    rows: &mut dyn Rows,
    (quiet, to_stdout): (bool, bool),
) -> anyhow::Result<SetStatus> {
    let count = writing.missing().iter().map(|rows| rows.end - rows.start).sum();
    let progress = Progress::new(count, Shown::to(quiet, to_stdout));
    let result = writing.run(rows, &mut |rows| {
        progress.advance(rows);
        interrupt::flow()
    });
    progress.end();
    result.map_err(failed)
}

/// An error of an export in the words of the program: how to go on, and whether somebody asked for an end.
pub(super) fn failed(error: ExportError) -> anyhow::Error {
    match error {
        ExportError::Engine(error) => error.into(),
        ExportError::Output(error) => error.into(),
        ExportError::Interrupted => Interrupted("nothing was left behind".to_owned()).into(),
        unfinished @ ExportError::Unfinished { .. } => {
            let text = format!("{unfinished}: pass --resume to go on");
            let interrupted = matches!(&unfinished, ExportError::Unfinished { cause, .. } if matches!(**cause, ExportError::Interrupted));
            match (interrupted, text.strip_prefix("interrupted; ")) {
                (true, Some(kept)) => Interrupted(kept.to_owned()).into(),
                _ => anyhow::Error::from(unfinished).context(text),
            }
        }
        other => other.into(),
    }
}
