//! A recipe: all that one group of draws needs besides its random words. Making one refuses what cannot be drawn,
//! so that whoever holds a [`Recipe`] can.

mod builder;
mod error;
mod outputs;
mod pilot;
mod scalar;
mod settings;
mod target;

pub use builder::RecipeBuilder;
pub use error::{PointlessSetting, RecipeError};
pub(crate) use outputs::OutputRequest;
pub use scalar::{Draw, ScalarSampler};
pub use settings::RecipeSettings;
pub use target::ResponseTarget;

use std::ops::Range;

use std::fmt;

use serde::{Deserialize, Serialize};

use crate::affine::Affine;
use crate::colorimetry;
use crate::dataset::SpectrumKind;
use crate::model::Model;
use crate::program::{Program, Proposal, feasibility};
use crate::quantity::{ArrayFormat, Quantity, ValueRange};
use crate::random::real::Real;
use crate::random::stream::Stream;
use crate::wgsl::{self, ComputeShader, ModuleOptions, ShaderVariant, WgslError};

/// Default limit on the number of candidates of a draw: as many as any driver tries in one dispatch.
pub const DEFAULT_MAX_ATTEMPTS: u32 = 65_000;

/// A model with the settings of its draws. See [`Recipe::builder`].
#[derive(Clone, Debug)]
pub struct Recipe {
    model: Model,
    settings: RecipeSettings,
    program: Program,
    probability: f64,
    acceptance: f64,
    /// The size of the cover that candidates are proposed from; `None` of plain rejection.
    cover: Option<CoverSize>,
    /// Number of the model's centres that have no share of the draws.
    left_out: usize,
}

/// Size of a cover: of the boxes that candidates come from where plain rejection finds next to none.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub struct CoverSize {
    /// The number of boxes.
    pub boxes: usize,
    /// The size of their table in bytes.
    pub bytes: usize,
}

/// Source of candidates. The draws have the same distribution either way, but are not the same draws.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum ProposalKind {
    /// Whichever is expected to cost less.
    #[default]
    Auto,
    /// The model's Gaussian, as in the appendix: right where a good part of it is acceptable.
    Plain,
    /// Boxes that cover what is acceptable, for models of up to 12 components: right where next to nothing is.
    Cover,
}

/// The luminous reflectance value (LRV) that reflectances are scaled to: CIE Y of the recipe's observer under its
/// illuminant (1931, 2 degrees, and D65 unless asked otherwise), 1 for a perfect white. A [`ResponseTarget`] is scaled to
/// another response in the same two ways.
///
/// ```
/// use spectroll::Lrv;
///
/// assert_eq!(Lrv::from(0.4), Lrv::Fixed(0.4));
/// assert_eq!(Lrv::from(0.2..0.6), Lrv::Uniform(0.2, 0.6));
/// ```
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "settings::LrvRecord", into = "settings::LrvRecord")]
pub enum Lrv {
    /// One luminous reflectance for every draw.
    Fixed(f64),
    /// One of its own for each draw, uniform between the two. It belongs to the draw and not to a candidate: where the
    /// scaled spectrum is bounded, a light target takes more candidates, and is as frequent as a dark one.
    /// [`Quantity::Lrv`](crate::Quantity::Lrv) has it. The first must be below the second; in f32, either may come out.
    Uniform(f64, f64),
}

impl fmt::Display for Lrv {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match self {
            Lrv::Fixed(lrv) => lrv.fmt(f),
            Lrv::Uniform(low, high) => write!(f, "{low}..{high}"),
        }
    }
}

impl From<f64> for Lrv {
    fn from(lrv: f64) -> Lrv {
        Lrv::Fixed(lrv)
    }
}

impl From<Range<f64>> for Lrv {
    fn from(range: Range<f64>) -> Lrv {
        Lrv::Uniform(range.start, range.end)
    }
}

/// Factor of an illuminant.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Intensity {
    /// A fixed factor.
    Fixed(f64),
    /// A factor between the two for each draw, uniform in its logarithm.
    LogUniform(f64, f64),
    /// For each draw a divisor of one of the model's spectra, chosen at random: the spectra's mean powers, unless the
    /// fit was normalized otherwise.
    Data,
}

/// The scale of an illuminant's tristimulus values.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "kebab-case")]
pub enum XyzScale {
    /// Sums of power x colour matching function x step in nm, without the 683 lm/W of luminous units.
    #[default]
    Absolute,
    /// Y = 1.
    UnitY,
}

