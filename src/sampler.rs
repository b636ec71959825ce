//! The compute shader of a recipe on a wgpu device, recorded into its host's command encoders. No code here submits,
//! polls or asks for a device.

use bytemuck::{Pod, Zeroable};
use wgpu::{BufferUsages, Device};

use crate::recipe::Recipe;
use crate::stream::{self, Draws};
use crate::wgsl::{self, Form, Target};

/// The bindings of `shaders/main.wgsl`, `shaders/parameters.wgsl` and `shaders/looped.wgsl`.
const PARAMETERS: u32 = 0;
const SPECTRA: u32 = 1;
const TALLIES: u32 = 2;
const MODEL: u32 = 3;

/// A recipe's compute pipeline on a wgpu device, to be recorded into its host's command encoders.
///
/// A sampler is a guest: it makes pipelines and buffers on the host's device, and never submits, polls or asks for a
/// device of its own. It needs no feature and no more than the default limits; where the device was created with
/// `SHADER_INT64` it multiplies in 64 bits.
///
/// ```
/// use spectroll::{Model, Recipe, Sampler, Stream, wgpu};
///
/// # fn host() -> Option<(wgpu::Device, wgpu::Queue)> { None }
/// # let Some((device, queue)) = host() else { return Ok(()) };
/// let recipe = Recipe::new(&Model::builtin("munsell-vrhel")?).build()?;
/// let sampler = Sampler::new(&device, &recipe);
/// let draws = sampler.prepare(&device, Stream::new(1).draws(0..4096))?;
///
/// let mut encoder = device.create_command_encoder(&Default::default());
/// draws.record(&mut encoder); // any pass of the host after this may bind draws.spectra()
/// queue.submit([encoder.finish()]);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct Sampler {
    pipeline: wgpu::ComputePipeline,
    /// The model's numbers, where the shader reads them from a buffer.
    model: Option<wgpu::Buffer>,
    bands: u32,
    max_attempts: u32,
    draws_per_thread: u32,
}

/// Why a range cannot be drawn in one dispatch.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SamplerError {
    #[error(
        "a range of {count} draws, of which this device takes at most {largest} at once ({limit}): split the range"
    )]
    TooMany { count: u64, largest: u64, limit: &'static str },
}

/// What the shader reads as `Parameters`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Parameters {
    key: [u32; 2],
    first: [u32; 2],
    count: u32,
    stream: u32,
    max_attempts: u32,
    padding: u32,
}

impl Sampler {
    /// Compiles the shader of a recipe. Errors of the device reach its host's error scopes and handlers.
    pub fn new(device: &Device, recipe: &Recipe) -> Sampler {
        let program = recipe.program();
        let target = target(device);
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("spectroll"),
            source: wgpu::ShaderSource::Wgsl(wgsl::shader(program, target).into()),
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("spectroll"),
            layout: None,
            module: &module,
            entry_point: Some("main"),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let model = (Form::of(program) == Form::Looped).then(|| {
            let numbers = wgsl::model_buffer(program);
            filled_buffer(device, "spectroll model", BufferUsages::STORAGE, bytemuck::cast_slice(&numbers))
        });
        Sampler {
            pipeline,
            model,
            bands: program.bands() as u32,
            max_attempts: program.max_attempts,
            draws_per_thread: wgsl::draws_per_thread(program, target),
        }
    }

    /// The most draws that one dispatch can make under these limits.
    pub fn max_count(&self, limits: &wgpu::Limits) -> u64 {
        self.limit(limits).0
    }

    /// That, and the name of what limits it.
    fn limit(&self, limits: &wgpu::Limits) -> (u64, &'static str) {
        let row = 4 * u64::from(self.bands);
        let threads = u64::from(limits.max_compute_workgroups_per_dimension) * u64::from(wgsl::WORKGROUP);
        let even = |count: u64| count / 2 * 2; // buffers have room for an even number of draws
        [
            (even(limits.max_storage_buffer_binding_size / row), "max_storage_buffer_binding_size"),
            (even(limits.max_buffer_size / row), "max_buffer_size"),
            (threads * u64::from(self.draws_per_thread), "max_compute_workgroups_per_dimension"),
            (u64::from(u32::MAX / self.bands / 2 * 2), "32-bit offsets"),
        ]
        .into_iter()
        .min()
        .expect("there are limits")
    }

    /// Buffers for `draws`, and all that records them.
    pub fn prepare(&self, device: &Device, draws: Draws) -> Result<Prepared, SamplerError> {
        self.prepare_for(device, draws, BufferUsages::COPY_SRC)
    }

