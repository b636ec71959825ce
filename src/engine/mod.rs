//! Draws in order, for programs without a GPU device of their own.
//!
//! A range is cut into windows, of which a few are in flight. Where the cuts fall never shows in the draws.

mod adapter;
#[cfg(any(test, feature = "report"))]
pub(crate) mod compute;
mod cpu;
mod exactness;
mod gpu;
mod reference;
mod schedule;
mod session;

use std::fmt;
use std::num::NonZeroUsize;
use std::ops::AddAssign;
use std::sync::Arc;

use half::f16;
use serde::Serialize;

use adapter::Wanted;
pub use adapter::{Adapter, ProbedAdapter, adapters, probed_adapters, wanted_backends};
pub use exactness::{ArithmeticChoice, ArithmeticVerdict, Probe, probe};
pub(crate) use schedule::{Job, Schedule};
pub use session::Session;

use crate::draw_status::DrawStatus;
use crate::quantity::{ArrayFormat, Dtype, Quantity};
use crate::random::stream::{DrawRange, Draws};
use crate::recipe::Recipe;
use crate::sampler::SamplerError;
use crate::threads::{self, ThreadError};

/// Choice of where to draw.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum EngineChoice {
    /// On the best hardware adapter, and on the CPU where there is none, or none that has the CPU's draws: software
    /// Vulkan gives the same draws, but slower.
    #[default]
    Auto,
    /// On the best adapter, hardware before software.
    Gpu,
    /// On the adapter of this index in [`adapters`], or whose name holds this text, in any case.
    Adapter(String),
    /// On the CPU, without any driver.
    Cpu,
}

/// Error returned where draws cannot be made, or not all of them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum EngineError {
    #[error("no adapter {}; {}", named(wanted), available(found))]
    NoAdapter { wanted: WantedAdapter, found: Vec<Adapter> },
    #[error("no graphics adapter was found: {}, or draw on the CPU", adapter::remedy())]
    NoAdapters,
    #[error(
        "the variable WGPU_BACKEND is {value:?}, and the interfaces are vulkan, metal, dx12 and gl, of which this build \
         has {}: unset it, or name one of them",
        adapter::compiled()
    )]
    UnknownBackend { value: String },
    #[error("adapter {adapter}: {reason}")]
    Gpu { adapter: String, reason: String },
    #[error(
        "adapter {adapter}: the {quantity} of draw {index} are not those of the CPU: draw on the CPU, or in exact \
         arithmetic"
    )]
    Differs { adapter: String, index: u64, quantity: Quantity },
    #[error(transparent)]
    Threads(#[from] ThreadError),
    #[error(transparent)]
    Range(#[from] SamplerError),
    #[error(
        "draw {index} found no acceptable candidate in {attempts} attempts: allow more attempts, or ask for less \
         extreme spectra"
    )]
    Exhausted { index: u64, attempts: u32 },
    #[error(
        "number {element} of {group:?} in scene {scene} found no acceptable candidate in {attempts} attempts: allow \
         more attempts, or ask for less extreme spectra"
    )]
    ExhaustedInScene { group: String, scene: u64, element: u64, attempts: u32 },
}

/// The index or the name of an adapter, and who asked for it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct WantedAdapter {
    /// The index, or part of the name.
    pub name: String,
    /// Whether the variable `WGPU_ADAPTER_NAME` asked for it, and not the caller.
    pub is_from_variable: bool,
}

/// An index as it stands, and a name in quotes.
fn named(wanted: &WantedAdapter) -> String {
    let WantedAdapter { name, is_from_variable } = wanted;
    let name = if name.bytes().all(|b| b.is_ascii_digit()) { name.to_owned() } else { format!("{name:?}") };
    if *is_from_variable { format!("{name}, as the variable WGPU_ADAPTER_NAME asks for") } else { name }
}

fn available(found: &[Adapter]) -> String {
    match found {
        [] => format!("there is none: {}", adapter::remedy()),
        [only] => format!("there is only 0: {only}"),
        all => {
            let lines = all.iter().enumerate().map(|(i, a)| format!("\n  {i}: {a}"));
            format!("there are:{}", lines.collect::<String>())
        }
    }
}

