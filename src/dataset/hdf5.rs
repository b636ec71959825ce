//! HDF5 files, and those of MATLAB v7.3, which are HDF5: every numeric array in them and in their groups.
//!
//! Whoever wrote the file may be hostile. Sizes that a file claims are compared with what it can hold before anything is
//! allocated, and the parser's panics, should it have any left, end as errors.

use std::collections::HashMap;
use std::path::Path;

use hdf5_pure::{
    AttrValue, Dataset, Datatype, DatatypeByteOrder, Error, File, FileAccessProperties, FloatingPointLayout,
    Group, MetadataCacheConfig, ReadSeekSource,
};

use super::arrays::{self, Array, Arrays, Order};
use super::files::{self, Source};
use super::numbers::{Number, NumberKind};
use super::units::WavelengthUnit;
use super::{DatasetError, MAX_VALUES};
use crate::caught::caught;
use crate::wording::counted;

/// Deepest group that is looked into.
const MAX_DEPTH: usize = 6;

/// Largest number of arrays that are looked at.
const MAX_ARRAYS: usize = 2000;

/// Bytes that are kept of the parts that describe a file: each is a few bytes, and many are read again and again.
const CACHE_BYTES: usize = 1 << 20;

/// Largest ratio of what chunks unpack to, to what they take in the file: that of deflate.
const MAX_RATIO: u64 = 1100;

pub(super) fn arrays(path: &Path, mut source: Source) -> Result<Arrays, DatasetError> {
    let failed = |reason: String| DatasetError::Format { path: path.to_owned(), format: "HDF5", reason };
    let is_matlab = source.head().map_err(|error| files::failed(path, error))?.starts_with(b"MATLAB");
    let read = caught(|| read(source, is_matlab));
    match read {
        Some(Ok(arrays)) => Ok(arrays),
        Some(Err(Fault::TooLarge)) => Err(DatasetError::TooLarge { path: path.to_owned() }),
        Some(Err(Fault::Other(reason))) => Err(failed(reason)),
        None => Err(failed("it is damaged; copy it again".to_owned())),
    }
}

/// Error of a read.
enum Fault {
    TooLarge,
    Other(String),
}

impl From<Error> for Fault {
    fn from(error: Error) -> Fault {
        Fault::Other(error.to_string())
    }
}

/// A walk through a file.
struct Walk {
    found: Arrays,
    /// Length of the file.
    file_bytes: u64,
    /// Values that may still be read.
    left: usize,
    is_matlab: bool,
}

fn read(source: Source, is_matlab: bool) -> Result<Arrays, Fault> {
    let source = ReadSeekSource::new(source).map_err(Error::from)?;
    let cache = MetadataCacheConfig::new(CACHE_BYTES);
    let file =
        File::from_source_with_options(source, FileAccessProperties::new().with_metadata_cache(cache))?;
    let file_bytes = file.file_size();
    let format = if is_matlab { "MATLAB file, version 7.3 (.mat)" } else { "HDF5" };
    let order = if is_matlab { Order::FirstFirst } else { Order::LastFirst };
    let root = file.root();
    let attributes = root.attrs()?;
    let kind = text(&attributes, "kind").and_then(|kind| serde_json::from_value(kind.into()).ok());
    let found = Arrays { format: format.to_owned(), order, kind, ..Arrays::default() };
    let mut walk = Walk { found, file_bytes, left: MAX_VALUES, is_matlab };
    walk.group(&root, "", 0)?;
    Ok(walk.found)
}

impl Walk {
    fn group(&mut self, group: &Group, prefix: &str, depth: usize) -> Result<(), Fault> {
        for name in group.datasets()? {
            if self.found.all.len() >= MAX_ARRAYS {
                return Ok(());
            }
            let set = group.dataset(&name)?;
            let full = if prefix.is_empty() { name } else { format!("{prefix}/{name}") };
            self.dataset(&set, full)?;
        }
        if depth < MAX_DEPTH {
            for name in group.groups()? {
                // MATLAB keeps the content of cells there.
                if name.starts_with('#') {
                    continue;
                }
                let full = if prefix.is_empty() { name.clone() } else { format!("{prefix}/{name}") };
                self.group(&group.group(&name)?, &full, depth + 1)?;
            }
        }
        Ok(())
    }

