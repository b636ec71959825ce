//! The checks: each holds a sample against a reference and says what differs, if it differs by more than chance.
//!
//! Thresholds come from one budget: all checks of all sound samples together raise a false alarm once in a million
//! choices of the seeds. The budget is split evenly over the checks that are run, and in a check over its comparisons
//! (Bonferroni). [`smallest_errors`] says what the checks can see.

use statrs::distribution::{ContinuousCDF, Normal};

use crate::sample::Sample;

/// The probability that sound draws fail any of the tests.
const FALSE_ALARMS: f64 = 1e-6;

/// How many checks are run on sound draws, at most; the tests count theirs.
pub(crate) const RUNS: usize = 180;

/// The probability that an error as large as [`smallest_errors`] says goes unseen.
const MISSED: f64 = 1e-3;

/// A band this close to a bound is at the edge.
pub(crate) const EDGE: f64 = 1e-3;

pub(crate) type Check = fn(&Sample, &Sample) -> Result<(), String>;

/// What a check holds a sample against.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Against {
    /// The oracle's sample, or nothing.
    Oracle,
    /// Another stream of the same sampler.
    OtherStream,
    /// The same stream 2^32 draws on.
    FarIndex,
    /// The library's f64 draws of the same indices.
    Library,
}

/// The checks that suit every scenario.
pub(crate) const CHECKS: [(&str, Against, Check); 10] = [
    ("acceptance", Against::Oracle, acceptance),
    ("means", Against::Oracle, means),
    ("covariance", Against::Oracle, covariance),
    ("distribution", Against::Oracle, distribution),
    ("edges", Against::Oracle, edges),
    ("physical", Against::Oracle, physical),
    ("neighbours", Against::Oracle, neighbours),
    ("streams", Against::OtherStream, independence),
    ("far indices", Against::FarIndex, independence),
    ("known draws", Against::Library, known_draws),
];

/// How many standard errors one of several comparisons may be off.
pub(crate) fn sigmas(comparisons: usize) -> f64 {
    -Normal::standard().inverse_cdf(FALSE_ALARMS / RUNS as f64 / comparisons as f64 / 2.0)
}

/// How far two distribution functions may be apart, times the root of the effective size, by the inequality of
/// Dvoretzky, Kiefer & Wolfowitz with Massart's constant (for two samples of equal size: Wei & Dudley 2012).
fn supremum(comparisons: usize) -> f64 {
    ((2.0 * RUNS as f64 * comparisons as f64 / FALSE_ALARMS).ln() / 2.0).sqrt()
}

fn mean(x: &[f64]) -> f64 {
    x.iter().sum::<f64>() / x.len() as f64
}

/// The mean, and the variance of the mean.
fn estimate(x: &[f64]) -> (f64, f64) {
    let m = mean(x);
    let variance = x.iter().map(|v| (v - m) * (v - m)).sum::<f64>() / x.len() as f64;
    (m, variance / x.len() as f64)
}

/// Whether two estimates, each with its variance, agree to so many standard errors.
fn agree(what: &str, (a, va): (f64, f64), (b, vb): (f64, f64), sigmas: f64) -> Result<(), String> {
    let error = (va + vb).sqrt();
    if (a - b).abs() <= sigmas * error {
        return Ok(());
    }
    Err(format!("{what}: {a:.6} against {b:.6}, {:.1} standard errors apart", (a - b).abs() / error))
}

/// The share of candidates that are accepted.
pub(crate) fn acceptance(sample: &Sample, reference: &Sample) -> Result<(), String> {
    let share = |s: &Sample| {
        let p = 1.0 / mean(&s.attempts); // of a geometric distribution, whose estimate has the variance
        (p, p * p * (1.0 - p) / s.len() as f64)
    };
    agree("acceptance", share(sample), share(reference), sigmas(1))
}

/// The mean of every band and of every weight.
pub(crate) fn means(sample: &Sample, reference: &Sample) -> Result<(), String> {
    let sigmas = sigmas(sample.bands.len() + sample.weights.len());
    for (what, a, b) in
        [("band", &sample.bands, &reference.bands), ("weight", &sample.weights, &reference.weights)]
    {
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            agree(&format!("the mean of {what} {i}"), estimate(a), estimate(b), sigmas)?;
        }
    }
    Ok(())
}

/// The covariance of every two weights, and the variance of each.
pub(crate) fn covariance(sample: &Sample, reference: &Sample) -> Result<(), String> {
    let k = sample.weights.len();
    let sigmas = sigmas(k * (k + 1) / 2);
    let products = |s: &Sample, i: usize, j: usize| {
        let (a, b) = (&s.weights[i], &s.weights[j]);
        let (ma, mb) = (mean(a), mean(b));
        estimate(&a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).collect::<Vec<_>>())
    };
    for (i, j) in (0..k).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        let what = format!("the covariance of weights {i} and {j}");
        agree(&what, products(sample, i, j), products(reference, i, j), sigmas)?;
    }
    Ok(())
}

