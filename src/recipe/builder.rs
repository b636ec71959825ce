//! Construction of recipes, and the checks that they can be drawn.

mod condition;
mod proposal;
mod target;

pub(super) use proposal::OWN_TARGETS;

use super::outputs::{Aim, OutputRequest, outputs};
use super::{
    DEFAULT_MAX_ATTEMPTS, Intensity, Lrv, PointlessSetting, ProposalKind, Recipe, RecipeError,
    RecipeSettings, ResponseTarget, XyzScale,
};
use crate::affine::Affine;
use crate::colorimetry::{Illuminant, Observer};
use crate::dataset::SpectrumKind;
use crate::model::Model;
use crate::program::condition::Condition;
use crate::program::{Bounds, IntensityLaw, Program};
use crate::quantity::{Dtype, Layout, Quantity};
use crate::sensors::{ResponseScale, Sensors};

/// A recipe under construction.
#[derive(Clone, Debug)]
pub struct RecipeBuilder {
    model: Model,
    lrv: Option<Lrv>,
    xyz: Option<[f64; 3]>,
    target: Option<ResponseTarget>,
    given: Option<Sensors>,
    bounds: Option<Bounds>,
    covariance_scale: f64,
    intensity: Option<Intensity>,
    proposal: ProposalKind,
    max_attempts: u32,
    outputs: OutputRequest,
}

impl RecipeBuilder {
    pub(super) fn new(model: &Model) -> RecipeBuilder {
        RecipeBuilder {
            model: model.clone(),
            lrv: None,
            xyz: None,
            target: None,
            given: None,
            bounds: None,
            covariance_scale: 1.0,
            intensity: None,
            proposal: ProposalKind::default(),
            max_attempts: DEFAULT_MAX_ATTEMPTS,
            outputs: OutputRequest::default(),
        }
    }

    /// Sets the quantities of each draw, at least one; [`Quantity::Spectra`] unless set. Engines add
    /// [`Quantity::Attempts`].
    pub fn quantities(mut self, quantities: impl IntoIterator<Item = Quantity>) -> Self {
        self.outputs.quantities = quantities.into_iter().collect();
        self
    }

    /// Sets the order of the values of quantities that have several per draw ([`Layout::Rows`]).
    pub fn layout(mut self, layout: Layout) -> Self {
        self.outputs.layout = layout;
        self
    }

    /// Sets the type of the spectra ([`Dtype::F32`]). In [`Dtype::F16`] they are rounded to nearest and ties to even,
    /// but never to an end of their [`ValueRange`]; above 65,504 they are infinite. Other quantities stay in 32 bits.
    /// Where the mean spectrum at the smallest intensity or target is below 2^-14 in every band, so that spectra lose
    /// digits in 16 bits, [`build`](RecipeBuilder::build) refuses.
    ///
    /// [`ValueRange`]: crate::ValueRange
    pub fn spectra_dtype(mut self, dtype: Dtype) -> Self {
        self.outputs.spectra = dtype;
        self
    }

    /// Sets the illuminant under which reflectances have their responses, XYZ, chromaticity, linear sRGB and LRV, and
    /// under which their targets are meant ([`Illuminant::D65`]).
    pub fn illuminant(mut self, illuminant: Illuminant) -> Self {
        self.outputs.illuminant = Some(illuminant);
        self
    }

    /// Sets the observer of XYZ, chromaticity, linear sRGB and LRV, and of their targets ([`Observer::Cie1931`]).
    pub fn observer(mut self, observer: Observer) -> Self {
        self.outputs.observer = Some(observer);
        self
    }

