//! Writes a million reflectances of luminous reflectance 0.4 to a file, as `spectroll sample` does.

use spectroll::export::{DrawExport, Output};
use spectroll::{Engine, EngineChoice, Model, Recipe, Stream};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let path = std::env::args().nth(1).unwrap_or_else(|| "reflectances.npy".to_owned());
    let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).lrv(0.4).build()?;
    let engine = Engine::new(&EngineChoice::Auto)?;
    let export = DrawExport::new(&recipe, Stream::new(1).draws(0..1_000_000));
    let summary = export.write(&engine, &Output::to(&path)?)?;
    println!("{path}: {} spectra, drawn by {engine}", summary.draws);
    Ok(())
}
