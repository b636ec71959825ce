//! Dialects of text: the separator and the decimal sign in which most cells are numbers.
//!
//! Every pair is tried on the first lines, and the one that makes the most numbers and the least text of them is taken.
//! Whole numbers between commas can be decimal commas that somebody wrote between commas; that is refused where nothing
//! else tells.

use std::fmt;

use crate::dataset::error::Remedy;
use crate::dataset::reading::{Decimal, ReadOptions, Separator};
use crate::dataset::sheet::{Cell, Sheet, SheetError, score};
use crate::threads;

/// Lines, and bytes, from which a dialect is told.
const SAMPLE: usize = 2000;
const SAMPLE_BYTES: usize = 1 << 18;

/// Separator and decimal sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::dataset) struct Dialect {
    pub(in crate::dataset) separator: Separator,
    pub(in crate::dataset) decimal: Decimal,
}

impl fmt::Display for Dialect {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let decimal = match self.decimal {
            Decimal::Point => "decimal points",
            Decimal::Comma => "decimal commas",
        };
        write!(f, "separated by {}, {decimal}", self.separator.name())
    }
}

impl Dialect {
    /// Finds the dialect of a text, as far as it is not given.
    pub(super) fn of(text: &str, options: &ReadOptions) -> Result<Dialect, SheetError> {
        let mut best: Option<(i64, Dialect)> = None;
        for decimal in [Decimal::Point, Decimal::Comma] {
            for &separator in Separator::ALL {
                let is_asked = options.separator.is_none_or(|asked| asked == separator)
                    && options.decimal.is_none_or(|asked| asked == decimal);
                if !is_asked
                    || (separator == Separator::Space && options.separator.is_none() && !has_blanks(text))
                {
                    continue;
                }
                let dialect = Dialect { separator, decimal };
                let Ok(sheet) = cells(text, dialect, options.skip, Some(SAMPLE)) else { continue };
                let score = score(&sheet);
                if score > 0 && best.is_none_or(|(most, _)| score > most) {
                    best = Some((score, dialect));
                }
            }
        }
        best.map(|(_, dialect)| dialect).ok_or_else(|| {
            let line = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
            let shown: String = line.trim().chars().filter(|c| !c.is_control()).take(60).collect();
            SheetError::new(
                format!(
                    "it holds no table of numbers; its first line is {shown:?}. Expected wavelengths and at least one \
                     spectrum, in columns or in rows, separated by tabs, semicolons, commas, bars or blanks"
                ),
                Remedy::Dialect,
            )
        })
    }

    /// Refuses whole numbers between commas that may be decimal commas, where no heading counts the columns.
    pub(super) fn check(self, text: &str, sheet: &Sheet, options: &ReadOptions) -> Result<(), SheetError> {
        let is_open = self.separator == Separator::Comma
            && self.decimal == Decimal::Point
            && options.decimal.is_none()
            && !text.contains('"');
        if !is_open {
            return Ok(());
        }
        let Some(doubt) = sheet.comma_doubt() else { return Ok(()) };
        Err(SheetError::at(
            doubt.place,
            format!(
                "{:?} is either {} whole numbers between commas, or {} numbers with decimal commas ({}): say which the \
                 decimal sign is, or separate by semicolons",
                doubt.whole, doubt.cells, doubt.numbers, doubt.decimals
            ),
            Remedy::Decimal,
        ))
    }
}

fn has_blanks(text: &str) -> bool {
    let end = text.len().min(SAMPLE_BYTES);
    text.as_bytes()[..end].iter().any(|b| matches!(b, b' ' | b'\t'))
}

