//! Draws that are ready to be recorded.

#[cfg(doc)]
use super::PrepareOptions;
use super::{Sampler, SamplerError};
use crate::quantity::{ArrayFormat, Quantity};
use crate::random::stream::{DrawRange, Draws};
use crate::wgsl::ComputeShader;

/// A range of draws with its buffers, ready to be recorded into a wgpu command encoder, any number of times.
#[derive(Debug)]
pub struct Prepared {
    pub(super) sampler: Sampler,
    pub(super) bindings: wgpu::BindGroup,
    pub(super) parameters: wgpu::Buffer,
    /// Progress of each draw, where one dispatch may not end them all.
    pub(super) progress: Option<wgpu::Buffer>,
    /// Indices of the draws, where they are given in a list.
    pub(super) indices: Option<wgpu::Buffer>,
    /// Responses that the draws are given, where the buffer is not the host's.
    pub(super) given: Option<wgpu::Buffer>,
    /// Buffers, in the order of the sampler's formats.
    pub(super) outputs: Vec<wgpu::Buffer>,
    /// Number of draws that a pass has threads for.
    pub(super) dispatched: u64,
    /// Number of draws that the buffers have room for.
    pub(super) prepared: u64,
}

impl Prepared {
    /// Place in [`Prepared::parameters`] of the number of draws, a word.
    pub const COUNT_OFFSET: u64 = 16;

