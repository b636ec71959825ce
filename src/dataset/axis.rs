//! Numbers that may be wavelengths: the checks that every reader applies to what it takes for them.

use std::fmt;

use super::units::WavelengthUnit;

/// Range of wavelengths that are taken for such, in nm: from the vacuum ultraviolet to the far infrared. Pixels,
/// counters, micrometres and values of spectra lie below it.
pub(super) const RANGE: [f64; 2] = [100.0, 1e6];

/// Reason for which numbers are no wavelengths.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum AxisFault {
    /// Fewer than one.
    None,
    /// The number at this index, which is not finite.
    NotFinite(usize, f64),
    /// Two indices of one value.
    Repeated(usize, usize, f64),
    /// An index at which they turn from rising to falling or back.
    Turns(usize, f64, f64),
    /// 0, 1, 2 ... or 1, 2, 3 ...
    Counter(f64, f64),
    /// Outside the [range](RANGE): lowest and highest, in the unit that they were taken to be in.
    Range(f64, f64),
}

impl AxisFault {
    /// The unit in which they might be wavelengths.
    pub(super) fn guess(&self) -> Option<WavelengthUnit> {
        match *self {
            AxisFault::Range(low, high) => WavelengthUnit::guess(low, high),
            _ => None,
        }
    }
}

impl fmt::Display for AxisFault {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        match *self {
            AxisFault::None => write!(f, "there are none"),
            AxisFault::NotFinite(i, value) => write!(f, "number {} is {value}", i + 1),
            AxisFault::Repeated(a, b, value) => {
                write!(f, "{value} stands twice, as number {} and as number {}", a + 1, b + 1)
            }
            AxisFault::Turns(i, before, after) => {
                write!(
                    f,
                    "number {} is {after} after {before}, where those before it run the other way",
                    i + 1
                )
            }
            AxisFault::Counter(first, last) => write!(f, "they count from {first} to {last}"),
            AxisFault::Range(low, high) => match self.guess() {
                Some(unit) => write!(
                    f,
                    "they run from {low} to {high}, which no wavelengths in nm do; are they in {unit}?"
                ),
                None => write!(f, "they run from {low} to {high}, which no wavelengths in nm do"),
            },
        }
    }
}

/// Checks that `values` are wavelengths in nm, rising or falling. Wavenumbers are to be converted before.
pub(super) fn check(values: &[f64]) -> Result<(), AxisFault> {
    monotone(values)?;
    let (first, last) = (values[0], values[values.len() - 1]);
    let (low, high) = (first.min(last), first.max(last));
    if is_counter(values) {
        return Err(AxisFault::Counter(first, last));
    }
    if low < RANGE[0] || high > RANGE[1] {
        return Err(AxisFault::Range(low, high));
    }
    Ok(())
}

/// Checks that `values` are finite and rise or fall throughout.
pub(super) fn monotone(values: &[f64]) -> Result<(), AxisFault> {
    let (Some(&first), Some(&last)) = (values.first(), values.last()) else { return Err(AxisFault::None) };
    if let Some(i) = values.iter().position(|v| !v.is_finite()) {
        return Err(AxisFault::NotFinite(i, values[i]));
    }
    let falls = last < first;
    let turn = |pair: &[f64]| if falls { pair[1] >= pair[0] } else { pair[1] <= pair[0] };
    let Some(i) = values.windows(2).position(turn) else { return Ok(()) };
    // A value that is there twice is the better message, wherever the two are.
    let at = i + 1;
    match values[..at].iter().position(|v| *v == values[at]) {
        Some(first) => Err(AxisFault::Repeated(first, at, values[at])),
        None => Err(AxisFault::Turns(at, values[i], values[at])),
    }
}

/// Whether they are 0, 1, 2 ... or 1, 2, 3 ...
pub(super) fn is_counter(values: &[f64]) -> bool {
    let Some(&first) = values.first() else { return false };
    (first == 0.0 || first == 1.0) && values.iter().enumerate().all(|(i, v)| *v == first + i as f64)
}

/// Whether they are whole numbers that count up by one, as numbers of samples do.
pub(super) fn counts(values: &[f64]) -> bool {
    values.len() > 1 && values[0].fract() == 0.0 && values.windows(2).all(|pair| pair[1] - pair[0] == 1.0)
}

/// Whether they have one step, to a thousandth of it: what hardly any other numbers than wavelengths have.
pub(super) fn is_even(values: &[f64]) -> bool {
    let [first, .., last] = *values else { return false };
    let step = (last - first) / (values.len() - 1) as f64;
    values.len() >= 4 && values.windows(2).all(|pair| (pair[1] - pair[0] - step).abs() <= 1e-3 * step.abs())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_no_axis_says_why() {
        let even: Vec<f64> = (0..31).map(|i| 400.0 + 10.0 * f64::from(i)).collect();
        assert_eq!(check(&even), Ok(()));
        assert_eq!(check(&even.iter().rev().copied().collect::<Vec<_>>()), Ok(()));
        for (values, message) in [
            (vec![], "there are none"),
            (vec![400.0, f64::NAN], "number 2 is NaN"),
            (vec![400.0, 410.0, 410.0], "410 stands twice, as number 2 and as number 3"),
            (vec![400.0, 410.0, 405.0, 420.0], "number 3 is 405 after 410"),
            (vec![1.0, 2.0, 3.0], "they count from 1 to 3"),
            (vec![0.4, 0.5, 0.7], "are they in um?"),
            (vec![-5.0, 5.0], "which no wavelengths in nm do"),
        ] {
            assert!(check(&values).unwrap_err().to_string().contains(message), "{values:?}");
        }
        assert!(
            is_even(&even)
                && !counts(&even)
                && counts(&[1001.0, 1002.0])
                && !is_even(&[400.0, 410.0, 425.0, 430.0])
        );
    }
}
