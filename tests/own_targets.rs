//! Draws that each have a target luminous reflectance of their own: how their labels are distributed, and what they
//! do not depend on. That engines agree on them is for `twins.rs` and `quantities.rs`.

mod engines;

use engines::{cpu, surfaces};
use rand::distr::Distribution;
use spectroll::{
    Bounds, Draw, Dtype, EngineError, Layout, Lrv, ProposalKind, Quantity, Recipe, RecipeBuilder, Stream,
    colorimetry,
};

const LOW: f64 = 0.2;
const HIGH: f64 = 0.8;

/// The draws of each test of a distribution.
const COUNT: u64 = 40_000;

/// The distance from the distribution that it should have which an empirical one of [`COUNT`] values exceeds once in
/// 10^9 (Kolmogorov and Smirnov).
const DISTANCE: f64 = 0.01636;

fn recipe(bounds: Bounds) -> Recipe {
    let wanted = [Quantity::Spectra, Quantity::Weights, Quantity::Lrv];
    surfaces().lrv(LOW..HIGH).bounds(bounds).quantities(wanted).build().expect("it can be drawn")
}

const ALL_BOUNDS: [Bounds; 3] = [Bounds::Base, Bounds::Scaled, Bounds::Both];

fn draws(recipe: &Recipe, stream: Stream) -> Vec<Draw<f32>> {
    let sampler = recipe.scalar_sampler::<f32>();
    (0..COUNT).map(|index| sampler.draw(stream, index)).collect()
}

fn label(draw: &Draw<f32>) -> f64 {
    f64::from(draw.values(Quantity::Lrv)[0])
}

/// The largest distance between the distribution of labels and the uniform one.
fn distance_from_uniform(mut labels: Vec<f64>) -> f64 {
    labels.sort_by(f64::total_cmp);
    let (count, width) = (labels.len() as f64, HIGH - LOW);
    let distances = labels.iter().enumerate().map(|(i, label)| {
        let expected = (label - LOW) / width;
        (expected - i as f64 / count).abs().max((expected - (i + 1) as f64 / count).abs())
    });
    distances.fold(0.0, f64::max)
}

/// Light targets take more candidates where the scaled spectrum is bounded, and must not be rarer for that.
#[test]
fn labels_are_uniform_under_every_rule() {
    for bounds in ALL_BOUNDS {
        let drawn = draws(&recipe(bounds), Stream::named(50, "labels"));
        let distance = distance_from_uniform(drawn.iter().map(label).collect());
        println!("{bounds:?}: {distance:.4}");
        assert!(distance < DISTANCE, "{bounds:?}: {distance}");
        assert!(drawn.iter().all(|draw| (LOW as f32..=HIGH as f32).contains(&draw.values(Quantity::Lrv)[0])));
        // What a target that is drawn anew with each candidate would come to: the first ones that pass.
        let first: Vec<_> = drawn.iter().filter(|d| d.status().attempts() == 1).map(label).collect();
        assert_eq!(distance_from_uniform(first) > 3.0 * DISTANCE, bounds != Bounds::Base, "{bounds:?}");
    }
}

/// Words of any generator of `rand` are given out in another order, and there, too, a target outlasts its candidates.
#[test]
fn labels_are_uniform_with_generators_of_rand() {
    let sampler = recipe(Bounds::Scaled).scalar_sampler::<f32>();
    let drawn = sampler.sample_iter(Stream::new(51).rng()).take(COUNT as usize);
    let distance = distance_from_uniform(drawn.map(|draw: Draw<f32>| label(&draw)).collect());
    assert!(distance < DISTANCE, "{distance}");
}

#[test]
fn every_spectrum_has_the_lrv_of_its_label() {
    let weights = colorimetry::lrv_weights(&"400:10:700".parse().expect("a grid")).expect("it is visible");
    for bounds in ALL_BOUNDS {
        for draw in draws(&recipe(bounds), Stream::new(52)) {
            let found: f64 = weights.iter().zip(draw.spectrum()).map(|(w, &s)| w * f64::from(s)).sum();
            assert!((found - label(&draw)).abs() < 2e-6, "{bounds:?}: {found} of {}", label(&draw));
            let above_one = draw.spectrum().iter().any(|&s| s >= 1.0);
            assert_eq!(draw.status().above_one(), above_one);
            assert!(!above_one || bounds == Bounds::Base);
        }
    }
}

/// The numbers of the eighths that values are in.
fn eighths(values: &[f64]) -> Vec<usize> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut eighths = vec![0; values.len()];
    order.iter().enumerate().for_each(|(rank, &i)| eighths[i] = 8 * rank / values.len());
    eighths
}

/// Pearson's statistic of two variables, by their eighths: where they are independent, a chi-square of 49 degrees.
fn dependence(a: &[f64], b: &[f64]) -> f64 {
    let mut counts = [[0f64; 8]; 8];
    eighths(a).into_iter().zip(eighths(b)).for_each(|(a, b)| counts[a][b] += 1.0);
    let expected = a.len() as f64 / 64.0;
    counts.as_flattened().iter().map(|count| (count - expected).powi(2) / expected).sum()
}

