//! Sensors and illuminants, as the settings of recipes have them: JSON.

use std::path::PathBuf;

use pyo3::prelude::*;

use spectroll::{Illuminant, SensorError, Sensors, Table};

use crate::error::{Result, value};

/// The set of a name: a built-in one, or that of a file.
#[pyfunction]
pub(crate) fn sensors(py: Python<'_>, name: PathBuf) -> PyResult<String> {
    Ok(py.detach(|| -> Result<String> {
        let text = name.to_string_lossy();
        if let Some(builtin) = Sensors::builtin(&text) {
            return json(&builtin);
        }
        // What is no path was meant as the name of a built-in set.
        if name.components().count() == 1 && name.extension().is_none() && !name.exists() {
            return Err(value(format!(
                "{}; or name a file of them",
                SensorError::Unknown(text.into_owned())
            )));
        }
        let table = Table::open(&name, None)?;
        let file = name.file_name().unwrap_or_default().to_string_lossy();
        json(&Sensors::from_table(&file, &table)?)
    })?)
}

/// A set of functions, checked.
#[pyfunction]
pub(crate) fn sensors_of(text: &str) -> PyResult<String> {
    Ok(json(&serde_json::from_str::<Sensors>(text).map_err(value)?)?)
}

/// The illuminant of a name or of a temperature.
#[pyfunction]
pub(crate) fn illuminant(name: &str) -> PyResult<String> {
    let found = Illuminant::named(name).map_err(|error| value(format!("illuminant={error}")))?;
    Ok(serde_json::to_string(&found).map_err(value)?)
}

fn json(sensors: &Sensors) -> Result<String> {
    serde_json::to_string(sensors).map_err(value)
}
