//! Grids of wavelengths, on which models live, and the spline that brings measured spectra onto them.

mod spline;

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

pub(crate) use spline::Spline;

/// More bands than any spectrometer gives: a larger request is a slip of the pen.
const MAX_BANDS: usize = 100_000;

/// Wavelengths in nanometres: at least one, increasing. Most grids are even; those of a sensor's bands, of many
/// spectrometers and of measurements without the bands that water absorbs are not.
///
/// Written `start:step:stop`, both ends included, or as a list:
///
/// ```
/// let grid: spectroll::Grid = "400:10:700".parse()?;
/// assert_eq!(grid.len(), 31);
/// assert_eq!((grid.last(), grid.step()), (700.0, Some(10.0)));
///
/// let bands: spectroll::Grid = "443, 490, 560, 665".parse()?;
/// assert_eq!((bands.len(), bands.step()), (4, None));
/// assert_eq!(bands.widths(), [23.5, 58.5, 87.5, 52.5]);
/// # Ok::<(), spectroll::GridError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grid(Spacing);

#[derive(Clone, Debug, PartialEq)]
enum Spacing {
    Even {
        start: f64,
        step: f64,
        len: usize,
    },
    /// Three or more: two are always even.
    Uneven(Arc<[f64]>),
}

/// Error returned where something is not a grid of wavelengths.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum GridError {
    #[error(
        "{0:?} is not a grid: write start:step:stop in nm, as in 400:10:700, or a list, as in 443,490,560"
    )]
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
}

impl Grid {
    /// The grid that most of the field's data share, and the default here: 400 to 700 nm by 10 nm, 31 bands.
    pub const DEFAULT: Grid = Grid(Spacing::Even { start: 400.0, step: 10.0, len: 31 });

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
        Ok(Grid(Spacing::Even { start, step, len }))
    }

    /// Makes the grid of these wavelengths (nm), which increase. It is even where they are, to rounding: 10^-6 of a step,
    /// or the precision of `f32` where that holds all of them.
    pub fn from_wavelengths(wavelengths: &[f64]) -> Result<Grid, GridError> {
        check_increasing(wavelengths)?;
        if !(1..=MAX_BANDS).contains(&wavelengths.len()) {
            return Err(GridError::Count(wavelengths.len()));
        }
        let [start, .., stop] = *wavelengths else {
            return Grid::new(wavelengths[0], 1.0, 1);
        };
        let steps = (wavelengths.len() - 1) as f64;
        let step = (stop - start) / steps;
        let is_within = |grid: &Grid, error: f64| {
            grid.wavelengths().zip(wavelengths).all(|(even, given)| (given - even).abs() <= error)
        };
        // Wavelengths that were made from a round step must give it back, and not its rounding errors.
        let round = |step: f64| (step * 1e9).round() / 1e9;
        if let Ok(grid) = Grid::new(start, round(step), wavelengths.len())
            && is_within(&grid, 0.0)
        {
            return Ok(grid);
        }
        let grid = Grid::new(start, step, wavelengths.len())?;
        if is_within(&grid, 1e-6 * step) {
            return Ok(grid);
        }
        if wavelengths.iter().all(|&w| f64::from(w as f32) == w) {
            let (start, stop) = (shortest(start), shortest(stop));
            if let Ok(grid) = Grid::new(start, round((stop - start) / steps), wavelengths.len())
                && is_within(&grid, stop * f64::from(f32::EPSILON))
            {
                return Ok(grid);
            }
        }
        Ok(Grid(Spacing::Uneven(wavelengths.into())))
    }

    /// The number of bands.
    #[allow(clippy::len_without_is_empty)] // a grid is never empty
    pub fn len(&self) -> usize {
        match &self.0 {
            Spacing::Even { len, .. } => *len,
            Spacing::Uneven(wavelengths) => wavelengths.len(),
        }
    }

    /// The step of an even grid, nm; `None` of an uneven one.
    pub fn step(&self) -> Option<f64> {
        match self.0 {
            Spacing::Even { step, .. } => Some(step),
            Spacing::Uneven(_) => None,
        }
    }

    /// The first wavelength, nm.
    pub fn first(&self) -> f64 {
        self.wavelength(0)
    }

    /// The last wavelength, nm.
    pub fn last(&self) -> f64 {
        self.wavelength(self.len() - 1)
    }

    /// The wavelength of a band, nm.
    pub fn wavelength(&self, band: usize) -> f64 {
        match &self.0 {
            Spacing::Even { start, step, .. } => start + band as f64 * step,
            Spacing::Uneven(wavelengths) => wavelengths[band],
        }
    }

    /// Every wavelength in order, nm.
    pub fn wavelengths(&self) -> impl ExactSizeIterator<Item = f64> + '_ {
        (0..self.len()).map(|band| self.wavelength(band))
    }

    /// The weight of each band in an integral over wavelength, nm: the step of an even grid, so that integrals are
    /// sums as in the appendix, and on an uneven one those of the trapezoid rule.
    pub fn widths(&self) -> Vec<f64> {
        match &self.0 {
            Spacing::Even { step, len, .. } => vec![*step; *len],
            Spacing::Uneven(wavelengths) => trapezoid(wavelengths),
        }
    }
}

