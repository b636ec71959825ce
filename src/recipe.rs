//! A recipe: all that one group of draws needs besides its random words. Making one refuses what cannot be drawn,
//! so that whoever holds a [`Recipe`] can.

use rand::Rng;
use rand::distr::Distribution;
use rayon::prelude::*;

use crate::colorimetry;
use crate::condition::Condition;
use crate::cover::Cover;
use crate::cpu::Kernel;
use crate::dataset::Kind;
use crate::grid::Grid;
use crate::model::Model;
use crate::normal::Real;
use crate::outputs::{Asked, outputs};
use crate::program::{self, Affine, Bounds, Level, Program, Tally, Target};
use crate::quantity::{Element, Format, Layout, Quantity};
use crate::region::{self, Room};
use crate::stream::Stream;
use crate::wgsl::{self, TextError};

/// How many candidates a draw may take unless asked otherwise.
pub const DEFAULT_MAX_ATTEMPTS: u32 = 1 << 16;

/// How many candidates estimate the acceptance before any work starts.
const PILOT: u64 = 1 << 16;

/// The probability that a draw finds no candidate within its attempts, above which a recipe is refused: one failure
/// in a data set of 10^12 draws.
const TOLERABLE_FAILURE: f64 = 1e-12;

/// A model, and what its draws must obey. See [`Recipe::new`].
#[derive(Clone, Debug)]
pub struct Recipe {
    model: Model,
    program: Program,
    probability: f64,
    acceptance: f64,
    /// How many boxes candidates are proposed from, and how many bytes their table has; `None` of plain rejection.
    cover: Option<(usize, usize)>,
}

/// Where candidates come from. The draws have the same distribution either way, but are not the same draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Proposal {
    /// Whatever is expected to cost less.
    #[default]
    Auto,
    /// The model's Gaussian, as in the appendix: right where a good part of it is acceptable.
    Plain,
    /// Boxes that cover what is acceptable, for models of up to 12 components: right where next to nothing is.
    Cover,
}

/// A recipe under construction.
#[derive(Clone, Debug)]
pub struct RecipeBuilder {
    model: Model,
    lrv: Option<f64>,
    xyz: Option<[f64; 3]>,
    bounds: Bounds,
    covariance_scale: f64,
    intensity: Option<Intensity>,
    proposal: Proposal,
    max_attempts: u32,
    outputs: Asked,
}

/// What an illuminant is multiplied by.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Intensity {
    /// This.
    Fixed(f64),
    /// Something between the two, uniform in its logarithm, for each draw.
    LogUniform(f64, f64),
    /// For each draw one of what the model's data were divided by before the fit, each as likely: their mean powers,
    /// unless the fit says otherwise.
    Data,
}

/// The scale of an illuminant's tristimulus values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Luminance {
    /// Sums of power x colour matching function x step in nm, without the 683 lm/W of luminous units.
    #[default]
    Absolute,
    /// Y = 1.
    One,
}

