//! The reading of a table whose wavelengths run across a row.

use nalgebra::DMatrix;

use super::columns::{Percents, misfit, no_number};
use super::layout::{Axis, Extent, Laid};
use super::{Mark, Sheet, SheetError, heading_wavelength};
use crate::dataset::axis::{self, AxisFault};
use crate::dataset::error::Remedy;
use crate::dataset::reading::{Decimal, ReadOptions};
use crate::dataset::units::{WavelengthUnit, is_wavelength_word};
use crate::wording::counted;

/// Number of rows at the top of a table among which its heading is looked for.
const ROWS: usize = 100;

/// A row that may hold wavelengths.
#[derive(Debug)]
pub(super) struct Heading {
    row: usize,
    /// Column of the table over which the first wavelength stands.
    start: usize,
    pub(super) axis: Axis,
    /// Whether letters stand before the numbers, as in R400.
    pub(super) is_lettered: bool,
    rows: Vec<usize>,
}

/// Cells of a row that read as wavelengths.
struct Run {
    start: usize,
    raw: Vec<f64>,
    unit: Option<WavelengthUnit>,
    is_lettered: bool,
}

impl Heading {
    /// Finds the row of a table: the one whose cells are the longest run of wavelengths.
    pub(super) fn find(
        sheet: &Sheet,
        extent: Extent,
        options: &ReadOptions,
        decimal: Decimal,
    ) -> Result<Heading, SheetError> {
        let mut best: Option<Heading> = None;
        // A row whose numbers are wavelengths in another unit comes closer than a longer one of values.
        let closeness = |length: usize, error: &SheetError| (matches!(error.remedy, Remedy::Unit(_)), length);
        let mut fault: Option<((bool, usize), SheetError)> = None;
        for row in 0..sheet.rows.len().min(ROWS) {
            for run in runs(sheet, row, decimal) {
                let length = run.raw.len();
                match Heading::of(sheet, extent, row, run, options) {
                    Ok(heading) if best.as_ref().is_none_or(|best| best.axis.values.len() < length) => {
                        best = Some(heading);
                    }
                    Err(error)
                        if fault.as_ref().is_none_or(|(most, _)| *most < closeness(length, &error)) =>
                    {
                        fault = Some((closeness(length, &error), error));
                    }
                    _ => {}
                }
            }
        }
        let nothing = || SheetError::new("no row holds wavelengths above numbers", Remedy::Layout);
        best.ok_or_else(|| fault.map_or_else(nothing, |(_, error)| error))
    }