    fn dataset(&mut self, set: &Dataset, name: String) -> Result<(), Fault> {
        let placed = |error: Error| Fault::Other(format!("{name:?}: {error}"));
        let shape = set.shape().map_err(placed)?;
        let size = set.element_size().map_err(placed)?;
        let is_number = is_number(set).map_err(placed)?;
        if !is_number || shape.is_empty() || shape.len() > 8 {
            return Ok(());
        }
        let count = shape.iter().try_fold(1u64, |product, side| product.checked_mul(*side));
        let bytes = count.and_then(|count| count.checked_mul(size));
        let (Some(count), Some(bytes)) = (count, bytes) else {
            return Err(Fault::Other(format!("{name:?} claims a shape of {shape:?}; copy it again")));
        };
        if count > self.left as u64 {
            return Err(Fault::TooLarge);
        }
        let stored = match set.is_chunked() {
            true => self.chunks(set, &name, size)?,
            false => self.file_bytes,
        };
        // Values that are nowhere in the file are all fill, and no measurements.
        let most = if set.filters().is_empty() { stored } else { stored.saturating_mul(MAX_RATIO) };
        if bytes > most.max(1 << 16) {
            return Err(Fault::Other(format!(
                "{name:?} claims {bytes} bytes of data, and the file has {}; copy it again",
                self.file_bytes
            )));
        }
        self.left -= count as usize;
        let attributes = set.attrs().map_err(placed)?;
        if name == arrays::COMMENT && self.is_matlab {
            // MATLAB's text is numbers of 16 bits.
            let units = set.read_u16().map_err(placed)?;
            let text = String::from_utf16(&units).ok();
            self.found.kind = text.and_then(|text| arrays::kind(&text)).or(self.found.kind);
            return Ok(());
        }
        if attributes.contains_key("MATLAB_empty")
            || text(&attributes, "MATLAB_class").as_deref() == Some("char")
        {
            return Ok(());
        }
        let mut values = numbers(set).map_err(placed)?;
        if values.is_empty() && count > 0 {
            return Err(Fault::Other(format!(
                "{name:?} holds numbers of a type that is not read: write it as float64"
            )));
        }
        if values.len() as u64 != count {
            return Err(Fault::Other(format!(
                "{name:?} holds {}, not {count}; copy it again",
                counted(values.len() as u64, "value", "values")
            )));
        }
        self.packing(&name, &attributes, &mut values);
        let unit = ["units", "unit", "Units", "Unit"].iter().find_map(|key| text(&attributes, key));
        let unit = unit.and_then(|unit| WavelengthUnit::named_in(&unit));
        let sides = shape.iter().rev().map(|side| *side as usize).collect();
        self.found.all.push(Array { name, sides, values, unit });
        Ok(())
    }

    /// Checks the chunks of a data set against the length of the file; returns the bytes that they take in it.
    fn chunks(&self, set: &Dataset, name: &str, size: u64) -> Result<u64, Fault> {
        let shape = set.chunk_shape()?.unwrap_or_default();
        let one = shape.iter().try_fold(size, |product, side| product.checked_mul(*side));
        if one.is_none_or(|one| one > super::MAX_BYTES) {
            return Err(Fault::Other(format!("{name:?} claims chunks of {shape:?}; copy it again")));
        }
        let chunks = set.chunks().map_err(|error| Fault::Other(format!("{name:?}: {error}")))?;
        let stored = chunks.iter().try_fold(0u64, |sum, chunk| sum.checked_add(chunk.storage_size));
        match stored {
            Some(stored) if stored <= self.file_bytes => Ok(stored),
            _ => Err(Fault::Other(format!("{name:?} claims more chunks than the file holds; copy it again"))),
        }
    }

