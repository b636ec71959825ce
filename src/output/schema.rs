//! Schema of a data set: columns of numbers, a row per draw, whatever they mean.

use std::borrow::Cow;
use std::io;

use half::f16;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::dataset::SpectrumKind;
use crate::quantity::{Dtype, ValueRange};

/// Decodes one value as f64, which holds values of every type exactly.
fn read(dtype: Dtype, bytes: &[u8]) -> f64 {
    match dtype {
        Dtype::F16 => f16::from_le_bytes([bytes[0], bytes[1]]).to_f64(),
        Dtype::F32 => f32::from_le_bytes(bytes.try_into().expect("four bytes")).into(),
        Dtype::F64 => f64::from_le_bytes(bytes.try_into().expect("eight bytes")),
        Dtype::U32 => u32::from_le_bytes(bytes.try_into().expect("four bytes")).into(),
    }
}

/// Column of a data set: one quantity of every draw.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Field {
    /// Name, such as `spectra`.
    pub name: String,
    /// Name of the axis of its values, such as `wavelength`; `None` where a draw has one value, and the array one
    /// dimension.
    pub axis: Option<String>,
    /// Name and extent of the axis of rows within a draw, where it has several, such as the surfaces of a scene.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outer: Option<(String, usize)>,
    /// Name and extent of a second such axis, between that and the values, such as the surfaces under each of a scene's
    /// lights.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub middle: Option<(String, usize)>,
    /// Names of the values along `axis`, where each has one of its own, such as X, Y and Z.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub channels: Vec<String>,
    /// Number of values per draw, in all its rows.
    pub width: usize,
    /// Type of the values as delivered.
    #[serde(rename = "element")]
    pub dtype: Dtype,
    /// Type of the values as written.
    pub stored: Dtype,
    /// Range of the values, which rounding preserves; `None` where it is not known.
    #[serde(default, rename = "interval", skip_serializing_if = "Option::is_none")]
    pub range: Option<ValueRange>,
}

impl Field {
    /// Makes a field of `width` values per draw, along `axis`.
    pub fn vector(name: &str, axis: &str, width: usize, dtype: Dtype) -> Field {
        Field { width, axis: Some(axis.to_owned()), ..Field::scalar(name, dtype) }
    }

    /// Makes a field of one value per draw.
    pub fn scalar(name: &str, dtype: Dtype) -> Field {
        let name = name.to_owned();
        Field {
            name,
            axis: None,
            outer: None,
            middle: None,
            channels: Vec::new(),
            width: 1,
            dtype,
            stored: dtype,
            range: None,
        }
    }

    /// Returns the field with `count` rows per draw, along the axis `outer`; along a second one outside of the first, where
    /// it has rows already.
    pub fn repeated(self, outer: &str, count: usize) -> Field {
        let middle = self.outer.or(self.middle);
        Field { width: self.width * count, outer: Some((outer.to_owned(), count)), middle, ..self }
    }

    /// Returns the field written as the type `stored`, if its values are floats.
    pub fn stored_as(mut self, stored: Dtype) -> Field {
        if self.dtype != Dtype::U32 {
            self.stored = stored;
        }
        self
    }

    /// Returns the field with a name for each value along its axis.
    pub fn with_channels(self, names: &[impl AsRef<str>]) -> Field {
        Field { channels: names.iter().map(|name| name.as_ref().to_owned()).collect(), ..self }
    }

    /// Returns the field with values in a range.
    pub fn within(self, range: ValueRange) -> Field {
        Field { range: Some(range), ..self }
    }

    /// Size of one draw as delivered, in bytes.
    pub fn delivered_bytes(&self) -> usize {
        self.width * self.dtype.size()
    }

    /// Size of one draw as written, in bytes.
    pub fn stored_bytes(&self) -> usize {
        self.width * self.stored.size()
    }

    /// Shape of the array of `rows` draws.
    pub fn shape(&self, rows: u64) -> Vec<u64> {
        let outer = self.outer.iter().chain(&self.middle).map(|(_, count)| *count);
        let inner = self.axis.as_ref().map(|_| self.inner_width());
        std::iter::once(rows).chain(outer.chain(inner).map(|n| n as u64)).collect()
    }

    /// Names of the dimensions, the first of which is `row`.
    pub fn axes<'a>(&'a self, row: &'a str) -> Vec<&'a str> {
        let outer = self.outer.iter().chain(&self.middle).map(|(name, _)| name.as_str());
        std::iter::once(row).chain(outer).chain(self.axis.as_deref()).collect()
    }

    /// Whether a draw has a list of values, rather than one.
    pub(super) fn is_list(&self) -> bool {
        self.axis.is_some() || self.outer.is_some()
    }

