//! The bands around the wavelengths of a grid: triangles that fall to 0 at the neighbouring wavelengths, so that those
//! of neighbours sum to 1 and the energy of every line is kept.

use super::measured::Gaps;
use crate::grid::Grid;

/// The ratio of a grid's steps to both sides of a wavelength from which on the longer one is no step but a gap, which no
/// band reaches across.
const BROKEN: f64 = 1.5;

/// The fewest measured wavelengths within a triangle with which the data are finer than the grid there.
const FINER: usize = 3;

/// The bands of a grid, for data at certain wavelengths.
pub(super) struct Bands {
    bands: Vec<Band>,
    is_broken: bool,
}

/// A band: the weights of the measured wavelengths from a first one on.
pub(super) struct Band {
    first: usize,
    weights: Vec<f64>,
    /// The range, nm, within which values must be there: to the neighbours in the grid, but not across its gaps and ends.
    needs: (f64, f64),
    hole: Option<f64>,
}

impl Band {
    /// Whether enough was measured within the triangle for an average.
    pub(super) fn is_finer(&self) -> bool {
        self.weights.len() >= FINER
    }

    /// Whether the average needs a value at a wavelength; what is measured beyond is welcome.
    pub(super) fn needs(&self, wavelength: f64) -> bool {
        (self.needs.0..=self.needs.1).contains(&wavelength)
    }

    /// A wavelength that the average needs, in a gap or beyond the ends of all measurements.
    pub(super) fn hole(&self) -> Option<f64> {
        self.hole
    }

    /// The numbers of the measured wavelengths within the triangle, each with its weight.
    pub(super) fn weights(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (self.first..).zip(self.weights.iter().copied())
    }
}

impl Bands {
    /// The bands of a grid for data at `wavelengths`. The weight of a measured wavelength is the height of the triangle
    /// there times the width that the measurement stands for.
    pub(super) fn new(wavelengths: &[f64], grid: &Grid) -> Bands {
        let gaps = Gaps::of(wavelengths);
        let widths = widths(wavelengths, &gaps);
        let reaches: Vec<(f64, f64)> = (0..grid.len()).map(|band| steps(grid, band)).collect();
        let is_broken = reaches.iter().any(|&(left, right)| is_gap(left, right));
        let last = grid.len() - 1;
        let band = |(number, (left, right)): (usize, (f64, f64))| {
            let centre = grid.wavelength(number);
            let needs = (
                if number == 0 || left > BROKEN * right { centre } else { centre - left },
                if number == last || right > BROKEN * left { centre } else { centre + right },
            );
            let shorter = left.min(right);
            let (left, right) = if is_gap(left, right) { (shorter, shorter) } else { (left, right) };
            let first = wavelengths.partition_point(|&w| w <= centre - left);
            let end = wavelengths.partition_point(|&w| w < centre + right).max(first);
            let height =
                |at: f64| 1.0 - if at < centre { (centre - at) / left } else { (at - centre) / right };
            let weights = (first..end).map(|j| widths[j] * height(wavelengths[j])).collect();
            let is_beyond = centre < wavelengths[0] || centre > wavelengths[wavelengths.len() - 1];
            let hole = if is_beyond { Some(centre) } else { gaps.within(needs, centre) };
            Band { first, weights, needs, hole }
        };
        Bands { bands: reaches.into_iter().enumerate().map(band).collect(), is_broken }
    }

    pub(super) fn iter(&self) -> std::slice::Iter<'_, Band> {
        self.bands.iter()
    }

    /// Whether the grid has gaps, or its wavelengths are those of separate bands.
    pub(super) fn is_broken(&self) -> bool {
        self.is_broken
    }
}

/// The steps of a grid to both sides of a band; beyond its ends they are as within.
fn steps(grid: &Grid, band: usize) -> (f64, f64) {
    if let Some(step) = grid.step() {
        return (step, step);
    }
    let step = |band: usize| grid.wavelength(band + 1) - grid.wavelength(band);
    let last = grid.len() - 2;
    (step(band.saturating_sub(1)), step(band.min(last)))
}

fn is_gap(left: f64, right: f64) -> bool {
    left.max(right) > BROKEN * left.min(right)
}

/// The width for which each measurement stands: half of the intervals to both sides that are no gaps.
fn widths(wavelengths: &[f64], gaps: &Gaps) -> Vec<f64> {
    let mut widths = vec![0.0; wavelengths.len()];
    for (i, pair) in wavelengths.windows(2).enumerate() {
        if !gaps.is_between(pair[0], pair[1]) {
            let half = (pair[1] - pair[0]) / 2.0;
            widths[i] += half;
            widths[i + 1] += half;
        }
    }
    // A measurement between two gaps stands for some width too.
    let least = widths.iter().copied().filter(|&width| width > 0.0).fold(f64::INFINITY, f64::min);
    let least = if least.is_finite() { least } else { 1.0 };
    widths.iter_mut().for_each(|width| *width = width.max(least));
    widths
}
