//! Estimates from many draws, their distances, and confidence intervals.

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;
use serde::Serialize;

use super::engines::Values;
use crate::model::Model;
use crate::random::philox::philox;

/// Number of resamplings for a confidence interval.
const RESAMPLINGS: u32 = 1000;

/// Number of spectra that are summed side by side.
const LANES: usize = 8;

/// A value and its 95 % confidence interval.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Confidence {
    /// The value.
    pub value: f64,
    /// The lower end.
    pub low: f64,
    /// The upper end.
    pub high: f64,
}

/// Median and quartiles of repetitions.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Quartiles {
    /// Value that a quarter of them are below.
    pub low: f64,
    /// Value that half of them are below.
    pub median: f64,
    /// Value that a quarter of them are above.
    pub high: f64,
}

impl Quartiles {
    pub(super) fn of(values: &[f64]) -> Quartiles {
        let [low, median, high] = [0.25, 0.5, 0.75].map(|share| quantile(values, share));
        Quartiles { low, median, high }
    }

    /// Multiplies all three by a factor.
    pub(super) fn times(self, factor: f64) -> Quartiles {
        Quartiles { low: factor * self.low, median: factor * self.median, high: factor * self.high }
    }
}

/// Sums over draws, from which means and covariances come. Values are taken from the model's mean, so that nothing
/// cancels.
pub(super) struct Moments<'a> {
    model: &'a Model,
    pub(super) draws: u64,
    /// Candidates that they took.
    pub(super) attempts: f64,
    bands: Vec<f64>,
    squares: Vec<f64>,
    weights: Vec<f64>,
    /// Products of weights, the lower triangle row by row.
    products: Vec<f64>,
}

/// Estimates of the distribution of draws.
#[derive(Clone, Debug)]
pub(super) struct Estimate {
    pub(super) mean: DVector<f64>,
    /// Covariance of the weights, k x k.
    pub(super) covariance: DMatrix<f64>,
    pub(super) acceptance: f64,
}

impl<'a> Moments<'a> {
    pub(super) fn new(model: &'a Model) -> Moments<'a> {
        let (n, k) = (model.bands(), model.components());
        Moments {
            model,
            draws: 0,
            attempts: 0.0,
            bands: vec![0.0; n],
            squares: vec![0.0; n],
            weights: vec![0.0; k],
            products: vec![0.0; k * (k + 1) / 2],
        }
    }

    /// Adds spectra, on all cores.
    pub(super) fn add(&mut self, values: Values) {
        let n = self.bands.len();
        let parts: Vec<_> = match values {
            Values::Single(values) => values.par_chunks(1024 * n).map(|part| self.of(part)).collect(),
            Values::Double(values) => values.par_chunks(1024 * n).map(|part| self.of(part)).collect(),
        };
        parts.iter().for_each(|part| self.merge(part));
    }

    /// Sums over a part, in lanes of several spectra, each a step of vector instructions.
    fn of<T: Copy + Into<f64>>(&self, values: &[T]) -> Moments<'a> {
        type Lanes = [f64; LANES];
        let mut sums = Moments::new(self.model);
        let (n, k) = (sums.bands.len(), sums.weights.len());
        let parts = self.model.parts();
        let basis: Vec<&[f64]> = parts.basis.as_slice().chunks_exact(k).collect(); // a column, so a band, each
        let zero: Lanes = [0.0; LANES];
        let (mut bands, mut squares) = (vec![zero; n], vec![zero; n]);
        let (mut totals, mut products) = (vec![zero; k], vec![zero; k * (k + 1) / 2]);
        let (mut centred, mut weights) = (vec![zero; n], vec![zero; k]);
        for rows in values.chunks(LANES * n) {
            // Lanes without a spectrum are at the mean, and add nothing.
            if rows.len() < LANES * n {
                centred.fill(zero);
            }
            for (lane, row) in rows.chunks_exact(n).enumerate() {
                for ((c, &value), mean) in centred.iter_mut().zip(row).zip(parts.mean.as_slice()) {
                    c[lane] = value.into() - mean;
                }
            }
            weights.fill(zero);
            for (b, c) in centred.iter().enumerate() {
                for lane in 0..LANES {
                    bands[b][lane] += c[lane];
                    squares[b][lane] += c[lane] * c[lane];
                }
                for (weight, &v) in weights.iter_mut().zip(basis[b]) {
                    for lane in 0..LANES {
                        weight[lane] += v * c[lane];
                    }
                }
            }
            let mut product = products.iter_mut();
            for i in 0..k {
                for (other, product) in weights[..=i].iter().zip(&mut product) {
                    for lane in 0..LANES {
                        product[lane] += weights[i][lane] * other[lane];
                    }
                }
                for lane in 0..LANES {
                    totals[i][lane] += weights[i][lane];
                }
            }
        }
        let total = |lanes: &[Lanes]| lanes.iter().map(|lane| lane.iter().sum()).collect::<Vec<f64>>();
        sums.bands = total(&bands);
        sums.squares = total(&squares);
        sums.weights = total(&totals);
        sums.products = total(&products);
        sums.draws = (values.len() / n) as u64;
        sums
    }