/// Why a recipe cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum RecipeError {
    #[error(
        "a target luminous reflectance of {0}: it must be above 0 and below 1, where 1 is a perfect white, and 1e-30 at least"
    )]
    Lrv(f64),
    #[error("a target luminous reflectance belongs to reflectances, and this model is of illuminants")]
    LrvOfIlluminant,
    #[error("the grid {0} has no light that the eye sees, so nothing on it has a luminous reflectance")]
    Invisible(Grid),
    #[error("no reflectance of this model has a luminous reflectance of {lrv}: the largest is {largest:.6}")]
    UnreachableLrv { lrv: f64, largest: f64 },
    #[error("tristimulus values of {0:?}: they must be finite, and Y above 0 and below 1")]
    Xyz([f64; 3]),
    #[error("target tristimulus values belong to reflectances, and this model is of illuminants")]
    XyzOfIlluminant,
    #[error("target tristimulus values say what the luminous reflectance is: leave the target for it out")]
    XyzAndLrv,
    #[error(
        "target tristimulus values take 3 of the directions in which a model varies, and it needs 4 or more: fit it \
         with more components"
    )]
    TooFewDirections,
    #[error("{}", unreachable_xyz(*xyz, *nearest))]
    UnreachableXyz { xyz: [f64; 3], nearest: Option<[f64; 3]> },
    #[error("an intensity of {0}: it must be above 0, finite and within what f32 holds")]
    Intensity(f64),
    #[error(
        "an intensity between {low} and {high}: the first must be below the second, and no more than 2^126 below"
    )]
    IntensityRange { low: f64, high: f64 },
    #[error("an intensity belongs to illuminants, and this model is of reflectances")]
    IntensityOfReflectance,
    #[error(
        "this model does not hold what its data were divided by: fit it again, normalized, or give intensities"
    )]
    NoPowers,
    #[error("{quantity} cannot come out: {reason}")]
    Quantity { quantity: Quantity, reason: &'static str },
    #[error("nothing is asked for: a recipe has at least one quantity")]
    Nothing,
    #[error("an illuminant of {found} values where the model has {expected} bands")]
    Light { found: usize, expected: usize },
    #[error(
        "the illuminant that surfaces are seen under has no luminance, or a value that is negative or not finite"
    )]
    DarkLight,
    #[error("a covariance scale of {0}: it must be finite and not negative")]
    CovarianceScale(f64),
    #[error("a draw needs at least 1 attempt and at most 2147483647, not {0}")]
    MaxAttempts(u32),
    #[error("the model's values reach {0:e}, beyond what f32 holds: fit it to rescaled or normalised data")]
    Scale(f64),
    #[error(
        "no spectrum of this model obeys the rule: the bounds at {} leave no room",
        nanometres(wavelengths)
    )]
    Empty { wavelengths: Vec<f64> },
    #[error(
        "what is acceptable cannot be covered: covers are for models of up to 12 components, and this one has {components}"
    )]
    NoCover { components: usize },
    #[error("too few candidates would be accepted: {}", hopeless(*acceptance, *max_attempts))]
    Hopeless { acceptance: f64, max_attempts: u32 },
}

impl Recipe {
    /// Starts a recipe: draws of `model` that are physical, and nothing more. [`RecipeBuilder::build`] ends it.
    ///
    /// ```
    /// use spectroll::{Bounds, Model, Recipe};
    ///
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::new(&model).lrv(0.4).bounds(Bounds::Scaled).build()?;
    /// assert!((recipe.acceptance() - 0.708).abs() < 0.01);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[allow(clippy::new_ret_no_self)] // an unchecked recipe cannot exist
    pub fn new(model: &Model) -> RecipeBuilder {
        RecipeBuilder {
            model: model.clone(),
            lrv: None,
            xyz: None,
            bounds: Bounds::default(),
            covariance_scale: 1.0,
            intensity: None,
            proposal: Proposal::default(),
            max_attempts: DEFAULT_MAX_ATTEMPTS,
            outputs: Asked::default(),
        }
    }