/// A chi-square of 49 degrees is above this once in 10^9.
const INDEPENDENT: f64 = 133.3;

/// What is accepted before scaling has nothing to do with the target.
#[test]
fn labels_and_spectra_are_independent_under_base() {
    let stream = Stream::new(53);
    let drawn = draws(&recipe(Bounds::Base), stream);
    let labels: Vec<_> = drawn.iter().map(label).collect();
    let weights: Vec<_> = drawn.iter().map(|draw| f64::from(draw.values(Quantity::Weights)[0])).collect();
    let found = dependence(&labels, &weights);
    assert!(found < INDEPENDENT, "{found}");
    // A label made of a word of the candidate's would be found out, although it is uniform, too.
    let words = (0..COUNT).map(|index| f64::from(stream.block(index, 0, 0)[0]));
    let found = dependence(&words.collect::<Vec<_>>(), &weights);
    assert!(found > INDEPENDENT, "{found}");
    // Under the other rules what passes at a light target is flatter.
    let drawn = draws(&recipe(Bounds::Scaled), stream);
    let peak = |draw: &Draw<f32>| {
        let [least, most] = [f32::min, f32::max].map(|f| draw.spectrum().iter().copied().reduce(f).unwrap());
        f64::from(least / most)
    };
    let labels: Vec<_> = drawn.iter().map(label).collect();
    assert!(dependence(&labels, &drawn.iter().map(peak).collect::<Vec<_>>()) > INDEPENDENT);
}

/// A target is one of the draw's own uniforms, and moves no candidate: under the rule `base`, from a cover or not, the
/// spectra are those of any other target, times what they are scaled by.
#[test]
fn a_target_moves_no_candidate() {
    for proposal in [ProposalKind::Plain, ProposalKind::Cover] {
        let of = |lrv: Lrv| {
            let builder = surfaces().covariance_scale(25.0).proposal(proposal).lrv(lrv);
            builder.quantities([Quantity::Weights, Quantity::Lrv]).build().expect("it can be drawn")
        };
        let (own, fixed) = (of(Lrv::Uniform(LOW, HIGH)), of(Lrv::Fixed(0.5)));
        assert_eq!(own.acceptance(), fixed.acceptance());
        assert_eq!(own.cover(), fixed.cover());
        for index in 0..1000 {
            let [own, fixed] = [&own, &fixed].map(|recipe| recipe.draw::<f32>(Stream::new(54), index));
            assert_eq!(own.status().attempts(), fixed.status().attempts());
            assert_eq!(own.values(Quantity::Weights), fixed.values(Quantity::Weights));
        }
    }
}

/// What the pilot run says of recipes whose targets differ in how many candidates they take.
#[test]
fn the_acceptance_is_that_of_draws() {
    for bounds in ALL_BOUNDS {
        let recipe = recipe(bounds);
        let drawn = draws(&recipe, Stream::new(55));
        let attempts = drawn.iter().map(|draw| u64::from(draw.status().attempts()));
        let found = COUNT as f64 / attempts.sum::<u64>() as f64;
        println!("{bounds:?}: {found:.4}, estimated {:.4}", recipe.acceptance());
        assert!((recipe.acceptance() / found - 1.0).abs() < 0.05, "{bounds:?}");
        assert!(recipe.probability() > recipe.acceptance() - 0.01, "{bounds:?}");
        // Targets that take many candidates count by all of these, where the rule depends on them.
        let differ = recipe.probability() > 1.05 * recipe.acceptance();
        assert_eq!(differ, bounds != Bounds::Base, "{bounds:?}: {}", recipe.probability());
    }
}

/// Labels stay in f32 beside spectra in f16, and are the same whatever else comes out.
#[test]
fn labels_do_not_depend_on_their_company() {
    let labels = |builder: RecipeBuilder| {
        let recipe = builder.lrv(LOW..HIGH).bounds(Bounds::Both).build().expect("it can be drawn");
        let mut labels = Vec::new();
        let drawn = cpu().draw(&recipe, Stream::new(56).draws(0..1003), |batch| {
            labels.extend_from_slice(batch.values(Quantity::Lrv));
            Ok::<_, EngineError>(())
        });
        drawn.expect("it draws");
        labels
    };
    let alone = labels(surfaces().quantities([Quantity::Lrv]));
    let spectra = [Quantity::Spectra, Quantity::Lrv];
    let halves = surfaces().quantities(spectra).spectra_dtype(Dtype::F16);
    assert!(labels(halves.clone()) == alone);
    assert!(labels(halves.layout(Layout::Planes)) == alone);
    let sampler = surfaces().quantities([Quantity::Lrv]).lrv(LOW..HIGH).build().expect("it can be drawn");
    let sampler = sampler.scalar_sampler::<f32>();
    let base: Vec<_> =
        (0..1003).map(|index| sampler.draw(Stream::new(56), index).values(Quantity::Lrv)[0]).collect();
    assert!(base == alone, "the rule has no part in the target");
}
