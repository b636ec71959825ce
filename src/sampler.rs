//! Compute pipeline of a recipe on a wgpu device, recorded into its host's command encoders. No code here submits,
//! polls or asks for a device.

use bytemuck::{Pod, Zeroable};
use wgpu::{BufferUsages, Device};

use crate::program::Program;
use crate::quantity::{ArrayFormat, Quantity};
use crate::random::stream::{DrawRange, Draws};
use crate::recipe::Recipe;
use crate::wgsl::{
    self, COVER_AT, Dialect, GIVEN_AT, INDICES_AT, Indexing, OUTPUTS_AT, PARAMETERS_AT, PROGRESS_AT,
    TABLES_AT, Tables,
};

/// The most dispatches that are recorded for one range: its draws take no more candidates than these try.
const MOST_SLICES: u32 = 1024;

/// Bytes of an index.
const INDEX_BYTES: u64 = 8;

/// A recipe's compute pipeline on a wgpu device, to be recorded into its host's command encoders.
///
/// A sampler is a guest: it makes pipelines and buffers on the host's device, and never submits, polls or asks for a
/// device of its own. It needs no feature and no more than the default limits; where the device was created with
/// `SHADER_INT64` it multiplies in 64 bits.
///
/// ```
/// use spectroll::{Model, Quantity, Recipe, Sampler, Stream, wgpu};
///
/// # fn host() -> Option<(wgpu::Device, wgpu::Queue)> { None }
/// # let Some((device, queue)) = host() else { return Ok(()) };
/// let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).quantities([Quantity::Xyz]).build()?;
/// let sampler = Sampler::new(&device, &recipe)?;
/// let draws = sampler.prepare(&device, Stream::new(1).draws(0..4096))?;
///
/// let mut encoder = device.create_command_encoder(&Default::default());
/// draws.record(&mut encoder); // any pass of the host after this may bind draws.buffer(Quantity::Xyz)
/// queue.submit([encoder.finish()]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Sampler {
    pipeline: wgpu::ComputePipeline,
    /// The tables that the shader reads from a buffer, if it has any.
    tables: Option<wgpu::Buffer>,
    /// The boxes from which candidates are drawn, if the recipe has a cover.
    cover: Option<wgpu::Buffer>,
    /// Formats of the output arrays.
    formats: Vec<ArrayFormat>,
    max_attempts: u32,
    /// Number of candidates of a draw that one dispatch tries.
    slice: u32,
    draws_per_thread: u32,
    indexing: Indexing,
    /// Number of responses that each draw is given.
    given: usize,
}

/// Error returned where something cannot be drawn on a device, or not in one dispatch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SamplerError {
    #[error(
        "a range of {count} draws, of which this device takes at most {largest} at once ({limit}): split the range"
    )]
    TooMany { count: u64, largest: u64, limit: &'static str },
    #[error(
        "{buffers} storage buffers, of which this device binds at most {largest} to a shader \
         (max_storage_buffers_per_shader_stage): ask for fewer quantities at once"
    )]
    TooManyBuffers { buffers: u32, largest: u32 },
    #[error("{0} bands, which are too many for one draw of a shader: draw on the CPU")]
    TooManyBands(usize),
    #[error(
        "draws of up to {attempts} candidates, of which dispatches that are recorded together try {largest} at most: \
         allow no more"
    )]
    TooManyAttempts { attempts: u32, largest: u32 },
    #[error(
        "{label} needs {bytes} bytes, and this device binds at most {largest} ({limit}): draw on the CPU"
    )]
    LargeTable { label: &'static str, bytes: u64, largest: u64, limit: &'static str },
    #[error("the device has no buffer for {label}: it was lost, or has no memory left")]
    NoBuffer { label: &'static str },
    #[error(
        "the recipe gives each draw {responses} responses, and there are none: prepare it with a buffer of them"
    )]
    NothingGiven { responses: usize },
    #[error(
        "a buffer of {bytes} bytes, where the responses that these draws are given need {needed} ({responses} of 4 bytes a \
         draw)"
    )]
    Given { bytes: u64, needed: u64, responses: usize },
    #[error(
        "a range of {count} draws, where room for {prepared} was prepared: prepare the largest range first"
    )]
    NoRoom { count: u64, prepared: u64 },
}

