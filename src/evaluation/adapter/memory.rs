//! Rates of a device's memory and of its bus to the host, and how near drawing comes to them.

use std::time::Instant;

use serde::Serialize;
use wgpu::BufferUsages;

use super::{AdapterError, RUNS, median};
use crate::engine::{Engine, EngineError};
use crate::model::Model;
use crate::random::stream::Stream;
use crate::recipe::Recipe;
use crate::sampler::{Sampler, SamplerOptions};

/// Size of a buffer: the largest that every device binds.
const BYTES: u64 = 128 << 20;

/// Number of draws that fill most of such a buffer.
const DRAWS: u64 = 1 << 20;

/// Duration of a run, seconds.
const RUN: f64 = 0.2;

/// Kernels that write a buffer, and that copy it to another, 16 bytes a thread.
const KERNELS: &str = "
@group(0) @binding(0) var<storage, read_write> target_words: array<vec4<u32>>;
@group(0) @binding(1) var<storage, read_write> source_words: array<vec4<u32>>;

@compute @workgroup_size(256)
fn fill(@builtin(global_invocation_id) id: vec3<u32>) {
    target_words[id.x] = vec4(id.x);
}

@compute @workgroup_size(256)
fn copy(@builtin(global_invocation_id) id: vec3<u32>) {
    target_words[id.x] = source_words[id.x];
}
";

/// Rates of an adapter, in bytes a second but for draws.
#[derive(Clone, Debug, Serialize)]
pub struct Bandwidth {
    /// Writing a buffer of 128 MiB.
    pub write: f64,
    /// Copying one to another: bytes that are copied, each of which is read and written.
    pub copy: f64,
    /// Spectra of reflectances that stay on the device, in plain arithmetic.
    pub draw: f64,
    /// Spectra that stay on the device, in exact arithmetic.
    pub draw_exact: f64,
    /// Copying a buffer to memory that the host maps, and reading it there.
    pub readback: f64,
    /// Spectra of reflectances, drawn and handed to the host in windows.
    pub draw_to_host: f64,
}

impl Bandwidth {
    /// Share of the rate of writing that draws reach on the device.
    pub fn share_of_writing(&self) -> f64 {
        self.draw / self.write
    }

    /// Share of the rate of reading back that draws reach on their way to the host.
    pub fn share_of_readback(&self) -> f64 {
        self.draw_to_host / self.readback
    }
}

pub(super) fn measure(engine: &Engine) -> Result<Bandwidth, AdapterError> {
    let (device, _) = engine.device().expect("it is an adapter's");
    let buffer = |size, usage| {
        let label = Some("spectroll bandwidth");
        device.create_buffer(&wgpu::BufferDescriptor { label, size, usage, mapped_at_creation: false })
    };
    let [target, source] = [0, 1].map(|_| buffer(BYTES, BufferUsages::STORAGE | BufferUsages::COPY_SRC));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("spectroll bandwidth"),
        source: wgpu::ShaderSource::Wgsl(KERNELS.into()),
    });
    let kernel = |name, buffers: &[&wgpu::Buffer]| {
        let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: Some("spectroll bandwidth"),
            layout: None,
            module: &module,
            entry_point: Some(name),
            compilation_options: wgpu::PipelineCompilationOptions::default(),
            cache: None,
        });
        let entries = (0..)
            .zip(buffers)
            .map(|(binding, buffer)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() });
        let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: Some("spectroll bandwidth"),
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries.collect::<Vec<_>>(),
        });
        move |encoder: &mut wgpu::CommandEncoder| {
            let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups((BYTES / 16 / 256) as u32, 1, 1);
        }
    };
    let recipe = Recipe::builder(&Model::builtin("munsell-vrhel").expect("it is built in")).build()?;
    let drawn = recipe.formats()[0].bytes(DRAWS);
    let drawing = |arithmetic| -> Result<_, AdapterError> {
        let options = SamplerOptions { arithmetic, ..SamplerOptions::default() };
        let sampler = Sampler::with_options(device, &recipe, options)?;
        let prepared = sampler.prepare(device, Stream::new(0).draws(0..DRAWS))?;
        Ok(move |encoder: &mut wgpu::CommandEncoder| prepared.record(encoder))
    };
    let [plain, exact] = [crate::wgsl::Arithmetic::Plain, crate::wgsl::Arithmetic::Exact].map(drawing);
    let staging = buffer(BYTES, BufferUsages::MAP_READ | BufferUsages::COPY_DST);
    Ok(Bandwidth {
        write: rate(engine, BYTES, &kernel("fill", &[&target]))?,
        copy: rate(engine, BYTES, &kernel("copy", &[&target, &source]))?,
        draw: rate(engine, drawn, &plain?)?,
        draw_exact: rate(engine, drawn, &exact?)?,
        readback: readback(engine, &target, &staging)?,
        draw_to_host: to_host(engine, &recipe, drawn)?,
    })
}

