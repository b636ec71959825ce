//! Zarr stores in a folder, of versions 2 and 3: arrays whose chunks are plain, or packed by Zstandard, gzip or zlib.

use std::fs::File;
use std::io::{self, BufReader, ErrorKind, Read};
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::arrays::{self, Array, Arrays, Order};
use super::numbers::Number;
use super::units::WavelengthUnit;
use super::{DatasetError, MAX_BYTES, MAX_VALUES, files, npy};
use crate::plain_file;

/// Largest number of arrays and of chunks of an array that are looked at.
const MAX_ARRAYS: usize = 2000;
const MAX_CHUNKS: usize = 1 << 20;

/// Largest file of JSON.
const MAX_JSON: u64 = 64 << 20;

/// Number of values of a chunk that are read at a time.
const PART: usize = 8192;

/// Whether a folder is a store.
pub(super) fn is_store(folder: &Path) -> bool {
    ["zarr.json", ".zgroup", ".zarray", ".zmetadata"].iter().any(|name| folder.join(name).is_file())
}

/// Every numeric array of a store.
pub(super) fn arrays(folder: &Path) -> Result<Arrays, DatasetError> {
    let mut found = Arrays { order: Order::LastFirst, ..Arrays::default() };
    let mut left = MAX_VALUES;
    let version = if folder.join("zarr.json").is_file() { 3 } else { 2 };
    found.format = format!("Zarr store, version {version}");
    let attributes = match version {
        3 => json(folder, "zarr.json")?.and_then(|node| node.get("attributes").cloned()),
        _ => json(folder, ".zattrs")?,
    };
    found.kind = attributes.and_then(|attributes| arrays::kind(&attributes.to_string()));
    walk(folder, folder, "", 0, &mut found, &mut left)?;
    Ok(found)
}

fn failed(folder: &Path, reason: impl Into<String>) -> DatasetError {
    DatasetError::Format { path: folder.to_owned(), format: "a Zarr store", reason: reason.into() }
}

/// JSON of a file, where it is there.
fn json(folder: &Path, name: &str) -> Result<Option<Value>, DatasetError> {
    let path = folder.join(name);
    if !path.is_file() {
        return Ok(None);
    }
    let bytes = files::read_capped(&path, MAX_JSON)?;
    serde_json::from_slice(&bytes).map(Some).map_err(|e| failed(folder, format!("{name}: {e}")))
}

fn walk(
    store: &Path,
    folder: &Path,
    name: &str,
    depth: usize,
    found: &mut Arrays,
    left: &mut usize,
) -> Result<(), DatasetError> {
    if found.all.len() >= MAX_ARRAYS {
        return Ok(());
    }
    let v3 = json(folder, "zarr.json")?.filter(|node| node["node_type"] == "array");
    let layout = match v3 {
        Some(node) => Some(Layout::v3(&node)),
        None => match json(folder, ".zarray")? {
            Some(node) => Some(Layout::v2(&node, &json(folder, ".zattrs")?.unwrap_or_default())),
            None => None,
        },
    };
    if let Some(layout) = layout {
        let own = if name.is_empty() { "array" } else { name };
        match layout {
            Ok(Some(layout)) => {
                let array = layout.read(folder, own, left).map_err(|e| match e {
                    Fault::File(error) => error,
                    Fault::Reason(reason) => failed(store, format!("{own:?}: {reason}")),
                })?;
                found.all.push(array);
            }
            Ok(None) => {}
            Err(reason) => return Err(failed(store, format!("{own:?}: {reason}"))),
        }
        return Ok(());
    }
    if depth >= 4 {
        return Ok(());
    }
    let mut inner = files::folders(folder)?;
    inner.sort();
    for path in inner {
        let own = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let name = if name.is_empty() { own } else { format!("{name}/{own}") };
        walk(store, &path, &name, depth + 1, found, left)?;
    }
    Ok(())
}

enum Fault {
    File(DatasetError),
    Reason(String),
}

impl From<DatasetError> for Fault {
    fn from(error: DatasetError) -> Fault {
        Fault::File(error)
    }
}

impl From<String> for Fault {
    fn from(reason: String) -> Fault {
        Fault::Reason(reason)
    }
}

/// Packing of a chunk.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Packing {
    Plain,
    Zstd,
    Gzip,
    Zlib,
}

/// Layout of an array in files.
struct Layout {
    shape: Vec<usize>,
    chunk: Vec<usize>,
    number: Number,
    packing: Packing,
    /// Whether the last side of a chunk runs slowest.
    is_fortran: bool,
    prefix: &'static str,
    separator: char,
    unit: Option<WavelengthUnit>,
    scale: [Option<f64>; 2],
    missing: Vec<f64>,
}

fn sides(value: &Value) -> Option<Vec<usize>> {
    value.as_array()?.iter().map(|side| side.as_u64().and_then(|side| usize::try_from(side).ok())).collect()
}

