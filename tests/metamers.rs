//! Metamers: draws that are given colours. They have them exactly, are the same on every engine and in every part of an
//! image, and have the distribution of the model's draws that happen to have that colour.

mod engines;
mod program;
#[path = "../examples/texture.rs"]
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

/// Two-sample statistic of Kolmogorov and Smirnov, times the root of the effective number.
fn kolmogorov(a: &mut [f64], b: &mut [f64]) -> f64 {
    a.sort_by(f64::total_cmp);
    b.sort_by(f64::total_cmp);
    let (mut i, mut j, mut largest) = (0, 0, 0.0f64);
    while i < a.len() && j < b.len() {
        if a[i] <= b[j] {
            i += 1;
        } else {
            j += 1;
        }
        largest = largest.max((i as f64 / a.len() as f64 - j as f64 / b.len() as f64).abs());
    }
    largest * ((a.len() * b.len()) as f64 / (a.len() + b.len()) as f64).sqrt()
}

/// A statistic above this has a probability of 2 exp(-2 x^2) = 1e-9: with some 300 comparisons in this file, a false alarm
/// in 3 million runs.
const ALARM: f64 = 3.27;

/// The largest statistic over bands and their differences.
fn difference(a: &[f32], b: &[f32]) -> f64 {
    // A band, or a band less another.
    let features = (0..31).map(|band| (band, None)).chain((0..28).map(|band| (band, Some(band + 3))));
    let of = |spectra: &[f32], (band, other): (usize, Option<usize>)| -> Vec<f64> {
        let value = |s: &[f32]| f64::from(s[band]) - other.map_or(0.0, |other| f64::from(s[other]));
        spectra.chunks(31).map(value).collect()
    };
    features.map(|feature| kolmogorov(&mut of(a, feature), &mut of(b, feature))).fold(0.0, f64::max)
}

/// The spectra of draws that are all given one colour.
fn of_colour(recipe: &Recipe, seed: u64, colour: [f32; 3], count: u64) -> Vec<f32> {
    let colours = colour.repeat(count as usize);
    let bytes = drawn(cpu(), recipe, Stream::new(seed).draws(0..count).into(), &colours);
    let spectra: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes[0]);
    spectra.chunks(31).filter(|spectrum| spectrum[0] != 0.0).flatten().copied().collect()
}

/// Plain draws of the model whose colour lies in a ball around one, which shrinks: the distribution of the others goes
/// over into that of the metamers.
#[test]
fn metamers_are_plain_draws_that_have_the_colour() {
    let recipe = given().max_attempts(65_000).build().expect("it can be drawn");
    let plain = Recipe::builder(&model()).build().expect("it can be drawn");
    let weights = seen();
    // A mean colour, and a darker and more saturated one.
    for (number, colour) in [[0.33f32, 0.30, 0.24], [0.22, 0.20, 0.14]].into_iter().enumerate() {
        let mut found: Vec<(f64, Vec<f32>)> = Vec::new();
        let made = cpu().draw(&plain, Stream::new(50 + number as u64).draws(0..24_000_000), |batch| {
            for spectrum in batch.spectra().chunks(31) {
                let squares =
                    weights.iter().zip(colour).map(|(w, c)| (product(w, spectrum) - f64::from(c)).powi(2));
                let distance = squares.sum::<f64>().sqrt();
                if distance < 0.02 {
                    found.push((distance, spectrum.to_vec()));
                }
            }
            Ok::<_, EngineError>(())
        });
        made.expect("it draws");
        let ours = of_colour(&recipe, 60, colour, 40_000);
        let within = |radius: f64| -> Vec<f32> {
            found.iter().filter(|(distance, _)| *distance < radius).flat_map(|(_, s)| s.clone()).collect()
        };
        let (wide, near) = (within(0.02), within(0.006));
        let (far, close) = (difference(&ours, &wide), difference(&ours, &near));
        println!(
            "{colour:?}: {} draws within 0.02 of white differ by {far:.2}, {} within 0.006 by {close:.2}; alarm at {ALARM}",
            wide.len() / 31,
            near.len() / 31
        );
        assert!(near.len() / 31 > 800 && close < ALARM, "{colour:?}: {close}");
    }
}

/// The model's Gaussian conditioned on a colour, made here from its parts and by other means: mean and factor of spectra.
struct Conditional {
    mean: DVector<f64>,
    /// Columns of the free normals.
    factor: DMatrix<f64>,
}