fn sorted(x: &[f64]) -> Vec<f64> {
    let mut x = x.to_vec();
    x.sort_unstable_by(f64::total_cmp);
    x
}

/// The distribution of every weight (two-sample Kolmogorov-Smirnov).
pub(crate) fn distribution(sample: &Sample, reference: &Sample) -> Result<(), String> {
    let (n, m) = (sample.len(), reference.len());
    let threshold = supremum(sample.weights.len()) * (1.0 / n as f64 + 1.0 / m as f64).sqrt();
    for (j, (a, b)) in sample.weights.iter().zip(&reference.weights).enumerate() {
        let (a, b) = (sorted(a), sorted(b));
        let (mut i, mut distance) = (0, 0f64);
        for (rank, value) in b.iter().enumerate() {
            while i < n && a[i] < *value {
                i += 1;
            }
            for rank in [rank, rank + 1] {
                distance = distance.max((i as f64 / n as f64 - rank as f64 / m as f64).abs());
            }
        }
        if distance > threshold {
            return Err(format!("weight {j}: distributions are {distance:.4} apart, beyond {threshold:.4}"));
        }
    }
    Ok(())
}

/// The distance of a sample from a distribution function.
fn distance(x: &[f64], cdf: impl Fn(f64) -> f64) -> f64 {
    let n = x.len() as f64;
    let gaps = sorted(x).into_iter().map(cdf).enumerate();
    gaps.fold(0.0, |d: f64, (i, p)| d.max(p - i as f64 / n).max((i + 1) as f64 / n - p))
}

/// The distribution of every weight against the Gaussian that it is where nothing is rejected.
pub(crate) fn gaussian(sample: &Sample, _: &Sample) -> Result<(), String> {
    let (parts, scale) = (sample.scenario.model.parts(), sample.scenario.scale);
    let threshold = supremum(sample.weights.len()) / (sample.len() as f64).sqrt();
    for (j, weights) in sample.weights.iter().enumerate() {
        let deviation = (scale * parts.weight_covariance[(j, j)]).sqrt();
        let normal = Normal::new(parts.weight_mean[j], deviation).expect("a deviation is positive");
        let distance = distance(weights, |w| normal.cdf(w));
        if distance > threshold {
            return Err(format!("weight {j}: {distance:.4} from its Gaussian, beyond {threshold:.4}"));
        }
    }
    Ok(())
}

/// The share of draws that come close to 0, that come close to 1, and that reach 1.
pub(crate) fn edges(sample: &Sample, reference: &Sample) -> Result<(), String> {
    let shares = |s: &Sample| {
        let extreme = |i: usize, pick: fn(f64, f64) -> f64| s.bands.iter().map(|b| b[i]).reduce(pick);
        let (mut low, mut high, mut above) = (0, 0, 0);
        for i in 0..s.len() {
            let (least, most) = (extreme(i, f64::min), extreme(i, f64::max));
            low += usize::from(least.is_some_and(|v| v.abs() < EDGE));
            high += usize::from(most.is_some_and(|v| (v - 1.0).abs() < EDGE));
            above += usize::from(most.is_some_and(|v| v >= 1.0));
        }
        [low, high, above].map(|count| count as f64 / s.len() as f64)
    };
    let (n, m) = (sample.len() as f64, reference.len() as f64);
    let sigmas = sigmas(3);
    for (what, (a, b)) in
        ["near 0", "near 1", "above 1"].iter().zip(shares(sample).into_iter().zip(shares(reference)))
    {
        let pooled = (n * a + m * b) / (n + m);
        let variance = |size: f64| pooled * (1.0 - pooled) / size;
        agree(&format!("the share of draws {what}"), (a, variance(n)), (b, variance(m)), sigmas)?;
    }
    Ok(())
}

/// Whether every value is above 0 and below its limit. No chance is involved.
pub(crate) fn physical(sample: &Sample, _: &Sample) -> Result<(), String> {
    let limit = sample.scenario.limit();
    match sample.bands.iter().flatten().find(|&&s| !(s > 0.0 && s < limit)) {
        Some(value) => Err(format!("a value of {value}")),
        None => Ok(()),
    }
}

/// Whether two groups of series of equal length are uncorrelated.
fn uncorrelated(what: &str, a: &[&[f64]], b: &[&[f64]]) -> Result<(), String> {
    let sigmas = sigmas(a.len() * b.len());
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            let ((mx, vx), (my, vy)) = (estimate(x), estimate(y));
            let n = x.len() as f64;
            let product = x.iter().zip(*y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
            let error = n * n * (vx * vy).sqrt() / n.sqrt();
            if product.abs() > sigmas * error {
                return Err(format!(
                    "{what}: series {i} and {j} correlate by {:.4}",
                    product / error / n.sqrt()
                ));
            }
        }
    }
    Ok(())
}