    /// The largest luminous reflectance that reflectances of a model can be scaled to and stay below 1, which none
    /// quite reaches: from a linear program. `None` of illuminants, and of a grid without visible light.
    pub fn largest_lrv(model: &Model) -> Option<f64> {
        let weights = colorimetry::lrv_weights(model.grid()).filter(|_| model.kind() == Kind::Reflectance)?;
        region::largest_lrv(&Program::new(model, &program::weights(model, 1.0)), &weights)
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The share of candidates that are accepted, estimated from 65,536 of them.
    pub fn acceptance(&self) -> f64 {
        self.acceptance
    }

    /// The probability that a spectrum of the model obeys the rule, which is the share that plain rejection accepts;
    /// estimated from as many candidates.
    pub fn probability(&self) -> f64 {
        self.probability
    }

    /// Where candidates come from; never [`Proposal::Auto`].
    pub fn proposal(&self) -> Proposal {
        if self.cover.is_some() { Proposal::Cover } else { Proposal::Plain }
    }

    /// How many boxes candidates are proposed from, and how many bytes their table has, where there is a cover.
    pub fn cover(&self) -> Option<(usize, usize)> {
        self.cover
    }

    /// What comes out, and how it lies in memory, in the order of [`Quantity`].
    pub fn formats(&self) -> Vec<Format> {
        self.program.outputs.iter().map(|output| output.format).collect()
    }

    /// Draw `index` of a stream, on the CPU: in f32 as the shader makes it, in f64 without its rounding errors.
    pub fn draw<R: Real>(&self, stream: Stream, index: u64) -> Drawn<R> {
        let (values, tally) = Kernel::new(&self.program).draw(stream, index);
        Drawn { tally, values: self.program.outputs.iter().map(|o| o.format.quantity).zip(values).collect() }
    }

    /// The draw as a WGSL module without bindings or entry points, for shaders of a host on any version of wgpu or any
    /// other engine. Every name has `prefix` and an underscore before it, so that several recipes fit in one shader:
    ///
    /// - `PREFIX_draw(seed: vec2<u32>, index: vec2<u32>) -> PREFIX_Draw` makes the same draw as every engine. Its
    ///   member `attempts` is how many candidates that took, 0 where it failed; the rest is for the functions below.
    ///   `PREFIX_draw_in(stream, seed, index)` makes that of a [`Stream`] by its number.
    /// - for spectra, `PREFIX_at(draw, band) -> f32` and `PREFIX_spectrum(draw) -> array<f32, bands>`;
    /// - for weights, `PREFIX_weights(draw) -> array<f32, components>`;
    /// - for XYZ and sRGB, `PREFIX_xyz(draw) -> vec3<f32>` and `PREFIX_srgb`;
    /// - for LRV and intensity, `PREFIX_lrv(draw) -> f32` and `PREFIX_intensity`.
    ///
    /// The module needs no optional feature. To import it with `naga_oil`, put a line `#define_import_path NAME` before
    /// it, as `spectroll shader --naga-oil` does.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe};
    ///
    /// let recipe = Recipe::new(&Model::builtin("granada")?).quantities([Quantity::Srgb]).build()?;
    /// assert!(recipe.wgsl("lamp")?.contains("fn lamp_srgb(d: lamp_Draw) -> vec3<f32>"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn wgsl(&self, prefix: &str) -> Result<String, TextError> {
        wgsl::module(&self.program, prefix)
    }

    pub(crate) fn program(&self) -> &Program {
        &self.program
    }
}

/// One draw. See [`Recipe::draw`].
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn<R> {
    tally: Tally,
    values: Vec<(Quantity, Vec<R>)>,
}

impl<R> Drawn<R> {
    /// What it took.
    pub fn tally(&self) -> Tally {
        self.tally
    }

    /// The values of a quantity, all 0 where the draw failed. None for [`Quantity::Attempts`], which
    /// [`Drawn::tally`] has, nor for what the recipe does not ask for.
    pub fn values(&self, quantity: Quantity) -> &[R] {
        self.values.iter().find(|(q, _)| *q == quantity).map_or(&[], |(_, values)| values)
    }

    /// The spectrum, a value for each band, if the recipe asks for it.
    pub fn spectrum(&self) -> &[R] {
        self.values(Quantity::Spectra)
    }
}

impl RecipeBuilder {
    /// What comes out, besides nothing: unless said, [`Quantity::Spectra`]. Engines add [`Quantity::Attempts`].
    pub fn quantities(mut self, quantities: impl IntoIterator<Item = Quantity>) -> Self {
        self.outputs.quantities = quantities.into_iter().collect();
        self
    }

    /// How quantities with several values a draw are ordered ([`Layout::Rows`]).
    pub fn layout(mut self, layout: Layout) -> Self {
        self.outputs.layout = layout;
        self
    }

    /// Spectra in 16 bits, rounded to nearest and ties to even; other quantities stay in 32.
    pub fn half_spectra(mut self) -> Self {
        self.outputs.spectra = Element::F16;
        self
    }

    /// The illuminant under which reflectances have their XYZ and sRGB (D65): its power in each band, in any unit.
    pub fn light(mut self, power: &[f64]) -> Self {
        self.outputs.light = Some(power.to_vec());
        self
    }

    /// The scale of an illuminant's XYZ and sRGB ([`Luminance::Absolute`]).
    pub fn luminance(mut self, luminance: Luminance) -> Self {
        self.outputs.luminance = luminance;
        self
    }

    /// Multiplies illuminants.
    pub fn intensity(self, intensity: Intensity) -> Self {
        RecipeBuilder { intensity: Some(intensity), ..self }
    }

    /// Scales every draw to a luminous reflectance value (LRV, 0 to 1), eq. 9 and 10.
    pub fn lrv(self, lrv: f64) -> Self {
        RecipeBuilder { lrv: Some(lrv), ..self }
    }

