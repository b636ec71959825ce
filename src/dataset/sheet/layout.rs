//! Layout of a table of cells: wavelengths down its side, or across its top.
//!
//! Both readings are tried. Where one alone is possible it is taken; where both are, what distinguishes wavelengths from
//! other numbers decides (an even step, a heading that says so, numbers that only count), and where nothing does the table
//! is refused with both readings named.

use nalgebra::DMatrix;

use super::columns::Column;
use super::rows::Heading;
use super::{Sheet, SheetError};
use crate::dataset::axis;
use crate::dataset::error::Remedy;
use crate::dataset::reading::{Decimal, ReadOptions, TableLayout};
use crate::dataset::units::WavelengthUnit;

/// Spectra of a table of cells.
#[derive(Debug)]
pub(in crate::dataset) struct Laid {
    /// Reason for the layout, in words.
    pub(in crate::dataset) layout: String,
    /// Place and unit of the wavelengths.
    pub(in crate::dataset) source: String,
    /// Wavelengths in nm, in the order of the file.
    pub(in crate::dataset) wavelengths: Vec<f64>,
    /// A column for each spectrum.
    pub(in crate::dataset) spectra: DMatrix<f64>,
    /// Names of the spectra; none where no spectrum has one.
    pub(in crate::dataset) names: Vec<String>,
    pub(in crate::dataset) notes: Vec<String>,
}

/// Wavelengths that were found in a table.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// In nm.
    pub(super) values: Vec<f64>,
    pub(super) unit: WavelengthUnit,
    /// Whether the file states the unit.
    pub(super) is_stated: bool,
    /// Text of their heading.
    pub(super) heading: String,
}

impl Axis {
    /// Whether the numbers are such as hardly any but wavelengths are.
    fn is_strong(&self) -> bool {
        axis::is_even(&self.values) || self.values.len() >= 12
    }

    /// Unit in words.
    pub(super) fn unit_note(&self) -> String {
        match (self.unit, self.is_stated) {
            (WavelengthUnit::Nm, true) => "in nm, as stated there".to_owned(),
            (WavelengthUnit::Nm, false) => "in nm".to_owned(),
            (unit, true) => format!("in {unit}, as stated there, and converted to nm"),
            (unit, false) => format!("in {unit}, as asked for, and converted to nm"),
        }
    }
}

/// Size of the table within a sheet: the number of cells of its rows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Extent {
    /// Cells of most rows that hold numbers.
    pub(super) cells: usize,
    /// Cells of most rows without columns at the end that are empty throughout.
    pub(super) width: usize,
}

impl Extent {
    fn of(sheet: &Sheet) -> Option<Extent> {
        let mut lengths = std::collections::BTreeMap::<usize, usize>::new();
        for row in
            (0..sheet.rows.len()).filter(|&row| sheet.row(row).cells >= 2 && !sheet.row(row).is_comment)
        {
            *lengths.entry(sheet.row(row).cells).or_default() += sheet.numbers(row);
        }
        let (&cells, &numbers) = lengths.iter().max_by_key(|(_, numbers)| **numbers)?;
        if numbers == 0 {
            return None;
        }
        let of_table = |row: &usize| sheet.row(*row).cells == cells;
        let is_used = |row: usize, column: usize| {
            !sheet.value(row, column).is_nan() || sheet.text(row, column).is_some()
        };
        let used = (0..sheet.rows.len())
            .filter(of_table)
            .map(|row| (0..cells).rev().find(|&column| is_used(row, column)).map_or(0, |last| last + 1));
        Some(Extent { cells, width: used.max()? })
    }

    /// Whether a row has as many cells as the table, where empty ones at its end do not count.
    pub(super) fn fits(self, sheet: &Sheet, row: usize) -> bool {
        let cells = sheet.row(row).cells;
        cells == self.cells
            || cells >= self.width
                && (self.width..cells)
                    .all(|column| sheet.value(row, column).is_nan() && sheet.text(row, column).is_none())
    }
}

