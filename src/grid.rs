//! Wavelength grids, and the resampling of measured spectra onto them.
//!
//! Models live on uniform grids; measurements need not. Where a grid point is a measured point its value is taken as
//! it stands; elsewhere a not-a-knot cubic spline interpolates, as the field's MATLAB tools do. Nothing is
//! extrapolated unless [`Extrapolation`] says how.

use std::fmt;
use std::str::FromStr;

/// More bands than any spectrometer gives: a larger request is a slip of the pen.
const MAX_BANDS: usize = 100_000;

/// A uniform grid of wavelengths in nanometres: at least one, increasing.
///
/// Written `start:step:stop`, both ends included:
///
/// ```
/// let grid: spectroll::Grid = "400:10:700".parse()?;
/// assert_eq!(grid.len(), 31);
/// assert_eq!(grid.last(), 700.0);
/// # Ok::<(), spectroll::GridError>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Grid {
    start: f64,
    step: f64,
    len: usize,
}

/// Error returned where something is not a uniform grid of wavelengths.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum GridError {
    #[error("{0:?} is not a grid: write start:step:stop in nm, as in 400:10:700")]
    Syntax(String),
    #[error("{0} is not a wavelength: wavelengths in nm are finite and above 0")]
    NotAWavelength(f64),
    #[error("a step of {0} nm does not increase the wavelength: it must be above 0")]
    Step(f64),
    #[error("the grid ends at {stop} nm, before it starts at {start} nm: write start:step:stop")]
    Reversed { start: f64, stop: f64 },
    #[error(
        "{stop} nm is not a whole number of steps of {step} nm from {start} nm: change the step or an end"
    )]
    Uneven { start: f64, step: f64, stop: f64 },
    #[error("a grid of {0} bands: it must have 1 to {MAX_BANDS}")]
    Count(usize),
    #[error("wavelengths must increase, but number {index} is {after} nm after {before} nm")]
    NotIncreasing { index: usize, before: f64, after: f64 },
    #[error("wavelengths are not evenly spaced: {after} nm follows {before} nm where the step is {step} nm")]
    NotUniform { before: f64, after: f64, step: f64 },
}

impl Grid {
    /// The grid that most of the field's data share, and the default here: 400 to 700 nm by 10 nm, 31 bands.
    pub const DEFAULT: Grid = Grid { start: 400.0, step: 10.0, len: 31 };

    /// Makes a grid of `len` wavelengths from `start` by `step`, both in nm.
    pub fn new(start: f64, step: f64, len: usize) -> Result<Grid, GridError> {
        if !(start.is_finite() && start > 0.0) {
            return Err(GridError::NotAWavelength(start));
        }
        if !(step.is_finite() && step > 0.0) {
            return Err(GridError::Step(step));
        }
        if !(1..=MAX_BANDS).contains(&len) {
            return Err(GridError::Count(len));
        }
        Ok(Grid { start, step, len })
    }

    /// Makes the grid through evenly spaced wavelengths (nm), which may carry rounding errors of 10^-6 of a step.
    pub fn from_wavelengths(wavelengths: &[f64]) -> Result<Grid, GridError> {
        check_increasing(wavelengths)?;
        let [start, .., stop] = *wavelengths else {
            let start = *wavelengths.first().ok_or(GridError::Count(0))?;
            return Grid::new(start, 1.0, 1);
        };
        let step = (stop - start) / (wavelengths.len() - 1) as f64;
        // Wavelengths that were made from a round step must give it back, and not its rounding errors.
        let round = (step * 1e9).round() / 1e9;
        if let Ok(grid) = Grid::new(start, round, wavelengths.len())
            && grid.wavelengths().eq(wavelengths.iter().copied())
        {
            return Ok(grid);
        }
        let grid = Grid::new(start, step, wavelengths.len())?;
        for (i, (&measured, even)) in wavelengths.iter().zip(grid.wavelengths()).enumerate().skip(1) {
            if (measured - even).abs() > 1e-6 * step {
                return Err(GridError::NotUniform { before: wavelengths[i - 1], after: measured, step });
            }
        }
        Ok(grid)
    }

    /// The number of bands.
    #[allow(clippy::len_without_is_empty)] // a grid is never empty
    pub fn len(&self) -> usize {
        self.len
    }

    /// The step, nm.
    pub fn step(&self) -> f64 {
        self.step
    }

