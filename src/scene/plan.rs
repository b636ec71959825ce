//! Plans to draw a [`Group`] that was found to be possible: the model, the recipe, and the engine or CPU.

use serde::Serialize;

use crate::colorimetry;
use crate::dataset::SpectrumKind;
use crate::grid::Grid;
use crate::model::{Model, ModelParts};
use crate::program::IntensityLaw;
use crate::quantity::Quantity;
use crate::random::stream::{self, Stream};
use crate::recipe::{Intensity, OutputRequest, Recipe, RecipeBuilder, RecipeError};

use super::array::{Array, Intensities, arrays};
use super::error::{Fault, SceneErrorKind};
use super::group::{Base, Group, Illuminants, IntensityScope, QUANTITIES, Viewing};
use super::lighting::Lighting;
use super::target::{TargetPlan, key};

/// A group as it is drawn.
pub(super) struct GroupPlan {
    pub(super) name: String,
    pub(super) kind: GroupKind,
    /// Model of its spectra; flat ones have none.
    pub(super) model: Option<Model>,
    /// Number of elements per scene.
    pub(super) count: u32,
    /// Stream of the group, in rows of `count`.
    pub(super) stream: Stream,
    pub(super) max_attempts: u32,
    pub(super) shapes: Shapes,
    pub(super) intensity: Option<Varying>,
    /// Factor of all its lights, where that is one number.
    pub(super) fixed_intensity: Option<f32>,
    /// For targets that are asked for what is seen of them; all others have it from their recipe.
    pub(super) eye: Option<Eye>,
    /// For what is seen under the lights of the scene.
    pub(super) lighting: Option<Lighting>,
    pub(super) arrays: Vec<Array>,
}

/// Kind of a group's spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum GroupKind {
    /// Lights.
    Illuminant,
    /// Reflectances.
    Surface,
    /// Reflectances with a constraint.
    Target,
}

/// Source of a group's spectra, before intensities.
pub(super) enum Shapes {
    /// From the engine, for each scene.
    Engine(Box<Drawing>),
    /// From the CPU, once for all scenes: for so few no shader is worth compiling.
    Once(Box<Drawing>),
    /// From the CPU, for each scene.
    Target(Box<TargetPlan>),
}

/// Weights of the bands in what is seen of a reflectance.
pub(super) struct Eye {
    xyz: Option<[Vec<f64>; 3]>,
    /// Of each sensor; none where there are no responses.
    responses: Vec<Vec<f64>>,
}

impl Eye {
    /// The eye of a group of targets; `None` where nothing of them is seen.
    fn new(base: &Base, grid: &Grid) -> Result<Option<Eye>, RecipeError> {
        let viewing = &base.viewing;
        let request = OutputRequest {
            illuminant: viewing.illuminant.clone(),
            observer: viewing.observer,
            response_scale: viewing.response_scale,
            ..OutputRequest::default()
        };
        let has_colours = Quantity::COLOURS.iter().any(|quantity| base.wants(*quantity));
        let xyz = has_colours.then(|| request.reflected_xyz_weights(grid)).transpose()?;
        let own = viewing.sensors.as_ref().filter(|_| viewing.under.is_none());
        let weights = own.map(|sensors| request.response_weights(sensors, SpectrumKind::Reflectance, grid));
        let responses = weights.transpose()?.unwrap_or_default();
        Ok((xyz.is_some() || !responses.is_empty()).then_some(Eye { xyz, responses }))
    }

    /// A quantity of a reflectance that is seen: summed in f64, since targets are drawn on the CPU whatever the engine.
    pub(super) fn see(&self, spectrum: &[f32], quantity: Quantity) -> Vec<f32> {
        let dot = |w: &Vec<f64>| w.iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum::<f64>();
        if quantity == Quantity::Responses {
            return self.responses.iter().map(|weights| dot(weights) as f32).collect();
        }
        let xyz = self.xyz.as_ref().expect("colours are asked for").each_ref().map(dot);
        let [x, y, z] = xyz;
        match quantity {
            Quantity::Xyz => xyz.map(|v| v as f32).to_vec(),
            Quantity::LinearSrgb => colorimetry::linear_srgb(xyz).map(|v| v as f32).to_vec(),
            Quantity::Chromaticity => [x, y].map(|v| (v / (x + y + z)) as f32).to_vec(),
            other => unreachable!("{other} is not of tristimulus values"),
        }
    }
}

