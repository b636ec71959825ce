//! The singular values and vectors of data, checked before a model is made of them.
//!
//! nalgebra's `SVD` with vectors gives wrong values, by up to a half, where an entry of its last 2 x 2 block is tiny
//! beside the rest (dimforge/nalgebra #1172): centring leaves such an entry in data of no more spectra than bands, and so
//! do repeated spectra and exact low rank. Here a QR decomposition makes the matrix square, the eigenvectors of its Gram
//! matrix come near the singular vectors, and the one-sided Jacobi method ends what rounding left of the way. That method
//! finds small values to as many digits as large ones (Demmel & Veselić 1992).

use nalgebra::{DMatrix, DVector, SymmetricEigen};

/// The most sweeps over all pairs of vectors. The most that any of 10^5 matrices took was 12.
const SWEEPS: usize = 60;

/// The largest error that is accepted: of values relative to the largest, of products of vectors, and of the total
/// variance relative to itself. Rounding leaves less than a hundredth of it.
const TOLERANCE: f64 = 1e-10;

/// Singular values and vectors of a matrix whose columns are spectra.
#[derive(Clone, Debug)]
pub(super) struct Decomposition {
    /// The singular values, in falling order.
    pub(super) values: DVector<f64>,
    /// The left singular vectors, a row each in the order of the values: the directions of band space. The largest entry
    /// of each is positive, since a decomposition leaves the signs open and a fit must be reproducible.
    pub(super) basis: DMatrix<f64>,
}

impl Decomposition {
    /// Decomposes finite columns whose squares neither overflow nor vanish. `None` where the result does not pass
    /// [`Decomposition::is_right`].
    pub(super) fn of(columns: &DMatrix<f64>) -> Option<Decomposition> {
        // A square matrix of the same singular values; q times its left vectors are those of the columns.
        let (square, q) = if columns.nrows() > columns.ncols() {
            let qr = columns.clone().qr();
            (qr.r(), Some(qr.q()))
        } else {
            (columns.transpose().qr().r().transpose(), None)
        };
        // Any orthonormal start would do; this one is near. QR, since rounding may leave it less than orthonormal.
        let mut vectors = SymmetricEigen::new(&square * square.transpose()).eigenvectors.qr().q();
        let mut images = square.tr_mul(&vectors);
        (0..SWEEPS).find(|_| is_orthogonal_after_a_sweep(&mut images, &mut vectors))?;

        let norms: Vec<f64> = images.column_iter().map(|image| image.norm()).collect();
        let mut order: Vec<usize> = (0..norms.len()).collect();
        order.sort_by(|&a, &b| norms[b].total_cmp(&norms[a]));
        let vectors = vectors.select_columns(&order);
        let mut basis = q.map_or_else(|| vectors.clone(), |q| q * &vectors).transpose();
        for mut vector in basis.row_iter_mut() {
            let largest = vector.iter().copied().fold(0.0, |a: f64, v| if v.abs() > a.abs() { v } else { a });
            if largest < 0.0 {
                vector.neg_mut();
            }
        }
        let values = DVector::from_iterator(order.len(), order.iter().map(|&i| norms[i]));
        let found = Decomposition { values, basis };
        found.is_right(columns).then_some(found)
    }

    /// Whether this decomposes the columns: the vectors are orthonormal, each value is the length of the columns'
    /// projections on its vector, these projections are orthogonal, and nothing of the columns' squares is missing.
    fn is_right(&self, columns: &DMatrix<f64>) -> bool {
        let largest = self.values.max();
        let total = columns.norm_squared();
        let projections = &self.basis * columns;
        let gram = &projections * projections.transpose();
        let near = |a: f64, b: f64, size: f64| (a - b).abs() <= TOLERANCE * size;
        let count = self.values.len();
        let is_value = |i: usize| near(projections.row(i).norm(), self.values[i], largest);
        let is_apart = |i: usize, j: usize| i == j || near(gram[(i, j)], 0.0, largest * largest);
        let products = &self.basis * self.basis.transpose();
        let is_unit = |i: usize, j: usize| near(products[(i, j)], f64::from(u8::from(i == j)), 1.0);
        near(self.values.norm_squared(), total, total)
            && self.values.iter().is_sorted_by(|a, b| a >= b)
            && (0..count).all(is_value)
            && (0..count).all(|i| (0..=i).all(|j| is_apart(i, j) && is_unit(i, j)))
    }
}

