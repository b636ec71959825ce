//! Errors of data: what is wrong, where, and what to do.

use std::path::PathBuf;

use super::MAX_BYTES;
use crate::grid::{Grid, GridError};

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
    #[error(
        "spectrum {spectrum} of {name} has no value at {wavelength} nm, which the grid needs; {place}: choose a grid without it, \
         leave such spectra out{remedy}"
    )]
    NotMeasured { name: String, spectrum: usize, wavelength: f64, place: String, remedy: &'static str },
    #[error(
        "no spectrum of {name} has every value that the grid needs, the first of them none at {wavelength} nm (spectrum \
         {spectrum}): choose a grid without it"
    )]
    AllDropped { name: String, spectrum: usize, wavelength: f64 },
    #[error("{a} and {b} were measured at different wavelengths: choose a grid for both")]
    Grids { a: String, b: String },
    #[error("{name} holds no spectra")]
    NoSpectra { name: String },
    #[error(
        "{name} was measured from {first} to {last} nm, which does not cover the grid {grid}: choose a grid within it, or extrapolate (hold or zero)"
    )]
    Range { name: String, first: f64, last: f64, grid: Grid },
}
