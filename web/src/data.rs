//! Spectra that were chosen or dropped, as they were measured.

use serde::Serialize;
use spectroll::{Model, Reading, SpectrumKind, Table};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::colour;
use crate::fitted::Fitted;
use crate::refusal::Refusal;
use crate::settings::{ReadSettings, parse};

/// Source of spectra.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Origin {
    /// A built-in model, whose data these are.
    Builtin(&'static str),
    /// A file, and the settings it was read with.
    File(String, ReadSettings),
}

/// Spectra as they were measured, and how they were read.
#[wasm_bindgen]
#[derive(Clone, Debug)]
pub struct Data {
    pub(crate) origin: Origin,
    pub(crate) tables: Vec<Table>,
    pub(crate) kind: Option<SpectrumKind>,
    /// Whether the kind is only likely, by the values.
    is_guess: bool,
    reading: Option<Account>,
}

/// Account of how a file was read.
#[derive(Clone, Debug, Serialize)]
struct Account {
    format: String,
    dialect: Option<String>,
    layout: String,
    wavelengths: String,
    notes: Vec<String>,
    others: Vec<String>,
}

/// Facts about data, for the page.
#[derive(Serialize)]
struct Facts<'a> {
    name: &'a str,
    spectra: usize,
    kind: Option<SpectrumKind>,
    is_guess: bool,
    first_nm: f64,
    last_nm: f64,
    missing: usize,
    reading: &'a Option<Account>,
    tables: Vec<TableFacts<'a>>,
}

#[derive(Serialize)]
struct TableFacts<'a> {
    name: &'a str,
    spectra: usize,
    bands: usize,
}

/// Built-in models as JSON: name, kind, number of spectra and range of each.
#[wasm_bindgen]
pub fn builtins() -> String {
    #[derive(Serialize)]
    struct Row {
        name: &'static str,
        kind: SpectrumKind,
        spectra: usize,
        first_nm: f64,
        last_nm: f64,
    }
    // A name with a grid in it is another model of the same data, which the page has another control for; one with a kernel
    // has a distribution that a fit of the page does not give.
    let names = Model::BUILTIN.iter().filter(|name| !name.ends_with("nm") && !name.ends_with("-kernel"));
    let row = |name: &'static str| {
        let data = Model::builtin_data(name).expect("it is built in");
        Row { name, kind: data.kind, spectra: data.spectra, first_nm: data.first, last_nm: data.last }
    };
    serde_json::to_string(&names.copied().map(row).collect::<Vec<_>>()).expect("numbers and text are JSON")
}

#[wasm_bindgen]
impl Data {
    /// The data of a built-in model.
    pub fn builtin(name: &str) -> Result<Data, Refusal> {
        let data = Model::builtin_data(name).map_err(Refusal::new)?;
        let name = *Model::BUILTIN.iter().find(|known| **known == name).expect("it has data");
        let tables = data.tables.iter().map(|table| table.table()).collect();
        Ok(Data {
            origin: Origin::Builtin(name),
            tables,
            kind: Some(data.kind),
            is_guess: false,
            reading: None,
        })
    }

    /// Spectra of a file, read with settings that are JSON.
    pub fn read(name: &str, bytes: Vec<u8>, settings: &str) -> Result<Data, Refusal> {
        let settings: ReadSettings = parse(settings)?;
        let reading = Table::from_bytes(name, bytes, &settings.options()?)?;
        let Reading { table, format, dialect, layout, wavelengths, notes, others, .. } = reading;
        let reading = Some(Account { format, dialect, layout, wavelengths, notes, others });
        let table = table.scaled(settings.scale());
        let kind = table.kind().or_else(|| likely(&table));
        let is_guess = table.kind().is_none();
        let origin = Origin::File(name.to_owned(), settings);
        Ok(Data { origin, tables: vec![table], kind, is_guess, reading })
    }

    /// Facts about the data as JSON.
    pub fn facts(&self) -> String {
        let name = match &self.origin {
            Origin::Builtin(name) => *name,
            Origin::File(name, _) => name.as_str(),
        };
        let ends = |pick: fn(&[f64]) -> f64| self.tables.iter().map(move |table| pick(table.wavelengths()));
        let facts = Facts {
            name,
            spectra: self.tables.iter().map(Table::len).sum(),
            kind: self.kind,
            is_guess: self.is_guess,
            first_nm: ends(|w| w[0]).fold(f64::INFINITY, f64::min),
            last_nm: ends(|w| w[w.len() - 1]).fold(f64::NEG_INFINITY, f64::max),
            missing: self.tables.iter().map(Table::missing).sum(),
            reading: &self.reading,
            tables: self
                .tables
                .iter()
                .map(|t| TableFacts { name: t.name(), spectra: t.len(), bands: t.wavelengths().len() })
                .collect(),
        };
        serde_json::to_string(&facts).expect("numbers and text are JSON")
    }

