//! Measured spectra: tables as they were measured, and the data set that a model is fitted to.
//!
//! A [`Table`] is what one file holds, at its own wavelengths. A [`Dataset`] is one or more tables on one grid. Both
//! are checked when they are made, so nothing downstream meets a NaN or a ragged row.

mod builtin;
mod csv;
#[cfg(feature = "hdf5")]
mod hdf5;
mod mat;
mod matrix;
mod npy;

use std::fmt;
use std::io::Read;
use std::path::{Path, PathBuf};

use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};

use crate::grid::{self, Extrapolation, Grid, GridError, Spline};
pub use builtin::BuiltinTable;

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

/// Error returned where data cannot be used: says what is wrong, where, and what to do.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum DatasetError {
    #[error("cannot read {path:?}: {source}")]
    Read { path: PathBuf, source: std::io::Error },
    #[error("{path:?} holds more than {} MiB (unpacked): split it, or keep only the spectra", MAX_BYTES >> 20)]
    TooLarge { path: PathBuf },
    #[error("{path:?} is empty")]
    Empty { path: PathBuf },
    #[error("{path:?}: unknown type of file; expected .mat, .h5, .npy, .csv, .tsv or .txt")]
    UnknownType { path: PathBuf },
    #[error("{path:?} is not a readable MATLAB file: {reason}")]
    Mat { path: PathBuf, reason: String },
    #[error("{path:?} is not readable HDF5: {reason}")]
    Hdf5 { path: PathBuf, reason: String },
    #[error("{path:?} is not a readable NumPy array: {reason}")]
    Npy { path: PathBuf, reason: String },
    #[error("{path:?} does not say at which wavelengths its spectra are: give them, as start:step:stop")]
    NoWavelengths { path: PathBuf },
    #[error("{path:?}, line {line}: {reason}")]
    Csv { path: PathBuf, line: u64, reason: String },
    #[error(
        "{path:?} holds no matrix of spectra with its wavelengths beside it (X with S_X = [start step count], or a vector wavelength); it holds {found}"
    )]
    NoMatrix { path: PathBuf, found: String },
    #[error("{path:?} holds several matrices of spectra: say which, as in {}:{}", path.display(), candidates[0])]
    Ambiguous { path: PathBuf, candidates: Vec<String> },
    #[error("{path:?} holds no matrix {variable:?} with its wavelengths beside it; it holds {found}")]
    NoVariable { path: PathBuf, variable: String, found: String },
    #[error(
        "{name}: {source} (text files have wavelengths in nm in their first column, and a spectrum in each other)"
    )]
    Wavelengths { name: String, source: GridError },
    #[error("{name}: {source}; the first column must hold the wavelengths: are the spectra in rows?")]
    FirstColumn { name: String, source: GridError },
    #[error(
        "{name}: {values} values in spectrum {spectrum}, but {wavelengths} wavelengths: give one value for each"
    )]
    Length { name: String, spectrum: usize, values: usize, wavelengths: usize },
    #[error(
        "spectrum {spectrum} of {name}: the value at {wavelength} nm is {value}; every value must be finite"
    )]
    NotFinite { name: String, spectrum: usize, wavelength: f64, value: f64 },
    #[error("{name} holds no spectra")]
    NoSpectra { name: String },
    #[error(
        "{name} was measured from {first} to {last} nm, which does not cover the grid {grid}: choose a grid within it, or extrapolate (hold or zero)"
    )]
    Range { name: String, first: f64, last: f64, grid: Grid },
}

/// Spectra of one source, as measured: increasing wavelengths (nm), finite values.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name in messages: a path and what it takes to find the spectra in that file.
    name: String,
    /// Name in models: without the folder, which is private to whoever fitted them.
    source: String,
    wavelengths: Vec<f64>,
    /// One column per spectrum.
    spectra: DMatrix<f64>,
    kind: Option<SpectrumKind>,
}

impl Table {
    /// Makes a table of values, each spectrum as long as `wavelengths` (nm). `name` is its name in messages.
    pub fn new(name: &str, wavelengths: Vec<f64>, spectra: &[Vec<f64>]) -> Result<Table, DatasetError> {
        if let Some(i) = spectra.iter().position(|s| s.len() != wavelengths.len()) {
            return Err(DatasetError::Length {
                name: name.to_owned(),
                spectrum: i + 1,
                values: spectra[i].len(),
                wavelengths: wavelengths.len(),
            });
        }
        let values = spectra.iter().flatten().copied();
        let spectra = DMatrix::from_iterator(wavelengths.len(), spectra.len(), values);
        Table::from_columns(name, wavelengths, spectra)
    }

