//! Colorimetry of the CIE on a grid: the only home of the standard observers, of illuminants, and of the weights that turn
//! a reflectance into its tristimulus values and its luminous reflectance (LRV). Functions that name no observer are of
//! the CIE 1931 2 degree observer.

mod illuminant;
mod observer;

pub use illuminant::{Illuminant, IlluminantError};
pub use observer::Observer;

use nalgebra::{Matrix3, Vector3};

use crate::dataset::BuiltinTable;
use crate::grid::{Extrapolation, Grid, Spline};

/// The CIE standard illuminant D65 on a grid (relative power, 100 at 560 nm); zero outside 380 to 780 nm.
pub fn d65(grid: &Grid) -> Vec<f64> {
    on_grid(BuiltinTable::D65, 0, grid)
}

/// The CIE 1931 2 degree observer's colour matching functions x, y and z on a grid; zero outside 360 to 830 nm.
pub fn cmf(grid: &Grid) -> [Vec<f64>; 3] {
    Observer::Cie1931.cmf(grid)
}

/// The CIE standard illuminant A on a grid (relative power, 100 at 560 nm): a black body of 2848 K in the temperature
/// scale of 1931 (CIE 15:2004, eq. 3.1).
pub fn illuminant_a(grid: &Grid) -> Vec<f64> {
    let planck = |nm: f64| nm.powi(-5) / (1.435e7 / (2848.0 * nm)).exp_m1();
    grid.wavelengths().map(|w| 100.0 * planck(w) / planck(560.0)).collect()
}

fn on_grid(table: BuiltinTable, spectrum: usize, grid: &Grid) -> Vec<f64> {
    let table = table.table();
    let spline = Spline::new(table.wavelengths(), table.spectrum(spectrum));
    grid.wavelengths().map(|w| spline.at(w, Extrapolation::Zero)).collect()
}

/// Weights of X, Y and Z for the power of a light in each band: [`Observer::emitted_xyz_weights`] of 1931.
pub fn emitted_xyz_weights(grid: &Grid) -> [Vec<f64>; 3] {
    Observer::Cie1931.emitted_xyz_weights(grid)
}

/// Weights of X, Y and Z for reflectances under D65 (1931 2 degree observer): tristimulus values are their products
/// with a reflectance, and a perfect white has Y = 1. `None` where the grid has no visible light.
pub fn xyz_weights(grid: &Grid) -> Option<[Vec<f64>; 3]> {
    xyz_weights_under(&d65(grid), grid)
}

/// Weights of X, Y and Z for reflectances under `light`: [`Observer::xyz_weights_under`] of 1931.
pub fn xyz_weights_under(light: &[f64], grid: &Grid) -> Option<[Vec<f64>; 3]> {
    Observer::Cie1931.xyz_weights_under(light, grid)
}

/// Weights of the luminous reflectance, LRV(r) = sum r D65 y / sum D65 y: CIE Y of the 1931 2 degree observer under
/// D65. They sum to 1, so a perfect white has LRV 1. `None` where the grid has no visible light. On an uneven grid the
/// sums are integrals by the trapezoid rule, as all that is weighted here.
pub fn lrv_weights(grid: &Grid) -> Option<Vec<f64>> {
    xyz_weights(grid).map(|[_, y, _]| y)
}

/// Matrix from XYZ relative to D65 white to linear Rec. 709 components, a row each (IEC 61966-2-1).
#[rustfmt::skip]
pub const XYZ_TO_SRGB: [[f64; 3]; 3] = [
    [ 3.2406255, -1.537208,  -0.4986286],
    [-0.9689307,  1.8757561,  0.0415175],
    [ 0.0557101, -0.2040211,  1.0569959],
];

/// Linear Rec. 709 components of XYZ relative to D65 white, unclamped: negative or above 1 outside the gamut.
pub fn linear_srgb(xyz: [f64; 3]) -> [f64; 3] {
    XYZ_TO_SRGB.map(|row| row.iter().zip(xyz).map(|(m, v)| m * v).sum())
}

/// XYZ relative to D65 white from linear Rec. 709 components: the inverse of [`linear_srgb`], to rounding.
pub fn linear_srgb_to_xyz(linear: [f64; 3]) -> [f64; 3] {
    let inverse = Matrix3::from_fn(|row, column| XYZ_TO_SRGB[row][column]).try_inverse();
    (inverse.expect("the matrix has an inverse") * Vector3::from(linear)).into()
}

