//! A scene in a renderer: a wall of tiles under a lamp, with the target in its middle, for each of some scenes. The
//! reflectances and the lights are recorded into the host's encoder, before the pass that reads them from a buffer a
//! group; nothing is read back but the picture.
//!
//!     cargo run --release --example scene -- walls.png

use spectroll::scene::{
    Illuminants, LrvLevels, Scene, SceneError, SceneSampler, Surfaces, TargetConstraint, Targets,
};
use spectroll::wgpu::{self, util::DeviceExt};
use spectroll::{Bounds, Model, colorimetry};

#[path = "host/mod.rs"]
mod host;

pub(crate) const SCENES: u32 = 8;
/// Tiles in a row of a wall, and rows.
pub(crate) const TILES: u32 = 15;
/// Pixels of a tile.
pub(crate) const TILE: u32 = 12;

pub(crate) fn walls() -> Result<Scene, SceneError> {
    let surfaces = Model::builtin("munsell-vrhel").expect("it is built in");
    let daylight = Model::builtin("granada").expect("it is built in");
    let levels = TargetConstraint::Lrv(LrvLevels::even(0.2, 0.6, SCENES));
    Scene::builder(u64::from(SCENES))
        .group(Illuminants::new("lamp", &daylight, 1))
        .group(Surfaces::new("wall", &surfaces, u64::from(TILES * TILES)))
        .group(Targets::new("target", &surfaces, levels).bounds(Bounds::Scaled))
        .build()
}

pub(crate) fn picture() -> Result<host::Image, Box<dyn std::error::Error>> {
    let host = host::device();
    let (device, _) = &host;
    let scene = walls()?;
    let drawn = SceneSampler::new(device, &scene)?.prepare(device, 0..u64::from(SCENES))?;

    let pipeline = host::pipeline(device, include_str!("walls.wgsl").to_owned());
    let [x, y, z] = colorimetry::cmf(scene.grid());
    let observer: Vec<f32> = (0..x.len()).flat_map(|b| [x[b], y[b], z[b], 0.0]).map(|v| v as f32).collect();
    let observer = device.create_buffer_init(&wgpu::util::BufferInitDescriptor {
        label: Some("observer"),
        contents: bytemuck::cast_slice(&observer),
        usage: wgpu::BufferUsages::UNIFORM,
    });
    let group = |name| drawn.buffer(name).expect("it is a group").as_entire_binding();
    let resources = [observer.as_entire_binding(), group("lamp"), group("wall"), group("target")];
    let bindings = device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("host"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[0, 1, 2, 3]
            .map(|binding| wgpu::BindGroupEntry { binding, resource: resources[binding as usize].clone() }),
    });
    Ok(host::render(
        &host,
        (SCENES / 2 * (TILES + 1) * TILE, 2 * (TILES + 1) * TILE),
        |encoder| drawn.record(encoder),
        |pass| {
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.draw(0..4, 0..SCENES);
        },
    ))
}

#[allow(dead_code)] // tests have the picture, and not this
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "walls.png".to_owned());
    host::save(&picture()?, &path)
}
