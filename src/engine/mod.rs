//! Draws in order, for programs without a GPU device of their own.
//!
//! A range is cut into windows, of which a few are in flight. Where the cuts fall never shows in the draws.

mod adapter;
mod cpu;
mod gpu;

use std::fmt;
use std::num::NonZeroUsize;
use std::ops::AddAssign;
use std::time::{Duration, Instant};

use half::f16;
use serde::Serialize;

use adapter::Wanted;
pub use adapter::{Adapter, adapters};

use crate::program::Tally;
use crate::quantity::{Element, Format, Layout, Quantity};
use crate::recipe::Recipe;
use crate::sampler::SamplerError;
use crate::stream::Draws;

/// The most bytes of a quantity in one window: all windows in flight stay in a cache of 32 MiB.
const WINDOW_BYTES: u64 = 8 << 20;

/// How long a window should take: short enough for an interrupt and for any watchdog, long enough to hide the cost of
/// starting one.
const WINDOW_TIME: Duration = Duration::from_millis(60);

/// Where to draw.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// On the best hardware adapter, and on the CPU where there is none: software Vulkan gives the same draws, but
    /// slower.
    #[default]
    Auto,
    /// On the best adapter, hardware before software.
    Gpu,
    /// On the adapter of this index in [`adapters`], or whose name holds this text, in any case.
    Adapter(String),
    /// On the CPU, without any driver.
    Cpu,
}

/// Why draws cannot be made, or not all of them.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum EngineError {
    #[error("no adapter {wanted:?}; {}", available(found))]
    NoAdapter { wanted: String, found: Vec<Adapter> },
    #[error(
        "no graphics adapter was found: install a Vulkan driver (Debian: mesa-vulkan-drivers), or pass --engine cpu"
    )]
    NoAdapters,
    #[error("adapter {adapter}: {reason}")]
    Gpu { adapter: String, reason: String },
    #[error("cannot start the threads to draw with: {0}; ask for fewer")]
    Threads(String),
    #[error(transparent)]
    Range(#[from] SamplerError),
    #[error(
        "draw {index} found no acceptable candidate in {attempts} attempts: allow more, or ask for less extreme spectra"
    )]
    Exhausted { index: u64, attempts: u32 },
    #[error(
        "number {element} of {group:?} in scene {scene} found no acceptable candidate in {attempts} attempts: allow \
         more, or ask for less extreme spectra"
    )]
    ExhaustedInScene { group: String, scene: u64, element: u64, attempts: u32 },
}

fn available(found: &[Adapter]) -> String {
    match found {
        [] => "this machine has none".to_owned(),
        all => {
            let lines = all.iter().enumerate().map(|(i, a)| format!("\n  {i}: {a}"));
            format!("there are:{}", lines.collect::<String>())
        }
    }
}

/// What draws: an adapter that it opens, or the CPU. While the caller has one window of draws the next ones are being
/// computed; memory is bounded by the windows in flight, whatever the range.
///
/// ```
/// use spectroll::{Choice, Engine, Model, Recipe, Stream};
///
/// let recipe = Recipe::new(&Model::builtin("munsell-vrhel")?).build()?;
/// let engine = Engine::new(&Choice::Cpu)?;
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
    /// Threads of its own: those of a caller might all be waiting for their draws.
    Cpu(rayon::ThreadPool),
}

/// A window of draws, as they are handed to the caller: an array for each quantity that the recipe asks for, and
/// tallies.
#[derive(Clone, Copy, Debug)]
pub struct Batch<'a> {
    /// Which draws these are.
    pub draws: Draws,
    formats: &'a [Format],
    /// The bytes of each quantity.
    arrays: [&'a [u8]; Quantity::ALL.len()],
}

/// What a range of draws took.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Summary {
    /// How many draws were made.
    pub draws: u64,
    /// How many candidates that took.
    pub attempts: u64,
    /// How many draws scaling took to 1 or above in some band ([`Bounds::Base`](crate::Bounds::Base)).
    pub above_one: u64,
}

