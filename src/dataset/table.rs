//! Tables: what one file holds, as it was measured.

use std::io::Read;
use std::path::Path;

use nalgebra::DMatrix;

use super::{DatasetError, MAX_BYTES, SpectrumKind, csv, mat, npy};
use crate::grid::{self, Grid};

/// Spectra of one source, as measured: increasing wavelengths (nm), finite values. A value may be NaN where a spectrum was
/// not measured.
#[derive(Clone, Debug, PartialEq)]
pub struct Table {
    /// Name in messages: a path and what it takes to find the spectra in that file.
    pub(super) name: String,
    /// Name in models: without the folder, which is private to whoever fitted them.
    pub(super) source: String,
    pub(super) wavelengths: Vec<f64>,
    /// One column per spectrum.
    pub(super) spectra: DMatrix<f64>,
    pub(super) kind: Option<SpectrumKind>,
}

impl Table {
    /// Makes a table of values, each spectrum as long as `wavelengths` (nm). `name` is its name in messages.
    pub fn new(name: &str, wavelengths: Vec<f64>, spectra: &[Vec<f64>]) -> Result<Table, DatasetError> {
        if let Some(i) = spectra.iter().position(|s| s.len() != wavelengths.len()) {
            return Err(DatasetError::Length {
                name: name.to_owned(),
                spectrum: i + 1,
                values: spectra[i].len(),
                wavelengths: wavelengths.len(),
            });
        }
        let values = spectra.iter().flatten().copied();
        let spectra = DMatrix::from_iterator(wavelengths.len(), spectra.len(), values);
        Table::from_columns(name, wavelengths, spectra)
    }

    /// Makes a table for the readers: `spectra` has a row for each wavelength.
    pub(super) fn from_columns(
        name: &str,
        wavelengths: Vec<f64>,
        spectra: DMatrix<f64>,
    ) -> Result<Table, DatasetError> {
        let name = name.to_owned();
        if spectra.is_empty() {
            return Err(DatasetError::NoSpectra { name });
        }
        if let Err(source) = grid::check_increasing(&wavelengths) {
            return Err(DatasetError::Wavelengths { name, source });
        }
        for (j, spectrum) in spectra.column_iter().enumerate() {
            if let Some(i) = spectrum.iter().position(|v| v.is_infinite()) {
                return Err(DatasetError::NotFinite {
                    name,
                    spectrum: j + 1,
                    wavelength: wavelengths[i],
                    value: spectrum[i],
                });
            }
        }
        Ok(Table { source: name.clone(), name, wavelengths, spectra, kind: None })
    }

    /// Reads a MATLAB file or an `.h5` one, or a `.csv`, `.tsv` or `.txt` file with the wavelengths in the first column
    /// and a spectrum in each other one. `variable` picks a matrix where a `.mat` or `.h5` file holds several.
    pub fn open(path: impl AsRef<Path>, variable: Option<&str>) -> Result<Table, DatasetError> {
        Table::open_on(path, variable, None)
    }

    /// Reads a table as [`Table::open`] does, and also `.npy` files with spectra in rows, whose wavelengths are
    /// `grid`.
    pub fn open_on(
        path: impl AsRef<Path>,
        variable: Option<&str>,
        grid: Option<Grid>,
    ) -> Result<Table, DatasetError> {
        let path = path.as_ref();
        let bytes = read_capped(path)?;
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        let mut table = match extension.as_str() {
            "mat" | "h5" | "hdf5" => mat::read(path, &bytes, variable),
            "npy" => npy::read(path, &bytes, grid),
            "csv" | "tsv" | "txt" => csv::read(path, &bytes),
            _ => Err(DatasetError::UnknownType { path: path.to_owned() }),
        }?;
        let (full, file) =
            (path.display().to_string(), path.file_name().unwrap_or_default().to_string_lossy());
        table.source = table.name.replace(&format!("{full:?}"), &file);
        Ok(table)
    }

    /// Whether the name of a file is that of a table, by its extension.
    pub fn may_open(path: &Path) -> bool {
        let extension = path.extension().and_then(|e| e.to_str()).unwrap_or_default().to_ascii_lowercase();
        matches!(extension.as_str(), "mat" | "h5" | "hdf5" | "npy" | "csv" | "tsv" | "txt")
    }

    /// Spectra multiplied by `factor`: 0.01 makes reflectances of percentages.
    pub fn scaled(mut self, factor: f64) -> Table {
        self.spectra *= factor;
        self
    }

    /// Name of the table in messages.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Kind of the spectra by the field's naming convention: `sur_x` are reflectances, `spd_x` and `daylightX`
    /// illuminants.
    pub fn kind(&self) -> Option<SpectrumKind> {
        self.kind
    }

    /// The wavelengths of the measurements, nm.
    pub fn wavelengths(&self) -> &[f64] {
        &self.wavelengths
    }

    /// The wavelengths at which any spectrum has a value, nm.
    pub(super) fn measured_wavelengths(&self) -> Vec<f64> {
        let rows = self.spectra.row_iter().zip(&self.wavelengths);
        rows.filter(|(row, _)| row.iter().any(|value| !value.is_nan())).map(|(_, &w)| w).collect()
    }

    /// The number of spectra.
    #[allow(clippy::len_without_is_empty)] // a table is never empty
    pub fn len(&self) -> usize {
        self.spectra.ncols()
    }

    /// The values of one spectrum, one per wavelength.
    pub fn spectrum(&self, index: usize) -> &[f64] {
        let bands = self.wavelengths.len();
        &self.spectra.as_slice()[index * bands..(index + 1) * bands]
    }
}

fn read_capped(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let failed = |source| DatasetError::Read { path: path.to_owned(), source };
    let mut bytes = Vec::new();
    let file = std::fs::File::open(path).map_err(failed)?;
    file.take(MAX_BYTES + 1).read_to_end(&mut bytes).map_err(failed)?;
    match bytes.len() as u64 {
        0 => Err(DatasetError::Empty { path: path.to_owned() }),
        n if n > MAX_BYTES => Err(DatasetError::TooLarge { path: path.to_owned() }),
        _ => Ok(bytes),
    }
}
