//! Settings of a reader, and its account of how it read a file.

use super::units::WavelengthUnit;
use super::{BuiltinTable, Table};

/// Settings of a reader, for what a file does not say of itself or says wrongly.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ReadOptions {
    /// Name of the array of spectra, where a file holds several.
    pub array: Option<String>,
    /// Name of the array of wavelengths, where a file holds several.
    pub wavelength_array: Option<String>,
    /// Wavelengths of the measurements (nm), of files that do not say: they take the place of what a file says.
    pub measured_at: Option<Vec<f64>>,
    /// Wavelengths (nm) of an array of as many bands, where neither the file nor [`measured_at`](Self::measured_at) says.
    pub fallback: Option<Vec<f64>>,
    /// Direction of the spectra in a table; found out where it is `None`.
    pub layout: Option<TableLayout>,
    /// Unit of the wavelengths; as the file says, or nm, where it is `None`.
    pub unit: Option<WavelengthUnit>,
    /// Sign between cells of text; found out where it is `None`.
    pub separator: Option<Separator>,
    /// Decimal sign of text; found out where it is `None`.
    pub decimal: Option<Decimal>,
    /// Number of lines of text to leave out at the top.
    pub skip: usize,
    /// Values that mean "not measured".
    pub missing_values: Vec<f64>,
}

/// Direction of the spectra in a table or a matrix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum TableLayout {
    /// Each spectrum is a column: the wavelengths run down the table.
    Columns,
    /// Each spectrum is a row: the wavelengths run across the table.
    Rows,
}

/// Sign between the cells of a line of text.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[non_exhaustive]
pub enum Separator {
    /// A tab.
    Tab,
    /// A semicolon.
    Semicolon,
    /// A comma.
    Comma,
    /// A vertical bar.
    Bar,
    /// Any number of blanks and tabs.
    Space,
}

impl Separator {
    /// Every separator, in the order in which they are tried.
    pub const ALL: &[Separator] =
        &[Separator::Tab, Separator::Semicolon, Separator::Comma, Separator::Bar, Separator::Space];

    /// Name in messages.
    pub fn name(self) -> &'static str {
        match self {
            Separator::Tab => "tabs",
            Separator::Semicolon => "semicolons",
            Separator::Comma => "commas",
            Separator::Bar => "vertical bars",
            Separator::Space => "blanks",
        }
    }

    /// The sign, where it is one.
    pub(super) fn byte(self) -> Option<u8> {
        match self {
            Separator::Tab => Some(b'\t'),
            Separator::Semicolon => Some(b';'),
            Separator::Comma => Some(b','),
            Separator::Bar => Some(b'|'),
            Separator::Space => None,
        }
    }
}

/// Sign between the whole and the fraction of a number.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Decimal {
    /// 0.5
    Point,
    /// 0,5
    Comma,
}

/// A table, and how it was read.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Reading {
    /// The spectra.
    pub table: Table,
    /// Format of the file.
    pub format: String,
    /// Encoding, separator and decimal sign of text.
    pub dialect: Option<String>,
    /// Direction of the spectra, and the reason to think so.
    pub layout: String,
    /// Place of the wavelengths, and their unit.
    pub wavelengths: String,
    /// Parts that were left out, and values that were changed, a sentence each.
    pub notes: Vec<String>,
    /// Other arrays, sheets or tables of the file, by name.
    pub others: Vec<String>,
}

impl Reading {
    /// The account of a table that is compiled in.
    pub fn builtin(builtin: BuiltinTable) -> Reading {
        Reading {
            table: builtin.table(),
            format: "built-in table".to_owned(),
            dialect: None,
            layout: "spectra in columns".to_owned(),
            wavelengths: "compiled in, in nm".to_owned(),
            notes: Vec::new(),
            others: Vec::new(),
        }
    }
}
