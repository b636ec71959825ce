//! Models at their limits: stiff, deficient and full covariances, one band to a thousand, one component to 64.

use nalgebra::DMatrix;
use rayon::prelude::*;

use super::examine::*;
use super::{Answer, Case, case, within};
use crate::dataset::SpectrumKind;
use crate::engine::Engine;
use crate::evaluation::statistics::tinted;
use crate::model::{Model, ModelError};
use crate::random::stream::Stream;
use crate::recipe::Recipe;

pub(super) const CASES: &[Case] = &[
    case("covariance of condition 1 to 10^12", "the square root loses the small directions", stiff),
    case("two components of zero variance", "a division by a deviation of 0", zero_variance),
    case("two components of equal variance", "directions that no decomposition tells apart", equal_variances),
    case("two basis vectors that are the same", "weights that count twice", duplicate_vectors),
    case("full covariance", "what is not diagonal is left out", full),
    case("full covariance of rank 4 of 6, weights with a mean", "roots of negative round-off", deficient),
    case("covariance that is not positive", "the root of a negative variance", indefinite),
    case("mean 10^6, taken back by the weights' mean", "cancellation in f32", cancelling),
    case("k = 1, 2, 31 and 64", "odd numbers of normals; the form with loops", components),
    case("1 band", "shapes of one", one_band),
    case("1,000 bands", "long shaders; the form with loops", thousand_bands),
];

/// Returns a rotation of k dimensions without any special direction.
fn rotation(k: usize) -> DMatrix<f64> {
    DMatrix::from_fn(k, k, |i, j| ((7 * i + 3 * j * j + 1) as f64).sin()).qr().q()
}

/// Makes reflectances around 1/2 whose covariance has these variances along no axis.
fn turned(variances: &[f64]) -> Model {
    let turn = rotation(variances.len());
    let covariance = &turn * diagonal(variances.iter().copied()) * turn.transpose();
    model(SpectrumKind::Reflectance, vec![0.5; 31], (&covariance + covariance.transpose()) / 2.0)
}

/// Checks each principal direction: the factor's variance to 1e-3, and that of draws in f64 to its standard error.
fn stiff(engine: &Engine) -> Answer {
    all([0, 4, 8, 12].map(|power| {
        let variances: [f64; 6] =
            std::array::from_fn(|i| 0.01 * 10f64.powf(-f64::from(power) * i as f64 / 5.0));
        let model = turned(&variances);
        let (factor, turn) = (model.weight_factor(), rotation(6));
        let by_factor = |i: usize| (factor.transpose() * turn.column(i)).norm_squared() / variances[i] - 1.0;
        let worst = (0..6).map(|i| by_factor(i).abs()).fold(0.0, f64::max);
        let answer = if worst > 1e-3 {
            Err(format!("the factor is off by {worst:.1e} of a variance"))
        } else {
            directions(&model, &turn, &variances).and_then(|()| drawn(engine, Recipe::builder(&model), ERROR))
        };
        (format!("10^{power}"), answer)
    }))
}

/// Checks that draws in f64 have these variances along the columns of `turn`.
fn directions(model: &Model, turn: &DMatrix<f64>, variances: &[f64]) -> Result<(), String> {
    let oracle = build(Recipe::builder(model))?.scalar_sampler::<f64>();
    let weights: Vec<_> = (0..DRAWS)
        .into_par_iter()
        .map(|i| oracle.draw(Stream::named(2, "stress"), i))
        .map(|drawn| turn.transpose() * model.project(drawn.spectrum()))
        .collect();
    for (i, &variance) in variances.iter().enumerate() {
        let found = weights.iter().map(|w| w[i] * w[i]).sum::<f64>() / DRAWS as f64;
        let sigmas = (found / variance - 1.0).abs() / (2.0 / DRAWS as f64).sqrt();
        if variance > 0.0 && sigmas > SIGMAS {
            return Err(format!("direction {i} has the variance {found:.3e} instead of {variance:.3e}"));
        }
        // The root of what rounding leaves of a largest variance.
        if variance == 0.0 && found > 1e-15 * variances[0] {
            return Err(format!("direction {i} has the variance {found:.1e} instead of none"));
        }
    }
    Ok(())
}