    /// The first wavelength, nm.
    pub fn first(&self) -> f64 {
        self.start
    }

    /// The last wavelength, nm.
    pub fn last(&self) -> f64 {
        self.wavelength(self.len - 1)
    }

    /// The wavelength of a band, nm.
    pub fn wavelength(&self, band: usize) -> f64 {
        self.start + band as f64 * self.step
    }

    /// Every wavelength in order, nm.
    pub fn wavelengths(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.len).map(|band| self.wavelength(band))
    }
}

impl fmt::Display for Grid {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        write!(f, "{}:{}:{}", self.first(), self.step, self.last())
    }
}

impl FromStr for Grid {
    type Err = GridError;

    fn from_str(text: &str) -> Result<Grid, GridError> {
        let parts: Result<Vec<f64>, _> = text.split(':').map(|part| part.trim().parse()).collect();
        let Ok([start, step, stop]) = parts.as_deref() else {
            return Err(GridError::Syntax(text.to_owned()));
        };
        let (start, step, stop) = (*start, *step, *stop);
        Grid::new(start, step, 1)?;
        if !stop.is_finite() {
            return Err(GridError::NotAWavelength(stop));
        }
        if stop < start {
            return Err(GridError::Reversed { start, stop });
        }
        let steps = (stop - start) / step;
        if (steps - steps.round()).abs() > 1e-6 {
            return Err(GridError::Uneven { start, step, stop });
        }
        Grid::new(start, step, (steps.round() as usize).saturating_add(1)) // the count is checked there
    }
}

/// Checks that wavelengths are finite, positive and strictly increasing.
pub(crate) fn check_increasing(wavelengths: &[f64]) -> Result<(), GridError> {
    if let Some(&bad) = wavelengths.iter().find(|w| !(w.is_finite() && **w > 0.0)) {
        return Err(GridError::NotAWavelength(bad));
    }
    match wavelengths.windows(2).position(|pair| pair[1] <= pair[0]) {
        Some(i) => {
            Err(GridError::NotIncreasing { index: i + 2, before: wavelengths[i], after: wavelengths[i + 1] })
        }
        None => Ok(()),
    }
}

/// Treatment of wavelengths at which a spectrum was not measured.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
pub enum Extrapolation {
    /// No value: asking for one is an error.
    #[default]
    Error,
    /// The value at the nearer end of the measurements.
    Hold,
    /// Zero.
    Zero,
}

/// A not-a-knot cubic spline through measured points (a parabola through three, a line through two).
pub(crate) struct Spline<'a> {
    x: &'a [f64],
    y: &'a [f64],
    slopes: Vec<f64>,
}

impl<'a> Spline<'a> {
    /// Makes the spline: `x` increases strictly and is as long as `y`; neither is empty.
    pub(crate) fn new(x: &'a [f64], y: &'a [f64]) -> Self {
        Spline { x, y, slopes: slopes(x, y) }
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
    fn grids_are_read_and_written() {
        let grid: Grid = "400:10:700".parse().unwrap();
        assert_eq!(grid, Grid::DEFAULT);
        assert_eq!(grid.to_string(), "400:10:700");
        let fine: Grid = "400:0.1:400.3".parse().unwrap();
        assert_eq!(Grid::from_wavelengths(&fine.wavelengths().collect::<Vec<_>>()), Ok(fine));
        for (text, message) in [
            ("400-700", "start:step:stop"),
            ("400:10", "start:step:stop"),
            ("700:10:400", "ends at 400 nm, before it starts at 700 nm"),
            ("400:0:700", "does not increase"),
            ("400:-10:700", "does not increase"),
            ("400:7:700", "whole number of steps"),
            ("NaN:1:2", "finite"),
            ("400:1e-9:700", "bands"),
            ("400:1e-300:700", "bands"),
        ] {
            let error = text.parse::<Grid>().unwrap_err().to_string();
            assert!(error.contains(message), "{text}: {error}");
        }
    }

    #[test]
    fn uneven_and_decreasing_wavelengths_are_named() {
        let uneven = Grid::from_wavelengths(&[400.0, 410.0, 425.0]).unwrap_err().to_string();
        assert!(uneven.contains("410 nm follows 400 nm"), "{uneven}");
        let falling = Grid::from_wavelengths(&[400.0, 410.0, 405.0]).unwrap_err().to_string();
        assert!(falling.contains("number 3 is 405 nm after 410 nm"), "{falling}");
    }

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