/// The weights and the attempts, where those vary.
fn series<'a>(sample: &'a Sample) -> Vec<&'a [f64]> {
    let varies = |x: &&'a [f64]| x.iter().any(|v| *v != x[0]);
    sample.weights.iter().map(Vec::as_slice).chain([sample.attempts.as_slice()]).filter(varies).collect()
}

/// The correlation between draws that follow each other.
pub(crate) fn neighbours(sample: &Sample, _: &Sample) -> Result<(), String> {
    let all = series(sample);
    let first: Vec<_> = all.iter().map(|x| &x[..x.len() - 1]).collect();
    let next: Vec<_> = all.iter().map(|x| &x[1..]).collect();
    uncorrelated("neighbours", &first, &next)
}

/// The correlation between two samples, draw by draw.
pub(crate) fn independence(sample: &Sample, other: &Sample) -> Result<(), String> {
    uncorrelated("two samples", &series(sample), &series(other))
}

/// Whether the first draws are those of the library in f64: as many as the reference has. No chance is involved.
pub(crate) fn known_draws(sample: &Sample, library: &Sample) -> Result<(), String> {
    let mut flips = 0;
    for i in 0..library.len() {
        if sample.attempts[i] != library.attempts[i] {
            flips += 1;
            continue;
        }
        for (a, b) in sample.bands.iter().zip(&library.bands) {
            if (a[i] - b[i]).abs() > 1e-4 {
                return Err(format!("draw {i}: {} where the library has {}", a[i], b[i]));
            }
        }
    }
    // f32 may flip a draw, but hardly ever.
    if flips > 1 { Err(format!("{flips} draws took another candidate than the library's")) } else { Ok(()) }
}

/// Whether uniforms have random bits below the 24th: those of a radius and of an angle, won back from the first two
/// weights. For draws in f64 of a model with a diagonal covariance; f32 has no such bits in its results.
pub(crate) fn low_bits(sample: &Sample, _: &Sample) -> Result<(), String> {
    let (parts, scale) = (sample.scenario.model.parts(), sample.scenario.scale);
    let normal = |j: usize, i: usize| {
        (sample.weights[j][i] - parts.weight_mean[j]) / (scale * parts.weight_covariance[(j, j)]).sqrt()
    };
    let below = |u: f64| (u * 2f64.powi(24)).rem_euclid(1.0);
    let threshold = supremum(2) / (sample.len() as f64).sqrt() + 2f64.powi(-9); // they come in 256 steps
    let normals = || (0..sample.len()).map(|i| (normal(0, i), normal(1, i)));
    let radii: Vec<_> = normals().map(|(x, y)| below((-(x * x + y * y) / 2.0).exp())).collect();
    let angles: Vec<_> = normals().map(|(x, y)| below(y.atan2(x) / std::f64::consts::TAU)).collect();
    for (what, bits) in [("radius", radii), ("angle", angles)] {
        let distance = distance(&bits, |p| p);
        if distance > threshold {
            return Err(format!(
                "the low bits of the {what} are {distance:.3} from uniform, beyond {threshold:.3}"
            ));
        }
    }
    Ok(())
}

/// The smallest errors that the checks see in all but one of 1,000 cases.
#[derive(Debug)]
pub(crate) struct Smallest {
    /// Of the acceptance, in parts of itself.
    pub(crate) acceptance: f64,
    /// Of a mean, in standard deviations.
    pub(crate) mean: f64,
    /// Of a correlation between weights.
    pub(crate) correlation: f64,
    /// Of a Gaussian's variance, in parts of itself.
    pub(crate) variance: f64,
    /// Of a distribution function, where it is largest, against the oracle.
    pub(crate) distribution: f64,
    /// The same against the formula.
    pub(crate) gaussian: f64,
    /// Of the share of draws at an edge, in parts of itself where it is 1 %.
    pub(crate) edge: f64,
    /// Of a correlation between neighbours, streams, or indices 2^32 apart.
    pub(crate) independence: f64,
}

/// What the checks see of two samples like this one.
pub(crate) fn smallest_errors(sample: &Sample) -> Smallest {
    let (n, k) = (sample.len() as f64, sample.weights.len());
    let power = -Normal::standard().inverse_cdf(MISSED);
    let z = |comparisons| (sigmas(comparisons) + power) * (2.0 / n).sqrt();
    let d =
        |size: f64, comparisons| (supremum(comparisons) + ((2.0 / MISSED).ln() / 2.0).sqrt()) / size.sqrt();
    let pairs = k * (k + 1) / 2;
    Smallest {
        acceptance: z(1) * (1.0 - 1.0 / mean(&sample.attempts)).sqrt(),
        mean: z(sample.bands.len() + k),
        correlation: z(pairs),
        variance: z(pairs) * 2f64.sqrt(),
        distribution: d(n / 2.0, k),
        gaussian: d(n, k),
        edge: z(3) * (0.99f64 / 0.01).sqrt(),
        independence: (sigmas((k + 1) * (k + 1)) + power) / n.sqrt(),
    }
}
