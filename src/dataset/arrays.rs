//! Arrays with names, as MATLAB, HDF5, NumPy and Zarr files hold them: the form from which wavelengths and spectra are
//! found.
//!
//! The field's convention is a matrix with its sampling `S_x` = [start step count] (nm) beside it, as in `sur_vrhel` with
//! `S_vrhel`. Elsewhere a vector of wavelengths lies beside the matrix, by one of many names or by none: then its numbers
//! must be wavelengths, and its length that of a side of the matrix.

use std::mem;
use std::path::Path;
use std::ptr;

use nalgebra::DMatrix;

use super::axis;
use super::numbers::transposed;
use super::reading::{ReadOptions, Reading, TableLayout};
use super::units::{WavelengthUnit, is_wavelength_word};
use super::{DatasetError, Remedy, SpectrumKind, Table};
use crate::grid::Grid;

/// Array of real numbers.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array {
    /// Name in the file, with the groups or structs that it lies in before it, as in `lib/reflectance`.
    pub(super) name: String,
    /// Lengths of its sides, that of neighbours in memory first.
    pub(super) sides: Vec<usize>,
    pub(super) values: Vec<f64>,
    /// Unit that its attributes state.
    pub(super) unit: Option<WavelengthUnit>,
}

impl Array {
    /// Name without the groups that it lies in.
    fn own_name(&self) -> &str {
        self.name.rsplit('/').next().unwrap_or(&self.name)
    }

    fn group(&self) -> &str {
        self.name.rsplit_once('/').map_or("", |(group, _)| group)
    }

    fn is_vector(&self) -> bool {
        self.sides.iter().filter(|side| **side != 1).count() <= 1
    }

    /// Name and sides, in the order in which the format's users write them.
    fn shown(&self, order: Order) -> String {
        let mut sides: Vec<String> = self.sides.iter().map(usize::to_string).collect();
        if order == Order::LastFirst {
            sides.reverse();
        }
        format!("{} ({})", self.name, sides.join(" x "))
    }
}

/// Order in which the users of a format write the sides of an array.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Order {
    /// As MATLAB: the side of neighbours in memory first.
    #[default]
    FirstFirst,
    /// As NumPy: that side last.
    LastFirst,
}

/// Contents of a file.
#[derive(Debug, Default)]
pub(super) struct Arrays {
    pub(super) format: String,
    /// Its numeric arrays.
    pub(super) all: Vec<Array>,
    /// The kind of the draws, where it is a data set of this program.
    pub(super) kind: Option<SpectrumKind>,
    pub(super) order: Order,
    pub(super) notes: Vec<String>,
    /// Whether the format itself says that spectra run along the first side.
    pub(super) is_convention: bool,
}

/// The variable in which data sets of this program say what they were made from, in JSON.
pub(super) const COMMENT: &str = "comment";

/// The names of draws in data sets of this program.
pub(super) const DRAWS: [&str; 2] = ["X", "spectra"];

/// The kind that the comment of a data set of this program records.
pub(super) fn kind(comment: &str) -> Option<SpectrumKind> {
    let mut attributes: serde_json::Value = serde_json::from_str(comment).ok()?;
    serde_json::from_value(attributes.get_mut("kind")?.take()).ok()
}

/// Wavelengths that may belong to arrays.
#[derive(Clone, Debug, PartialEq)]
struct Wave {
    name: String,
    group: String,
    /// In nm.
    values: Vec<f64>,
    source: Source,
    unit: WavelengthUnit,
}

#[derive(Clone, Debug, PartialEq)]
enum Source {
    /// [start step count], for arrays whose names end so.
    Sampling(String),
    /// A vector whose name says wavelengths.
    Named,
    /// A vector of numbers that may be wavelengths.
    Plain,
    /// The caller.
    Given,
}

/// The table of the array that the options name, or of the only one with its wavelengths.
pub(super) fn choose(
    path: &Path,
    mut arrays: Arrays,
    options: &ReadOptions,
) -> Result<Reading, DatasetError> {
    let mut waves: Vec<Wave> = arrays.all.iter().filter_map(|array| wave(array, options)).collect();
    if let Some(name) = &options.wavelength_array {
        waves = vec![asked_wave(path, &arrays, name, options)?];
    }
    if let Some(values) = &options.measured_at {
        waves = vec![given(values)];
    }
    let mut found = candidates(path, &arrays, &waves, options)?;
    if found.is_empty()
        && let Some(values) = &options.fallback
    {
        found = candidates(path, &arrays, &[given(values)], options)?;
    }
    let chosen = match (found.as_slice(), &options.array) {
        ([], Some(variable)) => {
            let (variable, found) = (variable.clone(), listed(&arrays));
            return Err(DatasetError::NoVariable { path: path.to_owned(), variable, found });
        }
        ([], None) => return Err(nothing(path, &arrays, options)),
        ([one], _) => one,
        (several, _) => {
            let is_draws =
                |(array, _): &&(&Array, Wave)| arrays.kind.is_some() && DRAWS.contains(&array.own_name());
            match several.iter().find(is_draws) {
                Some(draws) => draws,
                None => {
                    let candidates = several.iter().map(|(array, _)| array.name.clone()).collect();
                    let path = path.to_owned();
                    return Err(DatasetError::Ambiguous { path, what: "matrices of spectra", candidates });
                }
            }
        }
    };
    let (array, wave) = chosen;
    let index = arrays.all.iter().position(|other| ptr::eq(other, *array)).expect("it is one of them");
    let wave = wave.clone();
    // They may be half a gigabyte, and are moved.
    let values = mem::take(&mut arrays.all[index].values);
    extract(path, (&arrays, index), values, &wave, options)
}

