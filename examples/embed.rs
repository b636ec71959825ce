//! A renderer that draws its materials and lights itself: 640 spheres, each with a reflectance of its own, drawn into a
//! storage buffer in the frame's own command encoder; and a daylight for each row of them, drawn in the vertex shader by
//! functions that the recipe writes. Spectra meet in the host's shader and become XYZ and sRGB there. Nothing is read
//! back but the picture.
//!
//!     cargo run --release --example embed -- spheres.png

use spectroll::wgpu::{self, util::DeviceExt};
use spectroll::{Layout, Model, Quantity, Recipe, Sampler, Stream, colorimetry};

#[path = "host/mod.rs"]
pub(crate) mod host;

pub(crate) const COLUMNS: u32 = 32;
pub(crate) const ROWS: u32 = 20;
/// Pixels of a sphere's cell.
pub(crate) const CELL: u32 = 30;

pub(crate) fn surfaces() -> Result<Recipe, Box<dyn std::error::Error>> {
    let model = Model::builtin("munsell-vrhel")?;
    Ok(Recipe::builder(&model).quantities([Quantity::Spectra]).layout(Layout::PaddedRows).build()?)
}

pub(crate) fn daylights() -> Result<Recipe, Box<dyn std::error::Error>> {
    Ok(Recipe::builder(&Model::builtin("granada")?).build()?)
}

pub(crate) fn picture() -> Result<host::Image, Box<dyn std::error::Error>> {
    let host = host::device();
    let (device, _) = &host;

    // The reflectances: recorded below, before the pass that reads them.
    let surfaces = surfaces()?;
    let count = u64::from(COLUMNS * ROWS);
    let drawn = Sampler::new(device, &surfaces)?.prepare(device, Stream::new(1).draws(0..count))?;
    let reflectances = drawn.buffer(Quantity::Spectra).expect("the recipe asks for them");

    // The daylights: functions in the host's own shader.
    let text = format!("{}\n{}", daylights()?.wgsl("sun")?, include_str!("spheres.wgsl"));
    let pipeline = host::pipeline(device, text);

    let [x, y, z] = colorimetry::cmf(surfaces.model().grid());
    let observer: Vec<f32> = (0..x.len()).flat_map(|b| [x[b], y[b], z[b], 0.0]).map(|v| v as f32).collect();
    let observer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("observer"),
        contents: bytemuck::cast_slice(&observer),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("host"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[
            wgpu::BindGroupEntry { binding: 0, resource: reflectances.as_entire_binding() },
            wgpu::BindGroupEntry { binding: 1, resource: observer.as_entire_binding() },
        ],
    });
    Ok(host::render(
        &host,
        (COLUMNS * CELL, ROWS * CELL),
        |encoder| drawn.record(encoder),
        |pass| {
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.draw(0..4, 0..COLUMNS * ROWS);
        },
    ))
}

#[allow(dead_code)] // tests have the picture, and not this
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "spheres.png".to_owned());
    host::save(&picture()?, &path)
}
