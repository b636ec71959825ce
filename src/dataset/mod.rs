//! Measured spectra: tables as they were measured, and the data set that a model is fitted to.
//!
//! A [`Table`] is what one file holds, at its own wavelengths; a [`Reading`] also says how the file was read. A
//! [`Dataset`] is one or more tables on one grid. Each reader delivers cells ([`sheet`]) or arrays with names ([`arrays`]),
//! from which wavelengths and spectra are found in one place each; what is measured is judged ([`judge`]) before anything
//! is made of it.

mod arrays;
mod axis;
mod builtin;
mod envi;
mod error;
mod files;
mod folder;
mod format;
#[cfg(feature = "hdf5")]
mod hdf5;
mod jcamp;
mod judge;
mod mat;
mod npy;
mod npz;
mod numbers;
#[cfg(feature = "parquet")]
mod parquet;
mod reading;
mod resample;
mod sheet;
mod spdx;
mod spreadsheet;
mod table;
mod text;
mod units;
mod zarr;

use std::fmt;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::grid::{Extrapolation, Grid};
pub use builtin::BuiltinTable;
pub use error::{DatasetError, Remedy};
pub use judge::{SpectraCounts, Unphysical};
pub use reading::{Decimal, ReadOptions, Reading, Separator, TableLayout};
use resample::resample;
pub use table::Table;
pub use units::WavelengthUnit;

/// Limit on the bytes read of a file, and on those that a compressed file may unpack to: 512 MiB, 67 million values.
const MAX_BYTES: u64 = 512 << 20;

/// Limit on the values of a file.
const MAX_VALUES: usize = MAX_BYTES as usize / size_of::<f64>();

/// The reason of a refusal for size.
fn too_many(values: usize) -> String {
    format!("it holds {values} values, and {MAX_VALUES} are the most: split it, or keep only the spectra")
}

#[cfg(feature = "hdf5")]
fn hdf5_bytes(path: &std::path::Path, bytes: Vec<u8>) -> Result<arrays::Arrays, DatasetError> {
    hdf5::arrays(path, bytes)
}

#[cfg(not(feature = "hdf5"))]
fn hdf5_bytes(path: &std::path::Path, _: Vec<u8>) -> Result<arrays::Arrays, DatasetError> {
    let reason =
        "this build leaves out HDF5: build it with the feature hdf5, or resave with save(file, '-v7')";
    Err(format::not_built(path, "HDF5", reason))
}

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
    /// Judges `tables`, resamples them onto `grid` and joins them, in order. See [`Extrapolation`] for wavelengths
    /// outside a table's. Values that no measurement gives are an error.
    pub fn new(tables: &[Table], grid: Grid, extend: Extrapolation) -> Result<Dataset, DatasetError> {
        if tables.is_empty() {
            return Err(DatasetError::NoSpectra { name: "an empty list of tables".to_owned() });
        }
        tables.iter().try_for_each(|table| judge::table(table, &grid))?;
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
