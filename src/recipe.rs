//! A recipe: all that one group of draws needs besides its random words. Making one refuses what cannot be drawn,
//! so that whoever holds a [`Recipe`] can.

use rand::Rng;
use rand::distr::Distribution;
use rayon::prelude::*;

use crate::colorimetry;
use crate::cpu::Kernel;
use crate::dataset::Kind;
use crate::grid::Grid;
use crate::model::Model;
use crate::normal::Real;
use crate::program::{Bounds, Program, Tally, Target};
use crate::region;
use crate::stream::Stream;

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
    acceptance: f64,
}

/// A recipe under construction.
#[derive(Clone, Debug)]
pub struct RecipeBuilder {
    model: Model,
    lrv: Option<f64>,
    bounds: Bounds,
    covariance_scale: f64,
    max_attempts: u32,
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
            bounds: Bounds::default(),
            covariance_scale: 1.0,
            max_attempts: DEFAULT_MAX_ATTEMPTS,
        }
    }

    /// The model.
    pub fn model(&self) -> &Model {
        &self.model
    }

    /// The share of candidates that are accepted, estimated from 65,536 of them.
    pub fn acceptance(&self) -> f64 {
        self.acceptance
    }

    /// Draw `index` of a stream, on the CPU: in f32 as the shader makes it, in f64 without its rounding errors.
    pub fn draw<R: Real>(&self, stream: Stream, index: u64) -> (Vec<R>, Tally) {
        let mut spectrum = vec![R::ZERO; self.program.bands()];
        let tally = Kernel::new(&self.program).draw(stream, index, &mut spectrum);
        (spectrum, tally)
    }

    pub(crate) fn program(&self) -> &Program {
        &self.program
    }
}

impl RecipeBuilder {
    /// Scales every draw to a luminous reflectance value (LRV, 0 to 1), eq. 9 and 10.
    pub fn lrv(self, lrv: f64) -> Self {
        RecipeBuilder { lrv: Some(lrv), ..self }
    }

    /// What must lie between 0 and 1 where there is a target LRV.
    pub fn bounds(self, bounds: Bounds) -> Self {
        RecipeBuilder { bounds, ..self }
    }

    /// Multiplies the weights' covariance.
    pub fn covariance_scale(self, covariance_scale: f64) -> Self {
        RecipeBuilder { covariance_scale, ..self }
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
        let program = Program::new(&self.model, self.covariance_scale, target, self.max_attempts);
        check_scale(&program)?;
        if let Some(target) = &program.target {
            let largest = region::largest_lrv(&program, &target.weights);
            if let Some(largest) = largest.filter(|&largest| target.lrv >= largest) {
                return Err(RecipeError::UnreachableLrv { lrv: target.lrv, largest });
            }
        }
        if let Some(bands) = region::blocking_bands(&program) {
            let wavelengths = bands.into_iter().map(|band| self.model.grid().wavelength(band)).collect();
            return Err(RecipeError::Empty { wavelengths });
        }
        let acceptance = pilot(&program);
        if failure(acceptance, self.max_attempts) > TOLERABLE_FAILURE {
            return Err(RecipeError::Hopeless { acceptance, max_attempts: self.max_attempts });
        }
        Ok(Recipe { model: self.model, program, acceptance })
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
    let size = |b: usize| program.gain.iter().fold(program.offset[b].abs(), |a, gain| a.max(gain[b].abs()));
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
    let accepted = (0..PILOT).into_par_iter().map_init(
        || vec![0.0; program.bands()],
        |spectrum, index| kernel.candidate(|block| stream.block(index, 0, block), spectrum).is_some(),
    );
    accepted.filter(|&accepted| accepted).count() as f64 / PILOT as f64
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
        let kernel = Kernel::new(&self.program);
        let mut spectrum = vec![R::ZERO; self.program.bands()];
        // A recipe that could loop here for long could not be built.
        while kernel.candidate(|_| [(); 4].map(|()| rng.next_u32()), &mut spectrum).is_none() {}
        spectrum
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
            (surface.clone().covariance_scale(1e6), "none of 65536 was"),
            (surface.clone().covariance_scale(100.0).max_attempts(1000), "allow at least"),
            (light.clone().lrv(0.5), "of illuminants"),
        ] {
            let text = message(recipe);
            assert!(text.contains(part), "{text}");
        }
        // What the message advises is enough.
        let advised = message(surface.clone().covariance_scale(100.0).max_attempts(1000));
        let attempts =
            advised.split("allow at least ").nth(1).unwrap().split(' ').next().unwrap().parse().unwrap();
        assert!(surface.covariance_scale(100.0).max_attempts(attempts).build().is_ok());
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
        let (spectrum, tally) = recipe.draw::<f32>(Stream::new(1), 0);
        let ends = [spectrum[0], spectrum[15], spectrum[30]].map(f32::to_bits);
        assert_eq!((ends, tally.attempts(), tally.above_one()), (FIRST, 1, false));
    }

    const FIRST: [u32; 3] = [1050670988, 1051942847, 1058168784];
}
