//! Distribution of a model's weights: the Gaussian of the appendix, or others that keep to the shape of the data.

use std::fmt;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

use super::{Model, ModelError, are_finite, check_covariance, has_shape, is_diagonal, matrix, rows};
use crate::cover::{HalfSpace, physical};
use crate::dataset::SpectrumKind;
use crate::mixture::{Centres, MOST_CENTRES, Spread, triangle};
use crate::wording::counted;

/// Distribution of a model's weights before what is not physical is rejected.
///
/// Rejection takes draws of a Gaussian away from the data, since it reaches far beyond what is physical. The others keep
/// to the data, and each of their normal distributions is chosen as much more often as more of it is rejected, so that it
/// has its share of what is drawn.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum Distribution {
    /// One normal distribution with the weights' mean and covariance (Singh et al. 2018, eq. 4).
    #[default]
    Gaussian,
    /// A normal distribution about each measured spectrum's weights w, in equal shares: `m + a (w - m) + h L z`, with the
    /// weights' mean m, the factor L of their covariance, the bandwidth h, and `a = sqrt(1 - h^2)`, which keeps mean and
    /// covariance those of the data (the smoothed bootstrap with shrinkage; Silverman & Young 1987). At a bandwidth of 1 it
    /// is the Gaussian, at 0 the draws are the measured spectra.
    Kernel {
        /// h, from 0 to 1.
        bandwidth: f64,
        /// The weights of the measured spectra, M rows of k.
        weights: DMatrix<f64>,
    },
    /// A few normal distributions, each with a mean and a covariance of its own.
    Mixture(Vec<MixtureComponent>),
}

/// A normal distribution among those of a [`Distribution::Mixture`].
#[derive(Clone, Debug, PartialEq)]
pub struct MixtureComponent {
    /// The share of the draws that are its, above 0. Shares need not sum to 1.
    pub share: f64,
    /// The mean of its weights, k values.
    pub mean: DVector<f64>,
    /// The covariance of its weights, k x k, positive semi-definite.
    pub covariance: DMatrix<f64>,
}

impl fmt::Display for Distribution {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Distribution::Gaussian => f.write_str("Gaussian"),
            Distribution::Kernel { bandwidth, weights } => {
                let spectra = counted(weights.nrows() as u64, "spectrum", "spectra");
                write!(f, "kernel of bandwidth {bandwidth} about {spectra}")
            }
            Distribution::Mixture(components) => {
                let total: f64 = components.iter().map(|component| component.share).sum();
                let percents =
                    components.iter().map(|component| format!("{:.1}", 100.0 * component.share / total));
                let normals = counted(components.len() as u64, "normal distribution", "normal distributions");
                write!(f, "mixture of {normals}: {} %", percents.collect::<Vec<_>>().join(", "))
            }
        }
    }
}

impl Distribution {
    /// Name of the kind: `gaussian`, `kernel` or `mixture`.
    pub fn name(&self) -> &'static str {
        match self {
            Distribution::Gaussian => "gaussian",
            Distribution::Kernel { .. } => "kernel",
            Distribution::Mixture(_) => "mixture",
        }
    }

    /// The number of normal distributions.
    pub fn len(&self) -> usize {
        match self {
            Distribution::Gaussian => 1,
            Distribution::Kernel { weights, .. } => weights.nrows(),
            Distribution::Mixture(components) => components.len(),
        }
    }

    /// Whether there is none, which no model has.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Checks the distribution of k weights.
    pub(super) fn check(&self, k: usize) -> Result<(), ModelError> {
        if self.is_empty() || self.len() > MOST_CENTRES {
            return Err(ModelError::Centres { name: self.name(), found: self.len() });
        }
        match self {
            Distribution::Gaussian => Ok(()),
            Distribution::Kernel { bandwidth, weights } => {
                if !(0.0..=1.0).contains(bandwidth) {
                    return Err(ModelError::Bandwidth(*bandwidth));
                }
                has_shape("a row of distribution.weights", weights.ncols(), k)?;
                are_finite("distribution.weights", weights.as_slice())
            }
            Distribution::Mixture(components) => components.iter().try_for_each(|component| {
                if !(component.share.is_finite() && component.share > 0.0) {
                    return Err(ModelError::Share(component.share));
                }
                has_shape("a mean of distribution", component.mean.len(), k)?;
                has_shape("a covariance of distribution", component.covariance.nrows(), k)?;
                has_shape("a row of a covariance of distribution", component.covariance.ncols(), k)?;
                are_finite("distribution.mean", component.mean.as_slice())?;
                are_finite("distribution.covariance", component.covariance.as_slice())?;
                check_covariance(&component.covariance)
            }),
        }
    }
}

