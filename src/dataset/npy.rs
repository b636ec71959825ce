//! NumPy arrays. The file holds no wavelengths; the caller knows them.
//!
//! A header is a Python literal, and who writes it may be hostile: only what NumPy writes is understood, and nothing is
//! allocated before the file is known to hold as many bytes as the header promises.

use std::io::{self, Read};
use std::path::Path;

use super::arrays::{Array, Arrays, Order};
use super::files::Source;
use super::numbers::{Number, transposed};
use super::{DatasetError, files};

/// Largest header that is read, in bytes; NumPy reads no longer one either, unless it is told to.
const MAX_HEADER: usize = 10_000;

/// Largest number of sides.
const MAX_SIDES: usize = 8;

/// The array of a file, as the only one.
pub(super) fn arrays(path: &Path, source: Source) -> Result<Arrays, DatasetError> {
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let array = of_file(path, &name, source)?;
    Ok(Arrays {
        format: "NumPy array (.npy)".to_owned(),
        all: vec![array],
        order: Order::LastFirst,
        ..Arrays::default()
    })
}

/// Whether a file begins as one of NumPy's does.
pub(super) fn begins(bytes: &[u8]) -> bool {
    bytes.starts_with(b"\x93NUMPY")
}

/// The array of a file, by this name.
pub(super) fn of_file(path: &Path, name: &str, mut source: Source) -> Result<Array, DatasetError> {
    let length = source.length().map_err(|error| files::failed(path, error))?;
    array(name, &mut source, length).map_err(|reason| DatasetError::Format {
        path: path.to_owned(),
        format: "a NumPy array",
        reason,
    })
}

/// Reads an array from a source of as many bytes.
pub(super) fn array(name: &str, source: &mut impl Read, length: u64) -> Result<Array, String> {
    let header = Header::read(source)?;
    let number = Number::named(&header.dtype)
        .ok_or_else(|| format!("expected an array of numbers, found the type {}", header.dtype))?;
    if header.shape.is_empty() || header.shape.len() > MAX_SIDES {
        return Err(format!("expected spectra, found the shape {:?}", header.shape));
    }
    let values = header.shape.iter().try_fold(1u64, |product, side| product.checked_mul(*side));
    let size = values.and_then(|values| usize::try_from(values).ok()?.checked_mul(number.bytes));
    let there = length.saturating_sub(header.bytes);
    let Some(size) = size.filter(|size| *size as u64 <= there) else {
        let promised = size.map_or("more".to_owned(), |size| format!("{size} bytes"));
        return Err(format!("its header promises {promised} of data, and {there} are there; copy it again"));
    };
    let count = size / number.bytes;
    if count > super::MAX_VALUES {
        return Err(super::too_many(count));
    }
    let mut sides: Vec<usize> = header.shape.iter().map(|side| *side as usize).collect();
    if !header.fortran_order {
        sides.reverse();
    }
    let values = number.read_from(source, count).map_err(|error| cut(&error))?;
    match header.fortran_order {
        false => Ok(Array { name: name.to_owned(), sides, values, unit: None }),
        true => {
            let values = turned(&sides, &values);
            sides.reverse();
            Ok(Array { name: name.to_owned(), sides, values, unit: None })
        }
    }
}

/// Values with their sides in the opposite order.
pub(super) fn turned(sides: &[usize], values: &[f64]) -> Vec<f64> {
    if sides.iter().filter(|side| **side != 1).count() <= 1 {
        return values.to_vec();
    }
    if let [first, _] = *sides {
        return transposed(values, first);
    }
    let mut strides = vec![1; sides.len()];
    for i in 1..sides.len() {
        strides[i] = strides[i - 1] * sides[i - 1];
    }
    let mut index = vec![0; sides.len()];
    let mut out = Vec::with_capacity(values.len());
    for _ in 0..values.len() {
        out.push(values[index.iter().zip(&strides).map(|(i, stride)| i * stride).sum::<usize>()]);
        advance(&mut index, sides);
    }
    out
}

/// Takes an index to the next value of an array with these sides, of which the last runs first; from the last to the first.
pub(super) fn advance(index: &mut [usize], sides: &[usize]) {
    for (index, side) in index.iter_mut().zip(sides).rev() {
        *index += 1;
        if *index < *side {
            break;
        }
        *index = 0;
    }
}

