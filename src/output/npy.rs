//! NumPy's `.npy`: one array, C order. The `npyz` crate writes the header; the bytes of the draws follow unchanged.

use std::io::{self, Write};

use npyz::WriterBuilder;

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
        to.write_all(&header(type_string(field.stored), &field.shape(schema.count))?)?;
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
pub(super) fn file(dtype: &str, shape: &[u64], data: &[u8]) -> io::Result<Vec<u8>> {
    let header = header(dtype, shape)?;
    Ok([&header, data].concat())
}

/// Bytes before the data of an array.
pub(super) fn header(dtype: &str, shape: &[u64]) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    let dtype = npyz::DType::Plain(dtype.parse().expect("it is one of NumPy's types"));
    let options = npyz::WriteOptions::new_header_only();
    options.dtype(dtype).shape(shape).writer(&mut bytes).write_header_only()?;
    Ok(bytes)
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
