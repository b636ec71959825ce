//! Groups of a scene: illuminants, surfaces and targets.

use crate::colorimetry::{Illuminant, Observer};
use crate::model::Model;
use crate::program::Bounds;
use crate::quantity::Quantity;
use crate::recipe::{DEFAULT_MAX_ATTEMPTS, Intensity};
use crate::sensors::{ResponseScale, Sensors};

/// Settings that groups of all kinds have.
#[derive(Clone, Debug)]
pub(super) struct Base {
    pub(super) name: String,
    /// None where nothing is drawn from one.
    pub(super) model: Option<Model>,
    pub(super) count: u64,
    pub(super) covariance_scale: f64,
    pub(super) max_attempts: u32,
    pub(super) quantities: Vec<Quantity>,
    pub(super) viewing: Viewing,
}

/// Settings of what is seen of a group's spectra.
#[derive(Clone, Debug, Default)]
pub(super) struct Viewing {
    /// Sensors of responses.
    pub(super) sensors: Option<Sensors>,
    pub(super) response_scale: Option<ResponseScale>,
    /// Observer of XYZ, chromaticity, linear sRGB and LRV, where it is not that of 1931.
    pub(super) observer: Option<Observer>,
    /// Illuminant of reflectances, where it is not D65.
    pub(super) illuminant: Option<Illuminant>,
    /// Name of the group of lights that responses and color signals are under.
    pub(super) under: Option<String>,
}

/// The quantities that a group can be asked for.
pub(super) const QUANTITIES: [Quantity; 6] = [
    Quantity::Spectra,
    Quantity::Xyz,
    Quantity::Chromaticity,
    Quantity::LinearSrgb,
    Quantity::Responses,
    Quantity::ColorSignal,
];

/// Lights, so many in each scene.
#[derive(Clone, Debug)]
pub struct Illuminants {
    pub(super) base: Base,
    pub(super) fixed: bool,
    pub(super) intensity: Option<(Intensity, IntensityScope)>,
    pub(super) mean: Option<Vec<f64>>,
    pub(super) same_shape: bool,
}

/// Group of reflectances, with their number in each scene.
#[derive(Clone, Debug)]
pub struct Surfaces {
    pub(super) base: Base,
    pub(super) fixed: bool,
}

/// Group of reflectances with a constraint, such as a luminous reflectance.
#[derive(Clone, Debug)]
pub struct Targets {
    pub(super) base: Base,
    pub(super) aim: TargetConstraint,
    pub(super) bounds: Bounds,
    pub(super) copies: Copies,
}

/// A group of any kind.
#[derive(Clone, Debug)]
pub enum Group {
    /// Lights.
    Illuminants(Illuminants),
    /// Reflectances.
    Surfaces(Surfaces),
    /// Reflectances with a constraint.
    Targets(Targets),
}

/// Scope of an intensity.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IntensityScope {
    /// Each light has its own.
    Light,
    /// The lights of a scene have the same.
    Scene,
}

/// Constraint on a target.
#[derive(Clone, Debug, PartialEq)]
pub enum TargetConstraint {
    /// Luminous reflectance (LRV: CIE Y of the 1931 2 degree observer under D65, perfect white = 1), to which the
    /// spectrum is scaled (eq. 9, 10).
    Lrv(LrvLevels),
    /// The tristimulus values under D65, where a perfect white has Y = 1: see
    /// [`RecipeBuilder::xyz`](crate::RecipeBuilder::xyz).
    Xyz([f64; 3]),
    /// Tristimulus values under D65 by hue.
    Hue(Hue),
    /// All: the spectrum is its LRV in every band.
    Flat(LrvLevels),
}

/// Luminous reflectance values.
#[derive(Clone, Debug, PartialEq)]
pub enum LrvLevels {
    /// These levels in turn: scene s has number s modulo their number.
    Each(Vec<f64>),
    /// For each target its own, uniform between these.
    Uniform(f64, f64),
}