/// A sweep of the one-sided Jacobi method: turns pairs of columns of `images`, and those of `vectors` alike, until each
/// pair was orthogonal once. Returns whether there was nothing to turn.
fn is_orthogonal_after_a_sweep(images: &mut DMatrix<f64>, vectors: &mut DMatrix<f64>) -> bool {
    // A tolerance of f64::EPSILON alone is not reached on some matrices: sums of n products err by n of it. And what is
    // negligible beside the largest image cannot be turned exactly.
    let tolerance = f64::EPSILON * images.nrows() as f64;
    let negligible = f64::EPSILON * images.norm() / 100.0;
    let mut is_orthogonal = true;
    for q in 1..images.ncols() {
        for p in 0..q {
            let (x, y) = (images.column(p), images.column(q));
            let (a, b, product) = (x.norm(), y.norm(), x.dot(&y));
            if product.abs() <= (tolerance * a * b).max(negligible * a.max(b)) {
                continue;
            }
            is_orthogonal = false;
            let cotangent = (b - a) * (b + a) / (2.0 * product);
            let tangent = cotangent.signum() / (cotangent.abs() + cotangent.hypot(1.0));
            let cosine = 1.0 / tangent.hypot(1.0);
            for matrix in [&mut *images, &mut *vectors] {
                for row in 0..matrix.nrows() {
                    let (x, y) = (matrix[(row, p)], matrix[(row, q)]);
                    matrix[(row, p)] = cosine * (x - tangent * y);
                    matrix[(row, q)] = cosine * (tangent * x + y);
                }
            }
        }
    }
    is_orthogonal
}

#[cfg(test)]
mod tests {
    use rand::Rng;

    use super::*;
    use crate::dataset::BuiltinTable;
    use crate::random::stream::{Stream, StreamRng};

    fn values(rows: usize, columns: usize, row_by_row: &[f64]) -> DVector<f64> {
        let matrix = DMatrix::from_row_slice(rows, columns, row_by_row);
        Decomposition::of(&matrix).expect("it is decomposed").values
    }

    /// Matrices on which nalgebra's `SVD` with vectors is wrong; values from NumPy.
    #[test]
    fn small_matrices_have_their_published_values() {
        let first = values(3, 3, &[1.0, 2.0, 1.0, -2.0, 2.0, -2.0, -2.0, -2.0, -2.0])[0];
        assert!((first - 4.37300).abs() < 1e-5, "{first}");
        let first = values(3, 3, &[1.0, 2.0, 2.0, 2.0, -1.0, -1.0, 2.0, 1.0, -1.0])[0];
        assert!((first - 3.16228).abs() < 1e-5, "{first}");
        let ones = values(6, 7, &[1.0; 42]);
        assert!((ones[0] - 42f64.sqrt()).abs() < 1e-14 && ones[1] < 1e-14, "{ones}");
        #[rustfmt::skip]
        let second = values(4, 4, &[
            0.0, 0.0, 1.0, 0.0,
            1.0, 0.0, 1.0, 0.0,
            1.0, 1.0, 0.0, 1.0,
            0.0, 1.0, 1.0, 1.0,
        ])[1];
        assert!((second - 2f64.sqrt()).abs() < 1e-4, "{second}");
    }

    /// A number in -1..1.
    fn number(rng: &mut StreamRng) -> f64 {
        f64::from(rng.next_u32()) / 2f64.powi(31) - 1.0
    }

    fn below(rng: &mut StreamRng, n: usize) -> usize {
        rng.next_u32() as usize % n
    }

    fn centred(mut columns: DMatrix<f64>) -> DMatrix<f64> {
        let mean = columns.column_mean();
        columns.column_iter_mut().for_each(|mut column| column -= &mean);
        columns
    }

    /// Some spectra of a measured table at 10 nm, a column each.
    fn measured(rng: &mut StreamRng, table: BuiltinTable, step: usize, count: usize) -> DMatrix<f64> {
        let table = table.table();
        let spectra: Vec<Vec<f64>> = (0..count)
            .map(|_| table.spectrum(below(rng, table.len())).iter().step_by(step).copied().collect())
            .collect();
        DMatrix::from_fn(spectra[0].len(), count, |band, spectrum| spectra[spectrum][band])
    }

