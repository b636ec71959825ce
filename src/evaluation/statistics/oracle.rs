//! Oracle: the distributions of the library, drawn in another way. Its random words come from another crate in
//! sequence, its normals from the inverse of the normal distribution function rather than from Box-Muller, its
//! weights from an eigen-decomposition, and the bounds are written out as the appendix has them. Of the library it
//! uses the model's parts and the colorimetric tables.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rand_philox::{Philox, u32_to_unit_f64};
use rayon::prelude::*;
use statrs::distribution::{ContinuousCDF, Normal};

use super::sample::{Sample, Scenario, ScenarioDraw};
use crate::colorimetry;
use crate::dataset::SpectrumKind;
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
    /// A matrix whose product with its transpose is the covariance.
    root: DMatrix<f64>,
    /// Luminance of each band of a perfect white under D65; `white` is their sum.
    luminous: Vec<f64>,
    white: f64,
    normal: Normal,
}

impl Oracle<'_> {
    fn new(scenario: &Scenario) -> Oracle<'_> {
        let eigen = SymmetricEigen::new(&scenario.model.parts().weight_covariance * scenario.scale);
        let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        let grid = scenario.model.grid();
        let [_, y, _] = colorimetry::cmf(grid);
        let light = colorimetry::d65(grid).into_iter().zip(grid.widths());
        let luminous: Vec<_> = light.zip(y).map(|((e, width), y)| e * width * y).collect();
        Oracle {
            scenario,
            root: eigen.eigenvectors * DMatrix::from_diagonal(&roots),
            white: luminous.iter().sum(),
            luminous,
            normal: Normal::standard(),
        }
    }

    fn draw(&self, rng: &mut Philox) -> ScenarioDraw {
        (1..).find_map(|attempt| Some((self.candidate(rng)?, attempt))).expect("a draw ends")
    }

    fn candidate(&self, rng: &mut Philox) -> Option<Vec<f64>> {
        let parts = self.scenario.model.parts();
        let z = DVector::from_fn(self.root.ncols(), |_, _| {
            self.normal.inverse_cdf(u32_to_unit_f64(rng.next_u32()))
        });
        let base = &parts.mean + parts.basis.tr_mul(&(&parts.weight_mean + &self.root * z));
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
