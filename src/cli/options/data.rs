//! Files of measured spectra, and how to read them.

use std::path::Path;

use spectroll::suggestion::closest;
use spectroll::{
    BuiltinTable, Decimal, Grid, Model, ReadOptions, Reading, Separator, Table, TableLayout, WavelengthUnit,
};

use crate::cli::exit::Usage;

/// Settings of the readers, for what a file does not say of itself or says wrongly.
#[derive(Clone, clap::Args)]
#[command(next_help_heading = "Reading files")]
pub(in crate::cli) struct DataArguments {
    /// Multiply the data by this: 0.01 makes reflectances of percentages
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", value_parser = factor, allow_negative_numbers = true)]
    scale: f64,
    /// Direction of the spectra in a table or a matrix [default: found out]
    #[arg(long, value_enum)]
    layout: Option<TableLayout>,
    /// Unit of the wavelengths [default: as the file states, or nm]
    #[arg(long, value_enum)]
    unit: Option<WavelengthUnit>,
    /// Values that mean "not measured", as in --missing-value=-999 (several, with commas between them)
    #[arg(long, value_name = "V", value_delimiter = ',', allow_negative_numbers = true)]
    missing_value: Vec<f64>,
    /// Sign between the cells of text [default: found out]
    #[arg(long, value_enum)]
    separator: Option<Separator>,
    /// Decimal sign of text [default: found out]
    #[arg(long, value_enum)]
    decimal: Option<Decimal>,
    /// Leave out this many lines at the top of text
    #[arg(long, value_name = "N", default_value_t = 0)]
    skip: usize,
}

/// A factor above 0.
pub(in crate::cli) fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor: &f64| factor.is_finite() && *factor > 0.0);
    factor.ok_or_else(|| "expected a number above 0".to_owned())
}

/// A name on the command line: FILE, FILE:ARRAY, FILE@WAVELENGTHS or FILE:ARRAY@WAVELENGTHS.
#[derive(Debug, PartialEq)]
struct Source<'a> {
    path: &'a str,
    array: Option<&'a str>,
    /// The name of an array, or start:step:stop.
    wavelengths: Option<&'a str>,
}

impl<'a> Source<'a> {
    fn of(name: &'a str) -> Source<'a> {
        let exists = |path: &str| Path::new(path).exists();
        if exists(name) {
            return Source { path: name, array: None, wavelengths: None };
        }
        let (rest, wavelengths) = match name.rsplit_once('@') {
            Some((rest, wavelengths)) if !wavelengths.is_empty() && !rest.is_empty() => {
                (rest, Some(wavelengths))
            }
            _ => (name, None),
        };
        if exists(rest) {
            return Source { path: rest, array: None, wavelengths };
        }
        match rest.rsplit_once(':') {
            Some((path, array)) if !path.is_empty() && !array.is_empty() => {
                Source { path, array: Some(array), wavelengths }
            }
            _ => Source { path: rest, array: None, wavelengths },
        }
    }
}

impl DataArguments {
    /// Reads what a name stands for: a built-in table, a file, an array of one. `grid` is that of files whose spectra have
    /// no wavelengths.
    pub(in crate::cli) fn read(&self, name: &str, grid: Option<&Grid>) -> anyhow::Result<Reading> {
        let options = ReadOptions {
            layout: self.layout,
            unit: self.unit,
            separator: self.separator,
            decimal: self.decimal,
            skip: self.skip,
            missing_values: self.missing_value.clone(),
            ..ReadOptions::default()
        };
        read(name, grid, options)
    }

    /// The table of a name, scaled, and notes on what was done to it.
    pub(in crate::cli) fn table(
        &self,
        name: &str,
        grid: Option<&Grid>,
    ) -> anyhow::Result<(Table, Vec<String>)> {
        if let Some(builtin) = BuiltinTable::named(name) {
            return Ok((builtin.table().scaled(self.scale), Vec::new()));
        }
        let Reading { table, notes, .. } = self.read(name, grid)?;
        Ok((table.scaled(self.scale), notes))
    }

    /// Whether any setting differs from what is done unless told otherwise.
    pub(in crate::cli) fn is_asked(&self) -> bool {
        self.scale != 1.0
            || self.layout.is_some()
            || self.unit.is_some()
            || !self.missing_value.is_empty()
            || self.separator.is_some()
            || self.decimal.is_some()
            || self.skip != 0
    }

    /// Factor of all values.
    pub(in crate::cli) fn scale(&self) -> f64 {
        self.scale
    }
}

/// Reads what a name stands for: a file, or an array of one as `FILE:ARRAY@WAVELENGTHS`. `grid` is that of files whose
/// spectra have no wavelengths.
pub(in crate::cli) fn read(
    name: &str,
    grid: Option<&Grid>,
    settings: ReadOptions,
) -> anyhow::Result<Reading> {
    let source = Source::of(name);
    if Path::new(source.path).extension().is_none() && !Path::new(source.path).exists() {
        return Err(Usage(no_data(name)).into());
    }
    let is_grid = |text: &&str| text.contains([':', ',']);
    let measured = source.wavelengths.filter(is_grid).map(str::parse::<Grid>).transpose();
    let measured = measured.map_err(|e| Usage(format!("{name:?}: {e}")))?;
    let options = ReadOptions {
        array: source.array.map(str::to_owned),
        wavelength_array: source.wavelengths.filter(|text| !is_grid(text)).map(str::to_owned),
        measured_at: measured.map(|grid| grid.wavelengths().collect()),
        fallback: grid.map(|grid| grid.wavelengths().collect()),
        ..settings
    };
    Ok(Table::read(source.path, &options)?)
}

/// Says what a name that is no file's may have meant.
fn no_data(name: &str) -> String {
    if Model::BUILTIN.contains(&name) {
        return format!(
            "{name} is a model, fitted already, and measured spectra are wanted here; `spectroll sample {name} --wavelengths \
             START:STEP:STOP` fits it at another grid"
        );
    }
    let tables = || BuiltinTable::ALL.iter().map(|table| table.name());
    let known = tables().collect::<Vec<_>>().join(", ");
    let meant = closest(name, tables()).map_or(String::new(), |meant| format!(", did you mean {meant}?"));
    format!("{name:?} is neither a file nor a built-in table ({known}){meant}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_arrays_and_wavelengths() {
        for (name, path, array, wavelengths) in [
            ("a.mat", "a.mat", None, None),
            ("a.mat:x", "a.mat", Some("x"), None),
            ("a.mat:x@w", "a.mat", Some("x"), Some("w")),
            ("a.npy@380:5:780", "a.npy", None, Some("380:5:780")),
            ("a.h5:lib/x@lib/w", "a.h5", Some("lib/x"), Some("lib/w")),
        ] {
            assert_eq!(Source::of(name), Source { path, array, wavelengths }, "{name}");
        }
    }
}
