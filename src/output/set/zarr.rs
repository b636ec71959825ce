//! Zarr version 3: a group of arrays, chunked by draws, a file per chunk.
//!
//! A chunk is the bytes of its draws, and all else is JSON, so this is written out here: the `zarrs` crate would bring
//! 139 others, and would not let a chunk be hashed and put in place whole. Dimension names and the coordinates of
//! wavelengths are what xarray looks for; metadata are consolidated, so that a reader opens one file.

use std::borrow::Cow;
use std::io;

use serde_json::{Map, Value, json};

use super::super::schema::{Field, Schema, SharedArray};
use super::layout::Part;

/// Level at which Zstandard compresses chunks; `None` where it does not.
pub(super) type Level = Option<i32>;

/// Encodes the chunk files for the draws of one chunk. The last chunk of an array is padded with zeros to the length
/// of the others.
pub(super) fn chunk<'a>(
    schema: &Schema,
    level: Level,
    rows: u64,
    index: u64,
    columns: &'a [Vec<u8>],
) -> io::Result<Vec<Part<'a>>> {
    schema
        .fields
        .iter()
        .zip(columns)
        .map(|(field, column)| {
            let mut bytes = field.store(column)?;
            let size = rows as usize * field.stored_bytes();
            if bytes.len() < size {
                bytes.to_mut().resize(size, 0);
            }
            Ok(Part { name: chunk_name(field, index), bytes: pack(bytes, level)? })
        })
        .collect()
}

/// Name of the file of a field in a chunk.
pub(super) fn chunk_name(field: &Field, index: u64) -> String {
    let others = ".0".repeat(field.shape(0).len() - 1);
    format!("{}/c.{index}{others}", field.name)
}

#[cfg(feature = "zstd")]
fn pack(bytes: Cow<[u8]>, level: Level) -> io::Result<Cow<[u8]>> {
    match level {
        Some(level) => Ok(Cow::Owned(zstd::bulk::compress(&bytes, level)?)),
        None => Ok(bytes),
    }
}

#[cfg(not(feature = "zstd"))]
fn pack(bytes: Cow<[u8]>, level: Level) -> io::Result<Cow<[u8]>> {
    match level {
        Some(_) => Err(io::Error::other("this build leaves out Zstandard: build it with the feature zstd")),
        None => Ok(bytes),
    }
}

/// Encodes the files that describe the chunks to readers; the one that makes them a data set is last.
pub(super) fn metadata(schema: &Schema, level: Level, rows: u64) -> Vec<Part<'static>> {
    let mut arrays: Map<String, Value> = schema
        .fields
        .iter()
        .map(|field| (field.name.clone(), array(field, &schema.row, (schema.count, rows), level)))
        .collect();
    arrays.extend(schema.shared.iter().map(|constant| {
        let codecs = [json!({ "name": "bytes", "configuration": { "endian": "little" } })];
        let (shape, data_type) = (constant.shape(), constant.dtype.name());
        let names: Vec<_> = constant.axes.iter().map(|(name, _)| name.as_str()).collect();
        (constant.name.clone(), node(&shape, &shape, data_type, &codecs, &names, json!({})))
    }));
    let mut parts = Vec::new();
    if !schema.wavelengths.is_empty() {
        arrays.insert("wavelength".to_owned(), wavelength(schema.wavelengths.len()));
        let bytes = schema.wavelengths.iter().flat_map(|w| w.to_le_bytes()).collect();
        parts.push(Part { name: "wavelength/c.0".to_owned(), bytes });
    }
    parts.extend(
        arrays.iter().map(|(name, array)| Part { name: format!("{name}/zarr.json"), bytes: text(array) }),
    );
    let group = json!({
        "zarr_format": 3,
        "node_type": "group",
        "attributes": schema.attributes,
        "consolidated_metadata": { "kind": "inline", "must_understand": false, "metadata": arrays },
    });
    parts.push(Part { name: "zarr.json".to_owned(), bytes: text(&group) });
    parts
}

/// Encodes the arrays that all draws share, one chunk each.
pub(super) fn constants(schema: &Schema) -> Vec<Part<'_>> {
    let name = |constant: &'_ SharedArray| {
        let others = ".0".repeat(constant.axes.len() - 1);
        format!("{}/c.0{others}", constant.name)
    };
    schema
        .shared
        .iter()
        .map(|constant| Part { name: name(constant), bytes: Cow::Borrowed(constant.bytes.as_slice()) })
        .collect()
}

fn array(field: &Field, row: &str, (count, rows): (u64, u64), level: Level) -> Value {
    let mut codecs = vec![json!({ "name": "bytes", "configuration": { "endian": "little" } })];
    if let Some(level) = level {
        codecs.push(json!({ "name": "zstd", "configuration": { "level": level, "checksum": false } }));
    }
    node(&field.shape(count), &field.shape(rows), field.stored.name(), &codecs, &field.axes(row), json!({}))
}

fn wavelength(count: usize) -> Value {
    let codecs = [json!({ "name": "bytes", "configuration": { "endian": "little" } })];
    let shape = [count as u64];
    node(&shape, &shape, "float64", &codecs, &["wavelength"], json!({ "units": "nm" }))
}

fn node(
    shape: &[u64],
    chunk: &[u64],
    data_type: &str,
    codecs: &[Value],
    names: &[&str],
    attributes: Value,
) -> Value {
    json!({
        "zarr_format": 3,
        "node_type": "array",
        "shape": shape,
        "data_type": data_type,
        "chunk_grid": { "name": "regular", "configuration": { "chunk_shape": chunk } },
        "chunk_key_encoding": { "name": "default", "configuration": { "separator": "." } },
        "fill_value": if data_type.starts_with("float") { json!(0.0) } else { json!(0) },
        "codecs": codecs,
        "dimension_names": names,
        "attributes": attributes,
    })
}

fn text(value: &Value) -> Cow<'static, [u8]> {
    Cow::Owned((serde_json::to_string_pretty(value).expect("JSON is text") + "\n").into_bytes())
}
