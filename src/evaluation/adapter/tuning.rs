//! Rates by the size of windows and of workgroups.

use serde::Serialize;
use wgpu::BufferUsages;

use super::AdapterError;
use super::memory::{rate, seconds_to_host};
use crate::engine::Engine;
use crate::model::Model;
use crate::random::stream::Stream;
use crate::recipe::Recipe;
use crate::sampler::{Prepared, Sampler};
use crate::wgsl::{ComputeShader, shader_of};

/// Sizes of windows, MiB.
const WINDOWS: [u64; 6] = [8, 16, 32, 64, 128, 256];

/// Sizes of workgroups.
const WORKGROUPS: [u32; 4] = [32, 64, 128, 256];

/// Number of draws whose workgroups are measured.
const DRAWS: u64 = 1 << 19;

/// Rate of draws to the host in windows of a size, one after another.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WindowRate {
    /// Size of a window, MiB.
    pub mebibytes: u64,
    /// Draws a second; `None` where the device takes no window of that size.
    pub draws_per_second: Option<f64>,
}

/// Rate of draws that stay on the device, in workgroups of a size.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct WorkgroupRate {
    /// Number of threads in a workgroup.
    pub threads: u32,
    /// Draws a second.
    pub draws_per_second: f64,
}

fn surfaces() -> Result<Recipe, AdapterError> {
    Ok(Recipe::builder(&Model::builtin("munsell-vrhel").expect("it is built in")).build()?)
}

pub(super) fn windows(engine: &Engine) -> Result<Vec<WindowRate>, AdapterError> {
    let (device, _) = engine.device().expect("it is an adapter's");
    let recipe = surfaces()?;
    let (sampler, format) = (Sampler::new(device, &recipe)?, recipe.formats()[0]);
    let most = sampler.max_count(&device.limits());
    let of_size = |mebibytes: u64| -> Result<WindowRate, AdapterError> {
        let draws = (mebibytes << 20) / (format.bytes(4) / 4);
        if draws > most {
            return Ok(WindowRate { mebibytes, draws_per_second: None });
        }
        let prepared = sampler.prepare(device, Stream::new(0).draws(0..draws))?;
        let from = prepared.buffer(format.quantity).expect("it is drawn");
        let to = device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("spectroll window"),
            size: from.size(),
            usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
            mapped_at_creation: false,
        });
        let record = |encoder: &mut wgpu::CommandEncoder| prepared.record(encoder);
        let seconds = seconds_to_host(engine, &record, from, &to)?;
        Ok(WindowRate { mebibytes, draws_per_second: Some(draws as f64 / seconds) })
    };
    WINDOWS.into_iter().map(of_size).collect()
}

pub(super) fn workgroups(engine: &Engine) -> Result<Vec<WorkgroupRate>, AdapterError> {
    let (device, _) = engine.device().expect("it is an adapter's");
    let program = surfaces()?.program().clone();
    let variant = Sampler::variant(device);
    let (text, tables) = shader_of(&program, variant);
    let ours = format!("@workgroup_size({})", ComputeShader::WORKGROUP_SIZE);
    assert_eq!(text.matches(&ours).count(), 1, "the text has one entry point");
    let of_size = |threads: u32| -> Result<WorkgroupRate, AdapterError> {
        let text = text.replace(&ours, &format!("@workgroup_size({threads})"));
        let text = text.replace(
            &format!("THREADS = {}u", ComputeShader::WORKGROUP_SIZE),
            &format!("THREADS = {threads}u"),
        );
        let shader = ComputeShader::with_text(&program, variant, text, &tables.values);
        let sampler = Sampler::with_shader(device, shader.expect("it has the bands of a model"), None)?;
        let per_group = sampler.shader().draws_per_workgroup() / u64::from(ComputeShader::WORKGROUP_SIZE);
        let groups = DRAWS.div_ceil(per_group * u64::from(threads)) as u32;
        let prepared = sampler.prepare(device, Stream::new(0).draws(0..DRAWS))?;
        let bytes = prepared.formats()[0].bytes(DRAWS);
        let record = |encoder: &mut wgpu::CommandEncoder| record(&prepared, encoder, groups);
        let draws_per_second = rate(engine, bytes, &record)? / (bytes as f64 / DRAWS as f64);
        Ok(WorkgroupRate { threads, draws_per_second })
    };
    WORKGROUPS.into_iter().map(of_size).collect()
}

/// Records a pass of another number of workgroups than is the shader's own.
fn record(prepared: &Prepared, encoder: &mut wgpu::CommandEncoder, workgroups: u32) {
    let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
    prepared.bind(&mut pass);
    pass.dispatch_workgroups(workgroups, 1, 1);
}
