//! Text: a header, then a line a draw, each value the shortest decimal that reads back as the same number. The columns
//! of spectra are headed by their wavelengths in nm.

use std::io::{self, Write};

use super::Encoder;
use super::schema::{Element, Field, Schema};

pub(super) struct Csv<W: Write> {
    writer: ::csv::Writer<W>,
    schema: Schema,
}

impl<W: Write> Csv<W> {
    pub(super) fn begin(to: W, schema: &Schema) -> io::Result<Self> {
        let mut writer = ::csv::Writer::from_writer(to);
        let names = schema.fields.iter().flat_map(|field| names(field, &schema.wavelengths));
        writer.write_record(names).map_err(io_error)?;
        Ok(Csv { writer, schema: schema.clone() })
    }
}

impl<W: Write> Encoder for Csv<W> {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        for row in 0..self.schema.rows(columns) {
            for (field, column) in self.schema.fields.iter().zip(columns) {
                let size = field.delivered_bytes();
                for value in field.values(&column[row * size..(row + 1) * size]) {
                    self.writer.write_field(text(field.stored, value)).map_err(io_error)?;
                }
            }
            self.writer.write_record(None::<&[u8]>).map_err(io_error)?;
        }
        self.writer.flush()
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.writer.flush()
    }
}

/// The headings of a field's columns.
fn names(field: &Field, wavelengths: &[f64]) -> Vec<String> {
    match field.axis.as_deref() {
        Some("wavelength") => wavelengths.iter().map(f64::to_string).collect(),
        Some(_) => (1..=field.width).map(|i| format!("{}_{i}", field.name)).collect(),
        None => vec![field.name.clone()],
    }
}

/// The shortest decimal that reads back as the same value of its type.
fn text(element: Element, value: f64) -> String {
    match element {
        Element::F64 | Element::U32 => value.to_string(),
        Element::F32 => (value as f32).to_string(),
        // Its own shortest form would be ambiguous to those who read it as anything else.
        Element::F16 => half::f16::from_f64(value).to_f32().to_string(),
    }
}

/// The crate's own conversion would hide what kind of error it was.
fn io_error(error: ::csv::Error) -> io::Error {
    match error.into_kind() {
        ::csv::ErrorKind::Io(error) => error,
        other => io::Error::other(format!("{other:?}")),
    }
}