impl<'a> Batch<'a> {
    /// A batch of arrays, in the order of the formats. They may be longer than they need be.
    fn new(draws: Draws, formats: &'a [Format], arrays: impl IntoIterator<Item = &'a [u8]>) -> Batch<'a> {
        let mut batch = Batch { draws, formats, arrays: [&[]; Quantity::ALL.len()] };
        for (format, bytes) in formats.iter().zip(arrays) {
            batch.arrays[format.quantity as usize] = &bytes[..format.bytes(draws.count) as usize];
        }
        batch
    }

    /// What there is, in the order of [`Quantity`], and how it lies in its array. Planes are
    /// [`draws.count`](Batch::draws) apart, rounded up to a multiple of 4.
    pub fn formats(&self) -> &'a [Format] {
        self.formats
    }

    /// The bytes of a quantity, in this machine's order; none where the recipe does not ask for it.
    pub fn bytes(&self, quantity: Quantity) -> &'a [u8] {
        self.arrays[quantity as usize]
    }

    /// The values of a quantity in 32 bits, in the order of its [`Format`]; none where the recipe does not ask for it.
    ///
    /// # Panics
    /// Where they are not [`Element::F32`]: half spectra, and attempts.
    pub fn values(&self, quantity: Quantity) -> &'a [f32] {
        let other = |f: &&Format| f.quantity == quantity && f.element != Element::F32;
        if let Some(format) = self.formats.iter().find(other) {
            panic!("the {quantity} are {:?}, not F32", format.element);
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
        let single = |f: &Format| f.quantity == Quantity::Spectra && f.element == Element::F32;
        assert!(!self.formats.iter().any(single), "the spectra are F32, not F16");
        bytemuck::cast_slice(self.bytes(Quantity::Spectra))
    }

    /// What each draw took.
    pub fn tallies(&self) -> &'a [Tally] {
        bytemuck::cast_slice(self.bytes(Quantity::Attempts))
    }
}

impl Summary {
    /// The share of candidates that were accepted; `None` where there were none.
    pub fn acceptance(&self) -> Option<f64> {
        (self.attempts > 0).then(|| self.draws as f64 / self.attempts as f64)
    }

    fn add(&mut self, batch: &Batch, max_attempts: u32) -> Result<(), EngineError> {
        if let Some(failed) = batch.tallies().iter().position(|t| t.attempts() == 0) {
            let index = batch.draws.first.wrapping_add(failed as u64);
            return Err(EngineError::Exhausted { index, attempts: max_attempts });
        }
        self.count(batch.tallies());
        Ok(())
    }

    /// Adds draws that succeeded.
    pub(crate) fn count(&mut self, tallies: &[Tally]) {
        self.draws += tallies.len() as u64;
        self.attempts += tallies.iter().map(|t| u64::from(t.attempts())).sum::<u64>();
        self.above_one += tallies.iter().filter(|t| t.above_one()).count() as u64;
    }
}

impl AddAssign for Summary {
    fn add_assign(&mut self, other: Summary) {
        self.draws += other.draws;
        self.attempts += other.attempts;
        self.above_one += other.above_one;
    }
}

impl Engine {
    /// Opens what `choice` says. The variable `WGPU_ADAPTER_NAME` names the adapter where `choice` does not.
    pub fn new(choice: &Choice) -> Result<Engine, EngineError> {
        Engine::with_threads(choice, None)
    }

    /// The same, with so many threads if it comes to the CPU; one a core unless said.
    pub fn with_threads(choice: &Choice, threads: Option<NonZeroUsize>) -> Result<Engine, EngineError> {
        let adapter = match choice {
            Choice::Cpu => None,
            Choice::Auto => adapter::best(Wanted::Hardware)?,
            Choice::Gpu => Some(adapter::best(Wanted::Any)?.ok_or(EngineError::NoAdapters)?),
            Choice::Adapter(wanted) => Some(adapter::find(wanted)?),
        };
        let device = match adapter {
            Some(adapter) => Device::Gpu(gpu::Gpu::open(adapter)?),
            None => {
                let builder =
                    rayon::ThreadPoolBuilder::new().num_threads(threads.map_or(0, NonZeroUsize::get));
                Device::Cpu(builder.build().map_err(|e| EngineError::Threads(e.to_string()))?)
            }
        };
        Ok(Engine { device })
    }

    /// The adapter that draws; `None` on the CPU.
    pub fn adapter(&self) -> Option<&Adapter> {
        match &self.device {
            Device::Gpu(gpu) => Some(gpu.adapter()),
            Device::Cpu(_) => None,
        }
    }

