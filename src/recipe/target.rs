//! Targets: the response that every spectrum is scaled to.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::Lrv;
use crate::sensors::Sensors;

/// Response of one sensor that every reflectance is scaled to, as a luminous reflectance is, under the recipe's
/// illuminant; 1 for a perfect white. See [`RecipeBuilder::target`](crate::RecipeBuilder::target).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ResponseTarget {
    /// Set that the sensor is of.
    pub sensors: Sensors,
    /// Name of the sensor in its set.
    pub channel: String,
    /// The response: one for all draws, or one of its own for each.
    pub response: Lrv,
}

impl ResponseTarget {
    /// Makes the target of a channel of a set.
    pub fn new(sensors: Sensors, channel: &str, response: impl Into<Lrv>) -> ResponseTarget {
        ResponseTarget { sensors, channel: channel.to_owned(), response: response.into() }
    }

    /// Name of the sensor in messages, such as `ss2.L`.
    pub(super) fn sensor(&self) -> String {
        format!("{}.{}", self.sensors.name(), self.channel)
    }
}

impl fmt::Display for ResponseTarget {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}={}", self.sensor(), self.response)
    }
}
