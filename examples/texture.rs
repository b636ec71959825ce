//! A texture whose texels become spectra in the shader that shades them: `cargo run --release --example texture`.
//!
//! The text of the recipe stands before a shader of the host's own (`texture.wgsl`). Each texel gets a random spectrum that
//! has exactly its colour, the same that the program draws for that pixel, and nothing of it leaves the GPU but what the host
//! asks for; here, the colours again, which show that they are met.

#[path = "host/mod.rs"]
#[allow(dead_code)] // what a renderer has, and this only computes
pub(crate) mod host;

use spectroll::{Grid, Model, Quantity, Recipe, Sensors, wgpu};

/// The seed of the spectra.
pub(crate) const SEED: u64 = 5;

/// A recipe of reflectances that are each given their X, Y and Z, relative to white.
pub(crate) fn recipe() -> Recipe {
    let model = Model::builtin_with("munsell-vrhel", Grid::DEFAULT, 8).expect("it is built in");
    let eye = Sensors::builtin("cie1931").expect("it is built in");
    let recipe = Recipe::builder(&model).given(eye).quantities([Quantity::Spectra, Quantity::Xyz]);
    recipe.max_attempts(1000).build().expect("it can be drawn")
}

/// Colours of a texture, relative to white: a smooth field of muted ones.
pub(crate) fn texture(width: u32, height: u32) -> Vec<[f32; 4]> {
    let texel = |i: u32| {
        let (x, y) = ((i % width) as f32 / width as f32, (i / width) as f32 / height as f32);
        [0.25 + 0.15 * x, 0.27 + 0.1 * y, 0.30 - 0.1 * x * y, 1.0]
    };
    (0..width * height).map(texel).collect()
}

/// Shades the texture: X, Y and Z of each texel's spectrum, and the number of candidates that it took.
pub(crate) fn shade(recipe: &Recipe, texels: &[[f32; 4]], width: u32) -> Vec<[f32; 4]> {
    let (device, queue) = host::device();
    let text = recipe.wgsl("paint").expect("it is small")
        + &include_str!("texture.wgsl").replace("SEED", &format!("{SEED}u"));
    let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
        label: Some("texture"),
        source: wgpu::ShaderSource::Wgsl(text.into()),
    });
    let pipeline = device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
        label: Some("texture"),
        layout: None,
        module: &module,
        entry_point: Some("main"),
        compilation_options: Default::default(),
        cache: None,
    });
    let height = texels.len() as u32 / width;
    let size = wgpu::Extent3d { width, height, depth_or_array_layers: 1 };
    let texture = device.create_texture(&wgpu::TextureDescriptor {
        label: Some("colours"),
        size,
        mip_level_count: 1,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba32Float,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let layout =
        wgpu::TexelCopyBufferLayout { offset: 0, bytes_per_row: Some(16 * width), rows_per_image: None };
    queue.write_texture(texture.as_image_copy(), bytemuck::cast_slice(texels), layout, size);
    let buffer = |usage| {
        device.create_buffer(&wgpu::BufferDescriptor {
            label: Some("shaded"),
            size: 16 * texels.len() as u64,
            usage,
            mapped_at_creation: false,
        })
    };
    let shaded = buffer(wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_SRC);
    let copy = buffer(wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST);
    let view = texture.create_view(&Default::default());
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("texture"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: wgpu::BindingResource::TextureView(&view) },
            wgpu::BindGroupEntry { binding: 1, resource: shaded.as_entire_binding() },
        ],
    });
    let mut encoder = device.create_command_encoder(&Default::default());
    {
        let mut pass = encoder.begin_compute_pass(&Default::default());
        pass.set_pipeline(&pipeline);
        pass.set_bind_group(0, &bindings, &[]);
        pass.dispatch_workgroups(width.div_ceil(8), height.div_ceil(8), 1);
    }
    encoder.copy_buffer_to_buffer(&shaded, 0, &copy, 0, None);
    queue.submit([encoder.finish()]);
    copy.map_async(wgpu::MapMode::Read, .., |result| result.expect("it maps"));
    device.poll(wgpu::PollType::wait_indefinitely()).expect("the device works");
    bytemuck::pod_collect_to_vec(&copy.get_mapped_range(..).expect("it is mapped"))
}

fn main() {
    let (width, height) = (64, 48);
    let texels = texture(width, height);
    let shaded = shade(&recipe(), &texels, width);
    let found = shaded.iter().filter(|texel| texel[3] > 0.0).count();
    println!("{found} of {} texels have a spectrum of their colour", texels.len());
}
