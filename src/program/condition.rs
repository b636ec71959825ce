//! A model's Gaussian, given the responses of some sensors to its spectra, such as their tristimulus values.
//!
//! Responses are linear in the standard normals of a draw: c = a + A z, where A has n rows. Given c, z is normal on an
//! affine subspace: z = z0 + N y, where z0 = A^+ (c - a) is its shortest point, the columns of N are an orthonormal basis
//! of the directions that leave c alone, and y are k - n standard normals. That is the conditional mean and covariance in
//! closed form, in the frame where the covariance is 1; all else that is linear in z follows. Neither A^+ nor N depends on
//! c: as a map of (c, y), one program serves draws that each have responses of their own.

use nalgebra::{DMatrix, DVector};

use crate::affine::Affine;

/// Singular values below this part of the largest do not count: the responses do not vary freely.
const NEGLIGIBLE: f64 = 1e-9;

/// Effect of given responses on the normals of a model.
#[derive(Clone, Debug)]
pub(crate) struct Condition {
    /// a, the responses at z = 0.
    at_zero: DVector<f64>,
    /// A^+, k rows of n.
    inverse: DMatrix<f64>,
    /// N, k rows of k - n.
    free: DMatrix<f64>,
}

impl Condition {
    /// Makes the condition of a map of n responses. `None` where they cannot be given freely, or where nothing is left to
    /// draw: with n components or fewer, or a covariance that varies in no more than n directions.
    pub(crate) fn new(responses: &Affine) -> Option<Condition> {
        let (n, k) = (responses.offset.len(), responses.gain.len());
        if k <= n {
            return None;
        }
        let map = DMatrix::from_fn(n, k, |row, column| responses.gain[column][row]);
        // Values without vectors: with them nalgebra's are wrong where rows are nearly alike.
        let singular = map.singular_values();
        let largest = singular.max();
        if largest == 0.0 || singular.min() < NEGLIGIBLE * largest {
            return None;
        }
        // A^T = Q R, so that A^+ = Q (R^T)^-1, and the columns of Q span what the rows of A do.
        let qr = map.transpose().qr();
        let (q, r) = (qr.q(), qr.r());
        let inverse = r.solve_upper_triangular(&q.transpose())?.transpose();
        Some(Condition {
            at_zero: DVector::from_column_slice(&responses.offset),
            inverse,
            free: complement(&q.transpose()),
        })
    }

    /// A map of z as one of y, given these responses.
    pub(crate) fn given(&self, responses: &[f64], map: &Affine) -> Affine {
        let origin = &self.inverse * (DVector::from_column_slice(responses) - &self.at_zero);
        let shift = mix(map, origin.as_slice());
        let offset = map.offset.iter().zip(shift).map(|(offset, by)| offset + by).collect();
        Affine { offset, gain: self.free(map) }
    }

    /// A map of z as one of (c, y): of the responses that are given to a draw, and of the normals that are left.
    pub(crate) fn open(&self, map: &Affine) -> Affine {
        let shift = mix(map, (&self.inverse * -&self.at_zero).as_slice());
        let offset = map.offset.iter().zip(shift).map(|(offset, by)| offset + by).collect();
        let of_responses = self.inverse.column_iter().map(|column| mix(map, column.as_slice()));
        Affine { offset, gain: of_responses.chain(self.free(map)).collect() }
    }

    /// Change of a map's values per unit of each of y.
    fn free(&self, map: &Affine) -> Vec<Vec<f64>> {
        self.free.column_iter().map(|column| mix(map, column.as_slice())).collect()
    }
}

/// The sum of a map's gains, each times its part of `by`.
fn mix(map: &Affine, by: &[f64]) -> Vec<f64> {
    let mut sum = vec![0.0; map.offset.len()];
    for (gain, by) in map.gain.iter().zip(by) {
        sum.iter_mut().zip(gain).for_each(|(sum, gain)| *sum += gain * by);
    }
    sum
}

