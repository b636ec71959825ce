//! Tests of the generator alone: its normals must be normal, and independent of each other across draws, attempts,
//! streams and seeds.
//!
//! Every comparison is of one normal of a candidate, over many draws. Together their p-values must be uniform, which
//! says more than that none of them is small.

use rayon::prelude::*;
use statrs::distribution::{ChiSquared, ContinuousCDF, Normal};

use super::checks::{correlation, distance, kolmogorov, two_sided};
use crate::random::real::Real;
use crate::random::stream::Stream;

/// Number of cells of equal probability in a chi-squared test.
const CELLS: usize = 256;

/// Comparisons of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Group {
    /// Name of the comparison.
    pub name: &'static str,
    /// Probability that sound normals differ by as much, for each comparison.
    pub p_values: Vec<f64>,
}

/// Returns the first `components` normals of an attempt of `count` draws from index `first` on, in f32: a series for
/// each.
pub fn normals(stream: Stream, components: usize, first: u64, attempt: u32, count: u64) -> Vec<Vec<f64>> {
    let series = |j: usize| {
        let normal = |i: u64| {
            let words = stream.block(first.wrapping_add(i), attempt, (j / 4) as u32);
            let [x, y] = [words[j % 4 / 2 * 2], words[j % 4 / 2 * 2 + 1]];
            f64::from(f32::normal_pair(x, y)[j % 2])
        };
        (0..count).map(normal).collect()
    };
    (0..components).into_par_iter().map(series).collect()
}

/// Compares the first `components` normals of `count` draws of a seed.
pub fn uniformity(seed: u64, components: usize, count: u64) -> Vec<Group> {
    let make = |stream, first, attempt| normals(stream, components, first, attempt, count);
    let stream = Stream::named(seed, "generator");
    let z = make(stream, 0, 0);
    let normal = Normal::standard();
    let each = |test: &(dyn Fn(&[f64]) -> f64 + Sync)| z.par_iter().map(|z| test(z)).collect();
    let against = |other: Vec<Vec<f64>>| z.iter().zip(&other).map(|(a, b)| uncorrelated(a, b)).collect();
    let between = (0..components).flat_map(|i| (0..i).map(move |j| (i, j)));
    let squared = |z: &Vec<f64>| z.iter().map(|z| z * z).collect::<Vec<_>>();
    let group = |name, p_values| Group { name, p_values };
    vec![
        group(
            "distribution of each normal (Kolmogorov-Smirnov)",
            each(&|z| kolmogorov((z.len() as f64).sqrt() * distance(z, |z| normal.cdf(z)))),
        ),
        group(
            "each normal in 256 cells of equal probability (chi-squared)",
            each(&|z| chi_squared(z.iter().map(|&z| cell(normal.cdf(z), CELLS)), CELLS)),
        ),
        group(
            "each normal and its successor in 16 x 16 cells (chi-squared)",
            each(&|z| {
                let cell = |z: f64| cell(normal.cdf(z), 16);
                chi_squared(z.as_chunks::<2>().0.iter().map(|&[a, b]| 16 * cell(a) + cell(b)), 256)
            }),
        ),
        group("correlation of two normals", between.map(|(i, j)| uncorrelated(&z[i], &z[j])).collect()),
        group(
            "correlation of two squared normals",
            (1..components).map(|j| uncorrelated(&squared(&z[j]), &squared(&z[j - 1]))).collect(),
        ),
        group("correlation with the next draw", against(make(stream, 1, 0))),
        group("correlation with the draw 2^32 on", against(make(stream, 1 << 32, 0))),
        group("correlation with the next attempt", against(make(stream, 0, 1))),
        group("correlation with another stream", against(make(Stream::named(seed, "another"), 0, 0))),
        group("correlation with the next seed", {
            against(make(Stream::named(seed.wrapping_add(1), "generator"), 0, 0))
        }),
    ]
}

/// The cell of `cells` equal ones that a probability falls into.
fn cell(p: f64, cells: usize) -> usize {
    ((p * cells as f64) as usize).min(cells - 1)
}

/// The p-value of Pearson's test of equally likely cells.
fn chi_squared(values: impl Iterator<Item = usize>, cells: usize) -> f64 {
    let mut counts = vec![0u64; cells];
    values.for_each(|cell| counts[cell] += 1);
    let expected = counts.iter().sum::<u64>() as f64 / cells as f64;
    let statistic: f64 = counts.iter().map(|&c| (c as f64 - expected).powi(2) / expected).sum();
    ChiSquared::new(cells as f64 - 1.0).expect("there are cells").sf(statistic)
}

/// The p-value of a correlation.
fn uncorrelated(x: &[f64], y: &[f64]) -> f64 {
    two_sided(correlation(x, y) * (x.len() as f64).sqrt())
}

/// p-value of the p-values, which are uniform where all is sound.
pub fn of_all(p_values: &[f64]) -> f64 {
    kolmogorov((p_values.len() as f64).sqrt() * distance(p_values, |p| p))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sound_normals_have_uniform_p_values_and_others_have_not() {
        let groups = uniformity(1, 6, 1 << 14);
        let all: Vec<f64> = groups.iter().flat_map(|group| group.p_values.clone()).collect();
        assert!(of_all(&all) > 1e-4 && all.iter().all(|&p| p > 1e-6), "{groups:#?}");
        assert!(of_all(&all.iter().map(|p| p * p).collect::<Vec<_>>()) < 1e-6);
        let uniform: Vec<_> = (0..1 << 14).map(|i| i % CELLS).collect();
        assert!(chi_squared(uniform.iter().map(|&c| c / 2 * 2), CELLS) < 1e-9);
        assert!(uncorrelated(&[1.0, 2.0, 3.0, 4.0].repeat(20), &[1.0, 2.0, 3.0, 5.0].repeat(20)) < 1e-9);
    }
}
