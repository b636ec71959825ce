//! Version 5: elements one after another, each a tag (type, bytes) and what that says, at multiples of 8 bytes.
//!
//! Variables arrive side by side, but their sizes are known, so the places of all of them are, as in `.npz`. (The crates
//! that write this format want whole arrays in memory.) Nothing is compressed: draws do not compress.

use std::io::{self, Seek, SeekFrom, Write};

use super::Contents;
use crate::output::Encoder;
use crate::output::schema::Field;
use crate::quantity::Dtype;

/// More than all that a variable has besides its values.
pub(super) const HEAD_BYTES: u64 = 256;

/// The types of elements.
mod kind {
    pub(super) const INT8: u32 = 1;
    pub(super) const INT32: u32 = 5;
    pub(super) const UINT32: u32 = 6;
    pub(super) const SINGLE: u32 = 7;
    pub(super) const DOUBLE: u32 = 9;
    pub(super) const MATRIX: u32 = 14;
    pub(super) const UTF8: u32 = 16;
}

/// The classes of arrays.
mod class {
    pub(super) const CHAR: u32 = 4;
    pub(super) const DOUBLE: u32 = 6;
    pub(super) const SINGLE: u32 = 7;
    pub(super) const UINT32: u32 = 13;
}

pub(super) struct Mat<W> {
    to: W,
    fields: Vec<Field>,
    /// Offsets of the next bytes of each field.
    next: Vec<u64>,
}

impl<W: Write + Seek> Mat<W> {
    pub(super) fn begin(mut to: W, contents: &Contents) -> io::Result<Self> {
        let schema = &contents.schema;
        // The time of MATLAB's own headers is left out: the same draws make the same file.
        let text = "MATLAB 5.0 MAT-file, Platform: spectroll";
        to.write_all(&[format!("{text:<116}").as_bytes(), &[0; 8], &[0x00, 0x01, b'I', b'M']].concat())?;
        let mut end = 128;
        let mut next = Vec::new();
        for field in &schema.fields {
            let bytes = schema.count * field.stored_bytes() as u64;
            let (class, kind) = of(field.stored);
            let head = head(&field.name, (class, kind), &dimensions(&field.shape(schema.count)), bytes);
            to.seek(SeekFrom::Start(end))?;
            to.write_all(&head)?;
            next.push(end + head.len() as u64);
            end += head.len() as u64 + bytes.next_multiple_of(8);
        }
        // These are whole, and the last of them is the end of the file: what is skipped before reads as zeros.
        to.seek(SeekFrom::Start(end))?;
        for shared in &schema.shared {
            let dimensions = dimensions(&shared.shape());
            to.write_all(&variable(&shared.name, of(shared.dtype), &dimensions, &shared.bytes))?;
        }
        let mut doubles = |name: &str, values: &[f64], dimensions: [u64; 2]| {
            let bytes: Vec<u8> = values.iter().flat_map(|value| value.to_le_bytes()).collect();
            to.write_all(&variable(name, (class::DOUBLE, kind::DOUBLE), &dimensions, &bytes))
        };
        doubles("wavelength", &schema.wavelengths, [schema.wavelengths.len() as u64, 1])?;
        if let Some((sampling, dimensions)) = contents.sampling() {
            contents.samplings.iter().try_for_each(|name| doubles(name, &sampling, dimensions))?;
        }
        let text = ascii(&schema.attributes_text());
        let dimensions = [1, text.len() as u64];
        to.write_all(&variable("comment", (class::CHAR, kind::UTF8), &dimensions, text.as_bytes()))?;
        Ok(Mat { to, fields: schema.fields.clone(), next })
    }
}

impl<W: Write + Seek> Encoder for Mat<W> {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        for ((field, next), column) in self.fields.iter().zip(&mut self.next).zip(columns) {
            let stored = field.store(column)?;
            self.to.seek(SeekFrom::Start(*next))?;
            self.to.write_all(&stored)?;
            *next += stored.len() as u64;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.to.flush()
    }
}

/// The class of an array and the type of its values.
fn of(dtype: Dtype) -> (u32, u32) {
    match dtype {
        Dtype::F32 => (class::SINGLE, kind::SINGLE),
        Dtype::F64 => (class::DOUBLE, kind::DOUBLE),
        Dtype::U32 => (class::UINT32, kind::UINT32),
        Dtype::F16 => unreachable!("the format holds no halves: see FileFormat::check"),
    }
}

/// MATLAB's first dimension is the last of C order.
fn dimensions(shape: &[u64]) -> Vec<u64> {
    shape.iter().rev().copied().collect()
}

/// A variable with all its values.
fn variable(name: &str, types: (u32, u32), dimensions: &[u64], bytes: &[u8]) -> Vec<u8> {
    padded([head(name, types, dimensions, bytes.len() as u64), bytes.to_vec()].concat())
}

/// All of a variable that comes before its values, of which there will be so many bytes.
fn head(name: &str, (class, kind): (u32, u32), dimensions: &[u64], bytes: u64) -> Vec<u8> {
    let words = |words: &[u32]| words.iter().flat_map(|word| word.to_le_bytes()).collect::<Vec<u8>>();
    let dimensions: Vec<u32> = dimensions.iter().map(|&n| n as u32).collect(); // there are fewer bytes than 2^31
    let inner = [
        element(kind::UINT32, &words(&[class, 0])),
        element(kind::INT32, &words(&dimensions)),
        element(kind::INT8, name.as_bytes()),
        words(&[kind, bytes as u32]),
    ]
    .concat();
    let total = inner.len() as u64 + bytes.next_multiple_of(8);
    [words(&[kind::MATRIX, total as u32]), inner].concat()
}

/// A small element. Up to four bytes stand in its tag.
fn element(kind: u32, bytes: &[u8]) -> Vec<u8> {
    let size = bytes.len() as u32;
    let tag = match size {
        1..=4 => (size << 16 | kind).to_le_bytes().to_vec(),
        _ => [kind.to_le_bytes(), size.to_le_bytes()].concat(),
    };
    padded([tag, bytes.to_vec()].concat())
}

fn padded(mut bytes: Vec<u8>) -> Vec<u8> {
    bytes.resize(bytes.len().next_multiple_of(8), 0);
    bytes
}

/// JSON with what is not ASCII escaped, so that a letter is a byte for every reader.
fn ascii(json: &str) -> String {
    let mut text = String::with_capacity(json.len());
    for letter in json.chars() {
        match letter.is_ascii() {
            true => text.push(letter),
            false => {
                let mut units = [0; 2];
                letter.encode_utf16(&mut units).iter().for_each(|unit| text += &format!("\\u{unit:04x}"));
            }
        }
    }
    text
}