/// Uniform that the shader declares as `Parameters`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Parameters {
    key: [u32; 2],
    first: [u32; 2],
    count: u32,
    stream: u32,
    max_attempts: u32,
    plane: u32,
    row: u32,
    slice: u32,
    padding: [u32; 2],
}

impl Sampler {
    /// Compiles the shader of a recipe. Errors of the device reach its host's error scopes and handlers.
    pub fn new(device: &Device, recipe: &Recipe) -> Result<Sampler, SamplerError> {
        Sampler::of(device, recipe.program())
    }

    /// Compiles the shader of a program.
    pub(crate) fn of(device: &Device, program: &Program) -> Result<Sampler, SamplerError> {
        Sampler::indexed(device, program, Indexing::Range)
    }

    /// Compiles the shader of a program for draws whose indices are given in this way.
    pub(crate) fn indexed(
        device: &Device,
        program: &Program,
        indexing: Indexing,
    ) -> Result<Sampler, SamplerError> {
        let target = Sampler::target(device);
        let (text, tables) = wgsl::shader_of(program, target, indexing);
        Sampler::with_text(device, program, target, (text, indexing), &tables)
    }

    /// Compiles the shader that was written for a program, and puts the numbers that it reads into buffers.
    pub(crate) fn with_text(
        device: &Device,
        program: &Program,
        target: Dialect,
        (text, indexing): (String, Indexing),
        tables: &Tables,
    ) -> Result<Sampler, SamplerError> {
        let slice = wgsl::attempts_per_dispatch(program, target);
        if slice == 0 {
            return Err(SamplerError::TooManyBands(program.bands()));
        }
        let others = [
            !tables.values.is_empty(),
            program.proposal.is_some(),
            wgsl::is_sliced(program, target),
            indexing == Indexing::List,
            program.given > 0,
        ];
        let buffers = (program.outputs.len() + others.into_iter().filter(|&there| there).count()) as u32;
        let largest = device.limits().max_storage_buffers_per_shader_stage;
        if buffers > largest {
            return Err(SamplerError::TooManyBuffers { buffers, largest });
        }
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("spectroll"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("spectroll"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let storage = |label, bytes: &[u8]| filled(device, label, BufferUsages::STORAGE, bytes);
        let tables = (!tables.values.is_empty())
            .then(|| storage("spectroll tables", bytemuck::cast_slice(&tables.values)))
            .transpose()?;
        let words = program.proposal.as_ref().map(|proposal| proposal.rounded::<f32>().words());
        let cover =
            words.map(|words| storage("spectroll cover", bytemuck::cast_slice(&words))).transpose()?;
        Ok(Sampler {
            pipeline,
            tables,
            cover,
            formats: program.outputs.iter().map(|output| output.format).collect(),
            max_attempts: program.max_attempts,
            slice,
            draws_per_thread: wgsl::draws_per_thread(program, target),
            indexing,
            given: program.given,
        })
    }

    /// The form of shader that suits a device.
    pub(crate) fn target(device: &Device) -> Dialect {
        let int64 = device.features().contains(wgpu::Features::SHADER_INT64);
        match (int64, device.adapter_info().device_type) {
            (false, _) => Dialect::Baseline,
            (true, wgpu::DeviceType::Cpu) => Dialect::SoftwareInt64,
            (true, _) => Dialect::Int64,
        }
    }

    /// Number of dispatches that a range takes whose draws may take all the candidates that they are allowed.
    pub(crate) fn slices(&self) -> u32 {
        self.max_attempts.div_ceil(self.slice)
    }

    /// Formats of the output arrays, in the order of [`Quantity`].
    pub fn formats(&self) -> &[ArrayFormat] {
        &self.formats
    }

    /// Largest number of draws in one dispatch under these limits.
    pub fn max_count(&self, limits: &wgpu::Limits) -> u64 {
        self.limit(limits).0
    }

    /// Largest number of draws in one dispatch, and the name of the limit that sets it.
    fn limit(&self, limits: &wgpu::Limits) -> (u64, &'static str) {
        // Four draws, for which padding comes to nothing.
        let indices = if self.indexing == Indexing::List { 4 * INDEX_BYTES } else { 0 };
        let given = 4 * self.given_bytes();
        let four = self.formats.iter().map(|format| format.bytes(4)).chain([indices, given]);
        let four = four.max().expect("something comes out");
        let values = self.formats.iter().map(|format| format.values(4)).max().expect("something comes out");
        let threads = u64::from(limits.max_compute_workgroups_per_dimension) * u64::from(wgsl::WORKGROUP);
        [
            (4 * (limits.max_storage_buffer_binding_size / four), "max_storage_buffer_binding_size"),
            (4 * (limits.max_buffer_size / four), "max_buffer_size"),
            (threads * u64::from(self.draws_per_thread), "max_compute_workgroups_per_dimension"),
            (4 * (u64::from(u32::MAX) / values.max(8)), "32-bit offsets"),
        ]
        .into_iter()
        .min()
        .expect("there are limits")
    }

    /// Bytes of the responses that a draw is given.
    fn given_bytes(&self) -> u64 {
        size_of::<f32>() as u64 * self.given as u64
    }

    /// Allocates buffers for `draws`, and prepares to record them. Draws that are given responses take
    /// [`Sampler::prepare_given`].
    pub fn prepare(&self, device: &Device, draws: DrawRange) -> Result<Prepared, SamplerError> {
        if self.given > 0 {
            return Err(SamplerError::NothingGiven { responses: self.given });
        }
        self.check_attempts()?;
        self.prepare_for(device, draws, BufferUsages::COPY_SRC)
    }

    /// Allocates buffers for `draws` that are given responses, and prepares to record them: those of
    /// [`RecipeBuilder::given`](crate::RecipeBuilder::given). `colours` is a storage buffer of the host's with the f32
    /// responses of each draw, draw by draw. Passes that are recorded read what it holds when they run.
    pub fn prepare_given(
        &self,
        device: &Device,
        draws: DrawRange,
        colours: &wgpu::Buffer,
    ) -> Result<Prepared, SamplerError> {
        let (bytes, needed) = (colours.size(), draws.count * self.given_bytes());
        if self.given == 0 || bytes < needed {
            return Err(SamplerError::Given { bytes, needed, responses: self.given });
        }
        self.check_attempts()?;
        self.prepare_with(device, draws, BufferUsages::COPY_SRC, Some(colours))
    }

    fn check_attempts(&self) -> Result<(), SamplerError> {
        let largest = self.slice.saturating_mul(MOST_SLICES);
        match self.max_attempts > largest {
            true => Err(SamplerError::TooManyAttempts { attempts: self.max_attempts, largest }),
            false => Ok(()),
        }
    }

    /// Prepares as [`Sampler::prepare`] does, with buffers of another usage besides storage.
    pub(crate) fn prepare_for(
        &self,
        device: &Device,
        draws: DrawRange,
        usage: BufferUsages,
    ) -> Result<Prepared, SamplerError> {
        self.prepare_with(device, draws, usage, None)
    }

    /// Prepares with the host's buffer of responses, or with one of its own where the draws are given any.
    fn prepare_with(
        &self,
        device: &Device,
        draws: DrawRange,
        usage: BufferUsages,
        colours: Option<&wgpu::Buffer>,
    ) -> Result<Prepared, SamplerError> {
        let (largest, limit) = self.limit(&device.limits());
        if draws.count > largest {
            return Err(SamplerError::TooMany { count: draws.count, largest, limit });
        }
        let capacity = draws.count.max(1).next_multiple_of(u64::from(self.draws_per_thread));
        let output = |format: &ArrayFormat| {
            let label = format!("spectroll {}", format.quantity);
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(&label),
                size: format.bytes(capacity).next_multiple_of(4),
                usage: BufferUsages::STORAGE | usage,
                mapped_at_creation: false,
            })
        };
        let outputs: Vec<_> = self.formats.iter().map(output).collect();
        let usage = BufferUsages::UNIFORM | BufferUsages::COPY_DST;
        let parameters = self.parameters(draws);
        let parameters = filled(device, "spectroll parameters", usage, bytemuck::bytes_of(&parameters))?;
        let progress = (self.slices() > 1).then(|| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("spectroll progress"),
                size: 4 * capacity,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        });
        let indices = (self.indexing == Indexing::List).then(|| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("spectroll indices"),
                size: INDEX_BYTES * capacity,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        });
        let own = (self.given > 0 && colours.is_none()).then(|| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("spectroll given responses"),
                size: self.given_bytes() * capacity,
                usage: BufferUsages::STORAGE | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            })
        });
        let given = colours.cloned().or(own);
        let at = |format: &ArrayFormat| OUTPUTS_AT + format.quantity as u32;
        let entries: Vec<_> = std::iter::once((PARAMETERS_AT, &parameters))
            .chain(self.tables.iter().map(|tables| (TABLES_AT, tables)))
            .chain(self.cover.iter().map(|cover| (COVER_AT, cover)))
            .chain(progress.iter().map(|progress| (PROGRESS_AT, progress)))
            .chain(indices.iter().map(|indices| (INDICES_AT, indices)))
            .chain(given.iter().map(|given| (GIVEN_AT, given)))
            .chain(self.formats.iter().map(at).zip(&outputs))
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("spectroll"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let (count, prepared) = (draws.count, draws.count);
        Ok(Prepared {
            sampler: self.clone(),
            bindings,
            parameters,
            progress,
            indices,
            given,
            outputs,
            count,
            prepared,
        })
    }

    fn parameters(&self, draws: DrawRange) -> Parameters {
        Parameters {
            key: draws.stream.key(),
            first: draws.stream.index_words(draws.first),
            count: draws.count as u32, // `limit` keeps it below 2^32
            stream: draws.stream.id() << 8,
            max_attempts: self.max_attempts,
            plane: draws.count.next_multiple_of(4) as u32,
            row: draws.stream.row(),
            slice: self.slice,
            padding: [0; 2],
        }
    }
}