impl Model {
    /// Distribution of the weights.
    pub fn distribution(&self) -> &Distribution {
        &self.parts.distribution
    }

    /// The model with another distribution of its weights, whose mean and covariance stay as they are.
    pub fn with_distribution(&self, distribution: Distribution) -> Result<Model, ModelError> {
        distribution.check(self.components())?;
        let mut model = self.clone();
        model.parts.distribution = distribution;
        Ok(model)
    }

    /// The normal distributions of the weights in the frame of the standard normals, in which [`weight_factor`] times z is
    /// a weight's distance from the mean; `None` of a Gaussian, whose only one is standard.
    ///
    /// [`weight_factor`]: Model::weight_factor
    pub(crate) fn centres(&self) -> Option<Centres> {
        let (k, count) = (self.components(), self.distribution().len());
        let (coordinates, spread, shares) = match self.distribution() {
            Distribution::Gaussian => return None,
            Distribution::Kernel { bandwidth, weights } => {
                let shrinkage = (1.0 - bandwidth * bandwidth).sqrt();
                let coordinates = self.whitened(weights).into_iter().map(|c| shrinkage * c).collect();
                (coordinates, Spread::Same(*bandwidth), vec![1.0; count])
            }
            Distribution::Mixture(components) => {
                let means = DMatrix::from_fn(count, k, |g, j| components[g].mean[j]);
                let whitener = self.whitener();
                let factors = components.iter().flat_map(|component| {
                    lower_factor(&(&whitener * &component.covariance * whitener.transpose()))
                });
                let factors = factors.collect();
                (self.whitened(&means), Spread::Own(factors), components.iter().map(|c| c.share).collect())
            }
        };
        Some(Centres { coordinates, spread, shares, components: k })
    }

    /// Rows of weights as k coordinates each, in the frame of the standard normals.
    pub(crate) fn whitened(&self, weights: &DMatrix<f64>) -> Vec<f64> {
        let whitener = self.whitener();
        let mean = &self.parts.weight_mean;
        weights
            .row_iter()
            .flat_map(|row| (&whitener * (row.transpose() - mean)).as_slice().to_vec())
            .collect()
    }

    /// The inverse of [`weight_factor`](Model::weight_factor) on the directions in which weights vary, 0 on the others.
    fn whitener(&self) -> DMatrix<f64> {
        let factor = self.weight_factor();
        let largest = factor.amax();
        let inverse = |value: f64| if value > 1e-9 * largest { value.recip() } else { 0.0 };
        if is_diagonal(&factor) {
            return DMatrix::from_diagonal(&factor.diagonal().map(inverse));
        }
        let eigen = SymmetricEigen::new(factor);
        let inverses = DMatrix::from_diagonal(&eigen.eigenvalues.map(inverse));
        &eigen.eigenvectors * inverses * eigen.eigenvectors.transpose()
    }

    /// Bounds of physical spectra, as half-spaces of the standard normals.
    pub(crate) fn half_spaces(&self) -> Vec<HalfSpace> {
        physical(&self.spectrum_map(&self.weight_map(1.0)), self.kind() == SpectrumKind::Reflectance)
    }
}