/// Engine that draws: an adapter that it opens, or the CPU. While the caller has one window of draws the next ones
/// are being computed; memory is bounded by the windows in flight, whatever the range.
///
/// ```
/// use spectroll::{EngineChoice, Engine, Model, Recipe, Stream};
///
/// let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).build()?;
/// let engine = Engine::new(&EngineChoice::Cpu)?;
/// let spectra = engine.collect(&recipe, Stream::new(1).draws(0..1000))?;
/// assert_eq!(spectra.len(), 1000 * recipe.model().bands());
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Debug)]
pub struct Engine {
    device: Device,
}

#[derive(Debug)]
enum Device {
    Gpu(gpu::Gpu),
    Cpu(cpu::Threads),
}

/// A window of draws, as the caller receives them: an array for each quantity that the recipe asks for, and statuses.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Range of the draws; of those of a list ([`Stream::at`](crate::Stream::at)) it has their places in the list.
    pub draws: DrawRange,
    formats: &'a [ArrayFormat],
    /// The bytes of each quantity.
    arrays: [&'a [u8]; Quantity::COUNT],
}

/// Counts over a range of draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct DrawSummary {
    /// Number of draws made.
    pub draws: u64,
    /// Number of candidates they took.
    pub attempts: u64,
    /// Number of draws that scaling took to 1 or above in some band ([`Bounds::Base`](crate::Bounds::Base)).
    pub above_one: u64,
}

impl<'a> Batch<'a> {
    /// A batch of arrays, in the order of the formats. They may be longer than they need be.
    fn new(
        draws: DrawRange,
        formats: &'a [ArrayFormat],
        arrays: impl IntoIterator<Item = &'a [u8]>,
    ) -> Batch<'a> {
        let mut batch = Batch { draws, formats, arrays: [&[]; Quantity::COUNT] };
        for (format, bytes) in formats.iter().zip(arrays) {
            batch.arrays[format.quantity as usize] = &bytes[..format.bytes(draws.count) as usize];
        }
        batch
    }

    /// Formats of the arrays, in the order of [`Quantity`]. Planes are [`draws.count`](Batch::draws) apart, rounded
    /// up to a multiple of 4.
    pub fn formats(&self) -> &'a [ArrayFormat] {
        self.formats
    }

    /// The bytes of a quantity, in this machine's order; empty where the recipe does not ask for it.
    pub fn bytes(&self, quantity: Quantity) -> &'a [u8] {
        self.arrays[quantity as usize]
    }

    /// The values of a quantity in 32 bits, in the order of its [`ArrayFormat`]; empty where the recipe does not ask
    /// for it.
    ///
    /// # Panics
    /// Where they are not [`Dtype::F32`]: spectra in 16 bits, and attempts.
    pub fn values(&self, quantity: Quantity) -> &'a [f32] {
        let other = |f: &&ArrayFormat| f.quantity == quantity && f.dtype != Dtype::F32;
        if let Some(format) = self.formats.iter().find(other) {
            panic!("the {quantity} are {:?}, not F32", format.dtype);
        }
        bytemuck::cast_slice(self.bytes(quantity))
    }

    /// The spectra: [`Batch::values`] of [`Quantity::Spectra`].
    pub fn spectra(&self) -> &'a [f32] {
        self.values(Quantity::Spectra)
    }

    /// The spectra of a recipe that asks for them in 16 bits.
    ///
    /// # Panics
    /// Where they have 32.
    pub fn half_spectra(&self) -> &'a [f16] {
        let single = |f: &ArrayFormat| f.quantity == Quantity::Spectra && f.dtype == Dtype::F32;
        assert!(!self.formats.iter().any(single), "the spectra are F32, not F16");
        bytemuck::cast_slice(self.bytes(Quantity::Spectra))
    }

    /// Status of each draw.
    pub fn statuses(&self) -> &'a [DrawStatus] {
        bytemuck::cast_slice(self.bytes(Quantity::Attempts))
    }
}