    /// The same, with buffers of another usage besides storage.
    pub(crate) fn prepare_for(
        &self,
        device: &Device,
        draws: Draws,
        usage: BufferUsages,
    ) -> Result<Prepared, SamplerError> {
        let (largest, limit) = self.limit(&device.limits());
        if draws.count > largest {
            return Err(SamplerError::TooMany { count: draws.count, largest, limit });
        }
        let capacity = draws.count.max(1).next_multiple_of(2);
        let storage = |label, size| {
            let usage = BufferUsages::STORAGE | usage;
            let descriptor =
                wgpu::BufferDescriptor { label: Some(label), size, usage, mapped_at_creation: false };
            device.create_buffer(&descriptor)
        };
        let spectra = storage("spectroll spectra", capacity * 4 * u64::from(self.bands));
        let tallies = storage("spectroll tallies", capacity * 4);
        let parameters = filled_buffer(
            device,
            "spectroll parameters",
            BufferUsages::UNIFORM | BufferUsages::COPY_DST,
            bytemuck::bytes_of(&self.parameters(draws)),
        );
        let bound = [(PARAMETERS, Some(&parameters)), (SPECTRA, Some(&spectra)), (TALLIES, Some(&tallies))];
        let entries: Vec<_> = bound
            .into_iter()
            .chain([(MODEL, self.model.as_ref())])
            .filter_map(|(binding, buffer)| Some((binding, buffer?)))
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("spectroll"),
            layout: &self.pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        Ok(Prepared {
            sampler: self.clone(),
            bindings,
            parameters,
            spectra,
            tallies,
            count: draws.count as u32,
        })
    }

    fn parameters(&self, draws: Draws) -> Parameters {
        Parameters {
            key: draws.stream.key(),
            first: stream::words(draws.first),
            count: draws.count as u32, // `limit` keeps it below 2^32
            stream: draws.stream.id() << 8,
            max_attempts: self.max_attempts,
            padding: 0,
        }
    }
}

/// A range of draws, ready to be recorded, any number of times.
#[derive(Debug)]
pub struct Prepared {
    sampler: Sampler,
    bindings: wgpu::BindGroup,
    parameters: wgpu::Buffer,
    spectra: wgpu::Buffer,
    tallies: wgpu::Buffer,
    count: u32,
}

impl Prepared {
    /// Records a compute pass that fills the buffers.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        let descriptor = wgpu::ComputePassDescriptor { label: Some("spectroll"), timestamp_writes: None };
        let mut pass = encoder.begin_compute_pass(&descriptor);
        pass.set_pipeline(&self.sampler.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        let draws_per_workgroup = wgsl::WORKGROUP * self.sampler.draws_per_thread;
        pass.dispatch_workgroups(self.count.div_ceil(draws_per_workgroup), 1, 1);
    }

    /// The spectra once the pass has run: an f32 for each draw and band, draw by draw, without padding. The buffer
    /// may be longer by one draw. A draw that failed (see [`Prepared::tallies`]) is all zeros.
    pub fn spectra(&self) -> &wgpu::Buffer {
        &self.spectra
    }

    /// A [`Tally`](crate::Tally) for each draw once the pass has run. The buffer may be longer by one.
    pub fn tallies(&self) -> &wgpu::Buffer {
        &self.tallies
    }

    pub(crate) fn bands(&self) -> usize {
        self.sampler.bands as usize
    }

    /// Turns to other draws, no more than were prepared, in what the queue runs from its next submission on.
    pub(crate) fn turn_to(&mut self, queue: &wgpu::Queue, draws: Draws) {
        self.count = draws.count as u32;
        queue.write_buffer(&self.parameters, 0, bytemuck::bytes_of(&self.sampler.parameters(draws)));
    }
}

/// The form of shader that suits a device.
fn target(device: &Device) -> Target {
    let int64 = device.features().contains(wgpu::Features::SHADER_INT64);
    match (int64, device.adapter_info().device_type) {
        (false, _) => Target::Baseline,
        (true, wgpu::DeviceType::Cpu) => Target::SoftwareInt64,
        (true, _) => Target::Int64,
    }
}

fn filled_buffer(device: &Device, label: &str, usage: BufferUsages, bytes: &[u8]) -> wgpu::Buffer {
    let buffer = device.create_buffer(&wgpu::BufferDescriptor {
        label: Some(label),
        size: bytes.len() as u64,
        usage,
        mapped_at_creation: true,
    });
    buffer.get_mapped_range_mut(..).expect("it is mapped at creation").copy_from_slice(bytes);
    buffer.unmap();
    buffer
}
