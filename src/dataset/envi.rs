//! ENVI spectral libraries: numbers in one file (`.sli`), and a text beside it (`.hdr`) that says what they are.

use std::collections::HashMap;
use std::io::{Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::arrays::{Array, Arrays, Order};
use super::files::Source;
use super::numbers::{Number, NumberKind};
use super::units::WavelengthUnit;
use super::{DatasetError, MAX_VALUES, files, text, too_many};
use crate::wording::counted;

/// Largest header.
const MAX_HEADER: u64 = 64 << 20;

/// A header, and the file of numbers that it describes.
pub(super) struct Header {
    entries: HashMap<String, String>,
    data: PathBuf,
}

/// The header of a file that begins so, where it is one, or has one beside it.
pub(super) fn header(path: &Path, head: &[u8]) -> Result<Option<Header>, DatasetError> {
    let is_header = |bytes: &[u8]| {
        bytes.starts_with(b"ENVI\n") || bytes.starts_with(b"ENVI\r") || bytes.starts_with(b"ENVI ")
    };
    if is_header(head) {
        let stem = path.with_extension("");
        let beside = ["sli", "dat", "img", "bin"].into_iter().map(|extension| path.with_extension(extension));
        let data = beside.chain([stem]).find(|data| data.is_file() && data != path);
        let Some(data) = data else {
            return Err(failed(
                path,
                "the file of numbers that it describes (.sli) is not beside it".to_owned(),
            ));
        };
        let bytes = files::read_capped(path, MAX_HEADER)?;
        return Ok(Some(Header { entries: entries(&text::decode(&bytes).0), data }));
    }
    let named = PathBuf::from(format!("{}.hdr", path.display()));
    for beside in [path.with_extension("hdr"), named] {
        if beside.is_file() && beside != path {
            let bytes = files::read_capped(&beside, MAX_HEADER)?;
            if is_header(&bytes) {
                let entries = entries(&text::decode(&bytes).0);
                return Ok(Some(Header { entries, data: path.to_owned() }));
            }
        }
    }
    Ok(None)
}

fn failed(path: &Path, reason: String) -> DatasetError {
    DatasetError::Format { path: path.to_owned(), format: "an ENVI spectral library", reason }
}

/// Entries of a header: `name = value`, or `name = { values }` over several lines.
fn entries(text: &str) -> HashMap<String, String> {
    let mut found = HashMap::new();
    let mut rest = text;
    while let Some((name, after)) = rest.split_once('=') {
        let name = name.lines().last().unwrap_or_default().trim().to_lowercase();
        let after = after.trim_start_matches([' ', '\t']);
        let (value, next) = match after.strip_prefix('{') {
            Some(inner) => inner.split_once('}').unwrap_or((inner, "")),
            None => after.split_once('\n').unwrap_or((after, "")),
        };
        found.insert(name, value.trim().to_owned());
        rest = next;
    }
    found
}

/// The library as arrays.
pub(super) fn arrays(path: &Path, header: &Header) -> Result<Arrays, DatasetError> {
    let wrong = |reason: String| failed(path, reason);
    let entry = |name: &str| header.entries.get(name).map(String::as_str);
    let number = |name: &str| -> Result<usize, DatasetError> {
        let text = entry(name).ok_or_else(|| wrong(format!("its header has no entry {name:?}")))?;
        text.parse().map_err(|_| wrong(format!("{name} = {text:?} in its header is no whole number")))
    };
    if !entry("file type").is_some_and(|kind| kind.to_lowercase().contains("spectral library")) {
        return Err(wrong(
            "it is an image and no library: export the spectra of its pixels as text or as a NumPy array"
                .to_owned(),
        ));
    }
    let (bands, spectra) = (number("samples")?, number("lines")?);
    let offset = if entry("header offset").is_some() { number("header offset")? } else { 0 };
    let big_endian = entry("byte order") == Some("1");
    let (kind, bytes) = match number("data type")? {
        1 => (NumberKind::Unsigned, 1),
        2 => (NumberKind::Signed, 2),
        3 => (NumberKind::Signed, 4),
        4 => (NumberKind::Float, 4),
        5 => (NumberKind::Float, 8),
        12 => (NumberKind::Unsigned, 2),
        13 => (NumberKind::Unsigned, 4),
        14 => (NumberKind::Signed, 8),
        15 => (NumberKind::Unsigned, 8),
        other => return Err(wrong(format!("numbers of data type {other} are not real"))),
    };
    let mut data = Source::open(&header.data)?;
    let length = data.length().map_err(|error| files::failed(&header.data, error))?;
    let count = bands.checked_mul(spectra);
    let size = count.and_then(|count| count.checked_mul(bytes));
    let end = size.and_then(|size| offset.checked_add(size));
    let Some(count) = count.filter(|_| end.is_some_and(|end| end as u64 <= length)) else {
        return Err(wrong(format!(
            "its header promises {} of {}, and {:?} has {}",
            counted(spectra as u64, "spectrum", "spectra"),
            counted(bands as u64, "band", "bands"),
            header.data,
            counted(length, "byte", "bytes")
        )));
    };
    if count > MAX_VALUES {
        return Err(wrong(too_many(count)));
    }
    let values = data.seek(SeekFrom::Start(offset as u64));
    let values = values.and_then(|_| Number { kind, bytes, big_endian }.read_from(&mut data, count));
    let mut values = values.map_err(|error| files::failed(&header.data, error))?;
    let mut notes = Vec::new();
    if let Some(factor) = entry("reflectance scale factor").and_then(|text| text.parse::<f64>().ok())
        && factor.is_finite()
        && factor > 0.0
        && factor != 1.0
    {
        values.iter_mut().for_each(|value| *value /= factor);
        notes.push(format!("values were divided by the reflectance scale factor, {factor}"));
    }
    if let Some(ignored) = entry("data ignore value").and_then(|text| text.parse::<f64>().ok()) {
        let gone =
            values.iter_mut().filter(|value| **value == ignored).map(|value| *value = f64::NAN).count();
        let gone = counted(gone as u64, "value is", "values are");
        notes.push(format!("{gone} missing by the data ignore value, {ignored}"));
    }
    let mut found = Arrays {
        format: "ENVI spectral library".to_owned(),
        order: Order::LastFirst,
        notes,
        ..Arrays::default()
    };
    if let Some(list) = entry("wavelength") {
        let parsed: Result<Vec<f64>, _> = list.split(',').map(|text| text.trim().parse()).collect();
        let values = parsed.map_err(|_| wrong("its wavelengths are not all numbers".to_owned()))?;
        let unit = entry("wavelength units").and_then(WavelengthUnit::named_in);
        found.all.push(Array { name: "wavelength".to_owned(), sides: vec![values.len()], values, unit });
    }
    found.all.push(Array { name: "spectra".to_owned(), sides: vec![bands, spectra], values, unit: None });
    // A library of as many spectra as bands has its spectra in lines all the same.
    found.is_convention = true;
    Ok(found)
}
