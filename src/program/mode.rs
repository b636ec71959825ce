//! The most probable valid spectrum: the point of an acceptable polytope that is nearest to the origin of the normals.
//!
//! Bounds on a spectrum are half-spaces in the normals y that are left, and the density falls with |y|, so the mode is the
//! solution of a small quadratic program: minimise |y|^2 where G y >= h. That is least distance programming, which Lawson &
//! Hanson ("Solving Least Squares Problems", 1974, chapter 23) reduce to least squares with coefficients that are not
//! negative: with E = (G h)^T and f = (0 ... 0 1)^T, the residual r = E u - f of the best u >= 0 is 0 exactly where nothing
//! satisfies the bounds, and elsewhere y = -r_j / r_last. It ends after finitely many steps, and tells infeasibility
//! without a second method.

use nalgebra::{DMatrix, DVector};

use super::Program;
use crate::dataset::SpectrumKind;

/// Distance that the mode keeps from its bounds, relative to 1, the largest reflectance: f32 has room there.
pub(crate) const MARGIN: f64 = 1e-6;

/// Distance of a point beyond which nothing is taken to satisfy the bounds, in standard deviations.
const FARTHEST: f64 = 1e4;

/// The normals of the most probable spectrum that a program without given responses accepts, with a [`MARGIN`]; `None`
/// where none does. Reflectances alone have an upper bound. The program scales nothing.
pub(crate) fn mode(program: &Program) -> Option<Vec<f64>> {
    debug_assert!(program.given == 0 && program.target.is_none());
    let (m, spectrum) = (program.components(), &program.spectrum);
    let mut bounds = Vec::new();
    for (band, offset) in spectrum.offset.iter().enumerate() {
        let gain: Vec<f64> = spectrum.gain.iter().map(|gain| gain[band]).collect();
        if program.kind == SpectrumKind::Reflectance {
            let below: Vec<f64> = gain.iter().map(|gain| -gain).collect();
            bounds.push((below, offset + MARGIN - 1.0));
        }
        bounds.push((gain, MARGIN - offset));
    }
    // The mean, mostly.
    if bounds.iter().all(|(_, least)| *least <= 0.0) {
        return Some(vec![0.0; m]);
    }
    nearest_to_origin(m, &bounds)
}

/// The point nearest to the origin whose product with each vector is at least the number beside it.
fn nearest_to_origin(m: usize, bounds: &[(Vec<f64>, f64)]) -> Option<Vec<f64>> {
    // Vectors of length 1, so that one tolerance serves all.
    let mut columns = Vec::new();
    for (vector, least) in bounds {
        let length = vector.iter().map(|v| v * v).sum::<f64>().sqrt();
        if length < 1e-12 {
            if *least > 0.0 {
                return None;
            }
            continue;
        }
        columns.push((vector.iter().map(|v| v / length).collect::<Vec<f64>>(), least / length));
    }
    let e = DMatrix::from_fn(m + 1, columns.len(), |row, column| match row {
        row if row < m => columns[column].0[row],
        _ => columns[column].1,
    });
    let mut f = DVector::zeros(m + 1);
    f[m] = 1.0;
    let residual = not_negative(&e, &f)?;
    // |r|^2 = 1 / (1 + |y|^2)
    if residual.norm_squared() < 1.0 / (1.0 + FARTHEST * FARTHEST) {
        return None;
    }
    Some((0..m).map(|j| -residual[j] / residual[m]).collect())
}

/// The residual E u - f of the best u that has no negative part (Lawson & Hanson, algorithm NNLS).
fn not_negative(e: &DMatrix<f64>, f: &DVector<f64>) -> Option<DVector<f64>> {
    let columns = e.ncols();
    let mut u = vec![0.0; columns];
    let mut passive: Vec<usize> = Vec::new();
    let tolerance = 1e-13 * (1.0 + e.amax());
    let mut residual = -f;
    for _ in 0..10 * columns.max(30) {
        // The column along which the residual falls fastest.
        let slopes = e.tr_mul(&residual);
        let candidate =
            (0..columns).filter(|column| !passive.contains(column) && -slopes[*column] > tolerance);
        let Some(next) = candidate.min_by(|a, b| slopes[*a].total_cmp(&slopes[*b])) else {
            return Some(residual);
        };
        passive.push(next);
        loop {
            let Some(best) = least_squares(e, f, &passive) else {
                // The new column adds nothing to the others.
                passive.pop();
                return Some(residual);
            };
            let blocking = passive.iter().zip(&best).filter(|(_, value)| **value <= 0.0);
            let step = |(column, value): (&usize, &f64)| u[*column] / (u[*column] - value);
            let shortest = blocking.map(step).filter(|step| step.is_finite()).fold(1.0, f64::min);
            if best.iter().all(|value| *value > 0.0) {
                u.fill(0.0);
                passive.iter().zip(&best).for_each(|(&column, &value)| u[column] = value);
                break;
            }
            for (&column, value) in passive.iter().zip(&best) {
                u[column] += shortest * (value - u[column]);
            }
            let before = passive.len();
            passive.retain(|&column| u[column] > 1e-15);
            (0..columns).filter(|column| !passive.contains(column)).for_each(|column| u[column] = 0.0);
            if passive.is_empty() || passive.len() == before {
                break;
            }
        }
        residual = -f;
        passive.iter().for_each(|&column| residual.axpy(u[column], &e.column(column), 1.0));
    }
    Some(residual)
}