    /// Gives every draw these tristimulus values under D65, where a perfect white has Y = 1: draws of the model's
    /// Gaussian conditioned on them, of k - 3 dimensions, with the spectrum between 0 and 1. They are met to the
    /// rounding of f32, within 1e-6.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe, Stream};
    ///
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::new(&model).xyz([0.35, 0.3, 0.2]).quantities([Quantity::Xyz]).build()?;
    /// let drawn = recipe.draw::<f32>(Stream::new(1), 0);
    /// assert!((drawn.values(Quantity::Xyz)[0] - 0.35).abs() < 1e-6);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn xyz(self, xyz: [f64; 3]) -> Self {
        RecipeBuilder { xyz: Some(xyz), ..self }
    }

    /// What must lie between 0 and 1 where there is a target LRV.
    pub fn bounds(self, bounds: Bounds) -> Self {
        RecipeBuilder { bounds, ..self }
    }

    /// Multiplies the weights' covariance.
    pub fn covariance_scale(self, covariance_scale: f64) -> Self {
        RecipeBuilder { covariance_scale, ..self }
    }

    /// Where candidates come from ([`Proposal::Auto`]).
    pub fn proposal(self, proposal: Proposal) -> Self {
        RecipeBuilder { proposal, ..self }
    }

    /// How many candidates a draw may take ([`DEFAULT_MAX_ATTEMPTS`]).
    pub fn max_attempts(self, max_attempts: u32) -> Self {
        RecipeBuilder { max_attempts, ..self }
    }

    /// The recipe, if it can be drawn: its values make sense, a linear program finds room for a spectrum, and a pilot
    /// run finds enough of it.
    pub fn build(self) -> Result<Recipe, RecipeError> {
        if !(self.covariance_scale.is_finite() && self.covariance_scale >= 0.0) {
            return Err(RecipeError::CovarianceScale(self.covariance_scale));
        }
        if self.max_attempts == 0 || self.max_attempts > i32::MAX as u32 {
            return Err(RecipeError::MaxAttempts(self.max_attempts));
        }
        let target = self.lrv.map(|lrv| self.target(lrv)).transpose()?;
        let mut weights = program::weights(&self.model, self.covariance_scale);
        if let Some(xyz) = self.xyz {
            weights = self.condition(&weights)?.given(xyz, &weights);
        }
        let mut program =
            Program { target, max_attempts: self.max_attempts, ..Program::new(&self.model, &weights) };
        let mut asked = self.outputs.clone();
        if let Some(intensity) = self.intensity {
            program = self.brighten(program, intensity)?;
            asked.fixed = if let Intensity::Fixed(value) = intensity { Some(value) } else { None };
        }
        check_scale(&program)?;
        program.outputs = outputs(&asked, &self.model, &program, &weights)?;
        if let Some(target) = &program.target {
            let largest = region::largest_lrv(&program, &target.weights);
            if let Some(largest) = largest.filter(|&largest| target.lrv >= largest) {
                return Err(RecipeError::UnreachableLrv { lrv: target.lrv, largest });
            }
        }
        let half_spaces = region::half_spaces(&program);
        let within = match region::room(&half_spaces) {
            Room::None { bands } => {
                if let Some(xyz) = self.xyz {
                    return Err(RecipeError::UnreachableXyz { xyz, nearest: self.nearest(xyz) });
                }
                let wavelengths = bands.into_iter().map(|band| self.model.grid().wavelength(band)).collect();
                return Err(RecipeError::Empty { wavelengths });
            }
            Room::Ball { centre, .. } => Some(centre),
            Room::Unknown => None, // which the pilot run will tell
        };
        let plain = match self.proposal {
            Proposal::Cover => 0.0,
            Proposal::Auto | Proposal::Plain => pilot(&program),
        };
        let cover = match within {
            Some(within) if self.proposal == Proposal::Cover || self.may_cover(plain) => {
                Cover::new(&half_spaces, &within)
            }
            _ => None,
        };
        if self.proposal == Proposal::Cover && cover.is_none() {
            return Err(RecipeError::NoCover { components: program.components() });
        }
        let covered = cover.map(|cover| (program.clone().covered(&cover), cover));
        let covered = covered.map(|(program, cover)| (pilot(&program), program, cover));
        let covered = covered.filter(|(acceptance, ..)| Cover::pays(*acceptance, plain));
        let recipe = match covered {
            Some((acceptance, program, cover)) => Recipe {
                model: self.model,
                program,
                probability: acceptance * cover.mass(),
                acceptance,
                cover: Some((cover.len(), cover.proposal().bytes())),
            },
            None => Recipe { model: self.model, program, probability: plain, acceptance: plain, cover: None },
        };
        if failure(recipe.acceptance, self.max_attempts) > TOLERABLE_FAILURE {
            let acceptance = recipe.acceptance;
            return Err(RecipeError::Hopeless { acceptance, max_attempts: self.max_attempts });
        }
        Ok(recipe)
    }

    /// Whether a cover is to be tried.
    fn may_cover(&self, plain: f64) -> bool {
        self.proposal == Proposal::Auto && Cover::could_pay(plain)
    }

    /// What giving the tristimulus values does to this model.
    pub(crate) fn condition(&self, weights: &Affine) -> Result<Condition, RecipeError> {
        let [_, y, _] = self.xyz.unwrap_or([0.5; 3]);
        if let Some(xyz) = self.xyz.filter(|xyz| !(xyz.iter().all(|v| v.is_finite()) && y > 0.0 && y < 1.0)) {
            return Err(RecipeError::Xyz(xyz));
        }
        if self.model.kind() == Kind::Illuminant {
            return Err(RecipeError::XyzOfIlluminant);
        }
        if self.lrv.is_some() {
            return Err(RecipeError::XyzAndLrv);
        }
        let (_, xyz) = self.seen(weights)?;
        Condition::new(&xyz).ok_or(RecipeError::TooFewDirections)
    }

    /// The program without a target, and the map of its tristimulus values under D65.
    fn seen(&self, weights: &Affine) -> Result<(Program, Affine), RecipeError> {
        let grid = self.model.grid();
        let seen = colorimetry::xyz_weights(grid).ok_or(RecipeError::Invisible(grid))?;
        let program = Program::new(&self.model, weights);
        let xyz = program.spectrum.project(&seen);
        Ok((program, xyz))
    }

    /// The nearest tristimulus values that can be drawn. The very nearest leave no room for a spectrum to vary in, so
    /// these are a little of the way from there to those of the mean.
    fn nearest(&self, xyz: [f64; 3]) -> Option<[f64; 3]> {
        let weights = program::weights(&self.model, self.covariance_scale);
        let (program, map) = self.seen(&weights).ok()?;
        let nearest = region::nearest_xyz(&program, &map, xyz)?;
        let steps = (0..16).map(|doublings| 1e-4 * f64::from(1 << doublings)).take_while(|&part| part < 1.0);
        let inwards = |part| [0, 1, 2].map(|i| nearest[i] + part * (map.offset[i] - nearest[i]));
        let rounded = steps.map(inwards).map(|xyz| xyz.map(|v| (v * 1e4).round() / 1e4));
        let condition = self.condition(&weights).ok()?;
        rounded.into_iter().find(|&xyz| {
            let program = Program::new(&self.model, &condition.given(xyz, &weights));
            !matches!(region::room(&region::half_spaces(&program)), Room::None { .. })
                && failure(pilot(&program), self.max_attempts) <= TOLERABLE_FAILURE
        })
    }

    fn brighten(&self, program: Program, intensity: Intensity) -> Result<Program, RecipeError> {
        if self.model.kind() == Kind::Reflectance {
            return Err(RecipeError::IntensityOfReflectance);
        }
        let check = |value: f64| match (1e-30..1e30).contains(&value) {
            true => Ok(value),
            false => Err(RecipeError::Intensity(value)),
        };
        let level = match intensity {
            Intensity::Fixed(value) => return Ok(program.brightened(check(value)?)),
            Intensity::LogUniform(low, high) => {
                let octaves = (check(high)? / check(low)?).log2();
                if !(octaves > 0.0 && octaves <= 126.0) {
                    return Err(RecipeError::IntensityRange { low, high });
                }
                Level::LogUniform { low, octaves }
            }
            Intensity::Data => match self.model.parts().powers.as_slice() {
                [] => return Err(RecipeError::NoPowers),
                powers => Level::OneOf(powers.iter().map(|&p| check(p)).collect::<Result<_, _>>()?),
            },
        };
        Ok(Program { level: Some(level), ..program })
    }

    fn target(&self, lrv: f64) -> Result<Target, RecipeError> {
        // Far below, spectra would round to 0; just below 1, to 1.
        if !(1e-30..1.0).contains(&f64::from(lrv as f32)) {
            return Err(RecipeError::Lrv(lrv));
        }
        if self.model.kind() == Kind::Illuminant {
            return Err(RecipeError::LrvOfIlluminant);
        }
        let grid = self.model.grid();
        let weights = colorimetry::lrv_weights(grid).ok_or(RecipeError::Invisible(grid))?;
        Ok(Target { lrv, weights, bounds: self.bounds })
    }
}

