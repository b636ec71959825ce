//! Tables on a grid.

use nalgebra::DMatrix;

use super::{DatasetError, Table};
use crate::grid::{Extrapolation, Grid, Spline};

/// The spectra of `table` on `grid`: a row per band, a column per spectrum.
pub(super) fn resample(
    table: &Table,
    grid: Grid,
    extend: Extrapolation,
) -> Result<DMatrix<f64>, DatasetError> {
    let (first, last) = (table.wavelengths()[0], table.wavelengths()[table.wavelengths().len() - 1]);
    if extend == Extrapolation::Error && (grid.first() < first || grid.last() > last) {
        return Err(DatasetError::Range { name: table.name().to_owned(), first, last, grid });
    }
    let mut columns = DMatrix::zeros(grid.len(), table.len());
    for (j, mut column) in columns.column_iter_mut().enumerate() {
        let spline = Spline::new(table.wavelengths(), table.spectrum(j));
        for (value, wavelength) in column.iter_mut().zip(grid.wavelengths()) {
            *value = spline.at(wavelength, extend);
            if value.is_nan() {
                let (name, spectrum) = (table.name().to_owned(), j + 1);
                return Err(DatasetError::Missing { name, spectrum, wavelength });
            }
            if !value.is_finite() {
                let (name, value) = (table.name().to_owned(), *value);
                return Err(DatasetError::NotFinite { name, spectrum: j + 1, wavelength, value });
            }
        }
    }
    Ok(columns)
}
