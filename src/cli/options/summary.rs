//! Options of what is said of a run.

use std::io::{self, Write};

use serde::Serialize;

use super::OutputArguments;
use crate::cli::exit::Usage;

/// The form of a summary.
#[derive(clap::Args)]
pub(in crate::cli) struct SummaryArguments {
    /// Print the summary as JSON on standard output
    #[arg(long)]
    pub(in crate::cli) json: bool,
    /// Do not print progress and summary
    #[arg(short, long)]
    pub(in crate::cli) quiet: bool,
}

impl SummaryArguments {
    /// Whether people are told anything.
    pub(in crate::cli) fn is_in_words(&self) -> bool {
        !self.json && !self.quiet
    }

    /// Refuses a summary and data on one output.
    pub(in crate::cli) fn check(&self, output: &OutputArguments) -> Result<(), Usage> {
        if self.json && output.to_stdout() {
            return Err(Usage("--json and -o - would both write to standard output".to_owned()));
        }
        Ok(())
    }

    /// Prints a report as JSON, or tells it in words, or says nothing.
    pub(in crate::cli) fn tell(
        &self,
        report: &impl Serialize,
        in_words: impl FnOnce(),
    ) -> anyhow::Result<()> {
        if self.json {
            writeln!(io::stdout(), "{}", serde_json::to_string_pretty(report)?)?;
        } else if !self.quiet {
            in_words();
        }
        Ok(())
    }
}
