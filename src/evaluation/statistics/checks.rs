//! Checks: each compares a sample with a reference, and gives the probability that sound draws differ as much.

use serde::Serialize;
use statrs::distribution::{ContinuousCDF, Normal};
use statrs::function::erf::erfc;

use super::Finding;
use super::sample::Sample;

/// Probability that sound draws fail any of [`RUNS`] checks.
pub const FALSE_ALARMS: f64 = 1e-6;

/// Largest number of checks that are run on sound draws; the tests count theirs.
pub const RUNS: usize = 220;

/// Probability of missing an error as large as [`smallest_errors`] says.
pub const MISSED: f64 = 1e-3;

/// Distance from a bound below which a band is at the edge.
pub const EDGE: f64 = 1e-3;

/// Check of a sample against a reference.
#[derive(Clone, Copy, Debug)]
pub struct Check {
    /// Name of the check.
    pub name: &'static str,
    /// Reference that it needs.
    pub against: Against,
    /// Values that it compares, in words.
    pub compares: &'static str,
    find: fn(&Sample, &Sample) -> Finding,
}

impl Check {
    /// Compares a sample with a reference.
    pub fn run(&self, sample: &Sample, reference: &Sample) -> Finding {
        (self.find)(sample, reference)
    }

    /// Returns the check of this name.
    pub fn named(name: &str) -> &'static Check {
        let all = CHECKS.iter().chain([&GAUSSIAN, &LOW_BITS]);
        all.into_iter().find(|check| check.name == name).expect("there is a check of that name")
    }
}

/// Kind of reference.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Against {
    /// The oracle's sample.
    Oracle,
    /// Another stream of the same sampler.
    OtherStream,
    /// The stream of the sample, 2^32 draws on.
    FarIndex,
    /// The library's f64 draws of the same indices.
    Library,
}

const fn check(
    name: &'static str,
    against: Against,
    compares: &'static str,
    find: fn(&Sample, &Sample) -> Finding,
) -> Check {
    Check { name, against, compares, find }
}

/// Checks that suit every scenario.
pub static CHECKS: [Check; 10] = [
    check("acceptance", Against::Oracle, "the share of candidates that are accepted", acceptance),
    check("means", Against::Oracle, "the mean of every band and weight", means),
    check("covariance", Against::Oracle, "the covariance of every two weights", covariance),
    check(
        "distribution",
        Against::Oracle,
        "the distribution of every weight (Kolmogorov-Smirnov)",
        distribution,
    ),
    check("edges", Against::Oracle, "the share of draws within 1e-3 of a bound, or above 1", edges),
    check("physical", Against::Oracle, "every value with its bounds", physical),
    check("neighbours", Against::Oracle, "the correlation of draws that follow each other", neighbours),
    check("streams", Against::OtherStream, "the correlation of two streams", independence),
    check("far indices", Against::FarIndex, "the correlation of draws 2^32 indices apart", independence),
    check(
        "known draws",
        Against::Library,
        "draws one by one with the f64 ones of the same words",
        known_draws,
    ),
];

/// Check for scenarios that reject nothing, whose weights have a formula.
pub static GAUSSIAN: Check =
    check("gaussian", Against::Oracle, "the distribution of every weight with its Gaussian", gaussian);

/// Check for draws in f64 of a model with a diagonal covariance; f32 has no such bits in its results.
pub static LOW_BITS: Check = check(
    "low bits",
    Against::Oracle,
    "the bits of uniforms below the 24th, won back from weights",
    low_bits,
);

/// Number of standard errors that one of several comparisons may be off.
pub fn sigmas(comparisons: usize) -> f64 {
    -Normal::standard().inverse_cdf(FALSE_ALARMS / RUNS as f64 / comparisons as f64 / 2.0)
}

/// Largest accepted distance of two distribution functions, times the root of the effective size, by the inequality
/// of Dvoretzky, Kiefer & Wolfowitz with Massart's constant (for two samples of equal size: Wei & Dudley 2012).
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

