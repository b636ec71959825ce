//! Sensors: functions of wavelength that turn light into a response each, as those of cones, cameras and satellites.
//!
//! A response is linear in the spectrum: the sum over bands of the light times the sensor's function, times the width of
//! the bands. So it is one more map of a draw's standard normals, folded once (see `program`).

mod error;

use std::path::Path;

use serde::{Deserialize, Serialize};

pub use error::SensorError;

use crate::dataset::{BuiltinTable, Dataset, Table};
use crate::grid::{Extrapolation, Grid, Spline, check_increasing};

/// The most sensors of a set.
pub const MAX_SENSORS: usize = 64;

/// The largest share of its peak that a sensor of a file may have at the end of its table, where a grid goes beyond: it
/// counts as 0 there.
const NEGLIGIBLE: f64 = 0.01;

/// Set of sensors: 1 to 64 functions of wavelength, each with a name.
///
/// ```
/// use spectroll::Sensors;
///
/// let cones = Sensors::builtin("ss2").expect("it is built in");
/// assert_eq!(cones.channels(), ["L", "M", "S"]);
/// let camera = Sensors::new("camera", ["R", "G"], &[400.0, 550.0, 700.0], &[vec![0.0, 0.2, 0.0], vec![0.0, 0.9, 0.0]])?;
/// assert_eq!(camera.on_grid(&"400:50:700".parse()?)?.len(), 2);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "SensorsRecord", into = "SensorsRecord")]
pub struct Sensors {
    name: String,
    channels: Vec<String>,
    wavelengths: Vec<f64>,
    /// A function for each channel, with a value for each wavelength.
    functions: Vec<Vec<f64>>,
}

/// Scale of responses.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum ResponseScale {
    /// Relative to a perfect white: each channel is 1 for a reflectance of 1 in every band. For reflectances alone.
    #[default]
    White,
    /// Integrals: sums of power x sensitivity x step in nm, in the units of the light and the sensors.
    Absolute,
}

/// A set as it is written down: a built-in one by its name, any other with its functions.
#[derive(Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
enum SensorsRecord {
    Builtin(String),
    Own { name: String, channels: Vec<String>, wavelengths: Vec<f64>, functions: Vec<Vec<f64>> },
}

impl From<Sensors> for SensorsRecord {
    fn from(sensors: Sensors) -> SensorsRecord {
        if Sensors::builtin(&sensors.name).as_ref() == Some(&sensors) {
            return SensorsRecord::Builtin(sensors.name);
        }
        let Sensors { name, channels, wavelengths, functions } = sensors;
        SensorsRecord::Own { name, channels, wavelengths, functions }
    }
}

impl TryFrom<SensorsRecord> for Sensors {
    type Error = SensorError;

    fn try_from(record: SensorsRecord) -> Result<Sensors, SensorError> {
        match record {
            SensorsRecord::Builtin(name) => Sensors::builtin(&name).ok_or(SensorError::Unknown(name)),
            SensorsRecord::Own { name, channels, wavelengths, functions } => {
                Sensors::new(&name, channels, &wavelengths, &functions)
            }
        }
    }
}

impl Sensors {
    /// Names of the built-in sets: the standard observers `cie1931` and `cie1964`, the cone fundamentals of Stockman &
    /// Sharpe for 2 and 10 degrees and those of Smith & Pokorny, rods and melanopsin.
    pub const BUILTIN: [&str; 7] =
        ["cie1931", "cie1964", "ss2", "ss10", "smith-pokorny", "rods", "melanopsin"];

    /// The built-in set of a [name](Self::BUILTIN). Its functions are in energy units, each 1 at its largest but for those
    /// of the observers, and 0 outside their tables.
    pub fn builtin(name: &str) -> Option<Sensors> {
        let (table, channels): (_, &[&str]) = match name {
            "cie1931" => (BuiltinTable::Xyz1931, &["X", "Y", "Z"]),
            "cie1964" => (BuiltinTable::Xyz1964, &["X", "Y", "Z"]),
            "ss2" => (BuiltinTable::ConesSs2, &["L", "M", "S"]),
            "ss10" => (BuiltinTable::ConesSs10, &["L", "M", "S"]),
            "smith-pokorny" => (BuiltinTable::ConesSmithPokorny, &["L", "M", "S"]),
            "rods" => (BuiltinTable::Rods, &["rod"]),
            "melanopsin" => (BuiltinTable::Melanopsin, &["melanopsin"]),
            _ => return None,
        };
        let table = table.table();
        let functions: Vec<_> = (0..table.len()).map(|channel| table.spectrum(channel).to_vec()).collect();
        let channels = channels.iter().copied();
        Some(
            Sensors::new(name, channels, table.wavelengths(), &functions)
                .expect("compiled-in tables are sets"),
        )
    }

