//! JCAMP-DX: one spectrum as text, in the form that writes every number out (AFFN).

use std::collections::HashMap;
use std::path::Path;

use nalgebra::DMatrix;

use super::reading::{ReadOptions, Reading};
use super::units::WavelengthUnit;
use super::{DatasetError, Table};
use crate::wording::counted;

/// Reads the first block of data.
pub(super) fn read(path: &Path, text: &str, options: &ReadOptions) -> Result<Reading, DatasetError> {
    let failed = |reason: String| DatasetError::Format { path: path.to_owned(), format: "JCAMP-DX", reason };
    let mut entries: HashMap<String, &str> = HashMap::new();
    for record in text.split("##").skip(1) {
        let Some((label, value)) = record.split_once('=') else { continue };
        let label: String =
            label.chars().filter(|c| !matches!(c, ' ' | '-' | '/' | '_')).collect::<String>().to_uppercase();
        if matches!(label.as_str(), "XYDATA" | "XYPOINTS")
            && (entries.contains_key("XYDATA") || entries.contains_key("XYPOINTS"))
        {
            return Err(failed(
                "it holds several spectra: export each into a file of its own, or all as one table of text"
                    .to_owned(),
            ));
        }
        entries.entry(label).or_insert(value);
    }
    let number = |label: &str| {
        entries.get(label).and_then(|text| text.trim().lines().next()?.trim().parse::<f64>().ok())
    };
    let (x_factor, y_factor) = (number("XFACTOR").unwrap_or(1.0), number("YFACTOR").unwrap_or(1.0));
    let (x, y) = if let Some(data) = entries.get("XYDATA") {
        steps(data, number("FIRSTX"), number("LASTX"), number("NPOINTS"), x_factor).map_err(failed)?
    } else if let Some(data) = entries.get("XYPOINTS") {
        points(data, x_factor).map_err(failed)?
    } else {
        return Err(failed("it has neither ##XYDATA nor ##XYPOINTS: export it as text".to_owned()));
    };
    let stated = entries.get("XUNITS").and_then(|text| WavelengthUnit::named_in(text));
    let unit = options.unit.or(stated).unwrap_or(WavelengthUnit::Nm);
    let wavelengths: Vec<f64> = x.iter().map(|&x| unit.in_nm(x)).collect();
    let values: Vec<f64> = y.iter().map(|y| y * y_factor).collect();
    let mut notes = Vec::new();
    if let Some(y_units) = entries.get("YUNITS") {
        notes.push(format!("the values are {}", y_units.trim().lines().next().unwrap_or_default()));
    }
    let spectra = DMatrix::from_vec(values.len(), 1, values);
    let table = Table::from_measured(&format!("{path:?}"), wavelengths, spectra, &mut notes)?;
    Ok(Reading {
        table,
        format: "JCAMP-DX".to_owned(),
        dialect: None,
        layout: "one spectrum".to_owned(),
        wavelengths: format!("##XUNITS: {unit}"),
        notes,
        others: Vec::new(),
    })
}

/// Numbers of a line, which blanks, commas and signs separate.
fn numbers(line: &str) -> Result<Vec<f64>, String> {
    let line = line.split("$$").next().unwrap_or_default();
    let mut spaced = String::new();
    let mut before = ' ';
    for c in line.chars() {
        // A sign begins a number, but for that of an exponent.
        if matches!(c, '+' | '-') && !matches!(before, 'e' | 'E') {
            spaced.push(' ');
        }
        spaced.push(c);
        before = c;
    }
    let word = |word: &str| {
        word.parse().map_err(|_| format!("{word:?} is not a number; export it uncompressed (AFFN)"))
    };
    spaced.split([' ', ',', ';', '\t']).filter(|w| !w.is_empty()).map(word).collect()
}

/// Values in even steps: each line begins with its first abscissa.
fn steps(
    data: &str,
    first: Option<f64>,
    last: Option<f64>,
    count: Option<f64>,
    factor: f64,
) -> Result<(Vec<f64>, Vec<f64>), String> {
    let mut lines = data.lines();
    let form = lines.next().unwrap_or_default().replace(' ', "");
    if !form.starts_with("(X++(Y..Y))") {
        return Err(format!("data of the form {form} are not read: export it as text"));
    }
    let (mut values, mut checks) = (Vec::new(), Vec::new());
    for line in lines.map(str::trim).filter(|line| !line.is_empty()) {
        let all = numbers(line)?;
        let [x, line_values @ ..] = all.as_slice() else { continue };
        checks.push((values.len(), x * factor));
        values.extend_from_slice(line_values);
    }
    let (Some(first), Some(last)) = (first, last) else {
        return Err("it has no ##FIRSTX and ##LASTX".to_owned());
    };
    if count.is_some_and(|count| count != values.len() as f64) || values.len() < 2 {
        return Err(format!(
            "{} where ##NPOINTS says {}",
            counted(values.len() as u64, "value", "values"),
            count.unwrap_or(f64::NAN)
        ));
    }
    let step = (last - first) / (values.len() - 1) as f64;
    let x: Vec<f64> = (0..values.len()).map(|i| first + step * i as f64).collect();
    for (at, written) in checks {
        if at < x.len() && (x[at] - written).abs() > step.abs() {
            return Err(format!("a line begins at {written}, where its values are at {}", x[at]));
        }
    }
    Ok((x, values))
}

/// Pairs of abscissa and value.
fn points(data: &str, factor: f64) -> Result<(Vec<f64>, Vec<f64>), String> {
    let mut all = Vec::new();
    for line in data.lines().skip(1) {
        all.extend(numbers(line)?);
    }
    if all.len() % 2 != 0 || all.is_empty() {
        return Err(format!("{} numbers where pairs are expected", all.len()));
    }
    Ok((
        all.chunks_exact(2).map(|pair| pair[0] * factor).collect(),
        all.chunks_exact(2).map(|pair| pair[1]).collect(),
    ))
}