impl Layout {
    /// The layout of an array of version 3; `None` where it is not one of numbers.
    fn v3(node: &Value) -> Result<Option<Layout>, String> {
        let mut packing = Packing::Plain;
        let mut big_endian = false;
        for codec in node["codecs"].as_array().into_iter().flatten() {
            match codec["name"].as_str().unwrap_or_default() {
                "bytes" => big_endian = codec["configuration"]["endian"] == "big",
                "zstd" => packing = Packing::Zstd,
                "gzip" => packing = Packing::Gzip,
                other => return Err(unknown(other)),
            }
        }
        let Some(number) = node["data_type"].as_str().and_then(|name| Number::spelled(name, big_endian))
        else {
            return Ok(None);
        };
        let encoding = &node["chunk_key_encoding"];
        let (prefix, default) = if encoding["name"] == "v2" { ("", '.') } else { ("c", '/') };
        let separator = encoding["configuration"]["separator"].as_str().and_then(|s| s.chars().next());
        let chunk = &node["chunk_grid"]["configuration"]["chunk_shape"];
        Layout {
            shape: sides(&node["shape"]).ok_or("it has no shape")?,
            chunk: sides(chunk).ok_or("its chunks are not of one shape")?,
            number,
            packing,
            is_fortran: false,
            prefix,
            separator: separator.unwrap_or(default),
            unit: None,
            scale: [None; 2],
            missing: Vec::new(),
        }
        .with_attributes(&node["attributes"])
        .checked()
    }

    /// The layout of an array of version 2; `None` where it is not one of numbers.
    fn v2(node: &Value, attributes: &Value) -> Result<Option<Layout>, String> {
        let packing = match node["compressor"]["id"].as_str() {
            None => Packing::Plain,
            Some("zstd") => Packing::Zstd,
            Some("gzip") => Packing::Gzip,
            Some("zlib") => Packing::Zlib,
            Some(other) => return Err(unknown(other)),
        };
        if node["filters"].as_array().is_some_and(|filters| !filters.is_empty()) {
            return Err("it has filters, which are not read: write it without them".to_owned());
        }
        let Some(number) = node["dtype"].as_str().and_then(Number::named) else { return Ok(None) };
        let separator = node["dimension_separator"].as_str().and_then(|s| s.chars().next());
        Layout {
            shape: sides(&node["shape"]).ok_or("it has no shape")?,
            chunk: sides(&node["chunks"]).ok_or("it has no chunks")?,
            number,
            packing,
            is_fortran: node["order"] == "F",
            prefix: "",
            separator: separator.unwrap_or('.'),
            unit: None,
            scale: [None; 2],
            missing: Vec::new(),
        }
        .with_attributes(attributes)
        .checked()
    }

    fn with_attributes(mut self, attributes: &Value) -> Layout {
        let unit = attributes["units"].as_str().or(attributes["unit"].as_str());
        self.unit = unit.and_then(WavelengthUnit::named_in);
        self.scale = ["scale_factor", "add_offset"].map(|key| attributes[key].as_f64());
        self.missing =
            ["_FillValue", "missing_value"].iter().filter_map(|key| attributes[*key].as_f64()).collect();
        self
    }

    fn checked(self) -> Result<Option<Layout>, String> {
        let is_sound = self.shape.len() == self.chunk.len()
            && (1..=8).contains(&self.shape.len())
            && self.chunk.iter().all(|side| *side > 0);
        if !is_sound {
            return match self.shape.is_empty() {
                true => Ok(None), // a single number
                false => {
                    Err(format!("its shape {:?} and its chunks {:?} do not fit", self.shape, self.chunk))
                }
            };
        }
        let values = self.chunk.iter().try_fold(1usize, |product, side| product.checked_mul(*side));
        match values {
            Some(values) if values <= MAX_VALUES => Ok(Some(self)),
            _ => Err(format!("its chunks of {:?} are more than {MAX_VALUES} values", self.chunk)),
        }
    }

    fn read(&self, folder: &Path, name: &str, left: &mut usize) -> Result<Array, Fault> {
        let count = self.shape.iter().try_fold(1usize, |product, side| product.checked_mul(*side));
        let count = count
            .filter(|count| *count <= *left)
            .ok_or_else(|| super::too_many(count.unwrap_or(usize::MAX)))?;
        let grid: Vec<usize> =
            self.shape.iter().zip(&self.chunk).map(|(side, chunk)| side.div_ceil(*chunk)).collect();
        let chunks = grid.iter().try_fold(1usize, |product, side| product.checked_mul(*side));
        if chunks.is_none_or(|chunks| chunks > MAX_CHUNKS) {
            return Err(Fault::Reason(
                "it has more chunks than are read: write it in larger ones".to_owned(),
            ));
        }
        *left -= count;
        let mut values = vec![0.0; count];
        let mut present = 0;
        let mut at = vec![0; grid.len()];
        for _ in 0..chunks.unwrap_or(0) {
            let path = folder.join(self.key(&at));
            if path.is_file() {
                present += 1;
                self.read_chunk(&path, &at, &mut values)?;
            }
            npy::advance(&mut at, &grid);
        }
        // What a missing chunk is filled with is no measurement.
        let missing = chunks.unwrap_or(0) - present;
        if missing > 0 && count > 0 {
            return Err(Fault::Reason(format!(
                "{missing} of its {} chunks are not there; copy it again",
                present + missing
            )));
        }
        if !self.missing.is_empty() || self.scale != [None; 2] {
            for value in &mut values {
                if self.missing.contains(value) {
                    *value = f64::NAN;
                }
                *value = *value * self.scale[0].unwrap_or(1.0) + self.scale[1].unwrap_or(0.0);
            }
        }
        let sides = self.shape.iter().rev().copied().collect();
        Ok(Array { name: name.to_owned(), sides, values, unit: self.unit })
    }