    /// Makes a set of functions, each with a value for each of the wavelengths (nm, increasing). A name for each channel;
    /// all different.
    pub fn new(
        name: &str,
        channels: impl IntoIterator<Item = impl Into<String>>,
        wavelengths: &[f64],
        functions: &[Vec<f64>],
    ) -> Result<Sensors, SensorError> {
        let name = name.to_owned();
        let channels: Vec<String> = channels.into_iter().map(Into::into).collect();
        if !(1..=MAX_SENSORS).contains(&functions.len()) {
            return Err(SensorError::Count { name, found: functions.len() });
        }
        if channels.len() != functions.len() {
            return Err(SensorError::Names { name, found: channels.len(), expected: functions.len() });
        }
        if let Some(again) = (1..channels.len()).find(|&i| channels[..i].contains(&channels[i])) {
            return Err(SensorError::SameName { name, channel: channels[again].clone() });
        }
        check_increasing(wavelengths)
            .map_err(|source| SensorError::Wavelengths { name: name.clone(), source })?;
        for (channel, function) in channels.iter().zip(functions) {
            if function.len() != wavelengths.len() {
                let (found, expected, channel) = (function.len(), wavelengths.len(), channel.clone());
                return Err(SensorError::Length { name, channel, found, expected });
            }
            if let Some(at) = function.iter().position(|value| !value.is_finite()) {
                let (wavelength, value, channel) = (wavelengths[at], function[at], channel.clone());
                return Err(SensorError::NotFinite { name, channel, wavelength, value });
            }
        }
        Ok(Sensors { name, channels, wavelengths: wavelengths.to_vec(), functions: functions.to_vec() })
    }

    /// Makes a set of the spectra of a table, with the names that they have there, or their numbers from 1.
    pub fn from_table(name: &str, table: &Table) -> Result<Sensors, SensorError> {
        let functions: Vec<_> = (0..table.len()).map(|channel| table.spectrum(channel).to_vec()).collect();
        let named = |channel: usize| table.names().get(channel).filter(|name| !name.is_empty()).cloned();
        let channels = (0..table.len()).map(|channel| named(channel).unwrap_or((channel + 1).to_string()));
        Sensors::new(name, channels, table.wavelengths(), &functions)
    }

    /// Reads a set from a file, in any format that measured spectra have: a spectrum is a channel. The set has the name of
    /// the file, without its folder.
    pub fn open(path: impl AsRef<Path>) -> Result<Sensors, SensorError> {
        let path = path.as_ref();
        let name = path.file_name().unwrap_or_default().to_string_lossy();
        Sensors::from_table(&name, &Table::open(path, None)?)
    }

    /// Name of the set.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Names of the channels, in order.
    pub fn channels(&self) -> &[String] {
        &self.channels
    }

    /// Number of channels.
    #[allow(clippy::len_without_is_empty)] // a set is never empty
    pub fn len(&self) -> usize {
        self.channels.len()
    }

    /// The function of each channel on a grid. Functions of built-in sets are 0 outside their tables; those of others are
    /// where they have come down to 1 % of their peak at the end, and an error elsewhere. Functions finer than the grid
    /// are averaged over its bands, as measured lights are. One that is nowhere negative stays so.
    pub fn on_grid(&self, grid: &Grid) -> Result<Vec<Vec<f64>>, SensorError> {
        let is_builtin = Sensors::BUILTIN.contains(&self.name.as_str());
        let first = self.wavelengths[0];
        let last = self.wavelengths[self.wavelengths.len() - 1];
        let mut on_grid = match is_builtin {
            // As the observers' functions come to a grid elsewhere.
            true => {
                let spline = |function: &Vec<f64>| {
                    let spline = Spline::new(&self.wavelengths, function);
                    grid.wavelengths().map(|w| spline.at(w, Extrapolation::Zero)).collect::<Vec<_>>()
                };
                self.functions.iter().map(spline).collect::<Vec<_>>()
            }
            false => {
                self.check_ends(grid)?;
                let table = Table::new(&self.name, self.wavelengths.clone(), &self.functions)?;
                let data = Dataset::unjudged(&[table], grid.clone(), Extrapolation::Zero)?;
                data.spectra().column_iter().map(|column| column.iter().copied().collect()).collect()
            }
        };
        for ((channel, function), values) in self.channels.iter().zip(&self.functions).zip(&mut on_grid) {
            if function.iter().all(|value| *value >= 0.0) {
                // Between measured values a spline may dip below 0.
                values.iter_mut().for_each(|value| *value = value.max(0.0));
            }
            if values.iter().all(|value| *value == 0.0) {
                let (name, channel) = (self.name.clone(), channel.clone());
                return Err(SensorError::Blind { name, channel, first, last, grid: grid.clone() });
            }
        }
        Ok(on_grid)
    }