fn zero_variance(engine: &Engine) -> Answer {
    let variances = [0.01, 0.0, 0.001, 0.0];
    let model = model(SpectrumKind::Reflectance, vec![0.5; 31], diagonal(variances));
    directions(&model, &DMatrix::identity(4, 4), &variances)?;
    drawn(engine, Recipe::builder(&model), ERROR)
}

fn equal_variances(engine: &Engine) -> Answer {
    let variances = [0.004, 0.002, 0.002, 0.001];
    let model = turned(&variances);
    directions(&model, &rotation(4), &variances)?;
    drawn(engine, Recipe::builder(&model), ERROR)
}

fn duplicate_vectors(_: &Engine) -> Answer {
    let mut basis = cosines(3, 31);
    let copy = basis.row(1).into_owned();
    basis.set_row(2, &copy);
    match Model::new(parts(SpectrumKind::Reflectance, vec![0.5; 31], basis, diagonal([0.01; 3]))) {
        Err(e @ ModelError::NotOrthonormal { .. }) => super::good(format!("refused: {e}")),
        other => Err(format!("{other:?}")),
    }
}

fn full(engine: &Engine) -> Answer {
    let variances = [0.006, 0.003, 0.001, 0.0005, 0.0002, 0.0001];
    let model = turned(&variances);
    directions(&model, &rotation(6), &variances)?;
    drawn(engine, Recipe::builder(&model), ERROR)
}

fn deficient(engine: &Engine) -> Answer {
    let variances = [0.006, 0.003, 0.001, 0.0005, 0.0, 0.0];
    directions(&turned(&variances), &rotation(6), &variances)?;
    drawn(engine, Recipe::builder(&tinted()), ERROR)
}

fn indefinite(_: &Engine) -> Answer {
    match Model::new(parts(
        SpectrumKind::Reflectance,
        vec![0.5; 31],
        cosines(2, 31),
        diagonal([0.01, -0.001]),
    )) {
        Err(e @ ModelError::NotPositive { .. }) => super::good(format!("refused: {e}")),
        other => Err(format!("{other:?}")),
    }
}

/// Checks offsets that cancel: they are added in f64, before anything is rounded, so the bound is that of their
/// rounding errors there.
fn cancelling(engine: &Engine) -> Answer {
    let mut parts =
        parts(SpectrumKind::Reflectance, vec![1e6 + 0.5; 31], cosines(3, 31), diagonal([0.01, 0.004, 0.001]));
    parts.weight_mean[0] = -1e6 * 31f64.sqrt();
    let model = Model::new(parts).expect("the parts are a model");
    drawn(engine, Recipe::builder(&model), ERROR)
}

/// Checks many components: a sum of 64 terms rounds more often than one of 6.
fn components(engine: &Engine) -> Answer {
    all([(1, 31), (2, 31), (31, 31), (64, 64)].map(|(k, bands)| {
        let covariance = diagonal((0..k).map(|j| 0.02 / (1.0 + j as f64).powi(2)));
        let model = model(SpectrumKind::Reflectance, vec![0.5; bands], covariance);
        (format!("k = {k}"), drawn(engine, Recipe::builder(&model), ERROR * f64::max(1.0, k as f64 / 32.0)))
    }))
}

fn one_band(engine: &Engine) -> Answer {
    drawn(engine, Recipe::builder(&model(SpectrumKind::Reflectance, vec![0.5], diagonal([0.04]))), ERROR)
}

fn thousand_bands(engine: &Engine) -> Answer {
    let covariance = diagonal((0..6).map(|j| 3.0 / 10f64.powi(j)));
    let recipe = build(Recipe::builder(&model(SpectrumKind::Reflectance, vec![0.5; 1000], covariance)))?;
    let examined = examine(engine, &recipe, Stream::named(1, "stress").draws(0..1000))?;
    within(format!("1000 draws, {}", attempts(&examined)), examined.error, ERROR)
}