/// Rows of the lower triangular factor of a positive semi-definite matrix, one after another: Cholesky's, with columns of
/// zeros where rounding leaves no positive pivot.
fn lower_factor(covariance: &DMatrix<f64>) -> Vec<f64> {
    let k = covariance.nrows();
    let least = 1e-12 * covariance.amax();
    let mut factor = vec![0.0; triangle(k)];
    for j in 0..k {
        let sum = |i: usize, factor: &[f64]| {
            let products = (0..j).map(|l| factor[triangle(i) + l] * factor[triangle(j) + l]);
            covariance[(i, j)] - products.sum::<f64>()
        };
        let pivot = sum(j, &factor);
        if pivot <= least {
            continue;
        }
        factor[triangle(j) + j] = pivot.sqrt();
        for i in j + 1..k {
            factor[triangle(i) + j] = sum(i, &factor) / pivot.sqrt();
        }
    }
    factor
}

/// A distribution, as a model file has it.
#[derive(Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "lowercase", deny_unknown_fields)]
pub(super) enum DistributionRecord {
    Kernel { bandwidth: f64, weights: Vec<Vec<f64>> },
    Mixture { components: Vec<ComponentRecord> },
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct ComponentRecord {
    share: f64,
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
}

impl DistributionRecord {
    pub(super) fn of(distribution: &Distribution) -> Option<DistributionRecord> {
        match distribution {
            Distribution::Gaussian => None,
            Distribution::Kernel { bandwidth, weights } => {
                Some(DistributionRecord::Kernel { bandwidth: *bandwidth, weights: rows(weights) })
            }
            Distribution::Mixture(components) => {
                let component = |component: &MixtureComponent| ComponentRecord {
                    share: component.share,
                    mean: component.mean.as_slice().to_vec(),
                    covariance: rows(&component.covariance),
                };
                Some(DistributionRecord::Mixture { components: components.iter().map(component).collect() })
            }
        }
    }

    /// The distribution of k weights.
    pub(super) fn into_distribution(self, k: usize) -> Result<Distribution, ModelError> {
        match self {
            DistributionRecord::Kernel { bandwidth, weights } => Ok(Distribution::Kernel {
                bandwidth,
                weights: matrix("a row of distribution.weights", &weights, k)?,
            }),
            DistributionRecord::Mixture { components } => {
                let component = |record: ComponentRecord| -> Result<_, ModelError> {
                    let covariance = matrix("a row of a covariance of distribution", &record.covariance, k)?;
                    Ok(MixtureComponent { share: record.share, mean: record.mean.into(), covariance })
                };
                Ok(Distribution::Mixture(components.into_iter().map(component).collect::<Result<_, _>>()?))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of matrices of every rank, by its product.
    #[test]
    fn factors_are_those_of_their_covariances() {
        let k = 5;
        for rank in 0..=k {
            let gain = DMatrix::from_fn(k, rank, |i, j| (((i + 1) * (j + 2)) as f64).sin());
            let covariance = &gain * gain.transpose();
            let rows = lower_factor(&covariance);
            let factor = DMatrix::from_fn(k, k, |i, j| if j <= i { rows[triangle(i) + j] } else { 0.0 });
            let error = (&factor * factor.transpose() - &covariance).amax();
            // What is left out of a column of zeros is that small.
            assert!(error < 1e-12 * covariance.amax().max(1.0), "rank {rank}: {error:e}");
            assert_eq!((0..k).filter(|&j| factor[(j, j)] > 0.0).count(), rank);
        }
    }

    #[test]
    fn kinds_have_names() {
        let kernel = Distribution::Kernel { bandwidth: 0.5, weights: DMatrix::zeros(1, 1) };
        let names = [Distribution::Gaussian, kernel, Distribution::Mixture(Vec::new())].map(|d| d.name());
        assert_eq!(names, ["gaussian", "kernel", "mixture"]);
    }
}