impl Conditional {
    fn new(colour: [f32; 3]) -> Conditional {
        let model = model();
        let parts = model.parts();
        let basis = parts.basis.transpose(); // a column for each component
        let factor = &basis * model.weight_factor();
        let mean = &parts.mean + &basis * &parts.weight_mean;
        let weights = DMatrix::from_fn(3, 31, |row, column| seen()[row][column]);
        let a = &weights * &factor;
        let difference = DVector::from_fn(3, |i, _| f64::from(colour[i])) - &weights * &mean;
        let inverse = (&a * a.transpose()).try_inverse().expect("colours vary");
        let mean = mean + &factor * a.transpose() * &inverse * difference;
        // The projection on what leaves the colour alone, by its eigenvectors.
        let projection = DMatrix::identity(8, 8) - a.transpose() * inverse * &a;
        let eigen = projection.symmetric_eigen();
        let free: Vec<usize> = (0..8).filter(|&i| eigen.eigenvalues[i] > 0.5).collect();
        assert_eq!(free.len(), 5);
        Conditional { mean, factor: factor * eigen.eigenvectors.select_columns(&free) }
    }

    fn spectrum(&self, y: &DVector<f64>) -> Vec<f32> {
        (&self.mean + &self.factor * y).iter().map(|&value| value as f32).collect()
    }