    /// Path of a chunk within the folder of the array.
    fn key(&self, at: &[usize]) -> PathBuf {
        let numbers: Vec<String> = at.iter().map(usize::to_string).collect();
        let joined = numbers.join(&self.separator.to_string());
        match self.prefix {
            "" => joined.into(),
            prefix => format!("{prefix}{}{joined}", self.separator).into(),
        }
    }

    /// Reads a chunk into its place among the values of the array.
    fn read_chunk(&self, path: &Path, at: &[usize], values: &mut [f64]) -> Result<(), Fault> {
        let (file, _) = plain_file::open(path, MAX_BYTES).map_err(|error| files::failed(path, error))?;
        let name = || path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let damaged = |error: io::Error| match error.kind() {
            ErrorKind::UnexpectedEof => format!("chunk {} ends too early; copy it again", name()),
            _ => format!("chunk {} is damaged ({error}); copy it again", name()),
        };
        let mut source = self.unpacked(file).map_err(damaged)?;
        if self.is_fortran {
            let chunk = self.number.read_from(&mut source, self.chunk.iter().product()).map_err(damaged)?;
            let chunk = npy::turned(&self.chunk, &chunk);
            let mut rest = chunk.as_slice();
            let next = |count: usize, part: &mut Vec<f64>| {
                part.extend_from_slice(rest.split_off(..count).unwrap_or_default());
                Ok(())
            };
            self.place(at, next, values).map_err(damaged)?;
        } else {
            let mut bytes = vec![0; PART * self.number.bytes];
            let next = |count: usize, part: &mut Vec<f64>| {
                let bytes = &mut bytes[..count * self.number.bytes];
                source.read_exact(bytes)?;
                self.number.add(bytes, part);
                Ok(())
            };
            self.place(at, next, values).map_err(damaged)?;
        }
        // The sum of a packed chunk stands behind its values.
        match source.read(&mut [0]).map_err(damaged)? {
            0 => Ok(()),
            _ => Err(Fault::Reason(format!("chunk {} is longer than its values; copy it again", name()))),
        }
    }

    /// The bytes of the values of a chunk.
    fn unpacked(&self, file: File) -> io::Result<Box<dyn Read>> {
        Ok(match self.packing {
            Packing::Plain => Box::new(BufReader::with_capacity(1 << 16, file)),
            Packing::Gzip => Box::new(flate2::read::GzDecoder::new(file)),
            Packing::Zlib => Box::new(flate2::read::ZlibDecoder::new(file)),
            Packing::Zstd => unzstd(file)?,
        })
    }

    /// Puts the values of a chunk, which come in the order of its sides, into those of the array.
    fn place(
        &self,
        at: &[usize],
        mut next: impl FnMut(usize, &mut Vec<f64>) -> io::Result<()>,
        values: &mut [f64],
    ) -> io::Result<()> {
        let sides = self.shape.len();
        let last = self.chunk[sides - 1];
        let rows: usize = self.chunk[..sides - 1].iter().product();
        let start = |side: usize, index: &[usize]| at[side] * self.chunk[side] + index[side];
        let mut part = Vec::with_capacity(PART.min(last));
        let mut index = vec![0; sides];
        for _ in 0..rows {
            // A chunk at an end of the array has values that lie beyond it.
            let is_inside = (0..sides - 1).all(|side| start(side, &index) < self.shape[side]);
            let offset = (0..sides).fold(0, |offset, side| offset * self.shape[side] + start(side, &index));
            let length = if is_inside { last.min(self.shape[sides - 1] - at[sides - 1] * last) } else { 0 };
            for first in (0..last).step_by(PART) {
                part.clear();
                next(PART.min(last - first), &mut part)?;
                let kept = part.len().min(length.saturating_sub(first));
                if kept > 0 {
                    values[offset + first..][..kept].copy_from_slice(&part[..kept]);
                }
            }
            npy::advance(&mut index[..sides - 1], &self.chunk[..sides - 1]);
        }
        Ok(())
    }
}

fn unknown(codec: &str) -> String {
    format!("its chunks are packed by {codec}, which is not read: write it with zstd or without compression")
}

#[cfg(feature = "zstd")]
fn unzstd(file: File) -> io::Result<Box<dyn Read>> {
    Ok(Box::new(zstd::Decoder::new(file)?))
}

#[cfg(not(feature = "zstd"))]
fn unzstd(_: File) -> io::Result<Box<dyn Read>> {
    Err(io::Error::other("this build leaves out Zstandard: build it with the feature zstd"))
}