/// Splits text into cells; of the first `limit` lines alone, where there is a limit.
pub(in crate::dataset) fn cells(
    text: &str,
    dialect: Dialect,
    skip: usize,
    limit: Option<usize>,
) -> Result<Sheet, SheetError> {
    let is_quoted = text.contains('"');
    match dialect.separator.byte() {
        Some(byte) if is_quoted => {
            let sheet = quoted(text, byte, dialect.decimal, skip, limit)?;
            // A quote that nothing closes takes the rest of the file: then it is none.
            match sheet {
                Some(sheet) => Ok(sheet),
                None => plain(text, dialect, skip, limit),
            }
        }
        _ => plain(text, dialect, skip, limit),
    }
}

/// Lines of a text with their numbers, whatever ends them.
fn lines(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let mut rest = Some(text);
    let mut number = 0;
    std::iter::from_fn(move || {
        let text = rest?;
        number += 1;
        let end = text.as_bytes().iter().position(|b| matches!(b, b'\n' | b'\r'));
        let Some(end) = end else {
            rest = None;
            return (!text.is_empty()).then_some((number, text));
        };
        let after = if text[end..].starts_with("\r\n") { end + 2 } else { end + 1 };
        rest = Some(&text[after..]);
        Some((number, &text[..end]))
    })
}

/// The text after its first lines.
fn after(text: &str, skip: usize) -> &str {
    let start = lines(text).nth(skip).map(|(_, line)| line.as_ptr() as usize - text.as_ptr() as usize);
    &text[start.unwrap_or(text.len())..]
}

/// The line without the sign of a comment, and whether it has one.
fn uncommented(line: &str) -> (&str, bool) {
    let trimmed = line.trim_start_matches(['\u{feff}', ' ', '\t']);
    match trimmed.strip_prefix(['#', '%']) {
        Some(rest) => (rest.trim_start_matches(['#', '%', ' ']), true),
        None => (line, false),
    }
}

fn plain(text: &str, dialect: Dialect, skip: usize, limit: Option<usize>) -> Result<Sheet, SheetError> {
    let text = after(text, skip);
    let parts = match limit {
        Some(_) => vec![text],
        None => parts(text),
    };
    let sheets =
        threads::map(parts.len() as u64, 1, |part| part_of_plain(parts[part as usize], dialect, limit));
    let mut all = Sheet::new("line");
    let mut number = skip;
    for sheet in sheets {
        let (sheet, lines) = sheet?;
        all.append(sheet, number)?;
        number += lines;
    }
    Ok(all)
}

/// Text in parts of whole lines, for as many threads; one alone where it is short.
fn parts(text: &str) -> Vec<&str> {
    const LEAST: usize = 1 << 20;
    let size = text.len().div_ceil(threads::cores()).max(LEAST);
    let (mut parts, mut rest) = (Vec::new(), text);
    while rest.len() > size {
        let end = rest.as_bytes()[size..].iter().position(|b| matches!(b, b'\n' | b'\r'));
        let Some(end) = end.map(|end| size + end) else { break };
        let next = if rest.as_bytes()[end..].starts_with(b"\r\n") { end + 2 } else { end + 1 };
        // What ends a line is one byte, so that both parts are text.
        let (part, others) = rest.split_at(next);
        parts.push(part);
        rest = others;
    }
    parts.push(rest);
    parts
}

/// The cells of some lines, and how many lines they are.
fn part_of_plain(text: &str, dialect: Dialect, limit: Option<usize>) -> Result<(Sheet, usize), SheetError> {
    let mut sheet = Sheet::new("line");
    let (mut bytes, mut count) = (0, 0);
    for (number, line) in lines(text) {
        bytes += line.len();
        if limit.is_some_and(|limit| sheet.len() >= limit || bytes > SAMPLE_BYTES && sheet.len() > 20) {
            break;
        }
        count = number;
        let (line, is_comment) = uncommented(line);
        sheet.begin_row(number, is_comment);
        let parse = |text| Cell::parse(text, dialect.decimal);
        match dialect.separator.byte() {
            Some(byte) => line.split(char::from(byte)).for_each(|cell| sheet.push(parse(cell))),
            None => blanks(line, |cell| sheet.push(parse(cell))),
        }
        sheet.end_row()?;
    }
    Ok((sheet, count))
}

