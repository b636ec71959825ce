//! A model on the page: fitted here, or built in.

use serde::Serialize;
use spectroll::{
    Dataset, Fit, Grid, MAX_COMPONENTS, Model, Recipe, RecipeSettings, Resampling, SpectrumKind,
};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::colour;
use crate::command;
use crate::data::{Data, Origin};
use crate::drawing::Drawing;
use crate::refusal::Refusal;
use crate::settings::{FitSettings, grid, parse};

/// Number of components of built-in models.
pub(crate) const BUILTIN_COMPONENTS: usize = 6;

/// The most components that the page's slider has.
const MOST_SHOWN: usize = 16;

/// A model, the spectra it was fitted to, and how it is asked for.
#[wasm_bindgen]
#[derive(Clone, Debug)]
pub struct Fitted {
    pub(crate) model: Model,
    pub(crate) origin: Origin,
    pub(crate) settings: FitSettings,
    pub(crate) kind: SpectrumKind,
    data: Dataset,
}

/// Facts about a model, for the page.
#[derive(Serialize)]
struct Facts<'a> {
    kind: SpectrumKind,
    grid: String,
    wavelengths: Vec<f64>,
    spectra: usize,
    mean: Vec<f64>,
    /// Standard deviation of the model's spectra in each band.
    deviation: Vec<f64>,
    basis: Vec<Vec<f64>>,
    explained: &'a [f64],
    /// Shares of variance of as many components as the slider has.
    all_explained: Vec<f64>,
    largest_lrv: Option<f64>,
    has_powers: bool,
    notes: &'a [String],
    unusual: Vec<String>,
}

impl Fitted {
    pub(crate) fn new(data: &Data, settings: FitSettings) -> Result<Fitted, Refusal> {
        let kind = settings.kind.or(data.kind).ok_or(Refusal {
            control: Some("kind"),
            ..Refusal::new("the file does not say what its spectra are: choose reflectances or lights")
        })?;
        let asked = settings.wavelengths.trim();
        let on = match (asked, &data.origin) {
            ("as-measured", _) => Dataset::measured_grid(&data.tables)?,
            ("", Origin::Builtin("krinov")) => "400:10:650".parse().map_err(Refusal::new)?,
            ("", _) => Grid::DEFAULT,
            (text, _) => grid(text, "wavelengths")?,
        };
        let resampling = Resampling::default().missing(settings.missing());
        let dataset = Dataset::new(&data.tables, on.clone(), resampling)?;
        let model = match data.origin {
            Origin::Builtin(name) if settings.components == BUILTIN_COMPONENTS => {
                Model::builtin_at(name, on).map_err(Refusal::new)?
            }
            _ => Fit::new(kind).components(settings.components).fit(&dataset)?,
        };
        Ok(Fitted { model, origin: data.origin.clone(), settings, kind, data: dataset })
    }

    /// Shares of variance of many components, for as many as there are.
    fn all_explained(&self) -> Vec<f64> {
        let (bands, spectra) = self.data.spectra().shape();
        let mut most = MOST_SHOWN.min(bands).min(spectra.saturating_sub(1)).min(MAX_COMPONENTS);
        while most > self.model.components() {
            match Fit::new(self.kind).components(most).fit(&self.data) {
                Ok(model) => return model.parts().explained_variance.clone(),
                // Data of a lower rank.
                Err(_) => most -= 1,
            }
        }
        self.model.parts().explained_variance.clone()
    }
}

#[wasm_bindgen]
impl Fitted {
    /// Facts about the model as JSON.
    pub fn facts(&self) -> String {
        let parts = self.model.parts();
        let counts = self.data.judge(self.kind).ok();
        let unusual = counts.map(|counts| {
            let said = [(counts.above_one, "values above 1"), (counts.below_zero, "values below 0")];
            said.iter().filter(|(n, _)| *n > 0).map(|(n, what)| format!("{n} spectra with {what}")).collect()
        });
        let variance = |band: usize| {
            let row = parts.basis.column(band);
            (row.transpose() * &parts.weight_covariance * row)[0].max(0.0)
        };
        let facts = Facts {
            kind: self.kind,
            grid: self.model.grid().to_string(),
            wavelengths: self.model.grid().wavelengths().collect(),
            spectra: self.data.spectra().ncols(),
            mean: self.model.reconstruct(parts.weight_mean.as_slice()).as_slice().to_vec(),
            deviation: (0..self.model.bands()).map(|band| variance(band).sqrt()).collect(),
            basis: parts.basis.row_iter().map(|row| row.iter().copied().collect()).collect(),
            explained: &parts.explained_variance,
            all_explained: self.all_explained(),
            largest_lrv: Recipe::largest_lrv(&self.model),
            has_powers: !parts.powers.is_empty(),
            notes: self.data.notes(),
            unusual: unusual.unwrap_or_default(),
        };
        serde_json::to_string(&facts).expect("numbers and text are JSON")
    }

    /// Chromaticities x and y of the data, two values a spectrum; empty where they have none.
    pub fn chromaticities(&self) -> Vec<f32> {
        let Some(weights) = colour::xyz_weights(Some(self.kind), self.model.grid()) else {
            return Vec::new();
        };
        let spectra = self.data.spectra();
        let xy = |spectrum: &[f64]| colour::chromaticity(colour::xyz(&weights, spectrum));
        spectra.column_iter().flat_map(|spectrum| xy(spectrum.as_slice())).collect()
    }

    /// The text of the model file.
    pub fn json(&self) -> String {
        self.model.to_json() + "\n"
    }

    /// Name of the model file that the command line writes; empty where the program has the model built in.
    #[wasm_bindgen(js_name = fileName)]
    pub fn file_name(&self) -> String {
        command::model_file(self).unwrap_or_default()
    }

    /// A recipe that can be drawn, of settings that are JSON. `quantities` are those to draw; empty for what the page
    /// shows: spectra, and colours where there are any.
    pub fn recipe(&self, settings: &str, quantities: &str) -> Result<Drawing, Refusal> {
        let settings: RecipeSettings = parse(settings)?;
        Drawing::new(&self.model, settings, quantities)
    }

    /// The command lines that write the same bytes as a download.
    pub fn command(
        &self,
        settings: &str,
        file: &str,
        dtype: &str,
        count: u32,
        seed: u64,
    ) -> Result<String, Refusal> {
        let settings: RecipeSettings = parse(settings)?;
        Ok(command::lines(self, &settings, &command::Draws { file, dtype, count, seed }))
    }
}
