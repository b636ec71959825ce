//! Outputs of a program from the quantities that a recipe asks for: each as a map of the normals, folded in f64.

use super::{Illuminant, RecipeError, XyzScale};
use crate::affine::Affine;
use crate::colorimetry;
use crate::dataset::SpectrumKind;
use crate::model::Model;
use crate::program::{LrvLaw, Output, Program, Source, Unit};
use crate::quantity::{ArrayFormat, Dtype, Layout, Quantity};

/// Quantities that a recipe asks for, and their settings.
#[derive(Clone, Debug)]
pub(crate) struct OutputRequest {
    pub(crate) quantities: Vec<Quantity>,
    pub(crate) layout: Layout,
    /// The type of spectra.
    pub(crate) spectra: Dtype,
    /// The illuminant of reflectances, if it is not D65.
    pub(crate) illuminant: Option<Illuminant>,
    pub(crate) xyz_scale: Option<XyzScale>,
    /// The intensity of every draw, where it is the same.
    pub(crate) fixed: Option<f64>,
}

impl Default for OutputRequest {
    fn default() -> Self {
        OutputRequest {
            quantities: vec![Quantity::Spectra],
            layout: Layout::default(),
            spectra: Dtype::F32,
            illuminant: None,
            xyz_scale: None,
            fixed: None,
        }
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
    let has_colours = quantities.iter().any(|quantity| Quantity::COLOURS.contains(quantity));
    // A chromaticity is the same in every scale.
    let has_scaled = quantities.iter().any(|q| matches!(q, Quantity::Xyz | Quantity::LinearSrgb));
    if asked.illuminant.is_some() && !(has_colours && model.kind() == SpectrumKind::Reflectance) {
        let (setting, needs) = (
            "an illuminant for reflectances",
            "the quantity xyz, chromaticity or linear_srgb of reflectances",
        );
        return Err(RecipeError::Pointless { setting, needs });
    }
    if asked.xyz_scale.is_some() && !(has_scaled && model.kind() == SpectrumKind::Illuminant) {
        let (setting, needs) =
            ("a scale of tristimulus values", "the quantity xyz or linear_srgb of illuminants");
        return Err(RecipeError::Pointless { setting, needs });
    }
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
        Quantity::Lrv => match (&program.target, model.kind()) {
            (_, SpectrumKind::Illuminant) => {
                return Err(unless("illuminants have no luminous reflectance"));
            }
            (Some(target), _) => match target.lrv {
                LrvLaw::Fixed(lrv) => Source::Map(Affine::constant(lrv, k), Unit::One),
                LrvLaw::Uniform { .. } => Source::TargetLrv,
            },
            (None, _) => {
                let grid = model.grid();
                let weights = colorimetry::lrv_weights(grid).ok_or(RecipeError::Invisible(grid.clone()))?;
                Source::Map(program.spectrum.project(&[weights]), Unit::One)
            }
        },
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
    let grid = model.grid();
    if model.kind() == SpectrumKind::Illuminant {
        return Ok(colorimetry::emitted_xyz_weights(grid));
    }
    let power = match asked.illuminant.as_ref().unwrap_or(&Illuminant::D65) {
        Illuminant::D65 => return colorimetry::xyz_weights(grid).ok_or(RecipeError::Invisible(grid.clone())),
        Illuminant::A => colorimetry::illuminant_a(grid),
        Illuminant::E => vec![1.0; grid.len()],
        Illuminant::Power(power) => power.clone(),
    };
    if power.len() != grid.len() {
        return Err(RecipeError::Light { found: power.len(), expected: grid.len() });
    }
    if !power.iter().all(|power| power.is_finite() && *power >= 0.0) {
        return Err(RecipeError::DarkLight);
    }
    colorimetry::xyz_weights_under(&power, grid).ok_or(RecipeError::DarkLight)
}
