//! Data sets: what the program writes, with progress and Ctrl-C.

use std::ops::{ControlFlow, Range};
use std::path::PathBuf;

use pyo3::exceptions::PyKeyboardInterrupt;
use pyo3::prelude::*;

use spectroll::export::{
    ArraySelection, DrawExport, ExportError, Output, Rows, SceneExport, SpaceCheck, Writing,
};
use spectroll::output::{ChunkFormat, FileFormat, SetMode, SetStatus, Shard};
use spectroll::{DrawRange, Dtype, export::Destination};

use crate::error::{Error, Result, check_signals, value};
use crate::model::choice;
use crate::sampler::{Sampler, stream};
use crate::scene::Scene;

/// Options of a data set, as they come from Python.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub(crate) struct Options {
    path: PathBuf,
    is_folder: bool,
    format: Option<String>,
    dtype: Option<String>,
    chunk: Option<u64>,
    zstd: Option<i32>,
    /// Part of a set, from 1, and number of parts.
    shard: Option<(u64, u64)>,
    resume: bool,
    overwrite: bool,
    sidecar: bool,
    check_space: bool,
}

impl Options {
    fn output(&self) -> Result<Output> {
        let destination = self.destination()?;
        let dtypes = [("float32", Dtype::F32), ("float16", Dtype::F16), ("float64", Dtype::F64)];
        let dtype = self.dtype.as_deref().map_or(Ok(Dtype::F32), |name| choice("dtype", name, &dtypes))?;
        let mode = match (self.resume, self.overwrite) {
            (true, true) => return Err(value("resume=True goes on with what overwrite=True would replace")),
            (true, false) => SetMode::Resume,
            (false, true) => SetMode::Replace,
            (false, false) => SetMode::Create,
        };
        let mut output = Output::at(&self.path, destination).dtype(dtype).mode(mode);
        if let Some(chunk) = self.chunk {
            output = output.chunk(chunk);
        }
        if let Some((index, count)) = self.shard {
            output = output.shard(Shard { index, count });
        }
        if self.sidecar {
            output = output.with_sidecar();
        }
        if !self.check_space {
            output = output.space_check(SpaceCheck::Skip);
        }
        Ok(output)
    }

    fn destination(&self) -> Result<Destination> {
        let formats = [
            ("npy", FileFormat::Npy),
            ("npz", FileFormat::Npz),
            ("csv", FileFormat::Csv),
            ("h5", FileFormat::Hdf5),
            ("mat", FileFormat::Mat),
            ("parquet", FileFormat::Parquet),
            ("zarr", FileFormat::Zarr),
            ("spd", FileFormat::Spd),
        ];
        let format = match &self.format {
            Some(name) => choice("format", name, &formats)?,
            None => FileFormat::of(&self.path)?,
        };
        let destination = match format {
            FileFormat::Zarr => Destination::Set(ChunkFormat::Zarr { zstd: self.zstd }),
            FileFormat::Spd => Destination::SpdFolder,
            FileFormat::Npy if self.is_folder => Destination::Set(ChunkFormat::Npy),
            FileFormat::Parquet if self.is_folder => Destination::Set(ChunkFormat::Parquet),
            _ if self.is_folder => {
                return Err(value("a folder holds parts, with format=\"npy\" or \"parquet\", or spd files"));
            }
            file => Destination::File(file),
        };
        let is_set = matches!(destination, Destination::Set(_));
        if self.zstd.is_some() && !matches!(destination, Destination::Set(ChunkFormat::Zarr { .. })) {
            return Err(value("zstd= packs the chunks of a .zarr, and of nothing else"));
        }
        if self.sidecar && !matches!(destination, Destination::File(_)) {
            return Err(value("sidecar=True is for single files: sets of chunks have a manifest"));
        }
        let of_sets =
            [("chunk", self.chunk.is_some()), ("shard", self.shard.is_some()), ("resume", self.resume)];
        match of_sets.iter().find(|(_, given)| *given && !is_set) {
            Some((argument, _)) => Err(value(format!(
                "{argument}= needs an output of many files: name it .zarr, or a folder (\"name/\") with \
                 format=\"npy\" or \"parquet\""
            ))),
            None => Ok(destination),
        }
    }
}