impl DrawSummary {
    /// The share of candidates that were accepted; `None` where there were none.
    pub fn acceptance(&self) -> Option<f64> {
        (self.attempts > 0).then(|| self.draws as f64 / self.attempts as f64)
    }

    /// Adds a batch of draws, all of which must have succeeded.
    fn add(&mut self, batch: &Batch, draws: Draws, max_attempts: u32) -> Result<(), EngineError> {
        if let Some(failed) = batch.statuses().iter().position(|t| t.attempts() == 0) {
            let before = batch.draws.first.wrapping_sub(draws.range.first);
            let index = draws.index(before.wrapping_add(failed as u64));
            return Err(EngineError::Exhausted { index, attempts: max_attempts });
        }
        self.count(batch.statuses());
        Ok(())
    }

    /// Adds those of a batch of draws that succeeded.
    fn count_answered(&mut self, statuses: &[DrawStatus]) {
        let answered = statuses.iter().filter(|status| status.attempts() > 0);
        self.count(&answered.copied().collect::<Vec<_>>());
    }

    /// Adds draws that succeeded.
    pub(crate) fn count(&mut self, statuses: &[DrawStatus]) {
        self.draws += statuses.len() as u64;
        self.attempts += statuses.iter().map(|t| u64::from(t.attempts())).sum::<u64>();
        self.above_one += statuses.iter().filter(|t| t.above_one()).count() as u64;
    }
}

impl AddAssign for DrawSummary {
    fn add_assign(&mut self, other: DrawSummary) {
        self.draws += other.draws;
        self.attempts += other.attempts;
        self.above_one += other.above_one;
    }
}

impl Engine {
    /// Opens the engine of `choice`. The variable `WGPU_ADAPTER_NAME` names the adapter where `choice` does not.
    pub fn new(choice: &EngineChoice) -> Result<Engine, EngineError> {
        Engine::with_threads(choice, None)
    }

    /// Opens the engine of `choice`; if that is the CPU, with this number of threads, or one per core where it is
    /// `None`. One thread is that of the caller: several callers then draw at the same time, each on its own, and no
    /// thread is kept that the child of a fork would wait for.
    pub fn with_threads(choice: &EngineChoice, threads: Option<NonZeroUsize>) -> Result<Engine, EngineError> {
        let adapter = match choice {
            EngineChoice::Cpu => None,
            EngineChoice::Auto => adapter::best(Wanted::Hardware)?,
            EngineChoice::Gpu => Some(adapter::best(Wanted::Any)?.ok_or(EngineError::NoAdapters)?),
            EngineChoice::Adapter(wanted) => {
                Some(adapter::find(WantedAdapter { name: wanted.clone(), is_from_variable: false })?)
            }
        };
        if let Some(adapter) = adapter {
            let gpu = gpu::Gpu::open(adapter)?;
            let is_right =
                *choice != EngineChoice::Auto || exactness::standard(&gpu, ArithmeticChoice::Auto)?.is_exact;
            if is_right {
                return Ok(Engine { device: Device::Gpu(gpu) });
            }
        }
        Ok(Engine { device: Device::Cpu(cpu::Threads::new(threads)?) })
    }

    /// Sets the arithmetic in which an adapter draws ([`ArithmeticChoice::Auto`]). The CPU has but one.
    pub fn with_arithmetic(mut self, choice: ArithmeticChoice) -> Engine {
        if let Device::Gpu(gpu) = &mut self.device {
            gpu.arithmetic = choice;
        }
        self
    }

    /// Makes a share of the windows of an adapter, at least the first of each session, again on the CPU, and ends with
    /// [`EngineError::Differs`] where a byte differs. The share is between 0, which checks none, and 1 (0).
    pub fn with_recheck(mut self, share: f64) -> Engine {
        if let Device::Gpu(gpu) = &mut self.device {
            gpu.recheck = share;
        }
        self
    }

    /// Form of arithmetic of the sessions so far, and whether their draws are those of the CPU, by the trial that each
    /// began with; the lesser of several. `None` on the CPU, and before the first.
    pub fn verdict(&self) -> Option<ArithmeticVerdict> {
        match &self.device {
            Device::Gpu(gpu) => gpu.verdict(),
            Device::Cpu(_) => None,
        }
    }