/// Coefficients of some columns that come closest to f; `None` where the columns are not independent.
fn least_squares(e: &DMatrix<f64>, f: &DVector<f64>, columns: &[usize]) -> Option<Vec<f64>> {
    if columns.len() > e.nrows() {
        return None;
    }
    let chosen = e.select_columns(columns);
    let qr = chosen.qr();
    let r = qr.r();
    let least = (0..columns.len()).map(|i| r[(i, i)].abs()).fold(f64::INFINITY, f64::min);
    if least < 1e-11 {
        return None;
    }
    let solved = r.solve_upper_triangular(&qr.q().tr_mul(f))?;
    Some(solved.as_slice().to_vec())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::affine::Affine;

    #[test]
    fn points_of_simple_polytopes() {
        let near = |bounds: &[([f64; 2], f64)]| {
            let bounds: Vec<_> = bounds.iter().map(|(vector, least)| (vector.to_vec(), *least)).collect();
            nearest_to_origin(2, &bounds)
        };
        let is = |found: Option<Vec<f64>>, expected: [f64; 2]| {
            let found = found.expect("there is one");
            assert!(
                (found[0] - expected[0]).abs() < 1e-12 && (found[1] - expected[1]).abs() < 1e-12,
                "{found:?}"
            );
        };
        is(near(&[([1.0, 0.0], 2.0)]), [2.0, 0.0]);
        is(near(&[([1.0, 1.0], 2.0)]), [1.0, 1.0]);
        is(near(&[([1.0, 0.0], 1.0), ([0.0, 1.0], 3.0)]), [1.0, 3.0]);
        // The second bound holds where the first is met.
        is(near(&[([1.0, 0.0], 2.0), ([1.0, 1.0], 1.0)]), [2.0, 0.0]);
        is(near(&[([2.0, 0.0], 4.0), ([0.0, -3.0], -9.0)]), [2.0, 0.0]);
        assert_eq!(near(&[([1.0, 0.0], 1.0), ([-1.0, 0.0], 0.0)]), None);
        assert_eq!(near(&[([0.0, 0.0], 1.0)]), None);
        is(near(&[([0.0, 0.0], -1.0), ([1.0, 0.0], 0.5)]), [0.5, 0.0]);
    }

    /// The nearest point y of a convex set is the one with y . (p - y) >= 0 for every other point p of it: held against
    /// random points, and against a vertex that a linear program finds in each direction in which y could be beaten.
    #[test]
    fn the_mode_is_the_nearest_acceptable_point() {
        let mut word = 1u64;
        let mut uniform = || {
            word = word.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
            (word >> 11) as f64 / (1u64 << 53) as f64 - 0.5
        };
        let (mut active, mut impossible) = (0, 0);
        for trial in 0..200 {
            let (m, bands) = (1 + trial % 5, 12);
            let spectrum = Affine {
                offset: (0..bands).map(|_| 0.5 + 1.2 * uniform()).collect(),
                gain: (0..m).map(|_| (0..bands).map(|_| uniform()).collect()).collect(),
            };
            let program = Program::of(SpectrumKind::Reflectance, spectrum);
            let found = mode(&program);
            let least = |direction: &[f64]| least_product(&program, direction);
            let Some(y) = found else {
                assert_eq!(least(&vec![0.0; m]), None, "{trial}: there is a point");
                impossible += 1;
                continue;
            };
            let is_within = |y: &[f64]| {
                (0..bands).all(|band| {
                    let gains = program.spectrum.gain.iter().zip(y);
                    let value = program.spectrum.offset[band] + gains.map(|(g, y)| g[band] * y).sum::<f64>();
                    value > MARGIN - 1e-9 && value < 1.0 - MARGIN + 1e-9
                })
            };
            assert!(is_within(&y), "{trial}");
            let length: f64 = y.iter().map(|y| y * y).sum();
            let product = least(&y).expect("y itself is a point");
            assert!(product > length - 1e-6, "{trial}: {product} {length}");
            active += usize::from(length > 0.0);
            // A point that is farther out is noticed.
            let farther: Vec<f64> = y.iter().map(|y| 1.01 * y).collect();
            let length: f64 = farther.iter().map(|y| y * y).sum();
            assert!(length < 1e-3 || least(&farther).expect("there are points") < length - 1e-6, "{trial}");
        }
        assert!(active > 30 && impossible > 30, "{active} {impossible}");
    }

    /// The least product of a direction with a point within the bounds; `None` where there is none.
    fn least_product(program: &Program, direction: &[f64]) -> Option<f64> {
        use microlp::{ComparisonOp, OptimizationDirection, Problem};
        let mut problem = Problem::new(OptimizationDirection::Minimize);
        let y: Vec<_> = direction.iter().map(|&d| problem.add_var(d, (-1e4, 1e4))).collect();
        for (band, offset) in program.spectrum.offset.iter().enumerate() {
            let gains = program.spectrum.gain.iter().map(|gain| gain[band]);
            let terms: Vec<_> = y.iter().copied().zip(gains).collect();
            problem.add_constraint(&terms, ComparisonOp::Ge, MARGIN - offset);
            problem.add_constraint(&terms, ComparisonOp::Le, 1.0 - MARGIN - offset);
        }
        Some(problem.solve().ok()?.into_solution().ok()?.objective())
    }
}
