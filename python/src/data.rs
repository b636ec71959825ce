//! Measured spectra.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use spectroll::{
    BuiltinTable, Dataset, Decimal, Extrapolation, Missing, ReadOptions, Reading, ResampleMethod, Resampling,
    Separator, Table, TableLayout, WavelengthUnit,
};

use crate::error::{Error, Result, value};
use crate::model::{Wavelengths, choice, table};

/// Settings of a reader, as they are written in Python.
#[derive(FromPyObject)]
pub(crate) struct Settings {
    #[pyo3(item)]
    variable: Option<String>,
    #[pyo3(item)]
    wavelength_variable: Option<String>,
    #[pyo3(item)]
    wavelengths: Option<Wavelengths>,
    #[pyo3(item)]
    layout: Option<String>,
    #[pyo3(item)]
    unit: Option<String>,
    #[pyo3(item)]
    separator: Option<String>,
    #[pyo3(item)]
    decimal: Option<String>,
    #[pyo3(item)]
    skip: usize,
    #[pyo3(item)]
    missing_values: Vec<f64>,
    #[pyo3(item)]
    scale: f64,
}

impl Settings {
    fn options(&self) -> Result<ReadOptions> {
        let wavelengths = self.wavelengths.as_ref().map(Wavelengths::grid).transpose()?;
        Ok(ReadOptions {
            array: self.variable.clone(),
            wavelength_array: self.wavelength_variable.clone(),
            fallback: wavelengths.map(|grid| grid.wavelengths().collect()),
            layout: self.layout.as_deref().map(layout).transpose()?,
            unit: self.unit.as_deref().map(unit).transpose()?,
            separator: self.separator.as_deref().map(separator).transpose()?,
            decimal: self.decimal.as_deref().map(decimal).transpose()?,
            skip: self.skip,
            missing_values: self.missing_values.clone(),
            ..ReadOptions::default()
        })
    }

    fn scale(&self) -> Result<f64> {
        match self.scale.is_finite() && self.scale > 0.0 {
            true => Ok(self.scale),
            false => Err(value(format!("scale={}: it is a number above 0", self.scale))),
        }
    }
}

fn layout(name: &str) -> Result<TableLayout> {
    choice("layout", name, &[("columns", TableLayout::Columns), ("rows", TableLayout::Rows)])
}

fn unit(name: &str) -> Result<WavelengthUnit> {
    use WavelengthUnit::{Angstrom, Nm, PerCm, Um};
    choice("unit", name, &[Nm, Um, Angstrom, PerCm].map(|unit| (unit.name(), unit)))
}

fn separator(name: &str) -> Result<Separator> {
    use Separator::{Bar, Comma, Semicolon, Space, Tab};
    choice("separator", name, &[(",", Comma), (";", Semicolon), ("\t", Tab), ("|", Bar), (" ", Space)])
}

fn decimal(name: &str) -> Result<Decimal> {
    choice("decimal", name, &[(".", Decimal::Point), (",", Decimal::Comma)])
}

/// How measured spectra are brought to other wavelengths.
#[derive(FromPyObject)]
pub(crate) struct Onto {
    #[pyo3(item)]
    extrapolate: String,
    #[pyo3(item)]
    resample: String,
    #[pyo3(item)]
    missing: String,
}

impl Onto {
    pub(crate) fn resampling(&self) -> Result<Resampling> {
        let extrapolations =
            [("error", Extrapolation::Error), ("hold", Extrapolation::Hold), ("zero", Extrapolation::Zero)];
        let methods = [
            ("auto", ResampleMethod::Auto),
            ("interpolate", ResampleMethod::Interpolate),
            ("average", ResampleMethod::Average),
        ];
        let ways =
            [("error", Missing::Error), ("drop", Missing::Drop), ("interpolate", Missing::Interpolate)];
        Ok(Resampling::default()
            .extrapolation(choice("extrapolate", &self.extrapolate, &extrapolations)?)
            .method(choice("resample", &self.resample, &methods)?)
            .missing(choice("missing", &self.missing, &ways)?))
    }
}

/// Spectra in rows, their wavelengths, what kind they are where the file says it, their name, and what was done to them.
type Read<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Option<String>, String, Vec<String>);

/// Reads the spectra of a file, or of a table that is built in.
#[pyfunction]
pub(crate) fn read<'py>(py: Python<'py>, path: PathBuf, settings: Settings) -> PyResult<Read<'py>> {
    let Reading { table, notes, .. } = py.detach(|| -> Result<Reading> {
        let (options, scale) = (settings.options()?, settings.scale()?);
        let builtin = path.to_str().filter(|_| !path.exists()).and_then(BuiltinTable::named);
        let mut reading = match builtin {
            Some(builtin) => Reading::builtin(builtin),
            None => Table::read(&path, &options)?,
        };
        reading.table = reading.table.scaled(scale);
        Ok(reading)
    })?;
    // A folder on this machine is nobody else's business, and models keep the name.
    let (full, file) = (path.display().to_string(), path.file_name().unwrap_or_default().to_string_lossy());
    let name = table.name().replace(&format!("{full:?}"), &file);
    let kind = table.kind().map(|kind| kind.to_string());
    let wavelengths = PyArray1::from_slice(py, table.wavelengths());
    let shape = [table.len(), table.wavelengths().len()];
    // The array takes over the memory of the table.
    let spectra = PyArray1::from_vec(py, table.into_values()).reshape(shape)?;
    Ok((spectra, wavelengths, kind, name, notes))
}

/// Spectra in rows at other wavelengths, and what was done to bring them there.
#[pyfunction]
pub(crate) fn resample<'py>(
    py: Python<'py>,
    from: (PyReadonlyArray2<'py, f64>, PyReadonlyArray1<'py, f64>, String),
    grid: Wavelengths,
    onto: Onto,
) -> PyResult<(Bound<'py, PyArray2<f64>>, Vec<String>)> {
    let (from, resampling) = (table(&from)?, onto.resampling()?);
    let data = Dataset::new(&[from], grid.grid()?, resampling).map_err(Error::from)?;
    let rows: Vec<Vec<f64>> =
        data.spectra().column_iter().map(|spectrum| spectrum.iter().copied().collect()).collect();
    Ok((PyArray2::from_vec2(py, &rows).map_err(value)?, data.notes().to_vec()))
}

/// The wavelengths of a grid, in nm.
#[pyfunction]
pub(crate) fn wavelengths(text: &str) -> PyResult<Vec<f64>> {
    Ok(Wavelengths::Text(text.to_owned()).grid().map(|grid| grid.wavelengths().collect())?)
}

/// The names of the tables that are built in.
pub(crate) fn builtin_tables() -> Vec<&'static str> {
    BuiltinTable::ALL.iter().map(|table| table.name()).collect()
}