    /// Hit and run: along a random direction, a normal between where the line leaves the bounds.
    fn chain(&self, start: DVector<f64>, seed: u64, count: usize, thinning: usize) -> Vec<f32> {
        use spectroll::rand::RngExt;
        let mut rng = Stream::new(seed).rng();
        let mut normal = move || {
            let (u, v): (f64, f64) = (rng.random(), rng.random());
            ((-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos(), rng.random::<f64>())
        };
        let mut y = start;
        let mut spectra = Vec::new();
        for step in 0..(count + 100) * thinning {
            let direction = DVector::from_fn(5, |_, _| normal().0).normalize();
            let (value, slope) = (&self.mean + &self.factor * &y, &self.factor * &direction);
            let (mut low, mut high) = (-1e3f64, 1e3f64);
            for (value, slope) in value.iter().zip(&slope) {
                let ends = [(-value) / slope, (1.0 - value) / slope];
                low = low.max(ends[0].min(ends[1]));
                high = high.min(ends[0].max(ends[1]));
            }
            // A standard normal along the line, around where it is nearest to the origin, by its distribution function.
            let centre = -y.dot(&direction);
            let (from, to) = (phi(low - centre), phi(high - centre));
            let at = inverse_phi(from + (to - from) * normal().1).clamp(low - centre, high - centre);
            y += direction * (centre + at);
            if step >= 100 * thinning && step % thinning == 0 {
                spectra.extend(self.spectrum(&y));
            }
        }
        spectra
    }
}

/// The distribution function of the standard normal (Abramowitz & Stegun 7.1.26 would be too coarse: a series and a
/// continued fraction).
fn phi(x: f64) -> f64 {
    if x.abs() < 6.0 {
        let (mut term, mut sum, mut n) = (x, x, 1.0);
        while term.abs() > 1e-17 * sum.abs() {
            term *= x * x / (2.0 * n + 1.0);
            sum += term;
            n += 1.0;
        }
        return 0.5 + sum * (-x * x / 2.0).exp() / std::f64::consts::TAU.sqrt();
    }
    if x > 0.0 { 1.0 } else { 0.0 }
}

fn inverse_phi(p: f64) -> f64 {
    let (mut low, mut high) = (-9.0, 9.0);
    for _ in 0..60 {
        let middle = (low + high) / 2.0;
        if phi(middle) < p { low = middle } else { high = middle }
    }
    (low + high) / 2.0
}

/// A colour of which about one candidate in 130 is accepted.
const HARD: [f32; 3] = [0.43, 0.60, 0.06];

#[test]
fn hard_metamers_are_those_of_a_markov_chain() {
    let recipe = given().max_attempts(1_000_000).build().expect("it can be drawn");
    let ours = of_colour(&recipe, 70, HARD, 6000);
    assert_eq!(ours.len(), 31 * 6000);
    let conditional = Conditional::new(HARD);
    // From the mode, as another method finds it: a point that is within bounds.
    let first: Vec<f64> = ours[..31].iter().map(|&v| v.into()).collect();
    let start = conditional.factor.clone().svd(true, true);
    let start =
        start.solve(&(DVector::from_vec(first) - &conditional.mean), 1e-9).expect("it has a solution");
    let chain = conditional.chain(start, 71, 6000, 40);
    let statistic = difference(&ours, &chain);
    println!("a chain differs by {statistic:.2}; alarm at {ALARM}");
    assert!(statistic < ALARM, "{statistic}");

    // Planted faults, each a way in which such a sampler goes wrong.
    let unbounded = |transform: &dyn Fn(usize, Vec<f64>) -> Option<Vec<f32>>| -> Vec<f32> {
        use spectroll::rand::RngExt;
        let mut rng = Stream::new(72).rng();
        let mut spectra = Vec::new();
        let mut number = 0;
        while spectra.len() < 31 * 6000 {
            let mut normal = || {
                let (u, v): (f64, f64) = (rng.random(), rng.random());
                (-2.0 * (1.0 - u).ln()).sqrt() * (std::f64::consts::TAU * v).cos()
            };
            let y: Vec<f64> = (0..5).map(|_| normal()).collect();
            spectra.extend(transform(number, y).into_iter().flatten());
            number += 1;
        }
        spectra
    };
    let accepted = |spectrum: Vec<f32>| spectrum.iter().all(|&v| v > 0.0 && v < 1.0).then_some(spectrum);
    let neighbour = Conditional::new([HARD[0] + 0.01, HARD[1] + 0.01, HARD[2] + 0.01]);
    let faults: [(&str, Vec<f32>); 3] = [
        (
            "the colour of the neighbour",
            unbounded(&|_, y| accepted(neighbour.spectrum(&DVector::from_vec(y)))),
        ),
        (
            "a candidate that is not redrawn",
            unbounded(&|_, y| {
                let spectrum = conditional.spectrum(&DVector::from_vec(y));
                Some(spectrum.iter().map(|v| v.clamp(1e-6, 1.0 - 1e-6)).collect())
            }),
        ),
        (
            "a wrong null space",
            unbounded(&|_, mut y| {
                y[0] *= 0.7;
                accepted(conditional.spectrum(&DVector::from_vec(y)))
            }),
        ),
    ];
    for (fault, spectra) in faults {
        let statistic = difference(&ours, &spectra);
        println!("{fault}: {statistic:.2}");
        assert!(statistic > 1.5 * ALARM, "{fault}: {statistic}");
    }
}

/// A spectrum outside of the null space does not have its colour, which is noticed at once.
#[test]
fn a_wrong_null_space_changes_the_colour() {
    let conditional = Conditional::new([0.33, 0.30, 0.24]);
    let turned =
        DVector::from_fn(31, |band, _| conditional.factor[(band, 0)] * if band < 15 { 1.0 } else { 0.9 });
    let spectrum: Vec<f32> = (&conditional.mean + turned).iter().map(|&v| v as f32).collect();
    let weights = seen();
    let errors = weights.iter().zip([0.33, 0.30, 0.24]).map(|(w, c)| (product(w, &spectrum) - c).abs());
    assert!(errors.fold(0.0, f64::max) > 10.0 * BOUND);
}

fn answers(
    recipe: &Recipe,
    engine: &Engine,
    colours: &[f32],
    hard: HardColours,
    far: UnreachableColours,
) -> (AnswerCounts, Vec<Answer>, Vec<f32>) {
    let count = (colours.len() / 3) as u64;
    let (mut all, mut spectra) = (Vec::new(), Vec::new());
    let counts = Metamers::new(engine, recipe)
        .expect("it works")
        .hard(hard)
        .unreachable(far)
        .draw(Stream::new(9).draws(0..count), colours, |window| {
            all.extend_from_slice(window.answers);
            spectra.extend(bytemuck::pod_collect_to_vec::<u8, f32>(window.arrays().next().expect("spectra")));
            Ok::<_, MetamerError>(())
        })
        .expect("it draws");
    (counts, all, spectra)
}

#[test]
fn hard_and_unreachable_colours_have_their_answers() {
    let recipe = given().max_attempts(5).build().expect("it can be drawn");
    let colours: Vec<f32> = [HARD, [0.33, 0.30, 0.24], [1.0, 1.0, 1.0], [0.1, 0.9, 0.1], HARD].concat();
    let weights = seen();
    let error = |number: usize, spectra: &[f32]| {
        let spectrum = &spectra[31 * number..][..31];
        let differences = weights
            .iter()
            .zip(&colours[3 * number..])
            .map(|(w, c)| (product(w, spectrum) - f64::from(*c)).abs());
        differences.fold(0.0, f64::max)
    };
    let (counts, found, spectra) =
        answers(&recipe, cpu(), &colours, HardColours::Mode, UnreachableColours::Leave);
    assert_eq!((counts.mode, counts.sampled, counts.unreachable), (2, 1, 2), "{found:?}");
    assert!(matches!(
        found[..],
        [Answer::Mode, Answer::Sampled { .. }, Answer::Unreachable, Answer::Unreachable, Answer::Mode]
    ));
    assert!(error(0, &spectra) < BOUND && spectra[..31].iter().all(|&v| v > 0.0 && v < 1.0));
    assert!(spectra[62..124].iter().all(|&v| v == 0.0));
    assert_eq!(spectra[..31], spectra[124..]); // the mode takes no random numbers
    assert_eq!((found.clone(), spectra.clone()), {
        let (_, found, spectra) =
            answers(&recipe, gpu(), &colours, HardColours::Mode, UnreachableColours::Leave);
        (
            found,
            if gpu_is_software() {
                spectra
            } else {
                answers(&recipe, cpu(), &colours, HardColours::Mode, UnreachableColours::Leave).2
            },
        )
    });

    let (counts, found, spectra) =
        answers(&recipe, cpu(), &colours, HardColours::Skip, UnreachableColours::Nearest);
    assert_eq!((counts.skipped, counts.nearest), (2, 2), "{found:?}");
    assert!(spectra[..31].iter().all(|&v| v == 0.0));
    for number in [2, 3] {
        let Answer::Nearest { distance } = found[number] else { panic!("{:?}", found[number]) };
        assert!((error(number, &spectra) - f64::from(distance)).abs() < BOUND && distance > 0.0);
        assert!(spectra[31 * number..][..31].iter().all(|&v| v > 0.0 && v < 1.0));
    }
    // White is nearly there.
    assert!(found[2].distance() < 0.03, "{found:?}");

    let failed = Metamers::new(cpu(), &recipe)
        .expect("it works")
        .hard(HardColours::Error)
        .draw(Stream::new(9).draws(0..5), &colours, |_| Ok::<_, MetamerError>(()))
        .unwrap_err();
    assert!(
        failed
            .to_string()
            .contains("draw 0: no spectrum with the responses [0.43, 0.6, 0.06] was found in 5"),
        "{failed}"
    );
}

/// Colours that are far from what any spectrum has are drawn once and known from then on; it shows in no answer.
#[test]
fn colours_that_came_up_before_have_the_same_answers() {
    let mut colours = colours_of_draws(3000);
    for (number, colour) in colours.chunks_exact_mut(3).enumerate() {
        match number % 3 {
            0 => colour.fill(1.0),
            // Hard, or out of reach by little or by far.
            1 => colour.copy_from_slice(&[0.93, 0.90, 0.05 + 0.01 * (number % 40) as f32]),
            _ => {}
        }
    }
    let recipe =
        given().quantities([Quantity::Spectra, Quantity::Attempts]).max_attempts(200).build().unwrap();
    for engine in [cpu(), gpu()] {
        for unreachable in [UnreachableColours::Leave, UnreachableColours::Nearest] {
            let metamers = Metamers::new(engine, &recipe).unwrap_or_else(|e| panic!("{engine}: {e}"));
            let mut metamers = metamers.unreachable(unreachable);
            let mut answers = || {
                let (mut all, mut bytes) = (Vec::new(), Vec::new());
                let counts = metamers.draw(Stream::new(3).draws(5..3005), &colours, |window| {
                    assert_eq!(window.draws.first, 5 + all.len() as u64);
                    all.extend_from_slice(window.answers);
                    bytes.resize_with(window.formats().len(), Vec::new);
                    bytes.iter_mut().zip(window.arrays()).for_each(|(all, some)| all.extend_from_slice(some));
                    Ok::<_, MetamerError>(())
                });
                (all, bytes, counts.expect("every colour may be left or moved"))
            };
            let (first, second) = (answers(), answers());
            assert!(first == second, "{engine}, {unreachable:?}");
            assert_eq!(first.0.len(), 3000);
            let kinds = |kind: fn(&Answer) -> bool| first.0.iter().filter(|answer| kind(answer)).count();
            assert!(kinds(|answer| matches!(answer, Answer::Sampled { .. })) >= 1000);
            assert!(kinds(|answer| matches!(answer, Answer::Nearest { .. } | Answer::Unreachable)) >= 1000);
        }
    }
}

/// The mode is smooth in the model's sense: no other spectrum of that colour is more probable, and drawn ones are less.
#[test]
fn no_draw_is_more_probable_than_the_mode() {
    let recipe = given().max_attempts(1_000_000).build().expect("it can be drawn");
    let model = model();
    let inverse = model.parts().weight_covariance.clone().try_inverse().expect("it has full rank");
    let improbable = |spectrum: &[f32]| {
        let values = DVector::from_fn(31, |band, _| f64::from(spectrum[band])) - &model.parts().mean;
        let weights = &model.parts().basis * &values - &model.parts().weight_mean;
        (weights.transpose() * &inverse * &weights)[0]
    };
    for colour in [HARD, [0.33, 0.30, 0.24], [0.7, 0.75, 0.6]] {
        let mut mode = Vec::new();
        Metamers::new(cpu(), &recipe)
            .expect("it works")
            .modes(&colour, |window| {
                mode = bytemuck::pod_collect_to_vec::<u8, f32>(window.arrays().next().expect("spectra"));
                Ok::<_, MetamerError>(())
            })
            .expect("it has one");
        let least = improbable(&mode);
        let drawn = of_colour(&recipe, 80, colour, 2000);
        assert!(drawn.chunks(31).all(|spectrum| improbable(spectrum) > least - 1e-3), "{colour:?} {least}");
    }
}

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

fn write_png(path: &std::path::Path, width: u32, height: u32) {
    let file = std::fs::File::create(path).expect("it can be made");
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        [(60 + 3 * x) as u8, (70 + 2 * y) as u8, (150 - 2 * x) as u8]
    };
    let bytes: Vec<u8> = (0..width * height).flat_map(pixel).collect();
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes)).expect("it can be written");
}

