//! MATLAB files of versions 4, 5 to 7, and 7.3, which is HDF5.
//!
//! This module walks the elements of a version 5 file: unpacking is capped, what is not a numeric array (text, objects,
//! sparse matrices) is stepped over rather than failing the file, and dimensions are checked against the bytes that are
//! there. The fields of a struct and the content of a cell are taken one level down, as in `lib/reflectance`.

mod v4;

use std::io::Read;
use std::path::Path;

use super::arrays::{self, Array, Arrays};
use super::numbers::{Number, NumberKind};
use super::{DatasetError, MAX_BYTES};

const HEADER: usize = 128;
const MATRIX: u32 = 14;
const COMPRESSED: u32 = 15;

/// Classes of arrays.
const CELL: u32 = 1;
const STRUCT: u32 = 2;
const CHAR: u32 = 4;
const NUMERIC: std::ops::RangeInclusive<u32> = 6..=15;

/// Flag of complex numbers.
const COMPLEX: u32 = 0x0800;

/// Largest number of fields of a struct, and of arrays of a file, that are looked at.
const MAX_ARRAYS: usize = 10_000;

/// Whether a file begins as a MATLAB file does.
pub(super) fn begins(bytes: &[u8]) -> bool {
    matches!(bytes.get(126..HEADER), Some(b"IM" | b"MI")) && bytes.starts_with(b"MATLAB") || v4::begins(bytes)
}

/// Every real numeric array of a file that is not of version 7.3, in order, and what its comment says.
pub(super) fn arrays(path: &Path, bytes: &[u8]) -> Result<Arrays, DatasetError> {
    let failed =
        |reason: String| DatasetError::Format { path: path.to_owned(), format: "a MATLAB file", reason };
    let file = match bytes.get(126..HEADER) {
        Some(b"IM") => File { little_endian: true },
        Some(b"MI") => File { little_endian: false },
        _ => return v4::arrays(bytes).map_err(failed),
    };
    let mut found = Arrays { format: "MATLAB file, version 5 to 7 (.mat)".to_owned(), ..Arrays::default() };
    let mut unpacked = 0;
    let mut rest = &bytes[HEADER..];
    while rest.len() >= 8 {
        let (kind, size) = (file.word(rest, 0).unwrap_or(0), file.word(rest, 1).unwrap_or(0) as usize);
        let Some(payload) = rest.get(8..8 + size) else {
            return Err(failed("it ends in the middle of a variable; copy it again".to_owned()));
        };
        let inflated;
        let element = match kind {
            COMPRESSED => {
                inflated = inflate(payload, MAX_BYTES - unpacked)
                    .map_err(|e| failed(format!("a compressed variable is damaged ({e})")))?
                    .ok_or_else(|| DatasetError::TooLarge { path: path.to_owned() })?;
                unpacked += inflated.len() as u64;
                inflated.as_slice()
            }
            _ => &rest[..8 + size],
        };
        file.collect(element, "", 0, &mut found).map_err(failed)?;
        rest = &rest[8 + size..];
        if kind != COMPRESSED {
            rest = &rest[(size.next_multiple_of(8) - size).min(rest.len())..];
        }
    }
    Ok(found)
}

/// Unpacks at most `cap` bytes of a zlib stream; `None` where it holds more.
fn inflate(bytes: &[u8], cap: u64) -> std::io::Result<Option<Vec<u8>>> {
    let mut out = Vec::new();
    flate2::read::ZlibDecoder::new(bytes).take(cap + 1).read_to_end(&mut out)?;
    Ok((out.len() as u64 <= cap).then_some(out))
}

/// Order of the bytes of a file.
#[derive(Clone, Copy)]
struct File {
    little_endian: bool,
}

/// Part of an element: its type, and its bytes.
type Part<'b> = (u32, &'b [u8]);

impl File {
    fn word(self, at: &[u8], i: usize) -> Option<u32> {
        let word = at.get(4 * i..4 * i + 4)?.try_into().ok()?;
        Some(if self.little_endian { u32::from_le_bytes(word) } else { u32::from_be_bytes(word) })
    }

    /// The first part of these bytes, and those after it. Up to four bytes stand in the tag.
    fn part(self, rest: &[u8]) -> Option<(Part<'_>, &[u8])> {
        let tag = self.word(rest, 0)?;
        let (kind, start, size) = match tag >> 16 {
            0 => (tag, 8usize, self.word(rest, 1)? as usize),
            size => (tag & 0xFFFF, 4, size as usize),
        };
        let bytes = rest.get(start..start.checked_add(size)?)?;
        let after = rest.get((start + size).next_multiple_of(8)..).unwrap_or_default();
        Some(((kind, bytes), after))
    }

