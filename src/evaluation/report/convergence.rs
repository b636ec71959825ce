//! Statistical error against run time.
//!
//! For each number of draws n, replicates of n draws of their own estimate the mean spectrum, the covariance of the
//! weights and the acceptance; their root mean square distance from a reference of 25 times as many draws is the error. Engines
//! and peers take turns, so that all of them meet the machine's good and bad moments. Time is measured apart, with
//! nothing done with the draws. Replicates grow by the [`Rule`].

use serde::Serialize;

use super::engines::{Runner, Subject};
use super::estimate::{Confidence, Estimate, Moments, Quartiles, bootstrap, median, root_mean_square};
use super::peers::{PEERS, Peer, PeerFacts};
use super::reference::{Growing, Reference};
use super::stopping::{FIRST_POWER, Rule, Size, Spread, Stop};
use super::{Bench, ReportError};
use crate::random::stream::Stream;
use crate::recipe::Recipe;

/// Share of the time that is left which a further number of draws may take: the rest is for more replicates.
const GROWTH: f64 = 0.5;

/// Statistical error against run time.
#[derive(Clone, Debug, Serialize)]
pub struct Convergence {
    /// Reference of all comparisons.
    pub reference: Reference,
    /// Rule by which the replicates grew.
    pub rule: Rule,
    /// Reason for which they grew no more.
    pub stop: Stop,
    /// A curve for each engine and peer.
    pub curves: Vec<Curve>,
    /// Peers that drew.
    pub peers: Vec<PeerFacts>,
    /// Peers that were asked for and could not draw, and why.
    pub missing_peers: Vec<String>,
}

/// Maker of draws.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Source {
    /// An engine, as an index into the report's.
    Engine(usize),
    /// A peer, as an index into [`Convergence::peers`].
    Peer(usize),
}

/// Error of a maker of draws against its run time.
#[derive(Clone, Debug, Serialize)]
pub struct Curve {
    /// Maker of the draws.
    pub source: Source,
    /// A point for each number of draws.
    pub points: Vec<Point>,
    /// Figures of merit.
    pub merit: Merit,
}

/// A number of draws.
#[derive(Clone, Debug, Serialize)]
pub struct Point {
    /// Number of draws, n.
    pub draws: u64,
    /// Number of replicates.
    pub replicates: usize,
    /// Run time, seconds.
    pub seconds: Quartiles,
    /// Root mean square errors, in the order of [`Reference::errors`].
    pub errors: [Confidence; 3],
}

/// Figures of merit of a maker of draws.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Merit {
    /// Time from the engine's open device, or the loaded module, to the first draw, seconds: a compiled shader,
    /// buffers.
    pub first_draw: f64,
    /// Nanoseconds per draw at the largest number of draws.
    pub nanoseconds: Quartiles,
    /// Slope of log error of the mean over log draws: -1/2 where nothing but chance is at work.
    pub slope: Confidence,
    /// Squared error of the mean times seconds: less is better, whatever the number of draws. The error is that of all
    /// replicates, each for its number of draws; the time that of a draw at the largest number of draws.
    pub error2_seconds: Confidence,
    /// Time for the same error, relative to the first curve: ratios of the times of the same turns, at the largest
    /// number of draws that both made.
    pub relative_time: Quartiles,
    /// That number of draws.
    pub relative_draws: u64,
}

pub(super) fn measure(bench: &Bench, recipe: &Recipe) -> Result<Convergence, ReportError> {
    let rule = Rule::of(bench.effort);
    let mut turns = Turns { bench, recipe, reference: Growing::new(bench, recipe)?, makers: Vec::new() };
    for (engine, target) in bench.targets.iter().enumerate() {
        bench.agenda.say(&format!("first draw of {}", target.facts.name))?;
        turns.makers.push(Maker::of_engine(bench, engine, target, recipe)?);
    }
    let (mut peers, mut missing_peers) = (Vec::new(), Vec::new());
    for peer in bench.python.iter().flat_map(|python| PEERS.map(|peer| (python, peer))) {
        bench.agenda.say(&format!("first draw of {}", peer.1.0))?;
        match Peer::start(peer.0, peer.1, recipe.model()) {
            Ok(peer) => {
                peers.push(peer.facts.clone());
                let index = peers.len() - 1;
                turns.makers.push(Maker::new(
                    Source::Peer(index),
                    peer.first_draw,
                    Drawing::Peer(Box::new(peer)),
                ));
            }
            Err(reason) => missing_peers.push(reason),
        }
    }
    let stop = turns.run(&rule)?;
    missing_peers.extend(turns.makers.iter().filter_map(|maker| maker.failed.clone()));
    turns.makers.retain(|maker| maker.failed.is_none());
    let estimate = turns.reference.estimate();
    let reference = turns.reference.reference();
    let first = &turns.makers[0].sizes;
    let curve = |maker: &Maker| Curve {
        source: maker.source,
        points: maker.sizes.iter().map(|size| size.point(&estimate)).collect(),
        merit: merit(maker, first, &estimate, reference.draws),
    };
    let curves = turns.makers.iter().map(curve).collect();
    Ok(Convergence { curves, reference, rule, stop, peers, missing_peers })
}