    /// The device that draws and its queue, for tests and measurements of what runs on it.
    #[cfg(any(test, feature = "report"))]
    pub(crate) fn device(&self) -> Option<(&wgpu::Device, &wgpu::Queue)> {
        match &self.device {
            Device::Gpu(gpu) => Some(gpu.device()),
            Device::Cpu(_) => None,
        }
    }

    /// Waits until the device has done what its queue was given.
    #[cfg(feature = "report")]
    pub(crate) fn wait(&self) -> Result<(), EngineError> {
        match &self.device {
            Device::Gpu(gpu) => gpu.poll(wgpu::PollType::wait_indefinitely()),
            Device::Cpu(_) => Ok(()),
        }
    }

    /// Gets ready to draw from a recipe: what that takes (a compiled shader, buffers) is paid once, and serves any
    /// number of [`Drawer::draw`].
    pub fn drawer<'a>(&'a self, recipe: &'a Recipe) -> Result<Drawer<'a>, EngineError> {
        Ok(Drawer { recipe, ensemble: self.ensemble(&[Member { recipe, per_step: 1 }])? })
    }

    /// Gets ready to draw from several recipes at once. Members of one recipe share its shader.
    pub(crate) fn ensemble(&self, members: &[Member]) -> Result<Ensemble<'_>, EngineError> {
        Ok(Ensemble(match &self.device {
            Device::Gpu(gpu) => Way::Gpu(gpu::Drawer::new(gpu, members)?),
            Device::Cpu(pool) => Way::Cpu(cpu::Drawer::new(pool, members)),
        }))
    }

    /// Makes `draws` and hands them to `sink` in order, as [`Drawer::draw`] does, which is what to use for more than
    /// one range.
    pub fn draw<E: From<EngineError>>(
        &self,
        recipe: &Recipe,
        draws: Draws,
        sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<Summary, E> {
        self.drawer(recipe)?.draw(draws, sink)
    }

    /// Makes `draws` and returns their spectra, as [`Drawer::fill`] does, which is what to use for more than one range.
    ///
    /// # Panics
    /// Where [`Drawer::fill`] does.
    pub fn collect(&self, recipe: &Recipe, draws: Draws) -> Result<Vec<f32>, EngineError> {
        let mut drawer = self.drawer(recipe)?;
        let mut spectra = vec![0.0; drawer.values(draws)];
        drawer.fill(draws, &mut spectra)?;
        Ok(spectra)
    }
}

/// An engine with a recipe. See [`Engine::drawer`].
pub struct Drawer<'a> {
    recipe: &'a Recipe,
    ensemble: Ensemble<'a>,
}

impl Drawer<'_> {
    /// How many values the spectra of `draws` have: rows, one after the other.
    fn values(&self, draws: Draws) -> usize {
        let format = self.recipe.formats().into_iter().find(|format| format.quantity == Quantity::Spectra);
        let format = format.expect("the recipe asks for spectra");
        assert!(format.element == Element::F32, "the spectra are F16, not F32");
        assert!(format.layout != Layout::Planes, "spectra in planes cannot be put end to end");
        format.values(draws.count) as usize
    }

    /// Makes `draws` with their spectra in the caller's memory: draw by draw, a value for each band, and room
    /// for padding if the recipe asks for it, which the CPU leaves as it is. It writes the rest there as it makes it.
    ///
    /// # Panics
    /// Where the slice is not as long as they are, or the recipe asks for no spectra, in 16 bits, or in planes.
    pub fn fill(&mut self, draws: Draws, spectra: &mut [f32]) -> Result<Summary, EngineError> {
        assert_eq!(
            spectra.len(),
            self.values(draws),
            "{} draws do not fit what is there for them",
            draws.count
        );
        let mut summary = Summary::default();
        let max_attempts = self.recipe.program().max_attempts;
        match &mut self.ensemble.0 {
            _ if draws.count == 0 => {}
            Way::Gpu(drawer) => {
                let mut rest = spectra;
                drawer.draw(&[draws], draws.count, &mut |batches: &[Batch]| {
                    summary.add(&batches[0], max_attempts)?;
                    let values = batches[0].spectra();
                    let (window, after) = std::mem::take(&mut rest).split_at_mut(values.len());
                    window.copy_from_slice(values);
                    rest = after;
                    Ok::<_, EngineError>(())
                })?;
            }
            Way::Cpu(drawer) => drawer.fill(draws, bytemuck::cast_slice_mut(spectra), &mut |batch| {
                summary.add(&batch, max_attempts)
            })?,
        }
        Ok(summary)
    }

    /// Makes `draws` and hands them to `sink` in order, window by window. The first error ends it.
    pub fn draw<E: From<EngineError>>(
        &mut self,
        draws: Draws,
        mut sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<Summary, E> {
        let mut summary = Summary::default();
        let max_attempts = self.recipe.program().max_attempts;
        self.ensemble.draw(&[draws], draws.count, |batches| {
            summary.add(&batches[0], max_attempts)?;
            sink(batches[0])
        })?;
        Ok(summary)
    }
}

