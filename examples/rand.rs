//! Draws for code that lives in `rand`: a recipe drawn one at a time is a distribution, and its words may come from
//! any generator. Prints the mean and the spread of 10,000 reflectances at three wavelengths.
//!
//!     cargo run --release --example rand

use rand::distr::Distribution;
use spectroll::{Model, Recipe, Stream};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let model = Model::builtin("munsell-vrhel")?;
    let reflectances = Recipe::builder(&model).build()?.scalar_sampler::<f32>();
    // One of ours, which starts anywhere at no cost; any other of `rand`'s will do.
    let generator = Stream::named(1, "example").rng();
    let drawn: Vec<_> = reflectances.sample_iter(generator).take(10_000).collect();
    for band in [5, 15, 25] {
        let values = || drawn.iter().map(|drawn| f64::from(drawn.spectrum()[band]));
        let mean = values().sum::<f64>() / drawn.len() as f64;
        let variance = values().map(|v| (v - mean).powi(2)).sum::<f64>() / drawn.len() as f64;
        println!("{} nm: {mean:.3} +- {:.3}", model.grid().wavelength(band), variance.sqrt());
    }
    Ok(())
}