impl Recipe {
    /// Starts a recipe: draws of `model` that are physical, and nothing more. [`RecipeBuilder::build`] ends it.
    ///
    /// ```
    /// use spectroll::{Bounds, Model, Recipe};
    ///
    /// let model = Model::builtin("munsell-vrhel")?;
    /// let recipe = Recipe::builder(&model).lrv(0.4).bounds(Bounds::Scaled).build()?;
    /// assert!((recipe.acceptance() - 0.708).abs() < 0.01);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn builder(model: &Model) -> RecipeBuilder {
        RecipeBuilder::new(model)
    }

    /// The largest luminous reflectance that reflectances of a model can be scaled to and stay below 1, which none
    /// quite reaches: from a linear program. `None` of illuminants, and of a grid without visible light.
    ///
    /// ```
    /// use spectroll::{Model, Recipe};
    ///
    /// let largest = Recipe::largest_lrv(&Model::builtin("munsell-vrhel")?).expect("they are reflectances");
    /// assert!((largest - 0.9959).abs() < 1e-4);
    /// assert_eq!(Recipe::largest_lrv(&Model::builtin("granada")?), None);
    /// # Ok::<(), spectroll::ModelError>(())
    /// ```
    pub fn largest_lrv(model: &Model) -> Option<f64> {
        let weights =
            colorimetry::lrv_weights(model.grid()).filter(|_| model.kind() == SpectrumKind::Reflectance)?;
        feasibility::largest_lrv(&Program::new(model, &model.weight_map(1.0)), &weights)
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The settings that it was built from.
    pub fn settings(&self) -> &RecipeSettings {
        &self.settings
    }

    /// The share of candidates that are accepted, estimated from 65,536 of them, or from about as many in whole draws
    /// where what is accepted depends on a target of the draw's own.
    pub fn acceptance(&self) -> f64 {
        self.acceptance
    }

    /// The probability that a spectrum of the model is accepted, which is the acceptance of plain rejection;
    /// estimated from as many candidates.
    pub fn probability(&self) -> f64 {
        self.probability
    }

    /// Source of candidates; never [`ProposalKind::Auto`].
    pub fn proposal(&self) -> ProposalKind {
        if self.cover.is_some() { ProposalKind::Cover } else { ProposalKind::Plain }
    }

    /// The size of the cover that candidates are proposed from; `None` of plain rejection.
    pub fn cover(&self) -> Option<CoverSize> {
        self.cover
    }

    /// Number of measured spectra, or of a mixture's components, that have no share of the draws: about which fewer than 1
    /// in 64 spectra would be accepted. 0 of Gaussian models.
    pub fn left_out(&self) -> usize {
        self.left_out
    }

    /// The error of targets of each draw's own that bound its spectrum, where the model is not a Gaussian.
    pub(crate) fn centres_at_own_targets(&self) -> Option<RecipeError> {
        let name = self.model.distribution().name();
        let has_centres = matches!(self.program.proposal, Some(Proposal::Centres(_)));
        has_centres.then_some(RecipeError::CentresAnd { name, other: builder::OWN_TARGETS })
    }

    /// Range of values that its spectra may take.
    pub fn value_range(&self) -> ValueRange {
        self.program.value_range()
    }

    /// Formats of its quantities, in the order of [`Quantity`](crate::Quantity).
    pub fn formats(&self) -> Vec<ArrayFormat> {
        self.program.outputs.iter().map(|output| output.format).collect()
    }

    /// Names of the values of a quantity, where each has one of its own: those of responses are the channels of the
    /// sensors.
    pub fn channels(&self, quantity: Quantity) -> Vec<String> {
        match (quantity, &self.settings.sensors) {
            (Quantity::Responses, Some(sensors)) => sensors.channels().to_vec(),
            _ => quantity.channels().iter().map(|&name| name.to_owned()).collect(),
        }
    }

    /// Prepares to draw one at a time, on the CPU: for a few draws, for tests, and for code that lives in `rand`.
    pub fn scalar_sampler<R: Real>(&self) -> ScalarSampler<R> {
        ScalarSampler::new(self)
    }

    /// Makes draw `index` of a stream. For more than one, [`ScalarSampler::draw`] is faster.
    pub fn draw<R: Real>(&self, stream: Stream, index: u64) -> Draw<R> {
        self.scalar_sampler().draw(stream, index)
    }

    /// Makes draw `index` of a stream, given responses. For more than one, [`ScalarSampler::draw_given`] is faster.
    pub fn draw_given<R: Real>(&self, stream: Stream, index: u64, given: &[f32]) -> Draw<R> {
        self.scalar_sampler().draw_given(stream, index, given)
    }

    /// Writes the draw as a WGSL module without bindings or entry points, for shaders of a host on any version of
    /// wgpu or any other engine. Every name has `prefix` and an underscore before it, so that several recipes fit in
    /// one shader:
    ///
    /// - `PREFIX_draw(seed: vec2<u32>, index: vec2<u32>) -> PREFIX_Draw` makes the same draw as every engine. Its
    ///   member `attempts` is the number of candidates that took, 0 where it failed; the rest is for the functions below.
    ///   `PREFIX_draw_in(stream, seed, index)` draws from a [`Stream`], given its number.
    /// - where each draw is [given](RecipeBuilder::given) responses, `PREFIX_draw_given(seed, index, c)` takes their
    ///   place: c is a vector of two to four responses, or an array of more;
    /// - for spectra, `PREFIX_at(draw, band) -> f32` and `PREFIX_spectrum(draw) -> array<f32, bands>`;
    /// - for weights, `PREFIX_weights(draw) -> array<f32, components>`;
    /// - for XYZ and linear sRGB, `PREFIX_xyz(draw) -> vec3<f32>` and `PREFIX_linear_srgb`;
    /// - for chromaticity, `PREFIX_chromaticity(draw) -> vec2<f32>`;
    /// - for responses, `PREFIX_responses(draw) -> array<f32, channels>`;
    /// - for LRV and intensity, `PREFIX_lrv(draw) -> f32` and `PREFIX_intensity`.
    ///
    /// - the constants `PREFIX_BANDS`, `PREFIX_FIRST_NM` and, of an even grid, `PREFIX_STEP_NM`; beside spectra
    ///   `PREFIX_reflectance(draw, nm) -> f32`, or `PREFIX_power` of illuminants, at any wavelength: on the line between two
    ///   bands, and outside the grid the value of its end.
    ///
    /// `index` and `seed` are the low and the high word of a number. The module needs no optional feature. To import it with `naga_oil`, put a line `#define_import_path NAME` before
    /// it, as `spectroll shader --naga-oil` does.
    ///
    /// ```
    /// use spectroll::{Model, Quantity, Recipe};
    ///
    /// let recipe = Recipe::builder(&Model::builtin("granada")?).quantities([Quantity::LinearSrgb]).build()?;
    /// assert!(recipe.wgsl("lamp")?.contains("fn lamp_linear_srgb(d: lamp_Draw) -> vec3<f32>"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn wgsl(&self, prefix: &str) -> Result<String, WgslError> {
        self.wgsl_with(prefix, ModuleOptions::default())
    }

    /// Writes the module of [`Recipe::wgsl`] in a form of arithmetic, and with tables in a place of the host's choice.
    ///
    /// In the exact form a draw has the bytes of the CPU on every device that rounds sums and products to nearest, and
    /// the functions that draw take one argument more: `PREFIX_draw(seed, index, zero)`. That `zero` must be 0 and known
    /// at run time alone, as a member of a uniform buffer is: a compiler that knows it sees through the guards.
    ///
    /// ```
    /// use spectroll::{Arithmetic, Model, ModuleOptions, Recipe};
    ///
    /// let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).build()?;
    /// let options = ModuleOptions { arithmetic: Arithmetic::Exact, ..ModuleOptions::default() };
    /// let text = recipe.wgsl_with("wall", options)?;
    /// assert!(text.contains("fn wall_draw(seed: vec2<u32>, index: vec2<u32>, zero: u32) -> wall_Draw"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn wgsl_with(&self, prefix: &str, options: ModuleOptions) -> Result<String, WgslError> {
        wgsl::module(&self.program, self.model.grid(), prefix, options)
    }

    /// Bytes of the tables that the module reads, as words of 32 bits with the lowest byte first: the content of the
    /// storage buffer that [`TableStorage::Buffer`](crate::TableStorage::Buffer) declares. Empty where it reads none.
    pub fn tables(&self) -> Vec<u8> {
        wgsl::table_words(&self.program).into_iter().flat_map(u32::to_le_bytes).collect()
    }

    /// Whether its module keeps these tables in a constant unless [`ModuleOptions`] say otherwise.
    pub fn keeps_tables_constant(&self) -> bool {
        wgsl::keeps_tables_constant(&self.program)
    }

    /// Writes the compute shader that makes the draws, with its bindings and the bytes that go into them, for hosts on any
    /// graphics interface. On wgpu, [`Sampler`](crate::Sampler) does all that.
    ///
    /// ```
    /// use spectroll::{BindingRole, Model, Quantity, Recipe, ShaderVariant, Stream};
    ///
    /// let recipe = Recipe::builder(&Model::builtin("munsell-vrhel")?).build()?;
    /// let shader = recipe.compute_shader(ShaderVariant::default())?;
    /// assert_eq!((shader.workgroups(1000), shader.dispatches()), (16, 1));
    /// assert_eq!(shader.bytes(BindingRole::Output(Quantity::Spectra), 1000), 4 * 31 * 1000);
    /// assert_eq!(shader.parameters(Stream::new(7).draws(0..1000), 1000)[..4], 7u32.to_ne_bytes());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn compute_shader(&self, variant: ShaderVariant) -> Result<ComputeShader, WgslError> {
        ComputeShader::new(&self.program, variant)
    }

    /// The program of the model's own Gaussian, and the map of the responses that this recipe's draws are given.
    pub(crate) fn free(&self) -> (Program, Affine) {
        let builder = self.settings.builder(&self.model);
        builder.free().expect("the recipe was built from these settings")
    }

    pub(crate) fn program(&self) -> &Program {
        &self.program
    }
}

#[cfg(test)]
mod tests;