/// Makes a buffer of these bytes; of four zeros where there are none, since a binding is not empty.
pub(crate) fn filled(
    device: &Device,
    label: &'static str,
    usage: BufferUsages,
    bytes: &[u8],
) -> Result<wgpu::Buffer, SamplerError> {
    let (limits, size) = (device.limits(), bytes.len().max(4).next_multiple_of(4) as u64);
    let bound = match usage.contains(BufferUsages::STORAGE) {
        true => (limits.max_storage_buffer_binding_size, "max_storage_buffer_binding_size"),
        false => (limits.max_uniform_buffer_binding_size, "max_uniform_buffer_binding_size"),
    };
    let (largest, limit) = bound.min((limits.max_buffer_size, "max_buffer_size"));
    if size > largest {
        return Err(SamplerError::LargeTable { label, bytes: size, largest, limit });
    }
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size,
        usage,
        mapped_at_creation: true,
    });
    // Not `create_buffer_init`, which panics where the device is lost or has no memory left.
    let mut view = buffer.get_mapped_range_mut(..).map_err(|_| SamplerError::NoBuffer { label })?;
    view.slice(..bytes.len()).copy_from_slice(bytes);
    drop(view);
    buffer.unmap();
    Ok(buffer)
}

/// A range of draws with its buffers, ready to be recorded into a wgpu command encoder, any number of times.
#[derive(Debug)]
pub struct Prepared {
    sampler: Sampler,
    bindings: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    /// Progress of each draw, where one dispatch may not end them all.
    progress: Option<wgpu::Buffer>,
    /// Indices of the draws, where they are given in a list.
    indices: Option<wgpu::Buffer>,
    /// Responses that the draws are given, where they are given any.
    given: Option<wgpu::Buffer>,
    /// Buffers, in the order of the sampler's formats.
    outputs: Vec<wgpu::Buffer>,
    count: u64,
    /// Number of draws that the buffers have room for.
    prepared: u64,
}

