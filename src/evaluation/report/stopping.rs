//! Rule by which the replicates of the error grow: until the intervals are as narrow as wanted, or the time is over.

use serde::Serialize;

use super::Effort;

/// Width of a 95 % interval in standard errors.
const WIDTH: f64 = 2.0 * 1.96;

/// Numbers of draws are powers of ten, from 10^3 on.
pub(super) const FIRST_POWER: u32 = 3;

/// Stopping rule of the measurement of error against run time.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Rule {
    /// Largest number of draws.
    pub most_draws: u64,
    /// Longest run of an engine, seconds; numbers of draws that take longer are left out.
    pub longest_run: f64,
    /// Smallest number of replicates of a number of draws.
    pub least_replicates: usize,
    /// Width of the interval of an error, relative to the error, at which it needs no more replicates.
    pub error_width: f64,
    /// Width of the interval of the slope at which it needs no more replicates.
    pub slope_width: f64,
}

/// Reason for which the measurement ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum Stop {
    /// All intervals are as narrow as wanted.
    Narrow,
    /// The time was over.
    Time,
}

impl Rule {
    pub(super) fn of(effort: Effort) -> Rule {
        Rule {
            most_draws: effort.pick(1_000_000, 10_000_000, 100_000_000),
            longest_run: effort.pick(0.15, 0.6, 30.0),
            least_replicates: effort.pick(5, 6, 8),
            error_width: effort.pick(0.6, 0.4, 0.2),
            slope_width: effort.pick(0.1, 0.05, 0.02),
        }
    }

    /// Whether all intervals of curves are as narrow as wanted.
    pub(super) fn is_met(&self, curves: &[Vec<Spread>]) -> bool {
        let narrow = |curve: &Vec<Spread>| {
            slope_width(curve) <= self.slope_width && curve.iter().all(|s| s.width() <= self.error_width)
        };
        curves.iter().all(narrow)
    }

    /// The number of draws that most needs further replicates, and how many, of those that fit the seconds that are
    /// left: the one with the widest interval, relative to its cost once all are narrow and only the slope is not.
    pub(super) fn next(&self, sizes: &[Size], left: f64) -> Option<(u64, usize)> {
        let fit = |size: &&Size| size.round_seconds <= left;
        let wide = sizes.iter().filter(fit).filter(|size| size.width > self.error_width);
        let widest = wide.max_by(|a, b| a.width.total_cmp(&b.width));
        let cheapest = || {
            let gain = |size: &Size| size.width / size.replicates as f64 / size.round_seconds;
            sizes.iter().filter(fit).max_by(|a, b| gain(a).total_cmp(&gain(b)))
        };
        let size = widest.or_else(cheapest)?;
        let affordable = (left / size.round_seconds.max(1e-9)) as usize;
        Some((size.draws, (size.replicates / 4).clamp(1, affordable.max(1))))
    }
}

/// Number of draws that was measured, for [`Rule::next`].
#[derive(Clone, Copy, Debug)]
pub(super) struct Size {
    pub(super) draws: u64,
    pub(super) replicates: usize,
    /// Widest interval of a curve at it, relative to the error.
    pub(super) width: f64,
    /// Time of a replicate of every curve, seconds.
    pub(super) round_seconds: f64,
}

/// Error of a number of draws, with its own standard error.
#[derive(Clone, Copy, Debug)]
pub(super) struct Spread {
    pub(super) draws: u64,
    /// Standard error of the error, relative to it.
    pub(super) relative: f64,
}

impl Spread {
    /// From the errors of replicates: that of their root mean square, which is half that of their mean square.
    pub(super) fn of(draws: u64, errors: &[f64]) -> Spread {
        let n = errors.len() as f64;
        let mean = errors.iter().map(|e| e * e).sum::<f64>() / n;
        let variance = errors.iter().map(|e| (e * e - mean).powi(2)).sum::<f64>() / (n - 1.0);
        Spread { draws, relative: 0.5 * (variance / n).sqrt() / mean }
    }

    /// Width of the 95 % interval, relative to the error.
    pub(super) fn width(&self) -> f64 {
        WIDTH * self.relative
    }
}

/// Width of the 95 % interval of the slope of log error over log draws.
fn slope_width(curve: &[Spread]) -> f64 {
    let x: Vec<f64> = curve.iter().map(|s| (s.draws as f64).ln()).collect();
    let mean = x.iter().sum::<f64>() / x.len() as f64;
    let squares: f64 = x.iter().map(|x| (x - mean).powi(2)).sum();
    let variance: f64 = x.iter().zip(curve).map(|(x, s)| ((x - mean) / squares * s.relative).powi(2)).sum();
    WIDTH * variance.sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    const RULE: Rule = Rule {
        most_draws: 1_000_000,
        longest_run: 1.0,
        least_replicates: 5,
        error_width: 0.4,
        slope_width: 0.05,
    };

    fn spread(draws: u64, relative: f64) -> Spread {
        Spread { draws, relative }
    }

    #[test]
    fn narrow_intervals_end_it_and_wide_ones_do_not() {
        let curve = |relative| (3..=6).map(|p| spread(10u64.pow(p), relative)).collect::<Vec<_>>();
        // Over 4 decades the slope's standard error is 1 / (2.303 √5) of that of each error.
        assert!((slope_width(&curve(0.1)) - WIDTH * 0.1 / 5.149).abs() < 1e-4);
        assert!(RULE.is_met(&[curve(0.06), curve(0.05)]));
        assert!(!RULE.is_met(&[curve(0.06), curve(0.07)])); // the slope of one
        let mut one_wide = curve(0.01);
        one_wide[1].relative = 0.11;
        assert!(!RULE.is_met(&[one_wide]));
    }

    #[test]
    fn replicates_go_where_they_are_needed() {
        let size = |draws, replicates, width, round_seconds| Size { draws, replicates, width, round_seconds };
        let sizes = [size(1000, 40, 0.3, 0.01), size(10_000, 8, 0.9, 0.1), size(100_000, 6, 1.0, 5.0)];
        assert_eq!(RULE.next(&sizes, 60.0), Some((100_000, 1)));
        assert_eq!(RULE.next(&sizes, 1.0), Some((10_000, 2)));
        assert_eq!(RULE.next(&sizes, 0.15), Some((10_000, 1)));
        assert_eq!(RULE.next(&sizes, 0.05), Some((1000, 5))); // nothing else fits
        assert_eq!(RULE.next(&sizes, 0.001), None);
    }

    #[test]
    fn the_error_of_an_error_falls_with_the_replicates() {
        let errors = |n: usize| (0..n).map(|i| 1.0 + 0.5 * (i as f64 * 1.7).sin()).collect::<Vec<_>>();
        let [few, many] = [100, 1600].map(|n| Spread::of(10, &errors(n)).relative);
        assert!((few / many - 4.0).abs() < 0.2, "{few} {many}");
    }
}