    /// Checks that functions have come down where their table ends within the grid.
    fn check_ends(&self, grid: &Grid) -> Result<(), SensorError> {
        let last = self.wavelengths.len() - 1;
        let ends = [(0, grid.first() < self.wavelengths[0]), (last, grid.last() > self.wavelengths[last])];
        for (end, _) in ends.into_iter().filter(|(_, is_within)| *is_within) {
            for (channel, function) in self.channels.iter().zip(&self.functions) {
                let peak = function.iter().fold(0.0, |a: f64, value| a.max(value.abs()));
                if function[end].abs() > NEGLIGIBLE * peak {
                    return Err(SensorError::CutOff {
                        name: self.name.clone(),
                        channel: channel.clone(),
                        share: function[end] / peak,
                        wavelength: self.wavelengths[end],
                        grid: grid.clone(),
                    });
                }
            }
        }
        Ok(())
    }

    /// Weights of the bands in each channel's response to a light.
    pub(crate) fn emitted_weights(&self, grid: &Grid) -> Result<Vec<Vec<f64>>, SensorError> {
        self.reflected_weights(&vec![1.0; grid.len()], grid, ResponseScale::Absolute)
    }

    /// Weights of the bands in each channel's response to a reflectance under `light`, its power in each band.
    pub(crate) fn reflected_weights(
        &self,
        light: &[f64],
        grid: &Grid,
        scale: ResponseScale,
    ) -> Result<Vec<Vec<f64>>, SensorError> {
        let widths = grid.widths();
        let mut weights = self.on_grid(grid)?;
        for (channel, weights) in self.channels.iter().zip(&mut weights) {
            let factors = light.iter().zip(&widths);
            weights.iter_mut().zip(factors).for_each(|(weight, (light, width))| *weight *= light * width);
            if scale == ResponseScale::White {
                let (white, size) =
                    weights.iter().fold((0.0, 0.0), |(sum, size), w| (sum + w, size + w.abs()));
                // Of what is positive in part and negative in part little may be left.
                if white <= 1e-6 * size {
                    let (name, channel) = (self.name.clone(), channel.clone());
                    return Err(SensorError::White { name, channel, white });
                }
                weights.iter_mut().for_each(|weight| *weight /= white);
            }
        }
        Ok(weights)
    }

