//! A model made by hand with properties that no fit gives: a mean of the weights other than zero, and a full
//! covariance of deficient rank.

use crate::model::{Model, ModelParts};
use nalgebra::DMatrix;

/// Makes the model: the built-in reflectances with two components dropped, the other four turned into all six
/// weights, and a mean that favours one side of each.
pub fn tinted() -> Model {
    let parts = Model::builtin("munsell-vrhel").expect("it is built in").parts().clone();
    let k = parts.basis.nrows();
    let turn = DMatrix::from_fn(k, k, |i, j| ((7 * i + 3 * j * j + 1) as f64).sin()).qr().q();
    let variances =
        parts.weight_covariance.diagonal().map_with_location(|j, _, v| if j < 4 { 0.2 * v } else { 0.0 });
    let weight_covariance = &turn * DMatrix::from_diagonal(&variances) * turn.transpose();
    let deviations = parts.weight_covariance.diagonal().map(f64::sqrt);
    let weight_mean = deviations.map_with_location(|j, _, d| if j % 2 == 0 { 0.3 * d } else { -0.2 * d });
    let weight_covariance = (&weight_covariance + weight_covariance.transpose()) / 2.0;
    Model::new(ModelParts { weight_mean, weight_covariance, ..parts })
        .expect("a rotated covariance is still one")
}
