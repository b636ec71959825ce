//! What is asked of a draw: the flags that say so, which are also what a data set records of them.

use std::borrow::Cow;

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use spectroll::export::provenance::{Sum, model_sum, shader_sum};
use spectroll::output::{Field, Schema, SpdName};
use spectroll::{
    Batch, Bounds, DEFAULT_MAX_ATTEMPTS, Dtype, Engine, EngineError, Intensity, Model, ProposalKind,
    Quantity, Recipe, RecipeError, Session, SpectrumKind, Stream, XyzScale, colorimetry,
};

/// What draws must obey, and what comes out of them.
#[derive(Clone, clap::Args, Serialize, Deserialize)]
pub(super) struct Request {
    /// Scale every reflectance to this luminous reflectance value (0 to 1)
    #[arg(long, value_name = "Y", allow_negative_numbers = true)]
    pub(super) lrv: Option<f64>,
    /// What must be between 0 and 1 where there is an --lrv
    #[arg(long, value_enum, default_value = "base", requires = "lrv")]
    bounds: BoundsName,
    /// Multiply the covariance of the weights
    #[arg(long, default_value_t = 1.0, value_name = "C", allow_negative_numbers = true)]
    cov_scale: f64,
    /// Multiply illuminants: a number, LOW..HIGH (uniform in the logarithm), or data (what the model's were divided by)
    #[arg(long, value_name = "I", value_parser = intensity)]
    intensity: Option<IntensityName>,
    /// The quantities that are given of each draw
    #[arg(long, value_enum, value_delimiter = ',', value_name = "LIST", default_value = "spectra")]
    quantities: Vec<QuantityName>,
    /// The illuminant of reflectances' XYZ and sRGB
    #[arg(long, value_enum, default_value = "d65")]
    light: LightName,
    /// Give illuminants' XYZ and sRGB with Y = 1
    #[arg(long)]
    unit_luminance: bool,
    /// The distribution that candidates are drawn from
    #[arg(long, value_enum, default_value = "auto")]
    proposal: ProposalName,
    /// How many candidates a draw may take
    #[arg(long, default_value_t = DEFAULT_MAX_ATTEMPTS, value_name = "N")]
    max_attempts: u32,
}

#[derive(Clone, Copy, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum BoundsName {
    /// The spectrum before scaling
    Base,
    /// The spectrum after scaling
    Scaled,
    /// Both
    Both,
}

#[derive(Clone, Copy, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum ProposalName {
    /// Whatever is expected to cost less
    Auto,
    /// The model's Gaussian
    Plain,
    /// Boxes that cover the acceptable weights
    Cover,
}

#[derive(Clone, Copy, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum LightName {
    /// Noon daylight
    D65,
    /// Incandescent
    A,
    /// Equal energy
    E,
}

#[derive(Clone, Copy, ValueEnum, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum QuantityName {
    /// A value for each band
    Spectra,
    /// A value for each component
    Weights,
    /// Tristimulus values
    Xyz,
    /// Linear Rec. 709 components
    LinearSrgb,
    /// The luminous reflectance
    Lrv,
    /// How many candidates each draw took
    Attempts,
    /// What each illuminant was multiplied by
    Intensity,
}

#[derive(Clone, Copy, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
enum IntensityName {
    Fixed(f64),
    LogUniform(f64, f64),
    Data,
}

impl Request {
    /// The recipe of this for a model.
    pub(super) fn recipe(&self, model: &Model) -> Result<Recipe, RecipeError> {
        let mut recipe = Recipe::builder(model)
            .covariance_scale(self.cov_scale)
            .max_attempts(self.max_attempts)
            .quantities(self.quantities.iter().map(|quantity| quantity.meant()))
            .proposal(match self.proposal {
                ProposalName::Auto => ProposalKind::Auto,
                ProposalName::Plain => ProposalKind::Plain,
                ProposalName::Cover => ProposalKind::Cover,
            });
        if let Some(lrv) = self.lrv {
            recipe = recipe.lrv(lrv).bounds(match self.bounds {
                BoundsName::Base => Bounds::Base,
                BoundsName::Scaled => Bounds::Scaled,
                BoundsName::Both => Bounds::Both,
            });
        }
        if let Some(intensity) = self.intensity {
            recipe = recipe.intensity(match intensity {
                IntensityName::Fixed(value) => Intensity::Fixed(value),
                IntensityName::LogUniform(low, high) => Intensity::LogUniform(low, high),
                IntensityName::Data => Intensity::Data,
            });
        }
        if self.unit_luminance {
            recipe = recipe.xyz_scale(XyzScale::UnitY);
        }
        match self.light {
            LightName::D65 => recipe,
            LightName::A => recipe.illuminant(&colorimetry::illuminant_a(model.grid())),
            LightName::E => recipe.illuminant(&vec![1.0; model.bands()]),
        }
        .build()
    }
}

