//! The reading of a table whose wavelengths run down a column.

use nalgebra::DMatrix;

use super::layout::{Axis, Extent, Laid};
use super::{Mark, Sheet, SheetError};
use crate::dataset::axis::{self, AxisFault};
use crate::dataset::error::Remedy;
use crate::dataset::reading::ReadOptions;
use crate::dataset::units::{WavelengthUnit, is_id_word, is_wavelength_word};

/// Largest number of columns before that of the wavelengths.
const MAX_BEFORE: usize = 12;

/// Largest number of rows that a heading may have.
const MAX_HEADING: usize = 8;

/// A column that may hold wavelengths.
#[derive(Debug)]
pub(super) struct Column {
    column: usize,
    pub(super) axis: Axis,
    /// Whether its heading says that it holds wavelengths.
    pub(super) is_named: bool,
    /// Whether its heading says that it holds names or numbers of samples.
    pub(super) is_of_samples: bool,
    /// Rows of the wavelengths.
    rows: Vec<usize>,
}

impl Column {
    /// Finds the column of a table: the first whose heading says so, else the first that is neither text nor a counter.
    pub(super) fn find(sheet: &Sheet, extent: Extent, options: &ReadOptions) -> Result<Column, SheetError> {
        let all: Vec<Column> = (0..extent.width.min(MAX_BEFORE))
            .map(|column| Column::at(sheet, extent, column, options))
            .collect();
        if let Some(named) = all.iter().find(|column| column.is_named && !column.rows.is_empty()) {
            return Column::at(sheet, extent, named.column, options).checked(sheet);
        }
        let mut fault = None;
        for column in all {
            if column.rows.is_empty() {
                continue;
            }
            let is_counter = axis::is_counter(&column.raw(sheet));
            match column.checked(sheet) {
                Ok(column) => return Ok(column),
                Err(error) => fault = fault.or(Some(error)),
            }
            if !is_counter {
                break;
            }
        }
        Err(fault.unwrap_or_else(|| SheetError::new("no column holds numbers alone", Remedy::Layout)))
    }

    fn at(sheet: &Sheet, extent: Extent, column: usize, options: &ReadOptions) -> Column {
        let mut rows: Vec<usize> = (0..sheet.rows.len())
            .filter(|&row| {
                !sheet.row(row).is_comment && extent.fits(sheet, row) && !sheet.value(row, column).is_nan()
            })
            .collect();
        let heading = rows.first().map_or(String::new(), |&first| heading(sheet, extent, first, column));
        let marked = rows.iter().find_map(|&row| match sheet.mark(row, column) {
            Some(Mark::Length(unit)) => Some(unit),
            _ => None,
        });
        let stated = marked.or_else(|| WavelengthUnit::named_in(&heading));
        let unit = options.unit.or(stated).unwrap_or(WavelengthUnit::Nm);
        let mut values: Vec<f64> = rows.iter().map(|&row| unit.in_nm(sheet.value(row, column))).collect();
        // The corner of a table whose heading holds numbers.
        if let [0.0, below @ ..] = values.as_slice()
            && below.len() > 1
            && axis::check(below).is_ok()
        {
            values.remove(0);
            rows.remove(0);
        }
        let is_stated = options.unit.is_none() && stated.is_some();
        Column {
            column,
            is_named: is_wavelength_word(&heading),
            is_of_samples: is_id_word(&heading) && !is_wavelength_word(&heading),
            axis: Axis { values, unit, is_stated, heading },
            rows,
        }
    }

    fn raw(&self, sheet: &Sheet) -> Vec<f64> {
        self.rows.iter().map(|&row| sheet.value(row, self.column)).collect()
    }

    /// Name in messages.
    pub(super) fn name(&self) -> String {
        let name = match self.column {
            0 => "the first column".to_owned(),
            column => format!("column {}", column + 1),
        };
        match self.axis.heading.as_str() {
            "" => name,
            heading => format!("{name} ({heading:?})"),
        }
    }