    /// These sums, corrected by how far the `exact` draws of some words are from the `rough` ones of the same words: the
    /// expectation is that of exact draws, at the cost of rough ones.
    pub(super) fn corrected(&self, exact: &Moments, rough: &Moments) -> Moments<'a> {
        assert_eq!(exact.draws, rough.draws, "the words are the same");
        let share = self.draws as f64 / exact.draws as f64;
        let corrected = |sums: &[f64], exact: &[f64], rough: &[f64]| {
            let pairs = exact.iter().zip(rough);
            sums.iter().zip(pairs).map(|(sum, (a, b))| sum + share * (a - b)).collect()
        };
        Moments {
            model: self.model,
            draws: self.draws,
            attempts: self.attempts + share * (exact.attempts - rough.attempts),
            bands: corrected(&self.bands, &exact.bands, &rough.bands),
            squares: corrected(&self.squares, &exact.squares, &rough.squares),
            weights: corrected(&self.weights, &exact.weights, &rough.weights),
            products: corrected(&self.products, &exact.products, &rough.products),
        }
    }

    pub(super) fn merge(&mut self, other: &Moments) {
        let add = |a: &mut [f64], b: &[f64]| a.iter_mut().zip(b).for_each(|(a, b)| *a += b);
        add(&mut self.bands, &other.bands);
        add(&mut self.squares, &other.squares);
        add(&mut self.weights, &other.weights);
        add(&mut self.products, &other.products);
        self.draws += other.draws;
        self.attempts += other.attempts;
    }

    pub(super) fn estimate(&self) -> Estimate {
        let n = self.draws as f64;
        let k = self.weights.len();
        let product = |i: usize, j: usize| self.products[i * (i + 1) / 2 + j] / n;
        let covariance = DMatrix::from_fn(k, k, |i, j| {
            product(i.max(j), i.min(j)) - self.weights[i] * self.weights[j] / n / n
        });
        Estimate {
            mean: &self.model.parts().mean + DVector::from_column_slice(&self.bands) / n,
            covariance,
            acceptance: n / self.attempts,
        }
    }

    /// Root of the mean variance of a band.
    pub(super) fn deviation(&self) -> f64 {
        let n = self.draws as f64;
        let variances = self.bands.iter().zip(&self.squares).map(|(s, q)| q / n - (s / n).powi(2));
        (variances.sum::<f64>() / self.bands.len() as f64).sqrt()
    }
}

impl Estimate {
    /// Distances from another estimate: of the mean spectrum the root mean square over bands, of the covariance the
    /// Frobenius norm relative to the other's, and of the acceptance the difference.
    pub(super) fn errors(&self, other: &Estimate) -> [f64; 3] {
        [
            (&self.mean - &other.mean).norm() / (self.mean.len() as f64).sqrt(),
            (&self.covariance - &other.covariance).norm() / other.covariance.norm(),
            (self.acceptance - other.acceptance).abs(),
        ]
    }
}

pub(super) fn root_mean_square(values: &[f64]) -> f64 {
    (values.iter().map(|v| v * v).sum::<f64>() / values.len() as f64).sqrt()
}

pub(super) fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Smallest value that a share of all do not exceed.
pub(super) fn quantile(values: &[f64], share: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_unstable_by(f64::total_cmp);
    sorted[((sorted.len() as f64 * share) as usize).min(sorted.len() - 1)]
}

