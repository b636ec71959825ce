//! Random tables of text in every layout and dialect that the field has: each is read as it was meant, or refused; never
//! read wrongly.
//!
//! The numbers that are written are the truth, and whoever writes them here shares no code with the reader. A table without
//! a hazard must be read; one with a hazard (a marker, wavelengths in another unit or out of order, signs that can be read
//! in two ways) may be refused instead.

use std::fmt::Write as _;

use spectroll::{
    Dataset, DatasetError, Extrapolation, Grid, ReadOptions, Reading, Remedy, SpectrumKind, Table,
    WavelengthUnit,
};

/// Steele, Lea & Flood's generator: a table of a seed is always the same.
struct Random(u64);

impl Random {
    fn word(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn below(&mut self, n: usize) -> usize {
        (self.word() % n as u64) as usize
    }

    fn of<'a, T>(&mut self, all: &'a [T]) -> &'a T {
        let index = self.below(all.len());
        &all[index]
    }

    /// Whether something happens that happens once in `n` times.
    fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    fn unit(&mut self) -> f64 {
        (self.word() >> 11) as f64 / (1u64 << 53) as f64
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Ids {
    None,
    Names,
    Counter,
    Numbers,
}

/// Everything that is random about a table.
#[derive(Debug)]
struct Case {
    seed: u64,
    in_rows: bool,
    separator: char,
    comma: bool,
    quoted: bool,
    ids: Ids,
    headed: bool,
    unit: &'static str,
    unit_stated: bool,
    cell_units: bool,
    percent: bool,
    order: &'static str,
    marker: Option<&'static str>,
    before: usize,
    after: usize,
    blank: bool,
    trailing: bool,
    comment: bool,
    ending: &'static str,
    encoding: &'static str,
    digits: usize,
    /// In nm, as in the file.
    wavelengths: Vec<f64>,
    spectra: Vec<Vec<f64>>,
}

/// A number as it is written, and the value that whoever reads it should get.
fn written(value: f64, digits: usize) -> (String, f64) {
    let text = format!("{value:.digits$}");
    let value = text.parse().expect("it is a number");
    (text, value)
}

impl Case {
    fn new(seed: u64) -> Case {
        let mut random = Random(seed);
        let r = &mut random;
        let in_rows = r.once_in(2);
        let separator = *r.of(&[',', ';', '\t', '|', ' ']);
        let comma = separator != ',' && r.once_in(3);
        let bands = *r.of(&[5, 8, 12, 31, 61]);
        let count = *r.of(&[1, 2, 3, 7, 20]);
        let digits = *r.of(&[3, 4, 6]);
        let (start, step) = (380.0 + r.below(21) as f64, *r.of(&[1.0, 2.0, 5.0, 10.0, 2.5]));
        let uneven = r.once_in(4);
        let mut at = start;
        let mut wavelengths: Vec<f64> = (0..bands)
            .map(|_| {
                let here = at;
                at += if uneven { step * (1.0 + (r.below(80) as f64) / 100.0) } else { step };
                (here * 1000.0).round() / 1000.0
            })
            .collect();
        let order = *r.of(&["rising", "rising", "rising", "rising", "falling", "shuffled", "repeated"]);
        match order {
            "falling" => wavelengths.reverse(),
            "shuffled" => wavelengths.swap(1, 3),
            "repeated" => wavelengths[2] = wavelengths[1],
            _ => {}
        }
        let spectra = (0..count)
            .map(|_| {
                let (level, tilt, phase) = (0.2 + 0.5 * r.unit(), 0.2 * r.unit(), 6.0 * r.unit());
                let value = |band: usize| level + tilt * (band as f64 / 5.0 + phase).sin() * 0.9;
                (0..bands).map(|band| written(value(band).clamp(0.001, 0.99), digits).1).collect()
            })
            .collect();
        let unit = *r.of(&["nm", "nm", "nm", "nm", "um", "angstrom", "cm-1"]);
        Case {
            seed,
            in_rows,
            separator,
            comma,
            quoted: separator != ' ' && r.once_in(5),
            ids: *r.of(&[Ids::None, Ids::Names, Ids::Counter, Ids::Numbers]),
            headed: r.below(4) > 0,
            unit,
            unit_stated: r.once_in(2),
            cell_units: unit == "nm" && r.once_in(8),
            percent: r.once_in(8),
            order,
            marker: if r.once_in(4) {
                Some(*r.of(&[
                    "-999",
                    "-9999",
                    "-1.23e34",
                    "9.96921e36",
                    "65535",
                    "NaN",
                    "",
                    "n/a",
                    "-99.9",
                    "1e20",
                ]))
            } else {
                None
            },
            before: *r.of(&[0, 0, 0, 1, 3]),
            after: *r.of(&[0, 0, 0, 1]),
            blank: r.once_in(5),
            trailing: separator != ' ' && r.once_in(5),
            comment: r.once_in(6),
            ending: r.of::<&str>(&["\n", "\r\n", "\r"]),
            encoding: r.of::<&str>(&["utf8", "utf8", "bom", "utf16le", "utf16be", "latin"]),
            digits,
            wavelengths,
            spectra,
        }
    }

    fn number(&self, text: String) -> String {
        let text = if self.comma { text.replace('.', ",") } else { text };
        if self.quoted { format!("\"{text}\"") } else { text }
    }

    fn wavelength(&self, nm: f64) -> String {
        let value = match self.unit {
            "um" => nm / 1000.0,
            "angstrom" => nm * 10.0,
            "cm-1" => 1e7 / nm,
            _ => nm,
        };
        let text = if self.unit == "cm-1" {
            format!("{value:.9}")
        } else {
            format!("{}", (value * 1e6).round() / 1e6)
        };
        let text = if self.cell_units { format!("{text} nm") } else { text };
        self.number(text)
    }

    /// The value of a cell, and whether it is the one that is marked.
    fn value(&self, spectrum: usize, band: usize) -> String {
        if let (Some(marker), true) = (self.marker, self.is_marked(spectrum, band)) {
            return self.number(if self.separator == ' ' && marker.is_empty() {
                "NaN".to_owned()
            } else {
                marker.to_owned()
            });
        }
        let value = self.spectra[spectrum][band];
        match self.percent {
            true => self.number(format!("{:.*} %", self.digits, value * 100.0)),
            false => self.number(format!("{value:.*}", self.digits)),
        }
    }

    fn is_marked(&self, spectrum: usize, band: usize) -> bool {
        self.marker.is_some()
            && spectrum == self.seed as usize % self.spectra.len()
            && band == (self.seed / 64) as usize % self.wavelengths.len()
    }

    fn title(&self) -> String {
        let stated = if self.unit_stated {
            format!("Wellenlänge [{}]", self.unit)
        } else {
            "Wellenlänge".to_owned()
        };
        if self.separator == ' ' { stated.replace(' ', "_") } else { stated }
    }

    fn names(&self) -> Vec<String> {
        let name = |i: usize| match self.ids {
            Ids::Names if self.quoted => format!("\"Größe {i}{} rot\"", self.separator),
            Ids::Names | Ids::None => format!("Größe{i}"),
            Ids::Counter => format!("{}", i + 1),
            Ids::Numbers => format!("{}", 1001 + i),
        };
        (0..self.spectra.len()).map(name).collect()
    }

    fn text(&self) -> String {
        let mut rows: Vec<Vec<String>> = Vec::new();
        if self.in_rows {
            let mut head: Vec<String> = self.wavelengths.iter().map(|&nm| self.wavelength(nm)).collect();
            if self.ids != Ids::None {
                head.insert(0, "Sample".to_owned());
            }
            rows.push(head);
            for (spectrum, name) in self.names().iter().enumerate() {
                let mut row: Vec<String> =
                    (0..self.wavelengths.len()).map(|band| self.value(spectrum, band)).collect();
                if self.ids != Ids::None {
                    row.insert(0, name.clone());
                }
                rows.push(row);
            }
        } else {
            if self.headed {
                rows.push([vec![self.title()], self.names()].concat());
            }
            for (band, &nm) in self.wavelengths.iter().enumerate() {
                let mut row = vec![self.wavelength(nm)];
                row.extend((0..self.spectra.len()).map(|spectrum| self.value(spectrum, band)));
                rows.push(row);
            }
        }
        let mut text = String::new();
        for line in
            ["Instrument: model 3 (größer)", "Operator: nobody", "Measured in May"].iter().take(self.before)
        {
            let _ = write!(text, "{line}{}", self.ending);
        }
        if self.comment {
            let _ = write!(text, "# 12 scans were averaged{}", self.ending);
        }
        let half = rows.len() / 2;
        for (index, row) in rows.iter().enumerate() {
            text += &row.join(&self.separator.to_string());
            if self.trailing {
                text.push(self.separator);
            }
            text += self.ending;
            if self.blank && index == half {
                text += self.ending;
            }
        }
        for _ in 0..self.after {
            let _ = write!(text, "End of data{}", self.ending);
        }
        text
    }

    fn bytes(&self) -> Vec<u8> {
        let text = self.text();
        let units = |big: bool| {
            let pair = move |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
            std::iter::once(0xFEFF).chain(text.encode_utf16()).flat_map(pair).collect::<Vec<u8>>()
        };
        match self.encoding {
            "bom" => [b"\xEF\xBB\xBF", text.as_bytes()].concat(),
            "utf16le" => units(false),
            "utf16be" => units(true),
            "latin" => text.chars().map(|c| c as u8).collect(),
            _ => text.clone().into_bytes(),
        }
    }

    /// Whether a reader may refuse the table: anything that is in doubt, or that no measurement is.
    fn has_hazard(&self) -> bool {
        let is_number = |marker: &str| marker.parse::<f64>().is_ok_and(|v| !v.is_nan());
        let in_doubt = self.wavelengths.len() < 8 && self.spectra.len() > 1;
        // A decimal sign is told only where there is one, and not from two cells a line.
        self.order == "shuffled"
            || self.order == "repeated"
            || self.unit != "nm"
            || self.marker.is_some_and(is_number)
            || in_doubt
            || self.marker.is_some() && (self.spectra.len() < 3 || self.percent)
            || self.cell_units && self.in_rows
            || self.separator == ' ' && self.percent
            || self.before > 0 && self.separator == ' ' && self.wavelengths.len() < 12
            // Numbers of samples in steps of one, beside wavelengths in steps of one.
            || self.ids == Ids::Numbers && self.spectra.len() > 1
    }

    /// Whether a table is the one that was written.
    fn is_right(&self, table: &Table) -> bool {
        let falls = self.wavelengths[0] > self.wavelengths[self.wavelengths.len() - 1];
        let at = |band: usize| if falls { self.wavelengths.len() - 1 - band } else { band };
        let near = |a: f64, b: f64| (a - b).abs() <= 1e-9 * b.abs();
        table.len() == self.spectra.len()
            && table.wavelengths().len() == self.wavelengths.len()
            && (0..table.wavelengths().len()).all(|band| {
                near(table.wavelengths()[band], self.wavelengths[at(band)])
                    && (0..table.len()).all(|spectrum| {
                        let found = table.spectrum(spectrum)[band];
                        match (self.is_marked(spectrum, at(band)), self.marker) {
                            (true, Some(marker)) => match marker.parse::<f64>() {
                                Ok(value) if !value.is_nan() => {
                                    near(found, value) || near(found, value / 100.0)
                                }
                                _ => found.is_nan(),
                            },
                            _ => near(found, self.spectra[spectrum][at(band)]),
                        }
                    })
            })
    }

    /// What becomes of the table: how it was read, and whether a fit takes it.
    fn read(&self, folder: &std::path::Path) -> (Result<Reading, DatasetError>, Option<String>) {
        let path = folder.join(format!("{}.txt", self.seed));
        std::fs::write(&path, self.bytes()).expect("the folder is there");
        let reading = Table::read(&path, &ReadOptions::default());
        let refusal = reading.as_ref().ok().and_then(|reading| {
            // The wavelengths that the owner of the data asks for.
            let (first, last) =
                self.wavelengths.iter().fold((f64::INFINITY, 0.0f64), |(a, b), &w| (a.min(w), b.max(w)));
            let grid = Grid::new(first, (last - first) / 10.0, 10).expect("a grid");
            match Dataset::new(std::slice::from_ref(&reading.table), grid, Extrapolation::Error) {
                Ok(data) => data.judge(SpectrumKind::Reflectance).err().map(|e| e.to_string()),
                Err(error) => Some(error.to_string()),
            }
        });
        (reading, refusal)
    }
}

#[test]
fn tables_are_read_rightly_or_refused() {
    let folder = tempfile::tempdir().expect("a folder");
    let (mut right, mut refused) = (0, 0);
    let mut wrong = Vec::new();
    let count = std::env::var("SPECTROLL_TABLES").ok().and_then(|n| n.parse().ok()).unwrap_or(600);
    for seed in 0..count {
        let case = Case::new(seed);
        let (reading, refusal) = case.read(folder.path());
        let is_number = |marker: &str| marker.parse::<f64>().is_ok_and(|v| !v.is_nan());
        let fault = match (&reading, &refusal) {
            (Err(_), _) | (_, Some(_)) if case.has_hazard() => {
                refused += 1;
                None
            }
            (Err(error), _) => Some(format!("refused without need: {error}")),
            // Missing values are refused by a fit that needs them.
            (Ok(reading), Some(_)) if case.marker.is_some() && case.is_right(&reading.table) => {
                refused += 1;
                None
            }
            (Ok(_), Some(error)) => Some(format!("judged without need: {error}")),
            (Ok(reading), None) if !case.is_right(&reading.table) => {
                Some(format!("read wrongly: {reading:?}"))
            }
            (Ok(reading), None) if case.marker.is_some_and(is_number) => {
                Some(format!("a marker is taken for a value: {reading:?}"))
            }
            (Ok(reading), None) if matches!(case.order, "shuffled" | "repeated") => {
                Some(format!("wavelengths out of order are taken: {reading:?}"))
            }
            (Ok(_), None) => {
                right += 1;
                None
            }
        };
        if let Some(fault) = fault {
            let text: String = case.text().replace('\r', "\n").lines().take(6).collect::<Vec<_>>().join("\n");
            let lines: Vec<String> = text.lines().map(|line| line.chars().take(100).collect()).collect();
            let settings: String =
                format!("{case:?}").split(", wavelengths").next().unwrap_or_default().to_owned();
            let fault: String = fault.chars().take(500).collect();
            wrong.push(format!("{settings}\n{}\n--> {fault}", lines.join("\n")));
        }
    }
    println!("{count} tables: {right} read rightly, {refused} refused, {} otherwise", wrong.len());
    assert!(
        wrong.is_empty(),
        "{} of {count}; the first:\n{}",
        wrong.len(),
        wrong[..wrong.len().min(12)].join("\n\n")
    );
    assert!(right * 4 > count as usize, "too few are read: {right} of {count}");
}

/// The test notices a reader that is wrong: one that takes rows for columns, or forgets what is missing.
#[test]
fn a_wrong_reading_is_noticed() {
    let mut noticed = 0;
    for seed in 0..200 {
        let case = Case::new(seed);
        let spectra: Vec<Vec<f64>> =
            case.spectra.iter().map(|s| s.iter().map(|v| v * 1.001).collect()).collect();
        let mut wavelengths = case.wavelengths.clone();
        wavelengths.sort_by(f64::total_cmp);
        wavelengths.dedup();
        if wavelengths.len() == case.wavelengths.len() {
            let table = Table::new("wrong", wavelengths, &spectra).expect("a table");
            noticed += usize::from(!case.is_right(&table));
            continue;
        }
        noticed += 1;
    }
    assert_eq!(noticed, 200);
}

/// Whatever stands before the spectra, the refusal names the unit that mends it.
#[test]
fn other_units_are_named_in_both_layouts() {
    let folder = tempfile::tempdir().expect("a folder");
    let nm: Vec<f64> = (0..16).map(|i| 400.0 + 20.0 * f64::from(i)).collect();
    let value = |spectrum: usize, band: usize| 20.0 + 10.0 * (spectrum as f64) + (band as f64 * 0.7).sin();
    for (unit, of) in [
        (WavelengthUnit::Um, (|nm| nm / 1e3) as fn(f64) -> f64),
        (WavelengthUnit::Angstrom, |nm| nm * 10.0),
        (WavelengthUnit::PerCm, |nm| 1e7 / nm),
    ] {
        for ids in ["", "id,s", "sample,"] {
            let (head, prefix) = ids.split_once(',').unwrap_or_default();
            let first = |text: String| if ids.is_empty() { String::new() } else { text + "," };
            let joined = |cells: Vec<String>| cells.join(",");
            let mut rows = first(head.to_owned()) + &joined(nm.iter().map(|&w| of(w).to_string()).collect());
            for spectrum in 0..3 {
                let values = (0..nm.len()).map(|band| format!("{:.3}", value(spectrum, band))).collect();
                rows += &format!("\n{}{}", first(format!("{prefix}{}", spectrum + 7)), joined(values));
            }
            let mut columns = format!("{},a,b,c", if head.is_empty() { "x" } else { head });
            for (band, &w) in nm.iter().enumerate() {
                let values = (0..3).map(|spectrum| format!("{:.3}", value(spectrum, band))).collect();
                columns += &format!("\n{},{}", of(w), joined(values));
            }
            for text in [rows, columns] {
                let path = folder.path().join("x.csv");
                std::fs::write(&path, &text).expect("the folder is there");
                // Numbers that may be nm are read as such, and lie nowhere near the grid.
                let error = Table::read(&path, &ReadOptions::default())
                    .and_then(|reading| Dataset::new(&[reading.table], Grid::DEFAULT, Extrapolation::Error))
                    .expect_err(&text);
                assert_eq!(error.remedy(), Remedy::Unit(unit), "{error}\n{text}");
                let read = Table::read(&path, &ReadOptions { unit: Some(unit), ..ReadOptions::default() });
                let table = read.unwrap_or_else(|e| panic!("{e}\n{text}")).table;
                assert!(
                    table.len() == 3
                        && table.wavelengths().iter().zip(&nm).all(|(a, b)| (a - b).abs() < 1e-6)
                );
            }
        }
    }
}
