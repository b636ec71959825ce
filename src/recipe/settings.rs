//! Settings of a recipe, in a form that can be written down and read back.

use serde::{Deserialize, Serialize};

use super::{
    DEFAULT_MAX_ATTEMPTS, Intensity, Lrv, ProposalKind, Recipe, RecipeBuilder, ResponseTarget, XyzScale,
};
use crate::colorimetry::{Illuminant, Observer};
use crate::model::Model;
use crate::program::Bounds;
use crate::quantity::Quantity;
use crate::sensors::{ResponseScale, Sensors};

/// Everything that distinguishes the draws of a recipe from other draws of the same model. Data sets record it under
/// `recipe`, so the serialised names are part of their format.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecipeSettings {
    /// The target luminous reflectance (LRV).
    pub lrv: Option<Lrv>,
    /// The target tristimulus values, of the observer and under the illuminant.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub xyz: Option<[f64; 3]>,
    /// The target response of a sensor.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub target: Option<ResponseTarget>,
    /// The sensors whose responses each draw is given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub given: Option<Sensors>,
    /// Spectrum that must lie between 0 and 1 where there is a target LRV.
    pub bounds: Bounds,
    /// The factor of the weights' covariance.
    #[serde(rename = "cov_scale")]
    pub covariance_scale: f64,
    /// Factor of illuminants.
    pub intensity: Option<Intensity>,
    /// The quantities of each draw.
    pub quantities: Vec<Quantity>,
    /// The illuminant of reflectances' responses, XYZ, chromaticity, linear sRGB and LRV, and of targets.
    pub illuminant: Illuminant,
    /// The observer of XYZ, chromaticity, linear sRGB and LRV, and of their targets.
    #[serde(default, skip_serializing_if = "is_default")]
    pub observer: Observer,
    /// The sensors of responses.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sensors: Option<Sensors>,
    /// The scale of responses; `None` is relative to white for reflectances, and absolute for illuminants.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub response_scale: Option<ResponseScale>,
    /// The scale of illuminants' XYZ and linear sRGB.
    pub xyz_scale: XyzScale,
    /// Source of candidates, as it was asked for.
    pub proposal: ProposalKind,
    /// The most candidates that a draw may take.
    pub max_attempts: u32,
}

impl Default for RecipeSettings {
    fn default() -> Self {
        RecipeSettings {
            lrv: None,
            xyz: None,
            target: None,
            given: None,
            bounds: Bounds::default(),
            covariance_scale: 1.0,
            intensity: None,
            quantities: vec![Quantity::Spectra],
            illuminant: Illuminant::default(),
            observer: Observer::default(),
            sensors: None,
            response_scale: None,
            xyz_scale: XyzScale::default(),
            proposal: ProposalKind::default(),
            max_attempts: DEFAULT_MAX_ATTEMPTS,
        }
    }
}

