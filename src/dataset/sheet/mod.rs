//! Tables of cells, as text and spreadsheets have them: the form from which [`layout`] finds wavelengths and spectra.
//!
//! Numbers stand in one array, so that ten million cells take no more than their values; cells that are text are few,
//! and stand apart.

mod cell;
mod columns;
mod layout;
mod rows;

use std::collections::HashMap;

pub(super) use cell::{Cell, heading_wavelength};
pub(super) use layout::lay_out;

use super::error::Remedy;
use super::units::WavelengthUnit;
use super::{DatasetError, MAX_BYTES};
use crate::wording::counted;

/// Largest number of cells: their values take as many bytes as the largest file.
const MAX_CELLS: usize = MAX_BYTES as usize / size_of::<f64>();

/// Largest number of rows and of cells of text: a table of numbers has few of these.
const MAX_TEXTS: usize = 2_000_000;

/// Rows of cells.
#[derive(Debug)]
pub(super) struct Sheet {
    rows: Vec<Row>,
    /// Values of all cells, row by row; NaN where a cell is empty or text.
    values: Vec<f64>,
    texts: HashMap<usize, Box<str>>,
    /// Units that stand in cells.
    marks: HashMap<usize, Mark>,
    /// Name of a row in messages.
    pub(super) row_name: &'static str,
}

/// One row.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Row {
    /// Number in the file, from 1.
    line: usize,
    /// Index of its first cell.
    start: usize,
    cells: usize,
    /// Whether it stood behind the sign of a comment: such a row can be a heading and nothing else.
    is_comment: bool,
}

/// Unit that stands behind a number.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Mark {
    Percent,
    Length(WavelengthUnit),
}

/// Error of a table of cells, without the name of its file.
#[derive(Debug)]
pub(super) struct SheetError {
    pub(super) place: Option<String>,
    pub(super) reason: String,
    pub(super) remedy: Remedy,
}

impl SheetError {
    pub(super) fn new(reason: impl Into<String>, remedy: Remedy) -> SheetError {
        SheetError { place: None, reason: reason.into(), remedy }
    }

    pub(super) fn at(place: String, reason: impl Into<String>, remedy: Remedy) -> SheetError {
        SheetError { place: Some(place), reason: reason.into(), remedy }
    }

    /// The error of a file.
    pub(super) fn of(self, path: &std::path::Path) -> DatasetError {
        let path = path.to_owned();
        match self.place {
            Some(place) => DatasetError::Place { path, place, reason: self.reason, remedy: self.remedy },
            None => DatasetError::Layout { path, reason: self.reason, remedy: self.remedy },
        }
    }
}

impl Sheet {
    pub(super) fn new(row_name: &'static str) -> Sheet {
        Sheet { rows: Vec::new(), values: Vec::new(), texts: HashMap::new(), marks: HashMap::new(), row_name }
    }

    /// Makes room for as many cells: as a large table grows, it is moved again and again.
    #[cfg(feature = "parquet")]
    pub(super) fn reserve(&mut self, cells: usize) {
        self.values.reserve_exact(cells.min(MAX_CELLS));
    }

    /// Begins a row.
    pub(super) fn begin_row(&mut self, line: usize, is_comment: bool) {
        self.rows.push(Row { line, start: self.values.len(), cells: 0, is_comment });
    }

    /// Adds a cell to the last row.
    pub(super) fn push(&mut self, cell: Cell) {
        let at = self.values.len();
        let (value, mark) = match cell {
            Cell::Number(value) => (value, None),
            Cell::Percent(value) => (value, Some(Mark::Percent)),
            Cell::Length(value, unit) => (value, Some(Mark::Length(unit))),
            Cell::Missing => (f64::NAN, None),
            Cell::Text(text) => {
                self.texts.insert(at, text.into());
                (f64::NAN, None)
            }
        };
        if let Some(mark) = mark {
            self.marks.insert(at, mark);
        }
        self.values.push(value);
        self.rows.last_mut().expect("a row has begun").cells += 1;
    }

