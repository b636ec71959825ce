//! Colours as people write them, and the responses that they are.

use nalgebra::{Matrix3, Vector3};
use serde::{Deserialize, Serialize};

use crate::colorimetry::{Illuminant, Observer, linear_srgb_to_xyz};
use crate::grid::Grid;

/// Space that colours are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ColourSpace {
    /// Tristimulus values of the observer under the illuminant, a perfect white having Y = 1.
    Xyz,
    /// Encoded sRGB (IEC 61966-2-1), 0 to 1.
    Srgb,
    /// Linear sRGB, 0 to 1.
    LinearSrgb,
    /// CIELAB, with L from 0 to 100, relative to the perfect white.
    Lab,
    /// Responses of the sensors themselves, 1 for a perfect white.
    Responses,
}

/// Conversion of colours into responses relative to white, of an observer under an illuminant.
///
/// sRGB is defined under D65 and for the observer of 1931. Under another illuminant, or for another observer, its colours
/// are adapted to that white (Bradford), as a photograph is that is looked at in another light.
#[derive(Clone, Debug)]
pub struct ColourConversion {
    space: ColourSpace,
    white: [f64; 3],
    /// From XYZ relative to D65 to XYZ relative to this white, where it is another.
    adaptation: Option<Matrix3<f64>>,
}

/// Cone-like responses of the Bradford transform (Lam 1985), a row each.
#[rustfmt::skip]
const BRADFORD: [[f64; 3]; 3] = [
    [ 0.8951,  0.2664, -0.1614],
    [-0.7502,  1.7135,  0.0367],
    [ 0.0389, -0.0685,  1.0296],
];

impl ColourSpace {
    /// Every space, with its name in commands.
    pub const NAMED: [(&str, ColourSpace); 5] = [
        ("xyz", ColourSpace::Xyz),
        ("srgb", ColourSpace::Srgb),
        ("linear-srgb", ColourSpace::LinearSrgb),
        ("lab", ColourSpace::Lab),
        ("responses", ColourSpace::Responses),
    ];
}

impl ColourConversion {
    /// Makes the conversion for responses of an observer under an illuminant, on a grid; `None` where none of its light is
    /// visible there. Responses themselves need none.
    pub fn new(
        space: ColourSpace,
        observer: Observer,
        illuminant: &Illuminant,
        grid: &Grid,
    ) -> Option<ColourConversion> {
        let weights = observer.xyz_weights_under(&illuminant.power(grid), grid)?;
        let white = weights.map(|weights| weights.iter().sum());
        let is_srgb = matches!(space, ColourSpace::Srgb | ColourSpace::LinearSrgb);
        let is_own = *illuminant == Illuminant::D65 && observer == Observer::Cie1931;
        let adaptation = (is_srgb && !is_own).then(|| bradford(linear_srgb_to_xyz([1.0; 3]), white));
        Some(ColourConversion { space, white, adaptation })
    }

    /// The responses of a colour, each relative to that of a perfect white.
    pub fn responses(&self, colour: [f64; 3]) -> [f64; 3] {
        let xyz = match self.space {
            ColourSpace::Responses => return colour,
            ColourSpace::Xyz => colour,
            ColourSpace::Srgb => linear_srgb_to_xyz(colour.map(decoded)),
            ColourSpace::LinearSrgb => linear_srgb_to_xyz(colour),
            ColourSpace::Lab => self.xyz_of_lab(colour),
        };
        let adapted = match &self.adaptation {
            Some(adaptation) => (adaptation * Vector3::from(xyz)).into(),
            None => xyz,
        };
        [0, 1, 2].map(|i| adapted[i] / self.white[i])
    }

    /// CIE 15:2004, section 8.2.1.
    fn xyz_of_lab(&self, [l, a, b]: [f64; 3]) -> [f64; 3] {
        let y = (l + 16.0) / 116.0;
        let cube = |f: f64| match f > 6.0 / 29.0 {
            true => f.powi(3),
            false => (f - 4.0 / 29.0) * 108.0 / 841.0,
        };
        let relative = [y + a / 500.0, y, y - b / 200.0].map(cube);
        [0, 1, 2].map(|i| relative[i] * self.white[i])
    }
}

/// Linear component of an encoded one (IEC 61966-2-1).
fn decoded(value: f64) -> f64 {
    match value <= 0.04045 {
        true => value / 12.92,
        false => ((value + 0.055) / 1.055).powf(2.4),
    }
}

fn bradford(from: [f64; 3], to: [f64; 3]) -> Matrix3<f64> {
    let cones = Matrix3::from_fn(|row, column| BRADFORD[row][column]);
    let (from, to) = (cones * Vector3::from(from), cones * Vector3::from(to));
    let scale = Matrix3::from_diagonal(&to.component_div(&from));
    cones.try_inverse().expect("the matrix has an inverse") * scale * cones
}

#[cfg(test)]
mod tests {
    use super::*;

    fn conversion(space: ColourSpace, illuminant: Illuminant) -> ColourConversion {
        ColourConversion::new(space, Observer::Cie1931, &illuminant, &Grid::DEFAULT).unwrap()
    }

    fn close(a: [f64; 3], b: [f64; 3], error: f64) {
        assert!(a.iter().zip(b).all(|(a, b)| (a - b).abs() < error), "{a:?} {b:?}");
    }

    #[test]
    fn white_is_white_in_every_space() {
        for illuminant in [Illuminant::D65, Illuminant::A, Illuminant::F11] {
            close(
                conversion(ColourSpace::Lab, illuminant.clone()).responses([100.0, 0.0, 0.0]),
                [1.0; 3],
                1e-14,
            );
            // The matrix of sRGB has another white than D65 on this grid, by a part in ten thousand.
            for space in [ColourSpace::Srgb, ColourSpace::LinearSrgb] {
                close(conversion(space, illuminant.clone()).responses([1.0; 3]), [1.0; 3], 2e-3);
            }
        }
    }

    /// Values of colour-science 0.4.7 for sRGB (0.5, 0.25, 0.75) and for CIELAB (50, 20, -30), to six digits.
    #[test]
    fn colours_are_those_of_their_definitions() {
        let d65 = conversion(ColourSpace::Srgb, Illuminant::D65);
        let xyz = [0, 1, 2].map(|i| d65.responses([0.5, 0.25, 0.75])[i] * d65.white[i]);
        close(xyz, [0.200779, 0.119618, 0.506852], 1e-6);
        let lab = conversion(ColourSpace::Lab, Illuminant::D65);
        let relative = lab.responses([50.0, 20.0, -30.0]);
        close(relative, [0.225828, 0.184187, 0.371641], 1e-6);
        let dark = lab.responses([1.0, 0.0, 0.0]);
        close(dark, [1.0 / 903.3; 3], 1e-6);
        assert_eq!(
            conversion(ColourSpace::Responses, Illuminant::A).responses([0.1, 0.2, 0.3]),
            [0.1, 0.2, 0.3]
        );
    }
}