/// Draws of a recipe: `places` a scene, one for each of its elements or one for all.
pub(super) struct Drawing {
    pub(super) recipe: Recipe,
    pub(super) places: u32,
}

/// An intensity that varies.
pub(super) struct Varying {
    law: IntensityLaw<f32>,
    pub(super) scope: IntensityScope,
}

impl Varying {
    /// The intensity of an element of a scene; `stream` is in rows of as many as the scene has.
    pub(super) fn at(&self, stream: Stream, scene: u64, element: u32) -> f32 {
        // The first place of a row is the same in rows of any length.
        let (stream, index) = match self.scope {
            IntensityScope::Scene => (stream.in_rows(1), scene),
            IntensityScope::Light => (stream, scene * u64::from(stream.row()) + u64::from(element)),
        };
        self.law.of(stream.block(index, 0, stream::DRAW_BLOCK)[0])
    }
}

impl GroupPlan {
    /// Finds out how to draw group `number` of a scene, among `groups`.
    pub(super) fn new(number: usize, groups: &[Group], grid: &Grid, seed: u64) -> Result<GroupPlan, Fault> {
        let group = &groups[number];
        let base = group.base();
        let fault = |key, problem| Fault::of_group(number, key, problem);
        let count = u32::try_from(base.count).expect("the count was checked");
        let stream = Stream::named(seed, &base.name).in_rows(count);
        if let Some(model) = &base.model
            && model.grid() != grid
        {
            return Err(fault(
                "model",
                SceneErrorKind::Grid { model: model.grid().clone(), scene: grid.clone() },
            ));
        }
        if base.quantities.is_empty() {
            return Err(fault("quantities", SceneErrorKind::NoQuantities));
        }
        if let Some(other) = base.quantities.iter().find(|quantity| !QUANTITIES.contains(quantity)) {
            return Err(fault("quantities", SceneErrorKind::NotOfGroups { quantity: *other }));
        }
        check_viewing(group).map_err(|(k, p)| fault(k, p))?;
        let seen = Seen::of(base, groups);
        let mut eye = None;
        let (kind, shapes, intensity) = match group {
            Group::Illuminants(group) => {
                let (drawing, intensity) = illuminants(group, seen).map_err(|(k, p)| fault(k, p))?;
                let shapes = if group.fixed { Shapes::Once(drawing) } else { Shapes::Engine(drawing) };
                (GroupKind::Illuminant, shapes, intensity)
            }
            Group::Surfaces(group) => {
                let model = of_kind(base, SpectrumKind::Reflectance).map_err(|(k, p)| fault(k, p))?;
                let recipe = recipe(base, model, (group.fixed, seen));
                let recipe = recipe.build().map_err(|e| fault(key(&e), SceneErrorKind::Recipe(e)))?;
                let drawing = Box::new(Drawing { recipe, places: count });
                let shapes = if group.fixed { Shapes::Once(drawing) } else { Shapes::Engine(drawing) };
                (GroupKind::Surface, shapes, None)
            }
            Group::Targets(group) => {
                let target = TargetPlan::new(group, grid.len(), stream).map_err(|(k, p)| fault(k, p))?;
                eye = Eye::new(base, grid).map_err(|e| fault(key(&e), SceneErrorKind::Recipe(e)))?;
                (GroupKind::Target, Shapes::Target(Box::new(target)), None)
            }
        };
        let fixed_intensity = match group {
            Group::Illuminants(Illuminants { intensity: Some((Intensity::Fixed(factor), _)), .. }) => {
                Some(*factor as f32)
            }
            _ => None,
        };
        let intensities = match (&intensity, fixed_intensity) {
            (Some(varying), _) => Intensities::Varying(varying.scope),
            (None, Some(_)) => Intensities::Fixed,
            (None, None) => Intensities::None,
        };
        let lights = lights_of(base, groups).map_err(|(k, p)| fault(k, p))?;
        let lights = lights.map(|lights| groups[lights].base());
        let arrays = arrays(group, &shapes, (intensities, lights), grid.len());
        let model = match &shapes {
            Shapes::Engine(drawing) | Shapes::Once(drawing) => Some(drawing.recipe.model().clone()),
            Shapes::Target(_) => base.model.clone(),
        };
        let (name, max_attempts) = (base.name.clone(), base.max_attempts);
        Ok(GroupPlan {
            name,
            kind,
            model,
            count,
            stream,
            max_attempts,
            shapes,
            intensity,
            fixed_intensity,
            eye,
            lighting: None, // once all groups have a plan
            arrays,
        })
    }

