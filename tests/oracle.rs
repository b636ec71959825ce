//! The draws in f32, which every engine makes, against those in f64 of the same random words.
//!
//! Rounding can turn a candidate that lies within it of a bound from rejected to accepted or back: such flips are
//! counted. Normals in f64 come from the platform's logarithm, sine and cosine, and share no arithmetic with those in
//! f32.

use rayon::prelude::*;
use spectroll::{Bounds, Model, Real, Recipe, RecipeBuilder, Stream};

/// Draws of each recipe.
const DRAWS: u64 = 100_000;

/// The most draws that may take another candidate, of all 600,000. A candidate flips where a bound lies within some
/// 10^-7 of one of its values, so fewer than one in 10^6 is expected to.
const FLIPS: usize = 2;

/// The largest error of a value: some ten roundings of numbers up to 1, and normals that are off by up to 4e-7.
const ERROR: f64 = 1e-6;

/// The same where there is a target LRV, in parts of the spectrum's peak: the darkest candidates are scaled up tenfold
/// and more, and their errors with them.
const SCALED_ERROR: f64 = 1e-5;

fn recipes() -> Vec<(&'static str, Recipe, f64)> {
    let reflectances = Model::builtin("munsell-vrhel").expect("it is built in");
    let daylights = Model::builtin("granada").expect("it is built in");
    let recipe = |name, builder: RecipeBuilder, error| {
        (name, builder.build().expect("the recipe can be drawn"), error)
    };
    vec![
        recipe("reflectances", Recipe::builder(&reflectances), ERROR),
        recipe("covariance x 4", Recipe::builder(&reflectances).covariance_scale(4.0), ERROR),
        recipe("LRV 0.6, base", Recipe::builder(&reflectances).lrv(0.6), SCALED_ERROR),
        recipe(
            "LRV 0.6, scaled",
            Recipe::builder(&reflectances).lrv(0.6).bounds(Bounds::Scaled),
            SCALED_ERROR,
        ),
        recipe("LRV 0.2, both", Recipe::builder(&reflectances).lrv(0.2).bounds(Bounds::Both), SCALED_ERROR),
        recipe("illuminants", Recipe::builder(&daylights), ERROR),
    ]
}

/// How a draw in f32 differs from the one in f64.
enum Difference {
    /// It took another candidate.
    Flip,
    /// The largest error of a value, and the spectrum's peak.
    Error(f64, f64),
}

fn difference(recipe: &Recipe, stream: Stream, index: u64) -> Difference {
    let (ours, exact) = (recipe.draw::<f32>(stream, index), recipe.draw::<f64>(stream, index));
    if ours.status().attempts() != exact.status().attempts() {
        return Difference::Flip;
    }
    let (ours, exact) = (ours.spectrum(), exact.spectrum());
    let errors = ours.iter().zip(exact).map(|(&a, b)| (f64::from(a) - b).abs());
    Difference::Error(errors.fold(0.0, f64::max), exact.iter().copied().fold(0.0, f64::max))
}

#[test]
fn f32_takes_the_candidates_of_f64_and_keeps_their_values() {
    let mut all_flips = 0;
    for (name, recipe, bound) in recipes() {
        let stream = Stream::named(20, name);
        let differences: Vec<_> =
            (0..DRAWS).into_par_iter().map(|index| difference(&recipe, stream, index)).collect();
        let flips = differences.iter().filter(|d| matches!(d, Difference::Flip)).count();
        let errors = differences.iter().filter_map(|d| match *d {
            Difference::Flip => None,
            Difference::Error(error, peak) => Some((error, error / peak.max(1.0))),
        });
        let (absolute, relative) = errors.fold((0f64, 0f64), |(a, r), (e, f)| (a.max(e), r.max(f)));
        println!(
            "{name}: {flips} flips in {DRAWS} draws; largest error {absolute:.1e}, {relative:.1e} of the peak"
        );
        assert!(relative < bound, "{name}: an error of {relative:e}");
        all_flips += flips;
    }
    assert!(all_flips <= FLIPS, "{all_flips} flips");
}

/// That the bound on errors means something: uniforms cut to 24 bits, as some generators of f32 have them, exceed it
/// a thousandfold.
#[test]
fn uniforms_of_24_bits_would_not_pass() {
    let error = |index| {
        let [x, y, ..] = Stream::new(21).block(index, 0, 0);
        let (cut, exact) = (f32::normal_pair(x & !0xFF, y & !0xFF), f64::normal_pair(x, y));
        (0..2).map(|i| (f64::from(cut[i]) - exact[i]).abs()).fold(0.0, f64::max)
    };
    let largest = (0..DRAWS).into_par_iter().map(error).reduce(|| 0.0, f64::max);
    println!("normals of 24-bit uniforms: largest error {largest:.1e}");
    assert!(largest > 100.0 * ERROR, "{largest:e}");
}