/// Result of a run: draws, candidates, draws that reach 1, and whether the data set is complete.
type Written = (u64, u64, u64, bool);

/// Writes draws of a sampler. `progress` is called with the number of all rows that are to be drawn and 0, and then with
/// that of each window.
#[pyfunction]
pub(crate) fn write_draws(
    py: Python<'_>,
    sampler: &Bound<'_, Sampler>,
    draws: (u64, u64),
    source: (u64, Option<String>),
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<Written> {
    let ((first, count), (seed, name)) = (draws, source);
    let stream = stream(seed, name.as_deref())?;
    let sampler = sampler.get();
    let written = py.detach(|| -> Result<Written> {
        let draws = DrawRange { stream, first, count };
        let export = DrawExport::new(&sampler.recipe, draws)
            .model_name(&sampler.model_name)
            .stream_name(name.as_deref());
        let output = options.output()?;
        let (schema, companions) = (export.schema(&output), export.companions());
        output.check(&schema, &companions)?;
        let engine = sampler.request.engine()?;
        output.check_space(&schema, &companions)?;
        let mut rows = export.rows(&engine)?;
        let writing = Writing::open(&output, schema, &companions, &engine, &mut rows)?;
        let status = run(writing, &mut rows, progress.as_ref())?;
        let summary = rows.summary;
        Ok((summary.draws, summary.attempts, summary.above_one, status == SetStatus::Sealed))
    });
    Ok(written?)
}

/// Writes some scenes as [`write_draws`] does draws. Returns whether the data set is complete.
#[pyfunction]
pub(crate) fn write_scenes(
    py: Python<'_>,
    scene: &Bound<'_, Scene>,
    scenes: (u64, u64),
    options: Options,
    progress: Option<Py<PyAny>>,
) -> PyResult<bool> {
    let scene = scene.get();
    let written = py.detach(|| -> Result<bool> {
        let scenes: Range<u64> = scenes.0..scenes.1;
        let export = SceneExport::new(&scene.scene, scenes)
            .selection(ArraySelection::default())
            .file(&scene.file_name, &scene.text);
        let output = options.output()?;
        let (schema, companions) = (export.schema(&output), export.companions());
        output.check(&schema, &companions)?;
        let engine = scene.request.engine()?;
        output.check_space(&schema, &companions)?;
        let mut rows = export.rows(&engine, &schema)?;
        let writing = Writing::open(&output, schema, &companions, &engine, &mut rows)?;
        Ok(run(writing, &mut rows, progress.as_ref())? == SetStatus::Sealed)
    });
    Ok(written?)
}

/// Draws the rows that are missing and completes the output, and calls `progress` on the way. An exception of it, or
/// Ctrl-C, ends that and leaves a set as far as it is.
fn run(writing: Writing, rows: &mut dyn Rows, progress: Option<&Py<PyAny>>) -> Result<SetStatus> {
    let missing: u64 = writing.missing().iter().map(|rows| rows.end - rows.start).sum();
    let told = |all: Option<u64>, rows: u64| -> PyResult<()> {
        check_signals()?;
        let Some(progress) = progress else { return Ok(()) };
        Python::attach(|py| progress.call1(py, (all, rows)).map(drop))
    };
    let mut raised = told(Some(missing), 0).err();
    let result = writing.run(rows, &mut |count| {
        if raised.is_none() {
            raised = told(None, count).err();
        }
        if raised.is_some() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    });
    match (result, raised) {
        (Ok(status), None) => Ok(status),
        (Err(error), Some(raised)) if is_interrupt(&error) => {
            let is_ctrl_c = Python::attach(|py| raised.is_instance_of::<PyKeyboardInterrupt>(py));
            Err(if is_ctrl_c { error.into() } else { Error::from(raised) })
        }
        (Err(error), _) => Err(error.into()),
        // It was complete by then.
        (Ok(_), Some(raised)) => Err(raised.into()),
    }
}

/// Whether an error says that `watch` ended the work.
fn is_interrupt(error: &ExportError) -> bool {
    match error {
        ExportError::Interrupted => true,
        ExportError::Unfinished { cause, .. } => is_interrupt(cause),
        _ => false,
    }
}