#[test]
fn parts_of_an_image_have_the_spectra_of_the_whole() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    write_png(&folder.join("a.png"), 37, 23);
    for (name, options) in [
        ("a.zarr", "--chunk 5"),
        ("b.zarr", "--chunk 7 --zstd"),
        ("a.npz", ""),
        ("part.npz", "--crop 10,4,20,9"),
        ("two.npz", "--per-pixel 2"),
        ("mode.npz", "--per-pixel 0"),
        ("half.h5", "--dtype f16"),
    ] {
        let (_, said) =
            succeeds(folder, &format!("metamers a.png --seed 4 --engine cpu {options} -o {name}"));
        assert!(said.contains("pixels") && !said.contains("zeros"), "{said}");
    }
    for shard in ["1/3", "2/3", "3/3"] {
        succeeds(
            folder,
            &format!("metamers a.png --seed 4 --engine cpu --chunk 5 -o c.zarr --shard {shard} --resume"),
        );
    }
    let code =
        "import warnings; warnings.simplefilter('ignore')\n\
         import numpy as np, zarr, h5py, scipy.io\n\
         a = np.load('a.npz'); s = a['spectra']\n\
         assert s.shape == (23, 37, 31) and a['status'].shape == (23, 37) and a['colours'].shape == (23, 37, 3)\n\
         for name in 'abc':\n    assert (zarr.open(name + '.zarr')['spectra'][:] == s).all(), name\n\
         assert list(zarr.open('a.zarr')['spectra'].metadata.dimension_names) == ['row', 'column', 'wavelength']\n\
         assert (np.load('part.npz')['spectra'] == s[4:13, 10:30]).all()\n\
         t = np.load('two.npz')['spectra']; assert t.shape == (23, 37, 2, 31) and (t[:, :, 0] != t[:, :, 1]).any()\n\
         h = h5py.File('half.h5')['spectra'][:]; assert h.dtype == np.float16 and np.abs(h - s).max() < 5e-4\n\
         m = np.load('mode.npz'); assert (m['status'] == 2).all()\n\
         # The colours of the pixels, from their bytes and the standard.\n\
         x, y = np.arange(37), np.arange(23)[:, None]\n\
         rgb = np.stack(np.broadcast_arrays(60 + 3 * x, 70 + 2 * y, 150 - 2 * x), -1) / 255\n\
         linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)\n\
         M = np.linalg.inv([[3.2406255, -1.537208, -0.4986286], [-0.9689307, 1.8757561, 0.0415175], [0.0557101, -0.2040211, 1.0569959]])\n\
         xyz = linear @ M.T\n\
         data = DATA\n\
         cmf = scipy.io.loadmat(data + '/T_xyz1931.mat')['T_xyz1931'][:, 40:341:10]\n\
         d65 = scipy.io.loadmat(data + '/spd_D65.mat')['spd_D65'].ravel()[4:65:2]\n\
         w = d65 * cmf / (d65 * cmf[1]).sum()\n\
         for spectra in (s, t[:, :, 1], m['spectra']):\n    error = np.abs(spectra.astype(float) @ w.T - xyz).max(); assert error < 1e-5, error\n\
         assert np.abs(a['colours'] * w.sum(1) - xyz).max() < 1e-6\n\
         print('same')"
            .replace("DATA", &format!("{:?}", concat!(env!("CARGO_MANIFEST_DIR"), "/data")));
    assert_eq!(python(folder, &code), "same");
    let (_, said) = succeeds(folder, "verify a.zarr --redraw 1");
    assert!(said.contains("as they were written"), "{said}");
}

