//! HDF5 files, and those of MATLAB v7.3, which are HDF5: every numeric matrix in them, as MATLAB would see it.
//!
//! HDF5's first dimension is MATLAB's last. So spectra in rows, which is how NumPy's users have them, are in columns
//! here, and from here on all is as in older files of MATLAB's.

use std::path::Path;

use rust_hdf5::{H5File, Hdf5Error};

use super::matrix::Matrix;
use super::{DatasetError, MAX_BYTES};

pub(super) fn matrices(path: &Path) -> Result<Vec<Matrix>, DatasetError> {
    let failed = |e: Hdf5Error| DatasetError::Hdf5 { path: path.to_owned(), reason: e.to_string() };
    let file = H5File::options().no_locking().open(path).map_err(failed)?;
    let mut matrices: Vec<Matrix> = Vec::new();
    let mut left = MAX_BYTES as usize / size_of::<f64>();
    for name in file.dataset_names() {
        let set = file.dataset(&name).map_err(failed)?;
        let (columns, rows) = match *set.shape() {
            [length] => (1, length),
            [columns, rows] => (columns, rows),
            _ => continue,
        };
        let Some(count) = columns.checked_mul(rows).filter(|count| *count <= left) else {
            return Err(DatasetError::TooLarge { path: path.to_owned() });
        };
        // What is no number is somebody else's.
        let Ok(values) = set.read_numeric_as::<f64>() else { continue };
        left -= count;
        let matrix = Matrix { name: name.trim_start_matches('/').to_owned(), rows, columns, values };
        // One matrix may have two names.
        if !matrices.iter().any(|m| m.rows == rows && m.columns == columns && m.values == matrix.values) {
            matrices.push(matrix);
        }
    }
    Ok(matrices)
}
