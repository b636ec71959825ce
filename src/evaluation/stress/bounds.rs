//! Bounds and targets at their limits: means on and outside a bound, room thinner than f32 resolves, covariance
//! scales, luminous reflectances up to the largest, and attempts at their cap.

use statrs::function::erf::erfc;

use super::examine::*;
use super::{Answer, Case, case, good, within};
use crate::dataset::SpectrumKind;
use crate::engine::Engine;
use crate::model::Model;
use crate::program::Bounds;
use crate::random::stream::Stream;
use crate::recipe::{ProposalKind, Recipe, RecipeBuilder, RecipeError};

pub(super) const CASES: &[Case] = &[
    case("mean exactly on a bound", "half of all candidates are lost", on_bound),
    case("mean outside a bound by 1 to 6 deviations", "the pilot sees none; retries without end", outside),
    case("a value 10^-9 below the upper bound", "f32 rounds it to 1: no draw is ever accepted", thin),
    case("room of 10^-8 deviations between two bounds", "retries without end", pinched),
    case(
        "values of 10^-39 beside values of 1",
        "f32 below its normal range, which adapters may flush to 0",
        denormal,
    ),
    case("covariance times 10^-12 to 10^6", "no variation, or no acceptance", scales),
    case("covariance times 0", "a deviation of 0", no_variation),
    case("LRV 0 and 1", "a factor of 0; what nothing reaches", impossible_lrv),
    case("LRV of 10^-46 to 10^-6", "a target that rounds to 0 in f32", dark_lrv),
    case("LRV at the largest that the model reaches, and either side", "retries without end", largest_lrv),
    case("LRV 10^-9 below 1, of grey surfaces", "f32 rounds it to 1: no draw is ever accepted", almost_white),
    case("attempts at the cap", "draws that fail within the attempts allowed", capped),
];

/// Makes reflectances that vary in one band of three, by 0.1.
fn one_varies(mean: f64) -> Model {
    let mut basis = nalgebra::DMatrix::zeros(1, 3);
    basis[0] = 1.0;
    Model::new(parts(SpectrumKind::Reflectance, vec![mean, 0.5, 0.5], basis, diagonal([0.01])))
        .expect("it is a model")
}

/// Checks that the share of draws in (0, 1) is that of the normal distribution, to its standard error.
fn share(engine: &Engine, mean: f64) -> Answer {
    let recipe = build(Recipe::builder(&one_varies(mean)).proposal(ProposalKind::Plain))?;
    let below = |x: f64| erfc(-x / std::f64::consts::SQRT_2) / 2.0;
    let expected = below((1.0 - mean) / 0.1) - below(-mean / 0.1);
    let examined = examine(engine, &recipe, Stream::named(4, "stress").draws(0..DRAWS))?;
    // The estimate of a geometric distribution's parameter.
    let error = expected * ((1.0 - expected) / DRAWS as f64).sqrt();
    let sigmas = (examined.acceptance - expected).abs() / error;
    if sigmas > SIGMAS {
        return Err(format!("{:.5} of candidates accepted instead of {expected:.5}", examined.acceptance));
    }
    within(attempts(&examined), examined.error, ERROR)
}

fn on_bound(engine: &Engine) -> Answer {
    all([0.0, 1.0].map(|mean| (format!("mean {mean}"), share(engine, mean))))
}

/// Checks means outside a bound: up to 3 deviations can be drawn; beyond, a draw might exhaust its attempts, and the
/// recipe must say so.
fn outside(engine: &Engine) -> Answer {
    let drawn = [1.0, 2.0, 3.0].map(|d| (format!("{d}"), share(engine, -0.1 * d)));
    let hopeless = |e: &RecipeError| matches!(e, RecipeError::Hopeless { .. });
    let covered = [4.0, 5.0, 6.0].map(|d| {
        (
            format!("{d}, from a cover"),
            super::examine::drawn(engine, Recipe::builder(&one_varies(-0.1 * d)), ERROR),
        )
    });
    let refused = [4.0, 5.0, 6.0].map(|d| {
        let answer = refused(Recipe::builder(&one_varies(-0.1 * d)).proposal(ProposalKind::Plain), hopeless);
        (format!("{d}"), answer.and_then(|_| good("refused as hopeless")))
    });
    all(drawn.into_iter().chain(covered).chain(refused))
}

/// Checks a recipe that may be drawn to within `bound`, or be refused for want of room in f32.
fn drawn_or_refused(engine: &Engine, builder: RecipeBuilder, bound: f64) -> Answer {
    use RecipeError::{Empty, Hopeless, Lrv, Scale, UnreachableLrv};
    match builder.clone().build() {
        Err(Lrv(_) | Scale { .. }) => good("refused, beyond f32"),
        Err(e @ (Empty { .. } | Hopeless { .. } | UnreachableLrv { .. })) => {
            good(format!("refused: {}", first_sentence(&e.to_string())))
        }
        // What passes in f64 and never in f32 must not take 2^16 attempts a draw to find out.
        _ => drawn(engine, builder.max_attempts(1024), bound),
    }
}

fn thin(engine: &Engine) -> Answer {
    let mut basis = nalgebra::DMatrix::zeros(1, 3);
    basis[0] = 1.0;
    let mean = vec![1.0 - 1e-9, 0.5, 0.5];
    let model =
        Model::new(parts(SpectrumKind::Reflectance, mean, basis, diagonal([1e-20]))).expect("it is a model");
    drawn_or_refused(engine, Recipe::builder(&model), ERROR)
}

