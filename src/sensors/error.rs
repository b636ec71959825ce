//! Errors of sensors.

use super::{MAX_SENSORS, Sensors};
use crate::dataset::DatasetError;
use crate::grid::{Grid, GridError};
use crate::suggestion::closest;

/// Error returned where functions are no sensors, or none on a grid.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SensorError {
    #[error("{0:?} is no built-in set of sensors{meant}", meant = meant(.0))]
    Unknown(String),
    #[error("{0}")]
    Data(String),
    #[error("{name}: {found} sensors, where a set has 1 to {MAX_SENSORS}: leave some of them out")]
    Count { name: String, found: usize },
    #[error("{name}: {found} names for {expected} sensors: give each one")]
    Names { name: String, found: usize, expected: usize },
    #[error("{name}: two channels are called {channel:?}: rename one")]
    SameName { name: String, channel: String },
    #[error("{name}: {source}")]
    Wavelengths { name: String, source: GridError },
    #[error("channel {channel:?} of {name}: {found} values for {expected} wavelengths")]
    Length { name: String, channel: String, found: usize, expected: usize },
    #[error(
        "channel {channel:?} of {name}: {value} at {wavelength} nm; write 0 where the sensor sees nothing"
    )]
    NotFinite { name: String, channel: String, wavelength: f64, value: f64 },
    #[error(
        "channel {channel:?} of {name}: it has {:.0} % of its peak at {wavelength} nm, where its table ends, and the grid \
         {grid} goes on: choose a grid within the table, or add the values to the table, 0 where there are none",
        100.0 * share
    )]
    CutOff { name: String, channel: String, share: f64, wavelength: f64, grid: Grid },
    #[error(
        "channel {channel:?} of {name}, measured from {first} to {last} nm, sees nothing on the grid {grid}: leave it out, \
         or choose a model at other wavelengths"
    )]
    Blind { name: String, channel: String, first: f64, last: f64, grid: Grid },
    #[error(
        "channel {channel:?} of {name}: a perfect white has a response of {white:e}, to which none can be relative: ask for \
         absolute responses"
    )]
    White { name: String, channel: String, white: f64 },
    #[error("{name} has no channel {channel:?}; there are {}", known.join(", "))]
    NoChannel { name: String, channel: String, known: Vec<String> },
    #[error(
        "channel {channel:?} of {name} is negative at {wavelength} nm: spectra are scaled to responses that are nowhere \
         negative"
    )]
    Negative { name: String, channel: String, wavelength: f64 },
}

impl From<DatasetError> for SensorError {
    fn from(error: DatasetError) -> SensorError {
        SensorError::Data(error.to_string())
    }
}

fn meant(name: &str) -> String {
    let near =
        closest(name, Sensors::BUILTIN).map_or_else(String::new, |near| format!(", did you mean {near:?}?"));
    format!("{near}; there are {}", Sensors::BUILTIN.join(", "))
}