    /// Sets the sensors of [`Quantity::Responses`].
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe, Sensors, Stream};
    ///
    /// let cones = Sensors::builtin("ss2").expect("it is built in");
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::builder(&model).sensors(cones).quantities([Quantity::Responses]).build()?;
    /// let drawn = recipe.draw::<f32>(Stream::new(1), 0);
    /// assert_eq!(recipe.channels(Quantity::Responses), ["L", "M", "S"]);
    /// assert!(drawn.values(Quantity::Responses).iter().all(|&response| 0.0 < response && response < 1.0));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn sensors(mut self, sensors: Sensors) -> Self {
        self.outputs.sensors = Some(sensors);
        self
    }

    /// Sets the scale of responses ([`ResponseScale::White`] of reflectances, [`ResponseScale::Absolute`] of illuminants,
    /// which have no other).
    pub fn response_scale(mut self, scale: ResponseScale) -> Self {
        self.outputs.response_scale = Some(scale);
        self
    }

    /// Sets the scale of an illuminant's XYZ and linear sRGB ([`XyzScale::Absolute`]).
    pub fn xyz_scale(mut self, scale: XyzScale) -> Self {
        self.outputs.xyz_scale = Some(scale);
        self
    }

    /// Multiplies illuminants.
    pub fn intensity(self, intensity: Intensity) -> Self {
        RecipeBuilder { intensity: Some(intensity), ..self }
    }

    /// Scales every draw to a luminous reflectance value (LRV, 0 to 1), eq. 9 and 10: to one for all, or to one of its
    /// own for each draw, uniform in a range.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe, Stream};
    ///
    /// let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).lrv(0.2..0.6).quantities([Quantity::Lrv]).build()?;
    /// let label = recipe.draw::<f32>(Stream::new(1), 0).values(Quantity::Lrv)[0];
    /// assert!((0.2..=0.6).contains(&label));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn lrv(self, lrv: impl Into<Lrv>) -> Self {
        RecipeBuilder { lrv: Some(lrv.into()), ..self }
    }

    /// Scales every draw to the response of a sensor, relative to a perfect white (above 0 and below 1), as
    /// [`RecipeBuilder::lrv`] does to a luminous reflectance: to one for all, or to one of its own for each draw.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe, ResponseTarget, Sensors, Stream};
    ///
    /// let cones = Sensors::builtin("ss2").expect("it is built in");
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::builder(&model).target(ResponseTarget::new(cones.clone(), "L", 0.3)).sensors(cones);
    /// let drawn = recipe.quantities([Quantity::Responses]).build()?.draw::<f32>(Stream::new(1), 0);
    /// assert!((drawn.values(Quantity::Responses)[0] - 0.3).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn target(self, target: ResponseTarget) -> Self {
        RecipeBuilder { target: Some(target), ..self }
    }

    /// Gives every draw these tristimulus values, of the recipe's observer and under its illuminant, where a perfect white has Y = 1: draws of the model's
    /// Gaussian conditioned on them, of k - 3 dimensions, with the spectrum between 0 and 1. They are met to the
    /// rounding of f32, within 1e-6.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe, Stream};
    ///
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::builder(&model).xyz([0.35, 0.3, 0.2]).quantities([Quantity::Xyz]).build()?;
    /// let drawn = recipe.draw::<f32>(Stream::new(1), 0);
    /// assert!((drawn.values(Quantity::Xyz)[0] - 0.35).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn xyz(self, xyz: [f64; 3]) -> Self {
        RecipeBuilder { xyz: Some(xyz), ..self }
    }

    /// Gives every draw responses of its own: draws of the model's Gaussian conditioned on what these sensors saw, n values
    /// for each draw, relative to a perfect white under the recipe's illuminant (of illuminants, absolute). The covariance
    /// does not depend on them and the mean is linear in them, so one recipe serves draws of any responses:
    /// [`Session::draw_given`](crate::Session::draw_given) takes them, and [`Metamers`](crate::Metamers) answers also those
    /// that rejection hardly finds a spectrum for. They are met to the rounding of f32.
    ///
    /// A draw is a function of the model, the recipe, the seed, the stream, the index and its responses.
    /// [`Recipe::acceptance`] is that of the responses to the model's mean.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe, Sensors, Stream};
    ///
    /// let eye = Sensors::builtin("cie1931").expect("it is built in");
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::builder(&model).given(eye.clone()).sensors(eye).quantities([Quantity::Responses]).build()?;
    /// let drawn = recipe.draw_given::<f32>(Stream::new(1), 0, &[0.35, 0.3, 0.2]);
    /// assert!((drawn.values(Quantity::Responses)[0] - 0.35).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn given(self, sensors: Sensors) -> Self {
        RecipeBuilder { given: Some(sensors), ..self }
    }

    /// Sets the spectrum that must lie between 0 and 1 where there is a target LRV ([`Bounds::Base`]).
    pub fn bounds(self, bounds: Bounds) -> Self {
        RecipeBuilder { bounds: Some(bounds), ..self }
    }

    /// Multiplies the weights' covariance.
    pub fn covariance_scale(self, covariance_scale: f64) -> Self {
        RecipeBuilder { covariance_scale, ..self }
    }

    /// Sets the source of candidates ([`ProposalKind::Auto`]).
    pub fn proposal(self, proposal: ProposalKind) -> Self {
        RecipeBuilder { proposal, ..self }
    }

    /// Sets the largest number of candidates of a draw ([`DEFAULT_MAX_ATTEMPTS`]).
    pub fn max_attempts(self, max_attempts: u32) -> Self {
        RecipeBuilder { max_attempts, ..self }
    }

    /// Builds the recipe, if it can be drawn: its values make sense, a linear program finds room for a spectrum, and
    /// a pilot run accepts enough candidates.
    pub fn build(self) -> Result<Recipe, RecipeError> {
        let program = self.program()?;
        self.with_proposal(program)
    }

    fn settings(&self) -> RecipeSettings {
        RecipeSettings {
            lrv: self.lrv,
            xyz: self.xyz,
            target: self.target.clone(),
            given: self.given.clone(),
            bounds: self.bounds.unwrap_or_default(),
            covariance_scale: self.covariance_scale,
            intensity: self.intensity,
            quantities: self.outputs.quantities.clone(),
            illuminant: self.outputs.illuminant.clone().unwrap_or_default(),
            observer: self.outputs.observer(),
            sensors: self.outputs.sensors.clone(),
            response_scale: self.outputs.response_scale,
            xyz_scale: self.outputs.xyz_scale.unwrap_or_default(),
            proposal: self.proposal,
            max_attempts: self.max_attempts,
        }
    }

    /// The program of plain rejection.
    fn program(&self) -> Result<Program, RecipeError> {
        if !(self.covariance_scale.is_finite() && self.covariance_scale >= 0.0) {
            return Err(RecipeError::CovarianceScale(self.covariance_scale));
        }
        if self.max_attempts == 0 || self.max_attempts > i32::MAX as u32 {
            return Err(RecipeError::MaxAttempts(self.max_attempts));
        }
        if self.bounds.is_some() && self.lrv.is_none() && self.target.is_none() {
            return Err(RecipeError::Pointless(PointlessSetting::Bounds));
        }
        let target = self.scaling()?;
        let mut weights = self.model.weight_map(self.covariance_scale);
        if let Some(xyz) = self.xyz {
            if !(xyz.iter().all(|v| v.is_finite()) && xyz[1] > 0.0 && xyz[1] < 1.0) {
                return Err(RecipeError::Xyz(xyz));
            }
            weights = self.condition(&weights)?.given(&xyz, &weights);
        }
        let given = self.given.as_ref().map_or(0, Sensors::len);
        if let Some(sensors) = &self.given {
            let responses = self.responses(sensors, &weights)?;
            let condition = Condition::new(&responses);
            weights = condition.ok_or_else(|| self.too_few_directions(sensors))?.open(&weights);
        }
        let max_attempts = self.max_attempts;
        let mut program = Program { max_attempts, given, ..Program::new(&self.model, &weights) };
        program.target = target.map(|target| target.of_unlike_bands(&program.spectrum));
        let mut asked = OutputRequest { aim: self.aim(), ..self.outputs.clone() };
        if let Some(intensity) = self.intensity {
            program = self.brighten(program, intensity)?;
            asked.fixed = if let Intensity::Fixed(value) = intensity { Some(value) } else { None };
        }
        check_scale(&program)?;
        program.outputs = outputs(&asked, &self.model, &program, &weights)?;
        check_halves(&program)?;
        Ok(program)
    }

    fn brighten(&self, program: Program, intensity: Intensity) -> Result<Program, RecipeError> {
        if self.model.kind() == SpectrumKind::Reflectance {
            return Err(RecipeError::IntensityOfReflectance);
        }
        let check = |value: f64| match (1e-30..1e30).contains(&value) {
            true => Ok(value),
            false => Err(RecipeError::Intensity(value)),
        };
        let law = match intensity {
            Intensity::Fixed(value) => return Ok(program.brightened(check(value)?)),
            Intensity::LogUniform(low, high) => {
                let octaves = (check(high)? / check(low)?).log2();
                if !(octaves > 0.0 && octaves <= 126.0) {
                    return Err(RecipeError::IntensityRange { low, high });
                }
                IntensityLaw::LogUniform { low, octaves }
            }
            Intensity::Data => match self.model.parts().powers.as_slice() {
                [] => return Err(RecipeError::NoPowers),
                powers => IntensityLaw::OneOf(powers.iter().map(|&p| check(p)).collect::<Result<_, _>>()?),
            },
        };
        Ok(Program { intensity: Some(law), ..program })
    }

    /// Property that every draw is given.
    fn aim(&self) -> Aim {
        match (self.lrv, &self.target, self.xyz) {
            _ if self.given.is_some() => Aim::Given,
            (Some(_), ..) => Aim::Lrv,
            (None, Some(_), _) => Aim::Response,
            (None, None, Some(_)) => Aim::Xyz,
            (None, None, None) => Aim::Nothing,
        }
    }
}

