//! Draws of what plain rejection cannot reach: near-white reflectances and strong covariances, from a cover.

mod engines;

use engines::{cpu, forms, gpu_is_software, surfaces};
use spectroll::{
    Bounds, DrawRange, DrawStatus, Engine, EngineError, ProposalKind, Quantity, Recipe, RecipeBuilder,
    RecipeError, Stream, colorimetry,
};

/// Draws of each recipe.
const COUNT: u64 = 20_003;

fn near_white(lrv: f64) -> RecipeBuilder {
    surfaces().lrv(lrv).bounds(Bounds::Scaled)
}

fn rows(engine: &Engine, recipe: &Recipe, draws: DrawRange) -> (Vec<f32>, Vec<DrawStatus>) {
    let (mut spectra, mut statuses) = (Vec::new(), Vec::new());
    let made = engine.draw(recipe, draws, |batch| {
        spectra.extend_from_slice(batch.spectra());
        statuses.extend_from_slice(batch.statuses());
        Ok::<_, EngineError>(())
    });
    made.unwrap_or_else(|e| panic!("{engine}: {e}"));
    (spectra, statuses)
}

/// Target LRVs and covariance scales, with the probability of a candidate (plain rejection where it reaches that far,
/// and another exact method elsewhere).
fn extremes() -> Vec<(String, Recipe, f64)> {
    let lrvs = [(0.95, 8.74e-3), (0.98, 9.45e-5), (0.985, 9.30e-6), (0.99, 3.841e-8), (0.992, 9.654e-11)];
    let scales = [(25.0, 0.0322), (100.0, 1.585e-3), (1e4, 2.842e-9), (1e6, 2.861e-15)];
    let lrvs = lrvs.map(|(lrv, p)| (format!("LRV {lrv}"), near_white(lrv), p));
    let scales =
        scales.map(|(scale, p)| (format!("covariance x{scale}"), surfaces().covariance_scale(scale), p));
    let built = |(name, builder, p): (String, RecipeBuilder, f64)| {
        let recipe = builder.build().unwrap_or_else(|e| panic!("{name}: {e}"));
        (name, recipe, p)
    };
    lrvs.into_iter().chain(scales).map(built).collect()
}

#[test]
fn extremes_are_covered_and_physical_and_the_same_on_every_engine() {
    let software = gpu_is_software();
    let weights = colorimetry::lrv_weights(&"400:10:700".parse().expect("a grid")).expect("it is visible");
    for (name, recipe, probability) in extremes() {
        assert_eq!(recipe.proposal(), ProposalKind::Cover, "{name}");
        // Six standard errors of 65,536 candidates, and the last digit of those known to three.
        let error = (recipe.probability() / probability - 1.0).abs();
        assert!(recipe.acceptance() > 0.1 && error < 0.06, "{name}: {} {error}", recipe.acceptance());
        assert!(recipe.cover().is_some_and(|cover| cover.bytes <= 256 << 10));
        let draws = Stream::named(40, &name).draws((1 << 32) - 77..(1 << 32) - 77 + COUNT);
        let ours = rows(cpu(), &recipe, draws);
        for engine in forms() {
            assert!(!software || ours == rows(engine, &recipe, draws), "{name}, {:?}", engine.verdict());
        }
        let mut attempts = 0;
        for (i, (spectrum, status)) in ours.0.chunks_exact(31).zip(&ours.1).enumerate() {
            assert!(spectrum.iter().all(|&s| s > 0.0 && s < 1.0), "{name}: draw {i}");
            if let Some(lrv) = name.strip_prefix("LRV ") {
                let found: f64 = weights.iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum();
                assert!(
                    (found - lrv.parse::<f64>().expect("it is a number")).abs() < 2e-6,
                    "{name}: {found}"
                );
            }
            attempts += u64::from(status.attempts());
        }
        let acceptance = COUNT as f64 / attempts as f64;
        assert!((acceptance / recipe.acceptance() - 1.0).abs() < 0.06, "{name}: {acceptance}");
    }
}