    /// Ends a row; forgets it where all of its cells are empty.
    pub(super) fn end_row(&mut self) -> Result<(), SheetError> {
        let row = *self.rows.last().expect("a row has begun");
        let is_blank = (row.start..row.start + row.cells)
            .all(|at| self.values[at].is_nan() && !self.texts.contains_key(&at));
        if is_blank {
            self.rows.pop();
            self.values.truncate(row.start);
        }
        self.check_size()
    }

    /// Adds the rows of a sheet that was read apart, whose first line is the one after `lines` others.
    pub(super) fn append(&mut self, sheet: Sheet, lines: usize) -> Result<(), SheetError> {
        let start = self.values.len();
        let moved = |row: Row| Row { line: row.line + lines, start: row.start + start, ..row };
        self.rows.extend(sheet.rows.into_iter().map(moved));
        self.texts.extend(sheet.texts.into_iter().map(|(at, text)| (at + start, text)));
        self.marks.extend(sheet.marks.into_iter().map(|(at, mark)| (at + start, mark)));
        match start {
            0 => self.values = sheet.values,
            _ => self.values.extend(sheet.values),
        }
        self.check_size()
    }

    /// Whether two sheets have the same cells at the same places.
    #[cfg(test)]
    pub(in crate::dataset) fn is(&self, other: &Sheet) -> bool {
        let same = |(a, b): (&f64, &f64)| a.to_bits() == b.to_bits();
        self.rows == other.rows
            && self.values.len() == other.values.len()
            && self.values.iter().zip(&other.values).all(same)
            && self.texts == other.texts
            && self.marks == other.marks
    }

    fn check_size(&self) -> Result<(), SheetError> {
        if self.values.len() > MAX_CELLS || self.rows.len() > MAX_CELLS / 8 {
            return Err(SheetError::new(
                "it has more cells than 512 MiB hold: split it, or keep only the spectra",
                Remedy::None,
            ));
        }
        if self.texts.len() + self.marks.len() > MAX_TEXTS + self.values.len() / 2 {
            return Err(SheetError::new(
                "most of its cells are text; expected a table of numbers, with wavelengths in its first column or its first row",
                Remedy::None,
            ));
        }
        Ok(())
    }

    fn row(&self, row: usize) -> Row {
        self.rows[row]
    }

    /// Value of a cell: NaN where it is empty, text or not there.
    fn value(&self, row: usize, column: usize) -> f64 {
        let row = self.rows[row];
        if column < row.cells { self.values[row.start + column] } else { f64::NAN }
    }

    fn text(&self, row: usize, column: usize) -> Option<&str> {
        let row = self.rows[row];
        let at = row.start + column;
        // A number is no text, and most cells are numbers.
        let may_be = column < row.cells && self.values[at].is_nan();
        may_be.then(|| self.texts.get(&at))?.map(|text| &**text)
    }

    fn mark(&self, row: usize, column: usize) -> Option<Mark> {
        if self.marks.is_empty() {
            return None;
        }
        let row = self.rows[row];
        (column < row.cells).then(|| self.marks.get(&(row.start + column)))?.copied()
    }

    /// Number of cells of a row that are numbers.
    fn numbers(&self, row: usize) -> usize {
        let row = self.rows[row];
        self.values[row.start..row.start + row.cells].iter().filter(|v| !v.is_nan()).count()
    }

    /// Number of cells of a row that are text.
    fn text_cells(&self, row: usize) -> usize {
        let cells = self.rows[row];
        match self.texts.is_empty() {
            true => 0,
            false => (0..cells.cells).filter(|&column| self.text(row, column).is_some()).count(),
        }
    }

    /// Place of a cell in messages.
    fn place(&self, row: usize, column: usize) -> String {
        format!("{} {}, column {}", self.row_name, self.rows[row].line, column + 1)
    }

    fn line(&self, row: usize) -> String {
        format!("{} {}", self.row_name, self.rows[row].line)
    }

