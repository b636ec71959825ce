//! HDF5 files, and those of MATLAB v7.3, which are HDF5: every numeric matrix in them, as MATLAB would see it.
//!
//! HDF5's first dimension is MATLAB's last. So spectra in rows, which is how NumPy's users have them, are in columns
//! here, and from here on all is as in older files of MATLAB's. Of more than two dimensions, those but the last count as
//! one.

use std::path::Path;

use rust_hdf5::{H5File, Hdf5Error};

use super::matrix::{self, Matrices, Matrix};
use super::{DatasetError, MAX_BYTES};

pub(super) fn matrices(path: &Path) -> Result<Matrices, DatasetError> {
    let failed = |e: Hdf5Error| DatasetError::Hdf5 { path: path.to_owned(), reason: e.to_string() };
    let file = H5File::options().no_locking().open(path).map_err(failed)?;
    let recorded = file.attr_string("kind").ok();
    let kind = recorded.and_then(|kind| serde_json::from_value(kind.into()).ok());
    let mut matrices = Matrices { kind, ..Matrices::default() };
    let mut left = MAX_BYTES as usize / size_of::<f64>();
    for name in file.dataset_names() {
        let set = file.dataset(&name).map_err(failed)?;
        let shape = set.shape();
        let Some((&rows, others)) = shape.split_last() else { continue };
        let columns = others.iter().try_fold(1usize, |product, n| product.checked_mul(*n));
        let count = columns.and_then(|columns| columns.checked_mul(rows)).filter(|count| *count <= left);
        let (Some(columns), Some(count)) = (columns, count) else {
            if others.len() > 1 {
                continue; // somebody else's
            }
            return Err(DatasetError::TooLarge { path: path.to_owned() });
        };
        let name = name.trim_start_matches('/').to_owned();
        if name == matrix::COMMENT {
            // MATLAB's text is numbers of 16 bits.
            let text = set.read_numeric_as::<u16>().ok().and_then(|units| String::from_utf16(&units).ok());
            matrices.kind = text.and_then(|text| matrix::kind(&text)).or(matrices.kind);
            continue;
        }
        // What is no number is somebody else's.
        let Ok(values) = set.read_numeric_as::<f64>() else { continue };
        left -= count;
        let matrix = Matrix { name, rows, columns, values };
        // One matrix may have two names.
        let is_same = |m: &Matrix| m.rows == rows && m.columns == columns && m.values == matrix.values;
        if !matrices.all.iter().any(is_same) {
            matrices.all.push(matrix);
        }
    }
    Ok(matrices)
}
