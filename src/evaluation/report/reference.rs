//! Reference that errors are measured from: the expectation of draws in f64, to a stated error.
//!
//! Draws in f64 are an order of magnitude slower than those in f32 and differ from them by little. So most of the
//! reference is drawn in f32, by the CPU, and corrected by the mean difference of both from the same words. That
//! difference has so small a spread that fewer draws than a hundredth give it to less than the reference's own error, which
//! includes it.

use std::time::Instant;

use serde::Serialize;

use super::engines::{Runner, Subject};
use super::estimate::{Estimate, Moments, root_mean_square};
use super::{Bench, ReportError};
use crate::engine::{Engine, EngineChoice};
use crate::random::stream::Stream;
use crate::recipe::Recipe;

/// Draws of the reference for each draw of what is compared with it: its error is a fifth.
const SHARE: u64 = 25;

/// Number of draws of a part. Parts give the error.
const PART: u64 = 1 << 17;

/// Smallest number of parts.
const LEAST_PARTS: u64 = 10;

/// Draws in f32 for each in f64 of the correction, and the number of parts in which those come.
const PER_EXACT: u64 = 100;
const EXACT_PARTS: u64 = 10;

/// The reference.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    /// Number of draws in f32.
    pub draws: u64,
    /// Number of draws in f64, of words that those in f32 were made of too, from which the correction comes.
    pub exact_draws: u64,
    /// Correction of the mean spectrum: root mean square over bands.
    pub correction: f64,
    /// Standard error of that correction.
    pub correction_error: f64,
    /// Error of the reference itself: of the mean spectrum (reflectance or relative power), the covariance (relative
    /// to itself) and the acceptance. Times sqrt(draws / n) this is the expected error of n draws.
    pub errors: [f64; 3],
    /// Share of candidates that are accepted.
    pub acceptance: f64,
    /// Root of the mean variance of a band.
    pub deviation: f64,
}

/// A reference that can grow.
pub(super) struct Growing<'a> {
    recipe: &'a Recipe,
    engine: Subject,
    double: Subject,
    stream: Stream,
    rough: Moments<'a>,
    parts: Vec<Estimate>,
    /// Draws of the same words in f64 and in f32, with how far their mean spectra are apart in each part.
    same: [Moments<'a>; 2],
    apart: Vec<nalgebra::DVector<f64>>,
    /// Time that a draw took, seconds.
    pace: f64,
}

impl<'a> Growing<'a> {
    pub(super) fn new(bench: &Bench, recipe: &'a Recipe) -> Result<Growing<'a>, ReportError> {
        let moments = || Moments::new(recipe.model());
        Ok(Growing {
            recipe,
            engine: Subject::single(Engine::new(&EngineChoice::Cpu)?),
            double: Subject::double(),
            stream: Stream::named(bench.seed, "reference"),
            rough: moments(),
            parts: Vec::new(),
            same: [moments(), moments()],
            apart: Vec::new(),
            pace: 0.0,
        })
    }

    /// Number of draws of a reference for so many draws.
    fn draws_for(draws: u64) -> u64 {
        (SHARE * draws).div_ceil(PART).max(LEAST_PARTS) * PART
    }

    /// Seconds that it will take to grow so.
    pub(super) fn forecast(&self, draws: u64) -> f64 {
        self.pace * (Self::draws_for(draws) as f64 - self.rough.draws as f64).max(0.0)
    }

    /// Draws more, until the reference is good enough for so many draws.
    pub(super) fn grow(&mut self, bench: &Bench, draws: u64) -> Result<(), ReportError> {
        let all = Self::draws_for(draws);
        let (start, more) = (Instant::now(), all.saturating_sub(self.rough.draws));
        {
            let mut runner = self.engine.runner(self.recipe)?;
            while self.rough.draws < all {
                let part = sums(
                    bench,
                    &mut runner,
                    self.recipe,
                    self.stream,
                    self.rough.draws..self.rough.draws + PART,
                )?;
                self.parts.push(part.estimate());
                self.rough.merge(&part);
            }
        }
        let exact = (all / PER_EXACT).div_ceil(EXACT_PARTS).max(2_000);
        let (mut single, mut double) = (self.engine.runner(self.recipe)?, self.double.runner(self.recipe)?);
        while self.same[0].draws < EXACT_PARTS * exact {
            let range = self.same[0].draws..self.same[0].draws + exact;
            let ours = sums(bench, &mut double, self.recipe, self.stream, range.clone())?;
            let theirs = sums(bench, &mut single, self.recipe, self.stream, range)?;
            self.apart.push(ours.estimate().mean - theirs.estimate().mean);
            self.same[0].merge(&ours);
            self.same[1].merge(&theirs);
        }
        if more > 0 {
            self.pace = start.elapsed().as_secs_f64() / more as f64;
        }
        Ok(())
    }

    pub(super) fn estimate(&self) -> Estimate {
        self.rough.corrected(&self.same[0], &self.same[1]).estimate()
    }

    /// The reference with its errors: by formula where there is one; the covariance's from how much the parts differ.
    pub(super) fn reference(&self) -> Reference {
        let estimate = self.estimate();
        let (n, parts) = (self.rough.draws as f64, self.parts.len() as f64);
        let whole = self.rough.estimate();
        let apart: Vec<f64> = self.parts.iter().map(|part| part.errors(&whole)[1]).collect();
        let norm = |v: &nalgebra::DVector<f64>| v.norm() / (v.len() as f64).sqrt();
        let count = self.apart.len() as f64;
        let shift =
            self.apart.iter().fold(nalgebra::DVector::zeros(estimate.mean.len()), |a, b| a + b) / count;
        let strays: Vec<f64> = self.apart.iter().map(|apart| norm(&(apart - &shift))).collect();
        let correction_error = root_mean_square(&strays) / (count - 1.0).sqrt();
        let (deviation, p) = (self.rough.deviation(), estimate.acceptance);
        Reference {
            draws: self.rough.draws,
            exact_draws: self.same[0].draws,
            correction: norm(&shift),
            correction_error,
            errors: [
                (deviation / n.sqrt()).hypot(correction_error),
                root_mean_square(&apart) / (parts - 1.0).sqrt(),
                p * ((1.0 - p) / n).sqrt(),
            ],
            acceptance: p,
            deviation,
        }
    }
}

fn sums<'a>(
    bench: &Bench,
    runner: &mut Runner,
    recipe: &'a Recipe,
    stream: Stream,
    range: std::ops::Range<u64>,
) -> Result<Moments<'a>, ReportError> {
    let mut moments = Moments::new(recipe.model());
    let attempts = runner.draw(bench, stream.draws(range), &mut |values, _| moments.add(values))?;
    moments.attempts = attempts as f64;
    Ok(moments)
}