/// Colours in the hexcone of HSV, whose red, green and blue are linear Rec. 709 components here.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hue {
    /// Number of hues, at equal steps from red on: scene s has number s modulo this.
    pub levels: u32,
    /// The saturation of each target is uniform between these.
    pub saturation: (f64, f64),
    /// And its lightness (the value of HSV) between these.
    pub lightness: (f64, f64),
}

/// Relation of the targets of different levels.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Copies {
    /// Nothing: each is a draw of its own.
    #[default]
    Independent,
    /// The scenes of one round through the levels have one spectrum, scaled to each. A candidate is accepted only if
    /// all its copies are within bounds, that is, if the lightest is. (The authors' code scales what it accepted at
    /// another level, and lets some through that are not.)
    Scaled,
    /// All scenes have one spectrum, scaled to each level; accepted as the others.
    SameShape,
}

impl LrvLevels {
    /// `levels` values at equal steps, `from` and `to` included; one level is `from`.
    pub fn even(from: f64, to: f64, levels: u32) -> LrvLevels {
        let step = (to - from) / f64::from(levels.saturating_sub(1).max(1));
        LrvLevels::Each((0..levels).map(|level| from + step * f64::from(level)).collect())
    }

    /// Level of a scene, where `uniform` is between 0 and 1.
    pub(super) fn at(&self, scene: u64, uniform: impl FnOnce() -> f64) -> f64 {
        match self {
            LrvLevels::Each(levels) => levels[(scene % levels.len() as u64) as usize],
            LrvLevels::Uniform(low, high) => low + (high - low) * uniform(),
        }
    }

    /// The largest.
    pub(super) fn largest(&self) -> f64 {
        match self {
            LrvLevels::Each(levels) => levels.iter().fold(0.0, |a: f64, &b| a.max(b)),
            LrvLevels::Uniform(_, to) => *to,
        }
    }
}

impl From<f64> for LrvLevels {
    fn from(level: f64) -> LrvLevels {
        LrvLevels::Each(vec![level])
    }
}

macro_rules! base {
    ($group:ident) => {
        impl $group {
            /// Multiplies the covariance of the model's weights.
            pub fn covariance_scale(mut self, covariance_scale: f64) -> Self {
                self.base.covariance_scale = covariance_scale;
                self
            }

            /// Sets the largest number of candidates of a draw ([`DEFAULT_MAX_ATTEMPTS`]).
            pub fn max_attempts(mut self, max_attempts: u32) -> Self {
                self.base.max_attempts = max_attempts;
                self
            }

            /// The quantities to give an array each, of spectra, XYZ, chromaticity, linear sRGB, responses and, of
            /// reflectances, color signals ([`Quantity::Spectra`]): of reflectances under D65 unless
            /// [`illuminant`](Self::illuminant) says otherwise, where a perfect white has Y = 1; of illuminants
            /// their own ([`XyzScale::Absolute`](crate::XyzScale::Absolute)), intensity included. What else describes
            /// a group, such as its intensities, always comes along.
            pub fn quantities(mut self, quantities: impl IntoIterator<Item = Quantity>) -> Self {
                self.base.quantities = quantities.into_iter().collect();
                self
            }

            /// Sets the sensors of [`Quantity::Responses`].
            pub fn sensors(mut self, sensors: Sensors) -> Self {
                self.base.viewing.sensors = Some(sensors);
                self
            }

            /// Sets the scale of responses: of reflectances relative to a perfect white, and under the lights of a scene
            /// absolute, unless set; of illuminants always absolute.
            pub fn response_scale(mut self, scale: ResponseScale) -> Self {
                self.base.viewing.response_scale = Some(scale);
                self
            }

            /// Sets the observer of XYZ, chromaticity, linear sRGB and luminous reflectance ([`Observer::Cie1931`]).
            pub fn observer(mut self, observer: Observer) -> Self {
                self.base.viewing.observer = Some(observer);
                self
            }

            /// Sets the illuminant of what is seen of reflectances, and of their targets ([`Illuminant::D65`]).
            pub fn illuminant(mut self, illuminant: Illuminant) -> Self {
                self.base.viewing.illuminant = Some(illuminant);
                self
            }
        }

        impl From<$group> for Group {
            fn from(group: $group) -> Group {
                Group::$group(group)
            }
        }
    };
}

