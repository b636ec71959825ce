//! Settings of the page, as its scripts hand them over.

use serde::Deserialize;
use spectroll::{Dtype, GridError, Missing, ReadOptions, SpectrumKind, TableLayout, WavelengthUnit};

use crate::refusal::Refusal;

/// Settings of the reader of a dropped file.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct ReadSettings {
    /// Name of the array of spectra, where there are several; empty where it is found out.
    pub(crate) array: String,
    /// Wavelengths of the measurements as start:step:stop, of files that do not say; empty of others.
    pub(crate) measured_at: String,
    /// `columns` or `rows`; empty where it is found out.
    pub(crate) layout: String,
    /// `nm`, `um`, or as the program takes them; empty where the file says.
    pub(crate) unit: String,
    /// The value that means "not measured"; none where it is `None`.
    pub(crate) missing_value: Option<f64>,
    /// Whether the values are percentages.
    pub(crate) percent: bool,
}

/// Settings of a fit.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub(crate) struct FitSettings {
    /// Number of components.
    pub(crate) components: usize,
    /// Kind of the spectra; as the data say where it is `None`.
    pub(crate) kind: Option<SpectrumKind>,
    /// Wavelengths of the model: a grid, `as-measured`, or empty for those of the program.
    pub(crate) wavelengths: String,
    /// `error`, `drop` or `interpolate`.
    pub(crate) missing: String,
}

impl Default for FitSettings {
    fn default() -> Self {
        FitSettings { components: 6, kind: None, wavelengths: String::new(), missing: "error".to_owned() }
    }
}

/// Reads settings.
pub(crate) fn parse<'a, T: Deserialize<'a>>(text: &'a str) -> Result<T, Refusal> {
    serde_json::from_str(text).map_err(|e| Refusal::new(format_args!("the page's settings {text}: {e}")))
}

/// Wavelengths as they are typed.
pub(crate) fn grid(text: &str, control: &'static str) -> Result<spectroll::Grid, Refusal> {
    let refused = |e: GridError| Refusal {
        control: Some(control),
        ..Refusal::new(format_args!("{text:?} are no wavelengths: {e}, as in 400:10:700"))
    };
    text.trim().parse().map_err(refused)
}

impl ReadSettings {
    /// The options of the library's readers.
    pub(crate) fn options(&self) -> Result<ReadOptions, Refusal> {
        let text = |text: &str| Some(text.trim().to_owned()).filter(|text| !text.is_empty());
        let measured = text(&self.measured_at).map(|text| grid(&text, "measured-at")).transpose()?;
        Ok(ReadOptions {
            array: text(&self.array),
            measured_at: measured.map(|grid| grid.wavelengths().collect()),
            layout: match self.layout.as_str() {
                "columns" => Some(TableLayout::Columns),
                "rows" => Some(TableLayout::Rows),
                _ => None,
            },
            unit: unit(&self.unit),
            missing_values: self.missing_value.into_iter().collect(),
            ..ReadOptions::default()
        })
    }

    /// The factor of all values.
    pub(crate) fn scale(&self) -> f64 {
        if self.percent { 0.01 } else { 1.0 }
    }
}

fn unit(name: &str) -> Option<WavelengthUnit> {
    let units = [WavelengthUnit::Nm, WavelengthUnit::Um, WavelengthUnit::Angstrom, WavelengthUnit::PerCm];
    units.into_iter().find(|unit| unit.name() == name)
}

impl FitSettings {
    /// The treatment of spectra that lack a value.
    pub(crate) fn missing(&self) -> Missing {
        match self.missing.as_str() {
            "drop" => Missing::Drop,
            "interpolate" => Missing::Interpolate,
            _ => Missing::Error,
        }
    }
}

/// The type of the numbers in a file, by the name of the program's option.
pub(crate) fn dtype(name: &str) -> Result<Dtype, Refusal> {
    match name {
        "f16" => Ok(Dtype::F16),
        "f32" => Ok(Dtype::F32),
        "f64" => Ok(Dtype::F64),
        _ => Err(Refusal::new(format_args!("{name:?} is no type of numbers: f16, f32 and f64 are"))),
    }
}
