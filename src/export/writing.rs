//! An export under way: rows from an engine into an output that is open.

use std::io::{self, BufWriter};
use std::ops::{ControlFlow, Range};
use std::path::PathBuf;

use super::{Companions, Destination, Output, Rows};
use crate::engine::{Engine, EngineError};
use crate::metamers::MetamerError;
use crate::output::{
    FileWriter, IfExists, OutputError, PendingFile, Schema, SetStatus, SetWriter, Sidecar, SpdFolder,
    StreamWriter,
};

/// Error that ended an export before its data set was complete.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ExportError {
    /// The rows cannot be drawn.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A colour has no answer, and that is to be an error.
    #[error(transparent)]
    Metamers(MetamerError),
    /// The rows cannot be written.
    #[error(transparent)]
    Output(#[from] OutputError),
    /// Standard output cannot be written to.
    #[error("cannot write to standard output: {0}")]
    Stdout(#[source] io::Error),
    /// Something of the host's failed while the output was open.
    #[error("{0}")]
    Host(Box<dyn std::error::Error + Send + Sync>),
    /// The host asked for an end.
    #[error("interrupted")]
    Interrupted,
    /// A set stays unfinished: what is finished of it is in its folder, and another run can go on from there.
    #[error("{cause}; {}", kept(*.done, .folder))]
    Unfinished {
        /// The error that ended it.
        cause: Box<ExportError>,
        /// The number of this process's chunks that are finished, and of all; `None` where that could not be
        /// written down.
        done: Option<(u64, u64)>,
        /// The folder that holds them.
        folder: PathBuf,
    },
}

impl From<MetamerError> for ExportError {
    fn from(error: MetamerError) -> ExportError {
        match error {
            MetamerError::Engine(error) => ExportError::Engine(error),
            other => ExportError::Metamers(other),
        }
    }
}

fn kept(done: Option<(u64, u64)>, folder: &PathBuf) -> String {
    match done {
        Some((done, all)) => format!("{done} of {all} chunks are finished in {folder:?}"),
        None => format!("what is finished is in {folder:?}"),
    }
}

/// A data set whose output is open.
pub struct Writing {
    sink: Sink,
    count: u64,
}

enum Sink {
    Stream(StreamWriter),
    File(FileWriter, Option<Box<Sidecar>>),
    Spd(SpdFolder),
    Set(Box<SetWriter>),
}

impl Writing {
    /// Opens the output of a data set. Checking what is there of a set that is resumed may take minutes.
    pub fn open(
        output: &Output,
        mut schema: Schema,
        companions: &Companions,
        engine: &Engine,
        rows: &mut dyn Rows,
    ) -> Result<Writing, ExportError> {
        let (path, if_exists) = (output.path(), output.if_exists());
        let failed = |source| OutputError::Write { path: path.to_owned(), source };
        schema.shared = rows.shared(&schema.shared).map_err(failed)?;
        // All engines that have the CPU's bytes may work on one set; another leaves its mark.
        let rounding = if engine.is_exact() { None } else { Some(rows.rounding()?) };
        if let (Destination::Set(_), Some(rounding)) = (output.destination, &rounding) {
            schema.attributes.insert("rounding".to_owned(), rounding.clone().into());
        }
        let sink = match output.destination {
            Destination::Stdout(format) => {
                let stream = StreamWriter::new(BufWriter::new(io::stdout()), format, &schema)?;
                Sink::Stream(stream.map_err(ExportError::Stdout)?)
            }
            Destination::File(format) => {
                let file = FileWriter::create(path, format, &schema, &companions.spectra, if_exists)?;
                let sidecar = match output.has_sidecar {
                    true => {
                        // Only to learn now whether it can be made.
                        PendingFile::create(Sidecar::path(path), IfExists::Replace)?;
                        let model = companions.files.iter().find(|(name, _)| *name == "_model.json");
                        let model = model.map(|(_, text)| text.as_str());
                        Some(Box::new(Sidecar::new(format, &schema, rounding, model)))
                    }
                    false => None,
                };
                Sink::File(file, sidecar)
            }
            Destination::SpdFolder => {
                let Companions { spectra, first, .. } = companions;
                Sink::Spd(SpdFolder::create(path, &schema, spectra, *first, if_exists)?)
            }
            Destination::Set(_) => {
                let plan = output.plan(&schema).expect("the destination is a set");
                let files: Vec<_> =
                    companions.files.iter().map(|(name, text)| (*name, text.as_str())).collect();
                // What draws, as far as that can show in the draws.
                let adapter = engine.adapter().map_or_else(|| "CPU".to_owned(), ToString::to_string);
                let engine = match engine.verdict() {
                    Some(verdict) => format!("{adapter}, {verdict}"),
                    None => adapter,
                };
                let set = SetWriter::open(path, plan, &files, (output.shard, output.mode), &engine)?;
                Sink::Set(Box::new(set))
            }
        };
        Ok(Writing { sink, count: schema.count })
    }

    /// The rows that are still to be drawn.
    pub fn missing(&self) -> Vec<Range<u64>> {
        match &self.sink {
            Sink::Set(set) => set.missing(),
            _ => std::iter::once(0..self.count).collect(),
        }
    }

    /// Draws the rows that are missing, and completes the output. `watch` is told of the rows of each window, before they
    /// are written, and may end it.
    pub fn run(
        mut self,
        rows: &mut dyn Rows,
        watch: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<SetStatus, ExportError> {
        match self.fill(rows, watch) {
            Ok(()) => self.finish(),
            Err(error) => Err(self.stop(error)),
        }
    }

    /// Keeps what is finished of a set after an error, and adds to the error where that is.
    pub fn stop(self, error: ExportError) -> ExportError {
        let Sink::Set(set) = self.sink else { return error };
        let folder = set.folder().to_owned();
        let done = set.stop().ok().map(|progress| (progress.done, progress.chunks));
        ExportError::Unfinished { cause: Box::new(error), done, folder }
    }

    fn fill(
        &mut self,
        rows: &mut dyn Rows,
        watch: &mut dyn FnMut(u64) -> ControlFlow<()>,
    ) -> Result<(), ExportError> {
        let heed = |flow: ControlFlow<()>| match flow {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(ExportError::Interrupted),
        };
        for missing in self.missing() {
            rows.draw(missing, &mut |columns, count| {
                heed(watch(count))?;
                self.write(columns)
            })?;
        }
        heed(watch(0))
    }

    fn write(&mut self, columns: &[&[u8]]) -> Result<(), ExportError> {
        match &mut self.sink {
            Sink::Stream(stream) => stream.write(columns).map_err(ExportError::Stdout),
            Sink::File(file, _) => Ok(file.write(columns)?),
            Sink::Spd(folder) => Ok(folder.write(columns)?),
            Sink::Set(set) => Ok(set.write(columns)?),
        }
    }

    fn finish(self) -> Result<SetStatus, ExportError> {
        match self.sink {
            Sink::Stream(stream) => stream.finish().map_err(ExportError::Stdout)?,
            Sink::File(file, Some(sidecar)) => file.finish_with(*sidecar)?,
            Sink::File(file, None) => file.finish()?,
            Sink::Spd(folder) => folder.finish()?,
            Sink::Set(set) => return Ok(set.finish()?),
        }
        Ok(SetStatus::Sealed)
    }
}