base!(Illuminants);
base!(Surfaces);
base!(Targets);

impl Illuminants {
    /// `count` lights a scene.
    pub fn new(name: &str, model: &Model, count: u64) -> Illuminants {
        let base = Base::new(name, Some(model), count);
        Illuminants { base, fixed: false, intensity: None, mean: None, same_shape: false }
    }

    /// Draws the spectra once for all scenes. Intensities still differ from scene to scene.
    pub fn fixed(self) -> Self {
        Illuminants { fixed: true, ..self }
    }

    /// Multiplies the lights. The scope of one number for all is of no account.
    pub fn intensity(self, intensity: Intensity, scope: IntensityScope) -> Self {
        Illuminants { intensity: Some((intensity, scope)), ..self }
    }

    /// Replaces the mean spectrum of the model by this, a value a band in any unit: it is scaled to the mean power of
    /// the model's.
    pub fn mean(self, spectrum: &[f64]) -> Self {
        Illuminants { mean: Some(spectrum.to_vec()), ..self }
    }

    /// Gives all lights of a scene one spectrum.
    pub fn same_shape(self) -> Self {
        Illuminants { same_shape: true, ..self }
    }
}

macro_rules! under {
    ($group:ident) => {
        impl $group {
            /// Gives responses and color signals under each of the lights of a group of the same scene: arrays of (light,
            /// element, sensor) and (light, element, band).
            pub fn under(mut self, lights: &str) -> Self {
                self.base.viewing.under = Some(lights.to_owned());
                self
            }
        }
    };
}

under!(Surfaces);
under!(Targets);

impl Surfaces {
    /// `count` reflectances a scene.
    pub fn new(name: &str, model: &Model, count: u64) -> Surfaces {
        Surfaces { base: Base::new(name, Some(model), count), fixed: false }
    }

    /// Draws them once for all scenes.
    pub fn fixed(self) -> Self {
        Surfaces { fixed: true, ..self }
    }
}

impl Targets {
    /// One target a scene, drawn from a model.
    pub fn new(name: &str, model: &Model, aim: TargetConstraint) -> Targets {
        let base = Base::new(name, Some(model), 1);
        Targets { base, aim, bounds: Bounds::default(), copies: Copies::default() }
    }

    /// One target a scene, the same in every band.
    pub fn flat(name: &str, levels: LrvLevels) -> Targets {
        let base = Base::new(name, None, 1);
        Targets {
            base,
            aim: TargetConstraint::Flat(levels),
            bounds: Bounds::default(),
            copies: Copies::default(),
        }
    }

    /// `count` targets a scene.
    pub fn count(mut self, count: u64) -> Self {
        self.base.count = count;
        self
    }

    /// Sets the spectrum that must lie between 0 and 1 where there is a target LRV.
    pub fn bounds(self, bounds: Bounds) -> Self {
        Targets { bounds, ..self }
    }

    /// Sets the relation of the targets of different levels.
    pub fn copies(self, copies: Copies) -> Self {
        Targets { copies, ..self }
    }
}

impl Base {
    pub(super) fn new(name: &str, model: Option<&Model>, count: u64) -> Base {
        Base {
            name: name.to_owned(),
            model: model.cloned(),
            count,
            covariance_scale: 1.0,
            max_attempts: DEFAULT_MAX_ATTEMPTS,
            quantities: vec![Quantity::Spectra],
            viewing: Viewing::default(),
        }
    }

    pub(super) fn wants(&self, quantity: Quantity) -> bool {
        self.quantities.contains(&quantity)
    }
}

impl Group {
    pub(super) fn base(&self) -> &Base {
        match self {
            Group::Illuminants(group) => &group.base,
            Group::Surfaces(group) => &group.base,
            Group::Targets(group) => &group.base,
        }
    }
}
