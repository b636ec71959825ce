//! A few normal distributions that make data most likely, by expectation maximisation (Dempster, Laird & Rubin 1977).

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::Rng;

use crate::random::stream::Stream;
use crate::threads;

/// A normal distribution among several.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Normal {
    pub(crate) share: f64,
    pub(crate) mean: DVector<f64>,
    pub(crate) covariance: DMatrix<f64>,
}

/// Addition to each variance, which is 1 of all data, so that no distribution falls onto a point or a plane.
const FLOOR: f64 = 1e-4;

/// The most rounds, and the gain in the mean log likelihood below which they end.
const ROUNDS: usize = 500;
const NEGLIGIBLE: f64 = 1e-7;

/// Number of starts, of which the most likely result is taken.
const STARTS: u64 = 4;

/// `count` normal distributions of data, each with its share; `coordinates` has k of each spectrum. Fewer where some
/// would have none. The seed of their starts is fixed: the same data have the same ones.
pub(crate) fn normals(coordinates: &[f64], components: usize, count: usize) -> Vec<Normal> {
    let data: Vec<DVector<f64>> =
        coordinates.chunks_exact(components).map(DVector::from_column_slice).collect();
    let starts = threads::map(STARTS, 1, |seed| from_start(&data, count, seed));
    let best = starts.into_iter().max_by(|a, b| a.1.total_cmp(&b.1)).expect("there are starts");
    best.0
}

/// The distributions that one start leads to, and the mean log likelihood of the data.
fn from_start(data: &[DVector<f64>], count: usize, seed: u64) -> (Vec<Normal>, f64) {
    let mut likely = f64::NEG_INFINITY;
    let mut normals = of_shares(data, &nearest(data, &seeds(data, count, seed)));
    for _ in 0..ROUNDS {
        let (shares, log) = shares(data, &normals);
        normals = of_shares(data, &shares);
        if log - likely < NEGLIGIBLE {
            return (normals, log);
        }
        likely = log;
    }
    (normals, likely)
}

/// Points among the data, each chosen by the square of its distance to the nearest that was chosen before (k-means++,
/// Arthur & Vassilvitskii 2007).
fn seeds(data: &[DVector<f64>], count: usize, seed: u64) -> Vec<DVector<f64>> {
    let mut words = Stream::named(seed, "mixture").rng();
    let mut uniform = || (f64::from(words.next_u32()) + 0.5) * 2f64.powi(-32);
    let mut chosen = vec![data[(uniform() * data.len() as f64) as usize].clone()];
    let mut distances = vec![f64::INFINITY; data.len()];
    while chosen.len() < count {
        let last = chosen.last().expect("one was chosen");
        distances.iter_mut().zip(data).for_each(|(d, x)| *d = d.min((x - last).norm_squared()));
        let mut left = uniform() * distances.iter().sum::<f64>();
        let next = distances.iter().position(|distance| {
            left -= distance;
            left <= 0.0
        });
        chosen.push(data[next.unwrap_or(data.len() - 1)].clone());
    }
    chosen
}

/// Shares of each datum in each point: all in the nearest.
fn nearest(data: &[DVector<f64>], points: &[DVector<f64>]) -> Vec<Vec<f64>> {
    let of = |x: &DVector<f64>| {
        let distance = |g: &usize| (x - &points[*g]).norm_squared();
        let nearest = (0..points.len()).min_by(|a, b| distance(a).total_cmp(&distance(b)));
        (0..points.len()).map(|g| f64::from(u8::from(Some(g) == nearest))).collect()
    };
    data.iter().map(of).collect()
}

/// The distributions of data that are shared out among them.
fn of_shares(data: &[DVector<f64>], shares: &[Vec<f64>]) -> Vec<Normal> {
    let k = data[0].len();
    let of = |g: usize| {
        let total: f64 = shares.iter().map(|shares| shares[g]).sum();
        if total < 1e-9 * data.len() as f64 {
            return None;
        }
        let mut mean = DVector::zeros(k);
        data.iter().zip(shares).for_each(|(x, shares)| mean.axpy(shares[g] / total, x, 1.0));
        let mut covariance = DMatrix::from_diagonal_element(k, k, FLOOR);
        for (x, shares) in data.iter().zip(shares) {
            let from_mean = x - &mean;
            covariance.ger(shares[g] / total, &from_mean, &from_mean, 1.0);
        }
        Some(Normal { share: total / data.len() as f64, mean, covariance })
    };
    (0..shares[0].len()).filter_map(of).collect()
}