#[test]
fn tables_of_colours_in_every_space() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("it can be written");
    write("xyz.csv", "X,Y,Z\n0.3,0.3,0.25\n0.2,0.25,0.1\n");
    write("lab.csv", "L;a;b\n60;10;-15\n40;-10;20\n");
    write("cones.txt", "0.3 0.3 0.25\n0.2 0.22 0.1\n");
    write("srgb.csv", "0.6,0.5,0.4\n0.2,0.4,0.3\n");
    write("white.csv", "1,1,1\n0.95,1,1.08\n0.3,0.3,0.25\n");
    write("large.csv", "153,128,102\n");
    let run = "metamers --engine cpu --seed 2 --per-colour 50";
    for (name, options) in [
        ("xyz", "xyz.csv"),
        ("lab", "lab.csv --space lab --illuminant a --observer cie1964"),
        ("cones", "cones.txt --space ss2 --illuminant f11"),
        ("srgb", "srgb.csv --space srgb"),
    ] {
        succeeds(folder, &format!("{run} {options} -o {name}.npz"));
    }
    let found = python(
        folder,
        "import warnings; warnings.simplefilter('ignore')\n\
         import numpy as np, colour\n\
         def load(n):\n    a = np.load(n + '.npz'); assert a['spectra'].shape == (2, 50, 31); return a['spectra'].astype(float)\n\
         g = colour.SpectralShape(400, 700, 10)\n\
         def cmfs(n):\n    return colour.MSDS_CMFS[n].copy().align(g).values\n\
         def spd(n):\n    return colour.SDS_ILLUMINANTS[n].copy().align(g).values\n\
         def xyz(s, e, f):\n    return s @ (e[:, None] * f) / (e * f[:, 1]).sum()\n\
         two, ten = cmfs('CIE 1931 2 Degree Standard Observer'), cmfs('CIE 1964 10 Degree Standard Observer')\n\
         d65, a = spd('D65'), spd('A')\n\
         err = lambda x, y: np.abs(x - np.array(y)[:, None]).max()\n\
         assert err(xyz(load('xyz'), d65, two), [[0.3, 0.3, 0.25], [0.2, 0.25, 0.1]]) < 1e-5\n\
         white = xyz(np.ones(31), a, ten)\n\
         lab = xyz(load('lab'), a, ten) / white\n\
         f = np.where(lab > (6 / 29) ** 3, np.cbrt(lab), lab * 841 / 108 + 4 / 29)\n\
         lab = np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1)\n\
         assert err(lab, [[60, 10, -15], [40, -10, 20]]) < 2e-3\n\
         rgb = colour.XYZ_to_sRGB(xyz(load('srgb'), d65, two), chromatic_adaptation_transform=None)\n\
         assert err(rgb, [[0.6, 0.5, 0.4], [0.2, 0.4, 0.3]]) < 1e-3\n\
         fl = colour.SDS_ILLUMINANTS['FL11']; w = np.arange(400, 701, 10)\n\
         e = 0.25 * fl[w - 5] + 0.5 * fl[w] + 0.25 * fl[w + 5]\n\
         c = e[:, None] * cmfs('Stockman & Sharpe 2 Degree Cone Fundamentals')\n\
         assert err(load('cones') @ c / c.sum(0), [[0.3, 0.3, 0.25], [0.2, 0.22, 0.1]]) < 1e-5\n\
         print('same')",
    );
    assert_eq!(found, "same");
    let (_, said) = succeeds(folder, "metamers white.csv --engine cpu -o w.npz");
    assert!(
        said.contains("2 zeros, of colours that no spectrum has") && said.contains("their own: 1, 2"),
        "{said}"
    );
    let (_, said) = succeeds(folder, "metamers white.csv --engine cpu --nearest -o n.npz");
    assert!(said.contains("2 of the nearest colour, up to"), "{said}");
    let (json, _) = succeeds(folder, "metamers white.csv --engine cpu --nearest --json -o j.npz");
    assert!(json.contains("\"nearest\": 2") && json.contains("\"sampled\": 1"), "{json}");
    for (arguments, code, message) in [
        (
            "metamers white.csv --hard error -o e.npz",
            2,
            "draw 0: no spectrum of this model has the responses",
        ),
        ("metamers none.csv -o e.npz", 2, "there is no file of this name"),
        ("metamers large.csv --space srgb -o e.npz", 2, "whose values are 0 to 1: divide by 255"),
        ("metamers xyz.csv --space rods -o e.npz", 2, "3 values, where a colour has 1"),
        ("metamers xyz.csv --per-pixel 2 -o e.npz", 2, "--per-pixel is for an image"),
        ("metamers xyz.csv --crop 0,0,1,1 -o e.npz", 2, "--crop is for an image"),
        ("metamers xyz.csv --space ss3 -o e.npz", 2, "did you mean \"ss2\"?"),
        ("metamers xyz.csv --space labb -o e.npz", 2, "did you mean \"lab\"? there are xyz, srgb"),
        ("metamers xyz.csv --space cones.tsv -o e.npz", 4, "cannot read"),
        ("metamers xyz.csv -k 3 -o e.npz", 2, "fit it with more components"),
        ("metamers xyz.csv --model granada-10nm -o e.npz", 2, "is neither a file nor a built-in model"),
    ] {
        fails(folder, arguments, code, message);
    }
}

