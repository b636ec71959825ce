//! Scenes in a host's encoder: a buffer a group, recorded and not submitted.

use std::ops::Range;

use bytemuck::{Pod, Zeroable};
use rayon::ThreadPool;
use wgpu::{BufferUsages, Device};

use crate::engine::{DrawSummary, EngineError};
use crate::quantity::Quantity;
use crate::sampler::{Prepared, Sampler, SamplerError, SamplerOptions, filled};
use crate::threads;
use crate::wgsl::{Arithmetic, WORKGROUP};

use super::Scene;
use super::array::Array;
use super::group::IntensityScope;
use super::plan::{Drawing, GroupPlan};
use super::session::{SharedSpectra, columns};

const COPIES: &str = include_str!("../../shaders/scene_copies.wgsl");

/// A scene's pipelines on a wgpu device, for the spectra of its groups, whatever else they are asked for.
///
/// A guest as [`Sampler`] is: it never submits, polls or asks for a device of its own. `examples/scene.rs` has it in
/// a renderer.
pub struct SceneSampler<'a> {
    scene: &'a Scene,
    /// Samplers of the groups that the device draws.
    samplers: Vec<Option<Sampler>>,
    /// Pipeline that multiplies and copies spectra, where some need it.
    copies: Option<wgpu::ComputePipeline>,
    once: Vec<Option<SharedSpectra>>,
    /// Threads for what the device does not draw.
    pool: ThreadPool,
}

/// Scenes, ready to be recorded, any number of times.
pub struct PreparedScene<'a> {
    groups: Vec<Group<'a>>,
    copies: Option<wgpu::ComputePipeline>,
}

/// A group of some scenes.
struct Group<'a> {
    plan: &'a GroupPlan,
    drawn: Option<Prepared>,
    copied: Option<Copied>,
    /// The spectra, where they are not those that are drawn.
    spectra: Option<wgpu::Buffer>,
    /// Values beside the spectra: luminous reflectances, intensities.
    values: Vec<(&'a Array, Vec<f32>)>,
}

/// A pass that copies shapes and multiplies them.
struct Copied {
    bindings: wgpu::BindGroup,
    /// Workgroups in a row, and rows of them.
    workgroups: (u32, u32),
}

/// Uniform that the shader of copies declares as `Sizes`.
#[repr(C)]
#[derive(Clone, Copy, Pod, Zeroable)]
struct Sizes {
    values: u32,
    bands: u32,
    copies: u32,
    lights: u32,
}

impl<'a> SceneSampler<'a> {
    /// Compiles what the groups need that are drawn for each scene, and draws what serves all scenes.
    pub fn new(device: &Device, scene: &'a Scene) -> Result<SceneSampler<'a>, EngineError> {
        SceneSampler::with_arithmetic(device, scene, Arithmetic::Plain)
    }

    /// Compiles as [`SceneSampler::new`] does, in a form of arithmetic: that which [`probe`](crate::probe()) found for the
    /// device.
    pub fn with_arithmetic(
        device: &Device,
        scene: &'a Scene,
        arithmetic: Arithmetic,
    ) -> Result<SceneSampler<'a>, EngineError> {
        let mut samplers: Vec<Option<Sampler>> = Vec::new();
        for (i, plan) in scene.plans.iter().enumerate() {
            let Some(drawing) = plan.drawn_by_engine() else {
                samplers.push(None);
                continue;
            };
            let program = drawing.recipe.program().spectra_alone();
            let same = |other: &GroupPlan| {
                other.drawn_by_engine().is_some_and(|d| d.recipe.program().spectra_alone() == program)
            };
            samplers.push(Some(match scene.plans[..i].iter().position(same) {
                Some(other) => samplers[other].clone().expect("the device draws it"),
                None => {
                    Sampler::of(device, &program, SamplerOptions { arithmetic, ..SamplerOptions::default() })?
                }
            }));
        }
        let copies = scene.plans.iter().any(copies).then(|| pipeline(device));
        let pool = threads::pool(None)?;
        Ok(SceneSampler { scene, samplers, copies, once: pool.install(|| scene.once())?, pool })
    }