    /// Wavelengths of a table, nm.
    pub fn wavelengths(&self, table: usize) -> Vec<f64> {
        self.tables[table].wavelengths().to_vec()
    }

    /// Values of at most `most` spectra of a table, evenly chosen from all, one spectrum after the other; NaN where
    /// one was not measured.
    pub fn curves(&self, table: usize, most: usize) -> Vec<f32> {
        let of = &self.tables[table];
        chosen(of.len(), most).iter().flat_map(|&i| of.spectrum(i)).map(|&v| v as f32).collect()
    }

    /// Colours of the spectra of [`curves`](Data::curves), three bytes each; empty where they have none.
    pub fn colours(&self, table: usize, most: usize, kind: &str) -> Vec<u8> {
        let kind = match kind {
            "illuminant" => Some(SpectrumKind::Illuminant),
            _ => self.kind,
        };
        let of = &self.tables[table];
        colour::of_table(of, kind, &chosen(of.len(), most))
    }

    /// Fits a model with settings that are JSON.
    pub fn fit(&self, settings: &str) -> Result<Fitted, Refusal> {
        Fitted::new(self, parse(settings)?)
    }
}

/// Reflectances, where every value is between 0 and 1; `None` of anything else. The page says that this is a guess.
fn likely(table: &Table) -> Option<SpectrumKind> {
    let values = (0..table.len()).flat_map(|index| table.spectrum(index));
    let are_shares = values.filter(|value| !value.is_nan()).all(|value| (0.0..=1.0).contains(value));
    are_shares.then_some(SpectrumKind::Reflectance)
}

/// Indices of at most `most` of `count` things, evenly chosen.
fn chosen(count: usize, most: usize) -> Vec<usize> {
    let shown = count.min(most);
    (0..shown).map(|i| i * count / shown).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = "nm,a,b,c\n400,10,20,30\n410,20,30,35\n420,30,20,10\n";

    fn read(settings: &str) -> Data {
        Data::read("mine.csv", TEXT.as_bytes().to_vec(), settings).unwrap()
    }

    #[test]
    fn a_file_is_read_and_accounted_for() {
        let facts: serde_json::Value = serde_json::from_str(&read("{}").facts()).unwrap();
        assert_eq!((&facts["spectra"], &facts["first_nm"]), (&3.into(), &400.0.into()));
        assert_eq!(facts["reading"]["format"], "text");
        assert_eq!(read(r#"{"percent":true}"#).curves(0, 9)[..3], [0.1, 0.2, 0.3]);
    }

    #[test]
    fn shares_are_likely_reflectances_and_nothing_else_is_guessed() {
        assert_eq!(read("{}").kind, None);
        let guessed = read(r#"{"percent":true}"#);
        assert_eq!((guessed.kind, guessed.is_guess), (Some(SpectrumKind::Reflectance), true));
        let refusal = read("{}").fit(r#"{"components":1,"wavelengths":"400:10:420"}"#).unwrap_err();
        assert_eq!(refusal.control, Some("kind"));
    }

    #[test]
    fn percentages_name_the_control_that_mends_them() {
        let refused = read("{}").fit(r#"{"components":1,"kind":"reflectance","wavelengths":"400:10:420"}"#);
        let refusal = refused.expect_err("30 is no reflectance");
        assert_eq!(refusal.control, Some("percent"), "{refusal}");
    }

    #[test]
    fn every_table_of_a_builtin_is_there() {
        let facts: serde_json::Value =
            serde_json::from_str(&Data::builtin("munsell-vrhel").unwrap().facts()).unwrap();
        assert_eq!(facts["spectra"], 632);
        assert_eq!(facts["tables"][1]["spectra"], 170);
        assert!(builtins().contains("\"koivisto\""));
    }

    #[test]
    fn spectra_are_chosen_from_all() {
        assert_eq!(chosen(3, 200), [0, 1, 2]);
        assert_eq!(chosen(1000, 4), [0, 250, 500, 750]);
        assert_eq!(chosen(0, 4), [0; 0]);
    }
}
