//! Draws of one recipe, range after range or list after list.

use super::schedule::{Backend, Job, Schedule};
use super::{Batch, DrawSummary, Engine, EngineError};
use crate::quantity::{ArrayFormat, Dtype, Layout, Quantity};
use crate::random::stream::{DrawRange, Draws, Stream};
use crate::recipe::Recipe;
use crate::wgsl::Indexing;

impl Engine {
    /// Prepares to draw from a recipe: the shader is compiled and the buffers are allocated once, for any number of
    /// calls of [`Session::draw`].
    pub fn session<'a>(&'a self, recipe: &'a Recipe) -> Result<Session<'a>, EngineError> {
        let schedule = self.schedule(&[Job { recipe, per_step: 1 }])?;
        Ok(Session { recipe, engine: self, schedule, listed: None })
    }
}

/// Draws of a recipe on an engine, range after range or list after list. See [`Engine::session`].
pub struct Session<'a> {
    recipe: &'a Recipe,
    engine: &'a Engine,
    schedule: Schedule<'a>,
    /// For lists, once one was asked for: a GPU has another shader for these.
    listed: Option<Schedule<'a>>,
}

impl<'a> Session<'a> {
    /// Number of values in the spectra of `draws`: rows, one after the other.
    pub(super) fn values(&self, draws: DrawRange) -> usize {
        self.spectra_values(draws.count)
    }

    fn spectra_values(&self, draws: u64) -> usize {
        let format = self.recipe.formats().into_iter().find(|format| format.quantity == Quantity::Spectra);
        let format = format.expect("the recipe asks for spectra");
        assert!(format.dtype == Dtype::F32, "the spectra are F16, not F32");
        assert!(format.layout != Layout::Planes, "spectra in planes cannot be put end to end");
        format.values(draws) as usize
    }

