//! MATLAB files, whose matrices are read by the naming conventions of [`matrix`](super::matrix).
//!
//! The `matfile` crate decodes the numeric arrays of v5 files. This module walks the file's elements first, for three things which
//! that crate leaves to its caller: unpacking is capped, what is not a numeric array (structs, cells, objects) is
//! stepped over rather than failing the file, and dimensions are checked against the bytes that are there.

use std::io::Read;
use std::path::Path;

use matfile::{MatFile, NumericData};

use super::matrix::{self, Matrix};
use super::{DatasetError, MAX_BYTES, Table};

const HEADER: usize = 128;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

pub(super) fn read(path: &Path, bytes: &[u8], variable: Option<&str>) -> Result<Table, DatasetError> {
    let matrices = match is_hdf5(bytes) {
        true => hdf5(path)?,
        false => matrices(path, bytes)?,
    };
    matrix::choose(path, &matrices, variable)
}

/// Every real numeric matrix of the file, in order.
pub(super) fn matrices(path: &Path, bytes: &[u8]) -> Result<Vec<Matrix>, DatasetError> {
    let failed = |reason: &str| DatasetError::Mat { path: path.to_owned(), reason: reason.to_owned() };
    let little_endian = endianness(bytes).map_err(failed)?;
    let word = |at: &[u8], i: usize| -> Option<u32> {
        let word = at.get(4 * i..4 * i + 4)?.try_into().ok()?;
        Some(if little_endian { u32::from_le_bytes(word) } else { u32::from_be_bytes(word) })
    };

    let mut matrices = Vec::new();
    let mut unpacked = 0;
    let mut rest = &bytes[HEADER..];
    while rest.len() >= 8 {
        let (kind, size) = (word(rest, 0).unwrap_or(0), word(rest, 1).unwrap_or(0) as usize);
        let Some(payload) = rest.get(8..8 + size) else {
            return Err(failed("it ends in the middle of a variable; copy it again"));
        };
        let inflated;
        let element = match kind {
            COMPRESSED => {
                inflated = inflate(payload, MAX_BYTES - unpacked)
                    .map_err(|e| failed(&format!("a compressed variable is damaged ({e})")))?
                    .ok_or_else(|| DatasetError::TooLarge { path: path.to_owned() })?;
                unpacked += inflated.len() as u64;
                inflated.as_slice()
            }
            _ => &rest[..8 + size],
        };
        if is_numeric_matrix(element, word) {
            matrices.extend(decode(&bytes[..HEADER], element));
        }
        rest = &rest[8 + size..];
        if kind != COMPRESSED {
            rest = &rest[(size.next_multiple_of(8) - size).min(rest.len())..];
        }
    }
    Ok(matrices)
}

/// Whether the file is HDF5: of version 7.3, or not of MATLAB at all.
fn is_hdf5(bytes: &[u8]) -> bool {
    const HDF5: &[u8] = b"\x89HDF\r\n\x1a\n";
    bytes.starts_with(b"MATLAB 7.3") || bytes.starts_with(HDF5) || bytes.get(512..520) == Some(HDF5)
}

#[cfg(feature = "hdf5")]
fn hdf5(path: &Path) -> Result<Vec<Matrix>, DatasetError> {
    super::hdf5::matrices(path)
}

#[cfg(not(feature = "hdf5"))]
fn hdf5(path: &Path) -> Result<Vec<Matrix>, DatasetError> {
    let reason =
        "this build leaves out HDF5: build it with the feature hdf5, or resave with save(file, '-v7')";
    Err(DatasetError::Mat { path: path.to_owned(), reason: reason.to_owned() })
}

/// Whether the file is little-endian; an error says what else it is.
fn endianness(bytes: &[u8]) -> Result<bool, &'static str> {
    const V4: &str = "it is of version 4, which is not supported: resave it with save(file, '-v7')";
    match bytes.get(126..HEADER) {
        Some(b"IM") => return Ok(true),
        Some(b"MI") => return Ok(false),
        _ => {}
    }
    // A version 4 file starts with a small number, its type word, in either byte order.
    match bytes.first_chunk() {
        Some(&word) if u32::from_le_bytes(word).min(u32::from_be_bytes(word)) < 5000 => Err(V4),
        _ => Err("it has no MATLAB header"),
    }
}

/// At most `cap` bytes of a zlib stream; `None` where it holds more.
fn inflate(bytes: &[u8], cap: u64) -> std::io::Result<Option<Vec<u8>>> {
    let mut out = Vec::new();
    flate2::read::ZlibDecoder::new(bytes).take(cap + 1).read_to_end(&mut out)?;
    Ok((out.len() as u64 <= cap).then_some(out))
}

/// Whether an element is a real, dense, numeric array whose dimensions its bytes can hold.
fn is_numeric_matrix(element: &[u8], word: impl Fn(&[u8], usize) -> Option<u32>) -> bool {
    const CLASSES: std::ops::RangeInclusive<u32> = 6..=15; // double, single, and the integers
    const COMPLEX: u32 = 0x0800;
    let Some(flags) = word(element, 4) else { return false };
    let dimensions = || {
        let count = word(element, 7)? as usize / 4;
        (8..8 + count.min(8)).try_fold(1u64, |product, i| product.checked_mul(word(element, i)?.into()))
    };
    word(element, 0) == Some(MATRIX)
        && CLASSES.contains(&(flags & 0xFF))
        && flags & COMPLEX == 0
        && dimensions().is_some_and(|values| values <= element.len() as u64)
}

/// The matrix of one element, or nothing where it is not two-dimensional or not readable.
fn decode(header: &[u8], element: &[u8]) -> Option<Matrix> {
    let file = MatFile::parse([header, element].concat().as_slice()).ok()?;
    let [array] = file.arrays().as_slice() else { return None };
    let &[rows, columns] = array.size().as_slice() else { return None };
    let values: Vec<f64> = match array.data() {
        NumericData::Double { real, .. } => real.clone(),
        NumericData::Single { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::Int8 { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::UInt8 { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::Int16 { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::UInt16 { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::Int32 { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::UInt32 { real, .. } => real.iter().map(|&v| v.into()).collect(),
        NumericData::Int64 { real, .. } => real.iter().map(|&v| v as f64).collect(),
        NumericData::UInt64 { real, .. } => real.iter().map(|&v| v as f64).collect(),
    };
    let name = array.name().to_owned();
    (values.len() == rows.checked_mul(columns)?).then_some(Matrix { name, rows, columns, values })
}
