//! Draws for code that lives in `rand`: a recipe is a distribution, and its words may come from any generator. Prints
//! the mean and the spread of 10,000 reflectances at three wavelengths.
//!
//!     cargo run --release --example rand

use rand::distr::Distribution;
use spectroll::{Model, Recipe, Stream};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = Model::builtin("munsell-vrhel")?;
    let recipe = Recipe::new(&model).build()?;
    // One of ours, which starts anywhere at no cost; any other of `rand`'s will do.
    let generator = Stream::named(1, "example").rng();
    let spectra: Vec<Vec<f32>> = recipe.sample_iter(generator).take(10_000).collect();
    for band in [5, 15, 25] {
        let values = || spectra.iter().map(|spectrum| f64::from(spectrum[band]));
        let mean = values().sum::<f64>() / spectra.len() as f64;
        let variance = values().map(|v| (v - mean).powi(2)).sum::<f64>() / spectra.len() as f64;
        println!("{} nm: {mean:.3} +- {:.3}", model.grid().wavelength(band), variance.sqrt());
    }
    Ok(())
}