    /// A matrix of one of the kinds that a fit meets, and the name of the kind.
    fn example(rng: &mut StreamRng, kind: usize) -> (&'static str, DMatrix<f64>) {
        let count = 2 + below(rng, 19);
        match kind % 9 {
            0 => ("random", centred(DMatrix::from_fn(31, 6, |_, _| number(rng)))),
            1 => ("few papers", centred(measured(rng, BuiltinTable::Munsell, 2, count))),
            2 => ("few surfaces", centred(measured(rng, BuiltinTable::Vrhel, 5, count))),
            3 => {
                let rank = 1 + below(rng, 3);
                let left = DMatrix::from_fn(31, rank, |_, _| number(rng));
                let right = DMatrix::from_fn(rank, count + 2, |_, _| number(rng));
                ("exact low rank", left * right)
            }
            4 => {
                let some = DMatrix::from_fn(31, count, |_, _| number(rng));
                ("repeated spectra", centred(DMatrix::from_fn(31, 2 * count, |i, j| some[(i, j % count)])))
            }
            5 => (
                "integers",
                centred(DMatrix::from_fn(3 + count / 3, count, |_, _| (3.0 * number(rng)).round())),
            ),
            6 => ("tenths", centred(DMatrix::from_fn(31, count, |_, _| (10.0 * number(rng)).round() / 10.0))),
            7 => ("many spectra", centred(measured(rng, BuiltinTable::Munsell, 2, 100 + count))),
            _ => {
                let sizes: Vec<f64> = (0..count).map(|_| 10f64.powf(6.0 * number(rng))).collect();
                ("many sizes", DMatrix::from_fn(31, count, |_, j| sizes[j] * number(rng)))
            }
        }
    }

    /// Singular values without vectors, which nalgebra has right.
    fn check(count: usize, seed: u64) {
        let mut rng = Stream::named(seed, "decomposition").rng();
        let mut worst = 0f64;
        for i in 0..count {
            let (kind, matrix) = example(&mut rng, i);
            if matrix.amax() == 0.0 {
                continue;
            }
            let found = Decomposition::of(&matrix).unwrap_or_else(|| panic!("{kind} {i}: not decomposed"));
            let mut expected: Vec<f64> = matrix.singular_values().iter().copied().collect();
            expected.sort_by(|a, b| b.total_cmp(a));
            let error = found.values.iter().zip(&expected).map(|(a, b)| (a - b).abs() / expected[0]);
            let error = error.fold(0.0, f64::max);
            assert!(error < 1e-12, "{kind} {i}: the values err by {error:e} of the largest");
            worst = worst.max(error);
        }
        println!("{count} matrices: the largest error of a value is {worst:.1e} of the largest value");
    }

    #[test]
    fn two_thousand_matrices_of_all_kinds_are_right() {
        check(2_000, 1);
    }

    #[test]
    #[ignore = "takes minutes: see `make exhaustive`"]
    fn a_hundred_thousand_matrices_of_all_kinds_are_right() {
        check(100_000, 2);
    }

    /// A result that is nearly right, each way in which one can be wrong.
    #[test]
    fn a_wrong_decomposition_is_noticed() {
        let mut rng = Stream::new(3).rng();
        let matrix = centred(DMatrix::from_fn(31, 20, |_, _| number(&mut rng)));
        let right = Decomposition::of(&matrix).unwrap();
        let spoiled = |spoil: fn(&mut Decomposition)| {
            let mut wrong = right.clone();
            spoil(&mut wrong);
            wrong.is_right(&matrix)
        };
        assert!(right.is_right(&matrix));
        assert!(!spoiled(|d| d.values[0] *= 1.0 + 1e-8));
        assert!(!spoiled(|d| d.values.swap_rows(0, 1)));
        assert!(!spoiled(|d| d.basis.swap_rows(0, 1)));
        assert!(!spoiled(|d| d.basis.row_mut(2).scale_mut(1.0 + 1e-8)));
        assert!(!spoiled(|d| {
            let (a, b) = (d.basis.row(0).clone_owned(), d.basis.row(1).clone_owned());
            d.basis.set_row(0, &(&a + &b * 1e-4));
        }));
        assert!(!spoiled(|d| {
            *d = Decomposition {
                values: d.values.rows(0, 5).into_owned(),
                basis: d.basis.rows(0, 5).into_owned(),
            }
        }));
    }
}
