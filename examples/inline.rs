//! Draws inside a fragment shader: no buffers, no passes, only functions in the host's text. Each cell of a wall rolls
//! its own reflectance of a luminous reflectance of 0.3, so all chips are equally light, as the right half shows.
//!
//!     cargo run --release --example inline -- chips.png

use spectroll::{Bounds, Model, Quantity, Recipe};

#[path = "host/mod.rs"]
mod host;

pub(crate) const COLUMNS: u32 = 32;
pub(crate) const ROWS: u32 = 12;
/// Pixels of a chip's cell.
pub(crate) const CELL: u32 = 30;

pub(crate) fn chips() -> Result<Recipe, Box<dyn std::error::Error>> {
    let model = Model::builtin("munsell-vrhel")?;
    let wanted = [Quantity::LinearSrgb, Quantity::Xyz];
    Ok(Recipe::builder(&model).lrv(0.3).bounds(Bounds::Scaled).quantities(wanted).build()?)
}

pub(crate) fn picture() -> Result<host::Image, Box<dyn std::error::Error>> {
    let host = host::device();
    let text = format!("{}\n{}", chips()?.wgsl("chip")?, include_str!("chips.wgsl"));
    let pipeline = host::pipeline(&host.0, text);
    Ok(host::render(
        &host,
        (COLUMNS * CELL, ROWS * CELL),
        |_| {},
        |pass| {
            pass.set_pipeline(&pipeline);
            pass.draw(0..3, 0..1);
        },
    ))
}

#[allow(dead_code)] // tests have the picture, and not this
fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "chips.png".to_owned());
    host::save(&picture()?, &path)
}