fn given(values: &[f64]) -> Wave {
    Wave {
        name: String::new(),
        group: String::new(),
        values: values.to_vec(),
        source: Source::Given,
        unit: WavelengthUnit::Nm,
    }
}

/// The wavelengths that an array may be.
fn wave(array: &Array, options: &ReadOptions) -> Option<Wave> {
    if !array.is_vector() {
        return None;
    }
    let name = array.own_name();
    let is_sampling = name == "S" || name.strip_prefix("S_").is_some();
    let (values, source) = match *array.values.as_slice() {
        [start, step, count]
            if is_sampling && count.fract() == 0.0 && axis::check(&array.values).is_err() =>
        {
            let suffix = name.strip_prefix("S_").unwrap_or_default().to_ascii_lowercase();
            let grid = Grid::new(start, step, count as usize).ok()?;
            (grid.wavelengths().collect(), Source::Sampling(suffix))
        }
        _ if array.values.len() < 2 => return None,
        _ => {
            let is_named = is_sampling
                || is_wavelength_word(name)
                || matches!(name.to_lowercase().as_str(), "bands" | "band");
            let source = if is_named { Source::Named } else { Source::Plain };
            (array.values.clone(), source)
        }
    };
    let stated = array.unit.or_else(|| WavelengthUnit::named_in(name));
    let unit = options.unit.or(stated).unwrap_or(WavelengthUnit::Nm);
    let values: Vec<f64> = values.iter().map(|&value| unit.in_nm(value)).collect();
    axis::check(&values).ok()?;
    let group = array.group().to_owned();
    Some(Wave { name: array.name.clone(), group, values, source, unit })
}

/// The wavelengths of a name that was asked for.
fn asked_wave(path: &Path, arrays: &Arrays, name: &str, options: &ReadOptions) -> Result<Wave, DatasetError> {
    let of_name = |array: &&Array| array.name == name || array.own_name() == name;
    let Some(array) = arrays.all.iter().find(of_name) else {
        let (variable, found) = (name.to_owned(), listed(arrays));
        return Err(DatasetError::NoVariable { path: path.to_owned(), variable, found });
    };
    wave(array, options).map(|wave| Wave { source: Source::Given, ..wave }).ok_or_else(|| {
        let (reason, remedy) = fault(array, options);
        DatasetError::NotWavelengths { name: format!("{path:?}:{}", array.name), reason, remedy }
    })
}

/// Reason for which the numbers of an array are no wavelengths.
fn fault(array: &Array, options: &ReadOptions) -> (String, Remedy) {
    let unit = options.unit.or(array.unit).unwrap_or(WavelengthUnit::Nm);
    let values: Vec<f64> = array.values.iter().map(|&value| unit.in_nm(value)).collect();
    match axis::check(&values) {
        Err(fault) => {
            let remedy = fault.guess().map_or(Remedy::MeasuredAt, Remedy::Unit);
            (format!("its numbers are no wavelengths: {fault}"), remedy)
        }
        Ok(()) => ("it is no vector of wavelengths".to_owned(), Remedy::MeasuredAt),
    }
}