/// Numbers must survive rounding to f32, with room for sums and for a scale of 10^6 either way; where there is a
/// target, so must the LRV of dark candidates, by which all are divided. No band may be below f32's normal range, which
/// adapters may flush to 0.
fn check_scale(program: &Program) -> Result<(), RecipeError> {
    let Affine { offset, gain } = &program.spectrum;
    let size = |b: usize| gain.iter().fold(offset[b].abs(), |a, gain| a.max(gain[b].abs()));
    let sizes = || (0..program.bands()).map(size);
    let (least, largest) = (sizes().fold(f64::INFINITY, f64::min), sizes().fold(0.0, f64::max));
    let low = if program.target.is_some() { 1e-20 } else { 1e-30 };
    if !(low..1e30).contains(&largest) {
        return Err(RecipeError::Scale(largest));
    }
    let is_lost = least > 0.0 && least < f64::from(f32::MIN_POSITIVE);
    if is_lost { Err(RecipeError::Scale(least)) } else { Ok(()) }
}

/// The share of accepted candidates, of a stream of its own. In f32, as draws are made: what passes in f64 may have no
/// room there.
fn pilot(program: &Program) -> f64 {
    let kernel = Kernel::<f32>::new(program);
    let stream = Stream::named(0, "pilot");
    let accepted = (0..PILOT).into_par_iter().filter(|&index| kernel.accepts(|b| stream.block(index, 0, b)));
    accepted.count() as f64 / PILOT as f64
}

