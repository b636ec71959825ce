//! Recipes that can be drawn, and draws of the CPU.

use std::num::NonZeroUsize;

use spectroll::export::{Destination, DrawExport, Output};
use spectroll::output::FileFormat;
use spectroll::{
    DrawRange, DrawStatus, DrawSummary, Engine, EngineChoice, Model, Quantity, Recipe, RecipeError,
    RecipeSettings, ShaderVariant, SpectrumKind, Stream, XyzScale,
};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::export::Export;
use crate::kernel::Kernel;
use crate::refusal::Refusal;
use crate::settings::dtype;

/// A recipe that can be drawn.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Drawing {
    recipe: Recipe,
}

/// Draws of the CPU: an array for each quantity, and their counts.
#[wasm_bindgen]
#[derive(Debug)]
pub struct Drawn {
    arrays: Vec<(Quantity, Vec<u32>)>,
    summary: DrawSummary,
}

/// Name of the stream of trials, whose draws no data set holds.
pub(crate) const TRIAL: &str = "trial";

impl Drawing {
    pub(crate) fn new(
        model: &Model,
        mut settings: RecipeSettings,
        quantities: &str,
    ) -> Result<Drawing, Refusal> {
        if quantities.is_empty() {
            let mut all =
                vec![Quantity::Spectra, Quantity::LinearSrgb, Quantity::Attempts, Quantity::Chromaticity];
            if model.kind() == SpectrumKind::Illuminant {
                settings.xyz_scale = XyzScale::UnitY;
            } else {
                all.push(Quantity::Lrv);
            }
            settings.quantities = all;
            match settings.builder(model).build() {
                // A grid that the eye sees nothing of.
                Err(RecipeError::Invisible(_)) if settings.lrv.is_none() => {
                    settings.quantities = vec![Quantity::Spectra, Quantity::Attempts];
                    (settings.xyz_scale, settings.illuminant) = Default::default();
                }
                built => return Drawing::of(built),
            }
        } else {
            let asked: Result<Vec<_>, _> = quantities.split(',').map(quantity).collect();
            settings.quantities = asked?;
            settings.quantities.push(Quantity::Attempts);
        }
        Drawing::of(settings.builder(model).build())
    }

    pub(crate) fn of(built: Result<Recipe, RecipeError>) -> Result<Drawing, Refusal> {
        Ok(Drawing { recipe: built? })
    }

    pub(crate) fn draw_range(&self, draws: DrawRange) -> Result<Drawn, Refusal> {
        let formats = self.recipe.formats();
        let words =
            |format: &spectroll::ArrayFormat| vec![0u32; format.bytes(draws.count).div_ceil(4) as usize];
        let mut arrays: Vec<_> = formats.iter().map(|format| (format.quantity, words(format))).collect();
        let engine =
            Engine::with_threads(&EngineChoice::Cpu, Some(NonZeroUsize::MIN)).map_err(Refusal::new)?;
        let mut session = engine.session(&self.recipe).map_err(Refusal::new)?;
        let mut slices: Vec<_> =
            arrays.iter_mut().map(|(_, words)| bytemuck::cast_slice_mut::<u32, u8>(words)).collect();
        let summary = session.fill_arrays(draws, &mut slices).map_err(Refusal::new)?;
        Ok(Drawn { arrays, summary })
    }
}

/// A quantity by its name.
pub(crate) fn quantity(name: &str) -> Result<Quantity, Refusal> {
    let found = Quantity::ALL.iter().copied().find(|quantity| quantity.name() == name);
    found.ok_or_else(|| Refusal::new(format_args!("{name:?} is no quantity of a draw")))
}

#[wasm_bindgen]
impl Drawing {
    /// The share of candidates that are accepted, as a pilot run estimates it.
    pub fn acceptance(&self) -> f64 {
        self.recipe.acceptance()
    }

    /// Number of boxes that candidates come from; 0 where they come from the model's Gaussian.
    pub fn boxes(&self) -> usize {
        self.recipe.cover().map_or(0, |cover| cover.boxes)
    }

    /// Names of the quantities, with the number of values of each: `spectra 31,attempts 1`.
    pub fn formats(&self) -> String {
        let name = |format: spectroll::ArrayFormat| format!("{} {}", format.quantity, format.width);
        self.recipe.formats().into_iter().map(name).collect::<Vec<_>>().join(",")
    }

    /// Makes draws on the CPU.
    pub fn draw(&self, seed: u64, first: u64, count: u32) -> Result<Drawn, Refusal> {
        self.draw_range(DrawRange { stream: Stream::new(seed), first, count: count.into() })
    }

    /// Makes the draws on the CPU that a device is tried by.
    pub fn trial(&self, count: u32) -> Result<Drawn, Refusal> {
        self.draw_range(Stream::named(0, TRIAL).draws(0..count.into()))
    }

    /// Counts over statuses, as [`Drawn::counts`] has them. A draw that failed is an error.
    pub fn counts(&self, statuses: &[u32], first: u64) -> Result<Vec<f64>, Refusal> {
        let statuses: &[DrawStatus] = bytemuck::cast_slice(statuses);
        if let Some(failed) = statuses.iter().position(|status| status.attempts() == 0) {
            return Err(Refusal::new(format_args!(
                "draw {} found no acceptable candidate in {} attempts: ask for less extreme spectra",
                first.wrapping_add(failed as u64),
                self.recipe.settings().max_attempts
            )));
        }
        let attempts: f64 = statuses.iter().map(|status| f64::from(status.attempts())).sum();
        let above_one = statuses.iter().filter(|status| status.above_one()).count();
        Ok(vec![statuses.len() as f64, attempts, above_one as f64])
    }