    /// Number of draws that were made again on the CPU, and were the same. See [`Engine::with_recheck`].
    pub fn rechecked(&self) -> u64 {
        match &self.device {
            Device::Gpu(gpu) => gpu.rechecked(),
            Device::Cpu(_) => 0,
        }
    }

    /// Whether all draws so far are those of the CPU.
    pub fn is_exact(&self) -> bool {
        self.verdict().is_none_or(|verdict| verdict.is_exact)
    }

    #[cfg(test)]
    fn gpu(&self) -> Option<&gpu::Gpu> {
        match &self.device {
            Device::Gpu(gpu) => Some(gpu),
            Device::Cpu(_) => None,
        }
    }

    /// Adapter that draws; `None` on the CPU.
    pub fn adapter(&self) -> Option<&Adapter> {
        match &self.device {
            Device::Gpu(gpu) => Some(gpu.adapter()),
            Device::Cpu(_) => None,
        }
    }

    /// Threads for work that no device does: the engine's own, where it has any.
    pub(crate) fn pool(&self) -> Result<Arc<rayon::ThreadPool>, EngineError> {
        match &self.device {
            Device::Gpu(_) => Ok(Arc::new(threads::pool(None)?)),
            Device::Cpu(threads) => threads.pool(),
        }
    }

    /// Device that draws and its queue, for tests and measurements.
    #[cfg(any(test, feature = "report"))]
    pub(crate) fn device(&self) -> Option<(&wgpu::Device, &wgpu::Queue)> {
        match &self.device {
            Device::Gpu(gpu) => Some(gpu.device()),
            Device::Cpu(_) => None,
        }
    }

    /// Waits until the device has finished all submitted work.
    #[cfg(feature = "report")]
    pub(crate) fn wait(&self) -> Result<(), EngineError> {
        match &self.device {
            Device::Gpu(gpu) => gpu.poll(wgpu::PollType::wait_indefinitely()),
            Device::Cpu(_) => Ok(()),
        }
    }

    /// Draws a range and hands it to `sink` in order. For more than one range, [`Session::draw`] is faster.
    pub fn draw<E: From<EngineError>>(
        &self,
        recipe: &Recipe,
        draws: DrawRange,
        sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<DrawSummary, E> {
        self.session(recipe)?.draw(draws, sink)
    }

    /// Draws a range and returns its spectra. For more than one range, [`Session::fill`] is faster.
    ///
    /// # Panics
    /// Where [`Session::fill`] does.
    pub fn collect(&self, recipe: &Recipe, draws: DrawRange) -> Result<Vec<f32>, EngineError> {
        let mut session = self.session(recipe)?;
        let mut spectra = vec![0.0; session.values(draws)];
        session.fill(draws, &mut spectra)?;
        Ok(spectra)
    }
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.device {
            Device::Gpu(gpu) => gpu.adapter().fmt(f),
            Device::Cpu(threads) if threads.count() == 1 => f.write_str("CPU (1 thread)"),
            Device::Cpu(threads) => write!(f, "CPU ({} threads)", threads.count()),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::stream::Stream;

    #[test]
    fn a_draw_that_failed_is_named_by_its_index() {
        let formats = [ArrayFormat::status()];
        let statuses = [DrawStatus::accepted(1, false), DrawStatus::FAILED];
        let failed = |draws: Draws, window: DrawRange| {
            let batch = Batch::new(window, &formats, [bytemuck::cast_slice(&statuses)]);
            match DrawSummary::default().add(&batch, draws, 9) {
                Err(EngineError::Exhausted { index, attempts: 9 }) => index,
                other => panic!("{other:?}"),
            }
        };
        let stream = Stream::new(0);
        assert_eq!(failed(stream.draws(100..200).into(), stream.draws(150..152)), 151);
        let list = stream.at(&[10, 20, 30, 40]);
        assert_eq!(failed(list, list.part(2, 2).range), 40);
    }
}
