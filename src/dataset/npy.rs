//! NumPy arrays of spectra in rows. The file holds no wavelengths; the caller knows them.
//!
//! A header is a Python literal, and who writes it may be hostile: only what NumPy writes is understood, and nothing is
//! allocated before the file is known to hold as many bytes as the header promises.

use std::path::Path;

use half::f16;
use nalgebra::DMatrix;

use super::{DatasetError, Table};
use crate::grid::Grid;

/// Largest header that is read, in bytes; NumPy reads no longer one either, unless it is told to.
const MAX_HEADER: usize = 10_000;

pub(super) fn read(path: &Path, bytes: &[u8], grid: Option<Grid>) -> Result<Table, DatasetError> {
    let failed = |reason: String| DatasetError::Npy { path: path.to_owned(), reason };
    let (header, data) = Header::split(bytes).map_err(failed)?;
    let number = Number::named(&header.dtype)
        .ok_or_else(|| failed(format!("expected an array of numbers, found the type {}", header.dtype)))?;
    let &[rows, bands] = header.shape.as_slice() else {
        return Err(failed(format!("expected (spectra, bands), found the shape {:?}", header.shape)));
    };
    let values = rows.checked_mul(bands).and_then(|values| usize::try_from(values).ok());
    let size = values.and_then(|values| values.checked_mul(number.bytes()));
    if size.is_none_or(|size| size > data.len()) {
        let promised = size.map_or("more".to_owned(), |size| format!("{size} bytes"));
        let found = data.len();
        return Err(failed(format!(
            "its header promises {promised} of data, and {found} are there; copy it again"
        )));
    }
    let grid = grid.ok_or_else(|| DatasetError::NoWavelengths { path: path.to_owned() })?;
    if bands != grid.len() as u64 {
        return Err(failed(format!("spectra of {bands} bands do not lie on the {} of {grid}", grid.len())));
    }
    let (rows, bands) = (rows as usize, bands as usize);
    let values = data[..rows * bands * number.bytes()].chunks_exact(number.bytes()).map(|b| number.read(b));
    let spectra = match header.fortran_order {
        false => DMatrix::from_iterator(bands, rows, values),
        true => DMatrix::from_iterator(rows, bands, values).transpose(),
    };
    Table::from_columns(&format!("{path:?}"), grid.wavelengths().collect(), spectra)
}

/// Header of an array.
#[derive(Debug, PartialEq)]
struct Header {
    dtype: String,
    fortran_order: bool,
    shape: Vec<u64>,
}

impl Header {
    /// Reads the header of a file; returns it with the data after it.
    fn split(bytes: &[u8]) -> Result<(Header, &[u8]), String> {
        let rest = bytes.strip_prefix(b"\x93NUMPY").ok_or("it does not begin as a .npy file does")?;
        let cut = "it ends within its header; copy it again";
        let (length, rest) = match rest {
            [1, _, a, b, rest @ ..] => (usize::from(u16::from_le_bytes([*a, *b])), rest),
            [2 | 3, _, a, b, c, d, rest @ ..] => (u32::from_le_bytes([*a, *b, *c, *d]) as usize, rest),
            [1..=3, ..] => return Err(cut.to_owned()),
            _ => return Err("its version is none of 1, 2 and 3".to_owned()),
        };
        if length > MAX_HEADER {
            return Err(format!("its header has {length} bytes; {MAX_HEADER} is the most"));
        }
        let (text, data) = rest.split_at_checked(length).ok_or(cut)?;
        let text = std::str::from_utf8(text).map_err(|_| "its header is no text")?;
        let header =
            Header::parse(text).ok_or_else(|| format!("its header is not NumPy's: {}", text.trim()))?;
        Ok((header, data))
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
        Some(Header { dtype: dtype?, fortran_order: fortran_order?, shape: shape? })
    }
}

/// A string in quotes that begins a text, without escapes, and the text after it.
fn quoted(text: &str) -> Option<(&str, &str)> {
    let quote = text.chars().next().filter(|c| ['\'', '"'].contains(c))?;
    text[1..].split_once(quote)
}

/// Number as an array holds it.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Number {
    kind: Kind,
    bytes: usize,
    big_endian: bool,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Float,
    Signed,
    Unsigned,
}

impl Number {
    /// The number of NumPy's name for it: `<f4`, `>i2`, `|u1`. None of any other type.
    fn named(name: &str) -> Option<Number> {
        let (order, kind) = (name.get(..1)?, name.get(1..2)?);
        let bytes = name.get(2..)?.parse().ok()?;
        let kind = match (kind, bytes) {
            ("f", 2 | 4 | 8) => Kind::Float,
            ("i", 1 | 2 | 4 | 8) => Kind::Signed,
            ("u", 1 | 2 | 4 | 8) => Kind::Unsigned,
            _ => return None,
        };
        match order {
            "<" | ">" => {}
            "|" | "=" if bytes == 1 => {}
            _ => return None,
        }
        Some(Number { kind, bytes, big_endian: order == ">" })
    }

    fn bytes(self) -> usize {
        self.bytes
    }