/// A maker of draws at work.
struct Maker<'a> {
    source: Source,
    first_draw: f64,
    drawing: Drawing<'a>,
    sizes: Vec<Replicates>,
    /// Reason for which it draws no more, though it should.
    failed: Option<String>,
}

enum Drawing<'a> {
    Engine(Box<Runner<'a>>),
    Peer(Box<Peer>),
}

/// Times and estimates of replicates of a number of draws.
struct Replicates {
    draws: u64,
    seconds: Vec<f64>,
    estimates: Vec<Estimate>,
}

impl<'a> Maker<'a> {
    fn new(source: Source, first_draw: f64, drawing: Drawing<'a>) -> Maker<'a> {
        Maker { source, first_draw, drawing, sizes: Vec::new(), failed: None }
    }

    fn of_engine(
        bench: &Bench,
        engine: usize,
        target: &'a Subject,
        recipe: &'a Recipe,
    ) -> Result<Maker<'a>, ReportError> {
        let start = std::time::Instant::now();
        let mut runner = target.runner(recipe)?;
        runner.time(bench, Stream::new(bench.seed).draws(0..1))?;
        Ok(Maker::new(
            Source::Engine(engine),
            start.elapsed().as_secs_f64(),
            Drawing::Engine(Box::new(runner)),
        ))
    }

    /// Seconds that a run of so many draws will take, from the largest that was made.
    fn forecast(&self, draws: u64) -> f64 {
        self.sizes.last().map_or(0.0, |size| median(&size.seconds) * draws as f64 / size.draws as f64)
    }

    /// Makes a replicate of its size at this number of draws.
    fn replicate(&mut self, bench: &Bench, recipe: &Recipe, draws: u64) -> Result<(), ReportError> {
        let is_new = self.sizes.last().is_none_or(|size| size.draws < draws);
        if is_new {
            self.sizes.push(Replicates { draws, seconds: Vec::new(), estimates: Vec::new() });
        }
        let size = self.sizes.iter_mut().find(|size| size.draws == draws).expect("it was made once");
        let (stream, number) =
            (Stream::named(bench.seed, &format!("{draws} draws")), size.seconds.len() as u64);
        let range = stream.draws(number * draws..(number + 1) * draws);
        let (seconds, moments) = match &mut self.drawing {
            Drawing::Engine(runner) => {
                if is_new {
                    runner.time(bench, range)?; // buffers and windows find their size
                }
                runner.measure(bench, range, Moments::new(recipe.model()))?
            }
            Drawing::Peer(peer) => {
                let seed = stream.block(number, 0, 0)[0] >> 1;
                match peer.draw(bench, recipe.model(), (draws, seed))? {
                    Ok(measured) => measured,
                    Err(reason) => {
                        self.failed = Some(reason);
                        return Ok(());
                    }
                }
            }
        };
        size.seconds.push(seconds);
        size.estimates.push(moments.estimate());
        Ok(())
    }
}

/// Makers that take turns.
struct Turns<'a, 'b> {
    bench: &'b Bench<'b>,
    recipe: &'a Recipe,
    reference: Growing<'a>,
    makers: Vec<Maker<'a>>,
}

impl Turns<'_, '_> {
    /// Runs until the rule is met or the time is over.
    fn run(&mut self, rule: &Rule) -> Result<Stop, ReportError> {
        let powers = FIRST_POWER..=rule.most_draws.ilog10();
        for draws in powers.map(|power| 10u64.pow(power)) {
            if !self.grow(rule, draws)? {
                break;
            }
        }
        loop {
            let estimate = self.reference.estimate();
            let makers = || self.makers.iter().filter(|maker| maker.failed.is_none());
            let spreads = |maker: &Maker| maker.sizes.iter().map(|size| size.spread(&estimate)).collect();
            let curves: Vec<Vec<Spread>> = makers().map(spreads).collect();
            if rule.is_met(&curves) {
                return Ok(Stop::Narrow);
            }
            let size = |size: &Replicates| {
                let at = || curves.iter().flatten().filter(|spread| spread.draws == size.draws);
                let seconds = makers().flat_map(|maker| maker.sizes.iter().filter(|s| s.draws == size.draws));
                Size {
                    draws: size.draws,
                    replicates: size.seconds.len(),
                    width: at().map(Spread::width).fold(0.0, f64::max),
                    // Drawn twice, and summed.
                    round_seconds: seconds.map(|s| 2.5 * median(&s.seconds)).sum(),
                }
            };
            let longest =
                makers().max_by_key(|maker| maker.sizes.len()).expect("the CPU in f64 is always there");
            let sizes: Vec<Size> = longest.sizes.iter().map(size).collect();
            let Some((draws, rounds)) = rule.next(&sizes, self.bench.agenda.left()) else {
                return Ok(Stop::Time);
            };
            self.rounds(draws, rounds, &|maker| maker.sizes.iter().any(|size| size.draws == draws))?;
        }
    }