impl Prepared {
    /// Records a compute pass that fills the buffers.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        self.record_first(encoder);
        (1..self.sampler.slices()).for_each(|_| self.record_next(encoder));
    }

    /// Records the first of the [`slices`](Sampler::slices) that fill the buffers.
    pub(crate) fn record_first(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(progress) = &self.progress {
            encoder.clear_buffer(progress, 0, None);
        }
        self.record_next(encoder);
    }

    /// Records one more slice: draws that are not done try the candidates that come next.
    pub(crate) fn record_next(&self, encoder: &mut wgpu::CommandEncoder) {
        let descriptor = wgpu::ComputePassDescriptor { label: Some("spectroll"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&self.sampler.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        let draws_per_workgroup = wgsl::WORKGROUP * self.sampler.draws_per_thread;
        pass.dispatch_workgroups((self.count as u32).div_ceil(draws_per_workgroup), 1, 1);
    }

    /// Buffer with the values of a quantity once the pass has run, in its format of [`Prepared::formats`]; `None` if
    /// the recipe does not ask for it. The buffer may be longer. A draw that failed, as [`Quantity::Attempts`] tells,
    /// is 0.
    pub fn buffer(&self, quantity: Quantity) -> Option<&wgpu::Buffer> {
        let position = self.formats().iter().position(|format| format.quantity == quantity)?;
        Some(&self.outputs[position])
    }

    /// Formats of the arrays in the buffers. Planes are `count` draws apart, rounded up to a multiple of 4.
    pub fn formats(&self) -> &[ArrayFormat] {
        &self.sampler.formats
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
    /// anew in each frame. Passes that are recorded already draw it too, from the queue's next submission on; two
    /// ranges in one submission take two [`Sampler::prepare`].
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
        if draws.count > self.prepared {
            return Err(SamplerError::NoRoom { count: draws.count, prepared: self.prepared });
        }
        self.count = draws.count;
        queue.write_buffer(&self.parameters, 0, bytemuck::bytes_of(&self.sampler.parameters(draws)));
        Ok(())
    }

    /// Writes the responses that draws are given, no more than were prepared.
    pub(crate) fn set_given(&self, queue: &wgpu::Queue, draws: Draws) {
        if let Some(buffer) = &self.given {
            queue.write_buffer(buffer, 0, bytemuck::cast_slice(draws.given));
        }
    }

    /// Writes the indices of draws, for a shader that has them from a list: no more than were prepared.
    pub(crate) fn set_indices(&self, queue: &wgpu::Queue, draws: Draws) {
        let Some(buffer) = &self.indices else { return };
        let words = |number| draws.range.stream.index_words(draws.index(number));
        let words: Vec<[u32; 2]> = (0..draws.count()).map(words).collect();
        queue.write_buffer(buffer, 0, bytemuck::cast_slice(&words));
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::wgsl::layout::{assert_layout, offsets};

    #[test]
    fn parameters_lie_as_the_shader_reads_them() {
        let recipe = Recipe::builder(&Model::builtin("granada").unwrap()).build().unwrap();
        let (text, _) = wgsl::shader(recipe.program(), Dialect::Baseline);
        let members = offsets!(Parameters: key, first, count, stream, max_attempts, plane, row);
        assert_layout(&text, "Parameters", &members, size_of::<Parameters>());
    }
}