/// Spectra in 16 bits must be in the normal range of these somewhere, at the smallest intensity or target.
fn check_halves(program: &Program) -> Result<(), RecipeError> {
    let has_halves = program.outputs.iter().any(|output| output.format.dtype == Dtype::F16);
    let mean = &program.spectrum.offset;
    let scale = match (&program.target, &program.intensity) {
        (Some(target), _) => {
            target.lrv.least() / target.weights.iter().zip(mean).map(|(w, s)| w * s).sum::<f64>()
        }
        (None, Some(intensity)) => intensity.least(),
        (None, None) => 1.0,
    };
    let largest = mean.iter().fold(0.0, |a: f64, s| a.max(s.abs())) * scale.abs();
    let is_dim = has_halves && largest < half::f16::MIN_POSITIVE.to_f64();
    if is_dim { Err(RecipeError::DimHalves { largest }) } else { Ok(()) }
}

/// Numbers must survive rounding to f32, with room for sums and for a scale of 10^6 either way; where there is a
/// target, so must the LRV of dark candidates, by which all are divided. No band may be below f32's normal range, which
/// adapters may flush to 0.
fn check_scale(program: &Program) -> Result<(), RecipeError> {
    let Affine { offset, gain } = &program.spectrum;
    let size = |b: usize| gain.iter().fold(offset[b].abs(), |a, gain| a.max(gain[b].abs()));
    let sizes = || (0..program.bands()).map(size);
    let (least, largest) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
    let (low, high) = (if program.target.is_some() { 1e-20 } else { 1e-30 }, 1e30);
    if !(low..high).contains(&largest) {
        return Err(RecipeError::Scale { value: largest, low, high });
    }
    let low = f64::from(f32::MIN_POSITIVE);
    let is_lost = least > 0.0 && least < low;
    if is_lost { Err(RecipeError::Scale { value: least, low, high }) } else { Ok(()) }
}
