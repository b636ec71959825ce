//! Measured spectra: tables as they were measured, and the data set that a model is fitted to.
//!
//! A [`Table`] is what one file holds, at its own wavelengths. A [`Dataset`] is one or more tables on one grid. Both
//! are checked when they are made, so nothing downstream meets a NaN or a ragged row.

mod builtin;
mod csv;
mod error;
#[cfg(feature = "hdf5")]
mod hdf5;
mod mat;
mod matrix;
mod npy;
mod resample;
mod table;

use std::fmt;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::grid::{Extrapolation, Grid};
pub use builtin::BuiltinTable;
pub use error::DatasetError;
use resample::resample;
pub use table::Table;

/// Limit on the bytes read of a file, and on those that a compressed file may unpack to: 512 MiB, 67 million values.
const MAX_BYTES: u64 = 512 << 20;

/// Kind of spectrum: illuminants and reflectances have different physical limits.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum SpectrumKind {
    /// Spectral power distributions of lights: positive in every band, of any magnitude.
    Illuminant,
    /// Diffuse reflectances of surfaces: between 0 and 1 in every band.
    Reflectance,
}

impl fmt::Display for SpectrumKind {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(match self {
            SpectrumKind::Illuminant => "illuminant",
            SpectrumKind::Reflectance => "reflectance",
        })
    }
}

/// Spectra of one or more sources on one grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    grid: Grid,
    /// One column per spectrum.
    spectra: DMatrix<f64>,
    sources: Vec<String>,
    /// Number of spectra of each source.
    counts: Vec<usize>,
}

impl Dataset {
    /// Resamples `tables` onto `grid` and joins them, in order. See [`Extrapolation`] for wavelengths outside a
    /// table's.
    pub fn new(tables: &[Table], grid: Grid, extend: Extrapolation) -> Result<Dataset, DatasetError> {
        if tables.is_empty() {
            return Err(DatasetError::NoSpectra { name: "an empty list of tables".to_owned() });
        }
        let columns: Vec<_> = tables.iter().map(|t| resample(t, grid, extend)).collect::<Result<_, _>>()?;
        let count = columns.iter().map(DMatrix::ncols).sum();
        let values = columns.iter().flat_map(|c| c.iter().copied());
        let spectra = DMatrix::from_iterator(grid.len(), count, values);
        let sources = tables.iter().map(|t| format!("{} ({} spectra)", t.source, t.len())).collect();
        let counts = tables.iter().map(Table::len).collect();
        Ok(Dataset { grid, spectra, sources, counts })
    }

    /// The wavelengths.
    pub fn grid(&self) -> Grid {
        self.grid
    }

    /// The spectra: a row per band, a column per spectrum.
    pub fn spectra(&self) -> &DMatrix<f64> {
        &self.spectra
    }

    /// Sources of the spectra, a line each.
    pub fn sources(&self) -> &[String] {
        &self.sources
    }

    /// The source of spectrum `index` and its number there, from 1, as messages name it.
    pub(crate) fn place(&self, index: usize) -> String {
        let mut number = index;
        let source = self.counts.iter().position(|&count| {
            let is_here = number < count;
            number -= if is_here { 0 } else { count };
            is_here
        });
        format!("spectrum {} of {}", number + 1, self.sources[source.expect("the data have that many")])
    }
}