/// The probability that none of `attempts` candidates is accepted.
fn failure(acceptance: f64, attempts: u32) -> f64 {
    (f64::from(attempts) * (-acceptance).ln_1p()).exp()
}

fn hopeless(acceptance: f64, max_attempts: u32) -> String {
    if acceptance == 0.0 {
        return format!("none of {PILOT} was; ask for less extreme spectra");
    }
    let needed = (TOLERABLE_FAILURE.ln() / (-acceptance).ln_1p()).ceil();
    format!(
        "an estimated {acceptance:.1e} of them, so that one draw in {:.1e} would fail in all its {max_attempts} attempts; \
         allow at least {needed:.0} attempts, or ask for less extreme spectra",
        1.0 / failure(acceptance, max_attempts)
    )
}

fn unreachable_xyz(xyz: [f64; 3], nearest: Option<[f64; 3]>) -> String {
    let nearest = match nearest {
        Some([x, y, z]) => format!(
            "the nearest that can be drawn are X = {x}, Y = {y}, Z = {z} (by the largest of the differences)"
        ),
        None => "nor are any near them that can be drawn".to_owned(),
    };
    let [x, y, z] = xyz;
    format!("no reflectance of this model has the tristimulus values X = {x}, Y = {y}, Z = {z}: {nearest}")
}

fn nanometres(wavelengths: &[f64]) -> String {
    wavelengths.iter().map(|w| format!("{w} nm")).collect::<Vec<_>>().join(", ")
}

