//! Draws one at a time, on the CPU.

use rand::Rng;
use rand::distr::Distribution;

use super::Recipe;
use crate::cpu::Kernel;
use crate::normal::Real;
use crate::program::Tally;
use crate::quantity::Quantity;
use crate::stream::Stream;

/// Draws of a recipe, one at a time: in f32 as every engine makes them, in f64 without their rounding errors. See
/// [`Recipe::scalar`].
///
/// It is also a distribution for code that lives in `rand`: the words then come from any generator, two for each two
/// normals, rather than from a counter; everything else is the same. See also [`Stream::rng`].
///
/// ```
/// use rand::distr::Distribution;
/// use spectroll::{Drawn, Model, Recipe, Stream};
///
/// let daylights = Recipe::new(&Model::builtin("granada")?).build()?.scalar::<f32>();
/// let ten: Vec<Drawn<f32>> = daylights.sample_iter(Stream::new(7).rng()).take(10).collect();
/// assert!(ten.iter().flat_map(Drawn::spectrum).all(|&power| power > 0.0));
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
pub struct ScalarDrawer<R> {
    kernel: Kernel<R>,
    quantities: Vec<Quantity>,
}

impl<R: Real> ScalarDrawer<R> {
    pub(super) fn new(recipe: &Recipe) -> ScalarDrawer<R> {
        let program = recipe.program();
        let quantities = program.outputs.iter().map(|output| output.format.quantity).collect();
        ScalarDrawer { kernel: Kernel::new(program), quantities }
    }

    /// Draw `index` of a stream.
    pub fn draw(&self, stream: Stream, index: u64) -> Drawn<R> {
        self.drawn(self.kernel.draw(stream, index))
    }

    fn drawn(&self, (values, tally): (Vec<Vec<R>>, Tally)) -> Drawn<R> {
        Drawn { tally, values: self.quantities.iter().copied().zip(values).collect() }
    }
}

impl<R: Real> Distribution<Drawn<R>> for ScalarDrawer<R> {
    fn sample<G: Rng + ?Sized>(&self, rng: &mut G) -> Drawn<R> {
        // A recipe that could go on here for long could not be built.
        let mut attempts = 1..=u32::MAX;
        let drawn =
            attempts.find_map(|attempt| self.kernel.candidate(attempt, |_| [(); 4].map(|()| rng.next_u32())));
        self.drawn(drawn.expect("a candidate is accepted"))
    }
}

/// One draw.
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
