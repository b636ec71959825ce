//! Colours of spectra in pictures.

use spectroll::evaluation::plot::{self, Theme};
use spectroll::{Grid, SpectrumKind, colorimetry};

/// Conversion of a spectrum to a colour that shows on the ground of a theme.
pub(super) enum Colours {
    /// Weights of X, Y and Z that make white of a perfect reflector, and the luminance it is drawn with.
    Reflected([Vec<f64>; 3], f64),
    /// Weights of X, Y and Z, and the luminance of all lights, whatever their power.
    Emitted([Vec<f64>; 3], f64),
    /// The grid has no light that the eye sees; all have this colour.
    Unseen(&'static str),
}

impl Colours {
    pub(super) fn new(kind: SpectrumKind, grid: &Grid, theme: Theme) -> Colours {
        match (colorimetry::xyz_weights(grid), kind) {
            (None, _) => Colours::Unseen(theme.quiet()),
            (Some(weights), SpectrumKind::Reflectance) => {
                Colours::Reflected(weights, theme.white_luminance())
            }
            (Some(_), SpectrumKind::Illuminant) => {
                Colours::Emitted(colorimetry::emitted_xyz_weights(grid), theme.chromatic_luminance())
            }
        }
    }

    /// The colour of a spectrum, as `#rrggbb`.
    pub(super) fn of(&self, spectrum: &[f64]) -> String {
        let xyz = |weights: &[Vec<f64>; 3]| {
            [0, 1, 2].map(|i| weights[i].iter().zip(spectrum).map(|(w, s)| w * s).sum::<f64>())
        };
        match self {
            Colours::Reflected(weights, white) => {
                plot::exact_hex(colorimetry::linear_srgb(xyz(weights)).map(|v| white * v))
            }
            Colours::Emitted(weights, luminance) => plot::chromatic(xyz(weights), *luminance),
            Colours::Unseen(colour) => (*colour).to_owned(),
        }
    }

    /// Explains the colours.
    pub(super) fn note(&self) -> &'static str {
        match self {
            Colours::Reflected(_, 1.0) => "colours: under D65",
            Colours::Reflected(..) => "colours: under D65, darkened to show on white",
            Colours::Emitted(..) => "colours: of the light, at equal luminance",
            Colours::Unseen(_) => "outside the visible",
        }
    }
}
