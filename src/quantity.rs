//! What comes out of a draw, and how it lies in memory.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Something that a draw can give. Each is an array of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The spectrum: a value for each band, after scaling where there is a target or an intensity.
    Spectra,
    /// The weights of the model's components, k values, of the spectrum before scaling.
    Weights,
    /// CIE 1931 tristimulus values, 3: of a reflectance under an illuminant, where a perfect white has Y = 1; of an
    /// illuminant its own.
    Xyz,
    /// The same as linear Rec. 709 components, 3 (IEC 61966-2-1), unclamped.
    LinearSrgb,
    /// The luminous reflectance value of a reflectance under D65; the target where there is one.
    Lrv,
    /// A [`DrawStatus`](crate::DrawStatus): how many candidates the draw took.
    Attempts,
    /// What an illuminant was multiplied by.
    Intensity,
    /// CIE 1931 chromaticity x and y, of the tristimulus values, whatever their scale.
    Chromaticity,
}

impl Quantity {
    /// Every quantity.
    pub const ALL: &[Quantity] = &[
        Quantity::Spectra,
        Quantity::Weights,
        Quantity::Xyz,
        Quantity::LinearSrgb,
        Quantity::Lrv,
        Quantity::Attempts,
        Quantity::Intensity,
        Quantity::Chromaticity,
    ];

    /// Those that tristimulus values give.
    pub(crate) const COLOURS: &[Quantity] = &[Quantity::Xyz, Quantity::LinearSrgb, Quantity::Chromaticity];

    /// How many there are.
    pub(crate) const COUNT: usize = Quantity::ALL.len();

    /// The name of the axis that its values run over within a draw, in files; `None` where a draw has one value.
    pub fn axis(self) -> Option<&'static str> {
        match self {
            Quantity::Spectra => Some("wavelength"),
            Quantity::Weights => Some("component"),
            Quantity::Xyz | Quantity::LinearSrgb | Quantity::Chromaticity => Some("channel"),
            Quantity::Lrv | Quantity::Attempts | Quantity::Intensity => None,
        }
    }

    /// The names of its values, where each has one of its own.
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Quantity::Xyz => &["X", "Y", "Z"],
            Quantity::LinearSrgb => &["R", "G", "B"],
            Quantity::Chromaticity => &["x", "y"],
            _ => &[],
        }
    }

    /// Its name, as shaders, files and the command line have it.
    pub fn name(self) -> &'static str {
        match self {
            Quantity::Spectra => "spectra",
            Quantity::Weights => "weights",
            Quantity::Xyz => "xyz",
            Quantity::LinearSrgb => "linear_srgb",
            Quantity::Lrv => "lrv",
            Quantity::Attempts => "attempts",
            Quantity::Intensity => "intensity",
            Quantity::Chromaticity => "chromaticity",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// How the values of quantities that have several a draw are ordered.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// (draw, value): draw by draw, without padding.
    #[default]
    Rows,
    /// The same, with zeros up to a multiple of 4 values a draw, for shaders that read `vec4`s.
    PaddedRows,
    /// (value, draw): a plane for each value, which has a multiple of 4 draws; those beyond the last mean nothing.
    Planes,
}

/// What the values of spectra are between. 16 bits could round them to an end: they are rounded to the nearest that is
/// none.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ValueRange {
    /// Above 0.
    Positive,
    /// Above 0 and below 1.
    Unit,
}

impl ValueRange {
    /// The least half-precision number in it, and the largest; infinity where there is none.
    pub(crate) fn halves(self) -> [f32; 2] {
        match self {
            ValueRange::Positive => [2f32.powi(-24), f32::INFINITY],
            ValueRange::Unit => [2f32.powi(-24), 1.0 - 2f32.powi(-11)],
        }
    }
}

/// The type of a value.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Dtype {
    /// IEEE half precision: 11 significant bits, nothing above 65,504. Two make a word of a shader, the first its low
    /// half.
    #[serde(rename = "float16")]
    #[cfg_attr(feature = "cli", value(name = "f16"))]
    F16,
    /// IEEE single precision.
    #[default]
    #[serde(rename = "float32")]
    #[cfg_attr(feature = "cli", value(name = "f32"))]
    F32,
    /// IEEE double precision: of files, not of draws.
    #[serde(rename = "float64")]
    #[cfg_attr(feature = "cli", value(name = "f64"))]
    F64,
    /// An unsigned integer of 32 bits.
    #[serde(rename = "uint32")]
    #[cfg_attr(feature = "cli", value(skip))]
    U32,
}

impl Dtype {
    /// Its size in bytes.
    pub fn size(self) -> usize {
        match self {
            Dtype::F16 => 2,
            Dtype::F32 | Dtype::U32 => 4,
            Dtype::F64 => 8,
        }
    }

    /// What NumPy, Zarr and xarray call it.
    pub fn name(self) -> &'static str {
        match self {
            Dtype::F16 => "float16",
            Dtype::F32 => "float32",
            Dtype::F64 => "float64",
            Dtype::U32 => "uint32",
        }
    }
}

/// How a quantity lies in its array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrayFormat {
    /// What it is.
    pub quantity: Quantity,
    /// The type of its values.
    pub dtype: Dtype,
    /// How many a draw has, without padding.
    pub width: usize,
    /// How they are ordered.
    pub layout: Layout,
}

impl ArrayFormat {
    /// That of spectra unless asked otherwise.
    pub(crate) fn spectra(bands: usize) -> ArrayFormat {
        ArrayFormat { quantity: Quantity::Spectra, dtype: Dtype::F32, width: bands, layout: Layout::Rows }
    }

    /// That of tallies.
    pub(crate) fn status() -> ArrayFormat {
        ArrayFormat { quantity: Quantity::Attempts, dtype: Dtype::U32, width: 1, layout: Layout::Rows }
    }

    /// How many values there are from the start of one row to the start of the next. 1 in planes.
    pub fn stride(&self) -> usize {
        match self.layout {
            Layout::Rows => self.width,
            Layout::PaddedRows => self.width.next_multiple_of(4),
            Layout::Planes => 1,
        }
    }

    /// How many planes there are; 1 in rows.
    pub fn planes(&self) -> usize {
        if self.layout == Layout::Planes { self.width } else { 1 }
    }

    /// How many values the array of `draws` draws has, padding and all.
    pub fn values(&self, draws: u64) -> u64 {
        match self.layout {
            Layout::Rows | Layout::PaddedRows => draws * self.stride() as u64,
            Layout::Planes => draws.next_multiple_of(4) * self.width as u64,
        }
    }

    /// How many bytes the array of `draws` draws has.
    pub fn bytes(&self, draws: u64) -> u64 {
        self.values(draws) * self.dtype.size() as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes() {
        let format = |layout, dtype| ArrayFormat { quantity: Quantity::Spectra, dtype, width: 31, layout };
        assert_eq!(format(Layout::Rows, Dtype::F32).bytes(5), 4 * 31 * 5);
        assert_eq!(format(Layout::PaddedRows, Dtype::F32).bytes(5), 4 * 32 * 5);
        assert_eq!(format(Layout::Planes, Dtype::F16).bytes(5), 2 * 31 * 8);
    }
}