/// Draws for code that lives in `rand`: the words come from any generator, two for each two normals, rather than from
/// a counter; everything else is the same. A spectrum has a value for each band. See also [`Stream::rng`].
///
/// ```
/// use rand::distr::Distribution;
/// use spectroll::{Model, Recipe, Stream};
///
/// let recipe = Recipe::new(&Model::builtin("granada")?).build()?;
/// let daylights: Vec<Vec<f32>> = recipe.sample_iter(Stream::new(7).rng()).take(3).collect();
/// assert!(daylights.iter().flatten().all(|&power| power > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
impl<R: Real> Distribution<Vec<R>> for Recipe {
    fn sample<G: Rng + ?Sized>(&self, rng: &mut G) -> Vec<R> {
        let kernel = Kernel::new(&self.program.spectra_alone());
        // A recipe that could loop here for long could not be built.
        loop {
            if let Some(mut values) = kernel.candidate(|_| [(); 4].map(|()| rng.next_u32())) {
                return values.swap_remove(0);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn message(recipe: RecipeBuilder) -> String {
        recipe.build().unwrap_err().to_string()
    }

    #[test]
    fn what_cannot_be_drawn_says_why() {
        let surface = Recipe::new(&Model::builtin("munsell-vrhel").unwrap());
        let light = Recipe::new(&Model::builtin("granada").unwrap());
        for (recipe, part) in [
            (surface.clone().lrv(f64::NAN), "NaN: it must be above 0 and below 1"),
            (surface.clone().lrv(0.0), "reflectance of 0:"),
            (surface.clone().lrv(0.996), "the largest is 0.995928"),
            (surface.clone().covariance_scale(f64::NAN), "finite and not negative"),
            (surface.clone().max_attempts(0), "at least 1 attempt"),
            (surface.clone().max_attempts(u32::MAX), "at most 2147483647"),
            (surface.clone().covariance_scale(1e6).proposal(Proposal::Plain), "none of 65536 was"),
            (surface.clone().covariance_scale(100.0).max_attempts(50), "allow at least"),
            (light.clone().lrv(0.5), "of illuminants"),
            (light.clone().xyz([0.3; 3]), "of illuminants"),
            (surface.clone().xyz([0.3, 1.0, 0.3]), "Y above 0 and below 1"),
            (surface.clone().xyz([0.3, f64::NAN, 0.3]), "must be finite"),
            (surface.clone().xyz([0.3; 3]).lrv(0.3), "leave the target for it out"),
            (surface.clone().xyz([0.3; 3]).covariance_scale(0.0), "fit it with more components"),
        ] {
            let text = message(recipe);
            assert!(text.contains(part), "{text}");
        }
        // What the message advises is enough.
        let advised = message(surface.clone().covariance_scale(100.0).max_attempts(50));
        let attempts =
            advised.split("allow at least ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!(surface.covariance_scale(100.0).max_attempts(attempts).build().is_ok());
    }

    #[test]
    fn tristimulus_values_out_of_reach_come_with_the_nearest() {
        let surface = Recipe::new(&Model::builtin("munsell-vrhel").unwrap());
        for xyz in [[0.1, 0.4, 0.05], [0.9, 0.3, 0.1], [0.95, 0.99, 1.07], [0.01, 0.02, 0.6]] {
            let error = surface.clone().xyz(xyz).build().unwrap_err();
            let RecipeError::UnreachableXyz { nearest: Some(nearest), .. } = error else { panic!("{error}") };
            assert!(error.to_string().contains(&format!("Y = {}, Z", nearest[1])), "{error}");
            assert!(surface.clone().xyz(nearest).build().is_ok(), "{error}");
        }
    }

    #[test]
    fn a_model_without_room_names_its_wavelengths() {
        let mut parts = Model::builtin("munsell-vrhel").unwrap().parts().clone();
        parts.mean[3] = 9.0;
        parts.mean[4] = -9.0;
        let text = message(Recipe::new(&Model::new(parts).unwrap()));
        assert!(text.contains("the bounds at 430 nm, 440 nm leave no room"), "{text}");
    }

    #[test]
    fn values_beyond_f32_are_refused() {
        let mut parts = Model::builtin("granada").unwrap().parts().clone();
        parts.mean *= 1e35;
        assert!(message(Recipe::new(&Model::new(parts).unwrap())).contains("beyond what f32 holds"));
    }

    /// Frozen, so that a changed stream is a decision and not an accident.
    #[test]
    fn the_first_draw_stays_what_it_is() {
        let recipe = Recipe::new(&Model::builtin("munsell-vrhel").unwrap()).build().unwrap();
        let drawn = recipe.draw::<f32>(Stream::new(1), 0);
        let (spectrum, tally) = (drawn.spectrum(), drawn.tally());
        let ends = [spectrum[0], spectrum[15], spectrum[30]].map(f32::to_bits);
        assert_eq!((ends, tally.attempts(), tally.above_one()), (FIRST, 1, false));
    }

    const FIRST: [u32; 3] = [1050670988, 1051942847, 1058168784];
}
