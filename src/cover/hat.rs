//! An axis of a box: draws of a standard normal between two ends.

use std::f64::consts::{PI, SQRT_2};

/// Smallest share of an exponential hat that the normal may fill; below it an axis is drawn by its quantiles. An axis
/// as narrow as half a standard deviation fills this much, and there the quantiles' error is 1e-6 of its width.
const EFFICIENT: f64 = 0.99;

/// Width below which a mass comes from the middle of its interval, since a difference of tails would lose digits.
const NARROW: f64 = 1e-3;

/// Probability that a standard normal lies in an interval, to a relative error of 1e-10.
pub(super) fn normal_mass(low: f64, high: f64) -> f64 {
    let (middle, width) = ((low + high) / 2.0, high - low);
    if width < NARROW {
        let curvature = (middle * middle - 1.0) * width * width / 24.0;
        return (-middle * middle / 2.0).exp() * width * (1.0 + curvature) / (2.0 * PI).sqrt();
    }
    let upper_tail = |y: f64| 0.5 * libm::erfc(y / SQRT_2);
    // The difference of the smaller tails.
    if middle > 0.0 { upper_tail(low) - upper_tail(high) } else { upper_tail(-high) - upper_tail(-low) }
}

/// Method by which an axis is drawn, with its numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    /// The four numbers of [`Real::truncated`](crate::Real::truncated).
    pub(super) numbers: [f64; 4],
    /// Mass of the proposals before their costs thin them: at least that of the normal.
    pub(super) mass: f64,
}

impl Axis {
    /// Chooses the method for the interval from `low` to `high`, drawn relative to `centre`.
    pub(super) fn new(low: f64, high: f64, centre: f64) -> Axis {
        let (mass, hat) = (normal_mass(low, high), Hat::new(low, high));
        if mass < EFFICIENT * hat.mass {
            let [above, below] = [high, -low].map(|y| 0.5 * libm::erfc(y / SQRT_2));
            return Axis { numbers: [above, below, mass, -centre], mass };
        }
        let start = if hat.slope > 0.0 { low } else { high };
        let share = (-hat.slope.abs() * (high - low)).exp_m1();
        Axis { numbers: [start - hat.slope, -1.0 / hat.slope, share, hat.slope - centre], mass: hat.mass }
    }
}

/// Exponential above the normal density of an interval, exp(slope^2 / 2 - slope y) / sqrt(2 pi), which touches it at
/// y = slope.
struct Hat {
    slope: f64,
    mass: f64,
}

impl Hat {
    /// Finds the hat of least mass. Its logarithm is convex in the slope, with the derivative slope - mean(y), so the
    /// best slope is the mean of the proposals, and within the interval.
    fn new(low: f64, high: f64) -> Hat {
        let (middle, half) = ((low + high) / 2.0, (high - low) / 2.0);
        let mut slope = middle;
        for _ in 0..50 {
            let (mean, variance) = langevin(slope * half);
            let excess = slope - middle + half * mean;
            let step = excess / (1.0 + half * half * variance);
            slope = (slope - step).clamp(low, high);
            if step.abs() <= 1e-9 * half {
                break;
            }
        }
        // A slope of 0 would divide by 0. This one is as good as level.
        let least = 1e-24 / half;
        if slope.abs() < least {
            slope = least.copysign(middle);
        }
        // The integral of exp(slope^2 / 2 - slope y), from where it is largest.
        let (peak, fall) = (if slope > 0.0 { low } else { high }, 2.0 * half * slope.abs());
        let integral = -(-fall).exp_m1() / slope.abs() * (slope * slope / 2.0 - slope * peak).exp();
        Hat { slope, mass: integral / (2.0 * PI).sqrt() }
    }
}

/// Minus the mean, and the variance, of the density exp(-t y) on [-1, 1]: the Langevin function and its derivative.
fn langevin(t: f64) -> (f64, f64) {
    if t.abs() < 1e-2 {
        let square = t * t;
        return (t / 3.0 * (1.0 - square / 15.0), 1.0 / 3.0 - square / 15.0);
    }
    let sinh = t.abs().min(300.0).sinh();
    (1.0 / t.tanh() - 1.0 / t, 1.0 / (t * t) - 1.0 / (sinh * sinh))
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::*;
    use crate::random::real::DrawOperations;

    const INTERVALS: [(f64, f64); 12] = [
        (-13.0, 13.0),
        (-1.0, 2.0),
        (-0.1, 0.2),
        (-1e-4, 1e-4),
        (0.5, 0.5 + 1e-6),
        (4.0, 13.0),
        (-13.0, -2.5),
        (-9.0, -8.0),
        (6.5, 6.50001),
        (12.9, 13.0),
        (-3.0, -2.0),
        (1.0, 1.6),
    ];

    #[test]
    fn masses_are_those_of_statrs() {
        let normal = Normal::standard();
        for (low, high) in INTERVALS {
            let exact = match low > 0.0 {
                true => normal.sf(low) - normal.sf(high),
                false => normal.cdf(high) - normal.cdf(low),
            };
            let mass = normal_mass(low, high);
            let digits = (f64::EPSILON * 13.0 / (high - low)).max(1e-8); // statrs's own
            assert!((mass / exact - 1.0).abs() < digits, "{low} {high}: {mass:e} {exact:e}");
        }
    }

    /// The distribution of what remains after thinning, by integrating over words.
    #[test]
    fn what_is_drawn_is_the_truncated_normal() {
        const STEPS: u32 = 20_000;
        for (low, high) in INTERVALS {
            let axis = Axis::new(low, high, 0.25);
            let (mut kept, mut mean, mut square) = (0.0, 0.0, 0.0);
            for i in 0..STEPS {
                let [y, cost] = f64::truncated(axis.numbers, i * (u32::MAX / STEPS) + u32::MAX / (2 * STEPS));
                let (y, weight) = (y + 0.25, (-cost / 2.0).exp());
                assert!((low - 1e-9..=high + 1e-9).contains(&y) && cost >= 0.0, "{low} {high}: {y} {cost}");
                kept += weight / f64::from(STEPS);
                mean += weight * (y - low) / f64::from(STEPS);
                square += weight * (y - low).powi(2) / f64::from(STEPS);
            }
            let exact = normal_mass(low, high);
            assert!((kept * axis.mass / exact - 1.0).abs() < 1e-6, "{low} {high}: {kept} {axis:?} {exact:e}");
            assert!(axis.mass >= exact * (1.0 - 1e-12) && kept > 0.98);
            let moments = moments(low, high);
            for (found, exact) in [mean / kept, square / kept].iter().zip(moments) {
                assert!((found / exact - 1.0).abs() < 1e-3, "{low} {high}: {found} {exact}");
            }
        }
    }

    /// The mean and the mean square of y - low, by Simpson's rule.
    fn moments(low: f64, high: f64) -> [f64; 2] {
        let steps = 20_000;
        let width = (high - low) / f64::from(steps);
        let mut sums = [0.0; 3];
        for i in 0..=steps {
            let distance = f64::from(i) * width;
            let factor = if i == 0 || i == steps { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
            let density = factor * (-distance * (low + distance / 2.0)).exp();
            for (sum, power) in sums.iter_mut().zip(0..) {
                *sum += density * distance.powi(power);
            }
        }
        [sums[1] / sums[0], sums[2] / sums[0]]
    }
}