    /// Makes a table for the readers: `spectra` has a row for each wavelength.
    fn from_columns(name: &str, wavelengths: Vec<f64>, spectra: DMatrix<f64>) -> Result<Table, DatasetError> {
        let name = name.to_owned();
        if spectra.is_empty() {
            return Err(DatasetError::NoSpectra { name });
        }
        if let Err(source) = grid::check_increasing(&wavelengths) {
            return Err(DatasetError::Wavelengths { name, source });
        }
        for (j, spectrum) in spectra.column_iter().enumerate() {
            if let Some(i) = spectrum.iter().position(|v| !v.is_finite()) {
                return Err(DatasetError::NotFinite {
                    name,
                    spectrum: j + 1,
                    wavelength: wavelengths[i],
                    value: spectrum[i],
                });
            }
        }
        Ok(Table { source: name.clone(), name, wavelengths, spectra, kind: None })
    }

    /// Reads a MATLAB file or an `.h5` one, or a `.csv`, `.tsv` or `.txt` file with the wavelengths in the first column
    /// and a spectrum in each other one. `variable` picks a matrix where a `.mat` or `.h5` file holds several.
    pub fn open(path: impl AsRef<Path>, variable: Option<&str>) -> Result<Table, DatasetError> {
        Table::open_on(path, variable, None)
    }

    /// Reads a table as [`Table::open`] does, and also `.npy` files with spectra in rows, whose wavelengths are
    /// `grid`.
    pub fn open_on(
        path: impl AsRef<Path>,
        variable: Option<&str>,
        grid: Option<Grid>,
    ) -> Result<Table, DatasetError> {
        let path = path.as_ref();
        let bytes = read_capped(path)?;
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let mut table = match extension.as_str() {
            "mat" | "h5" | "hdf5" => mat::read(path, &bytes, variable),
            "npy" => npy::read(path, &bytes, grid),
            "csv" | "tsv" | "txt" => csv::read(path, &bytes),
            _ => Err(DatasetError::UnknownType { path: path.to_owned() }),
        }?;
        let (full, file) =
            (path.display().to_string(), path.file_name().unwrap_or_default().to_string_lossy());
        table.source = table.name.replace(&format!("{full:?}"), &file);
        Ok(table)
    }

    /// Whether the name of a file is that of a table, by its extension.
    pub fn may_open(path: &Path) -> bool {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        matches!(extension.as_str(), "mat" | "h5" | "hdf5" | "npy" | "csv" | "tsv" | "txt")
    }

    /// Spectra multiplied by `factor`: 0.01 makes reflectances of percentages.
    pub fn scaled(mut self, factor: f64) -> Table {
        self.spectra *= factor;
        self
    }

    /// Name of the table in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Kind of the spectra by the field's naming convention: `sur_x` are reflectances, `spd_x` and `daylightX`
    /// illuminants.
    pub fn kind(&self) -> Option<SpectrumKind> {
        self.kind
    }

    /// The wavelengths of the measurements, nm.
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths
    }

    /// The number of spectra.
    #[allow(clippy::len_without_is_empty)] // a table is never empty
    pub fn len(&self) -> usize {
        self.spectra.ncols()
    }

    /// The values of one spectrum, one per wavelength.
    pub fn spectrum(&self, index: usize) -> &[f64] {
        let bands = self.wavelengths.len();
        &self.spectra.as_slice()[index * bands..(index + 1) * bands]
    }

    fn resample(&self, grid: Grid, extend: Extrapolation) -> Result<DMatrix<f64>, DatasetError> {
        let (first, last) = (self.wavelengths[0], self.wavelengths[self.wavelengths.len() - 1]);
        if extend == Extrapolation::Error && (grid.first() < first || grid.last() > last) {
            return Err(DatasetError::Range { name: self.name.clone(), first, last, grid });
        }
        let mut columns = DMatrix::zeros(grid.len(), self.len());
        for (j, mut column) in columns.column_iter_mut().enumerate() {
            let spline = Spline::new(&self.wavelengths, self.spectrum(j));
            for (value, wavelength) in column.iter_mut().zip(grid.wavelengths()) {
                *value = spline.at(wavelength, extend);
                if !value.is_finite() {
                    let (name, value) = (self.name.clone(), *value);
                    return Err(DatasetError::NotFinite { name, spectrum: j + 1, wavelength, value });
                }
            }
        }
        Ok(columns)
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
        let columns: Vec<_> = tables.iter().map(|t| t.resample(grid, extend)).collect::<Result<_, _>>()?;
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

fn read_capped(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let failed = |source| DatasetError::Read { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    match bytes.len() as u64 {
        0 => Err(DatasetError::Empty { path: path.to_owned() }),
        n if n > MAX_BYTES => Err(DatasetError::TooLarge { path: path.to_owned() }),
        _ => Ok(bytes),
    }
}
