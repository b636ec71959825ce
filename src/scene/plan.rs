//! Plans to draw a [`Group`] that was found to be possible: the model, the recipe, and the engine or CPU.

use serde::Serialize;

use crate::colorimetry;
use crate::dataset::SpectrumKind;
use crate::grid::Grid;
use crate::model::{Model, ModelParts};
use crate::program::{Bounds, IntensityLaw};
use crate::quantity::{Dtype, Quantity, ValueRange};
use crate::random::stream::{self, Stream};
use crate::recipe::{Intensity, Recipe, RecipeBuilder, RecipeError};

use super::error::{Fault, SceneErrorKind};
use super::group::{Base, Group, Illuminants, IntensityScope, QUANTITIES, TargetConstraint, Targets};
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
    /// For targets that are asked for what it sees; all others have it from their recipe.
    pub(super) observer: Option<Observer>,
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

/// The weights of the bands in X, Y and Z under D65.
pub(super) struct Observer([Vec<f64>; 3]);

impl Observer {
    /// A quantity that tristimulus values give, of a reflectance: summed in f64, since targets are drawn on the CPU
    /// whatever the engine.
    pub(super) fn see(&self, spectrum: &[f32], quantity: Quantity) -> Vec<f32> {
        let dot = |w: &Vec<f64>| w.iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum::<f64>();
        let xyz = self.0.each_ref().map(dot);
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

/// An array that a scene gives.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Array {
    /// Its name: that of its group, with an underscore and the name of the quantity unless that is spectra.
    pub name: String,
    /// The group that it belongs to.
    #[serde(skip)]
    pub group: String,
    /// The kind of its group.
    #[serde(skip)]
    pub kind: GroupKind,
    /// The quantity that it holds: f32, or u32 where it counts attempts.
    pub quantity: Quantity,
    /// Whether it has an entry for each scene, rather than one for all.
    pub per_scene: bool,
    /// The extents of an entry. Spectra have (count, bands), and other quantities one of them or none.
    pub shape: Vec<usize>,
    /// Range of its values, if they are spectra.
    #[serde(skip)]
    pub range: Option<ValueRange>,
}

/// The name of a group's array: that of the group, with an underscore and the name of the quantity unless that is
/// spectra.
fn array_name(group: &str, quantity: Quantity) -> String {
    match quantity {
        Quantity::Spectra => group.to_owned(),
        quantity => format!("{group}_{quantity}"),
    }
}

impl Array {
    /// Number of values of an entry.
    pub fn values(&self) -> usize {
        self.shape.iter().product()
    }

    /// The type of its values.
    pub fn dtype(&self) -> Dtype {
        if self.quantity == Quantity::Attempts { Dtype::U32 } else { Dtype::F32 }
    }