    /// Applies the attributes by which files say what their numbers mean, as netCDF's conventions have them.
    fn packing(&mut self, name: &str, attributes: &HashMap<String, AttrValue>, values: &mut [f64]) {
        let numbers = |key: &str| attributes.get(key).and_then(attribute_numbers).unwrap_or_default();
        let first = |key: &str| numbers(key).first().copied();
        let mut said = Vec::new();
        let missing: Vec<f64> = ["_FillValue", "missing_value"].into_iter().flat_map(numbers).collect();
        let range = match *numbers("valid_range") {
            [low, high] => [Some(low), Some(high)],
            _ => [first("valid_min"), first("valid_max")],
        };
        let is_out = |value: f64| {
            missing.contains(&value)
                || range[0].is_some_and(|low| value < low)
                || range[1].is_some_and(|high| value > high)
        };
        let gone = values.iter_mut().filter(|value| is_out(**value)).map(|value| *value = f64::NAN).count();
        if gone > 0 {
            let gone = counted(gone as u64, "value is", "values are");
            said.push(format!("{gone} missing by _FillValue, missing_value or valid_range"));
        }
        let (factor, offset) = (first("scale_factor"), first("add_offset"));
        if factor.is_some() || offset.is_some() {
            let (factor, offset) = (factor.unwrap_or(1.0), offset.unwrap_or(0.0));
            values.iter_mut().for_each(|value| *value = *value * factor + offset);
            said.push(format!(
                "values were multiplied by scale_factor {factor}, and add_offset {offset} was added"
            ));
        }
        self.found.notes.extend(said.into_iter().map(|note| format!("{name}: {note}")));
    }
}

/// Whether the elements of a data set are real numbers.
fn is_number(set: &Dataset) -> Result<bool, Error> {
    use hdf5_pure::DType::{F32, F64, I8, I16, I32, I64, Other, U8, U16, U32, U64};
    let dtype = set.dtype()?;
    Ok(match dtype {
        F32 | F64 | I8 | I16 | I32 | I64 | U8 | U16 | U32 | U64 => true,
        // Half precision and the like.
        Other(datatype) => {
            matches!(*datatype, Datatype::FloatingPoint { .. } | Datatype::FixedPoint { .. })
        }
        _ => false,
    })
}

/// The values of a data set; none where their type is unknown.
fn numbers(set: &Dataset) -> Result<Vec<f64>, Error> {
    // The parser reads no half precision.
    const HALF: FloatingPointLayout = FloatingPointLayout {
        bit_offset: 0,
        bit_precision: 16,
        exponent_location: 10,
        exponent_size: 5,
        mantissa_location: 0,
        mantissa_size: 10,
        exponent_bias: 15,
    };
    match set.datatype()? {
        Datatype::FloatingPoint { size: 2, byte_order, layout: HALF } => {
            let big_endian = byte_order == DatatypeByteOrder::BigEndian;
            let number = Number { kind: NumberKind::Float, bytes: 2, big_endian };
            Ok(number.read_all(&set.read_raw()?))
        }
        datatype if datatype.type_size() > 8 => Ok(Vec::new()),
        _ => set.read_f64(),
    }
}

/// Text of an attribute.
fn text(attributes: &HashMap<String, AttrValue>, key: &str) -> Option<String> {
    attributes.get(key)?.as_str().map(str::to_owned)
}

/// Numbers of an attribute.
fn attribute_numbers(value: &AttrValue) -> Option<Vec<f64>> {
    use AttrValue::*;
    Some(match value {
        F32(v) => vec![f64::from(*v)],
        F32Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        F64(v) => vec![*v],
        F64Array(v) => v.clone(),
        I8(v) => vec![f64::from(*v)],
        I8Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        I16(v) => vec![f64::from(*v)],
        I16Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        I32(v) => vec![f64::from(*v)],
        I32Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        I64(v) => vec![*v as f64],
        I64Array(v) => v.iter().map(|v| *v as f64).collect(),
        U8(v) => vec![f64::from(*v)],
        U8Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        U16(v) => vec![f64::from(*v)],
        U16Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        U32(v) => vec![f64::from(*v)],
        U32Array(v) => v.iter().map(|v| f64::from(*v)).collect(),
        U64(v) => vec![*v as f64],
        U64Array(v) => v.iter().map(|v| *v as f64).collect(),
        _ => return None,
    })
}