/// Orthonormal columns that are orthogonal to the orthonormal `rows`: what is left of the unit vectors, the longest
/// first. Each is made orthogonal twice, which is enough (Parlett 1998, section 6.9).
fn complement(rows: &DMatrix<f64>) -> DMatrix<f64> {
    let k = rows.ncols();
    let mut found: Vec<DVector<f64>> = rows.row_iter().map(|row| row.transpose()).collect();
    while found.len() < k {
        let orthogonal = |mut vector: DVector<f64>| {
            found.iter().for_each(|other| vector -= other * other.dot(&vector));
            vector
        };
        let left = (0..k).map(|i| orthogonal(DVector::from_fn(k, |j, _| f64::from(i == j))));
        let longest = left.max_by(|a, b| a.norm().total_cmp(&b.norm())).expect("k is not 0");
        let next = orthogonal(longest).normalize();
        found.push(next);
    }
    DMatrix::from_columns(&found[rows.nrows()..])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colorimetry::xyz_weights;
    use crate::model::Model;
    use crate::program::Program;

    fn surfaces() -> (Model, Program, Affine) {
        let model = Model::builtin("munsell-vrhel").unwrap();
        let program = Program::new(&model, &model.weight_map(1.0));
        let xyz = program.spectrum.project(&xyz_weights(model.grid()).unwrap());
        (model, program, xyz)
    }

    #[test]
    fn given_tristimulus_values_do_not_vary() {
        let (_, program, xyz) = surfaces();
        let target = [0.3, 0.4, 0.2];
        let given = Condition::new(&xyz).unwrap().given(&target, &xyz);
        assert!(given.offset.iter().zip(target).all(|(found, wanted)| (found - wanted).abs() < 1e-14));
        assert_eq!(given.gain.len(), program.components() - 3);
        assert!(given.gain.iter().flatten().all(|gain| gain.abs() < 1e-15));
    }

    /// Against the textbook: mean + C A' (A C A')^-1 (xyz - a) and C - C A' (A C A')^-1 A C of the weights.
    #[test]
    fn mean_and_covariance_are_the_closed_form() {
        let (model, _, xyz) = surfaces();
        let target = [0.25, 0.3, 0.2];
        let map = model.weight_map(1.0);
        let given = Condition::new(&xyz).unwrap().given(&target, &map);
        let k = model.components();
        let factor = DMatrix::from_fn(k, k, |row, column| map.gain[column][row]);
        let a = DMatrix::from_fn(3, k, |row, column| xyz.gain[column][row]); // of z: a = A factor
        let inverse = (&a * a.transpose()).try_inverse().unwrap();
        let difference = DVector::from_fn(3, |i, _| target[i] - xyz.offset[i]);
        let mean = DVector::from_column_slice(&map.offset) + &factor * a.transpose() * &inverse * difference;
        let kept = DMatrix::identity(k, k) - a.transpose() * inverse * &a;
        let covariance = &factor * kept * factor.transpose();
        let gain = DMatrix::from_fn(k, k - 3, |row, column| given.gain[column][row]);
        assert!((DVector::from_column_slice(&given.offset) - mean).amax() < 1e-12);
        assert!((&gain * gain.transpose() - covariance).amax() < 1e-12);
    }

    /// One map of (c, y) is every map of y, whatever c.
    #[test]
    fn responses_of_each_draw_are_inputs_like_normals() {
        let (_, program, xyz) = surfaces();
        let condition = Condition::new(&xyz).unwrap();
        let open = condition.open(&program.spectrum);
        assert_eq!(open.gain.len(), program.components());
        for target in [[0.25, 0.3, 0.2], [0.9, 0.9, 0.8]] {
            let (each, own) = (open.at(&target), condition.given(&target, &program.spectrum));
            assert!(each.offset.iter().zip(&own.offset).all(|(a, b)| (a - b).abs() < 1e-13));
            assert_eq!(each.gain, own.gain);
        }
        // The responses themselves are the inputs.
        let own = condition.open(&xyz);
        assert!(own.offset.iter().all(|offset| offset.abs() < 1e-14));
        for (input, gain) in own.gain.iter().enumerate() {
            let expected = |row: usize| f64::from(u8::from(row == input));
            assert!(gain.iter().enumerate().all(|(row, gain)| (gain - expected(row)).abs() < 1e-14));
        }
    }

    #[test]
    fn what_does_not_vary_in_four_directions_is_refused() {
        let (_, _, xyz) = surfaces();
        let of = |gain: Vec<Vec<f64>>| Condition::new(&Affine { offset: xyz.offset.clone(), gain });
        assert!(of(xyz.gain[..3].to_vec()).is_none());
        assert!(of(vec![xyz.gain[0].clone(); 6]).is_none());
        assert!(of(vec![vec![0.0; 3]; 6]).is_none());
    }
}