    /// The compute shader of the recipe, in the plain or the exact form of arithmetic.
    pub fn kernel(&self, arithmetic: &str) -> Result<Kernel, Refusal> {
        let arithmetic = match arithmetic {
            "exact" => spectroll::Arithmetic::Exact,
            _ => spectroll::Arithmetic::Plain,
        };
        let variant = ShaderVariant { arithmetic, ..ShaderVariant::default() };
        Ok(Kernel::new(self.recipe.compute_shader(variant).map_err(Refusal::new)?))
    }

    /// WGSL functions for other people's shaders, as `spectroll shader` prints them.
    pub fn wgsl(&self) -> Result<String, Refusal> {
        self.recipe.wgsl("spectroll").map_err(Refusal::new)
    }

    /// Begins a file, `npy` or `csv`, of one quantity of draws.
    pub fn export(
        &self,
        format: &str,
        name: &str,
        of_type: &str,
        seed: u64,
        count: u32,
    ) -> Result<Export, Refusal> {
        let format = match format {
            "npy" => FileFormat::Npy,
            "csv" => FileFormat::Csv,
            _ => {
                return Err(Refusal::new(format_args!(
                    "{format:?} is no format of a download: npy and csv are"
                )));
            }
        };
        let draws = Stream::new(seed).draws(0..count.into());
        let output = Output::at("-", Destination::Stdout(format)).dtype(dtype(of_type)?);
        let mut schema = DrawExport::new(&self.recipe, draws).schema(&output);
        let quantity = quantity(name)?;
        schema.fields.retain(|field| field.name == quantity.name());
        Export::new(format, &schema)
    }
}

#[wasm_bindgen]
impl Drawn {
    /// Values of a quantity, draw by draw; empty where the recipe has none.
    pub fn values(&self, name: &str) -> Vec<f32> {
        let found = self.arrays.iter().find(|(quantity, _)| quantity.name() == name);
        found.map_or_else(Vec::new, |(_, words)| bytemuck::cast_slice(words).to_vec())
    }

    /// Words of a quantity, as a shader writes them.
    pub fn words(&self, name: &str) -> Vec<u32> {
        let found = self.arrays.iter().find(|(quantity, _)| quantity.name() == name);
        found.map_or_else(Vec::new, |(_, words)| words.clone())
    }

    /// Number of draws, of the candidates they took, and of draws that scaling took to 1 or above.
    pub fn counts(&self) -> Vec<f64> {
        let DrawSummary { draws, attempts, above_one } = self.summary;
        [draws, attempts, above_one].map(|n| n as f64).to_vec()
    }
}

#[cfg(test)]
mod tests {
    use crate::data::Data;
    use crate::fitted::Fitted;

    fn fitted(name: &str) -> Fitted {
        Data::builtin(name).unwrap().fit("{}").unwrap()
    }

    fn settings(lrv: &str, bounds: &str) -> String {
        format!(
            r#"{{"lrv":{lrv},"bounds":"{bounds}","cov_scale":1,"intensity":null,"quantities":["spectra"],"illuminant":"d65","xyz_scale":"absolute","proposal":"auto","max_attempts":65000}}"#
        )
    }

    #[test]
    fn draws_have_spectra_and_colours() {
        for (name, lrv, quantities) in [
            ("munsell-vrhel", "0.4", "spectra 31,linear_srgb 3,lrv 1,attempts 1,chromaticity 2"),
            ("granada", "null", "spectra 31,linear_srgb 3,attempts 1,chromaticity 2"),
        ] {
            let drawing = fitted(name).recipe(&settings(lrv, "base"), "").unwrap();
            assert_eq!(drawing.formats(), quantities);
            let drawn = drawing.draw(7, 0, 100).unwrap();
            assert_eq!(drawn.values("spectra").len(), 3100);
            assert_eq!(drawn.counts()[0], 100.0);
            assert_eq!(drawing.counts(&drawn.words("attempts"), 0).unwrap(), drawn.counts());
        }
    }

    #[test]
    fn a_draw_does_not_depend_on_what_else_is_asked() {
        let fitted = fitted("munsell-vrhel");
        let shown = fitted.recipe(&settings("null", "base"), "").unwrap().draw(1, 5, 64).unwrap();
        let alone = fitted.recipe(&settings("null", "base"), "spectra").unwrap().draw(1, 5, 64).unwrap();
        assert_eq!(shown.words("spectra"), alone.words("spectra"));
    }

    #[test]
    fn a_failed_draw_is_named() {
        let drawing = fitted("munsell-vrhel").recipe(&settings("null", "base"), "").unwrap();
        let refusal = drawing.counts(&[1, 0, 2], 10).unwrap_err();
        assert!(refusal.message.contains("draw 11 found no"), "{refusal}");
    }

    #[test]
    fn what_cannot_be_drawn_says_why() {
        let refusal = fitted("munsell-vrhel").recipe(&settings("0.999", "scaled"), "").unwrap_err();
        assert!(refusal.message.contains("the largest is 0.9959"), "{refusal}");
    }
}
