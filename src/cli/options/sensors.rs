//! Sensors, illuminants and targets as they are typed: names, and files of measurements.

use std::path::Path;

use spectroll::{
    Dataset, Extrapolation, Grid, Illuminant, Lrv, ReadOptions, Reading, ResponseTarget, SensorError, Sensors,
};

use super::data::read;
use super::recipe::range;
use crate::cli::exit::Usage;

/// Illuminant by its name or its temperature, or the file of one.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::cli) enum IlluminantSource {
    Named(Illuminant),
    File(String),
}

/// Illuminant of a text: a name, a temperature as in 5600K, or a file.
pub(in crate::cli) fn illuminant(text: &str) -> Result<IlluminantSource, String> {
    match Illuminant::named(text) {
        Ok(illuminant) => Ok(IlluminantSource::Named(illuminant)),
        Err(_) if looks_like_a_file(text) => Ok(IlluminantSource::File(text.to_owned())),
        Err(error) => Err(format!("{error}; or name a file of its power")),
    }
}

impl IlluminantSource {
    /// The illuminant on a grid.
    pub(in crate::cli) fn on(&self, grid: &Grid) -> anyhow::Result<Illuminant> {
        let name = match self {
            IlluminantSource::Named(illuminant) => return Ok(illuminant.clone()),
            IlluminantSource::File(name) => name,
        };
        let Reading { table, .. } = read(name, Some(grid), ReadOptions::default())?;
        if table.len() != 1 {
            let found = table.len();
            let text = format!("--illuminant {name}: it holds {found} spectra, and an illuminant is one");
            return Err(Usage(text).into());
        }
        let mut values = table.wavelengths().iter().zip(table.spectrum(0));
        if let Some((wavelength, power)) = values.find(|(_, power)| **power < 0.0) {
            let text = format!(
                "--illuminant {name}: its power at {wavelength} nm is {power}, and that of a light is never negative"
            );
            return Err(Usage(text).into());
        }
        let data = Dataset::new(&[table], grid.clone(), Extrapolation::Error)?;
        // A spline between zeros and a peak may dip below 0, which no light does.
        Ok(Illuminant::Power(data.spectra().column(0).iter().map(|power| power.max(0.0)).collect()))
    }
}

/// Set of sensors of a name, or of a file.
pub(in crate::cli) fn sensors(name: &str, grid: &Grid) -> anyhow::Result<Sensors> {
    if let Some(builtin) = Sensors::builtin(name) {
        return Ok(builtin);
    }
    if !looks_like_a_file(name) {
        let unknown = SensorError::Unknown(name.to_owned());
        return Err(Usage(format!("{unknown}; or name a file of them")).into());
    }
    let Reading { table, .. } = read(name, Some(grid), ReadOptions::default())?;
    let file = Path::new(name).file_name().unwrap_or_default().to_string_lossy();
    Ok(Sensors::from_table(&file, &table)?)
}

/// Target response as it is typed: SET.CHANNEL=Y, or =LOW..HIGH.
#[derive(Clone, Debug, PartialEq)]
pub(in crate::cli) struct TargetSource {
    /// Everything before the equals sign.
    sensor: String,
    response: Lrv,
}

/// Target of a text, as in `ss2.L=0.3`.
pub(in crate::cli) fn target(text: &str) -> Result<TargetSource, String> {
    let example = "expected SET.CHANNEL=Y or SET.CHANNEL=LOW..HIGH, as in ss2.L=0.3";
    let (sensor, response) = text.rsplit_once('=').ok_or(example)?;
    match sensor.split_once('.') {
        Some((set, channel)) if !set.is_empty() && !channel.is_empty() => {}
        _ => return Err(example.to_owned()),
    }
    Ok(TargetSource { sensor: sensor.trim().to_owned(), response: range("--target", response)? })
}

impl TargetSource {
    /// The target, with its sensors read.
    pub(in crate::cli) fn resolve(&self, grid: &Grid) -> anyhow::Result<ResponseTarget> {
        // Names of files and of channels may have dots: the set is the shortest that there is.
        let dots = self.sensor.match_indices('.').map(|(at, _)| at);
        let split = |at: usize| (&self.sensor[..at], &self.sensor[at + 1..]);
        let is_set = |name: &str| Sensors::BUILTIN.contains(&name) || Path::new(name).is_file();
        let found = dots.clone().map(split).find(|(set, _)| is_set(set));
        let (set, channel) = found.or(dots.map(split).next_back()).expect("there is a dot");
        Ok(ResponseTarget::new(sensors(set, grid)?, channel, self.response))
    }
}

/// Whether a text that is no known name may be the name of a file.
pub(in crate::cli) fn looks_like_a_file(text: &str) -> bool {
    Path::new(text).exists() || text.contains(['.', '/', '\\', ':', '@'])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn illuminants_are_names_temperatures_and_files() {
        assert_eq!(illuminant("F11"), Ok(IlluminantSource::Named(Illuminant::F11)));
        assert_eq!(illuminant("5600K"), Ok(IlluminantSource::Named(Illuminant::Daylight(5600.0))));
        assert_eq!(illuminant("lamp.csv"), Ok(IlluminantSource::File("lamp.csv".to_owned())));
        for (text, message) in [("d60", "there are d65, d50"), ("3000K", "from 4000 to 25000 K")] {
            let error = illuminant(text).unwrap_err();
            assert!(error.contains(message) && error.ends_with("or name a file of its power"), "{error}");
        }
    }

    #[test]
    fn targets_are_a_sensor_and_a_response() {
        let grid = Grid::DEFAULT;
        let found = target("ss2.L=0.2..0.6").unwrap().resolve(&grid).unwrap();
        assert_eq!(found, ResponseTarget::new(Sensors::builtin("ss2").unwrap(), "L", 0.2..0.6));
        for text in ["ss2.L", "ss2=0.3", ".L=0.3", "ss2.=0.3"] {
            assert!(target(text).unwrap_err().starts_with("expected SET.CHANNEL=Y"), "{text}");
        }
        assert!(
            target("ss2.L=40")
                .unwrap_err()
                .contains("--target is a fraction between 0 and 1; did you mean 0.4?")
        );
        let error = target("ss3.L=0.3").unwrap().resolve(&grid).unwrap_err().to_string();
        assert!(error.contains("\"ss3\" is no built-in set of sensors, did you mean \"ss2\"?"), "{error}");
    }

    #[test]
    fn the_file_of_a_set_may_have_dots() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("my.camera.csv");
        std::fs::write(&path, "nm,R.1,G\n400,0,0\n500,0.2,1\n600,1,0.3\n700,0,0\n").unwrap();
        let text = format!("{}.R.1=0.3", path.display());
        let found = target(&text).unwrap().resolve(&Grid::DEFAULT).unwrap();
        assert_eq!((found.sensors.name(), found.channel.as_str()), ("my.camera.csv", "R.1"));
        assert_eq!(found.sensors.channels(), ["R.1", "G"]);
    }
}
