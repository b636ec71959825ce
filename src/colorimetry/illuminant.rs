//! Illuminants that surfaces are seen under: those of the CIE by name, daylights by their temperature, and any other by
//! its power in each band.

use serde::{Deserialize, Serialize};

use super::{d65, illuminant_a, on_grid};
use crate::dataset::{BuiltinTable, Dataset};
use crate::grid::{Extrapolation, Grid};

/// Illuminant that reflectances have their responses, tristimulus values and luminous reflectance under.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum Illuminant {
    /// CIE standard illuminant D65: noon daylight.
    #[default]
    D65,
    /// CIE illuminant D50: horizon daylight, the reference of the graphic arts.
    D50,
    /// CIE illuminant D55: mid-morning daylight.
    D55,
    /// CIE illuminant D75: north sky daylight.
    D75,
    /// CIE standard illuminant A: incandescent light.
    A,
    /// CIE illuminant C: average daylight, by the convention of 1931.
    C,
    /// The equal-energy illuminant.
    E,
    /// CIE illuminant F2: a cool white fluorescent lamp.
    F2,
    /// CIE illuminant F7: a broad-band daylight fluorescent lamp.
    F7,
    /// CIE illuminant F11: a narrow-band white fluorescent lamp.
    F11,
    /// CIE daylight of this correlated colour temperature in kelvin, 4000 to 25000. D65 has 6504 K.
    Daylight(f64),
    /// The power in each band, in any unit.
    Power(Vec<f64>),
}

/// Error returned where a text or a number names no illuminant.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum IlluminantError {
    #[error("{0:?} is no illuminant: there are {known}, and daylights by their temperature, as in 5600K", known = names())]
    Unknown(String),
    #[error("a daylight of {0} K: the CIE defines them from 4000 to 25000 K")]
    Temperature(f64),
}

fn names() -> String {
    Illuminant::NAMED.map(|(name, _)| name).join(", ")
}

impl Illuminant {
    /// Illuminants that have a name.
    pub const NAMED: [(&str, Illuminant); 10] = [
        ("d65", Illuminant::D65),
        ("d50", Illuminant::D50),
        ("d55", Illuminant::D55),
        ("d75", Illuminant::D75),
        ("a", Illuminant::A),
        ("c", Illuminant::C),
        ("e", Illuminant::E),
        ("f2", Illuminant::F2),
        ("f7", Illuminant::F7),
        ("f11", Illuminant::F11),
    ];

    /// Illuminant of a name, in any case, or of a temperature as in `5600K`.
    ///
    /// ```
    /// use spectroll::Illuminant;
    ///
    /// assert_eq!(Illuminant::named("F11"), Ok(Illuminant::F11));
    /// assert_eq!(Illuminant::named("5600K"), Ok(Illuminant::Daylight(5600.0)));
    /// assert!(Illuminant::named("3000K").is_err());
    /// ```
    pub fn named(text: &str) -> Result<Illuminant, IlluminantError> {
        let lower = text.trim().to_lowercase();
        if let Some((_, found)) = Illuminant::NAMED.into_iter().find(|(name, _)| *name == lower) {
            return Ok(found);
        }
        let kelvin = lower.strip_suffix('k').and_then(|number| number.trim().parse::<f64>().ok());
        let daylight = Illuminant::Daylight(kelvin.ok_or_else(|| IlluminantError::Unknown(text.to_owned()))?);
        daylight.check().map(|()| daylight)
    }

    /// Checks that a temperature is one of daylight.
    pub(crate) fn check(&self) -> Result<(), IlluminantError> {
        match *self {
            Illuminant::Daylight(kelvin) if !(4000.0..=25000.0).contains(&kelvin) => {
                Err(IlluminantError::Temperature(kelvin))
            }
            _ => Ok(()),
        }
    }

    /// Power in each band of a grid, relative (100 at 560 nm, but for the lamps F and for [`Illuminant::Power`]); zero
    /// outside of the tables, which are from 380 to 780 nm. The narrow lines of the lamps keep their energy on coarse
    /// grids: their power is averaged over bands.
    pub fn power(&self, grid: &Grid) -> Vec<f64> {
        match self {
            Illuminant::D65 => d65(grid),
            // The CIE's temperatures are in a scale where the second radiation constant was 1.4380 cm K.
            Illuminant::D50 => daylight(5000.0 * 1.4388 / 1.438, grid),
            Illuminant::D55 => daylight(5500.0 * 1.4388 / 1.438, grid),
            Illuminant::D75 => daylight(7500.0 * 1.4388 / 1.438, grid),
            Illuminant::A => illuminant_a(grid),
            Illuminant::C => on_grid(BuiltinTable::IlluminantC, 0, grid),
            Illuminant::E => vec![1.0; grid.len()],
            Illuminant::F2 => lamp(0, grid),
            Illuminant::F7 => lamp(1, grid),
            Illuminant::F11 => lamp(2, grid),
            Illuminant::Daylight(kelvin) => daylight(*kelvin, grid),
            Illuminant::Power(power) => power.clone(),
        }
    }
}

