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
#[cfg(feature = "spreadsheets")]
mod spreadsheet;
mod table;
mod text;
#[cfg(feature = "parquet")]
mod thrift;
mod units;
mod zarr;

use std::fmt;

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::grid::Grid;
use crate::wording::counted;
pub use builtin::BuiltinTable;
pub use error::{DatasetError, Remedy};
pub use judge::{SpectraCounts, Unphysical};
pub use reading::{Decimal, ReadOptions, Reading, Separator, TableLayout};
pub use resample::{ResampleMethod, Resampling};
use resample::{Resampled, resample};
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
fn hdf5_arrays(path: &std::path::Path, source: files::Source) -> Result<arrays::Arrays, DatasetError> {
    hdf5::arrays(path, source)
}

#[cfg(not(feature = "hdf5"))]
fn hdf5_arrays(path: &std::path::Path, _: files::Source) -> Result<arrays::Arrays, DatasetError> {
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

/// Treatment of spectra that lack a value which the grid needs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Missing {
    /// An error, which names the first of them.
    #[default]
    Error,
    /// They are left out.
    Drop,
    /// The value is interpolated between those that were measured. What is missing at an end stays an error.
    Interpolate,
}

/// Spectra of one or more sources on one grid.
#[derive(Clone, Debug, PartialEq)]
pub struct Dataset {
    grid: Grid,
    /// One column per spectrum.
    spectra: DMatrix<f64>,
    sources: Vec<String>,
    /// The numbers, from 1, of the spectra of each source in its table.
    numbers: Vec<Vec<usize>>,
    notes: Vec<String>,
}

impl Dataset {
    /// Judges `tables`, resamples them onto `grid` and joins them, in order, as [`Resampling`] says; an
    /// [`Extrapolation`](crate::Extrapolation) alone stands for settings that are otherwise the defaults. Values that no measurement gives are an error.
    pub fn new(
        tables: &[Table],
        grid: Grid,
        settings: impl Into<Resampling>,
    ) -> Result<Dataset, DatasetError> {
        tables.iter().try_for_each(|table| judge::table(table, &grid))?;
        Dataset::unjudged(tables, grid, settings)
    }

    /// Resamples and joins tables as [`Dataset::new`] does, without judging whether their values can be measurements:
    /// for lamps, whose lines stand out, and for sensitivities, which are 0 where a sensor sees nothing.
    pub(crate) fn unjudged(
        tables: &[Table],
        grid: Grid,
        settings: impl Into<Resampling>,
    ) -> Result<Dataset, DatasetError> {
        let settings = settings.into();
        if tables.is_empty() {
            return Err(DatasetError::NoSpectra { name: "an empty list of tables".to_owned() });
        }
        let resampled = tables.iter().map(|table| resample(table, &grid, settings));
        let resampled = resampled.collect::<Result<Vec<_>, _>>()?;
        let count = resampled.iter().map(|of| of.numbers.len()).sum();
        let values = resampled.iter().flat_map(|of| of.spectra.iter().copied());
        let spectra = DMatrix::from_iterator(grid.len(), count, values);
        let source = |(table, of): (&Table, &Resampled)| {
            let count = counted(of.numbers.len() as u64, "spectrum", "spectra");
            format!("{} ({count})", table.source)
        };
        let sources = tables.iter().zip(&resampled).map(source).collect();
        let notes = resampled.iter().flat_map(|of| of.notes.iter().cloned()).collect();
        let numbers = resampled.into_iter().map(|of| of.numbers).collect();
        Ok(Dataset { grid, spectra, sources, numbers, notes })
    }

    /// The wavelengths at which these tables were measured, all of them alike, as a grid. Wavelengths at which a table has
    /// no value at all, as where water absorbs, are left out.
    pub fn measured_grid(tables: &[Table]) -> Result<Grid, DatasetError> {
        let [table, others @ ..] = tables else {
            return Err(DatasetError::NoSpectra { name: "an empty list of tables".to_owned() });
        };
        let wavelengths = table.measured_wavelengths();
        let is_other = |other: &&Table| other.measured_wavelengths() != wavelengths;
        if let Some(other) = others.iter().find(is_other) {
            return Err(DatasetError::Grids { a: table.name.clone(), b: other.name.clone() });
        }
        Grid::from_wavelengths(&wavelengths)
            .map_err(|source| DatasetError::Wavelengths { name: table.name.clone(), source })
    }

    /// The wavelengths.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The spectra: a row per band, a column per spectrum.
    pub fn spectra(&self) -> &DMatrix<f64> {
        &self.spectra
    }

    /// Sources of the spectra, a line each.
    pub fn sources(&self) -> &[String] {
        &self.sources
    }

    /// Sentences about what the resampling did beyond interpolation, and why.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The source of spectrum `index` and its number there, from 1, as messages name it.
    pub(crate) fn place(&self, index: usize) -> String {
        let places = self.numbers.iter().enumerate();
        let mut places =
            places.flat_map(|(source, numbers)| numbers.iter().map(move |number| (source, number)));
        let (source, number) = places.nth(index).expect("the data have that many");
        format!("spectrum {number} of {}", self.sources[source])
    }
}