/// 8-bit sRGB from linear components (IEC 61966-2-1), which are clamped to 0..1.
///
/// ```
/// use spectroll::colorimetry::encode_srgb;
///
/// assert_eq!(encode_srgb([0.001, 0.21586, 0.5]), [3, 128, 188]);
/// assert_eq!(encode_srgb([-1.0, 0.0, 2.0]), [0, 0, 255]);
/// ```
pub fn encode_srgb(linear: [f64; 3]) -> [u8; 3] {
    linear.map(|v| {
        let v = v.clamp(0.0, 1.0);
        let encoded = if v <= 0.0031308 { 12.92 * v } else { 1.055 * v.powf(1.0 / 2.4) - 0.055 };
        (encoded * 255.0).round() as u8
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_perfect_white_has_lrv_1_and_the_chromaticity_of_d65() {
        for grid in ["400:10:700", "400:5:700", "380:1:780"] {
            let grid = &grid.parse().unwrap();
            let [x, y, z] = xyz_weights(grid).unwrap().map(|w| w.iter().sum::<f64>());
            assert!((y - 1.0).abs() < 1e-14);
            let (cx, cy) = (x / (x + y + z), y / (x + y + z));
            assert!((cx - 0.3127).abs() < 5e-4 && (cy - 0.3290).abs() < 5e-4, "{grid}: {cx} {cy}");
            assert_eq!(encode_srgb(linear_srgb([0.9505, 1.0, 1.089])), [255; 3]);
        }
    }

    /// IEC 61966-2-1: 12.92 times what is dark, and mid-grey.
    #[test]
    fn encoded_colours_are_those_of_the_standard() {
        assert_eq!(encode_srgb([0.003, 0.5, 0.2]), [10, 188, 124]);
        assert_eq!(encode_srgb([-0.1, 1.5, 0.0031308]), [0, 255, 10]);
    }

    /// CIE 15:2004, tables T.1 and T.4.
    #[test]
    fn observer_and_illuminants_have_their_published_numbers() {
        let close = |found: &[f64], published: &[f64], error: f64| {
            assert_eq!(found.len(), published.len());
            for (a, b) in found.iter().zip(published) {
                assert!((a - b).abs() <= error * b.abs(), "{found:?} {published:?}");
            }
        };
        let grid = &"400:50:700".parse().unwrap();
        let [x, y, z] = cmf(grid);
        close(&x, &[0.01431, 0.3362, 0.0049, 0.4334499, 1.0622, 0.2835, 0.011359], 2e-3);
        close(&y, &[0.000396, 0.038, 0.323, 0.9949501, 0.631, 0.107, 0.004102], 2e-3);
        close(&z[..5], &[0.06785001, 1.77211, 0.272, 0.008749999, 0.0008], 2e-3);
        close(&d65(grid), &[82.7549, 117.008, 109.354, 104.046, 90.0062, 80.0268, 71.6091], 1e-4);
        close(&illuminant_a(grid), &[14.708, 33.0859, 59.8611, 92.912, 129.043, 165.028, 198.261], 1e-5);
        let fine: &Grid = &"380:1:780".parse().unwrap();
        let chromaticity = |light: &[f64]| {
            let [x, y, z] = cmf(fine).map(|f| f.iter().zip(light).map(|(f, e)| f * e).sum::<f64>());
            [x / (x + y + z), y / (x + y + z)]
        };
        close(&chromaticity(&d65(fine)), &[0.31272, 0.32903], 5e-5);
        close(&chromaticity(&illuminant_a(fine)), &[0.44758, 0.40745], 5e-5);
        close(&chromaticity(&[1.0; 401]), &[0.33331, 0.33329], 5e-4);
        // The luminances of the primaries of Rec. 709.
        let luminance = |linear| linear_srgb_to_xyz(linear)[1];
        let primaries = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]].map(luminance);
        close(&primaries, &[0.2126, 0.7152, 0.0722], 1e-3);
    }

    #[test]
    fn components_and_tristimulus_values_are_inverses() {
        let linear = [0.2, 0.7, 0.4];
        let back = linear_srgb(linear_srgb_to_xyz(linear));
        assert!(back.iter().zip(linear).all(|(a, b)| (a - b).abs() < 1e-14));
    }

    #[test]
    fn a_grid_in_the_infrared_has_no_luminance() {
        assert_eq!(lrv_weights(&"900:10:1000".parse().unwrap()), None);
    }
}