/// Bytes a second of what a pass writes: the median of some runs, each of as many passes as fill a run.
pub(super) fn rate(
    engine: &Engine,
    bytes: u64,
    record: &dyn Fn(&mut wgpu::CommandEncoder),
) -> Result<f64, EngineError> {
    let (device, queue) = engine.device().expect("it is an adapter's");
    let seconds = |times: u32| -> Result<f64, EngineError> {
        let start = Instant::now();
        let mut encoder = device.create_command_encoder(&Default::default());
        (0..times).for_each(|_| record(&mut encoder));
        queue.submit([encoder.finish()]);
        engine.wait()?;
        Ok(start.elapsed().as_secs_f64())
    };
    seconds(1)?; // compiles, and touches every page
    let times = (RUN / seconds(1)?).clamp(1.0, 1e3) as u32;
    let runs = (0..RUNS).map(|_| Ok(f64::from(times) * bytes as f64 / seconds(times)?));
    Ok(median(runs.collect::<Result<_, EngineError>>()?))
}

/// Bytes a second from a buffer of the device to the host.
fn readback(engine: &Engine, from: &wgpu::Buffer, to: &wgpu::Buffer) -> Result<f64, EngineError> {
    Ok(BYTES as f64 / seconds_to_host(engine, &|_| (), from, to)?)
}

/// Seconds until the host has read a buffer that a pass fills, by way of one that it maps: the median of some runs.
pub(super) fn seconds_to_host(
    engine: &Engine,
    record: &dyn Fn(&mut wgpu::CommandEncoder),
    from: &wgpu::Buffer,
    to: &wgpu::Buffer,
) -> Result<f64, EngineError> {
    let (device, queue) = engine.device().expect("it is an adapter's");
    let run = || -> Result<f64, EngineError> {
        let start = Instant::now();
        let mut encoder = device.create_command_encoder(&Default::default());
        record(&mut encoder);
        encoder.copy_buffer_to_buffer(from, 0, to, 0, None);
        queue.submit([encoder.finish()]);
        to.map_async(wgpu::MapMode::Read, .., |_| {});
        engine.wait()?;
        {
            let view = to.get_mapped_range(..).expect("it is mapped");
            std::hint::black_box(bytemuck::cast_slice::<u8, u32>(&view).iter().fold(0, |a, b| a ^ b));
        }
        to.unmap();
        Ok(start.elapsed().as_secs_f64())
    };
    run()?;
    Ok(median((0..RUNS).map(|_| run()).collect::<Result<_, _>>()?))
}

/// Bytes a second of spectra that a session hands to the host.
fn to_host(engine: &Engine, recipe: &Recipe, bytes: u64) -> Result<f64, EngineError> {
    let mut session = engine.session(recipe)?;
    let mut sum = 0u32;
    let mut run = || -> Result<f64, EngineError> {
        let start = Instant::now();
        session.draw(Stream::new(0).draws(0..DRAWS), |batch| {
            sum ^= batch.spectra().iter().fold(0, |a, b| a ^ b.to_bits());
            Ok::<_, EngineError>(())
        })?;
        Ok(bytes as f64 / start.elapsed().as_secs_f64())
    };
    (0..3).try_for_each(|_| run().map(|_| ()))?; // the windows find their size
    let rates = (0..RUNS).map(|_| run()).collect::<Result<_, _>>()?;
    std::hint::black_box(sum);
    Ok(median(rates))
}
