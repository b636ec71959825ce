//! Targets that spectra are scaled to.

use super::RecipeBuilder;
use crate::dataset::SpectrumKind;
use crate::program::{LrvLaw, LrvTarget};
use crate::recipe::{Lrv, RecipeError, ResponseTarget};
use crate::sensors::{ResponseScale, SensorError};

impl RecipeBuilder {
    /// The target that spectra are scaled to.
    pub(super) fn scaling(&self) -> Result<Option<LrvTarget>, RecipeError> {
        let bounds = self.bounds.unwrap_or_default();
        match (self.lrv, &self.target) {
            (None, None) => Ok(None),
            (Some(_), Some(target)) => Err(RecipeError::TwoTargets { sensor: target.sensor() }),
            (Some(lrv), None) => {
                let law = law(lrv, RecipeError::Lrv, |low, high| RecipeError::LrvRange { low, high })?;
                if self.model.kind() == SpectrumKind::Illuminant {
                    return Err(RecipeError::LrvOfIlluminant);
                }
                let [_, weights, _] = self.outputs.reflected_xyz_weights(self.model.grid())?;
                Ok(Some(LrvTarget { lrv: law, weights, bounds }))
            }
            (None, Some(target)) => {
                let sensor = || target.sensor();
                let law = law(
                    target.response,
                    |response| RecipeError::Response { sensor: sensor(), response },
                    |low, high| RecipeError::ResponseRange { sensor: sensor(), low, high },
                )?;
                if self.model.kind() == SpectrumKind::Illuminant {
                    return Err(RecipeError::ResponseOfIlluminant { sensor: sensor() });
                }
                Ok(Some(LrvTarget { lrv: law, weights: self.response_weights(target)?, bounds }))
            }
        }
    }

    /// The weights of the bands in the response that is aimed at.
    fn response_weights(&self, target: &ResponseTarget) -> Result<Vec<f64>, RecipeError> {
        let grid = self.model.grid();
        let channel = target.sensors.channel(&target.channel)?;
        let light = self.outputs.light(grid)?;
        let mut weights = target.sensors.reflected_weights(&light, grid, ResponseScale::White)?;
        let weights = weights.swap_remove(channel);
        // Where a weight is negative, a spectrum that is positive may have a response that no factor takes to the target.
        if let Some(band) = weights.iter().position(|weight| *weight < 0.0) {
            return Err(RecipeError::from(SensorError::Negative {
                name: target.sensors.name().to_owned(),
                channel: target.channel.clone(),
                wavelength: grid.wavelength(band),
            }));
        }
        Ok(weights)
    }
}

/// The law of a target, if its values are those of one.
fn law(
    target: Lrv,
    value: impl Fn(f64) -> RecipeError,
    range: impl Fn(f64, f64) -> RecipeError,
) -> Result<LrvLaw, RecipeError> {
    // Far below, spectra would round to 0; just below 1, to 1.
    let check = |target: f64| match (1e-30..1.0).contains(&f64::from(target as f32)) {
        true => Ok(target),
        false => Err(value(target)),
    };
    match target {
        Lrv::Fixed(fixed) => Ok(LrvLaw::Fixed(check(fixed)?)),
        Lrv::Uniform(low, high) if check(low)? < check(high)? => Ok(LrvLaw::uniform(low, high)),
        Lrv::Uniform(low, high) => Err(range(low, high)),
    }
}