/// Arrays that have wavelengths, with these.
fn candidates<'a>(
    path: &Path,
    arrays: &'a Arrays,
    waves: &[Wave],
    options: &ReadOptions,
) -> Result<Vec<(&'a Array, Wave)>, DatasetError> {
    let is_asked = |array: &&Array| match &options.array {
        Some(name) => array.name == *name || array.own_name() == *name,
        None => true,
    };
    let is_wave = |array: &Array| {
        waves.iter().any(|wave| wave.name == array.name && wave.source != Source::Plain)
            || array.own_name().starts_with("S_")
    };
    let mut found = Vec::new();
    for array in arrays.all.iter().filter(is_asked) {
        if is_wave(array) && options.array.is_none() || array.values.len() < 2 {
            continue;
        }
        let wave = match wave_of(array, waves) {
            Ok(Some(wave)) => wave,
            Ok(None) => continue,
            Err(candidates) => {
                let candidates =
                    candidates.into_iter().map(|wave| format!("{}@{wave}", array.name)).collect();
                return Err(DatasetError::Ambiguous {
                    path: path.to_owned(),
                    what: "wavelengths",
                    candidates,
                });
            }
        };
        // A vector of wavelengths is none of spectra.
        if wave.name != array.name && !(array.is_vector() && array.values == wave.values) {
            found.push((array, wave));
        }
    }
    // Vectors beside matrices are means, errors and labels.
    if options.array.is_none() && found.iter().any(|(array, _)| !array.is_vector()) {
        found.retain(|(array, wave)| {
            let is_sampled = matches!(&wave.source, Source::Sampling(suffix) if !suffix.is_empty());
            !array.is_vector() || is_sampled
        });
    }
    // One matrix may have two names.
    let mut distinct: Vec<(&Array, Wave)> = Vec::new();
    for (array, wave) in found {
        let is_same =
            |(other, _): &(&Array, Wave)| other.sides == array.sides && other.values == array.values;
        if !distinct.iter().any(is_same) {
            distinct.push((array, wave));
        }
    }
    Ok(distinct)
}

/// The wavelengths of an array; an error has the names of several that may be meant.
fn wave_of(array: &Array, waves: &[Wave]) -> Result<Option<Wave>, Vec<String>> {
    let fits = |wave: &&Wave| array.sides.contains(&wave.values.len()) && wave.name != array.name;
    let name = array.own_name().to_ascii_lowercase();
    let suffixed = |wave: &&Wave| matches!(&wave.source, Source::Sampling(suffix) if !suffix.is_empty() && name.ends_with(suffix));
    let longest = |wave: &&Wave| wave.name.len();
    if let Some(named) = waves.iter().filter(suffixed).max_by_key(longest) {
        return Ok(Some(named).filter(fits).cloned());
    }
    let group = array.group();
    let (is_given, is_named) = (|w: &Wave| w.source == Source::Given, |w: &Wave| w.source == Source::Named);
    let is_sampling = |w: &Wave| matches!(w.source, Source::Sampling(_));
    let is_plain = |w: &Wave| {
        w.source == Source::Plain && w.group == group && (axis::is_even(&w.values) || w.values.len() >= 8)
    };
    let levels: [&dyn Fn(&Wave) -> bool; 5] =
        [&is_given, &|w| is_named(w) && w.group == group, &|w| is_named(w), &is_sampling, &is_plain];
    for level in levels {
        let mut at_level: Vec<&Wave> = waves.iter().filter(|wave| level(wave)).filter(fits).collect();
        at_level.dedup_by(|a, b| a.values == b.values);
        match at_level.as_slice() {
            [] => {}
            [one] => return Ok(Some((*one).clone())),
            several => return Err(several.iter().map(|wave| wave.name.clone()).collect()),
        }
    }
    Ok(None)
}

/// The table of an array and its wavelengths.
fn extract(
    path: &Path,
    (arrays, index): (&Arrays, usize),
    values: Vec<f64>,
    wave: &Wave,
    options: &ReadOptions,
) -> Result<Reading, DatasetError> {
    let array = &arrays.all[index];
    let bands = wave.values.len();
    let name = format!("{path:?}:{}", array.name);
    let own = (arrays.kind.is_some() || arrays.is_convention) && DRAWS.contains(&array.own_name());
    let (side, reason) = side(array, wave, arrays.order, own, options.layout)
        .map_err(|reason| DatasetError::Layout { path: path.to_owned(), reason, remedy: Remedy::Layout })?;
    let inner: usize = array.sides[..side].iter().product();
    let outer: usize = array.sides[side + 1..].iter().product();
    let spectra = match inner {
        1 => DMatrix::from_vec(bands, outer, values),
        // Each of the outer parts has its bands in rows.
        _ => {
            let parts = values.chunks_exact(inner * bands);
            DMatrix::from_vec(bands, inner * outer, parts.flat_map(|part| transposed(part, inner)).collect())
        }
    };
    let mut notes = arrays.notes.clone();
    let mut table = Table::from_measured(&name, wave.values.clone(), spectra, &mut notes)?;
    table.kind = match array.own_name().to_ascii_lowercase() {
        n if n.starts_with("sur_") => Some(SpectrumKind::Reflectance),
        n if n.starts_with("spd_") || n.starts_with("daylight") => Some(SpectrumKind::Illuminant),
        _ => arrays.kind.filter(|_| own),
    };
    let wavelengths = match wave.source {
        Source::Given if wave.name.is_empty() => {
            if options.measured_at.is_none() {
                notes.push(format!(
                    "the file does not say at which wavelengths its {bands} bands are: they were taken to be those of the \
                     model"
                ));
            }
            "as given, in nm".to_owned()
        }
        Source::Sampling(_) => format!("{} = [start step count], in {}", wave.name, wave.unit),
        _ => format!("{}, in {}", wave.name, wave.unit),
    };
    let others = arrays.all.iter().filter(|other| other.name != array.name && other.name != wave.name);
    Ok(Reading {
        table,
        format: arrays.format.clone(),
        dialect: None,
        layout: format!("{}: {reason}", array.shown(arrays.order)),
        wavelengths,
        notes,
        others: others.map(|other| other.shown(arrays.order)).collect(),
    })
}

