//! What buffers of a host hold.

use spectroll::wgpu::{self, BufferUsages};

/// The words of buffers that a host has recorded something into.
pub(crate) fn read(
    (device, queue): &(wgpu::Device, wgpu::Queue),
    mut encoder: wgpu::CommandEncoder,
    buffers: &[&wgpu::Buffer],
) -> Vec<Vec<u32>> {
    let copies: Vec<_> = buffers
        .iter()
        .map(|buffer| {
            let copy = device.create_buffer(&wgpu::BufferDescriptor {
                label: None,
                size: buffer.size(),
                usage: BufferUsages::MAP_READ | BufferUsages::COPY_DST,
                mapped_at_creation: false,
            });
            encoder.copy_buffer_to_buffer(buffer, 0, &copy, 0, None);
            copy
        })
        .collect();
    queue.submit([encoder.finish()]);
    copies.iter().for_each(|copy| copy.map_async(wgpu::MapMode::Read, .., |result| result.expect("it maps")));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    let words = |copy: &wgpu::Buffer| {
        bytemuck::cast_slice(&copy.get_mapped_range(..).expect("it is mapped")).to_vec()
    };
    copies.iter().map(words).collect()
}
