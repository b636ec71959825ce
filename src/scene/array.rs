//! Arrays that a scene gives: their names, extents and types.

use serde::Serialize;

use crate::program::Bounds;
use crate::quantity::{Dtype, Quantity, ValueRange};
use crate::sensors::Sensors;

use super::group::{Base, Group, IntensityScope, TargetConstraint, Targets};
use super::plan::{GroupKind, Shapes};

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
    /// The extents of an entry. Spectra have (count, bands), and other quantities one of them or none; what is seen under
    /// the lights of the scene has the number of lights before these.
    pub shape: Vec<usize>,
    /// The group of lights that it is seen under.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub under: Option<String>,
    /// Names of the values along the last axis, where each has one of its own.
    #[serde(skip)]
    pub channels: Vec<String>,
    /// Range of its values, if they are spectra.
    #[serde(skip)]
    pub range: Option<ValueRange>,
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

/// Whether an intensity multiplies a quantity of lights.
pub(super) fn is_multiplied(quantity: Quantity) -> bool {
    matches!(quantity, Quantity::Spectra | Quantity::Xyz | Quantity::LinearSrgb | Quantity::Responses)
}

/// Intensities of a group.
#[derive(Clone, Copy, PartialEq)]
pub(super) enum Intensities {
    None,
    /// One number for all lights of all scenes.
    Fixed,
    Varying(IntensityScope),
}

/// The arrays that a group gives, of so many bands, where it is seen under these lights.
pub(super) fn arrays(
    group: &Group,
    shapes: &Shapes,
    (intensities, lights): (Intensities, Option<&Base>),
    bands: usize,
) -> Vec<Array> {
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
        name: match quantity {
            Quantity::Spectra => base.name.clone(),
            quantity => format!("{}_{quantity}", base.name),
        },
        group: base.name.clone(),
        kind,
        quantity,
        per_scene,
        shape: shape.to_vec(),
        under: None,
        channels: quantity.channels().iter().map(|&name| name.to_owned()).collect(),
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
    let channels: Vec<String> = base.viewing.sensors.iter().flat_map(Sensors::channels).cloned().collect();
    if base.wants(Quantity::Responses) {
        let per_scene = lights.is_some() || !once || varies;
        let shape: Vec<usize> =
            lights.iter().map(|lights| lights.count as usize).chain([count, channels.len()]).collect();
        let under = lights.map(|lights| lights.name.clone());
        arrays.push(Array { under, channels, ..array(Quantity::Responses, per_scene, &shape) });
    }
    if let Some(lights) = lights.filter(|_| base.wants(Quantity::ColorSignal)) {
        let under = Some(lights.name.clone());
        let range = Some(ValueRange::Positive);
        let shape = [lights.count as usize, count, bands];
        arrays.push(Array { under, range, ..array(Quantity::ColorSignal, true, &shape) });
    }
    if !flat {
        arrays.push(array(Quantity::Attempts, !once, &[count]));
    }
    arrays
}
