//! Standard observers: the colour matching functions of the CIE, and the weights that they give the bands of a grid.

use serde::{Deserialize, Serialize};

use super::on_grid;
use crate::dataset::BuiltinTable;
use crate::grid::Grid;

/// Standard observer: the colour matching functions that tristimulus values are sums with.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Observer {
    /// CIE 1931, for fields of 2 degrees.
    #[default]
    Cie1931,
    /// CIE 1964, for fields of 10 degrees.
    Cie1964,
}

impl Observer {
    /// Name in commands and files.
    pub fn name(self) -> &'static str {
        match self {
            Observer::Cie1931 => "cie1931",
            Observer::Cie1964 => "cie1964",
        }
    }

    /// The table of the colour matching functions, 360 to 830 nm by 1 nm.
    pub(crate) fn table(self) -> BuiltinTable {
        match self {
            Observer::Cie1931 => BuiltinTable::Xyz1931,
            Observer::Cie1964 => BuiltinTable::Xyz1964,
        }
    }

    /// The colour matching functions x, y and z on a grid; zero outside 360 to 830 nm.
    pub fn cmf(self, grid: &Grid) -> [Vec<f64>; 3] {
        [0, 1, 2].map(|function| on_grid(self.table(), function, grid))
    }

    /// Weights of X, Y and Z for the power of a light in each band, per nm: its tristimulus values are sums of the
    /// products, times the step of the grid or, on an uneven one, the widths of the trapezoid rule.
    pub fn emitted_xyz_weights(self, grid: &Grid) -> [Vec<f64>; 3] {
        let widths = grid.widths();
        self.cmf(grid).map(|f| f.iter().zip(&widths).map(|(f, width)| f * width).collect())
    }

    /// Weights of X, Y and Z for reflectances under `light`, the power of an illuminant in each band, in any unit: a
    /// perfect white has Y = 1. `None` where none of its light is visible.
    pub fn xyz_weights_under(self, light: &[f64], grid: &Grid) -> Option<[Vec<f64>; 3]> {
        let cmf = self.cmf(grid);
        // Widths relative to the first are 1 on an even grid, so that its weights are those of a plain sum to the last bit.
        let widths = grid.widths();
        let light: Vec<f64> = light.iter().zip(&widths).map(|(e, width)| e * (width / widths[0])).collect();
        let white: f64 = light.iter().zip(&cmf[1]).map(|(e, y)| e * y).sum();
        (white > 0.0).then(|| cmf.map(|f| light.iter().zip(&f).map(|(e, f)| e * f / white).collect()))
    }
}
