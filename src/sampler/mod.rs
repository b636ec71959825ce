//! Compute pipeline of a recipe on a wgpu device, recorded into its host's command encoders. No code here submits,
//! polls or asks for a device.

mod buffers;
mod error;
mod prepared;

use std::sync::Arc;

use wgpu::{BufferUsages, Device};

pub use buffers::PrepareOptions;
pub(crate) use buffers::filled;
pub use error::SamplerError;
pub use prepared::Prepared;

use crate::program::Program;
use crate::quantity::ArrayFormat;
#[cfg(doc)]
use crate::quantity::Quantity;
use crate::random::stream::DrawRange;
use crate::recipe::Recipe;
use crate::wgsl::{
    Arithmetic, Binding, BindingRole, ComputeShader, Dialect, Indexing, ShaderVariant, Stores, WgslError,
};

/// The most dispatches that are recorded for one range: its draws take no more candidates than these try.
const MOST_SLICES: u32 = 1024;

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
    layout: wgpu::BindGroupLayout,
    shader: Arc<ComputeShader>,
    /// The tables that the shader reads from a buffer, if it has any.
    tables: Option<wgpu::Buffer>,
    /// The boxes or centres that candidates are made of, if the recipe has any.
    proposal: Option<wgpu::Buffer>,
}

/// Settings of a sampler.
#[derive(Clone, Copy, Debug, Default)]
pub struct SamplerOptions<'a> {
    /// Form of the shader's arithmetic: that which [`probe`](crate::probe()) found for the device.
    pub arithmetic: Arithmetic,
    /// Source of the indices of draws. With a list, the indices are words of a buffer, two each, low and high: the draw of
    /// a material's number, say.
    pub indexing: Indexing,
    /// Cache that the pipeline is compiled from and into.
    pub cache: Option<&'a wgpu::PipelineCache>,
}

impl Sampler {
    /// Compiles the shader of a recipe. Errors of the device reach its host's error scopes and handlers.
    pub fn new(device: &Device, recipe: &Recipe) -> Result<Sampler, SamplerError> {
        Sampler::with_options(device, recipe, SamplerOptions::default())
    }

    /// Compiles the shader of a recipe with other settings than the default ones.
    pub fn with_options(
        device: &Device,
        recipe: &Recipe,
        options: SamplerOptions,
    ) -> Result<Sampler, SamplerError> {
        Sampler::of(device, recipe.program(), options)
    }

    /// Compiles the shader of a program.
    pub(crate) fn of(
        device: &Device,
        program: &Program,
        SamplerOptions { arithmetic, indexing, cache }: SamplerOptions,
    ) -> Result<Sampler, SamplerError> {
        let variant = ShaderVariant { indexing, arithmetic, ..Sampler::variant(device) };
        Sampler::with_shader(device, Sampler::shader_of(program, variant)?, cache)
    }

    /// Writes the shader of a program.
    pub(crate) fn shader_of(
        program: &Program,
        variant: ShaderVariant,
    ) -> Result<ComputeShader, SamplerError> {
        ComputeShader::new(program, variant).map_err(|error| match error {
            WgslError::TooManyBands(bands) => SamplerError::TooManyBands(bands),
            other => unreachable!("a compute shader is refused for its bands alone: {other}"),
        })
    }

