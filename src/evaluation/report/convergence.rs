//! Statistical error against run time.
//!
//! For each number of draws n and each engine, replicates of n draws of their own estimate the mean spectrum, the
//! covariance of the weights and the acceptance; their root mean square distance from a reference of ten times the most
//! draws is the error. Time is measured apart, with nothing done with the draws.

use serde::Serialize;

use super::engines::{Runner, Subject};
use super::estimate::{Confidence, Estimate, Moments, bootstrap, median, root_mean_square};
use super::{Bench, ReportError};
use crate::random::stream::{DrawRange, Stream};
use crate::recipe::Recipe;

/// Number of parts of the reference, whose differences give its own error.
const PARTS: u64 = 100;

/// Least and largest number of replicates for a number of draws.
const REPLICATES: [u64; 2] = [10, 40];

/// Statistical error against run time.
#[derive(Clone, Debug, Serialize)]
pub struct Convergence {
    /// Reference of all comparisons.
    pub reference: Reference,
    /// An entry for each engine and number of draws.
    pub points: Vec<Point>,
    /// An entry for each engine.
    pub merits: Vec<Merit>,
}

/// The reference, in f64.
#[derive(Clone, Debug, Serialize)]
pub struct Reference {
    /// Number of draws.
    pub draws: u64,
    /// Error of the reference itself: of the mean spectrum (reflectance or relative power), the covariance (relative
    /// to itself) and the acceptance. Times sqrt(draws / n) this is the expected error of n draws.
    pub errors: [f64; 3],
    /// Share of candidates that it accepted.
    pub acceptance: f64,
    /// Root of the mean variance of a band.
    pub deviation: f64,
}

/// An engine at a number of draws.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// The engine, as an index into the report's.
    pub engine: usize,
    /// Number of draws, n.
    pub draws: u64,
    /// Number of replicates.
    pub replicates: u64,
    /// Run time, seconds: median, smallest and largest.
    pub seconds: [f64; 3],
    /// Root mean square errors, in the order of [`Reference::errors`].
    pub errors: [Confidence; 3],
}

/// Figures of merit of an engine.
#[derive(Clone, Debug, Serialize)]
pub struct Merit {
    /// The engine, as an index into the report's.
    pub engine: usize,
    /// Time from the engine's open device to the first draw, seconds: a compiled shader, buffers.
    pub first_draw: f64,
    /// Nanoseconds per draw at the largest number of draws.
    pub nanoseconds: f64,
    /// Slope of log error of the mean over log draws: -1/2 where nothing but chance is at work.
    pub slope: Confidence,
    /// Squared error of the mean times seconds at the largest number of draws: less is better, whatever the number of
    /// draws.
    pub error2_seconds: Confidence,
}

pub(super) fn measure(bench: &Bench, name: &str, recipe: &Recipe) -> Result<Convergence, ReportError> {
    let most = bench.effort.pick(1_000_000, 10_000_000, 100_000_000);
    let (reference, estimate) = reference(bench, name, recipe, 10 * most)?;
    let (mut points, mut merits) = (Vec::new(), Vec::new());
    for (engine, target) in bench.targets.iter().enumerate() {
        let mut runs = Runs::new(bench, target, recipe, &estimate)?;
        let mut all = Vec::new();
        for draws in (3..).map(|power| 10u64.pow(power)).take_while(|&draws| draws <= most) {
            bench.say(&format!("{name}: {draws} draws by {}", target.facts.name))?;
            let [least, largest] = REPLICATES;
            let replicates = (least * most / draws).clamp(least, largest);
            let measured = runs.replicates(draws, replicates)?;
            points.push(Point {
                engine,
                draws,
                replicates,
                seconds: spread(&measured.seconds),
                errors: [0, 1, 2].map(|quantity| interval(&measured.errors, quantity)),
            });
            all.push(measured);
        }
        merits.push(merit(engine, runs.first_draw, &all));
    }
    Ok(Convergence { reference, points, merits })
}

/// Makes the reference, in f64 from a stream of its own.
fn reference(
    bench: &Bench,
    name: &str,
    recipe: &Recipe,
    draws: u64,
) -> Result<(Reference, Estimate), ReportError> {
    bench.say(&format!("{name}: {draws} draws in f64, as the reference"))?;
    let (target, stream) = (Subject::double(), Stream::named(bench.seed, "reference"));
    let mut runner = target.runner(recipe)?;
    let (mut whole, mut parts) = (Moments::new(recipe.model()), Vec::new());
    for part in 0..PARTS {
        let range = stream.draws(part * (draws / PARTS)..(part + 1) * (draws / PARTS));
        let moments = moments(bench, &mut runner, recipe, range)?;
        parts.push(moments.estimate());
        whole.merge(&moments);
    }
    let estimate = whole.estimate();
    // By formula where there is one; the covariance's from how much the parts differ.
    let n = draws as f64;
    let apart: Vec<f64> = parts.iter().map(|part| part.errors(&estimate)[1]).collect();
    let deviation = whole.deviation();
    let p = estimate.acceptance;
    let reference = Reference {
        draws,
        errors: [
            deviation / n.sqrt(),
            root_mean_square(&apart) / (PARTS as f64 - 1.0).sqrt(),
            p * ((1.0 - p) / n).sqrt(),
        ],
        acceptance: p,
        deviation,
    };
    Ok((reference, estimate))
}