impl QuantityName {
    fn meant(self) -> Quantity {
        match self {
            QuantityName::Spectra => Quantity::Spectra,
            QuantityName::Weights => Quantity::Weights,
            QuantityName::Xyz => Quantity::Xyz,
            QuantityName::LinearSrgb => Quantity::LinearSrgb,
            QuantityName::Lrv => Quantity::Lrv,
            QuantityName::Attempts => Quantity::Attempts,
            QuantityName::Intensity => Quantity::Intensity,
        }
    }
}

fn intensity(text: &str) -> Result<IntensityName, String> {
    let number = |text: &str| text.trim().parse::<f64>().ok();
    let parsed = match text.split_once("..") {
        Some((low, high)) => number(low).zip(number(high)).map(|(a, b)| IntensityName::LogUniform(a, b)),
        None if text == "data" => Some(IntensityName::Data),
        None => number(text).map(IntensityName::Fixed),
    };
    parsed.ok_or_else(|| "expected a number, LOW..HIGH as in 0.15..150, or data".to_owned())
}

/// What `count` draws of a recipe are as a data set, without what they were made from.
pub(super) fn schema(recipe: &Recipe, count: u64, stored: Dtype) -> Schema {
    let field = |format: spectroll::ArrayFormat| {
        let axis = match format.quantity {
            Quantity::Spectra => {
                let field = Field::vector("spectra", "wavelength", format.width, format.element);
                return field.within(recipe.interval());
            }
            Quantity::Weights => "component",
            Quantity::Xyz | Quantity::LinearSrgb => "channel",
            Quantity::Lrv | Quantity::Attempts | Quantity::Intensity => {
                return Field::scalar(format.quantity.name(), format.element);
            }
        };
        Field::vector(format.quantity.name(), axis, format.width, format.element)
    };
    Schema {
        fields: recipe.formats().into_iter().map(|format| field(format).stored_as(stored)).collect(),
        row: "draw".to_owned(),
        constants: Vec::new(),
        count,
        wavelengths: recipe.model().grid().wavelengths().collect(),
        attributes: Map::new(),
    }
}

/// The columns of a window, as [`schema`] has them: of tallies, the attempts.
pub(super) fn columns<'a>(recipe: &Recipe, batch: &Batch<'a>) -> Vec<Cow<'a, [u8]>> {
    let column = |quantity| match quantity {
        Quantity::Attempts => batch
            .statuses()
            .iter()
            .flat_map(|status| status.attempts().to_ne_bytes())
            .collect::<Vec<_>>()
            .into(),
        _ => Cow::Borrowed(batch.bytes(quantity)),
    };
    recipe.formats().iter().map(|format| column(format.quantity)).collect()
}

/// What draws are made from.
pub(super) fn attributes(
    name: &str,
    request: &Request,
    recipe: &Recipe,
    stream: (&Option<String>, Stream),
    first: u64,
) -> Map<String, Value> {
    let (stream_name, stream) = stream;
    let attributes = json!({
        "model": name,
        "model_blake3": model_sum(recipe.model()),
        "kind": recipe.model().kind(),
        "recipe": request,
        "seed": stream.seed(),
        "stream": stream_name,
        "start": first,
        "program": concat!("spectroll ", env!("CARGO_PKG_VERSION")),
        "shader_blake3": shader_sum(recipe),
    });
    let Value::Object(attributes) = attributes else { unreachable!("it is written as one") };
    attributes
}

/// A sum that engines share exactly where they round alike: of draws that no data set holds.
pub(super) fn rounding(recipe: &Recipe, session: &mut Session) -> Result<String, EngineError> {
    let mut sum = Sum::default();
    session.draw(Stream::named(0, "rounding").draws(0..4096), |batch| {
        columns(recipe, &batch).iter().for_each(|column| sum.update(column));
        Ok::<_, EngineError>(())
    })?;
    Ok(sum.finish())
}

/// What draws, as far as that can show in the draws.
pub(super) fn engine_name(engine: &Engine) -> String {
    engine.adapter().map_or_else(|| "CPU".to_owned(), ToString::to_string)
}

/// How `.spd` files of such draws are called.
pub(super) fn spd_name(request: &Request, kind: SpectrumKind) -> SpdName {
    match (kind, request.lrv) {
        (SpectrumKind::Illuminant, _) => SpdName::Illuminant,
        (SpectrumKind::Reflectance, None) => SpdName::Reflectance,
        (SpectrumKind::Reflectance, Some(lrv)) => SpdName::ReflectanceAt(lrv),
    }
}