    /// Buffers for some scenes, and all that records them.
    pub fn prepare(&self, device: &Device, scenes: Range<u64>) -> Result<PreparedScene<'a>, EngineError>
    where
        Self: 'a,
    {
        let plans = self.scene.plans.iter().zip(&self.samplers).zip(&self.once);
        let groups = plans.map(|((plan, sampler), once)| {
            let mut group = match (plan.drawn_by_engine(), sampler) {
                (Some(drawing), Some(sampler)) => {
                    self.drawn(device, plan, (drawing, sampler), scenes.clone())?
                }
                _ => self.made(device, plan, once.as_ref(), scenes.clone())?,
            };
            group.values.extend(plan.fixed_intensities());
            Ok(group)
        });
        Ok(PreparedScene { groups: groups.collect::<Result<_, EngineError>>()?, copies: self.copies.clone() })
    }

    /// A group that the device draws.
    fn drawn(
        &self,
        device: &Device,
        plan: &'a GroupPlan,
        (drawing, sampler): (&Drawing, &Sampler),
        scenes: Range<u64>,
    ) -> Result<Group<'a>, EngineError> {
        let places = u64::from(drawing.places);
        let stream = plan.stream.in_rows(drawing.places);
        let drawn = sampler.prepare(device, stream.draws(scenes.start * places..scenes.end * places))?;
        let Some(pipeline) = self.copies.as_ref().filter(|_| copies(plan)) else {
            return Ok(Group { plan, drawn: Some(drawn), copied: None, spectra: None, values: Vec::new() });
        };
        let bands = self.scene.grid.len();
        let elements = (scenes.end - scenes.start) * u64::from(plan.count);
        let bytes = check(device, elements, bands)?;
        let (intensities, lights) = intensities(plan, scenes);
        let spectra = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some(&format!("spectroll {}", plan.name)),
            size: bytes.max(4),
            usage: BufferUsages::STORAGE | BufferUsages::COPY_SRC,
            mapped_at_creation: false,
        });
        let sizes = Sizes {
            values: (elements * bands as u64) as u32, // `check` keeps it below 2^32
            bands: bands as u32,
            copies: plan.count / drawing.places,
            lights: lights.unwrap_or(elements.max(1) as u32),
        };
        let uniform = filled(device, "spectroll sizes", BufferUsages::UNIFORM, bytemuck::bytes_of(&sizes))?;
        let factors = bytemuck::cast_slice(&intensities);
        let factors = filled(device, "spectroll intensities", BufferUsages::STORAGE, factors)?;
        let shapes = drawn.buffer(Quantity::Spectra).expect("the program has them");
        let buffers = [&uniform, shapes, &factors, &spectra];
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("spectroll copies"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &[0, 1, 2, 3].map(|binding| wgpu::BindGroupEntry {
                binding,
                resource: buffers[binding as usize].as_entire_binding(),
            }),
        });
        let workgroups = sizes.values.div_ceil(WORKGROUP);
        let rows = workgroups.div_ceil(device.limits().max_compute_workgroups_per_dimension).max(1);
        let mut varying = plan.arrays.iter().filter(|_| plan.intensity.is_some());
        let values = varying.find(|array| array.quantity == Quantity::Intensity);
        Ok(Group {
            plan,
            copied: Some(Copied { bindings, workgroups: (workgroups.div_ceil(rows), rows) }),
            drawn: Some(drawn),
            spectra: Some(spectra),
            values: values.map(|array| (array, intensities)).into_iter().collect(),
        })
    }

    /// A group that the CPU makes.
    fn made(
        &self,
        device: &Device,
        plan: &'a GroupPlan,
        once: Option<&SharedSpectra>,
        scenes: Range<u64>,
    ) -> Result<Group<'a>, EngineError> {
        let mut summary = DrawSummary::default();
        let columns =
            self.pool.install(|| columns(plan, once, None, (scenes.start, scenes), &mut summary))?;
        let spectra = match once {
            Some(once) if plan.intensity.is_none() => once.of(Quantity::Spectra),
            _ => columns.of(Quantity::Spectra),
        };
        let bands = self.scene.grid.len();
        check(device, (spectra.len() / bands) as u64, bands)?;
        let usage = BufferUsages::STORAGE | BufferUsages::COPY_SRC;
        let buffer = filled(device, "spectroll spectra", usage, bytemuck::cast_slice(spectra))?;
        let values = columns.known(plan);
        Ok(Group { plan, drawn: None, copied: None, spectra: Some(buffer), values })
    }
}

