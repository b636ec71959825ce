//! Metamers of one colour: random spectra that look alike under daylight, and part under other lights.

use spectroll::{
    ColourConversion, ColourSpace, Illuminant, Observer, Quantity, Recipe, RecipeError, Stream, colorimetry,
};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::drawing::Drawing;
use crate::fitted::Fitted;
use crate::refusal::Refusal;

/// Lights that metamers are shown under. They are of one colour under the first.
const LIGHTS: [(&str, Illuminant); 3] =
    [("D65", Illuminant::D65), ("A", Illuminant::A), ("F11", Illuminant::F11)];

/// Spectra of one colour, and their colours under some lights.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Metamers {
    spectra: Vec<f32>,
    colours: [Vec<u8>; 3],
    counts: Vec<f64>,
}

#[wasm_bindgen]
impl Metamers {
    /// Values of the spectra, one after the other.
    pub fn spectra(&self) -> Vec<f32> {
        self.spectra.clone()
    }

    /// Names of the lights.
    pub fn lights() -> String {
        LIGHTS.map(|(name, _)| name).join(",")
    }

    /// 8-bit sRGB of the spectra under a light, adapted to it, so that white stays white.
    pub fn colours(&self, light: usize) -> Vec<u8> {
        self.colours[light].clone()
    }

    /// Number of draws, and of the candidates they took.
    pub fn counts(&self) -> Vec<f64> {
        self.counts.clone()
    }
}

#[wasm_bindgen]
impl Fitted {
    /// Draws spectra of a colour that is given in encoded sRGB, 0 to 255. Where the model has none, the refusal has the
    /// nearest colour of which it has some.
    pub fn metamers(&self, rgb: &[u8], seed: u64, count: u32) -> Result<Metamers, Refusal> {
        let grid = self.model.grid();
        let encoded = [0, 1, 2].map(|i| f64::from(rgb[i]) / 255.0);
        let conversion = ColourConversion::new(ColourSpace::Srgb, Observer::Cie1931, &Illuminant::D65, grid)
            .ok_or_else(|| Refusal::new("these wavelengths have no light that the eye sees"))?;
        let white = white(&Illuminant::D65, self).expect("it has visible light").1;
        let responses = conversion.responses(encoded);
        let xyz = [0, 1, 2].map(|i| responses[i] * white[i]);
        let recipe =
            Recipe::builder(&self.model).xyz(xyz).quantities([Quantity::Spectra, Quantity::Attempts]);
        let drawing = Drawing::of(recipe.build()).map_err(Refusal::of_colour)?;
        let drawn = drawing.draw_range(Stream::new(seed).draws(0..count.into()))?;
        let spectra = drawn.values(Quantity::Spectra.name());
        let colours = LIGHTS.map(|(_, light)| self.colours_under(&light, &spectra));
        Ok(Metamers { spectra, colours, counts: drawn.counts() })
    }

    fn colours_under(&self, light: &Illuminant, spectra: &[f32]) -> Vec<u8> {
        let Some((weights, white)) = white(light, self) else { return Vec::new() };
        let screen = colorimetry::linear_srgb_to_xyz([1.0; 3]);
        let colour = |spectrum: &[f32]| {
            let xyz = [0, 1, 2].map(|i| {
                let sum: f64 = weights[i].iter().zip(spectrum).map(|(w, s)| w * f64::from(*s)).sum();
                sum / white[i] * screen[i]
            });
            colorimetry::encode_srgb(colorimetry::linear_srgb(xyz))
        };
        spectra.chunks_exact(self.model.bands()).flat_map(colour).collect()
    }
}

/// Weights of X, Y and Z under a light, and the values of a perfect white.
fn white(light: &Illuminant, fitted: &Fitted) -> Option<([Vec<f64>; 3], [f64; 3])> {
    let grid = fitted.model.grid();
    let weights = Observer::Cie1931.xyz_weights_under(&light.power(grid), grid)?;
    let white = weights.each_ref().map(|weights| weights.iter().sum());
    Some((weights, white))
}

/// The nearest colour that can be drawn, as `#rrggbb`; `None` of other errors.
pub(crate) fn nearest(error: &RecipeError) -> Option<String> {
    let RecipeError::UnreachableXyz { nearest: Some(xyz), .. } = error else { return None };
    let [r, g, b] = colorimetry::encode_srgb(colorimetry::linear_srgb(*xyz));
    Some(format!("#{r:02x}{g:02x}{b:02x}"))
}

#[cfg(test)]
mod tests {
    use crate::data::Data;

    #[test]
    fn metamers_look_alike_under_daylight_alone() {
        let fitted = Data::builtin("munsell-vrhel").unwrap().fit(r#"{"components":8}"#).unwrap();
        let metamers = fitted.metamers(&[120, 140, 90], 1, 20).unwrap();
        let spread = |light: usize| {
            let colours = metamers.colours(light);
            let channel = |c: usize| colours.iter().skip(c).step_by(3);
            (0..3).map(|c| channel(c).max().unwrap() - channel(c).min().unwrap()).max().unwrap()
        };
        assert!(spread(0) <= 1 && spread(2) > 3, "{} {} {}", spread(0), spread(1), spread(2));
        let first = &metamers.colours(0)[..3];
        assert!(first.iter().zip([120, 140, 90]).all(|(a, b)| a.abs_diff(b) <= 2), "{first:?}");
    }

    #[test]
    fn a_colour_that_no_surface_has_comes_with_the_nearest() {
        let fitted = Data::builtin("munsell-vrhel").unwrap().fit("{}").unwrap();
        let refusal = fitted.metamers(&[0, 255, 0], 1, 20).unwrap_err();
        assert_eq!(refusal.control, Some("colour"));
        assert!(refusal.nearest.is_some_and(|colour| colour.starts_with('#') && colour.len() == 7));
    }
}