fn moments<'a>(
    bench: &Bench,
    runner: &mut Runner,
    recipe: &'a Recipe,
    draws: DrawRange,
) -> Result<Moments<'a>, ReportError> {
    let mut moments = Moments::new(recipe.model());
    moments.attempts = runner.draw(bench, draws, &mut |values, _| moments.add(values))?;
    Ok(moments)
}

/// Runs of an engine.
struct Runs<'a> {
    bench: &'a Bench<'a>,
    recipe: &'a Recipe,
    reference: &'a Estimate,
    runner: Runner<'a>,
    first_draw: f64,
}

impl<'a> Runs<'a> {
    fn new(
        bench: &'a Bench<'a>,
        target: &'a Subject,
        recipe: &'a Recipe,
        reference: &'a Estimate,
    ) -> Result<Runs<'a>, ReportError> {
        let start = std::time::Instant::now();
        let mut runner = target.runner(recipe)?;
        runner.time(bench, Stream::new(bench.seed).draws(0..1))?;
        let first_draw = start.elapsed().as_secs_f64();
        Ok(Runs { bench, recipe, reference, runner, first_draw })
    }

    /// Runs `count` replicates of `draws` draws.
    fn replicates(&mut self, draws: u64, count: u64) -> Result<Replicates, ReportError> {
        let stream = Stream::named(self.bench.seed, &format!("{draws} draws"));
        self.runner.time(self.bench, stream.draws(0..draws))?; // buffers and windows find their size
        let (mut seconds, mut errors) = (Vec::new(), Vec::new());
        for replicate in 0..count {
            let range = stream.draws(replicate * draws..(replicate + 1) * draws);
            seconds.push(self.runner.time(self.bench, range)?.0);
            let estimate = moments(self.bench, &mut self.runner, self.recipe, range)?.estimate();
            errors.push(estimate.errors(self.reference));
        }
        Ok(Replicates { draws, seconds, errors })
    }
}

/// Times and errors of replicates of a number of draws.
struct Replicates {
    draws: u64,
    seconds: Vec<f64>,
    errors: Vec<[f64; 3]>,
}

/// Median, smallest and largest.
fn spread(values: &[f64]) -> [f64; 3] {
    let least = values.iter().copied().fold(f64::INFINITY, f64::min);
    [median(values), least, values.iter().copied().fold(0.0, f64::max)]
}

fn picked(errors: &[[f64; 3]], quantity: usize, picks: &[usize]) -> f64 {
    root_mean_square(&picks.iter().map(|&i| errors[i][quantity]).collect::<Vec<_>>())
}

fn interval(errors: &[[f64; 3]], quantity: usize) -> Confidence {
    bootstrap(&[errors.len()], |picks| picked(errors, quantity, &picks[0]))
}

fn merit(engine: usize, first_draw: f64, all: &[Replicates]) -> Merit {
    let lengths: Vec<usize> = all.iter().map(|r| r.errors.len()).collect();
    let slope = bootstrap(&lengths, |picks| {
        let point = |(r, picks): (&Replicates, &Vec<usize>)| {
            ((r.draws as f64).ln(), picked(&r.errors, 0, picks).ln())
        };
        slope(&all.iter().zip(picks).map(point).collect::<Vec<_>>())
    });
    let most = all.last().expect("there are numbers of draws");
    let seconds = median(&most.seconds);
    let scaled = |v: f64| v * v * seconds;
    let error = interval(&most.errors, 0);
    Merit {
        engine,
        first_draw,
        nanoseconds: 1e9 * seconds / most.draws as f64,
        slope,
        error2_seconds: Confidence {
            value: scaled(error.value),
            low: scaled(error.low),
            high: scaled(error.high),
        },
    }
}

/// Slope of the line of least squares.
fn slope(points: &[(f64, f64)]) -> f64 {
    let n = points.len() as f64;
    let (mx, my) = points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + x / n, b + y / n));
    let (xy, xx) =
        points.iter().fold((0.0, 0.0), |(a, b), (x, y)| (a + (x - mx) * (y - my), b + (x - mx) * (x - mx)));
    xy / xx
}