/// Shares of each datum in each distribution, and the mean log likelihood of the data.
fn shares(data: &[DVector<f64>], normals: &[Normal]) -> (Vec<Vec<f64>>, f64) {
    let factors: Vec<_> = normals
        .iter()
        .map(|normal| {
            let factor = Cholesky::new(normal.covariance.clone()).expect("variances have a floor").unpack();
            let log_size: f64 = factor.diagonal().iter().map(|d| d.ln()).sum();
            (normal, factor, normal.share.ln() - log_size)
        })
        .collect();
    let mut sum = 0.0;
    let shares = data.iter().map(|x| {
        let logs = factors.iter().map(|(normal, factor, log)| {
            let scaled = factor.solve_lower_triangular(&(x - &normal.mean)).expect("variances have a floor");
            log - scaled.norm_squared() / 2.0
        });
        let logs: Vec<f64> = logs.collect();
        let largest = logs.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        let total: f64 = logs.iter().map(|log| (log - largest).exp()).sum();
        sum += largest + total.ln();
        logs.into_iter().map(|log| (log - largest).exp() / total).collect()
    });
    let shares = shares.collect();
    (shares, sum / data.len() as f64)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::real::Real;

    /// Two clusters of known means, widths and shares are found again.
    #[test]
    fn two_clusters_are_found() {
        let stream = Stream::named(3, "clusters");
        let data: Vec<f64> = (0..3000)
            .flat_map(|i| {
                let words = stream.block(i, 0, 0);
                let [x, y] = f64::normal_pair(words[0], words[1]);
                if i % 3 == 0 {
                    [2.0 + 0.2 * x, -1.0 + 0.1 * y]
                } else {
                    [-1.0 + 0.5 * x, 0.5 + 0.25 * x + 0.1 * y]
                }
            })
            .collect();
        let mut found = normals(&data, 2, 2);
        found.sort_by(|a, b| a.share.total_cmp(&b.share));
        let [narrow, wide] = &found[..] else { panic!("{found:?}") };
        assert!((narrow.share - 1.0 / 3.0).abs() < 0.005 && (wide.share - 2.0 / 3.0).abs() < 0.005);
        let near = |found: f64, expected: f64| assert!((found - expected).abs() < 0.03, "{found} {expected}");
        near(narrow.mean[0], 2.0);
        near(narrow.mean[1], -1.0);
        near(narrow.covariance[(0, 0)].sqrt(), 0.2);
        near(wide.mean[0], -1.0);
        near(wide.covariance[(0, 0)].sqrt(), 0.5);
        near(wide.covariance[(0, 1)], 0.125);
        assert_eq!(normals(&data, 2, 2).len(), 2);
    }

    /// Of tight clusters that are far apart each has a seed: a point has none beside it but by a chance of 1e-10.
    #[test]
    fn seeds_are_far_from_each_other() {
        let data: Vec<_> =
            (0..90).map(|i| DVector::from_element(1, f64::from(i % 3) + 1e-6 * f64::from(i))).collect();
        for seed in 0..20 {
            let mut clusters: Vec<_> = seeds(&data, 3, seed).iter().map(|point| point[0].floor()).collect();
            clusters.sort_by(f64::total_cmp);
            assert_eq!(clusters, [0.0, 1.0, 2.0]);
        }
    }

    /// As many as there are data, and repeated data: variances keep their floor, and shares sum to 1.
    #[test]
    fn few_and_repeated_data_have_distributions() {
        for (data, count) in [(vec![0.0, 1.0, 2.0], 3), (vec![1.0; 6], 2), (vec![-1.0, -1.0, 1.0, 1.0], 4)] {
            let found = normals(&data, 1, count);
            assert!((found.iter().map(|normal| normal.share).sum::<f64>() - 1.0).abs() < 1e-9, "{found:?}");
            assert!(found.iter().all(|normal| normal.covariance[(0, 0)] >= FLOOR), "{found:?}");
        }
    }
}