    /// The column, where its numbers are wavelengths.
    fn checked(self, sheet: &Sheet) -> Result<Column, SheetError> {
        let Err(fault) = axis::check(&self.axis.values) else { return Ok(self) };
        let raw = self.raw(sheet);
        let (low, high) =
            raw.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
        let name = self.name();
        let place = |row: usize| sheet.place(self.rows[row], self.column);
        Err(match fault {
            // A column of values is no column of wavelengths with a fault.
            AxisFault::Repeated(..) | AxisFault::Turns(..) if !self.is_named && low < axis::RANGE[0] => {
                SheetError::new(format!("{name} neither rises nor falls"), Remedy::Layout)
            }
            AxisFault::Repeated(first, again, _) => SheetError::at(
                place(again),
                format!(
                    "the wavelength {} stands in {} already; average or remove one of the two",
                    raw[again],
                    sheet.line(self.rows[first])
                ),
                Remedy::None,
            ),
            AxisFault::Turns(at, ..) => SheetError::at(
                place(at),
                format!(
                    "the wavelength {} comes after {}, where those before run the other way; sort the rows, or give each \
                     table a file of its own",
                    raw[at],
                    raw[at - 1]
                ),
                Remedy::Layout,
            ),
            AxisFault::NotFinite(at, _) => {
                SheetError::at(place(at), format!("{} is no wavelength", raw[at]), Remedy::None)
            }
            AxisFault::Counter(first, last) => SheetError::new(
                format!("{name} counts from {first} to {last}, which are no wavelengths in nm"),
                Remedy::Layout,
            ),
            AxisFault::Range(..) | AxisFault::None => {
                let guess = WavelengthUnit::guess(low, high).filter(|unit| *unit != self.axis.unit);
                let reason = format!(
                    "{name} runs from {low} to {high}, which no wavelengths in {} do",
                    self.axis.unit
                );
                match guess {
                    Some(unit) if axis::monotone(&raw).is_ok() => SheetError::new(
                        format!("{reason}; where they are in {unit}, say so"),
                        Remedy::Unit(unit),
                    ),
                    _ => SheetError::new(reason, Remedy::Layout),
                }
            }
        })
    }

    /// The spectra beside the column.
    pub(super) fn extract(self, sheet: &Sheet, extent: Extent, reason: &str) -> Result<Laid, SheetError> {
        let mut notes = Vec::new();
        let (first, last) = (self.rows[0], self.rows[self.rows.len() - 1]);
        self.check_rows(sheet, extent, first, last)?;
        let above = (0..first)
            .filter(|&row| !sheet.row(row).is_comment && sheet.row(row).cells + 1 < extent.width)
            .count();
        if above > 0 {
            notes.push(format!("left out {} above the table", sheet.counted(above)));
        }
        let below = sheet.rows[last + 1..].iter().filter(|row| !row.is_comment).count();
        if below > 0 {
            notes.push(format!(
                "left out {} below the table, from {} on ({})",
                sheet.counted(below),
                sheet.line(last + 1),
                sheet.shown(last + 1)
            ));
        }
        let (mut spectra, mut names) = (Vec::new(), Vec::new());
        let raw = self.raw(sheet);
        let mut percents = Percents::default();
        for column in 0..extent.width {
            if column == self.column {
                continue;
            }
            let name = column_name(sheet, extent, first, column);
            let texts = self.rows.iter().filter(|&&row| sheet.text(row, column).is_some()).count();
            let numbers = self.rows.iter().filter(|&&row| !sheet.value(row, column).is_nan()).count();
            if numbers == 0 {
                let kind = if texts == 0 { "empty" } else { "text" };
                notes.push(format!("{name} is {kind}, and left out"));
                continue;
            }
            let values: Vec<f64> = self.rows.iter().map(|&row| sheet.value(row, column)).collect();
            if values == raw {
                notes.push(format!("{name} has the wavelengths once more, and is left out"));
                continue;
            }
            if axis::is_counter(&values) && values.len() > 3 || column < self.column {
                notes.push(format!("{name} only counts or describes, and is left out"));
                continue;
            }
            if values.len() >= 5 && axis::check(&values).is_ok() && axis::is_even(&values) {
                return Err(SheetError::new(
                    format!(
                        "{name} may hold wavelengths as well ({}); keep one column of wavelengths in the file",
                        super::layout::ends(&values)
                    ),
                    Remedy::None,
                ));
            }
            if let Some(&row) = self.rows.iter().find(|&&row| sheet.text(row, column).is_some()) {
                let text = sheet.text(row, column).unwrap_or_default();
                return Err(SheetError::at(sheet.place(row, column), no_number(text), Remedy::Dialect));
            }
            for &row in &self.rows {
                percents.count(sheet, row, column)?;
            }
            spectra.extend(values);
            names.push(heading(sheet, extent, first, column));
        }
        if spectra.is_empty() {
            return Err(SheetError::new(
                format!("{} holds wavelengths, and no other column numbers", self.name()),
                Remedy::Dialect,
            ));
        }
        percents.apply(&mut spectra, &mut notes);
        let columns = spectra.len() / self.rows.len();
        Ok(Laid {
            layout: format!("spectra in columns: {reason}"),
            source: format!("{}, {}", self.name(), self.axis.unit_note()),
            spectra: DMatrix::from_vec(self.rows.len(), columns, spectra),
            wavelengths: self.axis.values,
            names: if names.iter().all(String::is_empty) { Vec::new() } else { names },
            notes,
        })
    }

