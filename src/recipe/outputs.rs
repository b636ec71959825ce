//! Outputs of a program from the quantities that a recipe asks for: each as a map of the normals, folded in f64.

use super::{PointlessSetting, RecipeError, XyzScale};
use crate::affine::Affine;
use crate::colorimetry::{self, Illuminant, Observer};
use crate::dataset::SpectrumKind;
use crate::grid::Grid;
use crate::model::Model;
use crate::program::{LrvLaw, Output, Program, Source, Unit};
use crate::quantity::{ArrayFormat, Dtype, Layout, Quantity};
use crate::sensors::{ResponseScale, Sensors};

/// Quantities that a recipe asks for, and their settings.
#[derive(Clone, Debug)]
pub(crate) struct OutputRequest {
    pub(crate) quantities: Vec<Quantity>,
    pub(crate) layout: Layout,
    /// The type of spectra.
    pub(crate) spectra: Dtype,
    /// The illuminant of reflectances, if it is not D65.
    pub(crate) illuminant: Option<Illuminant>,
    pub(crate) observer: Option<Observer>,
    pub(crate) sensors: Option<Sensors>,
    pub(crate) response_scale: Option<ResponseScale>,
    pub(crate) xyz_scale: Option<XyzScale>,
    /// The intensity of every draw, where it is the same.
    pub(crate) fixed: Option<f64>,
    pub(crate) aim: Aim,
}

/// Property that every draw is given.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) enum Aim {
    /// None.
    #[default]
    Nothing,
    /// A luminous reflectance, to which its spectrum is scaled.
    Lrv,
    /// The response of a sensor, to which its spectrum is scaled.
    Response,
    /// Tristimulus values, which its distribution is conditioned on.
    Xyz,
    /// Responses of its own, which its distribution is conditioned on.
    Given,
}

impl Default for OutputRequest {
    fn default() -> Self {
        OutputRequest {
            quantities: vec![Quantity::Spectra],
            layout: Layout::default(),
            spectra: Dtype::F32,
            illuminant: None,
            observer: None,
            sensors: None,
            response_scale: None,
            xyz_scale: None,
            fixed: None,
            aim: Aim::default(),
        }
    }
}

impl OutputRequest {
    /// Refuses settings that would change nothing.
    fn check(&self, kind: SpectrumKind) -> Result<(), RecipeError> {
        let wants = |list: &[Quantity]| self.quantities.iter().any(|quantity| list.contains(quantity));
        let is_reflectance = kind == SpectrumKind::Reflectance;
        let has_colours = wants(Quantity::COLOURS) || wants(&[Quantity::Lrv]);
        let has_responses = wants(&[Quantity::Responses]);
        let is_lit = has_colours || has_responses || self.aim != Aim::Nothing;
        let settings = [
            (PointlessSetting::Illuminant, self.illuminant.is_some() && !(is_reflectance && is_lit)),
            (
                PointlessSetting::Observer,
                self.observer.is_some() && !(has_colours || matches!(self.aim, Aim::Lrv | Aim::Xyz)),
            ),
            (PointlessSetting::Sensors, self.sensors.is_some() && !has_responses),
            (PointlessSetting::ResponseScale, self.response_scale.is_some() && !has_responses),
            (
                PointlessSetting::WhiteResponseScale,
                self.response_scale == Some(ResponseScale::White) && !is_reflectance,
            ),
            // A chromaticity is the same in every scale.
            (
                PointlessSetting::XyzScale,
                self.xyz_scale.is_some()
                    && (is_reflectance || !wants(&[Quantity::Xyz, Quantity::LinearSrgb])),
            ),
        ];
        match settings.into_iter().find(|(_, is_pointless)| *is_pointless) {
            Some((setting, _)) => Err(RecipeError::Pointless(setting)),
            None => Ok(()),
        }
    }

    pub(crate) fn observer(&self) -> Observer {
        self.observer.unwrap_or_default()
    }

    /// Power in each band of the illuminant that reflectances are seen under.
    pub(crate) fn light(&self, grid: &Grid) -> Result<Vec<f64>, RecipeError> {
        let illuminant = self.illuminant.as_ref().unwrap_or(&Illuminant::D65);
        illuminant.check()?;
        let power = illuminant.power(grid);
        if power.len() != grid.len() {
            return Err(RecipeError::Light { found: power.len(), expected: grid.len() });
        }
        if !power.iter().all(|power| power.is_finite() && *power >= 0.0) {
            return Err(RecipeError::DarkLight);
        }
        Ok(power)
    }

    /// Weights of the bands in X, Y and Z of a reflectance.
    pub(crate) fn reflected_xyz_weights(&self, grid: &Grid) -> Result<[Vec<f64>; 3], RecipeError> {
        let weights = self.observer().xyz_weights_under(&self.light(grid)?, grid);
        weights.ok_or(match self.illuminant {
            None | Some(Illuminant::D65) => RecipeError::Invisible(grid.clone()),
            _ => RecipeError::DarkLight,
        })
    }

