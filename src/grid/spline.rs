//! Not-a-knot cubic splines, with which the field's MATLAB tools resample spectra.

use std::borrow::Cow;

use super::Extrapolation;

/// A not-a-knot cubic spline through measured points (a parabola through three, a line through two).
pub(crate) struct Spline<'a> {
    x: &'a [f64],
    y: &'a [f64],
    slopes: Cow<'a, [f64]>,
}

impl<'a> Spline<'a> {
    /// Makes the spline: `x` increases strictly and is as long as `y`; neither is empty.
    pub(crate) fn new(x: &'a [f64], y: &'a [f64]) -> Self {
        Spline { x, y, slopes: slopes(x, y).into() }
    }

    /// Makes a spline again of the slopes that it had.
    pub(crate) fn of_slopes(x: &'a [f64], y: &'a [f64], slopes: &'a [f64]) -> Self {
        Spline { x, y, slopes: slopes.into() }
    }

    /// The slopes, which can be kept where the spline, which borrows its points, cannot.
    pub(crate) fn into_slopes(self) -> Vec<f64> {
        self.slopes.into_owned()
    }

    /// The value at `at`; outside the measured range as `extend` says, where `Error` holds the end value.
    pub(crate) fn at(&self, at: f64, extend: Extrapolation) -> f64 {
        let last = self.x.len() - 1;
        let right = self.x.partition_point(|&x| x <= at);
        if right > 0 && self.x[right - 1] == at {
            return self.y[right - 1];
        }
        if right == 0 || right > last {
            return match extend {
                Extrapolation::Zero => 0.0,
                Extrapolation::Hold | Extrapolation::Error => self.y[if right == 0 { 0 } else { last }],
            };
        }
        let left = right - 1;
        let h = self.x[right] - self.x[left];
        let t = (at - self.x[left]) / h;
        let rise = self.y[right] - self.y[left];
        let a = self.slopes[left] * h - rise;
        let b = rise - self.slopes[right] * h;
        self.y[left] + t * rise + t * (1.0 - t) * (a * (1.0 - t) + b * t)
    }
}

/// The spline's slope at each point: a tridiagonal system, whose end rows say that the third derivative is
/// continuous at the second and the second-to-last point.
fn slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let n = x.len();
    let h: Vec<f64> = x.windows(2).map(|w| w[1] - w[0]).collect();
    let d: Vec<f64> = y.windows(2).zip(&h).map(|(w, h)| (w[1] - w[0]) / h).collect();
    match n {
        1 => return vec![0.0],
        2 => return vec![d[0]; 2],
        3 => {
            let curvature = (d[1] - d[0]) / (h[0] + h[1]);
            return vec![d[0] - curvature * h[0], d[0] + curvature * h[0], d[1] + curvature * h[1]];
        }
        _ => {}
    }
    let (mut lower, mut diagonal, mut upper, mut rhs) =
        (vec![0.0; n], vec![0.0; n], vec![0.0; n], vec![0.0; n]);
    let span = h[0] + h[1];
    diagonal[0] = h[1];
    upper[0] = span;
    rhs[0] = ((h[0] + 2.0 * span) * h[1] * d[0] + h[0] * h[0] * d[1]) / span;
    for i in 1..n - 1 {
        lower[i] = h[i];
        diagonal[i] = 2.0 * (h[i - 1] + h[i]);
        upper[i] = h[i - 1];
        rhs[i] = 3.0 * (h[i] * d[i - 1] + h[i - 1] * d[i]);
    }
    let span = h[n - 2] + h[n - 3];
    lower[n - 1] = span;
    diagonal[n - 1] = h[n - 3];
    rhs[n - 1] = (h[n - 2] * h[n - 2] * d[n - 3] + (2.0 * span + h[n - 2]) * h[n - 3] * d[n - 2]) / span;
    // Elimination without pivoting: after the first row every pivot is at least h[i - 1] + h[i].
    for i in 1..n {
        let factor = lower[i] / diagonal[i - 1];
        diagonal[i] -= factor * upper[i - 1];
        rhs[i] -= factor * rhs[i - 1];
    }
    rhs[n - 1] /= diagonal[n - 1];
    for i in (0..n - 1).rev() {
        rhs[i] = (rhs[i] - upper[i] * rhs[i + 1]) / diagonal[i];
    }
    rhs
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_cubic_is_reproduced_and_measured_points_are_exact() {
        let cubic = |x: f64| 2.0 + x * (-1.0 + x * (0.5 + x * 0.25));
        let x = [1.0, 1.7, 2.0, 3.1, 4.0, 4.2];
        let y = x.map(cubic);
        let spline = Spline::new(&x, &y);
        for i in 0..=320 {
            let at = 1.0 + i as f64 * 0.01;
            assert!((spline.at(at, Extrapolation::Error) - cubic(at)).abs() < 1e-12, "at {at}");
        }
        assert!(x.iter().zip(&y).all(|(&x, &y)| spline.at(x, Extrapolation::Error) == y));
    }

    /// Values of scipy.interpolate.CubicSpline(x, y, bc_type="not-a-knot") at 1.5, 2.5 and 3.5, through the first 6,
    /// 4 and 3 points.
    #[test]
    fn agrees_with_scipy() {
        let x = [1.0, 2.0, 4.0, 5.0, 5.5, 7.0];
        let y = [0.3, -1.0, 2.5, 0.1, 0.7, 3.0];
        for (n, expected) in SCIPY {
            let spline = Spline::new(&x[..n], &y[..n]);
            for (at, value) in [1.5, 2.5, 3.5].into_iter().zip(expected) {
                assert!((spline.at(at, Extrapolation::Hold) - value).abs() < 1e-13, "{n} points at {at}");
            }
        }
        let spline = Spline::new(&x, &y);
        assert_eq!((spline.at(0.5, Extrapolation::Zero), spline.at(9.0, Extrapolation::Hold)), (0.0, 3.0));
    }

    const SCIPY: [(usize, [f64; 3]); 3] = [
        (6, [-1.1626773049645391, 0.11781914893617015, 2.538031914893617]),
        (4, [-0.9791666666666665, -0.2125000000000001, 1.9874999999999998]),
        (3, [-0.6041666666666667, -0.8875, 0.8624999999999996]),
    ];
}