/// The probability that a standard normal is farther from 0 than `z`.
pub(super) fn two_sided(z: f64) -> f64 {
    erfc(z.abs() / std::f64::consts::SQRT_2)
}

/// Probability that an empirical distribution of effective size n is `distance` or more from the true one, by
/// Kolmogorov's limit: `root` is sqrt(n) times the distance.
pub(in crate::evaluation) fn kolmogorov(root: f64) -> f64 {
    if root < 0.2 {
        return 1.0; // to 1e-12; the series would need many terms
    }
    let term = |i: i32| (if i % 2 == 1 { 2.0 } else { -2.0 }) * (-2.0 * (f64::from(i) * root).powi(2)).exp();
    (1..=40).map(term).sum::<f64>().clamp(0.0, 1.0)
}

impl Finding {
    /// Compares two estimates, each with its variance.
    fn agree(&mut self, what: &str, (a, va): (f64, f64), (b, vb): (f64, f64)) {
        let error = (va + vb).sqrt();
        if error == 0.0 {
            // No chance is involved where nothing varies.
            if a != b {
                self.fault.get_or_insert_with(|| format!("{what}: {a:.6} against {b:.6}"));
            }
            return;
        }
        let z = (a - b).abs() / error;
        self.compare(two_sided(z), || format!("{what}: {a:.6} against {b:.6}, {z:.1} standard errors apart"));
    }
}

/// Compares the shares of candidates that are accepted.
fn acceptance(sample: &Sample, reference: &Sample) -> Finding {
    let mut finding = Finding::default();
    let share = |s: &Sample| {
        // The delta method. Where each of several normal distributions has its own acceptance, the number of attempts is
        // not geometric.
        let (attempts, variance) = estimate(&s.attempts);
        (1.0 / attempts, variance / attempts.powi(4))
    };
    finding.agree("acceptance", share(sample), share(reference));
    finding
}

/// Compares the mean of every band and of every weight.
fn means(sample: &Sample, reference: &Sample) -> Finding {
    let mut finding = Finding::default();
    for (what, a, b) in
        [("band", &sample.bands, &reference.bands), ("weight", &sample.weights, &reference.weights)]
    {
        for (i, (a, b)) in a.iter().zip(b).enumerate() {
            finding.agree(&format!("the mean of {what} {i}"), estimate(a), estimate(b));
        }
    }
    finding
}

/// Compares the covariance of every two weights, and the variance of each.
fn covariance(sample: &Sample, reference: &Sample) -> Finding {
    let mut finding = Finding::default();
    let k = sample.weights.len();
    let products = |s: &Sample, i: usize, j: usize| {
        let (a, b) = (&s.weights[i], &s.weights[j]);
        let (ma, mb) = (mean(a), mean(b));
        estimate(&a.iter().zip(b).map(|(x, y)| (x - ma) * (y - mb)).collect::<Vec<_>>())
    };
    for (i, j) in (0..k).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        let what = format!("the covariance of weights {i} and {j}");
        finding.agree(&what, products(sample, i, j), products(reference, i, j));
    }
    finding
}

fn sorted(x: &[f64]) -> Vec<f64> {
    let mut x = x.to_vec();
    x.sort_unstable_by(f64::total_cmp);
    x
}

/// Compares the distribution of every weight (two-sample Kolmogorov-Smirnov).
fn distribution(sample: &Sample, reference: &Sample) -> Finding {
    let mut finding = Finding::default();
    let (n, m) = (sample.len(), reference.len());
    let root = (n as f64 * m as f64 / (n + m) as f64).sqrt();
    for (j, (a, b)) in sample.weights.iter().zip(&reference.weights).enumerate() {
        let distance = two_sample_distance(a, b);
        finding.compare(kolmogorov(root * distance), || {
            format!("weight {j}: distributions are {distance:.4} apart")
        });
    }
    finding
}

