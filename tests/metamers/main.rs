//! Metamers: draws that are given colours. They have them exactly, are the same on every engine and in every part of an
//! image, and have the distribution of the model's draws that happen to have that colour.

mod answers;
mod distribution;
#[path = "../engines/mod.rs"]
mod engines;
mod files;
#[path = "../program/mod.rs"]
mod program;
#[path = "../../examples/texture.rs"]
#[allow(dead_code)] // its `main`
mod texture;

use engines::{cpu, gpu, gpu_is_software};
use program::{fails, python, script, succeeds};
use spectroll::nalgebra::{DMatrix, DVector};
use spectroll::{
    Answer, AnswerCounts, Draws, Dtype, Engine, EngineError, Grid, HardColours, Illuminant, MetamerError,
    Metamers, Model, Quantity, Recipe, RecipeBuilder, Sensors, Stream, UnreachableColours, colorimetry,
};

/// The largest difference of a response from the one that was given, relative to white.
const BOUND: f64 = 1e-5;

fn model() -> Model {
    Model::builtin_with("munsell-vrhel", Grid::DEFAULT, 8).expect("it is built in")
}

fn eye() -> Sensors {
    Sensors::builtin("cie1931").expect("it is built in")
}

fn given() -> RecipeBuilder {
    Recipe::builder(&model()).given(eye())
}

/// Weights of the bands in each response to a reflectance under D65, relative to white.
fn seen() -> Vec<Vec<f64>> {
    let weights = colorimetry::xyz_weights(&Grid::DEFAULT).expect("it is visible");
    weights.iter().map(|w| w.iter().map(|v| v / w.iter().sum::<f64>()).collect()).collect()
}

fn product(weights: &[f64], spectrum: &[f32]) -> f64 {
    weights.iter().zip(spectrum).map(|(w, s)| w * f64::from(*s)).sum()
}

/// Colours of draws of the model itself, which others of it have for certain.
fn colours_of_draws(count: u64) -> Vec<f32> {
    let recipe = Recipe::builder(&model()).build().expect("it can be drawn");
    let spectra = cpu().collect(&recipe, Stream::named(1, "colours").draws(0..count)).expect("it draws");
    let weights = seen();
    spectra
        .chunks(31)
        .flat_map(|s| weights.iter().map(|w| product(w, s) as f32).collect::<Vec<_>>())
        .collect()
}

/// The bytes of all arrays of draws that are given colours.
fn drawn<'a>(engine: &Engine, recipe: &Recipe, draws: Draws<'a>, colours: &'a [f32]) -> Vec<Vec<u8>> {
    let mut all: Vec<Vec<u8>> = Vec::new();
    let mut session = engine.session(recipe).unwrap_or_else(|e| panic!("{engine}: {e}"));
    let made = session.draw_given(draws, colours, |batch| {
        all.resize_with(batch.formats().len(), Vec::new);
        for (format, bytes) in batch.formats().iter().zip(&mut all) {
            bytes.extend_from_slice(batch.bytes(format.quantity));
        }
        Ok::<_, EngineError>(())
    });
    made.unwrap_or_else(|e| panic!("{engine}: {e}"));
    all
}

/// The spectra of draws that are all given one colour.
fn of_colour(recipe: &Recipe, seed: u64, colour: [f32; 3], count: u64) -> Vec<f32> {
    let colours = colour.repeat(count as usize);
    let bytes = drawn(cpu(), recipe, Stream::new(seed).draws(0..count).into(), &colours);
    let spectra: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes[0]);
    spectra.chunks(31).filter(|spectrum| spectrum[0] != 0.0).flatten().copied().collect()
}

#[test]
fn every_engine_draws_the_same_metamers() {
    let colours = colours_of_draws(4097);
    let all = [Quantity::Spectra, Quantity::Weights, Quantity::Xyz, Quantity::Lrv, Quantity::Attempts];
    let fine = Model::builtin_with("munsell-vrhel", "400:1:700".parse().expect("a grid"), 9)
        .expect("it is built in");
    let recipes = [
        given().quantities(all),
        given().spectra_dtype(Dtype::F16),
        given().max_attempts(3),
        given().quantities([Quantity::Xyz]).illuminant(Illuminant::F11),
        Recipe::builder(&model()).given(Sensors::builtin("rods").expect("it is built in")),
        Recipe::builder(&fine).given(eye()).quantities(all), // in loops
    ];
    for (number, recipe) in recipes.into_iter().enumerate() {
        let recipe = recipe.build().unwrap_or_else(|e| panic!("{number}: {e}"));
        let width = recipe.settings().given.as_ref().expect("it has some").len();
        for count in [1u64, 2, 63, 65, 1000, 4097] {
            let colours = &colours[..count as usize * width];
            let range = Stream::new(3).draws(7..7 + count).into();
            let ours = drawn(cpu(), &recipe, range, colours);
            assert!(!gpu_is_software() || ours == drawn(gpu(), &recipe, range, colours), "{number}: {count}");
            let indices: Vec<u64> = (0..count).map(|i| 7 + i).collect();
            let list = Stream::new(3).at(&indices);
            assert!(ours == drawn(cpu(), &recipe, list, colours), "{number}: {count}");
            assert!(!gpu_is_software() || ours == drawn(gpu(), &recipe, list, colours), "{number}: {count}");
        }
    }
}