    /// Adds the arrays of an element, whose name is `prefix` and its own. What is no array of numbers adds nothing.
    fn collect(self, element: &[u8], prefix: &str, depth: usize, found: &mut Arrays) -> Result<(), String> {
        if self.word(element, 0) != Some(MATRIX) || found.all.len() >= MAX_ARRAYS {
            return Ok(());
        }
        let Some((flags, sides, name, rest)) = self.head(element) else { return Ok(()) };
        let name = match (prefix, name.as_str()) {
            ("", name) => name.to_owned(),
            (prefix, "") => prefix.to_owned(),
            (prefix, name) => format!("{prefix}/{name}"),
        };
        match flags & 0xFF {
            class if NUMERIC.contains(&class) && flags & COMPLEX == 0 => {
                if let Some(array) = self.numbers(name, sides, rest)? {
                    found.all.push(array);
                }
            }
            CHAR if name == arrays::COMMENT => {
                let text = self.part(rest).and_then(|(part, _)| self.text(part));
                found.kind = text.and_then(|text| arrays::kind(&text)).or(found.kind);
            }
            STRUCT if depth < 2 && sides.iter().all(|side| *side == 1) => {
                self.fields(rest, &name, depth, found)?;
            }
            CELL if depth < 2 && sides.iter().all(|side| *side == 1) => {
                self.collect(rest, &name, depth + 1, found)?;
            }
            _ => {}
        }
        Ok(())
    }

    /// Flags, sides and name of an array, and the bytes of its content.
    fn head(self, element: &[u8]) -> Option<(u32, Vec<usize>, String, &[u8])> {
        let ((_, flags), rest) = self.part(element.get(8..)?)?;
        let ((_, sides), rest) = self.part(rest)?;
        let ((_, name), rest) = self.part(rest)?;
        let count = (sides.len() / 4).min(8);
        let sides =
            (0..count).map(|i| self.word(sides, i).map(|side| side as usize)).collect::<Option<_>>()?;
        Some((self.word(flags, 0)?, sides, String::from_utf8_lossy(name).into_owned(), rest))
    }

    /// The array of numbers of a content; `None` where its bytes are not as many as its sides say.
    fn numbers(self, name: String, sides: Vec<usize>, content: &[u8]) -> Result<Option<Array>, String> {
        let Some(((kind, bytes), _)) = self.part(content) else { return Ok(None) };
        let (kind, width) = match kind {
            1 => (NumberKind::Signed, 1),
            2 => (NumberKind::Unsigned, 1),
            3 => (NumberKind::Signed, 2),
            4 => (NumberKind::Unsigned, 2),
            5 => (NumberKind::Signed, 4),
            6 => (NumberKind::Unsigned, 4),
            7 => (NumberKind::Float, 4),
            9 => (NumberKind::Float, 8),
            12 => (NumberKind::Signed, 8),
            13 => (NumberKind::Unsigned, 8),
            _ => return Ok(None),
        };
        let count = sides.iter().try_fold(1usize, |product, side| product.checked_mul(*side));
        if count.is_none_or(|count| count != bytes.len() / width) {
            return Ok(None);
        }
        if bytes.len() / width > super::MAX_VALUES {
            return Err(super::too_many(bytes.len() / width));
        }
        let number = Number { kind, bytes: width, big_endian: !self.little_endian };
        Ok(Some(Array { name, sides, values: number.read_all(bytes), unit: None }))
    }

    /// Adds the fields of a struct.
    fn fields(self, content: &[u8], name: &str, depth: usize, found: &mut Arrays) -> Result<(), String> {
        let names = || {
            let ((_, length), rest) = self.part(content)?;
            let length = self.word(length, 0)? as usize;
            let ((_, names), rest) = self.part(rest)?;
            if length == 0 || names.len() / length > MAX_ARRAYS {
                return None;
            }
            let text = |bytes: &[u8]| {
                String::from_utf8_lossy(bytes.split(|b| *b == 0).next().unwrap_or_default()).into_owned()
            };
            Some((names.chunks_exact(length).map(text).collect::<Vec<_>>(), rest))
        };
        let Some((names, mut rest)) = names() else { return Ok(()) };
        for field in names {
            let Some((_, after)) = self.part(rest) else { break };
            self.collect(rest, &format!("{name}/{field}"), depth + 1, found)?;
            rest = after;
        }
        Ok(())
    }

    /// Text of a part.
    fn text(self, (kind, bytes): Part) -> Option<String> {
        const UTF16: [u32; 2] = [4, 17]; // and numbers of 16 bits, which is what MATLAB itself writes
        const BYTES: [u32; 3] = [1, 2, 16];
        if BYTES.contains(&kind) {
            return String::from_utf8(bytes.to_vec()).ok();
        }
        let unit = |pair: &[u8; 2]| {
            if self.little_endian { u16::from_le_bytes(*pair) } else { u16::from_be_bytes(*pair) }
        };
        let units: Vec<u16> = bytes.as_chunks().0.iter().map(unit).collect();
        UTF16.contains(&kind).then(|| String::from_utf16(&units).ok())?
    }
}
