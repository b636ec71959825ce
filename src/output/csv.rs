//! Text: a header, then a line per draw, each value the shortest decimal that reads back as the same number. The
//! columns of spectra are headed by their wavelengths in nm. Nothing in it ever needs quotes.

use std::fmt::Write as _;
use std::io::{self, Write};

use super::Encoder;
use super::schema::{Field, Schema};
use crate::quantity::Dtype;

pub(super) struct Csv<W: Write> {
    to: W,
    schema: Schema,
    /// Lines of a window, in memory that the next window reuses.
    text: String,
}

impl<W: Write> Csv<W> {
    pub(super) fn begin(mut to: W, schema: &Schema) -> io::Result<Self> {
        let names: Vec<_> =
            schema.fields.iter().flat_map(|field| names(field, &schema.wavelengths)).collect();
        writeln!(to, "{}", names.join(","))?;
        to.flush()?;
        Ok(Csv { to, schema: schema.clone(), text: String::new() })
    }
}

impl<W: Write> Encoder for Csv<W> {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        self.text.clear();
        let rows = self.schema.rows(columns);
        let columns = self.schema.fields.iter().zip(columns).map(|(field, column)| field.store(column));
        let columns = columns.collect::<io::Result<Vec<_>>>()?;
        for row in 0..rows {
            for (field, column) in self.schema.fields.iter().zip(&columns) {
                let size = field.stored_bytes();
                for value in field.stored_values(&column[row * size..(row + 1) * size]) {
                    push(&mut self.text, field.stored, value);
                    self.text.push(',');
                }
            }
            self.text.pop();
            self.text.push('\n');
        }
        self.to.write_all(self.text.as_bytes())?;
        self.to.flush()
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.to.flush()
    }
}

/// Headings of a field's columns.
fn names(field: &Field, wavelengths: &[f64]) -> Vec<String> {
    if let Some((_, count)) = &field.outer {
        let one =
            Field { outer: field.middle.clone(), middle: None, width: field.width / count, ..field.clone() };
        let inner = names(&one, wavelengths);
        let heading = |i, inner: &String| match field.axis {
            Some(_) => {
                format!("{}_{i}_{}", field.name, inner.trim_start_matches(&format!("{}_", field.name)))
            }
            None => format!("{}_{i}", field.name),
        };
        return (0..*count).flat_map(|i| inner.iter().map(move |inner| heading(i, inner))).collect();
    }
    match field.axis.as_deref() {
        Some("wavelength") => wavelengths.iter().map(f64::to_string).collect(),
        Some(_) if field.channels.len() == field.width => field.channels.clone(),
        Some(_) => (0..field.width).map(|i| format!("{}_{i}", field.name)).collect(),
        None => vec![field.name.clone()],
    }
}

/// Appends the shortest decimal that reads back as the same value of its type.
fn push(text: &mut String, dtype: Dtype, value: f64) {
    match dtype {
        Dtype::F64 | Dtype::U32 => write!(text, "{value}"),
        // The shortest form of a half would be ambiguous to those who read it as anything else.
        Dtype::F32 | Dtype::F16 => write!(text, "{}", value as f32),
    }
    .expect("a string takes it all");
}
