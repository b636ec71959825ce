//! One compute shader on a device, run and waited for: what tests and measurements of single functions need.

use std::time::Instant;

use wgpu::util::DeviceExt;
use wgpu::{Buffer, BufferUsages, Device, Queue};

use crate::wgsl::WORKGROUP;

/// A shader with its storage buffers, all in group 0.
pub(crate) struct Compute<'a> {
    device: &'a Device,
    queue: &'a Queue,
    module: wgpu::ShaderModule,
    buffers: Vec<Buffer>,
}

/// Content of a storage buffer.
#[derive(Clone, Copy)]
pub(crate) enum Words<'a> {
    /// These words; no buffer at all where there are none.
    Given(&'a [u32]),
    /// As many words, which the shader writes.
    Written(usize),
}

impl<'a> Compute<'a> {
    /// Compiles a text, whose buffers are at bindings 0, 1, ... and whose workgroups have [`WORKGROUP`] threads.
    pub(crate) fn new(device: &'a Device, queue: &'a Queue, text: String, buffers: &[Words]) -> Compute<'a> {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("spectroll compute"),
            source: wgpu::ShaderSource::Wgsl(text.into()),
        });
        let buffer = |words: &Words| match *words {
            Words::Given(words) => device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
                label: None,
                contents: bytemuck::cast_slice(words),
                usage: BufferUsages::STORAGE,
            }),
            Words::Written(count) => {
                self::buffer(device, 4 * count as u64, BufferUsages::STORAGE | BufferUsages::COPY_SRC)
            }
        };
        Compute { device, queue, module, buffers: buffers.iter().map(buffer).collect() }
    }

    /// Compiles an entry point.
    pub(crate) fn pipeline(&self, entry: &str) -> wgpu::ComputePipeline {
        self.device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
            label: None,
            layout: None,
            module: &self.module,
            entry_point: Some(entry),
            compilation_options: Default::default(),
            cache: None,
        })
    }

    /// Runs at least as many threads, waits for them, and returns the seconds that it took.
    pub(crate) fn run(&self, pipeline: &wgpu::ComputePipeline, threads: u32) -> f64 {
        let bound = self.buffers.iter().zip(0..).filter(|(buffer, _)| buffer.size() > 0);
        let entries: Vec<_> = bound
            .map(|(buffer, binding)| wgpu::BindGroupEntry { binding, resource: buffer.as_entire_binding() })
            .collect();
        let bindings = self.device.create_bind_group(&wgpu::BindGroupDescriptor {
            label: None,
            layout: &pipeline.get_bind_group_layout(0),
            entries: &entries,
        });
        let mut encoder = self.device.create_command_encoder(&Default::default());
        {
            let mut pass = encoder.begin_compute_pass(&Default::default());
            pass.set_pipeline(pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.dispatch_workgroups(threads.div_ceil(WORKGROUP), 1, 1);
        }
        let start = Instant::now();
        self.queue.submit([encoder.finish()]);
        self.wait();
        start.elapsed().as_secs_f64()
    }

    /// The words that a buffer holds.
    pub(crate) fn read(&self, binding: usize) -> Vec<u32> {
        let buffer = &self.buffers[binding];
        let staging =
            self::buffer(self.device, buffer.size(), BufferUsages::MAP_READ | BufferUsages::COPY_DST);
        let mut encoder = self.device.create_command_encoder(&Default::default());
        encoder.copy_buffer_to_buffer(buffer, 0, &staging, 0, None);
        self.queue.submit([encoder.finish()]);
        staging.map_async(wgpu::MapMode::Read, .., |result| result.expect("it maps"));
        self.wait();
        bytemuck::cast_slice(&staging.get_mapped_range(..).expect("it is mapped")).to_vec()
    }

    fn wait(&self) {
        self.device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    }
}

fn buffer(device: &Device, size: u64, usage: BufferUsages) -> Buffer {
    device.create_buffer(&wgpu::BufferDescriptor { label: None, size, usage, mapped_at_creation: false })
}