/// Computes a statistic of replicates with its 95 % confidence interval: percentiles over resamplings of the
/// replicates (the bootstrap). `statistic` receives, for each of several lists, which of its `lengths` replicates to
/// take.
pub(super) fn bootstrap(lengths: &[usize], statistic: impl Fn(&[Vec<usize>]) -> f64) -> Confidence {
    let plain: Vec<Vec<usize>> = lengths.iter().map(|&n| (0..n).collect()).collect();
    let resampled: Vec<f64> = (0..RESAMPLINGS)
        .map(|round| {
            let pick = |list: usize, i: usize, n: usize| {
                let [word, ..] = philox([i as u32, list as u32, round, 0], [0xB007, 0x57A9]);
                ((u64::from(word) * n as u64) >> 32) as usize
            };
            let picks = |(list, &n): (usize, &usize)| (0..n).map(|i| pick(list, i, n)).collect();
            statistic(&lengths.iter().enumerate().map(picks).collect::<Vec<_>>())
        })
        .collect();
    Confidence {
        value: statistic(&plain),
        low: quantile(&resampled, 0.025),
        high: quantile(&resampled, 0.975),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn moments_are_those_of_the_formulas() {
        let model = Model::builtin("granada").unwrap();
        let spectra: Vec<Vec<f64>> = (0..3000)
            .map(|i| model.reconstruct(&[0, 1, 2, 3, 4, 5].map(|j| ((i * (j + 1)) as f64).sin())))
            .map(|s| s.as_slice().to_vec())
            .collect();
        let mut moments = Moments::new(&model);
        moments.add(Values::Double(&spectra.concat()));
        moments.attempts = 6000.0;
        let estimate = moments.estimate();
        let mean = |f: &dyn Fn(usize) -> f64| (0..3000).map(f).sum::<f64>() / 3000.0;
        let weight = |i: usize, j: usize| ((i * (j + 1)) as f64).sin();
        let (m1, m2) = (mean(&|i| weight(i, 1)), mean(&|i| weight(i, 2)));
        let expected = mean(&|i| weight(i, 1) * weight(i, 2)) - m1 * m2;
        assert!((estimate.covariance[(1, 2)] - expected).abs() < 1e-12);
        assert!((estimate.mean[7] - mean(&|i| spectra[i][7])).abs() < 1e-12);
        assert_eq!((estimate.acceptance, estimate.errors(&estimate)), (0.5, [0.0; 3]));
    }

    /// Draws that are a little off, and a correction from a tenth of them.
    #[test]
    fn corrected_sums_have_the_expectation_of_exact_draws() {
        let model = Model::builtin("granada").unwrap();
        let spectrum = |i: usize, off: f64| {
            let weights = [0, 1, 2, 3, 4, 5].map(|j| ((i * (j + 1)) as f64).sin() + off);
            model.reconstruct(&weights).as_slice().to_vec()
        };
        let sums = |range: std::ops::Range<usize>, off: f64, attempts: f64| {
            let mut moments = Moments::new(&model);
            let attempts = attempts * range.len() as f64;
            moments.add(Values::Double(&range.map(|i| spectrum(i, off)).collect::<Vec<_>>().concat()));
            Moments { attempts, ..moments }
        };
        let (rough, exact) = (sums(0..2003, 0.01, 1.5), sums(0..2003, 0.0, 1.6));
        let corrected = rough.corrected(&sums(5000..5200, 0.0, 1.6), &sums(5000..5200, 0.01, 1.5));
        let apart = |a: &Moments| a.estimate().errors(&exact.estimate());
        assert!(apart(&rough)[0] > 1e-3 && apart(&corrected)[0] < 1e-12, "{:?}", apart(&corrected));
        assert!(apart(&rough)[2] > 0.04 && apart(&corrected)[2] < 1e-12, "{:?}", apart(&corrected));
    }

    #[test]
    fn an_interval_covers_its_value() {
        let values: Vec<f64> = (0..20).map(f64::from).collect();
        let interval = bootstrap(&[20], |picks| picks[0].iter().map(|&i| values[i]).sum::<f64>() / 20.0);
        assert_eq!(interval.value, 9.5);
        // A mean of 20 of deviation 5.77 has the standard error 1.29.
        assert!((interval.low - (9.5 - 2.53)).abs() < 0.4 && (interval.high - (9.5 + 2.53)).abs() < 0.4);
    }
}