    /// A number of rows, by their name.
    pub(super) fn counted(&self, rows: usize) -> String {
        counted(rows as u64, self.row_name, &format!("{}s", self.row_name))
    }

    /// A row as a message shows it.
    fn shown(&self, row: usize) -> String {
        let cells = (0..self.rows[row].cells.min(4)).map(|column| match self.text(row, column) {
            Some(text) => text.chars().take(24).collect(),
            None if self.value(row, column).is_nan() => String::new(),
            None => self.value(row, column).to_string(),
        });
        cells.collect::<Vec<String>>().join(" | ")
    }
}

/// Score of a sheet as a reading of text: cells that are numbers, in rows that are as long as most, less those that speak
/// against it.
pub(super) fn score(sheet: &Sheet) -> i64 {
    let mut lengths: HashMap<usize, i64> = HashMap::new();
    for (index, row) in sheet.rows.iter().enumerate().filter(|(_, row)| row.cells >= 2 && !row.is_comment) {
        *lengths.entry(row.cells).or_default() += sheet.numbers(index) as i64;
    }
    let Some((&cells, _)) = lengths.iter().max_by_key(|(cells, numbers)| (**numbers, **cells)) else {
        return 0;
    };
    let mut score = 0;
    for (index, row) in sheet.rows.iter().enumerate().filter(|(_, row)| row.cells == cells && !row.is_comment)
    {
        let (numbers, texts) = (sheet.numbers(index) as i64, sheet.text_cells(index) as i64);
        // A heading of text speaks against nothing.
        score += if numbers == 0 { 0 } else { 2 * numbers - 3 * texts };
        let _ = row;
    }
    score
}

/// Two readings of whole numbers between commas.
pub(super) struct CommaDoubt {
    pub(super) place: String,
    pub(super) whole: String,
    pub(super) cells: usize,
    pub(super) decimals: String,
    pub(super) numbers: usize,
}

impl Sheet {
    pub(super) fn len(&self) -> usize {
        self.rows.len()
    }

    /// Two readings of cells that are all whole numbers, where they can be the halves of numbers with decimal commas; none where a heading has as
    /// many cells.
    pub(super) fn comma_doubt(&self) -> Option<CommaDoubt> {
        let is_data = |row: &usize| {
            !self.row(*row).is_comment && self.row(*row).cells >= 2 && self.text_cells(*row) == 0
        };
        let data: Vec<usize> = (0..self.rows.len()).filter(is_data).collect();
        let first = *data.first()?;
        let cells = self.row(first).cells;
        // Two cells are one number alone, and a table has more.
        if cells < 3 || data.iter().any(|&row| self.row(row).cells != cells) {
            return None;
        }
        let value = |row: usize, column: usize| self.value(row, column);
        let is_whole = |v: f64| v.is_nan() || v.fract() == 0.0 && v.abs() < 1e9;
        if !data.iter().all(|&row| (0..cells).all(|column| is_whole(value(row, column)))) {
            return None;
        }
        // A heading that names every column says that the commas separate. One of wavelengths is data of this kind too.
        let has_heading = (0..first).any(|row| self.row(row).cells == cells && self.text_cells(row) > 0);
        if has_heading {
            return None;
        }
        // Fractions are not negative.
        let start = cells % 2;
        let fractions = (start + 1..cells).step_by(2);
        let can_be = fractions.clone().all(|column| data.iter().all(|&row| value(row, column) >= 0.0));
        if !can_be {
            return None;
        }
        let shown =
            |row: usize| (0..cells.min(7)).map(|column| value(row, column).to_string()).collect::<Vec<_>>();
        let whole = shown(first);
        let mut decimals: Vec<String> = whole[..start.min(whole.len())].to_vec();
        decimals.extend(whole[start..].chunks_exact(2).map(|pair| pair.join(",")));
        Some(CommaDoubt {
            place: self.line(first),
            whole: whole.join(","),
            cells,
            decimals: decimals.join("; "),
            numbers: cells / 2 + start,
        })
    }
}