/// Gives the words of a line, where quotes keep blanks together and a unit belongs to the number before it.
fn blanks<'t>(line: &'t str, mut give: impl FnMut(&'t str)) {
    let mut rest = line.trim_start();
    while !rest.is_empty() {
        let quoted = rest.strip_prefix('"').and_then(|inner| inner.split_once('"'));
        let (word, after) = match quoted {
            Some(found) => found,
            None => rest.split_at(rest.find(char::is_whitespace).unwrap_or(rest.len())),
        };
        let after = after.trim_start();
        let unit = ["nm", "%", "um", "µm"].into_iter().find(|unit| {
            after
                .strip_prefix(unit)
                .is_some_and(|rest| rest.is_empty() || rest.starts_with(char::is_whitespace))
        });
        let is_number = word.ends_with(|c: char| c.is_ascii_digit());
        match unit {
            Some(unit) if is_number && quoted.is_none() => {
                let start = line.len() - rest.len();
                let end = line.len() - after.len() + unit.len();
                give(&line[start..end]);
                rest = line[end..].trim_start();
            }
            _ => {
                give(word);
                rest = after;
            }
        }
    }
}

/// Splits text with quotes; `None` where a quote spans so many lines that it must be a sign of inches.
fn quoted(
    text: &str,
    separator: u8,
    decimal: Decimal,
    skip: usize,
    limit: Option<usize>,
) -> Result<Option<Sheet>, SheetError> {
    let mut reader = ::csv::ReaderBuilder::new()
        .delimiter(separator)
        .has_headers(false)
        .flexible(true)
        .from_reader(after(text, skip).as_bytes());
    let mut sheet = Sheet::new("line");
    let mut record = ::csv::StringRecord::new();
    // A record's own line, where lines end in any way: the reader counts line feeds alone.
    let has_feeds = text.contains('\n');
    let mut records = 0;
    while reader.read_record(&mut record).is_ok_and(|more| more) {
        records += 1;
        let byte = record.position().map_or(0, |p| p.byte() as usize);
        if limit.is_some_and(|limit| sheet.len() >= limit || byte > SAMPLE_BYTES && sheet.len() > 20) {
            break;
        }
        if record.iter().any(|cell| cell.len() > 4096 && cell.contains(['\n', '\r'])) {
            return Ok(None);
        }
        let line = if has_feeds { record.position().map_or(0, |p| p.line() as usize) } else { records };
        let mut cells = record.iter();
        let first = cells.next().unwrap_or_default();
        let (first, is_comment) = uncommented(first);
        sheet.begin_row(line + skip, is_comment);
        sheet.push(Cell::parse(first, decimal));
        cells.for_each(|cell| sheet.push(Cell::parse(cell, decimal)));
        sheet.end_row()?;
    }
    Ok(Some(sheet))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Whatever ends the lines, and wherever the parts meet.
    #[test]
    fn parts_are_read_as_the_whole() {
        for end in ["\n", "\r\n", "\r"] {
            let line = |i: usize| match i % 1000 {
                0 => String::new(),
                1 => format!("# note {i}"),
                2 => format!("name {i},12 %,"),
                _ => format!("{i},{}.5,-0.25", i % 7),
            };
            let text: String = (1..200_000).map(|i| line(i) + end).collect();
            assert!(text.len() > 2 << 20);
            let dialect = Dialect { separator: Separator::Comma, decimal: Decimal::Point };
            let (whole, lines) = part_of_plain(&text, dialect, None).unwrap();
            assert_eq!(lines, 199_999);
            assert!(plain(&text, dialect, 0, None).unwrap().is(&whole), "{end:?}");
            let skipped = plain(&text, dialect, 5, None).unwrap();
            assert_eq!(skipped.len(), whole.len() - 5);
        }
    }
}
