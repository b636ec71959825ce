//! Coordinates in which boxes fit a polytope best.

use nalgebra::{DMatrix, DVector, SymmetricEigen};

use super::half_space::HalfSpace;
use super::simplex::Polytope;
use crate::affine::Affine;

/// Weight of the walls relative to the density: enough that the centre of a wide region stays clear of them, and
/// little enough that it stays where the mass is.
const BARRIER: f64 = 0.1;

/// A rotation of the standard normals, which leaves their distribution alone, and a centre within the region. It is
/// the maximiser of -|z|^2 / 2 + 0.1 sum log s, with s the distances from the walls; the axes are the eigenvectors
/// of minus the Hessian there.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Frame {
    /// A column for each axis, k x k, orthogonal.
    pub(super) axes: DMatrix<f64>,
    /// The centre, in the frame's coordinates.
    pub(super) centre: DVector<f64>,
}

impl Frame {
    /// Finds the frame of the region that half-spaces leave, from a point within it.
    pub(super) fn new(half_spaces: &[&HalfSpace], within: &[f64]) -> Frame {
        let mut z = DVector::from_column_slice(within);
        let normals: Vec<_> = half_spaces.iter().map(|h| DVector::from_column_slice(&h.normal)).collect();
        let rooms = |z: &DVector<f64>| -> Vec<f64> {
            half_spaces.iter().zip(&normals).map(|(h, normal)| h.room - normal.dot(z)).collect()
        };
        let value = |z: &DVector<f64>| -> f64 {
            let walls: f64 = rooms(z).iter().map(|&s| if s > 0.0 { s.ln() } else { f64::NEG_INFINITY }).sum();
            BARRIER * walls - z.norm_squared() / 2.0
        };
        let mut curvature = DMatrix::identity(z.len(), z.len());
        // Newton's method; a handful of steps is the rule.
        for _ in 0..100 {
            let (mut gradient, mut hessian) = (-&z, DMatrix::identity(z.len(), z.len()));
            for (s, normal) in rooms(&z).iter().zip(&normals) {
                gradient.axpy(-BARRIER / s, normal, 1.0);
                hessian.ger(BARRIER / (s * s), normal, normal, 1.0);
            }
            curvature.copy_from(&hessian);
            let Some(step) = hessian.cholesky().map(|factor| factor.solve(&gradient)) else { break };
            let gain = gradient.dot(&step);
            let here = value(&z);
            let shorter = std::iter::successors(Some(1.0), |t| Some(t / 2.0)).take(50);
            let next = shorter.map(|t| &z + t * &step).find(|next| value(next) > here);
            let Some(next) = next.filter(|_| gain > 1e-12) else { break };
            z = next;
        }
        let axes = SymmetricEigen::new(curvature).eigenvectors;
        Frame { centre: axes.tr_mul(&z), axes }
    }

    /// The region that half-spaces accept, in the frame's coordinates.
    pub(super) fn polytope(&self, half_spaces: &[&HalfSpace]) -> Polytope {
        let turned = |h: &&HalfSpace| self.axes.tr_mul(&DVector::from_column_slice(&h.normal));
        Polytope {
            normals: half_spaces.iter().flat_map(|h| turned(h).as_slice().to_vec()).collect(),
            rooms: half_spaces.iter().map(|h| h.room).collect(),
            dimensions: self.centre.len(),
        }
    }

    /// Rewrites a map of the standard normals as one of the frame's coordinates relative to its centre.
    pub(crate) fn turned(&self, map: &Affine) -> Affine {
        let mut turned = map.clone();
        for (i, value) in turned.offset.iter_mut().enumerate() {
            let gains = DVector::from_iterator(map.gain.len(), map.gain.iter().map(|row| row[i]));
            let gains = self.axes.tr_mul(&gains);
            *value += gains.dot(&self.centre);
            turned.gain.iter_mut().zip(&gains).for_each(|(row, &g)| row[i] = g);
        }
        turned
    }
}