/// Daylight of a temperature: a mean and two components (CIE 15:2004, eq. 3.3 to 3.8), with their factors rounded to three
/// decimals as the CIE has them.
fn daylight(kelvin: f64, grid: &Grid) -> Vec<f64> {
    let inverse = 1e3 / kelvin;
    let cubic = |[a, b, c, d]: [f64; 4]| a + inverse * (b + inverse * (c + inverse * d));
    let x = match kelvin <= 7000.0 {
        true => cubic([0.244063, 0.09911, 2.9678, -4.6070]),
        false => cubic([0.237040, 0.24748, 1.9018, -2.0064]),
    };
    let y = -3.0 * x * x + 2.870 * x - 0.275;
    let m = 0.0241 + 0.2562 * x - 0.7341 * y;
    let rounded = |value: f64| (value * 1e3).round() / 1e3;
    let first = rounded((-1.3515 - 1.7703 * x + 5.9114 * y) / m);
    let second = rounded((0.0300 - 31.4424 * x + 30.0717 * y) / m);
    let [s0, s1, s2] = [0, 1, 2].map(|function| on_grid(BuiltinTable::CieDaylight, function, grid));
    s0.iter().zip(s1.iter().zip(&s2)).map(|(s0, (s1, s2))| (s0 + first * s1 + second * s2).max(0.0)).collect()
}

/// A fluorescent lamp of the CIE, by its number in the table.
fn lamp(number: usize, grid: &Grid) -> Vec<f64> {
    let table = BuiltinTable::IlluminantsF.table();
    let lamps =
        Dataset::unjudged(&[table], grid.clone(), Extrapolation::Zero).expect("the table has every value");
    // A spline between a line and its surroundings may dip below 0, which no light does.
    lamps.spectra().column(number).iter().map(|power| power.max(0.0)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colorimetry::Observer;

    /// CIE 15:2004, table T.1 (D50, D55, D75), T.4 (C) and T.6.1 (F).
    #[test]
    fn illuminants_have_their_published_numbers() {
        let grid = &"400:50:700".parse().unwrap();
        for (illuminant, published) in [
            (Illuminant::D50, [49.308, 87.249, 95.774, 100.744, 97.744, 91.604, 91.604]),
            (Illuminant::C, [63.3, 124.0, 112.1, 105.2, 89.8, 88.1, 76.3]),
        ] {
            let found = illuminant.power(grid);
            // At 500 nm and 650 nm, which both tables have to one decimal at least.
            let published: &[f64] = &published;
            assert!((found[0] - published[0]).abs() < 0.05, "{illuminant:?} {found:?}");
            assert!((found[2] - published[2]).abs() < 0.1, "{illuminant:?} {found:?}");
        }
        // Chromaticities of the CIE for its 1931 observer (CIE 15:2004, table T.3 and T.7).
        let fine: &Grid = &"380:5:780".parse().unwrap();
        for (illuminant, [x, y]) in [
            (Illuminant::D50, [0.34567, 0.35851]),
            (Illuminant::D55, [0.33243, 0.34744]),
            (Illuminant::D75, [0.29903, 0.31488]),
            (Illuminant::C, [0.31006, 0.31616]),
            (Illuminant::F2, [0.3721, 0.3751]),
            (Illuminant::F7, [0.3129, 0.3292]),
            (Illuminant::F11, [0.3805, 0.3769]),
            (Illuminant::Daylight(6504.0), [0.31272, 0.32903]),
        ] {
            let light = illuminant.power(fine);
            let sums =
                Observer::Cie1931.cmf(fine).map(|f| f.iter().zip(&light).map(|(f, e)| f * e).sum::<f64>());
            let all: f64 = sums.iter().sum();
            let (found_x, found_y) = (sums[0] / all, sums[1] / all);
            assert!(
                (found_x - x).abs() < 1e-4 && (found_y - y).abs() < 1e-4,
                "{illuminant:?} {found_x} {found_y}"
            );
        }
    }

    /// Lines at 435.8 and 546.1 nm lie between the bands of a coarse grid, and their energy is there all the same.
    #[test]
    fn lamps_keep_their_energy_on_coarse_grids() {
        let energy = |grid: &str| {
            let grid: Grid = grid.parse().unwrap();
            Illuminant::F11.power(&grid).iter().zip(grid.widths()).map(|(e, width)| e * width).sum::<f64>()
        };
        let (fine, coarse) = (energy("400:5:700"), energy("400:10:700"));
        assert!((coarse / fine - 1.0).abs() < 0.01, "{fine} {coarse}");
    }

    #[test]
    fn names_and_temperatures() {
        for (name, illuminant) in Illuminant::NAMED {
            assert_eq!(Illuminant::named(&name.to_uppercase()), Ok(illuminant));
        }
        assert_eq!(Illuminant::named(" 6504 k "), Ok(Illuminant::Daylight(6504.0)));
        for (text, message) in [
            ("d60", "\"d60\" is no illuminant: there are d65, d50"),
            ("3000K", "a daylight of 3000 K: the CIE defines them from 4000 to 25000 K"),
            ("K", "is no illuminant"),
            ("nanK", "a daylight of NaN K"),
        ] {
            let error = Illuminant::named(text).unwrap_err().to_string();
            assert!(error.contains(message), "{error}");
        }
    }
}