    /// Checks that all rows between the first and the last are rows of the table.
    fn check_rows(&self, sheet: &Sheet, extent: Extent, first: usize, last: usize) -> Result<(), SheetError> {
        let mut expected = self.rows.iter().copied().peekable();
        for row in first..=last {
            if expected.next_if_eq(&row).is_some() || sheet.row(row).is_comment {
                continue;
            }
            return Err(misfit(sheet, extent, row, self.column));
        }
        // A row that is cut short, or one cell longer, is not a remark below the table.
        let after = (last + 1..sheet.rows.len()).find(|&row| {
            !sheet.row(row).is_comment
                && !sheet.value(row, self.column).is_nan()
                && sheet.numbers(row) >= 2.min(extent.width)
        });
        after.map_or(Ok(()), |row| Err(misfit(sheet, extent, row, self.column)))
    }
}

/// The error of a row within a table that is none of its rows.
pub(super) fn misfit(sheet: &Sheet, extent: Extent, row: usize, column: usize) -> SheetError {
    let cells = sheet.row(row).cells;
    if !extent.fits(sheet, row) && sheet.numbers(row) > 0 {
        return SheetError::at(
            sheet.line(row),
            format!("{cells} fields, but the other rows have {}", extent.cells),
            Remedy::Dialect,
        );
    }
    match sheet.text(row, column) {
        Some(text) => SheetError::at(sheet.place(row, column), no_number(text), Remedy::Dialect),
        None if sheet.numbers(row) > 0 => {
            SheetError::at(sheet.place(row, column), "the wavelength is missing", Remedy::None)
        }
        None => SheetError::at(
            sheet.line(row),
            format!("text in the middle of the table: {:?}", sheet.shown(row)),
            Remedy::Dialect,
        ),
    }
}

pub(super) fn no_number(text: &str) -> String {
    format!("{:?} is not a number", text.chars().take(40).collect::<String>())
}

/// Numbers that are marked as percentages, and the first that is not.
#[derive(Default)]
pub(super) struct Percents {
    marked: usize,
    plain: usize,
}

impl Percents {
    /// Counts the value of a cell.
    pub(super) fn count(&mut self, sheet: &Sheet, row: usize, column: usize) -> Result<(), SheetError> {
        match sheet.mark(row, column) {
            Some(Mark::Percent) => self.marked += 1,
            Some(Mark::Length(unit)) => {
                return Err(SheetError::at(
                    sheet.place(row, column),
                    format!(
                        "a value of {} {unit} is a wavelength and not one of a spectrum",
                        sheet.value(row, column)
                    ),
                    Remedy::Layout,
                ));
            }
            None => self.plain += usize::from(!sheet.value(row, column).is_nan()),
        }
        if self.marked > 0 && self.plain > 0 {
            return Err(SheetError::at(
                sheet.place(row, column),
                "some values are marked with %, and others are not: mark all or none",
                Remedy::None,
            ));
        }
        Ok(())
    }

    /// Makes fractions of percentages.
    pub(super) fn apply(&self, values: &mut [f64], notes: &mut Vec<String>) {
        if self.marked > 0 {
            values.iter_mut().for_each(|value| *value /= 100.0);
            notes.push("every value is marked with %, and was divided by 100".to_owned());
        }
    }
}

/// Text above a cell: all of the rows of a heading, joined.
pub(super) fn heading(sheet: &Sheet, extent: Extent, first: usize, column: usize) -> String {
    let mut parts = Vec::new();
    for row in (first.saturating_sub(MAX_HEADING)..first).rev() {
        let cells = sheet.row(row).cells;
        // Heads of rows are often left out, and then the heading is one cell shorter.
        let shift = usize::from(cells >= 2 && cells + 1 == extent.cells && cells + 1 == extent.width);
        if !extent.fits(sheet, row) && shift == 0 {
            break;
        }
        if let Some(text) = column.checked_sub(shift).and_then(|column| sheet.text(row, column)) {
            parts.push(text.trim());
        }
    }
    parts.reverse();
    parts.join(" ")
}

fn column_name(sheet: &Sheet, extent: Extent, first: usize, column: usize) -> String {
    match heading(sheet, extent, first, column).as_str() {
        "" => format!("column {}", column + 1),
        heading => format!("column {} ({heading:?})", column + 1),
    }
}
