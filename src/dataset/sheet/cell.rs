//! Single cells: numbers in the ways people and instruments write them.

use crate::dataset::reading::Decimal;
use crate::dataset::units::WavelengthUnit;

/// Content of a cell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(in crate::dataset) enum Cell<'t> {
    /// A number.
    Number(f64),
    /// A number of percent, which is a hundred times the value.
    Percent(f64),
    /// A number with a unit of length behind it.
    Length(f64, WavelengthUnit),
    /// Nothing, or a word for nothing.
    Missing,
    /// Anything else.
    Text(&'t str),
}

/// Words for a value that is not there, in small letters.
const MISSING: [&str; 20] = [
    "nan", "na", "n/a", "n.a.", "#n/a", "null", "none", "nil", "-", "--", "---", ".", "*", "?", "missing",
    "<na>", "1.#qnan", "-1.#ind", "1.#ind", "-nan",
];

impl<'t> Cell<'t> {
    /// Reads a cell.
    pub(in crate::dataset) fn parse(text: &'t str, decimal: Decimal) -> Cell<'t> {
        let text = text.trim_matches(|c: char| c.is_whitespace() || c == '\u{feff}' || c == '\0');
        if text.is_empty() {
            return Cell::Missing;
        }
        if let Some(value) = number(text, decimal) {
            return Cell::Number(value);
        }
        let is_word = text.len() <= 8 && MISSING.contains(&text.to_ascii_lowercase().as_str());
        if is_word {
            return Cell::Missing;
        }
        if let Some(value) = text.strip_suffix('%').and_then(|rest| number(rest.trim_end(), decimal)) {
            return Cell::Percent(value);
        }
        // A number with a unit: only what follows the number can be one.
        let end = text.find(|c: char| c.is_alphabetic() || c == '°').unwrap_or(text.len());
        let (head, tail) = text.split_at(end);
        let tail = tail.trim();
        if end > 0
            && tail.len() <= 12
            && !tail.eq_ignore_ascii_case("a")
            && (tail.contains("cm") || !tail.contains(|c: char| c.is_ascii_digit()))
            && let (Some(value), Some(unit)) =
                (number(head.trim_end(), decimal), WavelengthUnit::named_in(tail))
        {
            return Cell::Length(value, unit);
        }
        Cell::Text(text)
    }
}

/// A number with this decimal sign: digits, an exponent that may be Fortran's, and any sign of minus.
pub(super) fn number(text: &str, decimal: Decimal) -> Option<f64> {
    let first = text.bytes().next()?;
    let begins = first.is_ascii_digit() || matches!(first, b'-' | b'+' | b'.' | b',') || first >= 0x80;
    // "inf" and "nan" are words; the first is a number all the same, so that a message shows it.
    if !begins && !first.eq_ignore_ascii_case(&b'i') {
        return None;
    }
    let is_plain = decimal == Decimal::Point
        && text.bytes().all(|b| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+' | b'e' | b'E'));
    if is_plain {
        return text.parse().ok();
    }
    let mut plain = String::with_capacity(text.len());
    for (at, c) in text.char_indices() {
        plain.push(match (c, decimal) {
            (',', Decimal::Comma) => {
                let next = text.as_bytes().get(at + 1);
                if !next.is_some_and(u8::is_ascii_digit) {
                    return None;
                }
                '.'
            }
            (',', Decimal::Point) | ('.', Decimal::Comma) => return None,
            ('\u{2212}' | '\u{2013}', _) => '-',
            ('d' | 'D', _) => 'e',
            (c, _) => c,
        });
    }
    let value: f64 = plain.parse().ok()?;
    (!value.is_nan()).then_some(value)
}

/// Wavelength that a heading names, as in `400`, `400 nm`, `R400`, `X400.5` or `NM_400`, and the unit that it has. Whether
/// letters stand before the number is the last of the three.
pub(in crate::dataset) fn heading_wavelength(
    text: &str,
    decimal: Decimal,
) -> Option<(f64, Option<WavelengthUnit>, bool)> {
    let text = text.trim().trim_matches(['[', ']', '(', ')', '"', '\'']);
    match Cell::parse(text, decimal) {
        Cell::Number(value) => return Some((value, None, false)),
        Cell::Length(value, unit) => return Some((value, Some(unit), false)),
        _ => {}
    }
    let start = text.find(|c: char| c.is_ascii_digit())?;
    let (prefix, rest) = text.split_at(start);
    let is_prefix = prefix.len() <= 16
        && prefix
            .chars()
            .all(|c| c.is_alphabetic() || matches!(c, '_' | ' ' | '.' | '-' | '(' | '[' | ':' | '=' | '@'));
    if !is_prefix {
        return None;
    }
    let unit = WavelengthUnit::named_in(prefix);
    match Cell::parse(rest.trim_end_matches([')', ']']), decimal) {
        Cell::Number(value) => Some((value, unit, true)),
        Cell::Length(value, unit) => Some((value, Some(unit), true)),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_as_people_write_them() {
        use Decimal::{Comma, Point};
        for (text, decimal, value) in [
            ("0.5", Point, 0.5),
            (" +1.5E-3 ", Point, 1.5e-3),
            ("1.0D+02", Point, 100.0),
            ("\u{2212}0.5", Point, -0.5),
            (".5", Point, 0.5),
            ("0,5", Comma, 0.5),
            ("-1,5e3", Comma, -1500.0),
            ("12", Comma, 12.0),
            ("inf", Point, f64::INFINITY),
        ] {
            assert_eq!(Cell::parse(text, decimal), Cell::Number(value), "{text}");
        }
        for (text, decimal) in [
            ("0,5", Point),
            ("0.5", Comma),
            ("1.234,5", Comma),
            ("5,", Comma),
            ("1 2", Point),
            ("0x1", Point),
        ] {
            assert!(matches!(Cell::parse(text, decimal), Cell::Text(_)), "{text}");
        }
        for text in ["", " ", "NaN", "n/a", "#N/A", "--", "-1.#IND"] {
            assert_eq!(Cell::parse(text, Point), Cell::Missing, "{text}");
        }
        assert_eq!(Cell::parse("12.3 %", Point), Cell::Percent(12.3));
        assert_eq!(Cell::parse("380 nm", Point), Cell::Length(380.0, WavelengthUnit::Nm));
        assert_eq!(Cell::parse("0,38 µm", Comma), Cell::Length(0.38, WavelengthUnit::Um));
    }

    #[test]
    fn wavelengths_in_headings() {
        for (text, value, lettered) in [
            ("400", 400.0, false),
            ("400nm", 400.0, false),
            ("R400", 400.0, true),
            ("X400.5", 400.5, true),
            ("SPECTRAL_NM400", 400.0, true),
            ("NM_400", 400.0, true),
            ("R(400)", 400.0, true),
        ] {
            let found =
                heading_wavelength(text, Decimal::Point).map(|(value, _, lettered)| (value, lettered));
            assert_eq!(found, Some((value, lettered)), "{text}");
        }
        for text in ["leaf", "s1b", "400-410", ""] {
            assert!(heading_wavelength(text, Decimal::Point).is_none(), "{text}");
        }
    }
}