/// The weights of the trapezoid rule: half the way between the neighbours of each point. `x` has two or more.
pub(crate) fn trapezoid(x: &[f64]) -> Vec<f64> {
    let last = x.len() - 1;
    (0..=last).map(|i| (x[(i + 1).min(last)] - x[i.saturating_sub(1)]) / 2.0).collect()
}

/// The shortest decimal that single precision rounds to this value.
pub(crate) fn shortest(value: f64) -> f64 {
    (value as f32).to_string().parse().expect("a number is read as it was written")
}

/// The most wavelengths that an uneven grid is written out with.
const MAX_WRITTEN: usize = 12;

impl fmt::Display for Grid {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match &self.0 {
            Spacing::Even { step, .. } => write!(f, "{}:{step}:{}", self.first(), self.last()),
            Spacing::Uneven(wavelengths) if wavelengths.len() <= MAX_WRITTEN => {
                let written: Vec<_> = wavelengths.iter().map(f64::to_string).collect();
                f.write_str(&written.join(","))
            }
            Spacing::Uneven(wavelengths) => {
                write!(f, "{} wavelengths from {} to {}", wavelengths.len(), self.first(), self.last())
            }
        }
    }
}

impl FromStr for Grid {
    type Err = GridError;

    fn from_str(text: &str) -> Result<Grid, GridError> {
        let numbers = |separator: char| {
            let parts: Result<Vec<f64>, _> = text.split(separator).map(|part| part.trim().parse()).collect();
            parts.map_err(|_| GridError::Syntax(text.to_owned()))
        };
        if text.contains(',') {
            return Grid::from_wavelengths(&numbers(',')?);
        }
        let [start, step, stop] = numbers(':')?[..] else {
            return Err(GridError::Syntax(text.to_owned()));
        };
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
            ("near,far", "a list"),
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
    fn lists_of_wavelengths_are_grids() {
        let bands: Grid = "443, 490,560,665".parse().unwrap();
        assert_eq!(bands.to_string(), "443,490,560,665");
        assert_eq!(bands.wavelengths().collect::<Vec<_>>(), [443.0, 490.0, 560.0, 665.0]);
        assert_eq!((bands.first(), bands.last(), bands.step()), (443.0, 665.0, None));
        assert_eq!("400,410,420".parse::<Grid>(), "400:10:420".parse());
        let many: Vec<f64> = (0..60).map(|i| 398.0 + 5.0 * f64::from(i) - 0.01 * f64::from(i * i)).collect();
        let many = Grid::from_wavelengths(&many).unwrap();
        assert_eq!(many.to_string(), "60 wavelengths from 398 to 658.19");
        for (text, message) in [
            ("400,410,405", "number 3 is 405 nm after 410 nm"),
            ("400,410,410", "number 3 is 410 nm after 410 nm"),
            ("400,,410", "is not a grid"),
            ("0,410", "0 is not a wavelength"),
        ] {
            let error = text.parse::<Grid>().unwrap_err().to_string();
            assert!(error.contains(message), "{text}: {error}");
        }
    }

    /// The weights of the bands in an integral: constant on an even grid, and the trapezoid rule's on an uneven one.
    #[test]
    fn widths_are_steps_or_those_of_the_trapezoid_rule() {
        assert_eq!("400:10:420".parse::<Grid>().unwrap().widths(), [10.0; 3]);
        assert_eq!("400,410,440".parse::<Grid>().unwrap().widths(), [5.0, 20.0, 15.0]);
        assert_eq!(Grid::from_wavelengths(&[500.0]).unwrap().widths(), [1.0]);
    }

    /// Single precision moves the wavelengths of an even grid by up to 3e-5 nm, which is no unevenness.
    #[test]
    fn wavelengths_in_single_precision_are_even() {
        let step = (701.3 - 399.7) / 39.0;
        let single: Vec<f64> = (0..40).map(|i| f64::from((399.7 + f64::from(i) * step) as f32)).collect();
        let grid = Grid::from_wavelengths(&single).unwrap();
        assert!((grid.step().unwrap() - step).abs() < 1e-9 && grid.first() == 399.7, "{grid:?}");
        let mut moved = single;
        moved[7] = f64::from((moved[7] + 0.001) as f32);
        assert_eq!(Grid::from_wavelengths(&moved).unwrap().step(), None);
    }
}
