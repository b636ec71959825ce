//! Text in whatever dialect: encoding, separator and decimal sign are found out from the content and not from the ending
//! of the name.

mod decode;
mod dialect;

use std::path::Path;

use super::reading::{ReadOptions, Reading};
use super::sheet::lay_out;
use super::units::WavelengthUnit;
use super::{DatasetError, Table};
use crate::wording::counted;

pub(super) use decode::decode;
pub(super) use dialect::{Dialect, cells};

/// Reads a table of text.
pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Reading, DatasetError> {
    let (text, encoding) = decode(bytes);
    read_text(path, &text, encoding, "text", options)
}

/// Reads a table of text that is decoded already.
pub(super) fn read_text(
    path: &Path,
    text: &str,
    encoding: &str,
    format: &str,
    options: &ReadOptions,
) -> Result<Reading, DatasetError> {
    let dialect = Dialect::of(text, options).map_err(|e| e.of(path))?;
    let sheet = cells(text, dialect, options.skip, None).map_err(|e| e.of(path))?;
    dialect.check(text, &sheet, options).map_err(|e| e.of(path))?;
    let stated = options.unit.or_else(|| stated_unit(text));
    let with_unit = ReadOptions { unit: stated, ..options.clone() };
    let laid = lay_out(&sheet, &with_unit, dialect.decimal).map_err(|e| e.of(path))?;
    let mut notes = laid.notes;
    if let (None, Some(unit)) = (options.unit, stated) {
        notes.insert(0, format!("the lines above the table state the unit of the wavelengths: {unit}"));
    }
    if options.skip > 0 {
        notes.insert(
            0,
            format!("skipped the first {}, as asked for", counted(options.skip as u64, "line", "lines")),
        );
    }
    let mut table = Table::from_measured(&format!("{path:?}"), laid.wavelengths, laid.spectra, &mut notes)?;
    table.names = laid.names;
    Ok(Reading {
        table,
        format: format.to_owned(),
        dialect: Some(format!("{encoding}, {dialect}")),
        layout: laid.layout,
        wavelengths: laid.source,
        notes,
        others: Vec::new(),
    })
}

/// Unit that a line above the table states, as in "X Units: Wavelength (micrometers)" of the ECOSTRESS library.
fn stated_unit(text: &str) -> Option<WavelengthUnit> {
    let states = |line: &&str| {
        let lower = line.trim_start_matches(['#', '%', ' ']).to_lowercase();
        ["x units", "xunits", "x-units", "wavelength units", "wavelength unit"]
            .iter()
            .any(|start| lower.starts_with(start))
    };
    let line = text.lines().take(100).find(states)?;
    WavelengthUnit::named_in(line.split_once([':', '=', ',', ';', '\t'])?.1)
}

/// Reads a table of cells that are no text, as spreadsheets have them.
#[cfg(feature = "spreadsheets")]
pub(super) fn read_sheet(
    path: &Path,
    sheet: &super::sheet::Sheet,
    format: &str,
    options: &ReadOptions,
) -> Result<Reading, DatasetError> {
    let laid = lay_out(sheet, options, super::reading::Decimal::Point).map_err(|e| e.of(path))?;
    let mut notes = laid.notes;
    let mut table = Table::from_measured(&format!("{path:?}"), laid.wavelengths, laid.spectra, &mut notes)?;
    table.names = laid.names;
    Ok(Reading {
        table,
        format: format.to_owned(),
        dialect: None,
        layout: laid.layout,
        wavelengths: laid.source,
        notes,
        others: Vec::new(),
    })
}