/// f32 against the oracle, on the same words.
#[test]
fn f32_takes_the_candidates_of_f64() {
    let (mut flips, mut worst) = (0, 0f64);
    for (name, recipe, _) in extremes() {
        let stream = Stream::named(41, &name);
        let (single, double) = (recipe.scalar_sampler::<f32>(), recipe.scalar_sampler::<f64>());
        for index in 0..5000 {
            let (ours, exact) = (single.draw(stream, index), double.draw(stream, index));
            if ours.status() != exact.status() {
                flips += 1;
                continue;
            }
            let errors = ours.spectrum().iter().zip(exact.spectrum()).map(|(a, b)| (f64::from(*a) - b).abs());
            worst = errors.fold(worst, f64::max);
        }
    }
    println!("{flips} of 45,000 draws took another candidate; largest error {worst:.1e}");
    // Some 2e-5 of the candidates, of which a draw takes about five.
    assert!(flips <= 45 && worst < 1e-5, "{flips} {worst:e}");
}

/// Where both reach, a cover and plain rejection give the same distribution: their means and variances, band by band,
/// to five standard errors.
#[test]
fn a_cover_draws_what_plain_rejection_draws() {
    let draws = |proposal, seed| {
        let recipe = surfaces().covariance_scale(25.0).proposal(proposal).build().expect("it can be drawn");
        assert_eq!(recipe.proposal(), proposal);
        cpu().collect(&recipe, Stream::new(seed).draws(0..COUNT)).expect("it draws")
    };
    let samples = [draws(ProposalKind::Plain, 42), draws(ProposalKind::Cover, 43)];
    for band in 0..31 {
        let [(a, va), (b, vb)] = samples.each_ref().map(|spectra| {
            let values: Vec<_> = spectra.iter().skip(band).step_by(31).map(|&s| f64::from(s)).collect();
            let mean = values.iter().sum::<f64>() / COUNT as f64;
            (mean, values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / COUNT as f64)
        });
        let error = ((va + vb) / COUNT as f64).sqrt();
        assert!((a - b).abs() < 5.0 * error, "band {band}: means {a} and {b}");
        // The kurtosis of what is bounded is below that of a normal.
        assert!(
            (va / vb - 1.0).abs() < 5.0 * (4.0 / COUNT as f64).sqrt(),
            "band {band}: variances {va} and {vb}"
        );
    }
}

/// Quantities besides spectra are maps of the cover's coordinates, too.
#[test]
fn quantities_come_from_a_cover() {
    let wanted = Quantity::ALL.iter().copied().filter(|q| *q != Quantity::Intensity);
    let recipe = near_white(0.98).quantities(wanted).build().expect("it can be drawn");
    let model = recipe.model().clone();
    let xyz = colorimetry::xyz_weights(model.grid()).expect("it is visible");
    for index in 0..100 {
        let drawn = recipe.draw::<f64>(Stream::new(44), index);
        let base = model.reconstruct(drawn.values(Quantity::Weights));
        let scale = drawn.spectrum()[0] / base[0];
        assert!(drawn.spectrum().iter().zip(&base).all(|(s, b)| (s - scale * b).abs() < 1e-12));
        for (value, weights) in drawn.values(Quantity::Xyz).iter().zip(&xyz) {
            let expected: f64 = weights.iter().zip(drawn.spectrum()).map(|(w, s)| w * s).sum();
            assert!((value - expected).abs() < 1e-12);
        }
    }
}

#[test]
fn what_cannot_be_covered_says_why() {
    let refused = near_white(0.996).build().unwrap_err();
    assert!(refused.to_string().contains("the largest is 0.995928"), "{refused}");
    let [a, b] = [1.0, 1.2].map(|lrv| near_white(lrv).build().unwrap_err());
    assert!(matches!((a, b), (RecipeError::Lrv(_), RecipeError::Lrv(_))));
    let hopeless = surfaces().covariance_scale(1e4).proposal(ProposalKind::Plain).build().unwrap_err();
    assert!(matches!(hopeless, RecipeError::Hopeless { .. }), "{hopeless}");
}