    fn of(
        sheet: &Sheet,
        extent: Extent,
        row: usize,
        run: Run,
        options: &ReadOptions,
    ) -> Result<Heading, SheetError> {
        let left: String =
            (0..run.start).filter_map(|column| sheet.text(row, column)).collect::<Vec<_>>().join(" ");
        let stated =
            run.unit.or_else(|| is_wavelength_word(&left).then(|| WavelengthUnit::named_in(&left)).flatten());
        let unit = options.unit.or(stated).unwrap_or(WavelengthUnit::Nm);
        let values: Vec<f64> = run.raw.iter().map(|&value| unit.in_nm(value)).collect();
        let name = || format!("{} ({})", sheet.line(row), sheet.shown(row));
        if let Err(error) = axis::check(&values) {
            let place = |at: usize| sheet.place(row, run.start + at);
            let is_close = run.raw.len() >= 5 && run.raw.iter().all(|v| *v >= axis::RANGE[0]);
            return Err(match error {
                AxisFault::Repeated(first, again, _) if is_close => SheetError::at(
                    place(again),
                    format!(
                        "the wavelength {} stands in column {} already; average or remove one of the two",
                        run.raw[again],
                        run.start + first + 1
                    ),
                    Remedy::None,
                ),
                AxisFault::Range(..) if run.raw.len() >= 2 => {
                    let (low, high) = run
                        .raw
                        .iter()
                        .fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), &v| (a.min(v), b.max(v)));
                    let guess = WavelengthUnit::guess(low, high).filter(|guess| *guess != unit);
                    match guess {
                        Some(guess) if axis::is_even(&run.raw) || run.raw.len() >= 12 => SheetError::new(
                            format!(
                                "{} runs from {low} to {high}, which no wavelengths in {unit} do; where they are in {guess}, \
                                 say so",
                                name()
                            ),
                            Remedy::Unit(guess),
                        ),
                        _ => SheetError::new("no row holds wavelengths above numbers", Remedy::Layout),
                    }
                }
                _ => SheetError::new("no row holds wavelengths above numbers", Remedy::Layout),
            });
        }
        // Heads of rows are often left out of the heading, which is one cell shorter then.
        let cells = sheet.row(row).cells;
        let shift = usize::from(cells >= 2 && cells + 1 == extent.cells && cells + 1 == extent.width);
        let start = run.start + shift;
        let end = start + values.len();
        let rows: Vec<usize> = (row + 1..sheet.rows.len())
            .filter(|&below| {
                let has_numbers = || (start..end).any(|column| !sheet.value(below, column).is_nan());
                !sheet.row(below).is_comment && extent.fits(sheet, below) && has_numbers()
            })
            .collect();
        if rows.is_empty() || end > extent.width {
            return Err(SheetError::new("no row holds wavelengths above numbers", Remedy::Layout));
        }
        let is_stated = options.unit.is_none() && stated.is_some();
        let axis = Axis { values, unit, is_stated, heading: left };
        Ok(Heading { row, start, axis, is_lettered: run.is_lettered, rows })
    }

    /// Name in messages.
    pub(super) fn name(&self, sheet: &Sheet) -> String {
        sheet.line(self.row)
    }

    /// The spectra below the row.
    pub(super) fn extract(self, sheet: &Sheet, extent: Extent, reason: &str) -> Result<Laid, SheetError> {
        let bands = self.axis.values.len();
        let columns = self.start..self.start + bands;
        let mut notes = Vec::new();
        let above = (0..self.row).filter(|&row| !sheet.row(row).is_comment).count();
        if above > 0 {
            notes.push(format!("left out {} above the heading", sheet.counted(above)));
        }
        for (side, others) in [("before", 0..columns.start), ("after", columns.end..extent.width)] {
            if !others.is_empty() {
                let shift = usize::from(sheet.row(self.row).cells + 1 == extent.width);
                let names: Vec<&str> = others
                    .clone()
                    .filter_map(|column| sheet.text(self.row, column.checked_sub(shift)?))
                    .take(6)
                    .collect();
                notes.push(format!(
                    "left out {} {side} the wavelengths ({})",
                    counted(others.len() as u64, "column", "columns"),
                    names.join(", ")
                ));
            }
        }
        let (first, last) = (self.rows[0], self.rows[self.rows.len() - 1]);
        let mut expected = self.rows.iter().copied().peekable();
        for row in first..sheet.rows.len() {
            if expected.next_if_eq(&row).is_some() || sheet.row(row).is_comment {
                continue;
            }
            let is_text = sheet.numbers(row) <= usize::from(self.start > 0);
            match row < last {
                _ if !is_text => return Err(misfit(sheet, extent, row, self.start)),
                true => return Err(misfit(sheet, extent, row, self.start)),
                false => {
                    notes.push(format!(
                        "left out {} and all below it ({})",
                        sheet.line(row),
                        sheet.shown(row)
                    ));
                    break;
                }
            }
        }
        let mut spectra = Vec::with_capacity(bands * self.rows.len());
        let head = |row: usize| (0..columns.start).find_map(|column| sheet.text(row, column));
        let names: Vec<String> =
            self.rows.iter().map(|&row| head(row).unwrap_or_default().trim().to_owned()).collect();
        let mut percents = Percents::default();
        for &row in &self.rows {
            for column in columns.clone() {
                if let Some(text) = sheet.text(row, column) {
                    return Err(SheetError::at(sheet.place(row, column), no_number(text), Remedy::Dialect));
                }
                percents.count(sheet, row, column)?;
                spectra.push(sheet.value(row, column));
            }
        }
        percents.apply(&mut spectra, &mut notes);
        Ok(Laid {
            layout: format!("spectra in rows: {reason}"),
            source: format!("{}, {}", self.name(sheet), self.axis.unit_note()),
            spectra: DMatrix::from_vec(bands, self.rows.len(), spectra),
            wavelengths: self.axis.values,
            names: if names.iter().all(String::is_empty) { Vec::new() } else { names },
            notes,
        })
    }
}

/// Runs of cells of a row that read as wavelengths, each also without its first cells, where that makes it one.
fn runs(sheet: &Sheet, row: usize, decimal: Decimal) -> Vec<Run> {
    let cells = sheet.row(row).cells;
    let mut found = Vec::new();
    let mut run: Option<Run> = None;
    for column in 0..=cells {
        let value = sheet.value(row, column);
        let cell = match (column < cells, value.is_nan()) {
            (false, _) => None,
            (true, false) => match sheet.mark(row, column) {
                Some(Mark::Length(unit)) => Some((value, Some(unit), false)),
                Some(Mark::Percent) => None,
                None => Some((value, None, false)),
            },
            (true, true) => sheet.text(row, column).and_then(|text| heading_wavelength(text, decimal)),
        };
        match cell {
            Some((value, unit, is_lettered)) => {
                let run = run.get_or_insert(Run { start: column, raw: Vec::new(), unit, is_lettered });
                run.raw.push(value);
                run.is_lettered |= is_lettered;
                if run.unit != unit {
                    run.unit = None;
                }
            }
            None => found.extend(run.take()),
        }
    }
    found.retain(|run| run.raw.len() >= 2);
    let mut shorter = Vec::new();
    for run in &found {
        for skip in 1..4.min(run.raw.len().saturating_sub(1)) {
            let raw = run.raw[skip..].to_vec();
            if axis::check(&run.raw).is_err() && axis::check(&raw).is_ok() {
                let (unit, is_lettered) = (run.unit, run.is_lettered);
                shorter.push(Run { start: run.start + skip, raw, unit, is_lettered });
                break;
            }
        }
    }
    found.extend(shorter);
    found
}