/// Largest distance of the distribution functions of two samples.
pub(in crate::evaluation) fn two_sample_distance(a: &[f64], b: &[f64]) -> f64 {
    let (a, b) = (sorted(a), sorted(b));
    let (mut i, mut j, mut distance) = (0, 0, 0f64);
    while i < a.len() && j < b.len() {
        // Both functions step at a value that both samples have: they are compared after it.
        let value = a[i].min(b[j]);
        i += a[i..].iter().take_while(|&&v| v == value).count();
        j += b[j..].iter().take_while(|&&v| v == value).count();
        distance = distance.max((i as f64 / a.len() as f64 - j as f64 / b.len() as f64).abs());
    }
    distance
}

/// The distance of a sample from a distribution function.
pub(super) fn distance(x: &[f64], cdf: impl Fn(f64) -> f64) -> f64 {
    let n = x.len() as f64;
    let gaps = sorted(x).into_iter().map(cdf).enumerate();
    gaps.fold(0.0, |d: f64, (i, p)| d.max(p - i as f64 / n).max((i + 1) as f64 / n - p))
}

/// Compares the distribution of every weight with the Gaussian that it has where nothing is rejected.
fn gaussian(sample: &Sample, _: &Sample) -> Finding {
    let mut finding = Finding::default();
    let (parts, scale) = (sample.scenario.model.parts(), sample.scenario.scale);
    for (j, weights) in sample.weights.iter().enumerate() {
        let deviation = (scale * parts.weight_covariance[(j, j)]).sqrt();
        let normal = Normal::new(parts.weight_mean[j], deviation).expect("a deviation is positive");
        let distance = distance(weights, |w| normal.cdf(w));
        finding.compare(kolmogorov((sample.len() as f64).sqrt() * distance), || {
            format!("weight {j}: {distance:.4} from its Gaussian")
        });
    }
    finding
}

/// Compares the shares of draws that come close to 0, that come close to 1, and that reach 1.
fn edges(sample: &Sample, reference: &Sample) -> Finding {
    let mut finding = Finding::default();
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
    for (what, (a, b)) in
        ["near 0", "near 1", "above 1"].iter().zip(shares(sample).into_iter().zip(shares(reference)))
    {
        let pooled = (n * a + m * b) / (n + m);
        let variance = |size: f64| pooled * (1.0 - pooled) / size;
        finding.agree(&format!("the share of draws {what}"), (a, variance(n)), (b, variance(m)));
    }
    finding
}

/// Checks that every value is above 0 and below its limit. No chance is involved.
fn physical(sample: &Sample, _: &Sample) -> Finding {
    let limit = sample.scenario.limit();
    let wrong = sample.bands.iter().flatten().find(|&&s| !(s > 0.0 && s < limit));
    Finding { fault: wrong.map(|value| format!("a value of {value}")), ..Finding::default() }
}

/// Checks that two groups of series of equal length are uncorrelated.
fn uncorrelated(what: &str, a: &[&[f64]], b: &[&[f64]]) -> Finding {
    let mut finding = Finding::default();
    for (i, x) in a.iter().enumerate() {
        for (j, y) in b.iter().enumerate() {
            let r = correlation(x, y);
            let p = two_sided(r * (x.len() as f64).sqrt());
            finding.compare(p, || format!("{what}: series {i} and {j} correlate by {r:.4}"));
        }
    }
    finding
}

/// Correlation of two series that vary.
pub(super) fn correlation(x: &[f64], y: &[f64]) -> f64 {
    let ((mx, vx), (my, vy)) = (estimate(x), estimate(y));
    let product = x.iter().zip(y).map(|(x, y)| (x - mx) * (y - my)).sum::<f64>();
    let n = x.len() as f64;
    product / (n * n * (vx * vy).sqrt())
}