impl PreparedScene<'_> {
    /// Records compute passes that fill the buffers of the groups that the device draws; the others are full.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder) {
        for group in &self.groups {
            if let Some(drawn) = &group.drawn {
                drawn.record(encoder);
            }
            let (Some(copied), Some(pipeline)) = (&group.copied, &self.copies) else { continue };
            let descriptor =
                wgpu::ComputePassDescriptor { label: Some("spectroll copies"), timestamp_writes: None };
            let mut pass = encoder.begin_compute_pass(&descriptor);
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &copied.bindings, &[]);
            let (row, rows) = copied.workgroups;
            pass.dispatch_workgroups(row, rows, 1);
        }
    }

    /// The spectra of a group once the passes have run, as f32 by scene, element and band; of one that is fixed, and
    /// has no intensity that varies, by element and band. The buffer may be longer. `None` where there is no such
    /// group.
    pub fn buffer(&self, group: &str) -> Option<&wgpu::Buffer> {
        let group = self.groups.iter().find(|other| other.plan.name == group)?;
        let drawn = || group.drawn.as_ref()?.buffer(Quantity::Spectra);
        group.spectra.as_ref().or_else(drawn)
    }

    /// The values of another array of f32, such as `target_lrv` or `lights_intensity`, which are known already.
    pub fn values(&self, name: &str) -> Option<&[f32]> {
        let mut values = self.groups.iter().flat_map(|group| &group.values);
        values.find(|(array, _)| array.name == name).map(|(_, values)| values.as_slice())
    }
}

/// Whether spectra are drawn that are not yet those of the group.
fn copies(plan: &GroupPlan) -> bool {
    plan.drawn_by_engine().is_some_and(|drawing| drawing.places < plan.count || plan.intensity.is_some())
}

/// Intensities of some scenes, and the number of consecutive elements that share one: all, where there are none.
fn intensities(plan: &GroupPlan, scenes: Range<u64>) -> (Vec<f32>, Option<u32>) {
    let Some(intensity) = &plan.intensity else { return (vec![1.0], None) };
    let lights = if intensity.scope == IntensityScope::Scene { plan.count } else { 1 };
    let elements = scenes.flat_map(|scene| (0..plan.count / lights).map(move |element| (scene, element)));
    (elements.map(|(scene, element)| intensity.at(plan.stream, scene, element)).collect(), Some(lights))
}

/// Size of a number of spectra in bytes, if a buffer of the device holds them.
fn check(device: &Device, spectra: u64, bands: usize) -> Result<u64, EngineError> {
    let limits = device.limits();
    let row = 4 * bands as u64;
    let (largest, limit) = [
        (limits.max_storage_buffer_binding_size / row, "max_storage_buffer_binding_size"),
        (limits.max_buffer_size / row, "max_buffer_size"),
        (u64::from(u32::MAX) / row, "32-bit offsets"),
    ]
    .into_iter()
    .min()
    .expect("there are limits");
    match spectra > largest {
        true => Err(SamplerError::TooMany { count: spectra, largest, limit }.into()),
        false => Ok(spectra * row),
    }
}

fn copies_text() -> String {
    COPIES.replace("WORKGROUP", &WORKGROUP.to_string())
}

fn pipeline(device: &Device) -> wgpu::ComputePipeline {
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("spectroll copies"),
        source: wgpu::ShaderSource::Wgsl(copies_text().into()),
    });
    device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("spectroll copies"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: wgpu::PipelineCompilationOptions::default(),
        cache: None,
    })
}

#[cfg(test)]
mod tests {
    use super::{Sizes, copies_text};
    use crate::wgsl::layout::{assert_layout, offsets};

    #[test]
    fn sizes_lie_as_the_shader_reads_them() {
        let members = offsets!(Sizes: values, bands, copies, lights);
        assert_layout(&copies_text(), "Sizes", &members, size_of::<Sizes>());
    }
}
