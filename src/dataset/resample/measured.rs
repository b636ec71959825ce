//! The measured points of a spectrum, and the gaps between them.

use std::borrow::Cow;
use std::cell::OnceCell;

use crate::grid::Spline;

/// Whether two wavelengths are one, but for what single precision rounds.
pub(super) fn is_same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1.2e-7 * b
}

/// The points of a spectrum that have a value.
pub(super) struct Measured<'a> {
    /// The number of the spectrum in its table, from 1.
    pub(super) number: usize,
    x: Cow<'a, [f64]>,
    y: Cow<'a, [f64]>,
    /// The wavelengths of the table that have no value here.
    missing: Vec<f64>,
    /// The slopes are found once, and only if they are needed.
    slopes: OnceCell<Vec<f64>>,
}

impl<'a> Measured<'a> {
    /// The points of a spectrum that are not NaN; `None` if there are none.
    pub(super) fn new(number: usize, wavelengths: &'a [f64], values: &'a [f64]) -> Option<Measured<'a>> {
        let slopes = OnceCell::new();
        if !values.iter().any(|value| value.is_nan()) {
            let (x, y) = (Cow::Borrowed(wavelengths), Cow::Borrowed(values));
            return Some(Measured { number, x, y, missing: Vec::new(), slopes });
        }
        let points = wavelengths.iter().zip(values);
        let (x, y): (Vec<f64>, Vec<f64>) = points.clone().filter(|(_, value)| !value.is_nan()).unzip();
        let missing = points.filter(|(_, value)| value.is_nan()).map(|(&wavelength, _)| wavelength).collect();
        (!x.is_empty()).then(|| Measured { number, x: x.into(), y: y.into(), missing, slopes })
    }

    /// The value that was measured at this wavelength.
    pub(super) fn exactly(&self, at: f64) -> Option<f64> {
        let right = self.x.partition_point(|&x| x <= at);
        let near = [right.checked_sub(1), Some(right)].into_iter().flatten();
        near.filter(|&i| i < self.x.len()).find(|&i| is_same(at, self.x[i])).map(|i| self.y[i])
    }

    /// The last wavelength with a value at or before this one, and the first one after it.
    pub(super) fn neighbours(&self, at: f64) -> (Option<f64>, Option<f64>) {
        let right = self.x.partition_point(|&x| x <= at);
        (right.checked_sub(1).map(|i| self.x[i]), self.x.get(right).copied())
    }

    /// Whether a value is missing between two neighbours, or nothing was measured there in the whole table.
    pub(super) fn has_gap(&self, gaps: &Gaps, before: f64, after: f64) -> bool {
        let i = self.missing.partition_point(|&x| x <= before);
        self.missing.get(i).is_some_and(|&x| x < after) || gaps.is_between(before, after)
    }

    /// The spline through the points.
    pub(super) fn spline(&self) -> Spline<'_> {
        let slopes = self.slopes.get_or_init(|| Spline::new(&self.x, &self.y).into_slopes());
        Spline::of_slopes(&self.x, &self.y, slopes)
    }
}

/// The intervals between measured wavelengths that are gaps: more than one and a half times as long as those around
/// them, of which eight are looked at and the longer half counts.
pub(super) struct Gaps(Vec<(f64, f64)>);

/// The least number of intervals around one by which it may be called a gap.
const LEAST: usize = 4;

impl Gaps {
    pub(super) fn of(wavelengths: &[f64]) -> Gaps {
        let intervals: Vec<f64> = wavelengths.windows(2).map(|pair| pair[1] - pair[0]).collect();
        let is_gap = |&i: &usize| {
            let around = i.saturating_sub(4)..(i + 5).min(intervals.len());
            let mut others: Vec<f64> = around.filter(|&j| j != i).map(|j| intervals[j]).collect();
            others.sort_by(f64::total_cmp);
            others.len() >= LEAST && intervals[i] > 1.5 * others[others.len() / 2]
        };
        let gaps = (0..intervals.len()).filter(is_gap);
        Gaps(gaps.map(|i| (wavelengths[i], wavelengths[i + 1])).collect())
    }

    /// A wavelength of a range that lies in a gap: `centre` if that does.
    pub(super) fn within(&self, (from, to): (f64, f64), centre: f64) -> Option<f64> {
        if self.0.iter().any(|gap| gap.0 < centre && centre < gap.1) {
            return Some(centre);
        }
        let overlap = self.0.iter().map(|gap| (gap.0.max(from), gap.1.min(to)));
        overlap.into_iter().find(|(from, to)| from < to).map(|(from, to)| (from + to) / 2.0)
    }

    /// Whether there is a gap that begins at or after a wavelength and ends at or before another.
    pub(super) fn is_between(&self, before: f64, after: f64) -> bool {
        let i = self.0.partition_point(|gap| gap.0 < before);
        self.0.get(i).is_some_and(|gap| gap.1 <= after)
    }
}