    /// The number of a channel by its name.
    pub(crate) fn channel(&self, name: &str) -> Result<usize, SensorError> {
        self.channels.iter().position(|channel| channel == name).ok_or_else(|| SensorError::NoChannel {
            name: self.name.clone(),
            channel: name.to_owned(),
            known: self.channels.clone(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colorimetry::{Observer, d65};

    fn camera() -> Sensors {
        let red = vec![0.0, 0.1, 1.0, 0.3];
        Sensors::new("camera.csv", ["R"], &[400.0, 500.0, 600.0, 700.0], &[red]).unwrap()
    }

    #[test]
    fn built_in_sets_have_their_channels_and_peaks() {
        for name in Sensors::BUILTIN {
            let sensors = Sensors::builtin(name).unwrap();
            assert_eq!(sensors.name(), name);
            let peaks = sensors.functions.iter().map(|f| f.iter().fold(0.0, |a: f64, v| a.max(*v)));
            for (channel, peak) in sensors.channels().iter().zip(peaks) {
                let is_observer = name.starts_with("cie");
                assert!(is_observer || (peak - 1.0).abs() < 0.003, "{name} {channel} {peak}");
            }
        }
        assert_eq!(Sensors::builtin("ss1"), None);
    }

    /// The weights are those by which tristimulus values are summed.
    #[test]
    fn the_observer_is_a_set_of_sensors() {
        let grid = &"400:10:700".parse().unwrap();
        for (name, observer) in [("cie1931", Observer::Cie1931), ("cie1964", Observer::Cie1964)] {
            let sensors = Sensors::builtin(name).unwrap();
            let weights = sensors.reflected_weights(&d65(grid), grid, ResponseScale::White).unwrap();
            let xyz = observer.xyz_weights_under(&d65(grid), grid).unwrap();
            for (own, [x, y]) in weights[1].iter().zip(xyz[1].iter().map(|y| [*y, *y])) {
                assert!((own - x).abs() < 1e-15 && (own - y).abs() < 1e-15);
            }
            assert!((weights[0].iter().sum::<f64>() - 1.0).abs() < 1e-14);
            let emitted = sensors.emitted_weights(grid).unwrap();
            let expected = observer.emitted_xyz_weights(grid);
            assert!(emitted.iter().zip(&expected).all(|(a, b)| a == b));
        }
    }

    #[test]
    fn sets_are_written_by_name_or_whole() {
        let text = |sensors: &Sensors| serde_json::to_string(sensors).unwrap();
        let cones = Sensors::builtin("ss10").unwrap();
        assert_eq!(text(&cones), "\"ss10\"");
        for sensors in [cones, camera()] {
            assert_eq!(serde_json::from_str::<Sensors>(&text(&sensors)).unwrap(), sensors);
        }
        // A set that only has the name of a built-in one is not it.
        let other = Sensors { name: "rods".to_owned(), ..camera() };
        assert!(text(&other).starts_with("{\"name\":\"rods\""));
        let error = serde_json::from_str::<Sensors>("\"ss3\"").unwrap_err().to_string();
        assert!(error.contains("\"ss3\" is no built-in set of sensors, did you mean \"ss2\"?"), "{error}");
    }

    #[test]
    fn channels_without_names_are_numbered() {
        let table = Table::new("t", vec![400.0, 500.0], &[vec![0.0, 1.0], vec![1.0, 0.0]]).unwrap();
        assert_eq!(Sensors::from_table("s", &table).unwrap().channels(), ["1", "2"]);
    }

    #[test]
    fn functions_that_cannot_be_sensors_are_refused() {
        let grid = |text: &str| text.parse::<Grid>().unwrap();
        let make = |channels: &[&str], wavelengths: &[f64], functions: &[Vec<f64>]| {
            Sensors::new("s", channels.iter().copied(), wavelengths, functions).unwrap_err().to_string()
        };
        for (error, message) in [
            (make(&[], &[400.0], &[]), "s: 0 sensors, where a set has 1 to 64"),
            (make(&["a"], &[400.0], &[vec![1.0], vec![1.0]]), "s: 1 names for 2 sensors"),
            (make(&["a", "a"], &[400.0], &[vec![1.0], vec![1.0]]), "s: two channels are called \"a\""),
            (make(&["a"], &[400.0, 390.0], &[vec![1.0; 2]]), "wavelengths must increase"),
            (make(&["a"], &[400.0], &[vec![1.0; 2]]), "channel \"a\" of s: 2 values for 1 wavelengths"),
            (make(&["a"], &[400.0], &[vec![f64::NAN]]), "channel \"a\" of s: NaN at 400 nm"),
        ] {
            assert!(error.contains(message), "{error}");
        }
        let refused = |sensors: &Sensors, text: &str| sensors.on_grid(&grid(text)).unwrap_err().to_string();
        let error = refused(&camera(), "400:10:720");
        assert!(
            error.contains("\"R\" of camera.csv: it has 30 % of its peak at 700 nm, where its table ends"),
            "{error}"
        );
        assert!(camera().on_grid(&grid("380:10:700")).is_ok());
        let flat = Sensors::new("s", ["a"], &[400.0, 500.0], &[vec![2.0; 2]]).unwrap();
        assert!(flat.on_grid(&grid("410:10:490")).is_ok());
        for (text, end) in [("390:10:490", "at 400 nm"), ("410:10:510", "at 500 nm")] {
            let error = refused(&flat, text);
            assert!(error.contains("100 % of its peak") && error.contains(end), "{error}");
        }
        let error = refused(&Sensors::builtin("melanopsin").unwrap(), "900:10:1000");
        assert!(error.contains("sees nothing on the grid 900:10:1000"), "{error}");
        let opponent = Sensors::new("s", ["rg"], &[400.0, 500.0], &[vec![1.0, -1.0]]).unwrap();
        let weights = opponent.reflected_weights(&[1.0; 2], &grid("400:100:500"), ResponseScale::White);
        assert!(weights.unwrap_err().to_string().contains("a perfect white has a response of"));
        // A response of 1 is little where its parts are a thousand million.
        let loud = Sensors::new("s", ["rg"], &[400.0, 500.0], &[vec![1e9, 1.0 - 1e9]]).unwrap();
        let weights = loud.reflected_weights(&[1.0; 2], &grid("400:100:500"), ResponseScale::White);
        assert!(weights.is_err());
        assert!(camera().channel("G").unwrap_err().to_string().contains("has no channel \"G\"; there are R"));
    }
}
