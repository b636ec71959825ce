//! Errors of data: what is wrong, where, and what to do.

use std::path::PathBuf;

use super::MAX_BYTES;
use super::units::WavelengthUnit;
use crate::grid::{Grid, GridError, shortest};
use crate::wording::counted;

/// Setting of a reader or a fit that the message of an error advises.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum Remedy {
    /// None: the file is to be changed.
    None,
    /// A value that means "not measured" ([`ReadOptions::missing_values`](super::ReadOptions::missing_values)).
    MissingValue(f64),
    /// Spectra with missing values are left out ([`Missing`](super::Missing)).
    Missing,
    /// A factor for all values ([`Table::scaled`](super::Table::scaled)).
    Scale(f64),
    /// The unit of the wavelengths ([`ReadOptions::unit`](super::ReadOptions::unit)).
    Unit(WavelengthUnit),
    /// The direction of the spectra ([`ReadOptions::layout`](super::ReadOptions::layout)).
    Layout,
    /// The separator, the decimal sign, or the number of lines to skip.
    Dialect,
    /// The decimal sign ([`ReadOptions::decimal`](super::ReadOptions::decimal)).
    Decimal,
    /// The wavelengths of the measurements ([`ReadOptions::measured_at`](super::ReadOptions::measured_at)).
    MeasuredAt,
    /// The wavelengths of the model.
    Wavelengths,
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
    #[error("{path:?} is {found}, which is not read: {advice}")]
    UnknownType { path: PathBuf, found: String, advice: &'static str },
    #[error("{path:?} is not readable as {format}: {reason}")]
    Format { path: PathBuf, format: &'static str, reason: String },
    #[error("{path:?}, {place}: {reason}")]
    Place { path: PathBuf, place: String, reason: String, remedy: Remedy },
    #[error("{path:?}: {reason}")]
    Layout { path: PathBuf, reason: String, remedy: Remedy },
    #[error(
        "{path:?} does not say at which wavelengths its {}: give them, as start:step:stop",
        counted(*bands as u64, "band is", "bands are")
    )]
    NoWavelengths { path: PathBuf, bands: usize },
    #[error(
        "{path:?} holds no matrix of spectra with its wavelengths beside it (X with S_X = [start step count], or a vector wavelength); it holds {found}"
    )]
    NoMatrix { path: PathBuf, found: String },
    #[error("{path:?} holds several {what}: say which, as in {}:{}", path.display(), candidates.join(&format!(" or {}:", path.display())))]
    Ambiguous { path: PathBuf, what: &'static str, candidates: Vec<String> },
    #[error("{path:?} holds no matrix {variable:?} with its wavelengths beside it; it holds {found}")]
    NoVariable { path: PathBuf, variable: String, found: String },
    #[error("{name}: {source}")]
    Wavelengths { name: String, source: GridError },
    #[error("{name}: {reason}")]
    NotWavelengths { name: String, reason: String, remedy: Remedy },
    #[error(
        "{name}: {} in spectrum {spectrum}, but {}: give one value for each",
        counted(*values as u64, "value", "values"),
        counted(*wavelengths as u64, "wavelength", "wavelengths")
    )]
    Length { name: String, spectrum: usize, values: usize, wavelengths: usize },
    #[error(
        "spectrum {spectrum} of {name}: the value at {wavelength} nm is {value}; every value must be finite, or missing"
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
    #[error("{place}: the value at {wavelength} nm is {value}{reason}")]
    Value { place: String, wavelength: f64, value: f64, reason: String, remedy: Remedy },
    #[error("{place}: {reason}")]
    Spectrum { place: String, reason: String, remedy: Remedy },
    #[error(
        "{name} was measured from {} to {} nm, which does not cover the grid {grid}: choose a grid within it, or \
         extrapolate (hold or zero)",
        shortest(*first),
        shortest(*last)
    )]
    Range { name: String, first: f64, last: f64, grid: Grid },
}

impl DatasetError {
    /// Setting that the message advises.
    pub fn remedy(&self) -> Remedy {
        match self {
            DatasetError::Place { remedy, .. }
            | DatasetError::Layout { remedy, .. }
            | DatasetError::NotWavelengths { remedy, .. }
            | DatasetError::Value { remedy, .. }
            | DatasetError::Spectrum { remedy, .. } => *remedy,
            DatasetError::NoWavelengths { .. } => Remedy::MeasuredAt,
            DatasetError::NotMeasured { .. } => Remedy::Missing,
            DatasetError::AllDropped { .. } | DatasetError::Grids { .. } | DatasetError::Range { .. } => {
                Remedy::Wavelengths
            }
            _ => Remedy::None,
        }
    }
}
