//! Tables: what one file holds, as it was measured.

use std::path::Path;

use nalgebra::DMatrix;

use super::files::Source;
use super::reading::{ReadOptions, Reading};
use super::{DatasetError, MAX_BYTES, Remedy, SpectrumKind, axis, format};
use crate::grid::{self, Grid};
use crate::wording::counted;

/// Spectra of one source, as measured: increasing wavelengths (nm), and values that are finite or NaN, which means "not
/// measured".
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
    /// Names of the spectra, where the file has any: one for each, which may be empty.
    pub(super) names: Vec<String>,
}

impl Table {
    /// Makes a table of values, each spectrum as long as `wavelengths` (nm). NaN means "not measured". `name` is its name
    /// in messages.
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
        Ok(Table { source: name.clone(), name, wavelengths, spectra, kind: None, names: Vec::new() })
    }

    /// Makes a table of wavelengths in nm that may fall, which is noted, and that are checked to be such.
    pub(super) fn from_measured(
        name: &str,
        mut wavelengths: Vec<f64>,
        mut spectra: DMatrix<f64>,
        notes: &mut Vec<String>,
    ) -> Result<Table, DatasetError> {
        if let Err(fault) = axis::check(&wavelengths) {
            let remedy = fault.guess().map_or(Remedy::None, Remedy::Unit);
            let reason = format!("its wavelengths are none: {fault}");
            return Err(DatasetError::NotWavelengths { name: name.to_owned(), reason, remedy });
        }
        if wavelengths[0] > wavelengths[wavelengths.len() - 1] {
            wavelengths.reverse();
            let bands = wavelengths.len();
            for mut spectrum in spectra.column_iter_mut() {
                for band in 0..bands / 2 {
                    spectrum.swap_rows(band, bands - 1 - band);
                }
            }
            notes.push("the wavelengths fall, and were turned round".to_owned());
        }
        Table::from_columns(name, wavelengths, spectra)
    }

    /// Reads a file of spectra in any format that is read. `variable` picks a matrix where a file holds several.
    pub fn open(path: impl AsRef<Path>, variable: Option<&str>) -> Result<Table, DatasetError> {
        Table::open_on(path, variable, None)
    }

    /// Reads a table as [`Table::open`] does, and also files whose spectra have no wavelengths, which are those of `grid`.
    pub fn open_on(
        path: impl AsRef<Path>,
        variable: Option<&str>,
        grid: Option<Grid>,
    ) -> Result<Table, DatasetError> {
        let options = ReadOptions {
            array: variable.map(str::to_owned),
            fallback: grid.map(|grid| grid.wavelengths().collect()),
            ..ReadOptions::default()
        };
        Table::read(path, &options).map(|reading| reading.table)
    }

    /// Reads a file of spectra, and says how it was read.
    pub fn read(path: impl AsRef<Path>, options: &ReadOptions) -> Result<Reading, DatasetError> {
        let path = path.as_ref();
        Ok(Table::marked(path, format::read(path, options)?, options))
    }

    /// Reads the bytes of a file of spectra, at most 512 MiB, where a host has them and no file system, as a browser
    /// does. `name` is the name of the file, in messages and in models; that of a format never decides what it is.
    ///
    /// ```
    /// use spectroll::{ReadOptions, Table};
    ///
    /// let text = b"nm,a,b\n400,0.1,0.2\n410,0.2,0.3\n420,0.3,0.2\n";
    /// let reading = Table::from_bytes("mine.csv", text.to_vec(), &ReadOptions::default())?;
    /// assert_eq!((reading.table.len(), reading.table.spectrum(1)), (2, &[0.2, 0.3, 0.2][..]));
    /// # Ok::<(), spectroll::DatasetError>(())
    /// ```
    pub fn from_bytes(name: &str, bytes: Vec<u8>, options: &ReadOptions) -> Result<Reading, DatasetError> {
        let path = Path::new(name);
        if bytes.is_empty() {
            return Err(DatasetError::Empty { path: path.to_owned() });
        }
        if bytes.len() as u64 > MAX_BYTES {
            return Err(DatasetError::TooLarge { path: path.to_owned() });
        }
        Ok(Table::marked(path, format::read_source(path, Source::of(bytes), options)?, options))
    }

    /// The reading of a file with its name in models, and with values marked as missing as asked for.
    fn marked(path: &Path, mut reading: Reading, options: &ReadOptions) -> Reading {
        let table = &mut reading.table;
        let (full, file) =
            (path.display().to_string(), path.file_name().unwrap_or_default().to_string_lossy());
        table.source = table.name.replace(&format!("{full:?}"), &file);
        if !options.missing_values.is_empty() {
            let mut marked = 0;
            for value in table.spectra.iter_mut() {
                // NaN is missing already.
                if options.missing_values.iter().any(|missing| close(*missing, *value)) {
                    *value = f64::NAN;
                    marked += 1;
                }
            }
            let marked = counted(marked, "value", "values");
            reading.notes.push(format!("marked {marked} as missing, as asked for"));
        }
        reading
    }

    /// Whether the name of a file is that of a table, by its extension.
    pub fn may_open(path: &Path) -> bool {
        format::may_open(path)
    }

    /// Spectra multiplied by `factor`: 0.01 makes reflectances of percentages.
    pub fn scaled(mut self, factor: f64) -> Table {
        if factor != 1.0 {
            self.spectra *= factor;
        }
        self
    }

    /// Number of values that are missing (NaN).
    pub fn missing(&self) -> usize {
        self.spectra.iter().filter(|v| v.is_nan()).count()
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

    /// Names of the spectra as the file has them, in the headings of its columns or the heads of its rows: one for each,
    /// empty where a spectrum has none; an empty list where none has.
    pub fn names(&self) -> &[String] {
        &self.names
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

    /// The values of all spectra, one spectrum after the other, without a copy; NaN where one was not measured.
    pub fn into_values(self) -> Vec<f64> {
        self.spectra.data.into()
    }

    /// The values of one spectrum, one per wavelength; NaN where it was not measured.
    pub fn spectrum(&self, index: usize) -> &[f64] {
        let bands = self.wavelengths.len();
        &self.spectra.as_slice()[index * bands..(index + 1) * bands]
    }
}

/// Whether a value is a marker: as close as single precision has it, since -1.23e34 of a file of such is no other number.
fn close(marker: f64, value: f64) -> bool {
    (value - marker).abs() <= 1e-6 * marker.abs()
}