/// A recipe among several that are drawn together, step by step.
#[derive(Clone, Copy)]
pub(crate) struct Member<'a> {
    pub(crate) recipe: &'a Recipe,
    /// How many draws a step takes, at least 1.
    pub(crate) per_step: u64,
}

/// An engine with the members of an ensemble.
pub(crate) struct Ensemble<'a>(Way<'a>);

enum Way<'a> {
    Gpu(gpu::Drawer<'a>),
    Cpu(cpu::Drawer<'a>),
}

impl Ensemble<'_> {
    /// Makes the first `steps` steps of each member's draws, and hands them to `sink` window by window, a batch a
    /// member. A window is one submission for all members. Nothing is said of draws that failed.
    pub(crate) fn draw<E: From<EngineError>>(
        &mut self,
        draws: &[Draws],
        steps: u64,
        mut sink: impl FnMut(&[Batch]) -> Result<(), E>,
    ) -> Result<(), E> {
        match &mut self.0 {
            _ if steps == 0 => Ok(()),
            Way::Gpu(drawer) => drawer.draw(draws, steps, &mut sink),
            Way::Cpu(drawer) => drawer.draw(draws, steps, &mut sink),
        }
    }
}

impl fmt::Display for Engine {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.device {
            Device::Gpu(gpu) => gpu.adapter().fmt(f),
            Device::Cpu(pool) if pool.current_num_threads() == 1 => f.write_str("CPU (1 thread)"),
            Device::Cpu(pool) => write!(f, "CPU ({} threads)", pool.current_num_threads()),
        }
    }
}

/// How many steps the next window should have: grows or shrinks towards [`WINDOW_TIME`].
struct Pace {
    next: u64,
    most: u64,
    /// Windows have a multiple of this, so that none leaves half a thread idle and planes have no padding.
    grain: u64,
}

impl Pace {
    /// Windows of at most `most` steps of the members, whose `formats` come out. The first has about 10^5 candidates.
    fn new<'a>(members: &[Member], formats: impl Iterator<Item = &'a [Format]>, most: u64) -> Pace {
        let four_steps = |(member, formats): (&Member, &'a [Format])| {
            formats.iter().map(|format| format.bytes(4 * member.per_step)).max()
        };
        let bytes = members.iter().zip(formats).filter_map(four_steps).max().expect("something comes out");
        let candidates =
            members.iter().map(|member| member.per_step as f64 / member.recipe.acceptance()).sum::<f64>();
        let grain = if members.iter().all(|member| member.per_step == 1) { 4 } else { 1 };
        let most = most.min(4 * WINDOW_BYTES / bytes).max(grain) / grain * grain;
        Pace { next: ((1e5 / candidates) as u64).clamp(grain, most), most, grain }
    }

    /// Learns from a window of `steps` that took until now from `start`.
    fn learn(&mut self, steps: u64, start: Instant) {
        let ratio = WINDOW_TIME.as_secs_f64() / start.elapsed().as_secs_f64().max(1e-6);
        let wanted = steps as f64 * ratio.clamp(0.25, 2.0);
        self.next = (wanted as u64).clamp(self.grain, self.most) / self.grain * self.grain;
    }

    /// The steps of the next window, of what is left of `steps` from `offset` on.
    fn window(&self, steps: u64, offset: u64) -> Option<Window> {
        let left = steps - offset;
        (left > 0).then(|| Window { offset, steps: left.min(self.next) })
    }
}

/// Some steps of an ensemble.
#[derive(Clone, Copy)]
struct Window {
    offset: u64,
    steps: u64,
}

impl Window {
    /// The part of a member's draws.
    fn of(self, draws: Draws, per_step: u64) -> Draws {
        draws.part(self.offset * per_step, self.steps * per_step)
    }
}