/// All of a cube of sRGB colours, with the numbers that the guide states; `cargo test --release --test metamers -- --ignored
/// --nocapture cube`.
#[test]
#[ignore = "a quarter of a million colours"]
fn all_of_the_srgb_cube_is_answered() {
    let recipe = given().max_attempts(1000).build().expect("it can be drawn");
    let weights = seen();
    let decode = |i: u32| {
        let v = f64::from(i) / 63.0;
        if v <= 0.04045 { v / 12.92 } else { ((v + 0.055) / 1.055).powf(2.4) }
    };
    let whites =
        colorimetry::xyz_weights(&Grid::DEFAULT).expect("it is visible").map(|w| w.iter().sum::<f64>());
    let colours: Vec<f32> = (0..1u32 << 18)
        .flat_map(|i| {
            let xyz = colorimetry::linear_srgb_to_xyz([i >> 12, (i >> 6) & 63, i & 63].map(decode));
            [0, 1, 2].map(|c| (xyz[c] / whites[c]) as f32)
        })
        .collect();
    let start = std::time::Instant::now();
    let (counts, found, spectra) =
        answers(&recipe, cpu(), &colours, HardColours::Mode, UnreachableColours::Nearest);
    let seconds = start.elapsed().as_secs_f64();
    let mut worst = 0.0f64;
    for ((answer, spectrum), colour) in found.iter().zip(spectra.chunks(31)).zip(colours.chunks(3)) {
        assert!(spectrum.iter().all(|&value| value > 0.0 && value < 1.0), "{answer:?}");
        let errors = weights.iter().zip(colour).map(|(w, c)| (product(w, spectrum) - f64::from(*c)).abs());
        worst = worst.max(errors.fold(0.0, f64::max) - f64::from(answer.distance()));
    }
    println!("{counts:?}, largest error {worst:.1e}, {seconds:.1} s");
    assert_eq!(counts.all(), 1 << 18);
    assert!(worst < BOUND, "{worst}");
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
