//! Spreadsheets: the first sheet that holds a table of numbers.

use std::io::Cursor;
use std::path::Path;

use calamine::{Data, Range, Reader, open_workbook_auto_from_rs};

use super::reading::{Decimal, ReadOptions, Reading};
use super::sheet::{Cell, Sheet, SheetError};
use super::{DatasetError, text};
use crate::caught::caught;

/// Reads a spreadsheet; the array that is asked for is the name of a sheet.
pub(super) fn read(path: &Path, bytes: &[u8], options: &ReadOptions) -> Result<Reading, DatasetError> {
    let failed =
        |reason: String| DatasetError::Format { path: path.to_owned(), format: "a spreadsheet", reason };
    let sheets = caught(|| sheets(bytes));
    let sheets = sheets.ok_or_else(|| failed("it is damaged; save it again".to_owned()))?.map_err(failed)?;
    let names: Vec<String> = sheets.iter().map(|(name, _)| name.clone()).collect();
    let asked: Vec<_> =
        sheets.iter().filter(|(name, _)| options.array.as_ref().is_none_or(|asked| asked == name)).collect();
    if asked.is_empty() {
        let variable = options.array.clone().unwrap_or_default();
        return Err(DatasetError::NoVariable { path: path.to_owned(), variable, found: names.join(", ") });
    }
    let mut first_error = None;
    let mut found = Vec::new();
    for (name, range) in asked {
        let sheet = cells(range).map_err(|e| e.of(path))?;
        let format = format!("spreadsheet, sheet {name:?}");
        match text::read_sheet(path, &sheet, &format, options) {
            Ok(reading) => found.push((name.clone(), reading)),
            Err(error) => first_error = first_error.or(Some(error)),
        }
    }
    let candidates: Vec<String> = found.iter().map(|(name, _)| name.clone()).collect();
    match (found.len(), found.pop()) {
        (1, Some((name, mut reading))) => {
            reading.table.name = format!("{path:?}:{name}");
            reading.others = names.into_iter().filter(|other| *other != name).collect();
            Ok(reading)
        }
        (0, _) => Err(first_error.unwrap_or_else(|| failed("it has no sheets".to_owned()))),
        _ => Err(DatasetError::Ambiguous { path: path.to_owned(), what: "sheets of spectra", candidates }),
    }
}

fn sheets(bytes: &[u8]) -> Result<Vec<(String, Range<Data>)>, String> {
    let mut book = open_workbook_auto_from_rs(Cursor::new(bytes)).map_err(|e| e.to_string())?;
    let names = book.sheet_names();
    names
        .into_iter()
        .map(|name| {
            book.worksheet_range(&name)
                .map(|range| (name.clone(), range))
                .map_err(|e| format!("{name:?}: {e}"))
        })
        .collect()
}

fn cells(range: &Range<Data>) -> Result<Sheet, SheetError> {
    let mut sheet = Sheet::new("row");
    let (first_row, first_column) = range.start().unwrap_or_default();
    for (index, row) in range.rows().enumerate() {
        sheet.begin_row(first_row as usize + index + 1, false);
        for _ in 0..first_column {
            sheet.push(Cell::Missing);
        }
        for cell in row {
            sheet.push(match cell {
                Data::Float(value) => Cell::Number(*value),
                Data::Int(value) => Cell::Number(*value as f64),
                Data::String(text) => Cell::parse(text, Decimal::Point),
                Data::Empty => Cell::Missing,
                Data::Error(_) => Cell::Text("#ERROR"),
                _ => Cell::Text("a date or a truth value"),
            });
        }
        sheet.end_row()?;
    }
    Ok(sheet)
}