/// A draw depends on its own index and colour, and on nothing else.
#[test]
fn draws_do_not_depend_on_their_neighbours() {
    let colours = colours_of_draws(3000);
    let recipe = given().build().expect("it can be drawn");
    let all = drawn(cpu(), &recipe, Stream::new(3).draws(0..3000).into(), &colours);
    let order: Vec<u64> = (0..3000).map(|i| (i * 1231 + 17) % 3000).collect();
    let shuffled: Vec<f32> = order.iter().flat_map(|&i| colours[3 * i as usize..][..3].to_vec()).collect();
    let found = drawn(cpu(), &recipe, Stream::new(3).at(&order), &shuffled);
    for (bytes, other) in all.iter().zip(&found) {
        let width = bytes.len() / 3000;
        for (place, &i) in order.iter().enumerate() {
            assert_eq!(bytes[i as usize * width..][..width], other[place * width..][..width]);
        }
    }
    let single = recipe.scalar_sampler::<f32>();
    let spectra: &[f32] = bytemuck::cast_slice(&all[0]);
    for i in [0usize, 5, 2999] {
        let one = single.draw_given(Stream::new(3), i as u64, &colours[3 * i..][..3]);
        assert_eq!(one.spectrum(), &spectra[31 * i..][..31]);
    }
}

#[test]
fn metamers_have_the_colour_that_was_asked_for() {
    let colours = colours_of_draws(20_000);
    let recipe = given().max_attempts(65_000).build().expect("it can be drawn");
    let weights = seen();
    let mut worst = 0.0f64;
    let counts = Metamers::new(cpu(), &recipe)
        .expect("it works")
        .draw(Stream::new(4).draws(0..20_000), &colours, |window| {
            let bytes = window.arrays().next().expect("there are spectra");
            let spectra: &[f32] = bytemuck::cast_slice(bytes);
            for (number, spectrum) in spectra.chunks(31).enumerate() {
                assert!(spectrum.iter().all(|&value| value > 0.0 && value < 1.0));
                let colour = &colours[3 * (window.draws.first as usize + number)..][..3];
                for (weights, given) in weights.iter().zip(colour) {
                    worst = worst.max((product(weights, spectrum) - f64::from(*given)).abs());
                }
            }
            Ok::<_, MetamerError>(())
        })
        .expect("it draws");
    println!("{counts:?}, largest difference {worst:.1e} of white");
    assert_eq!((counts.all(), counts.unreachable, counts.skipped), (20_000, 0, 0));
    assert!(counts.sampled > 19_900 && worst < BOUND, "{counts:?} {worst}");
}

/// A colour of which about one candidate in 130 is accepted.
const HARD: [f32; 3] = [0.43, 0.60, 0.06];

#[test]
fn what_cannot_be_given_says_why() {
    let message = |builder: RecipeBuilder| builder.build().unwrap_err().to_string();
    for (builder, part) in [
        (given().lrv(0.3), "a target luminous reflectance beside responses that each draw is given"),
        (given().xyz([0.3; 3]), "target tristimulus values beside"),
        (given().covariance_scale(0.0), "fit it with more components"),
        (
            Recipe::builder(&Model::builtin_with("munsell-vrhel", Grid::DEFAULT, 3).expect("it is built in"))
                .given(eye()),
            "the 3 responses of cie1931 that draws are given take as many directions",
        ),
        (given().sensors(eye()), "a set of sensors needs the quantity responses"),
    ] {
        let text = message(builder);
        assert!(text.contains(part), "{text}");
    }
}

/// Metamers per second of colours that the model itself has, in process; printed and not judged.
#[test]
#[ignore = "a measurement, which asserts nothing of times"]
fn metamers_per_second() {
    let count = 2_000_000u64;
    let colours = colours_of_draws(count);
    for (name, recipe) in [("spectra", given()), ("spectra in 16 bits", given().spectra_dtype(Dtype::F16))] {
        let recipe = recipe.build().expect("it can be drawn");
        let mut session = cpu().session(&recipe).expect("it works");
        for _ in 0..4 {
            let start = std::time::Instant::now();
            session
                .draw_given(Stream::new(1).draws(0..count), &colours, |_| Ok::<_, EngineError>(()))
                .expect("it draws");
            println!("{name}: {:.1} million a second", count as f64 / start.elapsed().as_secs_f64() / 1e6);
        }
    }
}

/// Each texel's spectrum has its colour, and is the one that the CPU draws for that pixel.
#[test]
fn a_shader_turns_texels_into_the_spectra_of_the_cpu() {
    let (recipe, width) = (texture::recipe(), 64);
    let texels = texture::texture(width, 48);
    let shaded = texture::shade(&recipe, &texels, width);
    let scalar = recipe.scalar_sampler::<f32>();
    let stream = Stream::new(texture::SEED);
    for (i, (shaded, texel)) in shaded.iter().zip(&texels).enumerate() {
        let (x, y) = (i as u64 % u64::from(width), i as u64 / u64::from(width));
        let drawn = scalar.draw_given(stream, y << 32 | x, &texel[..3]);
        let xyz = drawn.values(Quantity::Xyz);
        let expected = [xyz[0], xyz[1], xyz[2], drawn.status().attempts() as f32];
        match gpu_is_software() {
            true => assert_eq!(*shaded, expected, "{x}, {y}"),
            false => assert!(shaded.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-5), "{x}, {y}"),
        }
        assert!(shaded[3] > 0.0, "{x}, {y}");
    }
}

/// The same colours by other methods: what they are asked for, they have less exactly.
#[test]
fn spectra_of_colours_beside_other_methods() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    println!("{}", script(folder.path(), "recovery", ", 200, 2"));
}