    /// Converts delivered values to the type in which they are written. An error names the value that does not fit.
    pub(crate) fn store<'a>(&self, bytes: &'a [u8]) -> io::Result<Cow<'a, [u8]>> {
        if self.dtype == self.stored {
            return Ok(Cow::Borrowed(bytes));
        }
        let values = bytes.chunks_exact(self.dtype.size());
        let mut out = Vec::with_capacity(values.len() * self.stored.size());
        match (self.dtype, self.stored) {
            (from, Dtype::F16) => {
                for row in bytes.chunks_exact(self.inner_width() * self.dtype.size()) {
                    let values = || row.chunks_exact(self.dtype.size()).map(|v| read(from, v));
                    self.check_dim(values())?;
                    for value in values() {
                        out.extend_from_slice(&self.half(value)?.to_le_bytes());
                    }
                }
            }
            (from, Dtype::F32) => {
                values.for_each(|v| out.extend_from_slice(&(read(from, v) as f32).to_le_bytes()));
            }
            (from, Dtype::F64) => values.for_each(|v| out.extend_from_slice(&read(from, v).to_le_bytes())),
            (_, Dtype::U32) => unreachable!("no float is written as an integer"),
        }
        Ok(Cow::Owned(out))
    }

    /// Number of values of each of a draw's rows: of a spectrum, its bands.
    fn inner_width(&self) -> usize {
        let rows = self.outer.iter().chain(&self.middle).map(|(_, count)| (*count).max(1));
        self.width / rows.product::<usize>()
    }

    /// Refuses values, of one spectrum say, of which even the largest is below the normal range of half precision. A
    /// value that is small beside others of its spectrum is rounded there to 2^-25, or 1/2048 of a largest value that
    /// passes, as any number in half precision is to 1/2048 of itself; but where all are as small, all lose their digits.
    fn check_dim(&self, values: impl Iterator<Item = f64>) -> io::Result<()> {
        let largest = values.fold(0.0, |a: f64, value| a.max(value.abs()));
        if largest > 0.0 && largest < f16::MIN_POSITIVE.to_f64() {
            let what = format!(
                "{} of up to {largest:.1e} do not fit float16, which loses digits below 6.1e-5: use float32",
                self.name
            );
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(())
    }

    fn half(&self, value: f64) -> io::Result<f16> {
        let [least, largest] = self.range.map_or([f32::NEG_INFINITY, f32::INFINITY], ValueRange::halves);
        // By way of f32, in which values are drawn: without instructions for it, the crate's conversion from f64 drops low
        // bits before it rounds, and takes a value just above a tie for one.
        let half = f16::from_f32(value.clamp(least.into(), largest.into()) as f32);
        if half.is_infinite() && value.is_finite() {
            let (name, most) = (&self.name, f16::MAX);
            let what = format!("{name} of {value:e} do not fit float16, which ends at {most}: use float32");
            return Err(io::Error::new(io::ErrorKind::InvalidData, what));
        }
        Ok(half)
    }

    /// Decodes bytes that [`store`](Field::store) made.
    pub(super) fn stored_values<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = f64> + use<'a> {
        let dtype = self.stored;
        bytes.chunks_exact(dtype.size()).map(move |value| read(dtype, value))
    }

    /// Decodes delivered bytes.
    pub(super) fn values<'a>(&self, bytes: &'a [u8]) -> impl Iterator<Item = f64> + use<'a> {
        let dtype = self.dtype;
        bytes.chunks_exact(dtype.size()).map(move |value| read(dtype, value))
    }
}

/// An array that all draws share.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct SharedArray {
    /// Name.
    pub name: String,
    /// Dimensions: their names and extents.
    pub axes: Vec<(String, u64)>,
    /// Type of its values, as they are written.
    #[serde(rename = "element")]
    pub dtype: Dtype,
    /// Values in C order. A set of chunks has them in a file of their own.
    #[serde(skip)]
    pub bytes: Vec<u8>,
}

/// Compares descriptions and ignores values, which a manifest does not hold: those of one description are equal.
impl PartialEq for SharedArray {
    fn eq(&self, other: &SharedArray) -> bool {
        (&self.name, &self.axes, self.dtype) == (&other.name, &other.axes, other.dtype)
    }
}

impl SharedArray {
    /// Extents of its dimensions.
    pub(super) fn shape(&self) -> Vec<u64> {
        self.axes.iter().map(|(_, extent)| *extent).collect()
    }
}

/// An array of spectra in a data set, for formats whose names say what spectra are.
#[derive(Clone, Debug, PartialEq)]
pub struct SpectraArray {
    /// The name of the field or of the shared array.
    pub name: String,
    /// The group of a scene that they are of; `None` of draws.
    pub group: Option<String>,
    /// The kind of the spectra.
    pub kind: SpectrumKind,
    /// Their luminous reflectance.
    pub lrv: LrvLabel,
}

/// The luminous reflectance that an array of spectra was scaled to.
#[derive(Clone, Debug, PartialEq)]
pub enum LrvLabel {
    /// None.
    None,
    /// One luminous reflectance for all spectra.
    Same(f64),
    /// One for each spectrum, in the field of this name, where the data set has it.
    Field(String),
}