    /// Compiles a shader, and puts the numbers that it reads into buffers.
    pub(crate) fn with_shader(
        device: &Device,
        shader: ComputeShader,
        cache: Option<&wgpu::PipelineCache>,
    ) -> Result<Sampler, SamplerError> {
        let uniforms = 1;
        let buffers = shader.bindings().len() as u32 - uniforms;
        let largest = device.limits().max_storage_buffers_per_shader_stage;
        if buffers > largest {
            return Err(SamplerError::TooManyBuffers { buffers, largest });
        }
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("spectroll"),
            source: wgpu::ShaderSource::Wgsl(shader.text().into()),
        });
        let entries: Vec<_> = shader.bindings().iter().map(layout_entry).collect();
        let layout = device.create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some("spectroll"),
            entries: &entries,
        });
        let pipeline_layout = device.create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
            label: Some("spectroll"),
            bind_group_layouts: &[Some(&layout)],
            ..Default::default()
        });
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("spectroll"),
            layout: Some(&pipeline_layout),
            module: &module,
            entry_point: Some(ComputeShader::ENTRY_POINT),
            compilation_options: wgpu::PipelineCompilationOptions {
                // Whatever is read of it has been written.
                zero_initialize_workgroup_memory: false,
                ..Default::default()
            },
            cache,
        });
        let storage = |label, role| {
            let is_there = shader.bindings().iter().any(|binding| binding.role == role);
            let bytes = shader.contents(role).filter(|_| is_there);
            bytes.map(|bytes| filled(device, label, BufferUsages::STORAGE, bytes)).transpose()
        };
        let tables = storage("spectroll tables", BindingRole::Tables)?;
        let proposal = storage("spectroll proposal", BindingRole::Proposal)?;
        Ok(Sampler { pipeline, layout, shader: Arc::new(shader), tables, proposal })
    }

    /// The variant of a shader that suits a device, for draws of a range in plain arithmetic.
    pub fn variant(device: &Device) -> ShaderVariant {
        let int64 = device.features().contains(wgpu::Features::SHADER_INT64);
        let is_software = device.adapter_info().device_type == wgpu::DeviceType::Cpu;
        let dialect = match (int64, is_software) {
            (false, _) => Dialect::Baseline,
            (true, true) => Dialect::SoftwareInt64,
            (true, false) => Dialect::Int64,
        };
        let stores = if is_software { Stores::Direct } else { Stores::Gathered };
        ShaderVariant { dialect, stores, ..ShaderVariant::default() }
    }

    /// Number of dispatches that a range takes whose draws may take all the candidates that they are allowed.
    pub(crate) fn slices(&self) -> u32 {
        self.shader.dispatches()
    }

    /// The shader: its text, its bindings, and the bytes that go into them.
    pub fn shader(&self) -> &ComputeShader {
        &self.shader
    }

    /// Layout of its bind group, for hosts that make their own: the bindings of [`ComputeShader::bindings`].
    pub fn bind_group_layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// The pipeline, for hosts that record it themselves.
    pub fn pipeline(&self) -> &wgpu::ComputePipeline {
        &self.pipeline
    }

    /// Formats of the output arrays, in the order of [`Quantity`].
    pub fn formats(&self) -> &[ArrayFormat] {
        self.shader.formats()
    }

    /// Largest number of draws in one dispatch under these limits.
    pub fn max_count(&self, limits: &wgpu::Limits) -> u64 {
        self.limit(limits).0
    }

    /// Largest number of draws in one dispatch, and the name of the limit that sets it.
    fn limit(&self, limits: &wgpu::Limits) -> (u64, &'static str) {
        // Four draws, for which padding comes to nothing.
        let is_listed = self.shader.variant().indexing == Indexing::List;
        let indices = is_listed.then(|| self.shader.bytes(BindingRole::Indices, 4));
        let given = self.shader.bytes(BindingRole::Given, 4);
        let four = self.formats().iter().map(|format| format.bytes(4)).chain(indices).chain([given]);
        let four = four.max().expect("something comes out");
        let values = self.formats().iter().map(|format| format.values(4)).max().expect("something comes out");
        let workgroups = u64::from(limits.max_compute_workgroups_per_dimension);
        [
            (4 * (limits.max_storage_buffer_binding_size / four), "max_storage_buffer_binding_size"),
            (4 * (limits.max_buffer_size / four), "max_buffer_size"),
            (workgroups * self.shader.draws_per_workgroup(), "max_compute_workgroups_per_dimension"),
            (4 * (u64::from(u32::MAX) / values.max(8)), "32-bit offsets"),
        ]
        .into_iter()
        .min()
        .expect("there are limits")
    }

    /// Allocates buffers for `draws`, and prepares to record them. Draws that are given responses take a buffer of them:
    /// [`PrepareOptions::given`].
    pub fn prepare(&self, device: &Device, draws: DrawRange) -> Result<Prepared, SamplerError> {
        self.prepare_with(device, draws, &PrepareOptions::default())
    }

    /// Prepares as [`Sampler::prepare`] does, with buffers of other usages, or with some of the host's. Where the indices
    /// are those of a list, the range counts its entries, from 0.
    ///
    /// ```
    /// use spectroll::{Model, PrepareOptions, Quantity, Recipe, Sampler, Stream, wgpu};
    ///
    /// # fn host() -> Option<(wgpu::Device, wgpu::Queue, wgpu::Buffer)> { None }
    /// # let Some((device, queue, palette)) = host() else { return Ok(()) };
    /// let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).quantities([Quantity::Xyz]).build()?;
    /// // The second kilobyte of a buffer of the host's.
    /// let part = wgpu::BufferBinding { buffer: &palette, offset: 1024, size: wgpu::BufferSize::new(1024) };
    /// let options = PrepareOptions { outputs: vec![(Quantity::Xyz, part)], ..PrepareOptions::default() };
    /// let draws = Stream::new(1).draws(0..64);
    /// let prepared = Sampler::new(&device, &recipe)?.prepare_with(&device, draws, &options)?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn prepare_with(
        &self,
        device: &Device,
        draws: DrawRange,
        options: &PrepareOptions,
    ) -> Result<Prepared, SamplerError> {
        let (attempts, largest) =
            (self.shader.max_attempts(), self.shader.slice().saturating_mul(MOST_SLICES));
        if attempts > largest {
            return Err(SamplerError::TooManyAttempts { attempts, largest });
        }
        let responses = self.shader.given();
        if responses > 0 && options.given.is_none() {
            return Err(SamplerError::NothingGiven { responses });
        }
        self.prepare_slices(device, draws, options)
    }
}

fn layout_entry(binding: &Binding) -> wgpu::BindGroupLayoutEntry {
    let storage = |read_only| wgpu::BufferBindingType::Storage { read_only };
    wgpu::BindGroupLayoutEntry {
        binding: binding.binding,
        visibility: wgpu::ShaderStages::COMPUTE,
        ty: wgpu::BindingType::Buffer {
            ty: match binding.role {
                BindingRole::Parameters => wgpu::BufferBindingType::Uniform,
                BindingRole::Tables | BindingRole::Proposal => storage(true),
                BindingRole::Indices | BindingRole::Given => storage(true),
                BindingRole::Progress | BindingRole::Output(_) => storage(false),
            },
            has_dynamic_offset: false,
            min_binding_size: None,
        },
        count: None,
    }
}
