//! The distribution of metamers, against plain draws of the model and against a Markov chain.

use super::*;

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
