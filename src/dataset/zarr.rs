//! Zarr stores in a folder, of versions 2 and 3: arrays whose chunks are plain, or packed by Zstandard, gzip or zlib.

use std::io::Read;
use std::path::{Path, PathBuf};

use serde_json::Value;

use super::arrays::{self, Array, Arrays, Order};
use super::numbers::Number;
use super::units::WavelengthUnit;
use super::{DatasetError, MAX_BYTES, MAX_VALUES, files};

/// Largest number of arrays and of chunks of an array that are looked at.
const MAX_ARRAYS: usize = 2000;
const MAX_CHUNKS: usize = 1 << 20;

/// Largest file of JSON.
const MAX_JSON: u64 = 64 << 20;

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
    fill: f64,
    prefix: &'static str,
    separator: char,
    unit: Option<WavelengthUnit>,
    scale: [Option<f64>; 2],
    missing: Vec<f64>,
}

fn sides(value: &Value) -> Option<Vec<usize>> {
    value.as_array()?.iter().map(|side| side.as_u64().and_then(|side| usize::try_from(side).ok())).collect()
}

/// A number of JSON, where names stand for those that JSON has not.
fn fill(value: &Value) -> f64 {
    match value {
        Value::String(text) => text.parse().unwrap_or(f64::NAN),
        value => value.as_f64().unwrap_or(f64::NAN),
    }
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
            fill: fill(&node["fill_value"]),
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
            fill: fill(&node["fill_value"]),
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
        let bytes = self.chunk.iter().try_fold(self.number.bytes, |product, side| product.checked_mul(*side));
        match bytes {
            Some(bytes) if bytes as u64 <= MAX_BYTES => Ok(Some(self)),
            _ => Err(format!("its chunks of {:?} are more than 512 MiB", self.chunk)),
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
        // An array of fill alone is no measurement, and takes no file.
        let mut values = vec![self.fill; count];
        let mut present = 0;
        let mut at = vec![0; grid.len()];
        for _ in 0..chunks.unwrap_or(0) {
            let path = folder.join(self.key(&at));
            if path.is_file() {
                present += 1;
                let chunk = self.unpack(&path)?;
                self.place(&at, &chunk, &mut values);
            }
            for side in (0..at.len()).rev() {
                at[side] += 1;
                if at[side] < grid[side] {
                    break;
                }
                at[side] = 0;
            }
        }
        let missing = chunks.unwrap_or(0) - present;
        if missing > 0 && count > 0 {
            return Err(Fault::Reason(format!(
                "{missing} of its {} chunks are not there; copy it again",
                present + missing
            )));
        }
        for value in &mut values {
            if self.missing.contains(value) {
                *value = f64::NAN;
            }
            *value = *value * self.scale[0].unwrap_or(1.0) + self.scale[1].unwrap_or(0.0);
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

    /// Values of a chunk.
    fn unpack(&self, path: &Path) -> Result<Vec<f64>, Fault> {
        let packed = files::read_capped(path, MAX_BYTES)?;
        let count: usize = self.chunk.iter().product();
        let size = count * self.number.bytes;
        let cap = size as u64 + 1;
        let mut bytes = Vec::new();
        let unpacked = match self.packing {
            Packing::Plain => {
                bytes = packed;
                Ok(0)
            }
            Packing::Gzip => {
                flate2::read::GzDecoder::new(packed.as_slice()).take(cap).read_to_end(&mut bytes)
            }
            Packing::Zlib => {
                flate2::read::ZlibDecoder::new(packed.as_slice()).take(cap).read_to_end(&mut bytes)
            }
            Packing::Zstd => unzstd(&packed, cap, &mut bytes),
        };
        let name = || path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        unpacked.map_err(|e| format!("chunk {} is damaged ({e}); copy it again", name()))?;
        if bytes.len() != size {
            return Err(Fault::Reason(format!(
                "chunk {} has {} bytes, not {size}; copy it again",
                name(),
                bytes.len()
            )));
        }
        Ok(self.number.read_all(&bytes))
    }

    /// Puts the values of a chunk into those of the array.
    fn place(&self, at: &[usize], chunk: &[f64], values: &mut [f64]) {
        let sides = self.shape.len();
        let chunk = match self.is_fortran {
            true => super::npy::turned(&self.chunk, chunk),
            false => chunk.to_vec(),
        };
        let last = self.chunk[sides - 1];
        let mut index = vec![0; sides];
        for row in chunk.chunks_exact(last) {
            let start: Vec<usize> =
                (0..sides).map(|side| at[side] * self.chunk[side] + index[side]).collect();
            if (0..sides - 1).all(|side| start[side] < self.shape[side]) {
                let offset = (0..sides).fold(0, |offset, side| offset * self.shape[side] + start[side]);
                let length = last.min(self.shape[sides - 1] - start[sides - 1]);
                values[offset..offset + length].copy_from_slice(&row[..length]);
            }
            for side in (0..sides - 1).rev() {
                index[side] += 1;
                if index[side] < self.chunk[side] {
                    break;
                }
                index[side] = 0;
            }
        }
    }
}

fn unknown(codec: &str) -> String {
    format!("its chunks are packed by {codec}, which is not read: write it with zstd or without compression")
}

#[cfg(feature = "zstd")]
fn unzstd(packed: &[u8], cap: u64, bytes: &mut Vec<u8>) -> std::io::Result<usize> {
    zstd::Decoder::with_buffer(packed)?.take(cap).read_to_end(bytes)
}

#[cfg(not(feature = "zstd"))]
fn unzstd(_: &[u8], _: u64, _: &mut Vec<u8>) -> std::io::Result<usize> {
    Err(std::io::Error::other("this build leaves out Zstandard: build it with the feature zstd"))
}