    /// Reads as many bytes as a number has.
    fn read(self, bytes: &[u8]) -> f64 {
        let mut word = [0; 8];
        for (i, &byte) in bytes.iter().enumerate() {
            word[if self.big_endian { self.bytes - 1 - i } else { i }] = byte;
        }
        let bits = u64::from_le_bytes(word);
        match (self.kind, self.bytes) {
            (Kind::Float, 2) => f16::from_bits(bits as u16).to_f64(),
            (Kind::Float, 4) => f64::from(f32::from_bits(bits as u32)),
            (Kind::Float, _) => f64::from_bits(bits),
            (Kind::Unsigned, _) => bits as f64,
            (Kind::Signed, bytes) => {
                let unused = 64 - 8 * bytes as u32;
                ((bits << unused) as i64 >> unused) as f64
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file(header: &str, data: &[u8]) -> Vec<u8> {
        let length = (header.len() as u16).to_le_bytes();
        [b"\x93NUMPY\x01\x00", &length[..], header.as_bytes(), data].concat()
    }

    fn table(header: &str, data: &[u8]) -> Result<Table, DatasetError> {
        read(Path::new("a.npy"), &file(header, data), Some("400:10:420".parse().unwrap()))
    }

    #[test]
    fn numbers_of_every_width_and_order() {
        let values = [[1.0, 2.0, 3.0], [4.0, 5.0, 100.0]];
        let flat = || values.as_flattened().iter();
        let bytes = |f: &dyn Fn(f64) -> Vec<u8>| flat().flat_map(|&v| f(v)).collect::<Vec<u8>>();
        for (name, data) in [
            ("<f2", bytes(&|v| f16::from_f64(v).to_le_bytes().to_vec())),
            ("<f4", bytes(&|v| (v as f32).to_le_bytes().to_vec())),
            (">f4", bytes(&|v| (v as f32).to_be_bytes().to_vec())),
            ("<f8", bytes(&|v| v.to_le_bytes().to_vec())),
            (">f8", bytes(&|v| v.to_be_bytes().to_vec())),
            ("|u1", bytes(&|v| vec![v as u8])),
            ("|i1", bytes(&|v| vec![v as i8 as u8])),
            ("<i2", bytes(&|v| (v as i16).to_le_bytes().to_vec())),
            (">u2", bytes(&|v| (v as u16).to_be_bytes().to_vec())),
            ("<i4", bytes(&|v| (v as i32).to_le_bytes().to_vec())),
            (">i8", bytes(&|v| (v as i64).to_be_bytes().to_vec())),
            ("<u8", bytes(&|v| (v as u64).to_le_bytes().to_vec())),
        ] {
            let header = format!("{{'descr': '{name}', 'fortran_order': False, 'shape': (2, 3), }}\n");
            let table = table(&header, &data).unwrap();
            assert_eq!([table.spectrum(0), table.spectrum(1)], [values[0], values[1]], "{name}");
        }
        assert_eq!(Number::named("<i2").unwrap().read(&(-5i16).to_le_bytes()), -5.0);
        let columns = [1u8, 4, 2, 5, 3, 100];
        let fortran = table("{\"shape\": (2, 3), 'descr': '|u1', 'fortran_order': True}", &columns).unwrap();
        assert_eq!(fortran.spectrum(1), values[1]);
    }

    /// Headers that lie, or are no header at all, are refused before anything is made of them.
    #[test]
    fn what_is_not_numpys_is_refused() {
        let wide =
            format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({}, 2), }}", u64::MAX / 2 + 1);
        for (header, message) in [
            (
                "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 3), }",
                "promises 24 bytes of data, and 12",
            ),
            (wide.as_str(), "promises more of data"),
            ("{'descr': '<c8', 'fortran_order': False, 'shape': (1, 3), }", "the type <c8"),
            ("{'descr': [('a', '<f4')], 'fortran_order': False, 'shape': (1,), }", "not NumPy's"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (3,), }", "the shape [3]"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (), }", "the shape []"),
            ("{'descr': '<f4', 'fortran_order': False, 'shape': (-1, 3), }", "not NumPy's"),
            ("{'descr': '<f4', 'fortran_order': False}", "not NumPy's"),
            ("[[[[[[[[[[[[[[[[[[[[[[[[", "not NumPy's"),
            ("", "not NumPy's"),
        ] {
            let error = table(header, &[0; 12]).unwrap_err().to_string();
            assert!(error.contains(message), "{header}: {error}");
        }
        let whole = file("{'descr': '<f4', 'fortran_order': False, 'shape': (1, 3), }", &[0; 12]);
        let huge = *b"\x93NUMPY\x02\x00\xff\xff\xff\xff";
        for (bytes, message) in [
            (&huge[..], "4294967295 bytes; 10000 is the most"),
            (b"\x93NUMPY\x09\x00", "none of 1, 2 and 3"),
            (b"PK\x03\x04", "does not begin"),
        ] {
            assert!(Header::split(bytes).unwrap_err().contains(message), "{message}");
        }
        for end in 0..whole.len() {
            assert!(read(Path::new("a.npy"), &whole[..end], Some("400:10:420".parse().unwrap())).is_err());
        }
    }
}