impl RecipeSettings {
    /// Starts a recipe of a model with these settings. A setting that would change nothing for this model is an error
    /// of [`RecipeBuilder::build`] only where it differs from its default.
    pub fn builder(&self, model: &Model) -> RecipeBuilder {
        let default = RecipeSettings::default();
        let mut builder = Recipe::builder(model)
            .covariance_scale(self.covariance_scale)
            .max_attempts(self.max_attempts)
            .quantities(self.quantities.iter().copied())
            .proposal(self.proposal);
        if let Some(lrv) = self.lrv {
            builder = builder.lrv(lrv);
        }
        if let Some(target) = &self.target {
            builder = builder.target(target.clone());
        }
        if let Some(sensors) = &self.given {
            builder = builder.given(sensors.clone());
        }
        if self.lrv.is_some() || self.target.is_some() || self.bounds != default.bounds {
            builder = builder.bounds(self.bounds);
        }
        if let Some(xyz) = self.xyz {
            builder = builder.xyz(xyz);
        }
        if let Some(intensity) = self.intensity {
            builder = builder.intensity(intensity);
        }
        if self.illuminant != default.illuminant {
            builder = builder.illuminant(self.illuminant.clone());
        }
        if self.observer != default.observer {
            builder = builder.observer(self.observer);
        }
        if let Some(sensors) = &self.sensors {
            builder = builder.sensors(sensors.clone());
        }
        if let Some(scale) = self.response_scale {
            builder = builder.response_scale(scale);
        }
        if self.xyz_scale != default.xyz_scale {
            builder = builder.xyz_scale(self.xyz_scale);
        }
        builder
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// A target LRV as it is written: a number, or `{"uniform": [low, high]}`.
#[derive(Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub(super) enum LrvRecord {
    Fixed(f64),
    Uniform { uniform: (f64, f64) },
}

impl From<LrvRecord> for Lrv {
    fn from(record: LrvRecord) -> Lrv {
        match record {
            LrvRecord::Fixed(lrv) => Lrv::Fixed(lrv),
            LrvRecord::Uniform { uniform: (low, high) } => Lrv::Uniform(low, high),
        }
    }
}

impl From<Lrv> for LrvRecord {
    fn from(lrv: Lrv) -> LrvRecord {
        match lrv {
            Lrv::Fixed(lrv) => LrvRecord::Fixed(lrv),
            Lrv::Uniform(low, high) => LrvRecord::Uniform { uniform: (low, high) },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Names that `verify` reads in sets of earlier runs.
    #[test]
    fn serialised_names_stay() {
        let plain = serde_json::to_string(&RecipeSettings::default()).unwrap();
        assert_eq!(
            plain,
            r#"{"lrv":null,"bounds":"base","cov_scale":1.0,"intensity":null,"quantities":["spectra"],"illuminant":"d65","xyz_scale":"absolute","proposal":"auto","max_attempts":65000}"#
        );
        let other = RecipeSettings {
            lrv: Some(Lrv::Fixed(0.4)),
            xyz: Some([0.1, 0.2, 0.3]),
            bounds: Bounds::Both,
            intensity: Some(Intensity::LogUniform(0.15, 150.0)),
            quantities: Quantity::ALL.to_vec(),
            illuminant: Illuminant::Power(vec![1.0, 2.0]),
            xyz_scale: XyzScale::UnitY,
            proposal: ProposalKind::Cover,
            target: Some(ResponseTarget::new(Sensors::builtin("ss2").unwrap(), "L", 0.2..0.6)),
            observer: Observer::Cie1964,
            sensors: Some(Sensors::new("own", ["a"], &[500.0, 600.0], &[vec![0.0, 1.0]]).unwrap()),
            response_scale: Some(ResponseScale::Absolute),
            ..RecipeSettings::default()
        };
        let text = serde_json::to_string(&other).unwrap();
        for name in [
            "\"lrv\":0.4,",
            "\"both\"",
            "{\"loguniform\":[0.15,150.0]}",
            "linear_srgb",
            "{\"power\":[1.0,2.0]}",
            "\"unit-y\"",
            r#""target":{"sensors":"ss2","channel":"L","response":{"uniform":[0.2,0.6]}}"#,
            r#""observer":"cie1964""#,
            r#""sensors":{"name":"own","channels":["a"],"wavelengths":[500.0,600.0],"functions":[[0.0,1.0]]}"#,
            r#""response_scale":"absolute""#,
        ] {
            assert!(text.contains(name), "{name} in {text}");
        }
        assert_eq!(serde_json::from_str::<RecipeSettings>(&text).unwrap(), other);
        let ranged = RecipeSettings { lrv: Some(Lrv::Uniform(0.2, 0.6)), ..RecipeSettings::default() };
        let text = serde_json::to_string(&ranged).unwrap();
        assert_eq!(text, plain.replace("null,\"bounds", "{\"uniform\":[0.2,0.6]},\"bounds"));
        assert_eq!(serde_json::from_str::<RecipeSettings>(&text).unwrap(), ranged);
        let named = |illuminant: Illuminant| serde_json::to_string(&illuminant).unwrap();
        assert_eq!(
            named(Illuminant::Daylight(5600.0)) + &named(Illuminant::F11),
            "{\"daylight\":5600.0}\"f11\""
        );
        let simple = |intensity| serde_json::to_string(&intensity).unwrap();
        assert_eq!(simple(Intensity::Data) + &simple(Intensity::Fixed(2.0)), r#""data"{"fixed":2.0}"#);
    }
}