    /// The schedule that makes such draws.
    fn schedule(&mut self, draws: &Draws) -> Result<&mut Schedule<'a>, EngineError> {
        if draws.indices.is_none() || matches!(self.schedule.0, Backend::Cpu(_)) {
            return Ok(&mut self.schedule);
        }
        if self.listed.is_none() {
            let job = Job { recipe: self.recipe, per_step: 1 };
            self.listed = Some(self.engine.schedule_of(&[job], Indexing::List)?);
        }
        Ok(self.listed.as_mut().expect("it was made"))
    }

    /// Makes draws with their spectra in the caller's memory: draw by draw, a value for each band, and room for
    /// padding if the recipe asks for it, which the CPU leaves as it is. The CPU writes
    /// everything else there directly, without a copy.
    ///
    /// # Panics
    /// Where the slice is not as long as they are, or the recipe asks for no spectra, in 16 bits, or in planes.
    pub fn fill<'d>(
        &mut self,
        draws: impl Into<Draws<'d>>,
        spectra: &mut [f32],
    ) -> Result<DrawSummary, EngineError> {
        let draws = draws.into();
        let count = draws.count();
        assert_eq!(
            spectra.len(),
            self.spectra_values(count),
            "{count} draws do not fit what is there for them"
        );
        if let (Backend::Cpu(_), 1..) = (&self.schedule.0, count) {
            return self.fill_in_place(draws, vec![(Quantity::Spectra, bytemuck::cast_slice_mut(spectra))]);
        }
        let mut rest = spectra;
        self.draw(draws, |batch| {
            let values = batch.spectra();
            let (window, after) = std::mem::take(&mut rest).split_at_mut(values.len());
            window.copy_from_slice(values);
            rest = after;
            Ok(())
        })
    }

    /// Makes draws with all that the recipe asks for in the caller's memory: the bytes of an array for each of
    /// [`Recipe::formats`], in their order and this machine's. [`Quantity::Attempts`] are
    /// [`DrawStatus`](crate::DrawStatus)es. Padding is undefined. The CPU writes arrays of whole and aligned words of 4
    /// bytes without a copy, and all others, as the GPU all, window by window.
    ///
    /// # Panics
    /// Where there is not one array for each format, or one is not as long as [`ArrayFormat::bytes`].
    pub fn fill_arrays<'d>(
        &mut self,
        draws: impl Into<Draws<'d>>,
        arrays: &mut [&mut [u8]],
    ) -> Result<DrawSummary, EngineError> {
        let draws = draws.into();
        let (count, formats) = (draws.count(), self.recipe.formats());
        assert_eq!(arrays.len(), formats.len(), "an array for each quantity");
        for (format, array) in formats.iter().zip(&*arrays) {
            let (quantity, bytes) = (format.quantity, format.bytes(count));
            assert_eq!(array.len() as u64, bytes, "the {quantity} of {count} draws have {bytes} bytes");
        }
        let is_words = |array: &&mut [u8]| bytemuck::try_cast_slice::<u8, u32>(array).is_ok();
        if let (Backend::Cpu(_), 1..) = (&self.schedule.0, count)
            && arrays.iter().all(is_words)
        {
            let arrays = arrays.iter_mut().map(|array| bytemuck::cast_slice_mut(array));
            return self
                .fill_in_place(draws, formats.iter().map(|format| format.quantity).zip(arrays).collect());
        }
        let mut done = 0;
        self.draw(draws, |batch| {
            for (format, array) in formats.iter().zip(&mut *arrays) {
                copy(*format, (batch.bytes(format.quantity), batch.draws.count), (array, count), done);
            }
            done += batch.draws.count;
            Ok(())
        })
    }

    /// Makes draws on the CPU with some of their arrays in the caller's memory.
    fn fill_in_place(
        &mut self,
        draws: Draws,
        arrays: Vec<(Quantity, &mut [u32])>,
    ) -> Result<DrawSummary, EngineError> {
        let mut summary = DrawSummary::default();
        let max_attempts = self.recipe.program().max_attempts;
        let Backend::Cpu(schedule) = &mut self.schedule.0 else { unreachable!("the CPU draws") };
        schedule.fill(draws, arrays, &mut |batch| summary.add(&batch, draws, max_attempts))?;
        Ok(summary)
    }

    /// Makes the draws of a list of indices, in its order, and hands them to `sink` window by window: the bytes of each
    /// are those that it has in any range. The first error ends it.
    ///
    /// ```
    /// use spectroll::{Engine, EngineChoice, EngineError, Model, Recipe, Stream};
    ///
    /// let recipe = Recipe::builder(&Model::builtin("granada")?).build()?;
    /// let engine = Engine::new(&EngineChoice::Cpu)?;
    /// engine.session(&recipe)?.at(Stream::new(1), &[1 << 40, 3, 3], |batch| {
    ///     let rows: Vec<&[f32]> = batch.spectra().chunks(31).collect();
    ///     assert_eq!((rows.len(), rows[1]), (3, rows[2]));
    ///     Ok::<_, EngineError>(())
    /// })?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn at<E: From<EngineError>>(
        &mut self,
        stream: Stream,
        indices: &[u64],
        sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<DrawSummary, E> {
        self.draw(stream.at(indices), sink)
    }

    /// Makes draws that are given responses, n of them for each channel of the recipe's
    /// [given sensors](crate::RecipeBuilder::given), draw by draw, and hands them to `sink` in order, window by window. A
    /// draw for whose responses no candidate was accepted is no error: its status says so, and its quantities are 0.
    /// Returns the summary of those that succeeded.
    ///
    /// # Panics
    /// Where there are not n responses for each draw, or the recipe gives draws none.
    pub fn draw_given<'d, E: From<EngineError>>(
        &mut self,
        draws: impl Into<Draws<'d>>,
        given: &'d [f32],
        mut sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<DrawSummary, E> {
        let draws = draws.into().with_given(given);
        let (count, width) = (draws.count() as usize, self.recipe.program().given);
        assert!(width > 0, "the recipe gives draws no responses");
        assert_eq!(given.len(), width * count, "{width} responses for each of {count} draws");
        let mut summary = DrawSummary::default();
        self.schedule(&draws)?.draw(&[draws], draws.count(), |batches| {
            summary.count_answered(batches[0].statuses());
            sink(batches[0])
        })?;
        Ok(summary)
    }

    /// Makes draws, of a range or of a list, and hands them to `sink` in order, window by window. The first error ends
    /// it.
    pub fn draw<'d, E: From<EngineError>>(
        &mut self,
        draws: impl Into<Draws<'d>>,
        mut sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<DrawSummary, E> {
        let draws = draws.into();
        assert_eq!(self.recipe.program().given, 0, "draws that are given responses take draw_given");
        let mut summary = DrawSummary::default();
        let max_attempts = self.recipe.program().max_attempts;
        self.schedule(&draws)?.draw(&[draws], draws.count(), |batches| {
            summary.add(&batches[0], draws, max_attempts)?;
            sink(batches[0])
        })?;
        Ok(summary)
    }
}

/// Copies the bytes of a window of draws to where they belong in those of all draws, `done` draws in.
fn copy(format: ArrayFormat, (from, count): (&[u8], u64), (to, all): (&mut [u8], u64), done: u64) {
    let planes = format.planes();
    let bytes = |draws: u64| draws as usize * format.stride() * format.dtype.size();
    let (from_plane, to_plane) =
        ((format.bytes(count) as usize / planes), (format.bytes(all) as usize / planes));
    for (from, to) in from.chunks(from_plane.max(1)).zip(to.chunks_mut(to_plane.max(1))) {
        to[bytes(done)..][..bytes(count)].copy_from_slice(&from[..bytes(count)]);
    }
}