    /// Whether it has an array of a quantity.
    pub(super) fn gives(&self, quantity: Quantity) -> bool {
        self.arrays.iter().any(|array| array.quantity == quantity)
    }

    /// Number of scenes in a row that share a draw.
    pub(super) fn round(&self) -> u64 {
        match &self.shapes {
            Shapes::Target(target) => target.round().unwrap_or(1),
            Shapes::Engine(_) | Shapes::Once(_) => 1,
        }
    }

    /// Array of the intensities of its lights and their values, where one number is the factor of all.
    pub(super) fn fixed_intensities(&self) -> Option<(&Array, Vec<f32>)> {
        let array = self.arrays.iter().find(|array| array.quantity == Quantity::Intensity)?;
        Some((array, vec![self.fixed_intensity?; self.count as usize]))
    }

    /// Spectra that the engine draws, if it draws any.
    pub(super) fn drawn_by_engine(&self) -> Option<&Drawing> {
        match &self.shapes {
            Shapes::Engine(drawing) => Some(drawing),
            _ => None,
        }
    }
}

/// Quantities of a group that others of its scene, or what is seen under lights, are made of.
#[derive(Clone, Copy, Default)]
struct Seen {
    weights: bool,
    spectra: bool,
}

impl Seen {
    fn of(base: &Base, groups: &[Group]) -> Seen {
        // Those that are seen under this group, and the group itself where it is seen under another.
        let is_under = |other: &&Base| other.viewing.under.as_ref() == Some(&base.name);
        let own = std::iter::once(base).filter(|base| base.viewing.under.is_some());
        let all: Vec<&Base> = groups.iter().map(Group::base).filter(is_under).chain(own).collect();
        Seen {
            weights: all.iter().any(|base| base.wants(Quantity::Responses)),
            spectra: all.iter().any(|base| base.wants(Quantity::ColorSignal)),
        }
    }
}

/// The recipe of what the group gives. What is drawn once has its spectra all the same: a renderer takes them.
fn recipe(base: &Base, model: &Model, (once, seen): (bool, Seen)) -> RecipeBuilder {
    let spectra = (once || seen.spectra).then_some(Quantity::Spectra);
    let weights = seen.weights.then_some(Quantity::Weights);
    let is_own = |quantity: &Quantity| match quantity {
        Quantity::Responses => base.viewing.under.is_none(),
        Quantity::ColorSignal => false,
        _ => true,
    };
    let own: Vec<Quantity> =
        base.quantities.iter().copied().filter(is_own).chain(spectra).chain(weights).collect();
    let builder = Recipe::builder(model)
        .covariance_scale(base.covariance_scale)
        .max_attempts(base.max_attempts)
        .quantities(own);
    viewed(builder, &base.viewing)
}

/// The recipe with the settings of what is seen of it; those under lights are none of a recipe's.
pub(super) fn viewed(mut builder: RecipeBuilder, viewing: &Viewing) -> RecipeBuilder {
    if let Some(observer) = viewing.observer {
        builder = builder.observer(observer);
    }
    if let Some(illuminant) = &viewing.illuminant {
        builder = builder.illuminant(illuminant.clone());
    }
    if viewing.under.is_none() {
        if let Some(sensors) = &viewing.sensors {
            builder = builder.sensors(sensors.clone());
        }
        if let Some(scale) = viewing.response_scale {
            builder = builder.response_scale(scale);
        }
    }
    builder
}