/// Schema of a data set.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Schema {
    /// Fields, in the order in which their columns are delivered.
    pub fields: Vec<Field>,
    /// Name of a row: `draw`, or `scene` where it is one.
    #[serde(default = "draw")]
    pub row: String,
    /// Arrays that all draws share.
    #[serde(default, rename = "constants", skip_serializing_if = "Vec::is_empty")]
    pub shared: Vec<SharedArray>,
    /// Number of draws.
    pub count: u64,
    /// Wavelengths of the axis `wavelength`, nm.
    pub wavelengths: Vec<f64>,
    /// Attributes for files that can hold them: the model, the recipe and the seed.
    pub attributes: Map<String, Value>,
}

fn draw() -> String {
    "draw".to_owned()
}

impl Schema {
    /// Size of one draw as written, in bytes.
    pub fn row_bytes(&self) -> u64 {
        self.fields.iter().map(|field| field.stored_bytes() as u64).sum()
    }

    /// Number of draws in a window of columns, which must agree.
    pub(super) fn rows(&self, columns: &[&[u8]]) -> usize {
        assert_eq!(columns.len(), self.fields.len(), "a column for each field");
        let mut rows = self.fields.iter().zip(columns).map(|(field, column)| {
            assert_eq!(column.len() % field.delivered_bytes(), 0, "{} has whole rows", field.name);
            column.len() / field.delivered_bytes()
        });
        let first = rows.next().unwrap_or(0);
        assert!(rows.all(|rows| rows == first), "the columns are equally long");
        first
    }

    /// The only field, for formats that hold one.
    pub(super) fn only_field(&self) -> &Field {
        let [field] = self.fields.as_slice() else {
            panic!("the format holds one field: see FileFormat::check")
        };
        field
    }

    /// Attributes as JSON text.
    pub(super) fn attributes_text(&self) -> String {
        serde_json::to_string(&self.attributes).expect("maps of JSON are JSON")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn values_are_written_as_asked() {
        let field = Field::vector("x", "wavelength", 2, Dtype::F32);
        let values = [0.1f32, 1.0, 65504.0, 1e-7];
        let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(matches!(field.store(&bytes), Ok(Cow::Borrowed(_))));
        let double = field.clone().stored_as(Dtype::F64);
        let expected: Vec<u8> = values.iter().flat_map(|&v| f64::from(v).to_le_bytes()).collect();
        assert_eq!(*double.store(&bytes).unwrap(), expected);
        let half = field.stored_as(Dtype::F16);
        let expected: Vec<u8> = values.iter().flat_map(|&v| f16::from_f32(v).to_le_bytes()).collect();
        assert_eq!(*half.store(&bytes).unwrap(), expected);
        assert_eq!(half.shape(5), [5, 2]);
        let twice = Field::vector("y", "sensor", 3, Dtype::F32).repeated("surface", 4).repeated("light", 2);
        assert_eq!((twice.shape(5), twice.width), (vec![5, 2, 4, 3], 24));
        assert_eq!(twice.axes("scene"), ["scene", "light", "surface", "sensor"]);
        let attempts = Field::scalar("attempts", Dtype::U32).stored_as(Dtype::F16);
        assert_eq!((attempts.stored, attempts.shape(5)), (Dtype::U32, vec![5]));
    }

    #[test]
    fn halves_hold_dim_bands_but_no_dim_spectra() {
        let bytes = |values: &[f32]| values.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let field = Field::vector("spectra", "wavelength", 2, Dtype::F32).repeated("number", 2);
        let field = field.stored_as(Dtype::F16).within(ValueRange::Positive);
        let error = |values: &[f32]| field.store(&bytes(values)).map_err(|e| e.to_string()).err();
        let least = f16::MIN_POSITIVE.to_f32();
        assert_eq!(error(&[1e-12, least, 1e-30, 1.0]), None);
        // A band that would be 0 is the smallest number above it.
        let drawn = bytes(&[1e-12, least, 0.5, 1.0]);
        let stored = field.store(&drawn).unwrap();
        let stored: Vec<f64> = field.stored_values(&stored).collect();
        assert_eq!(stored, [2f64.powi(-24), 2f64.powi(-14), 0.5, 1.0]);
        // One of a draw's rows is as much lost as all of them.
        let expected =
            "spectra of up to 6.1e-5 do not fit float16, which loses digits below 6.1e-5: use float32";
        assert_eq!(error(&[0.5, 0.5, 1e-5, f32::from_bits(least.to_bits() - 1)]).unwrap(), expected);
        assert!(error(&[1e-9, 1.2e-9, 0.5, 0.5]).unwrap().starts_with("spectra of up to 1.2e-9 do not fit"));
        // Nothing is lost of zeros.
        assert_eq!(error(&[0.0; 4]), None);
        assert!(error(&[1.0, 1.0, 1e5, 1.0]).unwrap().contains("ends at 65504"));
    }
}