    /// Records a compute pass that fills the buffers.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        self.clear(encoder);
        let mut pass = begin(encoder);
        self.record_in(&mut pass);
    }

    /// Forgets how far draws have come that one dispatch may not end: before each pass of the host's own, and needless
    /// where the shader makes all of them in one dispatch ([`ComputeShader::dispatches`]).
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(progress) = &self.progress {
            encoder.clear_buffer(progress, 0, None);
        }
    }

    /// Records what fills the buffers into a pass of the host's own, which may have timestamps and other work; after
    /// [`Prepared::clear`]. Leaves its pipeline and its bind group 0 set.
    pub fn record_in(&self, pass: &mut wgpu::ComputePass) {
        let workgroups = self.sampler.shader.workgroups(self.dispatched);
        self.bind(pass);
        (0..self.sampler.slices()).for_each(|_| pass.dispatch_workgroups(workgroups, 1, 1));
    }

    /// Records as [`Prepared::record_in`] does, with the number of workgroups from a buffer: three words at `offset`, of
    /// which the last two are 1. A pass before it that knows how many draws there are writes these, and the number of
    /// draws into [`Prepared::parameters`], at most as many as were prepared.
    pub fn record_indirect_in(&self, pass: &mut wgpu::ComputePass, workgroups: &wgpu::Buffer, offset: u64) {
        self.bind(pass);
        (0..self.sampler.slices()).for_each(|_| pass.dispatch_workgroups_indirect(workgroups, offset));
    }

    /// Sets the pipeline and the bind group.
    pub(crate) fn bind(&self, pass: &mut wgpu::ComputePass) {
        pass.set_pipeline(&self.sampler.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
    }

    /// Buffer of the parameters, with the usage `COPY_DST`: at [`Prepared::COUNT_OFFSET`] it has the number of draws.
    pub fn parameters(&self) -> &wgpu::Buffer {
        &self.parameters
    }

    /// Buffer of the indices, where they are those of a list.
    pub fn indices(&self) -> Option<&wgpu::Buffer> {
        self.indices.as_ref()
    }

    /// Records the first of the [`slices`](Sampler::slices) that fill the buffers.
    pub(crate) fn record_first(&self, encoder: &mut wgpu::CommandEncoder) {
        self.clear(encoder);
        self.record_next(encoder);
    }

    /// Records one more slice: draws that are not done try the candidates that come next.
    pub(crate) fn record_next(&self, encoder: &mut wgpu::CommandEncoder) {
        let mut pass = begin(encoder);
        self.bind(&mut pass);
        pass.dispatch_workgroups(self.sampler.shader.workgroups(self.dispatched), 1, 1);
    }

    /// Buffer with the values of a quantity once the pass has run, in its format of [`Prepared::formats`]; `None` if
    /// the recipe does not ask for it. The buffer may be longer. A draw that failed, as [`Quantity::Attempts`] tells,
    /// is 0.
    pub fn buffer(&self, quantity: Quantity) -> Option<&wgpu::Buffer> {
        let position = self.formats().iter().position(|format| format.quantity == quantity)?;
        Some(&self.outputs[position])
    }

    /// Formats of the arrays in the buffers. Planes are as far apart as the number of draws that was prepared, rounded up
    /// to a multiple of 4.
    pub fn formats(&self) -> &[ArrayFormat] {
        self.sampler.formats()
    }

    /// Number of slices that fill the buffers.
    pub(crate) fn slices(&self) -> u32 {
        self.sampler.slices()
    }

    /// Buffers, in the order of the formats.
    pub(crate) fn buffers(&self) -> &[wgpu::Buffer] {
        &self.outputs
    }

    /// Changes the range of draws, to at most as many as were prepared, in the same buffers: for a host that draws
    /// anew in each frame. Passes that are recorded already draw it too, from the queue's next submission on, all of it:
    /// a pass has threads for as many as were prepared. Two ranges in one submission take two [`Sampler::prepare`]. What
    /// lies behind the last draw of a shorter range is left as it was.
    ///
    /// ```
    /// use spectroll::{Model, Recipe, Sampler, Stream, wgpu};
    ///
    /// # fn host() -> Option<(wgpu::Device, wgpu::Queue)> { None }
    /// # let Some((device, queue)) = host() else { return Ok(()) };
    /// let recipe = Recipe::builder(&Model::builtin("granada")?).build()?;
    /// let mut lamps = Sampler::new(&device, &recipe)?.prepare(&device, Stream::new(0).draws(0..64))?;
    /// for frame in 0..3 {
    ///     lamps.set_draws(&queue, Stream::new(frame).draws(0..64))?;
    ///     let mut encoder = device.create_command_encoder(&Default::default());
    ///     lamps.record(&mut encoder);
    ///     queue.submit([encoder.finish()]);
    /// }
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn set_draws(&mut self, queue: &wgpu::Queue, draws: DrawRange) -> Result<(), SamplerError> {
        self.check_room(draws)?;
        queue.write_buffer(&self.parameters, 0, &self.sampler.shader.parameters(draws, self.prepared));
        Ok(())
    }

    /// Changes the range for a pass that is yet to be recorded, of no more threads than it takes, and with planes as far
    /// apart as it has draws.
    pub(crate) fn set_window(&mut self, queue: &wgpu::Queue, draws: DrawRange) -> Result<(), SamplerError> {
        self.check_room(draws)?;
        self.dispatched = draws.count;
        queue.write_buffer(&self.parameters, 0, &self.sampler.shader.parameters(draws, draws.count));
        Ok(())
    }

    fn check_room(&self, draws: DrawRange) -> Result<(), SamplerError> {
        match draws.count > self.prepared {
            true => Err(SamplerError::NoRoom { count: draws.count, prepared: self.prepared }),
            false => Ok(()),
        }
    }

    /// Writes the indices of draws, for a shader that has them from a list: no more than were prepared.
    pub(crate) fn set_indices(&self, queue: &wgpu::Queue, draws: Draws) {
        let Some(buffer) = &self.indices else { return };
        queue.write_buffer(buffer, 0, bytemuck::cast_slice(&ComputeShader::indices(draws)));
    }

    /// Writes the responses that draws are given, no more than were prepared.
    pub(crate) fn set_given(&self, queue: &wgpu::Queue, draws: Draws) {
        if let Some(buffer) = &self.given {
            queue.write_buffer(buffer, 0, bytemuck::cast_slice(draws.given));
        }
    }
}

fn begin(encoder: &mut wgpu::CommandEncoder) -> wgpu::ComputePass<'_> {
    let descriptor = wgpu::ComputePassDescriptor { label: Some("spectroll"), timestamp_writes: None };
    encoder.begin_compute_pass(&descriptor)
}