/// Refuses settings of what is seen that lack another, or mean nothing.
fn check_viewing(group: &Group) -> Result<(), (&'static str, SceneErrorKind)> {
    let (base, Viewing { sensors, response_scale, under, .. }) = (group.base(), &group.base().viewing);
    let has_responses = base.wants(Quantity::Responses);
    let missing = |key, example| Err((key, SceneErrorKind::Missing { example }));
    let pointless = |key, with| Err((key, SceneErrorKind::Pointless { with }));
    if has_responses && sensors.is_none() {
        return missing("sensors", "sensors = \"ss2\", or a file, for the responses");
    }
    if base.wants(Quantity::ColorSignal) && under.is_none() {
        return missing("under", "under = \"lights\", the name of the lights of the color signals");
    }
    if sensors.is_some() && !has_responses {
        return pointless("sensors", "without \"responses\" among the quantities");
    }
    if response_scale.is_some() && !has_responses {
        return pointless("response_scale", "without \"responses\" among the quantities");
    }
    if under.is_some() && matches!(group, Group::Illuminants(_)) {
        return pointless("under", "for lights");
    }
    if under.is_some() && !has_responses && !base.wants(Quantity::ColorSignal) {
        return pointless("under", "without \"responses\" or \"color_signal\" among the quantities");
    }
    Ok(())
}

/// The number of the group of lights that a group is seen under.
fn lights_of(base: &Base, groups: &[Group]) -> Result<Option<usize>, (&'static str, SceneErrorKind)> {
    let Some(under) = &base.viewing.under else { return Ok(None) };
    let is_meant = |group: &Group| matches!(group, Group::Illuminants(_)) && group.base().name == *under;
    groups.iter().position(is_meant).map(Some).ok_or_else(|| {
        let lights = groups.iter().filter(|group| matches!(group, Group::Illuminants(_)));
        let known = lights.map(|group| group.base().name.clone()).collect();
        ("under", SceneErrorKind::NoLights { name: under.clone(), known })
    })
}

fn of_kind(base: &Base, wanted: SpectrumKind) -> Result<&Model, (&'static str, SceneErrorKind)> {
    let model = base.model.as_ref().expect("only flat targets have none");
    match model.kind() {
        found if found == wanted => Ok(model),
        found => Err(("model", SceneErrorKind::Kind { found, wanted })),
    }
}

type Lights = (Box<Drawing>, Option<Varying>);

fn illuminants(group: &Illuminants, seen: Seen) -> Result<Lights, (&'static str, SceneErrorKind)> {
    let model = of_kind(&group.base, SpectrumKind::Illuminant)?;
    let model = match &group.mean {
        Some(mean) => with_mean(model, mean).map_err(|problem| ("mean", problem))?,
        None => model.clone(),
    };
    let failed = |e: RecipeError| (key(&e), SceneErrorKind::Recipe(e));
    let mut recipe = recipe(&group.base, &model, (group.fixed, seen));
    let mut varying = None;
    match group.intensity {
        None => {}
        // The same for all: the recipe has it for nothing.
        Some((intensity @ Intensity::Fixed(_), _)) => recipe = recipe.intensity(intensity),
        Some((intensity, scope)) => {
            let checked = recipe.clone().intensity(intensity).build().map_err(failed)?;
            let law = checked.program().intensity.as_ref().expect("the intensity varies");
            varying = Some(Varying { law: law.rounded(), scope });
        }
    }
    let places = if group.same_shape { 1 } else { group.base.count as u32 };
    let recipe = recipe.build().map_err(failed)?;
    Ok((Box::new(Drawing { recipe, places }), varying))
}

/// The model with another mean spectrum, of the same mean power.
fn with_mean(model: &Model, mean: &[f64]) -> Result<Model, SceneErrorKind> {
    let parts = model.parts();
    if mean.len() != model.bands() {
        return Err(SceneErrorKind::MeanLength { found: mean.len(), expected: model.bands() });
    }
    if let Some(band) = mean.iter().position(|&power| power < 0.0) {
        let (power, wavelength) = (mean[band], model.grid().wavelength(band));
        return Err(SceneErrorKind::NegativeMean { power, wavelength });
    }
    let power = mean.iter().sum::<f64>() / mean.len() as f64;
    if !(power > 0.0 && power.is_finite()) {
        return Err(SceneErrorKind::DarkMean(power));
    }
    // The mean of the draws is that of the model and what the mean weights add to it.
    let old = model.reconstruct(parts.weight_mean.as_slice());
    let scale = old.mean() / power;
    let mut new = parts.mean.clone();
    new.iter_mut().zip(mean).zip(&old).for_each(|((new, mean), old)| *new += scale * mean - old);
    Model::new(ModelParts { mean: new, ..parts.clone() }).map_err(SceneErrorKind::Model)
}
