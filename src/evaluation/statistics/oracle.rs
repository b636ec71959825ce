//! Oracle: the distributions of the library, drawn in another way. Its random words come from another crate in
//! sequence, its normals from the inverse of the normal distribution function rather than from Box-Muller, its
//! weights from an eigen-decomposition, and the bounds are written out as the appendix has them. Of the library it
//! uses the model's parts and the colorimetric tables.
//!
//! Of a model that is no Gaussian a normal distribution is chosen by its share alone, and candidates of that one are made
//! until one is accepted: what the library does by odds, which it estimates, needs none here.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand_philox::{Philox, u32_to_unit_f64};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::sample::{Sample, Scenario, ScenarioDraw};
use crate::colorimetry;
use crate::dataset::SpectrumKind;
use crate::model::Distribution;
use crate::program::Bounds;

/// Number of draws that share a generator.
const CHUNK: u64 = 1024;

/// Makes `count` draws of a scenario.
pub fn sample(scenario: &Scenario, seed: u64, count: u64) -> Sample<'_> {
    let oracle = Oracle::new(scenario);
    let draws: Vec<_> = (0..count.div_ceil(CHUNK))
        .into_par_iter()
        .flat_map_iter(|chunk| {
            let mut rng = Philox::from_u64_seed_stream(seed, chunk);
            (0..CHUNK.min(count - chunk * CHUNK)).map(|_| oracle.draw(&mut rng)).collect::<Vec<_>>()
        })
        .collect();
    Sample::new(scenario, &draws)
}

struct Oracle<'a> {
    scenario: &'a Scenario,
    normals: Vec<About>,
    /// Luminance of each band of a perfect white under D65; `white` is their sum.
    luminous: Vec<f64>,
    white: f64,
    normal: Normal,
}

/// A normal distribution of weights.
struct About {
    mean: DVector<f64>,
    /// A matrix whose product with its transpose is the covariance.
    root: DMatrix<f64>,
    /// The sum of the shares up to it.
    up_to: f64,
}

/// The normal distributions of a scenario's weights.
fn normals(scenario: &Scenario) -> Vec<About> {
    let parts = scenario.model.parts();
    let root = |covariance: &DMatrix<f64>| {
        let eigen = SymmetricEigen::new(covariance * scenario.scale);
        eigen.eigenvectors * DMatrix::from_diagonal(&eigen.eigenvalues.map(|v| v.max(0.0).sqrt()))
    };
    let spread = |from_mean: DVector<f64>| &parts.weight_mean + scenario.scale.sqrt() * from_mean;
    match &parts.distribution {
        Distribution::Kernel { bandwidth, weights } => {
            let root = *bandwidth * root(&parts.weight_covariance);
            let shrinkage = (1.0 - bandwidth * bandwidth).sqrt();
            let about = |i: usize| About {
                mean: spread(shrinkage * (weights.row(i).transpose() - &parts.weight_mean)),
                root: root.clone(),
                up_to: (i + 1) as f64 / weights.nrows() as f64,
            };
            (0..weights.nrows()).map(about).collect()
        }
        Distribution::Mixture(components) => {
            let total: f64 = components.iter().map(|component| component.share).sum();
            let mut up_to = 0.0;
            let about = components.iter().map(|component| {
                up_to += component.share / total;
                About {
                    mean: spread(&component.mean - &parts.weight_mean),
                    root: root(&component.covariance),
                    up_to,
                }
            });
            about.collect()
        }
        Distribution::Gaussian => {
            vec![About { mean: parts.weight_mean.clone(), root: root(&parts.weight_covariance), up_to: 1.0 }]
        }
    }
}

impl Oracle<'_> {
    fn new(scenario: &Scenario) -> Oracle<'_> {
        let grid = scenario.model.grid();
        let [_, y, _] = colorimetry::cmf(grid);
        let light = colorimetry::d65(grid).into_iter().zip(grid.widths());
        let luminous: Vec<_> = light.zip(y).map(|((e, width), y)| e * width * y).collect();
        Oracle {
            scenario,
            normals: normals(scenario),
            white: luminous.iter().sum(),
            luminous,
            normal: Normal::standard(),
        }
    }

    fn draw(&self, rng: &mut Philox) -> ScenarioDraw {
        let about = match self.normals.as_slice() {
            [only] => only,
            normals => {
                let share = u32_to_unit_f64(rng.next_u32());
                &normals[normals.partition_point(|about| about.up_to < share).min(normals.len() - 1)]
            }
        };
        (1..).find_map(|attempt| Some((self.candidate(about, rng)?, attempt))).expect("a draw ends")
    }

    fn candidate(&self, about: &About, rng: &mut Philox) -> Option<Vec<f64>> {
        let parts = self.scenario.model.parts();
        let z = DVector::from_fn(about.root.ncols(), |_, _| {
            self.normal.inverse_cdf(u32_to_unit_f64(rng.next_u32()))
        });
        let base = &parts.mean + parts.basis.tr_mul(&(&about.mean + &about.root * z));
        let positive = base.iter().all(|&s| s > 0.0);
        let below_one = |s: &DVector<f64>| s.iter().all(|&s| s < 1.0);
        let Some((lrv, bounds)) = self.scenario.target else {
            let physical = positive && (parts.kind == SpectrumKind::Illuminant || below_one(&base));
            return physical.then(|| base.as_slice().to_vec());
        };
        let lrv_of_base = self.luminous.iter().zip(&base).map(|(l, s)| l * s).sum::<f64>() / self.white;
        let scaled = &base * (lrv / lrv_of_base);
        let accepted = match bounds {
            Bounds::Base => positive && below_one(&base),
            // A spectrum that is negative throughout has a negative LRV, and scaling would make it positive.
            Bounds::Scaled => positive && below_one(&scaled),
            Bounds::Both => positive && below_one(&base) && below_one(&scaled),
        };
        accepted.then(|| scaled.as_slice().to_vec())
    }
}
