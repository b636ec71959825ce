//! Colours for a screen, and the outline of the chromaticity diagram.

use spectroll::{Grid, SpectrumKind, Table, colorimetry};
use wasm_bindgen::prelude::wasm_bindgen;

/// 8-bit sRGB of linear components, three values a colour. Lights, whose brightness is arbitrary, are scaled so that the
/// largest component is 1; reflectances are taken as they are, a perfect white being 1.
#[wasm_bindgen(js_name = encodeColours)]
pub fn encode_colours(linear: &[f32], are_lights: bool) -> Vec<u8> {
    let encode = |rgb: &[f32]| encoded([0, 1, 2].map(|i| f64::from(rgb[i])), are_lights);
    linear.chunks_exact(3).flat_map(encode).collect()
}

fn encoded(linear: [f64; 3], is_light: bool) -> [u8; 3] {
    let largest = linear.iter().fold(0.0, |a: f64, v| a.max(*v));
    let scale = if is_light && largest > 0.0 { 1.0 / largest } else { 1.0 };
    colorimetry::encode_srgb(linear.map(|v| v * scale))
}

/// Chromaticities x and y of monochromatic lights from 400 to 700 nm by 5 nm, and last that of D65.
#[wasm_bindgen]
pub fn locus() -> Vec<f64> {
    let grid = Grid::new(400.0, 5.0, 61).expect("it is a grid");
    let [x, y, z] = colorimetry::cmf(&grid);
    let lines = (0..grid.len()).map(|i| [x[i], y[i], z[i]]);
    let d65 = colorimetry::d65(&grid);
    let white = [&x, &y, &z].map(|f| f.iter().zip(&d65).map(|(f, e)| f * e).sum::<f64>());
    lines.chain(std::iter::once(white)).flat_map(|xyz| chromaticity(xyz).map(f64::from)).collect()
}

/// Chromaticity of tristimulus values.
pub(crate) fn chromaticity([x, y, z]: [f64; 3]) -> [f32; 2] {
    let sum = x + y + z;
    [(x / sum) as f32, (y / sum) as f32]
}

/// Weights of X, Y and Z for spectra of a kind on a grid; `None` where it has no visible light.
pub(crate) fn xyz_weights(kind: Option<SpectrumKind>, grid: &Grid) -> Option<[Vec<f64>; 3]> {
    let reflected = colorimetry::xyz_weights(grid)?;
    Some(match kind {
        Some(SpectrumKind::Illuminant) => colorimetry::emitted_xyz_weights(grid),
        _ => reflected,
    })
}

/// Tristimulus values of a spectrum.
pub(crate) fn xyz(weights: &[Vec<f64>; 3], spectrum: &[f64]) -> [f64; 3] {
    [0, 1, 2].map(|i| weights[i].iter().zip(spectrum).map(|(w, s)| w * s).sum())
}

/// 8-bit sRGB of some spectra of a table; empty where they have no colour, as outside the visible or with gaps.
pub(crate) fn of_table(table: &Table, kind: Option<SpectrumKind>, indices: &[usize]) -> Vec<u8> {
    let Ok(grid) = Grid::from_wavelengths(table.wavelengths()) else { return Vec::new() };
    let Some(weights) = xyz_weights(kind, &grid) else { return Vec::new() };
    let is_light = kind == Some(SpectrumKind::Illuminant);
    let colour = |&index: &usize| {
        let linear = colorimetry::linear_srgb(xyz(&weights, table.spectrum(index)));
        encoded(linear.map(|v| if v.is_finite() { v } else { 0.5 }), is_light)
    };
    indices.iter().flat_map(colour).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lights_are_as_bright_as_can_be_and_surfaces_as_they_are() {
        assert_eq!(encode_colours(&[0.001, 0.21586, 0.5], false), [3, 128, 188]);
        assert_eq!(encode_colours(&[2.0, 4.0, -1.0], true), [188, 255, 0]);
        assert_eq!(encode_colours(&[0.0; 3], true), [0; 3]);
    }

    #[test]
    fn the_locus_ends_in_d65() {
        let locus = locus();
        assert_eq!(locus.len(), 2 * 62);
        assert!(
            (locus[122] - 0.3127).abs() < 1e-3 && (locus[123] - 0.329).abs() < 1e-3,
            "{:?}",
            &locus[122..]
        );
    }
}