/// The side of an array along which the wavelengths run, and the reason.
fn side(
    array: &Array,
    wave: &Wave,
    order: Order,
    is_own: bool,
    layout: Option<TableLayout>,
) -> Result<(usize, String), String> {
    let bands = wave.values.len();
    let fitting: Vec<usize> = (0..array.sides.len()).filter(|&side| array.sides[side] == bands).collect();
    let last = array.sides.len() - 1;
    let asked = layout.map(|layout| match (layout, order) {
        (TableLayout::Columns, Order::FirstFirst) | (TableLayout::Rows, Order::LastFirst) => 0,
        (TableLayout::Rows, Order::FirstFirst) | (TableLayout::Columns, Order::LastFirst) => last,
    });
    if let Some(side) = asked {
        return match fitting.contains(&side) {
            true => Ok((side, "as asked for".to_owned())),
            false => Err(format!(
                "{} has {} values along the asked-for direction, and there are {bands} wavelengths",
                array.shown(order),
                array.sides[side]
            )),
        };
    }
    let by_name = array.own_name().to_ascii_lowercase();
    let is_convention = matches!(wave.source, Source::Sampling(_))
        || ["sur_", "spd_", "t_", "b_", "daylight"].iter().any(|start| by_name.starts_with(start));
    match fitting.as_slice() {
        [side] => Ok((*side, format!("{bands} wavelengths fit one side alone"))),
        [_, ..] if is_own => Ok((0, "as this program writes draws".to_owned())),
        // The convention for functions to integrate with is rows.
        [_, second, ..] if is_convention && by_name.starts_with("t_") => {
            Ok((*second, "by the name, T_x".to_owned()))
        }
        [_, ..] if is_convention => Ok((0, "by the convention of S_x".to_owned())),
        _ => Err(format!(
            "{} has {bands} values along more than one side, so that its spectra may be its columns or its rows: say which",
            array.shown(order)
        )),
    }
}

fn listed(arrays: &Arrays) -> String {
    match arrays.all.as_slice() {
        [] => "no numeric matrix".to_owned(),
        all => {
            let mut names: Vec<String> = all.iter().take(20).map(|array| array.shown(arrays.order)).collect();
            if all.len() > 20 {
                names.push(format!("and {} more", all.len() - 20));
            }
            names.join(", ")
        }
    }
}

/// The error of a file without a matrix that has its wavelengths.
fn nothing(path: &Path, arrays: &Arrays, options: &ReadOptions) -> DatasetError {
    let matrices: Vec<&Array> = arrays.all.iter().filter(|array| !array.is_vector()).collect();
    // A vector that is called wavelengths, and whose numbers are none.
    let named = arrays.all.iter().find(|array| {
        let name = array.own_name();
        array.is_vector()
            && array.values.len() > 1
            && is_wavelength_word(name)
            && wave(array, options).is_none()
    });
    if let Some(array) = named {
        let (reason, remedy) = fault(array, options);
        return DatasetError::NotWavelengths { name: format!("{path:?}:{}", array.name), reason, remedy };
    }
    if let Some(values) = &options.measured_at
        && let [array] = matrices.as_slice()
    {
        let (given, array) = (values.len(), array.shown(arrays.order));
        return DatasetError::Layout {
            path: path.to_owned(),
            reason: format!("{array} has no side of the {given} wavelengths that were given"),
            remedy: Remedy::MeasuredAt,
        };
    }
    let has_wave =
        arrays.all.iter().any(|array| wave(array, options).is_some_and(|wave| wave.source != Source::Plain));
    match matrices.as_slice() {
        [array] if !has_wave => {
            let bands = array.sides[0];
            match &options.fallback {
                Some(values) => DatasetError::Layout {
                    path: path.to_owned(),
                    reason: format!(
                        "it does not say at which wavelengths its {bands} bands are, and they are not the {} of the model: \
                         give those of the measurements, as start:step:stop",
                        values.len()
                    ),
                    remedy: Remedy::MeasuredAt,
                },
                None => DatasetError::NoWavelengths { path: path.to_owned(), bands },
            }
        }
        _ => DatasetError::NoMatrix { path: path.to_owned(), found: listed(arrays) },
    }
}
