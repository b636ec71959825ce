//! Draws one at a time, on the CPU.

use rand::Rng;
use rand::distr::Distribution;

use super::Recipe;
use crate::cpu::Kernel;
use crate::draw_status::DrawStatus;
use crate::quantity::Quantity;
use crate::random::real::Real;
use crate::random::stream::{DRAW_BLOCK, Stream};

/// Draws of a recipe, one at a time: in f32 as every engine makes them, in f64 without their rounding errors. See
/// [`Recipe::scalar_sampler`](crate::Recipe::scalar_sampler).
///
/// It is also a distribution for code that lives in `rand`: the words then come from any generator, two for each two
/// normals, rather than from a counter; everything else is the same. See also [`Stream::rng`].
///
/// ```
/// use rand::distr::Distribution;
/// use spectroll::{Draw, Model, Recipe, Stream};
///
/// let daylights = Recipe::builder(&Model::builtin("granada")?).build()?.scalar_sampler::<f32>();
/// let ten: Vec<Draw<f32>> = daylights.sample_iter(Stream::new(7).rng()).take(10).collect();
/// assert!(ten.iter().flat_map(Draw::spectrum).all(|&power| power > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ScalarSampler<R> {
    kernel: Kernel<R>,
    quantities: Vec<Quantity>,
}

impl<R: Real> ScalarSampler<R> {
    pub(super) fn new(recipe: &Recipe) -> ScalarSampler<R> {
        let program = recipe.program();
        let quantities = program.outputs.iter().map(|output| output.format.quantity).collect();
        ScalarSampler { kernel: Kernel::new(program), quantities }
    }

    /// Makes draw `index` of a stream.
    ///
    /// # Panics
    /// Where the recipe gives draws responses, which [`draw_given`](Self::draw_given) takes.
    pub fn draw(&self, stream: Stream, index: u64) -> Draw<R> {
        self.drawn(self.kernel.draw(stream, index))
    }

    /// Makes draw `index` of a stream, given responses: one for each channel of the recipe's
    /// [given sensors](crate::RecipeBuilder::given). All quantities are 0 where no candidate was accepted.
    ///
    /// # Panics
    /// Where there are not as many.
    pub fn draw_given(&self, stream: Stream, index: u64, given: &[f32]) -> Draw<R> {
        self.drawn(self.kernel.draw_given(stream, index, given))
    }

    fn drawn(&self, (values, status): (Vec<Vec<R>>, DrawStatus)) -> Draw<R> {
        Draw { status, values: self.quantities.iter().copied().zip(values).collect() }
    }
}

impl<R: Real> Distribution<Draw<R>> for ScalarSampler<R> {
    fn sample<G: Rng + ?Sized>(&self, rng: &mut G) -> Draw<R> {
        let mut words = || [(); 4].map(|()| rng.next_u32());
        // What belongs to the draw is the same in all attempts: were its target drawn anew with each candidate, hard
        // targets would be rarer than easy ones.
        let mut own = None;
        let mut block = |number| match number {
            DRAW_BLOCK => *own.get_or_insert_with(&mut words),
            _ => words(),
        };
        // A recipe that could go on here for long could not be built.
        let mut attempts = 1..=u32::MAX;
        let drawn = attempts.find_map(|attempt| self.kernel.candidate(attempt, &mut block));
        self.drawn(drawn.expect("a candidate is accepted"))
    }
}

/// One draw.
#[derive(Clone, Debug, PartialEq)]
pub struct Draw<R> {
    status: DrawStatus,
    values: Vec<(Quantity, Vec<R>)>,
}

impl<R> Draw<R> {
    /// Status of the draw.
    pub fn status(&self) -> DrawStatus {
        self.status
    }

    /// The values of a quantity, all 0 where the draw failed. None for [`Quantity::Attempts`], which
    /// [`Draw::status`] has, nor for what the recipe does not ask for.
    pub fn values(&self, quantity: Quantity) -> &[R] {
        self.values.iter().find(|(q, _)| *q == quantity).map_or(&[], |(_, values)| values)
    }

    /// The spectrum, a value for each band, if the recipe asks for it.
    pub fn spectrum(&self) -> &[R] {
        self.values(Quantity::Spectra)
    }
}
