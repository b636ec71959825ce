//! NumPy's `.npy`: one array, C order: a header, after which the bytes of the draws follow unchanged.

use std::io::{self, Write};

use super::Encoder;
use super::schema::{Field, Schema};
use crate::quantity::Dtype;

pub(super) struct Npy<W> {
    to: W,
    field: Field,
}

impl<W: Write> Npy<W> {
    pub(super) fn begin(mut to: W, schema: &Schema) -> io::Result<Self> {
        let field = schema.only_field().clone();
        to.write_all(&header(type_string(field.stored), &field.shape(schema.count)))?;
        Ok(Npy { to, field })
    }
}

impl<W: Write> Encoder for Npy<W> {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        let [column] = columns else { unreachable!("the schema has one field") };
        self.to.write_all(&self.field.store(column)?)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.to.flush()
    }
}

/// The bytes of a whole small file.
pub(super) fn file(dtype: &str, shape: &[u64], data: &[u8]) -> Vec<u8> {
    [&header(dtype, shape), data].concat()
}

/// Bytes before the data of an array, a multiple of 64 (numpy.lib.format, version 1.0).
pub(super) fn header(dtype: &str, shape: &[u64]) -> Vec<u8> {
    let extents: String = shape.iter().map(|extent| format!("{extent}, ")).collect();
    let text = format!("{{'descr': '{dtype}', 'fortran_order': False, 'shape': ({extents}), }}");
    // Magic, version and length come before it, and a line feed ends it.
    let length = (10 + text.len() + 1).next_multiple_of(64) - 10;
    let size = u16::try_from(length).expect("few extents are short").to_le_bytes();
    [b"\x93NUMPY\x01\x00", &size[..], format!("{text:<0$}\n", length - 1).as_bytes()].concat()
}

/// Name of a type in NumPy's headers.
pub(super) fn type_string(dtype: Dtype) -> &'static str {
    match dtype {
        Dtype::F16 => "<f2",
        Dtype::F32 => "<f4",
        Dtype::F64 => "<f8",
        Dtype::U32 => "<u4",
    }
}
