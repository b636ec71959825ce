//! Scenarios, which are models with a recipe, and samples, which are their draws.

use rayon::prelude::*;

use super::tinted::tinted;
use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
use crate::draw_status::DrawStatus;
use crate::engine::{Batch, Engine, EngineError};
use crate::grid::{Extrapolation, Grid};
use crate::model::{Distribution, Fit, FitDistribution, Model};
use crate::program::Bounds;
use crate::random::stream::Stream;
use crate::recipe::Recipe;

/// A model with a recipe.
#[derive(Clone, Debug)]
pub struct Scenario {
    /// Name of the scenario.
    pub name: String,
    /// Model that is drawn from.
    pub model: Model,
    /// Target LRV, and the bounds that apply with it.
    pub target: Option<(f64, Bounds)>,
    /// Factor of the covariance.
    pub scale: f64,
}

/// Scale of the covariance at which no candidate is ever rejected: the weights are as normal as they were drawn.
const UNTRUNCATED: f64 = 0.01;

impl Scenario {
    /// Every kind of recipe, on the built-in models and on one with properties that no fit gives.
    pub fn all() -> Vec<Scenario> {
        let reflectances = || Model::builtin("munsell-vrhel").expect("it is built in");
        let kernel = || Model::builtin("munsell-vrhel-kernel").expect("it is built in");
        let daylights = Model::builtin("granada").expect("it is built in");
        let scenario =
            |name: &str, model, target, scale| Scenario { name: name.to_owned(), model, target, scale };
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
            scenario("kernel", kernel(), None, 1.0),
            scenario("kernel, LRV 0.6, base", kernel(), Some((0.6, Bounds::Base)), 1.0),
            scenario("mixture", mixture(), None, 1.0),
        ]
    }

    /// Returns the scenario of this name.
    pub fn named(name: &str) -> Scenario {
        Scenario::all().into_iter().find(|s| s.name == name).expect("there is a scenario of that name")
    }

    /// Recipe of the scenario.
    pub fn recipe(&self) -> Recipe {
        let recipe = Recipe::builder(&self.model).covariance_scale(self.scale);
        let recipe = match self.target {
            Some((lrv, bounds)) => recipe.lrv(lrv).bounds(bounds),
            None => recipe,
        };
        let recipe = recipe.build().expect("the recipe can be drawn");
        assert_eq!(recipe.left_out(), 0, "the oracle would wait for what is left out");
        recipe
    }

    /// Whether weights are those of a Gaussian: the model is one, and no candidate is rejected.
    pub fn is_gaussian(&self) -> bool {
        self.scale == UNTRUNCATED && *self.model.distribution() == Distribution::Gaussian
    }

    /// Upper limit of every value of an output.
    pub fn limit(&self) -> f64 {
        match (self.model.kind(), self.target) {
            (SpectrumKind::Illuminant, _) | (_, Some((_, Bounds::Base))) => f64::INFINITY,
            _ => 1.0,
        }
    }
}

/// Surfaces in four clusters, each with a covariance of its own.
fn mixture() -> Model {
    let tables = [BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()];
    let data = Dataset::new(&tables, Grid::DEFAULT, Extrapolation::Error);
    let fit = Fit::new(SpectrumKind::Reflectance).distribution(FitDistribution::Mixture(4));
    fit.fit(&data.expect("the tables have these wavelengths")).expect("surfaces can be fitted")
}

/// One spectrum, and the number of candidates it took.
pub type ScenarioDraw = (Vec<f64>, u32);

/// Draws of a scenario. A series is the values of one band, weight or count over the draws, in order.
#[derive(Clone)]
pub struct Sample<'a> {
    /// Scenario of the draws.
    pub scenario: &'a Scenario,
    /// A series for each band.
    pub bands: Vec<Vec<f64>>,
    /// The spectra projected onto the model's basis: weights, or where spectra are scaled something linear in them.
    pub weights: Vec<Vec<f64>>,
    /// Number of candidates that each draw took.
    pub attempts: Vec<f64>,
}

impl<'a> Sample<'a> {
    /// Makes the sample of these draws.
    pub fn new(scenario: &'a Scenario, draws: &[ScenarioDraw]) -> Sample<'a> {
        let model = &scenario.model;
        let weights: Vec<_> = draws.par_iter().map(|(spectrum, _)| model.project(spectrum)).collect();
        Sample {
            scenario,
            bands: (0..model.bands()).map(|b| draws.iter().map(|(s, _)| s[b]).collect()).collect(),
            weights: (0..model.components()).map(|j| weights.iter().map(|w| w[j]).collect()).collect(),
            attempts: draws.iter().map(|&(_, attempts)| f64::from(attempts)).collect(),
        }
    }

    /// Makes the sample of draws `first`, `first + 1`, ... by calling `draw` for each.
    pub fn of(
        scenario: &'a Scenario,
        first: u64,
        count: u64,
        draw: impl Fn(u64) -> ScenarioDraw + Sync,
    ) -> Self {
        let draws: Vec<_> = (0..count).into_par_iter().map(|i| draw(first + i)).collect();
        Sample::new(scenario, &draws)
    }

    /// Makes a sample with an engine.
    pub fn of_engine(
        scenario: &'a Scenario,
        engine: &Engine,
        stream: Stream,
        first: u64,
        count: u64,
    ) -> Result<Sample<'a>, EngineError> {
        let mut draws = Vec::new();
        engine.draw(&scenario.recipe(), stream.draws(first..first + count), |batch| {
            draws.extend(rows(&batch).map(|(row, status)| {
                let spectrum = row.iter().map(|&s| f64::from(s)).collect();
                (spectrum, status.attempts())
            }));
            Ok::<_, EngineError>(())
        })?;
        Ok(Sample::new(scenario, &draws))
    }

    /// Makes a sample with the library in f64.
    pub fn of_library(scenario: &'a Scenario, stream: Stream, first: u64, count: u64) -> Sample<'a> {
        let oracle = scenario.recipe().scalar_sampler();
        Sample::of(scenario, first, count, |index| {
            let drawn = oracle.draw(stream, index);
            (drawn.spectrum().to_vec(), drawn.status().attempts())
        })
    }

    /// Number of draws.
    #[allow(clippy::len_without_is_empty)] // nobody samples nothing
    pub fn len(&self) -> usize {
        self.attempts.len()
    }
}

/// Spectra and statuses of a batch, draw by draw.
pub(crate) fn rows<'b>(batch: &'b Batch) -> impl Iterator<Item = (&'b [f32], DrawStatus)> {
    let bands = batch.formats()[0].width;
    batch.spectra().chunks_exact(bands).zip(batch.statuses().iter().copied())
}
