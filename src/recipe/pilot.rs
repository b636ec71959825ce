//! Pilot run, which estimates the acceptance before any work starts.

use crate::cpu::Kernel;
use crate::program::Program;
use crate::random::stream::Stream;
use crate::threads;

/// Number of candidates of a pilot run.
pub(super) const PILOT: u64 = 1 << 16;

/// Smallest number of whole draws for an estimate: enough for 1 part in 10, at some 10^6 candidates in the worst
/// case.
const LEAST_DRAWS: u64 = 256;

/// Number of candidates that are worth a thread.
const GRAIN: u64 = 1 << 12;

/// The probability that a draw finds no candidate within its attempts, above which a recipe is refused: one failure
/// in a data set of 10^12 draws.
pub(super) const TOLERABLE_FAILURE: f64 = 1e-12;

/// The share of accepted candidates, of a stream of its own. In f32, as draws are made: what passes in f64 may have no
/// room there.
pub(super) fn pilot(program: &Program) -> f64 {
    let kernel = Kernel::<f32>::new(program);
    let stream = Stream::named(0, "pilot");
    let accepted = threads::map(PILOT, GRAIN, |index| kernel.accepts(|b| stream.block(index, 0, b)));
    accepted.into_iter().filter(|&accepted| accepted).count() as f64 / PILOT as f64
}

/// The share of accepted candidates among those of whole draws, each of which goes on until one meets its own target: a
/// hard target counts by all the candidates that it takes. `least` is the acceptance at the hardest, which keeps the
/// candidates to about [`PILOT`].
pub(super) fn pilot_of_draws(program: &Program, least: f64) -> f64 {
    let kernel = Kernel::<f32>::new(program);
    let stream = Stream::named(0, "pilot");
    let draws = ((PILOT as f64 * least) as u64).max(LEAST_DRAWS);
    let candidates = threads::map(draws, 1, |index| match kernel.draw(stream, index).1.attempts() {
        0 => u64::from(program.max_attempts),
        attempts => u64::from(attempts),
    });
    draws as f64 / candidates.into_iter().sum::<u64>() as f64
}

/// The probability that none of `attempts` candidates is accepted.
pub(super) fn failure(acceptance: f64, attempts: u32) -> f64 {
    (f64::from(attempts) * (-acceptance).ln_1p()).exp()
}
