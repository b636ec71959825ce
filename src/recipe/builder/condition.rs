//! Weights whose tristimulus values or responses are given.

use super::RecipeBuilder;
use crate::affine::Affine;
use crate::dataset::SpectrumKind;
use crate::model::Distribution;
use crate::program::Program;
use crate::program::condition::Condition;
use crate::program::feasibility::{self, Room};
use crate::recipe::pilot::{TOLERABLE_FAILURE, failure, pilot};
use crate::recipe::{ProposalKind, RecipeError};
use crate::sensors::{ResponseScale, Sensors};

impl RecipeBuilder {
    /// The program of the model's own Gaussian, and the map of the responses that draws are given.
    pub(crate) fn free(&self) -> Result<(Program, Affine), RecipeError> {
        let weights = self.model.weight_map(self.covariance_scale);
        let sensors = self.given.as_ref().expect("the recipe gives draws responses");
        Ok((Program::new(&self.model, &weights), self.responses(sensors, &weights)?))
    }

    /// The map of the responses of sensors that draws are given.
    pub(super) fn responses(&self, sensors: &Sensors, weights: &Affine) -> Result<Affine, RecipeError> {
        let others = [
            ("a target luminous reflectance", self.lrv.is_some()),
            ("a target response", self.target.is_some()),
            ("target tristimulus values", self.xyz.is_some()),
            ("an intensity", self.intensity.is_some()),
            ("a cover", self.proposal == ProposalKind::Cover),
        ];
        if let Some((other, _)) = others.into_iter().find(|(_, is_set)| *is_set) {
            return Err(RecipeError::GivenAnd { other });
        }
        if *self.model.distribution() != Distribution::Gaussian {
            let (name, other) = (self.model.distribution().name(), "responses that each draw is given");
            return Err(RecipeError::CentresAnd { name, other });
        }
        let grid = self.model.grid();
        let seen = match self.model.kind() {
            SpectrumKind::Illuminant => sensors.emitted_weights(grid)?,
            SpectrumKind::Reflectance => {
                sensors.reflected_weights(&self.outputs.light(grid)?, grid, ResponseScale::White)?
            }
        };
        Ok(Program::new(&self.model, weights).spectrum.project(&seen))
    }

    pub(super) fn too_few_directions(&self, sensors: &Sensors) -> RecipeError {
        let (name, channels) = (sensors.name().to_owned(), sensors.len());
        RecipeError::TooFewToGive { name, channels, components: self.model.components() }
    }

    /// Effect of the given tristimulus values on this model.
    pub(crate) fn condition(&self, weights: &Affine) -> Result<Condition, RecipeError> {
        if self.model.kind() == SpectrumKind::Illuminant {
            return Err(RecipeError::XyzOfIlluminant);
        }
        if self.lrv.is_some() || self.target.is_some() {
            return Err(RecipeError::XyzAndLrv);
        }
        let (_, map) = self.seen(weights)?;
        Condition::new(&map).ok_or(RecipeError::TooFewDirections)
    }

    /// The program without a target, and the map of its tristimulus values.
    fn seen(&self, weights: &Affine) -> Result<(Program, Affine), RecipeError> {
        let seen = self.outputs.reflected_xyz_weights(self.model.grid())?;
        let program = Program::new(&self.model, weights);
        let xyz = program.spectrum.project(&seen);
        Ok((program, xyz))
    }

    /// The nearest tristimulus values that can be drawn. The very nearest leave no room for a spectrum to vary in, so
    /// these are a little of the way from there to those of the mean.
    pub(super) fn nearest(&self, xyz: [f64; 3]) -> Option<[f64; 3]> {
        let weights = self.model.weight_map(self.covariance_scale);
        let (program, map) = self.seen(&weights).ok()?;
        let nearest = feasibility::nearest(&program, &map, &xyz)?;
        let steps = (0..16).map(|doublings| 1e-4 * f64::from(1 << doublings)).take_while(|&part| part < 1.0);
        let inwards = |part| [0, 1, 2].map(|i| nearest[i] + part * (map.offset[i] - nearest[i]));
        let rounded = steps.map(inwards).map(|xyz| xyz.map(|v| (v * 1e4).round() / 1e4));
        let condition = self.condition(&weights).ok()?;
        rounded.into_iter().find(|&xyz| {
            let program = Program::new(&self.model, &condition.given(&xyz, &weights));
            !matches!(feasibility::room(&feasibility::half_spaces(&program)), Room::None { .. })
                && failure(pilot(&program), self.max_attempts) <= TOLERABLE_FAILURE
        })
    }
}
