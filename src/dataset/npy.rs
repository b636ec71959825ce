//! NumPy arrays of spectra in rows. The file holds no wavelengths; the caller knows them.

use std::path::Path;

use half::f16;
use nalgebra::DMatrix;
use npyz::{NpyFile, Order};

use super::{DatasetError, Table};
use crate::grid::Grid;

pub(super) fn read(path: &Path, bytes: &[u8], grid: Option<Grid>) -> Result<Table, DatasetError> {
    let failed = |reason: String| DatasetError::Npy { path: path.to_owned(), reason };
    let file = NpyFile::new(bytes).map_err(|e| failed(e.to_string()))?;
    let grid = grid.ok_or_else(|| DatasetError::NoWavelengths { path: path.to_owned() })?;
    let &[rows, bands] = file.shape() else {
        return Err(failed(format!("expected (spectra, bands), found the shape {:?}", file.shape())));
    };
    if bands != grid.len() as u64 {
        return Err(failed(format!("spectra of {bands} bands do not lie on the {} of {grid}", grid.len())));
    }
    let (dtype, order) = (file.dtype().descr(), file.order());
    let values = file
        .try_data::<f64>()
        .map(Iterator::collect)
        .or_else(|file| file.try_data::<f32>().map(|data| data.map(|v| v.map(f64::from)).collect()))
        .or_else(|file| file.try_data::<f16>().map(|data| data.map(|v| v.map(f64::from)).collect()))
        .map_err(|_| failed(format!("expected floats, found {dtype}")))?;
    let values: Vec<f64> = Result::map_err(values, |e: std::io::Error| failed(e.to_string()))?;
    let (rows, bands) = (rows as usize, bands as usize);
    if values.len() != rows * bands {
        return Err(failed("it ends in the middle of a spectrum; copy it again".to_owned()));
    }
    let spectra = match order {
        Order::C => DMatrix::from_vec(bands, rows, values),
        Order::Fortran => DMatrix::from_vec(rows, bands, values).transpose(),
    };
    Table::from_columns(&format!("{path:?}"), grid.wavelengths().collect(), spectra)
}