/// Finds the wavelengths and the spectra of a sheet.
pub(in crate::dataset) fn lay_out(
    sheet: &Sheet,
    options: &ReadOptions,
    decimal: Decimal,
) -> Result<Laid, SheetError> {
    let Some(extent) = Extent::of(sheet) else {
        return Err(SheetError::new(
            "it holds no table of numbers: expected wavelengths and at least one spectrum, in columns or in rows",
            Remedy::Dialect,
        ));
    };
    let column = Column::find(sheet, extent, options);
    let heading = Heading::find(sheet, extent, options, decimal);
    match (options.layout, column, heading) {
        (Some(TableLayout::Columns), Ok(column), _) => column.extract(sheet, extent, "as asked for"),
        (Some(TableLayout::Columns), Err(fault), _) => Err(fault),
        (Some(TableLayout::Rows), _, Ok(heading)) => heading.extract(sheet, extent, "as asked for"),
        (Some(TableLayout::Rows), _, Err(fault)) => Err(fault),
        (None, Ok(column), Err(_)) => {
            let reason = format!("{} holds wavelengths, and no row does", column.name());
            column.extract(sheet, extent, &reason)
        }
        (None, Err(_), Ok(heading)) => {
            let reason = format!("{} holds wavelengths, and no column does", heading.name(sheet));
            heading.extract(sheet, extent, &reason)
        }
        (None, Ok(column), Ok(heading)) => match preferred(&column, &heading) {
            Some((TableLayout::Columns, reason)) => column.extract(sheet, extent, reason),
            Some((TableLayout::Rows, reason)) => heading.extract(sheet, extent, reason),
            None => Err(SheetError::new(
                format!(
                    "both {} ({}) and {} ({}) may be wavelengths: say whether the spectra are in columns or in rows",
                    column.name(),
                    ends(&column.axis.values),
                    heading.name(sheet),
                    ends(&heading.axis.values)
                ),
                Remedy::Layout,
            )),
        },
        (None, Err(column), Err(heading)) => Err(neither(column, heading)),
    }
}

/// The reading of two possible ones that what the numbers look like decides for.
fn preferred(column: &Column, heading: &Heading) -> Option<(TableLayout, &'static str)> {
    let across = (TableLayout::Rows, "the numbers of its first column are those of samples");
    let down = (TableLayout::Columns, "the numbers of its heading are those of samples");
    // A heading that says samples over numbers that only wavelengths are is wrong.
    if column.is_of_samples && (heading.axis.is_strong() || !column.axis.is_strong()) {
        return Some(across);
    }
    if column.is_named && heading.is_lettered {
        return Some((TableLayout::Columns, "the heading of its first column says wavelengths"));
    }
    if column.is_named && !heading.axis.is_strong() {
        return Some((TableLayout::Columns, "the heading of its first column says wavelengths"));
    }
    let (counts_down, counts_across) =
        (axis::counts(&column.axis.values), axis::counts(&heading.axis.values));
    match (counts_down, counts_across) {
        (true, false) if heading.axis.is_strong() && !column.is_named => return Some(across),
        (false, true) if column.axis.is_strong() => return Some(down),
        _ => {}
    }
    match (column.axis.is_strong(), heading.axis.is_strong()) {
        (true, false) => Some((TableLayout::Columns, "its first column has the step of wavelengths")),
        (false, true) => Some((TableLayout::Rows, "its heading has the step of wavelengths")),
        _ => None,
    }
}

/// The error of a table that has no wavelengths: of the reading that comes closer, with the other named.
fn neither(column: SheetError, heading: SheetError) -> SheetError {
    let weight = |error: &SheetError| match error.remedy {
        Remedy::Unit(_) => 3,
        _ if error.place.is_some() => 2,
        _ => 1,
    };
    let (first, second) = match weight(&column) >= weight(&heading) {
        true => (column, heading),
        false => (heading, column),
    };
    // A fault with a place is of one reading alone.
    if weight(&first) == 2 {
        return first;
    }
    SheetError {
        place: first.place,
        reason: format!("no wavelengths found: {}; and {}", first.reason, second.reason),
        remedy: first.remedy,
    }
}

/// The ends of wavelengths, for messages.
pub(super) fn ends(values: &[f64]) -> String {
    match *values {
        [first, second, .., last] => format!("{first}, {second} ... {last}"),
        [first, last] => format!("{first}, {last}"),
        [first] => first.to_string(),
        [] => String::new(),
    }
}