    /// Goes on to a larger number of draws, unless that takes too long.
    fn grow(&mut self, rule: &Rule, draws: u64) -> Result<bool, ReportError> {
        let goes_on = |maker: &Maker| {
            let short = maker.forecast(draws) <= rule.longest_run || draws <= 10_000;
            short && maker.sizes.last().is_none_or(|size| size.draws * 10 == draws)
        };
        if draws > 100_000 {
            let drawn = self.makers.iter().filter(|maker| goes_on(maker)).map(|maker| maker.forecast(draws));
            let seconds =
                self.reference.forecast(draws) + 2.5 * rule.least_replicates as f64 * drawn.sum::<f64>();
            if !self.makers.iter().any(goes_on) || seconds > GROWTH * self.bench.agenda.left() {
                return Ok(false);
            }
        }
        self.bench.agenda.say(&format!("reference for {draws} draws"))?;
        self.reference.grow(self.bench, draws)?;
        self.rounds(draws, rule.least_replicates, &goes_on)?;
        Ok(true)
    }

    /// Lets makers take turns.
    fn rounds(
        &mut self,
        draws: u64,
        rounds: usize,
        joins: &dyn Fn(&Maker) -> bool,
    ) -> Result<(), ReportError> {
        self.bench.agenda.say(&format!("replicates of {draws} draws"))?;
        let joins: Vec<bool> = self.makers.iter().map(joins).collect();
        for _ in 0..rounds {
            for (maker, _) in
                self.makers.iter_mut().zip(&joins).filter(|(maker, joins)| **joins && maker.failed.is_none())
            {
                maker.replicate(self.bench, self.recipe, draws)?;
            }
        }
        Ok(())
    }
}

impl Replicates {
    /// Errors of the replicates, of a quantity.
    fn errors(&self, reference: &Estimate, quantity: usize) -> Vec<f64> {
        self.estimates.iter().map(|estimate| estimate.errors(reference)[quantity]).collect()
    }

    fn spread(&self, reference: &Estimate) -> Spread {
        Spread::of(self.draws, &self.errors(reference, 0))
    }

    fn point(&self, reference: &Estimate) -> Point {
        let interval = |quantity| {
            let errors = self.errors(reference, quantity);
            bootstrap(&[errors.len()], |picks| picked(&errors, &picks[0]))
        };
        Point {
            draws: self.draws,
            replicates: self.seconds.len(),
            seconds: Quartiles::of(&self.seconds),
            errors: [0, 1, 2].map(interval),
        }
    }
}

fn picked(values: &[f64], picks: &[usize]) -> f64 {
    root_mean_square(&picks.iter().map(|&i| values[i]).collect::<Vec<_>>())
}

fn merit(maker: &Maker, first: &[Replicates], reference: &Estimate, reference_draws: u64) -> Merit {
    let lengths: Vec<usize> = maker.sizes.iter().map(|size| size.seconds.len()).collect();
    let errors: Vec<Vec<f64>> = maker.sizes.iter().map(|size| size.errors(reference, 0)).collect();
    let slope = bootstrap(&lengths, |picks| {
        let points = maker.sizes.iter().zip(&errors).zip(picks);
        let point = |((size, errors), picks): ((&Replicates, &Vec<f64>), &Vec<usize>)| {
            ((size.draws as f64).ln(), picked(errors, picks).ln())
        };
        slope(&points.map(point).collect::<Vec<_>>())
    });
    let most = maker.sizes.last().expect("there are numbers of draws");
    // The square of an error is of the draws and of the reference.
    let draws: Vec<f64> = maker
        .sizes
        .iter()
        .map(|size| 1.0 / (1.0 / size.draws as f64 + 1.0 / reference_draws as f64))
        .collect();
    let error2_seconds = bootstrap(&lengths, |picks| {
        let squares = errors.iter().zip(&draws).zip(picks);
        let squares =
            squares.flat_map(|((errors, n), picks)| picks.iter().map(move |&i| n * errors[i] * errors[i]));
        let seconds =
            picks.last().expect("there is a size").iter().map(|&i| most.seconds[i]).collect::<Vec<_>>();
        squares.sum::<f64>() / lengths.iter().sum::<usize>() as f64 * median(&seconds) / most.draws as f64
    });
    let pairs = first.iter().rev().find(|size| size.draws <= most.draws).expect("all begin alike");
    let own =
        maker.sizes.iter().find(|size| size.draws == pairs.draws).expect("a smaller one was made before");
    let ratios: Vec<f64> = own.seconds.iter().zip(&pairs.seconds).map(|(a, b)| a / b).collect();
    Merit {
        first_draw: maker.first_draw,
        nanoseconds: Quartiles::of(&most.seconds).times(1e9 / most.draws as f64),
        slope,
        error2_seconds,
        relative_time: Quartiles::of(&ratios),
        relative_draws: pairs.draws,
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
