//! Recipes with their engines, and draws into memory of Python's.

use std::collections::HashMap;
use std::num::NonZeroUsize;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use numpy::{PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use self_cell::self_cell;

use spectroll::{
    Arithmetic, ArithmeticChoice, ArrayFormat, DrawStatus, DrawSummary, Draws, Dtype, Engine, EngineChoice,
    Layout, ModuleOptions, Quantity, Recipe, RecipeSettings, Session, Stream,
};

use crate::error::{Error, Result, check_signals, value};
use crate::model::{Model, choice};
use crate::process::PerProcess;

/// Number of draws between two looks at whether somebody pressed Ctrl-C: some 20 ms.
const BLOCK: u64 = 1 << 19;

/// Name of an engine, its number of threads, and the name of its arithmetic.
pub(crate) type Request<'a> = (&'a str, Option<usize>, &'a str);

/// Engines by their choice, number of threads and arithmetic.
type Engines = HashMap<(String, usize, ArithmeticChoice), Arc<Engine>>;

/// Name, type, width, axis and channels of an array.
type Format = (&'static str, &'static str, usize, Option<&'static str>, Vec<String>);

/// Open engines. They stay open, as a device takes long to open.
static ENGINES: PerProcess<Mutex<Engines>> = PerProcess::new();

/// Engine that is asked for.
#[derive(Clone)]
pub(crate) struct EngineRequest {
    name: String,
    choice: EngineChoice,
    threads: Option<NonZeroUsize>,
    arithmetic: ArithmeticChoice,
}

impl EngineRequest {
    pub(crate) fn new((name, threads, arithmetic): Request) -> Result<EngineRequest> {
        let choice = match name {
            "auto" => EngineChoice::Auto,
            "cpu" => EngineChoice::Cpu,
            "gpu" => EngineChoice::Gpu,
            adapter => EngineChoice::Adapter(adapter.to_owned()),
        };
        let threads = threads.map(|count| {
            NonZeroUsize::new(count)
                .ok_or_else(|| value("threads=0: it is at least 1, or None for one per core"))
        });
        let forms = [
            ("auto", ArithmeticChoice::Auto),
            ("plain", ArithmeticChoice::Plain),
            ("exact", ArithmeticChoice::Exact),
        ];
        let arithmetic = self::choice("arithmetic", arithmetic, &forms)?;
        Ok(EngineRequest { name: name.to_owned(), choice, threads: threads.transpose()?, arithmetic })
    }

    /// The engine of this process.
    pub(crate) fn engine(&self) -> Result<Arc<Engine>> {
        let mut engines = lock(ENGINES.get());
        let key = (self.name.clone(), self.threads.map_or(0, NonZeroUsize::get), self.arithmetic);
        if let Some(engine) = engines.get(&key) {
            return Ok(engine.clone());
        }
        let engine = Engine::with_threads(&self.choice, self.threads)?.with_arithmetic(self.arithmetic);
        let engine = Arc::new(engine);
        engines.insert(key, engine.clone());
        Ok(engine)
    }
}

/// Locks, whatever became of another holder.
fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// An engine with a recipe, which a session borrows.
struct Owner {
    engine: Arc<Engine>,
    recipe: Arc<Recipe>,
}

self_cell!(
    /// A session with what it borrows.
    struct Drawing {
        owner: Owner,
        #[not_covariant]
        dependent: Session,
    }
);

/// Sessions of a process that nobody draws from at the moment.
#[derive(Default)]
struct Sessions {
    idle: Mutex<Vec<Drawing>>,
    /// Held while a GPU draws: more than one session would only take its memory.
    device: Mutex<()>,
}

/// A recipe and the engine that is to draw it.
#[pyclass(frozen, module = "spectroll._spectroll")]
pub(crate) struct Sampler {
    pub(crate) recipe: Arc<Recipe>,
    pub(crate) model_name: String,
    pub(crate) request: EngineRequest,
    sessions: PerProcess<Sessions>,
}

#[pymethods]
impl Sampler {
    /// A sampler of a model: `settings` are those of a recipe as JSON.
    #[new]
    fn new(
        py: Python<'_>,
        model: &Bound<'_, Model>,
        settings: &str,
        layout: &str,
        dtype: &str,
        engine: Request,
    ) -> PyResult<Sampler> {
        let layouts =
            [("rows", Layout::Rows), ("padded-rows", Layout::PaddedRows), ("planes", Layout::Planes)];
        let layout = choice("layout", layout, &layouts)?;
        let dtype = choice("dtype", dtype, &[("float32", Dtype::F32), ("float16", Dtype::F16)])?;
        let settings: RecipeSettings = serde_json::from_str(settings).map_err(value)?;
        let request = EngineRequest::new(engine)?;
        let Model { model, name } = model.get();
        let builder = settings.builder(model).layout(layout).spectra_dtype(dtype);
        let recipe = py.detach(|| builder.build()).map_err(Error::from)?;
        let (recipe, model_name) = (Arc::new(recipe), name.clone());
        Ok(Sampler { recipe, model_name, request, sessions: PerProcess::new() })
    }

    #[getter]
    fn acceptance(&self) -> f64 {
        self.recipe.acceptance()
    }

    #[getter]
    fn probability(&self) -> f64 {
        self.recipe.probability()
    }

    /// The engine, by its name; this opens it.
    fn engine(&self, py: Python<'_>) -> PyResult<String> {
        Ok(py.detach(|| self.request.engine())?.to_string())
    }

    /// Formats of the arrays, in the order in which they are drawn.
    fn formats(&self) -> Vec<Format> {
        let formats = self.recipe.formats().into_iter();
        formats
            .map(|ArrayFormat { quantity, dtype, width, .. }| {
                (quantity.name(), dtype.name(), width, quantity.axis(), self.recipe.channels(quantity))
            })
            .collect()
    }

    /// The draws of a recipe as a WGSL module.
    fn wgsl(&self, prefix: &str, arithmetic: &str) -> PyResult<String> {
        let forms = [("plain", Arithmetic::Plain), ("exact", Arithmetic::Exact)];
        let arithmetic = choice("arithmetic", arithmetic, &forms)?;
        let options = ModuleOptions { arithmetic, ..ModuleOptions::default() };
        Ok(self.recipe.wgsl_with(prefix, options).map_err(Error::from)?)
    }

    /// The content of the buffer that the module declares; empty where it declares none.
    fn tables<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let is_declared = !self.recipe.keeps_tables_constant();
        PyBytes::new(py, &if is_declared { self.recipe.tables() } else { Vec::new() })
    }

    /// Draws a range of a source, a seed and the name of a stream, into the bytes of an array for each format. Returns the
    /// numbers of draws, of candidates, and of draws that scaling took to 1 or above.
    fn fill(
        &self,
        py: Python<'_>,
        first: u64,
        count: u64,
        source: (u64, Option<String>),
        arrays: Vec<PyReadwriteArray1<'_, u8>>,
    ) -> PyResult<(u64, u64, u64)> {
        let stream = self::stream(source.0, source.1.as_deref())?;
        self.fill_with(py, spectroll::DrawRange { stream, first, count }.into(), arrays)
    }

    /// Makes the draws of a list of indices as [`Sampler::fill`] does those of a range.
    fn fill_at(
        &self,
        py: Python<'_>,
        indices: PyReadonlyArray1<'_, u64>,
        source: (u64, Option<String>),
        arrays: Vec<PyReadwriteArray1<'_, u8>>,
    ) -> PyResult<(u64, u64, u64)> {
        let stream = self::stream(source.0, source.1.as_deref())?;
        self.fill_with(py, stream.at(indices.as_slice().map_err(value)?), arrays)
    }
}

impl Sampler {
    fn fill_with(
        &self,
        py: Python<'_>,
        draws: Draws<'_>,
        mut arrays: Vec<PyReadwriteArray1<'_, u8>>,
    ) -> PyResult<(u64, u64, u64)> {
        let slices = arrays.iter_mut().map(|array| array.as_slice_mut());
        let mut slices = slices.collect::<std::result::Result<Vec<_>, _>>().map_err(value)?;
        let formats = self.recipe.formats();
        let summary = py.detach(|| {
            let summary = self.with_session(|session| fill(session, &formats, draws, &mut slices))?;
            let mut arrays = formats.iter().zip(&mut slices);
            if let Some((_, statuses)) = arrays.find(|(format, _)| format.quantity == Quantity::Attempts) {
                count_attempts(statuses);
            }
            Ok::<_, Error>(summary)
        })?;
        Ok((summary.draws, summary.attempts, summary.above_one))
    }

    /// Works with a session that nobody else uses.
    fn with_session<T>(&self, work: impl FnOnce(&mut Session<'_>) -> Result<T>) -> Result<T> {
        let sessions = self.sessions.get();
        let engine = self.request.engine()?;
        let _held = engine.adapter().is_some().then(|| lock(&sessions.device));
        let idle = lock(&sessions.idle).pop();
        let mut drawing = match idle {
            Some(drawing) => drawing,
            None => {
                let owner = Owner { engine, recipe: self.recipe.clone() };
                Drawing::try_new(owner, |owner| owner.engine.session(&owner.recipe))?
            }
        };
        let done = drawing.with_dependent_mut(|_, session| work(session))?;
        lock(&sessions.idle).push(drawing); // not after an error, which may have lost some of its buffers
        Ok(done)
    }
}

/// The stream of a name under a seed.
pub(crate) fn stream(seed: u64, name: Option<&str>) -> Result<Stream> {
    let unnamed = Stream::new(seed);
    let Some(name) = name else { return Ok(unnamed) };
    let stream = Stream::named(seed, name);
    if stream == unnamed {
        return Err(value(format!(
            "stream={name:?} has by its hash the draws of no stream: choose another name"
        )));
    }
    Ok(stream)
}

/// Draws into arrays, block by block, so that Ctrl-C is heard.
fn fill(
    session: &mut Session<'_>,
    formats: &[ArrayFormat],
    draws: Draws<'_>,
    arrays: &mut [&mut [u8]],
) -> Result<DrawSummary> {
    if draws.count() <= BLOCK {
        return Ok(session.fill_arrays(draws, arrays)?);
    }
    let mut summary = DrawSummary::default();
    let mut done = 0;
    let mut scratch = Vec::new();
    while done < draws.count() {
        let count = BLOCK.min(draws.count() - done);
        let part = draws.part(done, count);
        if formats.iter().all(|format| format.planes() == 1) {
            let blocks = formats.iter().zip(&mut *arrays);
            let mut blocks: Vec<&mut [u8]> = blocks
                .map(|(format, array)| {
                    &mut array[format.bytes(done) as usize..][..format.bytes(count) as usize]
                })
                .collect();
            summary += session.fill_arrays(part, &mut blocks)?;
        } else {
            scratch.resize_with(formats.len(), Vec::new);
            for (format, block) in formats.iter().zip(&mut scratch) {
                block.resize(format.bytes(count) as usize, 0);
            }
            let mut blocks: Vec<&mut [u8]> = scratch.iter_mut().map(Vec::as_mut_slice).collect();
            summary += session.fill_arrays(part, &mut blocks)?;
            for ((format, block), array) in formats.iter().zip(&blocks).zip(&mut *arrays) {
                put(format, (block, count), (array, draws.count()), done);
            }
        }
        done += count;
        check_signals()?;
    }
    Ok(summary)
}

/// Puts the planes of a block of draws where they belong in those of all draws, `done` draws in.
fn put(format: &ArrayFormat, (block, count): (&[u8], u64), (array, all): (&mut [u8], u64), done: u64) {
    let size = |draws: u64| draws as usize * format.stride() * format.dtype.size();
    let plane = |draws: u64| format.bytes(draws) as usize / format.planes();
    for (from, to) in block.chunks(plane(count)).zip(array.chunks_mut(plane(all))) {
        to[size(done)..][..size(count)].copy_from_slice(&from[..size(count)]);
    }
}

/// Turns statuses into the numbers of candidates that they hold.
fn count_attempts(statuses: &mut [u8]) {
    for word in statuses.chunks_exact_mut(size_of::<DrawStatus>()) {
        let status: DrawStatus = bytemuck::pod_read_unaligned(word);
        word.copy_from_slice(&status.attempts().to_ne_bytes());
    }
}
