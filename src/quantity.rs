//! Quantities of a draw, and their layout in memory.

use std::fmt;

use serde::{Deserialize, Serialize};

/// Quantity that a draw can give, in an array of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum), value(rename_all = "snake_case"))]
#[serde(rename_all = "snake_case")]
pub enum Quantity {
    /// The spectrum: one value per band, after scaling where there is a target or an intensity.
    Spectra,
    /// The k weights of the model's components, for the spectrum before scaling.
    Weights,
    /// Tristimulus values X, Y, Z of the recipe's observer (CIE 1931, 2 degrees, unless asked otherwise): of a reflectance
    /// under an illuminant, where a perfect white has Y = 1; of an illuminant its own.
    Xyz,
    /// Linear Rec. 709 components R, G, B (IEC 61966-2-1) of the tristimulus values, unclamped: outside the gamut
    /// they are negative or above 1. The matrix is that of D65, and nothing is adapted to another white.
    LinearSrgb,
    /// The luminous reflectance (LRV) of a reflectance: CIE Y of the recipe's observer under its illuminant (1931, 2
    /// degrees, and D65 unless asked otherwise), 1 for a perfect white.
    Lrv,
    /// The [`DrawStatus`](crate::DrawStatus), which has the number of candidates that the draw took.
    Attempts,
    /// The factor that an illuminant was multiplied by.
    Intensity,
    /// Chromaticity x and y, of the tristimulus values, whatever their scale.
    Chromaticity,
    /// Responses of a set of sensors, one a channel: to a reflectance under an illuminant, or to an illuminant itself.
    Responses,
    /// The light that a surface sends to the eye, by band: its reflectance times each of the lights of its scene.
    #[cfg_attr(feature = "cli", value(skip))] // scenes alone have it
    ColorSignal,
}

impl Quantity {
    /// Every quantity but [`Responses`](Quantity::Responses), which take a set of sensors, and
    /// [`ColorSignal`](Quantity::ColorSignal), which takes the lights of a scene.
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

    /// The quantities that tristimulus values give.
    pub(crate) const COLOURS: &[Quantity] = &[Quantity::Xyz, Quantity::LinearSrgb, Quantity::Chromaticity];

    /// Number of quantities, those of sensors and scenes included.
    pub(crate) const COUNT: usize = Quantity::ColorSignal as usize + 1;

    /// Name of the axis of its values within a draw, in files; `None` where a draw has one value.
    pub fn axis(self) -> Option<&'static str> {
        match self {
            Quantity::Spectra | Quantity::ColorSignal => Some("wavelength"),
            Quantity::Responses => Some("sensor"),
            Quantity::Weights => Some("component"),
            Quantity::Xyz | Quantity::LinearSrgb | Quantity::Chromaticity => Some("channel"),
            Quantity::Lrv | Quantity::Attempts | Quantity::Intensity => None,
        }
    }

    /// Names of its values, where each has one of its own, whatever the recipe; those of responses are those of the
    /// sensors ([`Recipe::channels`](crate::Recipe::channels)).
    pub fn channels(self) -> &'static [&'static str] {
        match self {
            Quantity::Xyz => &["X", "Y", "Z"],
            Quantity::LinearSrgb => &["R", "G", "B"],
            Quantity::Chromaticity => &["x", "y"],
            _ => &[],
        }
    }

    /// Name in shaders, files and commands.
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
            Quantity::Responses => "responses",
            Quantity::ColorSignal => "color_signal",
        }
    }
}

impl fmt::Display for Quantity {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Order of the values of a quantity that has several per draw.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Layout {
    /// (draw, value): draw by draw, without padding.
    #[default]
    Rows,
    /// (draw, value), with zeros up to a multiple of 4 values a draw, for shaders that read `vec4`s.
    PaddedRows,
    /// (value, draw): a plane for each value, with room for a multiple of 4 draws; values beyond the last draw are
    /// undefined.
    Planes,
}

/// Range of values that a spectrum may take. Where 16 bits would round a value to an end of it, it is rounded to the
/// nearest number within.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ValueRange {
    /// Above 0.
    Positive,
    /// Above 0 and below 1.
    Unit,
}

impl ValueRange {
    /// The smallest half-precision number within the range, and the largest; infinity where there is none.
    pub(crate) fn halves(self) -> [f32; 2] {
        match self {
            ValueRange::Positive => [2f32.powi(-24), f32::INFINITY],
            ValueRange::Unit => [2f32.powi(-24), 1.0 - 2f32.powi(-11)],
        }
    }
}

/// Type of a value.
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
    /// IEEE double precision: in files only, never in draws.
    #[serde(rename = "float64")]
    #[cfg_attr(feature = "cli", value(name = "f64"))]
    F64,
    /// An unsigned integer of 32 bits.
    #[serde(rename = "uint32")]
    #[cfg_attr(feature = "cli", value(skip))]
    U32,
}

impl Dtype {
    /// Size in bytes.
    pub fn size(self) -> usize {
        match self {
            Dtype::F16 => 2,
            Dtype::F32 | Dtype::U32 => 4,
            Dtype::F64 => 8,
        }
    }

    /// Name in NumPy, Zarr and xarray.
    pub fn name(self) -> &'static str {
        match self {
            Dtype::F16 => "float16",
            Dtype::F32 => "float32",
            Dtype::F64 => "float64",
            Dtype::U32 => "uint32",
        }
    }
}

/// Layout of a quantity in its array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ArrayFormat {
    /// The quantity.
    pub quantity: Quantity,
    /// Type of its values.
    pub dtype: Dtype,
    /// Number of values per draw, without padding.
    pub width: usize,
    /// Order of the values.
    pub layout: Layout,
}

impl ArrayFormat {
    /// Format of spectra unless a recipe asks for another.
    pub(crate) fn spectra(bands: usize) -> ArrayFormat {
        ArrayFormat { quantity: Quantity::Spectra, dtype: Dtype::F32, width: bands, layout: Layout::Rows }
    }

    /// Format of statuses.
    pub(crate) fn status() -> ArrayFormat {
        ArrayFormat { quantity: Quantity::Attempts, dtype: Dtype::U32, width: 1, layout: Layout::Rows }
    }

    /// Number of values from the start of one row to the start of the next; 1 in planes.
    pub fn stride(&self) -> usize {
        match self.layout {
            Layout::Rows => self.width,
            Layout::PaddedRows => self.width.next_multiple_of(4),
            Layout::Planes => 1,
        }
    }

    /// Number of planes; 1 in rows.
    pub fn planes(&self) -> usize {
        if self.layout == Layout::Planes { self.width } else { 1 }
    }

    /// Number of values in the array of `draws` draws, with padding.
    pub fn values(&self, draws: u64) -> u64 {
        match self.layout {
            Layout::Rows | Layout::PaddedRows => draws * self.stride() as u64,
            Layout::Planes => draws.next_multiple_of(4) * self.width as u64,
        }
    }

    /// Number of bytes in the array of `draws` draws, with padding.
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