/// Series of the weights and of the attempts, where those vary.
fn series<'a>(sample: &'a Sample) -> Vec<&'a [f64]> {
    let varies = |x: &&'a [f64]| x.iter().any(|v| *v != x[0]);
    sample.weights.iter().map(Vec::as_slice).chain([sample.attempts.as_slice()]).filter(varies).collect()
}

/// Checks the correlation between consecutive draws.
fn neighbours(sample: &Sample, _: &Sample) -> Finding {
    let all = series(sample);
    let first: Vec<_> = all.iter().map(|x| &x[..x.len() - 1]).collect();
    let next: Vec<_> = all.iter().map(|x| &x[1..]).collect();
    uncorrelated("neighbours", &first, &next)
}

/// Checks the correlation between two samples, draw by draw.
fn independence(sample: &Sample, other: &Sample) -> Finding {
    uncorrelated("two samples", &series(sample), &series(other))
}

/// Checks that the first draws are those of the library in f64: as many as the reference has. No chance is involved.
fn known_draws(sample: &Sample, library: &Sample) -> Finding {
    let mut flips = 0;
    let fault = (0..library.len()).find_map(|i| {
        if sample.attempts[i] != library.attempts[i] {
            flips += 1;
            return None;
        }
        let values = sample.bands.iter().zip(&library.bands).map(|(a, b)| (a[i], b[i]));
        let (a, b) = values.into_iter().find(|(a, b)| (a - b).abs() > 1e-4)?;
        Some(format!("draw {i}: {a} where the library has {b}"))
    });
    // f32 may flip a draw, but hardly ever.
    let flipped = (flips > 1).then(|| format!("{flips} draws took another candidate than the library's"));
    Finding { fault: fault.or(flipped), ..Finding::default() }
}

/// Checks that uniforms have random bits below the 24th: those of a radius and of an angle, recovered from the first
/// two weights.
fn low_bits(sample: &Sample, _: &Sample) -> Finding {
    let mut finding = Finding::default();
    let (parts, scale) = (sample.scenario.model.parts(), sample.scenario.scale);
    let normal = |j: usize, i: usize| {
        (sample.weights[j][i] - parts.weight_mean[j]) / (scale * parts.weight_covariance[(j, j)]).sqrt()
    };
    let below = |u: f64| (u * 2f64.powi(24)).rem_euclid(1.0);
    let normals = || (0..sample.len()).map(|i| (normal(0, i), normal(1, i)));
    let radii: Vec<_> = normals().map(|(x, y)| below((-(x * x + y * y) / 2.0).exp())).collect();
    let angles: Vec<_> = normals().map(|(x, y)| below(y.atan2(x) / std::f64::consts::TAU)).collect();
    for (what, bits) in [("radius", radii), ("angle", angles)] {
        let distance = (distance(&bits, |p| p) - 2f64.powi(-9)).max(0.0); // they come in 256 steps
        finding.compare(kolmogorov((sample.len() as f64).sqrt() * distance), || {
            format!("the low bits of the {what} are {distance:.3} from uniform")
        });
    }
    finding
}

/// Smallest errors that the checks see in all but one of 1,000 cases.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Smallest {
    /// Error of the acceptance, relative to it.
    pub acceptance: f64,
    /// Error of a mean, in standard deviations.
    pub mean: f64,
    /// Error of a correlation between weights.
    pub correlation: f64,
    /// Error of a Gaussian's variance, relative to it.
    pub variance: f64,
    /// Error of a distribution function, where it is largest, against the oracle.
    pub distribution: f64,
    /// Error of a distribution function, where it is largest, against the formula.
    pub gaussian: f64,
    /// Error of the share of draws at an edge, relative to it, where it is 1 %.
    pub edge: f64,
    /// Correlation between neighbours, streams, or indices 2^32 apart.
    pub independence: f64,
}

/// Computes the smallest errors that the checks see in samples like this one.
pub fn smallest_errors(sample: &Sample) -> Smallest {
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

#[cfg(test)]
mod tests;