/// The reason of a file that ends too early, or cannot be read on.
fn cut(error: &io::Error) -> String {
    match error.kind() {
        io::ErrorKind::UnexpectedEof => "it ends too early; copy it again".to_owned(),
        _ => error.to_string(),
    }
}

/// Header of an array.
#[derive(Debug, PartialEq)]
struct Header {
    dtype: String,
    fortran_order: bool,
    shape: Vec<u64>,
    /// Number of bytes before the data.
    bytes: u64,
}

impl Header {
    /// Reads the header of a file, up to its data.
    fn read(source: &mut impl Read) -> Result<Header, String> {
        let mut take = |count: usize| {
            let mut bytes = vec![0; count];
            source.read_exact(&mut bytes).map(|()| bytes).map_err(|error| cut(&error))
        };
        let start = take(8)?;
        if !begins(&start) {
            return Err("it does not begin as a .npy file does".to_owned());
        }
        let width = match start[6] {
            1 => 2,
            2 | 3 => 4,
            _ => return Err("its version is none of 1, 2 and 3".to_owned()),
        };
        let mut length = [0; 4];
        length[..width].copy_from_slice(&take(width)?);
        let length = u32::from_le_bytes(length) as usize;
        if length > MAX_HEADER {
            return Err(format!("its header has {length} bytes; {MAX_HEADER} is the most"));
        }
        let text = String::from_utf8(take(length)?).map_err(|_| "its header is no text")?;
        let header = Header::parse(&text).ok_or_else(|| {
            format!("its header is not NumPy's: {}", text.trim().chars().take(60).collect::<String>())
        })?;
        Ok(Header { bytes: (8 + width + length) as u64, ..header })
    }

    /// Parses `{'descr': '<f4', 'fortran_order': False, 'shape': (3, 31), }`, in any order.
    fn parse(text: &str) -> Option<Header> {
        let mut rest = text.trim().strip_prefix('{')?.strip_suffix('}')?.trim();
        let (mut dtype, mut fortran_order, mut shape) = (None, None, None);
        while !rest.is_empty() {
            let (key, after) = quoted(rest)?;
            let after = after.trim_start().strip_prefix(':')?.trim_start();
            rest = match key {
                "descr" => {
                    let (value, after) = quoted(after)?;
                    dtype = Some(value.to_owned());
                    after
                }
                "fortran_order" => {
                    let is = |word| after.strip_prefix(word);
                    fortran_order = Some(is("True").is_some());
                    is("True").or_else(|| is("False"))?
                }
                "shape" => {
                    let (inner, after) = after.strip_prefix('(')?.split_once(')')?;
                    let extents = inner.trim().trim_end_matches(',').trim_end();
                    let number = |extent: &str| extent.trim().trim_end_matches('L').parse().ok();
                    shape = match extents {
                        "" => Some(Vec::new()),
                        extents => Some(extents.split(',').map(number).collect::<Option<_>>()?),
                    };
                    after
                }
                _ => return None,
            }
            .trim_start();
            rest = match rest.strip_prefix(',') {
                Some(rest) => rest.trim_start(),
                None if rest.is_empty() => rest,
                None => return None,
            };
        }
        Some(Header { dtype: dtype?, fortran_order: fortran_order?, shape: shape?, bytes: 0 })
    }
}

/// A string in quotes that begins a text, without escapes, and the text after it.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| ['\'', '"'].contains(c))?;
    text[1..].split_once(quote)
}

/// Text of an array of one string, as NumPy holds it: four bytes a letter.
pub(super) fn text(bytes: &[u8]) -> Option<String> {
    let mut data = bytes;
    let header = Header::read(&mut data).ok()?;
    let big_endian = match header.dtype.get(..2)? {
        "<U" => false,
        ">U" => true,
        _ => return None,
    };
    let letter = |b: &[u8; 4]| {
        char::from_u32(if big_endian { u32::from_be_bytes(*b) } else { u32::from_le_bytes(*b) })
    };
    data.as_chunks().0.iter().map(letter).take_while(|c| *c != Some('\0')).collect()
}
