//! Draws inside a fragment shader: no passes and no buffers but one of a table, only functions in the host's text. Each
//! cell of a wall rolls its own reflectance of a luminous reflectance of 0.3, so all chips are equally light, as the right
//! half shows. They vary more than measured ones do, so that plain rejection would try some 30 candidates a chip: a cover
//! proposes them, whose boxes the text reads from the table.
//!
//!     cargo run --release --example inline -- chips.png

use spectroll::{Bounds, Model, ModuleOptions, ProposalKind, Quantity, Recipe, TableStorage, wgpu};

#[path = "host/mod.rs"]
mod host;

pub(crate) const COLUMNS: u32 = 32;
pub(crate) const ROWS: u32 = 12;
/// Pixels of a chip's cell.
pub(crate) const CELL: u32 = 30;

pub(crate) fn chips() -> Result<Recipe, Box<dyn std::error::Error>> {
    let model = Model::builtin("munsell-vrhel")?;
    let wanted = [Quantity::LinearSrgb, Quantity::Xyz];
    let vivid = Recipe::builder(&model).lrv(0.3).bounds(Bounds::Scaled).covariance_scale(9.0);
    Ok(vivid.proposal(ProposalKind::Cover).quantities(wanted).build()?)
}

pub(crate) fn picture() -> Result<host::Image, Box<dyn std::error::Error>> {
    let host = host::device();
    let chips = chips()?;
    let tables = Some(TableStorage::Buffer { group: 0, binding: 0 });
    let text = chips.wgsl_with("chip", ModuleOptions { tables, ..ModuleOptions::default() })?;
    let pipeline = host::pipeline(&host.0, format!("{text}\n{}", include_str!("chips.wgsl")));
    let content = chips.tables();
    let boxes = host.0.create_buffer(&wgpu::BufferDescriptor {
        label: Some("boxes"),
        size: content.len() as u64,
        usage: wgpu::BufferUsages::STORAGE | wgpu::BufferUsages::COPY_DST,
        mapped_at_creation: false,
    });
    host.1.write_buffer(&boxes, 0, &content);
    let bindings = host.0.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some("chips"),
        layout: &pipeline.get_bind_group_layout(0),
        entries: &[wgpu::BindGroupEntry { binding: 0, resource: boxes.as_entire_binding() }],
    });
    Ok(host::render(
        &host,
        (COLUMNS * CELL, ROWS * CELL),
        |_| {},
        |pass| {
            pass.set_pipeline(&pipeline);
            pass.set_bind_group(0, &bindings, &[]);
            pass.draw(0..3, 0..1);
        },
    ))
}

#[allow(dead_code)] // tests have the picture, and not this
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "chips.png".to_owned());
    host::save(&picture()?, &path)
}
