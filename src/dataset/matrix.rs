//! Matrices of spectra by the naming conventions of the field: a matrix with its sampling `S_x` = [start step count]
//! (nm) beside it, as in `sur_vrhel` with `S_vrhel`, or else a vector `wavelength`.

use std::path::Path;

use nalgebra::DMatrix;

use super::{DatasetError, SpectrumKind, Table};
use crate::grid::Grid;

/// A two-dimensional real array, column by column.
pub(super) struct Matrix {
    pub(super) name: String,
    pub(super) rows: usize,
    pub(super) columns: usize,
    pub(super) values: Vec<f64>,
}

/// Contents of a file.
#[derive(Default)]
pub(super) struct Matrices {
    /// Its numeric arrays.
    pub(super) all: Vec<Matrix>,
    /// The kind of the draws, where it is a data set of this program.
    pub(super) kind: Option<SpectrumKind>,
}

/// The variable in which data sets of this program say what they were made from, in JSON.
pub(super) const COMMENT: &str = "comment";

/// The names of draws in data sets of this program.
const DRAWS: [&str; 2] = ["X", "spectra"];

/// The kind that the comment of a data set of this program records.
pub(super) fn kind(comment: &str) -> Option<SpectrumKind> {
    let mut attributes: serde_json::Value = serde_json::from_str(comment).ok()?;
    serde_json::from_value(attributes.get_mut("kind")?.take()).ok()
}

/// The table of the matrix that `variable` names, or of the only one with its sampling beside it.
pub(super) fn choose(
    path: &Path,
    Matrices { all: matrices, kind }: &Matrices,
    variable: Option<&str>,
) -> Result<Table, DatasetError> {
    let mut samplings: Vec<_> = matrices.iter().filter_map(sampling).collect();
    if samplings.is_empty() {
        samplings.extend(matrices.iter().filter_map(wavelengths));
    }
    let spectra: Vec<_> = matrices
        .iter()
        .filter_map(|m| Some((m, grid_of(m, &samplings)?)))
        .filter(|(m, _)| variable.is_none_or(|v| v == m.name))
        .collect();
    let found = || match matrices.as_slice() {
        [] => "no numeric matrix".to_owned(),
        all => all
            .iter()
            .map(|m| format!("{} ({} x {})", m.name, m.rows, m.columns))
            .collect::<Vec<_>>()
            .join(", "),
    };
    let path = path.to_owned();
    match (spectra.as_slice(), variable) {
        ([(matrix, grid)], _) => {
            let mut table = table(&format!("{path:?}:{}", matrix.name), matrix, grid.clone())?;
            table.kind = table.kind.or(kind.filter(|_| DRAWS.contains(&matrix.name.as_str())));
            Ok(table)
        }
        ([], None) => Err(DatasetError::NoMatrix { path, found: found() }),
        ([], Some(v)) => Err(DatasetError::NoVariable { path, variable: v.to_owned(), found: found() }),
        (several, _) => {
            let candidates = several.iter().map(|(m, _)| m.name.clone()).collect();
            Err(DatasetError::Ambiguous { path, candidates })
        }
    }
}

fn table(name: &str, matrix: &Matrix, grid: Grid) -> Result<Table, DatasetError> {
    // Spectra stand in columns, but the convention for functions to integrate with (`T_`) is rows.
    let in_rows =
        matrix.rows != grid.len() || (matrix.name.starts_with("T_") && matrix.columns == grid.len());
    let values = &matrix.values;
    let spectra = match in_rows {
        true => DMatrix::from_column_slice(matrix.rows, matrix.columns, values).transpose(),
        false => DMatrix::from_column_slice(matrix.rows, matrix.columns, values),
    };
    let mut table = Table::from_columns(name, grid.wavelengths().collect(), spectra)?;
    table.kind = match matrix.name.to_ascii_lowercase() {
        n if n.starts_with("sur_") => Some(SpectrumKind::Reflectance),
        n if n.starts_with("spd_") || n.starts_with("daylight") => Some(SpectrumKind::Illuminant),
        _ => None,
    };
    Ok(table)
}

/// The suffix and grid of a variable `S_suffix` = [start step count].
fn sampling(matrix: &Matrix) -> Option<(String, Grid)> {
    let suffix = matrix.name.strip_prefix("S_")?.to_ascii_lowercase();
    let &[start, step, count] = matrix.values.as_slice() else { return None };
    (count.fract() == 0.0).then(|| Grid::new(start, step, count as usize).ok())?.map(|grid| (suffix, grid))
}

/// The grid of a vector of wavelengths, which serves every matrix of the file.
fn wavelengths(matrix: &Matrix) -> Option<(String, Grid)> {
    let is_named = matches!(matrix.name.to_ascii_lowercase().as_str(), "wavelength" | "wavelengths" | "wave");
    let is_vector = matrix.rows == 1 || matrix.columns == 1;
    (is_named && is_vector)
        .then(|| Grid::from_wavelengths(&matrix.values).ok())?
        .map(|grid| (String::new(), grid))
}

/// The sampling that belongs to a matrix: the one whose suffix ends the matrix's name, else the only one in the file;
/// and one of the matrix's sides must be as long as it says.
fn grid_of(matrix: &Matrix, samplings: &[(String, Grid)]) -> Option<Grid> {
    if matrix.name.starts_with("S_") || wavelengths(matrix).is_some() {
        return None;
    }
    let name = matrix.name.to_ascii_lowercase();
    let named = samplings.iter().filter(|(suffix, _)| name.ends_with(suffix)).max_by_key(|(s, _)| s.len());
    let (_, grid) = named.or(match samplings {
        [only] => Some(only),
        _ => None,
    })?;
    (grid.len() == matrix.rows || grid.len() == matrix.columns).then(|| grid.clone())
}
