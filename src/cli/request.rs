//! What is asked of a draw: the flags that say so, which are also what a data set records of them.

use clap::ValueEnum;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use spectroll::output::{Element, Field, Schema, SpdName};
use spectroll::provenance::{Sum, model_sum, shader_sum};
use spectroll::{
    Batch, Bounds, DEFAULT_MAX_ATTEMPTS, Drawer, Engine, EngineError, Kind, Model, Recipe, RecipeError,
    Stream,
};

/// What draws must obey.
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

impl Request {
    /// The recipe of this for a model.
    pub(super) fn recipe(&self, model: &Model) -> Result<Recipe, RecipeError> {
        let recipe = Recipe::new(model).covariance_scale(self.cov_scale).max_attempts(self.max_attempts);
        match self.lrv {
            None => recipe,
            Some(lrv) => recipe.lrv(lrv).bounds(match self.bounds {
                BoundsName::Base => Bounds::Base,
                BoundsName::Scaled => Bounds::Scaled,
                BoundsName::Both => Bounds::Both,
            }),
        }
        .build()
    }
}

/// What `count` draws of a recipe are as a data set, without what they were made from.
pub(super) fn schema(recipe: &Recipe, count: u64, stored: Element) -> Schema {
    let fields = vec![Field::vector("spectra", "wavelength", recipe.model().bands(), Element::F32)];
    Schema {
        fields: fields.into_iter().map(|field| field.stored_as(stored)).collect(),
        count,
        wavelengths: recipe.model().grid().wavelengths().collect(),
        attributes: Map::new(),
    }
}

/// The columns of a window, as [`schema`] has them.
pub(super) fn columns<'a>(batch: &Batch<'a>) -> Vec<&'a [u8]> {
    vec![bytemuck::cast_slice(batch.spectra)]
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
pub(super) fn rounding(drawer: &mut Drawer) -> Result<String, EngineError> {
    let mut sum = Sum::default();
    drawer.draw(Stream::named(0, "rounding").draws(0..4096), |batch| {
        columns(&batch).into_iter().for_each(|column| sum.update(column));
        Ok::<_, EngineError>(())
    })?;
    Ok(sum.finish())
}

/// What draws, as far as that can show in the draws.
pub(super) fn engine_name(engine: &Engine) -> String {
    engine.adapter().map_or_else(|| "CPU".to_owned(), ToString::to_string)
}

/// How `.spd` files of such draws are called.
pub(super) fn spd_name(request: &Request, kind: Kind) -> SpdName {
    match (kind, request.lrv) {
        (Kind::Illuminant, _) => SpdName::Illuminant,
        (Kind::Reflectance, None) => SpdName::Reflectance,
        (Kind::Reflectance, Some(lrv)) => SpdName::ReflectanceAt(lrv),
    }
}
