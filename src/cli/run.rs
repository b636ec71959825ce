//! A run: rows that are drawn into an output, for the commands that make data sets and the one that checks them.

use std::ops::Range;

use spectroll::output::{Schema, SetStatus, SpdName};
use spectroll::{Engine, EngineError};

use super::progress::Progress;
use super::sink::{Destination, OutputArguments, Sink};
use super::{check_interrupt, request, watch_interrupts};

/// What takes the columns of some rows, and how many rows they are.
pub(super) type Window<'a> = dyn FnMut(&[&[u8]], u64) -> anyhow::Result<()> + 'a;

/// What draws the rows of a data set.
pub(super) trait Source {
    /// A sum that engines share exactly where they round alike.
    fn rounding(&mut self) -> Result<String, EngineError>;

    /// Draws some rows, counted from the first of the data set, and hands them on in order, window by window.
    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> anyhow::Result<()>;
}

/// What is to be made, and where.
pub(super) struct Run<'a> {
    pub(super) output: &'a OutputArguments,
    pub(super) target: Destination,
    pub(super) schema: Schema,
    /// How `.spd` files are called, and the number of the first row for that.
    pub(super) spd: (SpdName, u64),
    /// Files that lie beside the chunks of a set, by name.
    pub(super) companions: &'a [(&'a str, &'a str)],
    pub(super) engine: &'a Engine,
    pub(super) quiet: bool,
}

/// A run whose output is open.
pub(super) struct Open<'a> {
    sink: Sink,
    run: Run<'a>,
}

impl<'a> Run<'a> {
    /// Opens the output. From here on Ctrl-C is for [`check_interrupt`] to see.
    pub(super) fn open(mut self, source: &mut dyn Source) -> anyhow::Result<Open<'a>> {
        let is_set = matches!(self.target, Destination::Set(_));
        if is_set {
            self.schema.attributes.insert("rounding".to_owned(), source.rounding()?.into());
        }
        // Checking what is there of a set may take minutes and be ended at any moment; a file that is begun may not.
        if !is_set {
            watch_interrupts();
        }
        let companions = (self.companions, request::engine_name(self.engine));
        let sink = self.output.open(self.target, &self.schema, self.spd, (companions.0, &companions.1))?;
        if is_set {
            watch_interrupts();
        }
        Ok(Open { sink, run: self })
    }
}

impl Open<'_> {
    /// Draws the rows that are missing, and completes the output.
    pub(super) fn make(mut self, source: &mut dyn Source) -> anyhow::Result<SetStatus> {
        match self.fill(source) {
            Ok(()) => self.sink.finish(),
            Err(error) => Err(self.stop(error)),
        }
    }

    /// Keeps what is finished after an error, and adds to it how to go on.
    pub(super) fn stop(self, error: anyhow::Error) -> anyhow::Error {
        self.sink.stop(error)
    }

    fn fill(&mut self, source: &mut dyn Source) -> anyhow::Result<()> {
        let missing = self.sink.missing(self.run.schema.count);
        let count = missing.iter().map(|rows| rows.end - rows.start).sum();
        let progress = Progress::new(count, self.run.quiet, self.run.output.to_stdout());
        let sink = &mut self.sink;
        let drawn = missing.into_iter().try_for_each(|rows| {
            source.draw(rows, &mut |columns, count| {
                check_interrupt()?;
                sink.write(columns)?;
                progress.advance(count);
                Ok(())
            })
        });
        progress.end();
        drawn.and_then(|()| Ok(check_interrupt()?))
    }
}