    /// Weights of the bands in the response of each sensor.
    pub(crate) fn response_weights(
        &self,
        sensors: &Sensors,
        kind: SpectrumKind,
        grid: &Grid,
    ) -> Result<Vec<Vec<f64>>, RecipeError> {
        Ok(match kind {
            SpectrumKind::Illuminant => sensors.emitted_weights(grid)?,
            SpectrumKind::Reflectance => {
                let scale = self.response_scale.unwrap_or_default();
                sensors.reflected_weights(&self.light(grid)?, grid, scale)?
            }
        })
    }
}

/// Makes the outputs of a program of these weights, each quantity once and in their order.
pub(crate) fn outputs(
    asked: &OutputRequest,
    model: &Model,
    program: &Program,
    weights: &Affine,
) -> Result<Vec<Output>, RecipeError> {
    let mut quantities = asked.quantities.clone();
    quantities.sort_unstable();
    quantities.dedup();
    if quantities.is_empty() {
        return Err(RecipeError::Nothing);
    }
    asked.check(model.kind())?;
    let output = |quantity| {
        let source = source(quantity, asked, model, program, weights)?;
        let width = match &source {
            Source::Spectrum => program.bands(),
            Source::Map(map, _) => map.offset.len(),
            Source::Intensity | Source::TargetLrv | Source::Status => 1,
        };
        let dtype = match quantity {
            Quantity::Spectra => asked.spectra,
            Quantity::Attempts => Dtype::U32,
            _ => Dtype::F32,
        };
        let layout = match quantity {
            Quantity::Lrv | Quantity::Attempts | Quantity::Intensity => Layout::Rows,
            _ => asked.layout,
        };
        Ok(Output { format: ArrayFormat { quantity, dtype, width, layout }, source })
    };
    quantities.into_iter().map(output).collect()
}

fn source(
    quantity: Quantity,
    asked: &OutputRequest,
    model: &Model,
    program: &Program,
    weights: &Affine,
) -> Result<Source, RecipeError> {
    let unless = |reason| RecipeError::Quantity { quantity, reason };
    let scaled = if program.scales() { Unit::Scale } else { Unit::One };
    let k = program.components();
    Ok(match quantity {
        Quantity::Spectra => Source::Spectrum,
        Quantity::Weights => Source::Map(weights.clone(), Unit::One),
        Quantity::Xyz | Quantity::LinearSrgb => {
            let xyz = program.spectrum.project(&xyz_weights(asked, model)?);
            let unit = match (model.kind(), asked.xyz_scale.unwrap_or_default()) {
                (SpectrumKind::Illuminant, XyzScale::UnitY) => Unit::Over(xyz.value(1)),
                _ => scaled,
            };
            let map = if quantity == Quantity::Xyz { xyz } else { xyz.project(&colorimetry::XYZ_TO_SRGB) };
            Source::Map(map, unit)
        }
        Quantity::Chromaticity => {
            let grid = model.grid();
            colorimetry::lrv_weights(grid).ok_or(RecipeError::Invisible(grid.clone()))?;
            let xyz = program.spectrum.project(&xyz_weights(asked, model)?);
            let sum = xyz.project(&[[1.0; 3]]);
            Source::Map(xyz.project(&[[1.0, 0.0, 0.0], [0.0, 1.0, 0.0]]), Unit::Over(sum))
        }
        Quantity::Lrv => match (&program.target, asked.aim, model.kind()) {
            (_, _, SpectrumKind::Illuminant) => {
                return Err(unless("illuminants have no luminous reflectance"));
            }
            (Some(target), Aim::Lrv, _) => match target.lrv {
                LrvLaw::Fixed(lrv) => Source::Map(Affine::constant(lrv, k), Unit::One),
                LrvLaw::Uniform { .. } => Source::TargetLrv,
            },
            _ => {
                let [_, y, _] = asked.reflected_xyz_weights(model.grid())?;
                Source::Map(program.spectrum.project(&[y]), scaled)
            }
        },
        Quantity::Responses => {
            let sensors = asked.sensors.as_ref();
            let sensors = sensors.ok_or(unless("it needs a set of sensors, and the recipe has none"))?;
            Source::Map(
                program.spectrum.project(&asked.response_weights(sensors, model.kind(), model.grid())?),
                scaled,
            )
        }
        Quantity::ColorSignal => {
            return Err(unless("it is of surfaces in scenes, under the lights of each"));
        }
        Quantity::Attempts => Source::Status,
        Quantity::Intensity => match (&program.intensity, asked.fixed) {
            (Some(_), _) => Source::Intensity,
            (None, Some(intensity)) => Source::Map(Affine::constant(intensity, k), Unit::One),
            (None, None) => return Err(unless("it needs an intensity, and the recipe has none")),
        },
    })
}

/// The weights of the bands in X, Y and Z.
fn xyz_weights(asked: &OutputRequest, model: &Model) -> Result<[Vec<f64>; 3], RecipeError> {
    match model.kind() {
        SpectrumKind::Illuminant => Ok(asked.observer().emitted_xyz_weights(model.grid())),
        SpectrumKind::Reflectance => asked.reflected_xyz_weights(model.grid()),
    }
}