    /// Number of bytes of an entry: every value has 4.
    pub fn bytes(&self) -> usize {
        4 * self.values()
    }
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
    /// Finds out how to draw group `number` of a scene.
    pub(super) fn new(number: usize, group: &Group, grid: &Grid, seed: u64) -> Result<GroupPlan, Fault> {
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
        let mut observer = None;
        let (kind, shapes, intensity) = match group {
            Group::Illuminants(group) => {
                let (drawing, intensity) = illuminants(group).map_err(|(k, p)| fault(k, p))?;
                let shapes = if group.fixed { Shapes::Once(drawing) } else { Shapes::Engine(drawing) };
                (GroupKind::Illuminant, shapes, intensity)
            }
            Group::Surfaces(group) => {
                let model = of_kind(base, SpectrumKind::Reflectance).map_err(|(k, p)| fault(k, p))?;
                let recipe = recipe(base, model, group.fixed);
                let recipe = recipe.build().map_err(|e| fault(key(&e), SceneErrorKind::Recipe(e)))?;
                let drawing = Box::new(Drawing { recipe, places: count });
                let shapes = if group.fixed { Shapes::Once(drawing) } else { Shapes::Engine(drawing) };
                (GroupKind::Surface, shapes, None)
            }
            Group::Targets(group) => {
                let target = TargetPlan::new(group, grid.len(), stream).map_err(|(k, p)| fault(k, p))?;
                if base.quantities.iter().any(|quantity| Quantity::COLOURS.contains(quantity)) {
                    let invisible = || SceneErrorKind::Recipe(RecipeError::Invisible(grid.clone()));
                    let weights = colorimetry::xyz_weights(grid);
                    observer = Some(Observer(weights.ok_or_else(|| fault("wavelengths", invisible()))?));
                }
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
        let arrays = arrays(group, &shapes, intensities, grid.len());
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
            observer,
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

/// The recipe of what the group gives. What is drawn once has its spectra all the same: a renderer takes them.
fn recipe(base: &Base, model: &Model, once: bool) -> RecipeBuilder {
    let spectra = once.then_some(Quantity::Spectra);
    Recipe::builder(model)
        .covariance_scale(base.covariance_scale)
        .max_attempts(base.max_attempts)
        .quantities(base.quantities.iter().copied().chain(spectra))
}

fn of_kind(base: &Base, wanted: SpectrumKind) -> Result<&Model, (&'static str, SceneErrorKind)> {
    let model = base.model.as_ref().expect("only flat targets have none");
    match model.kind() {
        found if found == wanted => Ok(model),
        found => Err(("model", SceneErrorKind::Kind { found, wanted })),
    }
}

type Lights = (Box<Drawing>, Option<Varying>);

fn illuminants(group: &Illuminants) -> Result<Lights, (&'static str, SceneErrorKind)> {
    let model = of_kind(&group.base, SpectrumKind::Illuminant)?;
    let model = match &group.mean {
        Some(mean) => with_mean(model, mean).map_err(|problem| ("mean", problem))?,
        None => model.clone(),
    };
    let failed = |e: RecipeError| (key(&e), SceneErrorKind::Recipe(e));
    let mut recipe = recipe(&group.base, &model, group.fixed);
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

/// Whether an intensity multiplies a quantity of lights.
pub(super) fn is_multiplied(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Spectra | Quantity::Xyz | Quantity::LinearSrgb)
}

/// Intensities of a group.
#[derive(Clone, Copy, PartialEq)]
enum Intensities {
    None,
    /// One number for all lights of all scenes.
    Fixed,
    Varying(IntensityScope),
}

fn arrays(group: &Group, shapes: &Shapes, intensities: Intensities, bands: usize) -> Vec<Array> {
    let base = group.base();
    let count = base.count as usize;
    let once = matches!(shapes, Shapes::Once(_));
    let kind = match group {
        Group::Illuminants(_) => GroupKind::Illuminant,
        Group::Surfaces(_) => GroupKind::Surface,
        Group::Targets(_) => GroupKind::Target,
    };
    let range = match group {
        Group::Illuminants(_) => ValueRange::Positive,
        Group::Surfaces(_) => ValueRange::Unit,
        Group::Targets(Targets { aim: TargetConstraint::Lrv(_), bounds: Bounds::Base, .. }) => {
            ValueRange::Positive
        }
        Group::Targets(_) => ValueRange::Unit,
    };
    let array = |quantity: Quantity, per_scene, shape: &[usize]| Array {
        name: array_name(&base.name, quantity),
        group: base.name.clone(),
        kind,
        quantity,
        per_scene,
        shape: shape.to_vec(),
        range: (quantity == Quantity::Spectra).then_some(range),
    };
    let mut arrays = Vec::new();
    let varies = matches!(intensities, Intensities::Varying(_));
    if base.wants(Quantity::Spectra) {
        arrays.push(array(Quantity::Spectra, !once || varies, &[count, bands]));
    }
    match intensities {
        Intensities::Varying(IntensityScope::Scene) => arrays.push(array(Quantity::Intensity, true, &[])),
        Intensities::Varying(IntensityScope::Light) => {
            arrays.push(array(Quantity::Intensity, true, &[count]));
        }
        Intensities::Fixed => arrays.push(array(Quantity::Intensity, false, &[count])),
        Intensities::None => {}
    }
    let mut flat = false;
    if let Group::Targets(Targets { aim, .. }) = group {
        arrays.push(array(Quantity::Lrv, true, &[count]));
        if let TargetConstraint::Hue(_) = aim {
            arrays.push(array(Quantity::Xyz, true, &[count, 3]));
        }
        flat = matches!(aim, TargetConstraint::Flat(_));
    }
    for &quantity in Quantity::COLOURS {
        // The given tristimulus values of a hue are among them already.
        if base.wants(quantity) && arrays.iter().all(|array| array.quantity != quantity) {
            let scales = varies && is_multiplied(quantity);
            arrays.push(array(quantity, !once || scales, &[count, quantity.channels().len()]));
        }
    }
    if !flat {
        arrays.push(array(Quantity::Attempts, !once, &[count]));
    }
    arrays
}
