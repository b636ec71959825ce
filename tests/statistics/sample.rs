//! Scenarios, which are what is drawn, and samples, which are what came of it.

use rayon::prelude::*;
use spectroll::{Bounds, Choice, Engine, EngineError, Kind, Model, Recipe, Stream};

use crate::tinted::tinted;

/// A model under a rule.
pub(crate) struct Scenario {
    pub(crate) name: &'static str,
    pub(crate) model: Model,
    /// The target LRV, and what must be physical.
    pub(crate) target: Option<(f64, Bounds)>,
    /// What multiplies the covariance.
    pub(crate) scale: f64,
}

/// Small enough that no candidate is ever rejected: the weights are as normal as they were drawn.
const UNTRUNCATED: f64 = 0.01;

impl Scenario {
    pub(crate) fn all() -> Vec<Scenario> {
        let reflectances = || Model::builtin("munsell-vrhel").expect("it is built in");
        let daylights = Model::builtin("granada").expect("it is built in");
        let scenario = |name, model, target, scale| Scenario { name, model, target, scale };
        vec![
            scenario("untruncated", reflectances(), None, UNTRUNCATED),
            scenario("untruncated, tinted", tinted(), None, UNTRUNCATED),
            scenario("reflectances", reflectances(), None, 1.0),
            scenario("covariance x 4", reflectances(), None, 4.0),
            scenario("tinted", tinted(), None, 1.0),
            scenario("LRV 0.6, base", reflectances(), Some((0.6, Bounds::Base)), 1.0),
            scenario("LRV 0.2, scaled", reflectances(), Some((0.2, Bounds::Scaled)), 1.0),
            scenario("LRV 0.6, scaled", reflectances(), Some((0.6, Bounds::Scaled)), 1.0),
            scenario("LRV 0.6, both", reflectances(), Some((0.6, Bounds::Both)), 1.0),
            scenario("illuminants", daylights, None, 1.0),
        ]
    }

    pub(crate) fn named(name: &str) -> Scenario {
        Scenario::all().into_iter().find(|s| s.name == name).expect("there is a scenario of that name")
    }

    pub(crate) fn recipe(&self) -> Recipe {
        let recipe = Recipe::new(&self.model).covariance_scale(self.scale);
        let recipe = match self.target {
            Some((lrv, bounds)) => recipe.lrv(lrv).bounds(bounds),
            None => recipe,
        };
        recipe.build().expect("the recipe can be drawn")
    }

    pub(crate) fn is_untruncated(&self) -> bool {
        self.scale == UNTRUNCATED
    }

    /// What every value of an output is below.
    pub(crate) fn limit(&self) -> f64 {
        match (self.model.kind(), self.target) {
            (Kind::Illuminant, _) | (_, Some((_, Bounds::Base))) => f64::INFINITY,
            _ => 1.0,
        }
    }
}

/// One spectrum, and how many candidates it took.
pub(crate) type Draw = (Vec<f64>, u32);

/// Draws of a scenario. A series is the values of one band, weight or count over the draws, in order.
#[derive(Clone)]
pub(crate) struct Sample<'a> {
    pub(crate) scenario: &'a Scenario,
    pub(crate) bands: Vec<Vec<f64>>,
    /// The spectra projected onto the model's basis: weights, or where spectra are scaled something linear in them.
    pub(crate) weights: Vec<Vec<f64>>,
    pub(crate) attempts: Vec<f64>,
}

impl<'a> Sample<'a> {
    pub(crate) fn new(scenario: &'a Scenario, draws: &[Draw]) -> Sample<'a> {
        let model = &scenario.model;
        let weights: Vec<_> = draws.par_iter().map(|(spectrum, _)| model.project(spectrum)).collect();
        Sample {
            scenario,
            bands: (0..model.bands()).map(|b| draws.iter().map(|(s, _)| s[b]).collect()).collect(),
            weights: (0..model.components()).map(|j| weights.iter().map(|w| w[j]).collect()).collect(),
            attempts: draws.iter().map(|&(_, attempts)| f64::from(attempts)).collect(),
        }
    }

    /// The sample of draws `first`, `first + 1`, ... that `draw` makes one by one.
    pub(crate) fn of(
        scenario: &'a Scenario,
        first: u64,
        count: u64,
        draw: impl Fn(u64) -> Draw + Sync,
    ) -> Self {
        let draws: Vec<_> = (0..count).into_par_iter().map(|i| draw(first + i)).collect();
        Sample::new(scenario, &draws)
    }

    /// The draws of the f32 engine.
    pub(crate) fn of_engine(scenario: &'a Scenario, stream: Stream, first: u64, count: u64) -> Sample<'a> {
        let engine = Engine::new(&Choice::Cpu).expect("the CPU is always there");
        let mut draws = Vec::new();
        let made = engine.draw(&scenario.recipe(), stream.draws(first..first + count), |batch| {
            let rows = batch.spectra().chunks_exact(scenario.model.bands()).zip(batch.tallies());
            draws.extend(rows.map(|(row, t)| (row.iter().map(|&s| f64::from(s)).collect(), t.attempts())));
            Ok::<_, EngineError>(())
        });
        made.expect("every draw succeeds");
        Sample::new(scenario, &draws)
    }

    /// The f64 draws of the library.
    pub(crate) fn of_library(scenario: &'a Scenario, stream: Stream, first: u64, count: u64) -> Sample<'a> {
        let recipe = scenario.recipe();
        Sample::of(scenario, first, count, |index| {
            let drawn = recipe.draw::<f64>(stream, index);
            (drawn.spectrum().to_vec(), drawn.tally().attempts())
        })
    }

    /// How many draws there are.
    pub(crate) fn len(&self) -> usize {
        self.attempts.len()
    }
}
