//! Draws of one recipe, range after range.

use super::schedule::{Backend, Job, Schedule};
use super::{Batch, DrawSummary, Engine, EngineError};
use crate::quantity::{Dtype, Layout, Quantity};
use crate::random::stream::DrawRange;
use crate::recipe::Recipe;

impl Engine {
    /// Prepares to draw from a recipe: the shader is compiled and the buffers are allocated once, for any number of
    /// calls of [`Session::draw`].
    pub fn session<'a>(&'a self, recipe: &'a Recipe) -> Result<Session<'a>, EngineError> {
        Ok(Session { recipe, schedule: self.schedule(&[Job { recipe, per_step: 1 }])? })
    }
}

/// Draws of a recipe on an engine, range after range. See [`Engine::session`].
pub struct Session<'a> {
    recipe: &'a Recipe,
    schedule: Schedule<'a>,
}

impl Session<'_> {
    /// Number of values in the spectra of `draws`: rows, one after the other.
    pub(super) fn values(&self, draws: DrawRange) -> usize {
        let format = self.recipe.formats().into_iter().find(|format| format.quantity == Quantity::Spectra);
        let format = format.expect("the recipe asks for spectra");
        assert!(format.dtype == Dtype::F32, "the spectra are F16, not F32");
        assert!(format.layout != Layout::Planes, "spectra in planes cannot be put end to end");
        format.values(draws.count) as usize
    }

    /// Draws a range with its spectra in the caller's memory: draw by draw, a value for each band, and room for
    /// padding if the recipe asks for it, which the CPU leaves as it is. The CPU writes
    /// everything else there directly, without a copy.
    ///
    /// # Panics
    /// Where the slice is not as long as they are, or the recipe asks for no spectra, in 16 bits, or in planes.
    pub fn fill(&mut self, draws: DrawRange, spectra: &mut [f32]) -> Result<DrawSummary, EngineError> {
        assert_eq!(
            spectra.len(),
            self.values(draws),
            "{} draws do not fit what is there for them",
            draws.count
        );
        let mut summary = DrawSummary::default();
        let max_attempts = self.recipe.program().max_attempts;
        match &mut self.schedule.0 {
            _ if draws.count == 0 => {}
            Backend::Gpu(session) => {
                let mut rest = spectra;
                session.draw(&[draws], draws.count, &mut |batches: &[Batch]| {
                    summary.add(&batches[0], max_attempts)?;
                    let values = batches[0].spectra();
                    let (window, after) = std::mem::take(&mut rest).split_at_mut(values.len());
                    window.copy_from_slice(values);
                    rest = after;
                    Ok::<_, EngineError>(())
                })?;
            }
            Backend::Cpu(session) => {
                session.fill(draws, bytemuck::cast_slice_mut(spectra), &mut |batch| {
                    summary.add(&batch, max_attempts)
                })?
            }
        }
        Ok(summary)
    }

    /// Draws a range and hands it to `sink` in order, window by window. The first error ends it.
    pub fn draw<E: From<EngineError>>(
        &mut self,
        draws: DrawRange,
        mut sink: impl FnMut(Batch) -> Result<(), E>,
    ) -> Result<DrawSummary, E> {
        let mut summary = DrawSummary::default();
        let max_attempts = self.recipe.program().max_attempts;
        self.schedule.draw(&[draws], draws.count, |batches| {
            summary.add(&batches[0], max_attempts)?;
            sink(batches[0])
        })?;
        Ok(summary)
    }
}
