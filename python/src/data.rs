//! Measured spectra.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use spectroll::{Dataset, Table};

use crate::error::{Error, Result};
use crate::model::{Wavelengths, extrapolation, table};

/// Spectra in rows, their wavelengths, what kind they are where the file says it, and their name.
type Read<'py> = (Bound<'py, PyArray2<f64>>, Bound<'py, PyArray1<f64>>, Option<String>, String);

/// Reads the spectra of a file.
#[pyfunction]
pub(crate) fn read<'py>(
    py: Python<'py>,
    path: PathBuf,
    variable: Option<String>,
    wavelengths: Option<Wavelengths>,
) -> PyResult<Read<'py>> {
    let table = py.detach(|| -> Result<Table> {
        let grid = wavelengths.map(|wavelengths| wavelengths.grid()).transpose()?;
        Ok(Table::open_on(&path, variable.as_deref(), grid)?)
    })?;
    // A folder on this machine is nobody else's business, and models keep the name.
    let (full, file) = (path.display().to_string(), path.file_name().unwrap_or_default().to_string_lossy());
    let name = table.name().replace(&format!("{full:?}"), &file);
    let rows: Vec<Vec<f64>> = (0..table.len()).map(|index| table.spectrum(index).to_vec()).collect();
    let spectra = PyArray2::from_vec2(py, &rows).map_err(crate::error::value)?;
    let kind = table.kind().map(|kind| kind.to_string());
    Ok((spectra, PyArray1::from_slice(py, table.wavelengths()), kind, name))
}

/// Spectra in rows at other wavelengths.
#[pyfunction]
pub(crate) fn resample<'py>(
    py: Python<'py>,
    from: (PyReadonlyArray2<'py, f64>, PyReadonlyArray1<'py, f64>, String),
    grid: Wavelengths,
    extrapolate: &str,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let (from, extend) = (table(&from)?, extrapolation(extrapolate)?);
    let data = Dataset::new(&[from], grid.grid()?, extend).map_err(Error::from)?;
    let rows: Vec<Vec<f64>> =
        data.spectra().column_iter().map(|spectrum| spectrum.iter().copied().collect()).collect();
    PyArray2::from_vec2(py, &rows).map_err(|e| crate::error::value(e).into())
}

/// The wavelengths of a grid, in nm.
#[pyfunction]
pub(crate) fn wavelengths(text: &str) -> PyResult<Vec<f64>> {
    Ok(Wavelengths::Text(text.to_owned()).grid().map(|grid| grid.wavelengths().collect())?)
}