fn pinched(_: &Engine) -> Answer {
    let s = 0.5f64.sqrt();
    let basis = nalgebra::DMatrix::from_row_slice(1, 2, &[s, -s]);
    let model = Model::new(parts(SpectrumKind::Reflectance, vec![1e-9; 2], basis, diagonal([0.02])))
        .expect("it is a model");
    refused(Recipe::builder(&model), |e| {
        matches!(e, RecipeError::Hopeless { .. } | RecipeError::Empty { .. })
    })
}

fn denormal(engine: &Engine) -> Answer {
    let mut basis = nalgebra::DMatrix::zeros(1, 3);
    basis[1] = 1.0;
    let mean = vec![1e-39, 1.0, 1.0];
    let model =
        Model::new(parts(SpectrumKind::Illuminant, mean, basis, diagonal([0.01]))).expect("it is a model");
    drawn_or_refused(engine, Recipe::builder(&model), ERROR)
}

fn scales(engine: &Engine) -> Answer {
    let model = builtin("munsell-vrhel");
    let drawn = [1e-12, 1e-6, 1.0, 100.0, 1e4, 1e6].map(|scale| {
        (format!("{scale:e}"), drawn(engine, Recipe::builder(&model).covariance_scale(scale), ERROR))
    });
    let refused = [1e4, 1e6].map(|scale| {
        let builder = Recipe::builder(&model).covariance_scale(scale).proposal(ProposalKind::Plain);
        let answer = refused(builder, |e| matches!(e, RecipeError::Hopeless { .. }));
        (format!("{scale:e} by plain rejection"), answer)
    });
    all(drawn.into_iter().chain(refused))
}

fn no_variation(engine: &Engine) -> Answer {
    drawn(engine, Recipe::builder(&builtin("munsell-vrhel")).covariance_scale(0.0), ERROR)
}

fn impossible_lrv(_: &Engine) -> Answer {
    let model = builtin("munsell-vrhel");
    all([0.0, 1.0].map(|lrv| {
        let answer = refused(Recipe::builder(&model).lrv(lrv), |e| matches!(e, RecipeError::Lrv(_)));
        (format!("{lrv}"), answer.and_then(|_| good("refused, not between 0 and 1")))
    }))
}

fn dark_lrv(engine: &Engine) -> Answer {
    let model = builtin("munsell-vrhel");
    let both = [1e-46, 1e-39, 1e-30, 1e-6].map(|lrv| {
        [("base", Bounds::Base), ("scaled", Bounds::Scaled)].map(|(name, bounds)| {
            let answer = drawn_or_refused(engine, target(&model, lrv, bounds), SCALED_ERROR);
            (format!("{lrv:e} {name}"), answer)
        })
    });
    all(both.into_iter().flatten())
}

fn largest_lrv(engine: &Engine) -> Answer {
    let model = builtin("munsell-vrhel");
    let recipe = |lrv| target(&model, lrv, Bounds::Scaled);
    let Err(RecipeError::UnreachableLrv { largest, .. }) = recipe(0.999).build() else {
        return Err("an LRV of 0.999 was not refused".to_owned());
    };
    let unreachable = |e: &RecipeError| matches!(e, RecipeError::UnreachableLrv { .. });
    let no_room = |e: &RecipeError| matches!(e, RecipeError::Hopeless { .. } | RecipeError::Empty { .. });
    let said = |answer: Answer, as_what: &str| answer.and_then(|_| good(format!("refused as {as_what}")));
    all([
        ("0.95".to_owned(), drawn(engine, recipe(0.95), SCALED_ERROR)),
        (format!("{largest:.6} - 1e-6"), said(refused(recipe(largest - 1e-6), no_room), "without room")),
        (format!("{largest:.6}"), said(refused(recipe(largest), unreachable), "unreachable")),
        (format!("{largest:.6} + 1e-6"), said(refused(recipe(largest + 1e-6), unreachable), "unreachable")),
    ])
}

fn almost_white(engine: &Engine) -> Answer {
    let grey = model(SpectrumKind::Reflectance, vec![0.5; 31], diagonal([0.01]));
    drawn_or_refused(engine, target(&grey, 1.0 - 1e-9, Bounds::Scaled), SCALED_ERROR)
}

/// Checks limits on attempts: one where all pass; as many as are just enough; fewer; and more than the counter holds.
fn capped(engine: &Engine) -> Answer {
    let model = builtin("munsell-vrhel");
    let plain = || Recipe::builder(&model);
    let acceptance = build(plain())?.acceptance();
    let enough = (1e-12f64.ln() / (-acceptance).ln_1p()).ceil() as u32;
    let hopeless = |e: &RecipeError| matches!(e, RecipeError::Hopeless { .. });
    let out_of_range = |e: &RecipeError| matches!(e, RecipeError::MaxAttempts(_));
    let said = |answer: Answer| answer.and_then(|_| good("refused"));
    all([
        ("1, all pass".to_owned(), drawn(engine, plain().covariance_scale(1e-4).max_attempts(1), ERROR)),
        (format!("{enough}"), drawn(engine, plain().max_attempts(enough), ERROR)),
        (format!("{}", enough - 1), said(refused(plain().max_attempts(enough - 1), hopeless))),
        ("2^31 - 1".to_owned(), drawn(engine, plain().max_attempts(i32::MAX as u32), ERROR)),
        ("2^31".to_owned(), said(refused(plain().max_attempts(1 << 31), out_of_range))),
        ("0".to_owned(), said(refused(plain().max_attempts(0), out_of_range))),
    ])
}
