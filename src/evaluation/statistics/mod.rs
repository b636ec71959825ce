//! Statistical checks of the distribution of draws.
//!
//! Samples of an engine are compared with an oracle that shares no code with it, by checks that each have a stated rate
//! of false alarms and a stated smallest error. Tests run them on fixed seeds, and on samplers that are broken in one
//! way each, every one of which they catch; the report runs them on its user's adapter and model.
//!
//! The thresholds come from one budget: [`RUNS`] checks of sound samples together raise a false alarm once in a million
//! choices of the seeds. The budget is split evenly over the checks that are run, and in a check over its comparisons
//! (Bonferroni). [`smallest_errors`] says what the checks can see.

mod checks;
mod generator;
mod oracle;
mod sample;
mod tinted;

pub use checks::{Against, CHECKS, Check, EDGE, FALSE_ALARMS, GAUSSIAN, LOW_BITS, MISSED, RUNS};
pub use checks::{Smallest, sigmas, smallest_errors};
pub(super) use checks::{kolmogorov, two_sample_distance};
pub use generator::{Group, normals, of_all, uniformity};
pub use oracle::sample as oracle;
pub(crate) use sample::rows;
pub use sample::{Sample, Scenario, ScenarioDraw};
pub use tinted::tinted;

use crate::random::stream::Stream;

/// Number of draws that are compared one by one with the library's.
pub const KNOWN: u64 = 4096;

/// Result of the comparisons of a check.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Finding {
    /// Probability that sound draws differ by as much, for each comparison.
    pub p_values: Vec<f64>,
    /// The least likely comparison, in words.
    pub worst: String,
    /// Fault that chance cannot explain.
    pub fault: Option<String>,
}

impl Finding {
    /// Adds a comparison.
    fn compare(&mut self, p: f64, what: impl FnOnce() -> String) {
        if self.p_values.iter().all(|&smallest| p < smallest) {
            self.worst = what();
        }
        self.p_values.push(p);
    }

    /// Probability that sound draws look as bad in any of the comparisons.
    pub fn p(&self) -> f64 {
        let comparisons = self.p_values.len() as f64;
        match &self.fault {
            Some(_) => 0.0,
            None => self.p_values.iter().map(|p| p * comparisons).fold(1.0, f64::min),
        }
    }

    /// Describes the difference, where it is more than chance.
    pub fn alarm(&self) -> Option<String> {
        let unlikely = || (self.p() < FALSE_ALARMS / RUNS as f64).then(|| self.worst.clone());
        self.fault.clone().or_else(unlikely)
    }
}

/// Function that draws a sample: from a stream, a first index and a number of draws.
pub type SampleFn<'s, 'a, E> = &'s dyn Fn(Stream, u64, u64) -> Result<Sample<'a>, E>;

/// Runs every check that suits the scenario of `oracle` on as many draws of `sampler` as the oracle has, of streams
/// under `seed`. The only errors are those of the sampler.
pub fn battery<E>(
    sampler: SampleFn<E>,
    oracle: &Sample,
    seed: u64,
) -> Result<Vec<(&'static Check, Finding)>, E> {
    let (stream, count) = (Stream::named(seed, "sample"), oracle.len() as u64);
    let sample = sampler(stream, 0, count)?;
    let other = sampler(Stream::named(seed, "other"), 0, count)?;
    let far = sampler(stream, 1 << 32, count)?;
    let library = Sample::of_library(oracle.scenario, stream, 0, KNOWN.min(count));
    let gaussian = oracle.scenario.is_gaussian().then_some(&GAUSSIAN);
    let run = |check: &'static Check| {
        let reference = match check.against {
            Against::Oracle => oracle,
            Against::OtherStream => &other,
            Against::FarIndex => &far,
            Against::Library => &library,
        };
        (check, check.run(&sample, reference))
    };
    Ok(CHECKS.iter().chain(gaussian).map(run).collect())
}
