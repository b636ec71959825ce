//! The judgement of measured spectra, before anything is made of them: numbers that cannot be measurements are refused with
//! their place and a remedy.
//!
//! A file marks what was not measured by a number, and a model of such numbers looks like any other. So each spectrum is
//! compared with itself (one value far outside the rest of it, or a number by which the field marks), each table with the
//! wavelengths that it claims, and the data set, whose kind is known where a model is fitted, with what light and surfaces
//! can do.

use super::{Dataset, DatasetError, Remedy, SpectrumKind, Table, axis, units::WavelengthUnit};
use crate::grid::Grid;

/// Largest reflectance factor that is taken for one: fluorescent and retroreflecting surfaces exceed 1, but not by so much.
const MAX_REFLECTANCE: f64 = 2.5;

/// Most negative reflectance that noise makes.
const MIN_REFLECTANCE: f64 = -0.2;

/// Most negative power that noise makes, relative to the largest of its spectrum.
const MIN_POWER: f64 = -0.25;

/// Reflectance that a spectrum stays below where it was divided by a hundred once too often, and that hardly any surface
/// stays below.
const DARKEST: f64 = 0.012;

/// Range of wavelengths over which that can be told, in nm.
const BROAD_NM: f64 = 100.0;

/// Ratio to the rest of a spectrum from which a number by which the field marks is a marker, a negative number, and any
/// other.
const RATIOS: [f64; 3] = [2.0, 4.0, 1000.0];

/// Spectra with values that are unusual, and no error.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct SpectraCounts {
    /// Number of reflectances with values above 1, as fluorescence makes them.
    pub above_one: usize,
    /// Number of spectra with values below 0, as noise makes them.
    pub below_zero: usize,
}

/// Error returned where spectra are not of the kind that they are said to be.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[error("{place}: {reason}")]
pub struct Unphysical {
    /// Source of the spectrum, and its number there.
    pub place: String,
    /// Value, wavelength, and what to do.
    pub reason: String,
    /// Setting that the reason advises.
    pub remedy: Remedy,
}

/// Judges a table for a grid, whatever the kind of its spectra.
pub(super) fn table(table: &Table, grid: &Grid) -> Result<(), DatasetError> {
    wavelengths(table, grid)?;
    for spectrum in 0..table.len() {
        marker(table, spectrum)?;
    }
    zeros(table, grid)
}

fn wavelengths(table: &Table, grid: &Grid) -> Result<(), DatasetError> {
    let measured = table.wavelengths();
    let (first, last) = (measured[0], measured[measured.len() - 1]);
    let refused = |reason: String, unit: Option<WavelengthUnit>| DatasetError::NotWavelengths {
        name: table.name().to_owned(),
        reason,
        remedy: unit.map_or(Remedy::None, Remedy::Unit),
    };
    if let Err(fault) = axis::check(measured) {
        return Err(refused(format!("its wavelengths are none: {fault}"), fault.guess()));
    }
    let is_apart = last < grid.first() || first > grid.last();
    let guess = WavelengthUnit::guess(first, last).filter(|unit| *unit != WavelengthUnit::Nm);
    if is_apart {
        let advice = match guess {
            Some(unit) => format!("; where its wavelengths are in {unit}, say so"),
            None => "; choose a grid within them".to_owned(),
        };
        return Err(refused(
            format!(
                "it was measured from {first} to {last} nm, where no wavelength of the grid {grid} lies{advice}"
            ),
            guess,
        ));
    }
    Ok(())
}

/// Numbers by which the field marks values that were not measured, without their signs.
const MARKERS: [f64; 36] = [
    9.0,
    99.0,
    999.0,
    9999.0,
    99999.0,
    999_999.0,
    9_999_999.0,
    99.9,
    999.9,
    9999.9,
    99999.9,
    99.99,
    999.99,
    9999.99,
    888.0,
    8888.0,
    32767.0,
    32768.0,
    65534.0,
    65535.0,
    2_147_483_647.0,
    2_147_483_648.0,
    4_294_967_295.0,
    1e10,
    1e20,
    1e30,
    1e33,
    1e34,
    1.23e34,
    1e35,
    1e36,
    9.969_21e36,
    1e37,
    1e38,
    3.402_823_5e38,
    1.797_693_134_862_315_7e308,
];

fn is_marker(value: f64) -> bool {
    let size = value.abs();
    // A decimal of single precision, or one that a file has rounded.
    size >= 1e30 || MARKERS.iter().any(|marker| (size - marker).abs() <= 1e-5 * marker)
}

/// Refuses a spectrum one value of which stands far outside the others.
fn marker(table: &Table, spectrum: usize) -> Result<(), DatasetError> {
    let values = table.spectrum(spectrum);
    let refused = |band: usize, reason: &str| {
        let value = values[band];
        let like = values.iter().filter(|v| **v == value).count();
        let times = if like > 1 {
            format!(", as in {} other places of the spectrum", like - 1)
        } else {
            String::new()
        };
        DatasetError::Value {
            place: format!("spectrum {} of {}", spectrum + 1, table.name()),
            wavelength: table.wavelengths()[band],
            value,
            reason: format!(
                "{times}, {reason}: where it marks what was not measured, say so, and leave out such spectra or fill them; \
                 else remove the spectrum"
            ),
            remedy: Remedy::MissingValue(value),
        }
    };
    // The largest sizes, each once, from the largest down.
    let mut top: [f64; 6] = [0.0; 6];
    let mut distinct = 0;
    for size in values.iter().map(|v| v.abs()).filter(|size| !size.is_nan()) {
        if size <= top[5] || top.contains(&size) {
            continue;
        }
        let at = top.iter().position(|t| size > *t).expect("it is larger than the last");
        top[at..].rotate_right(1);
        top[at] = size;
        distinct += 1;
    }
    let rest = distinct.min(6);
    for above in 1..rest.min(5) {
        let ratio = top[above - 1] / top[above];
        // Those above the gap, the smallest of which decides.
        let Some(band) = values.iter().position(|v| v.abs() == top[above - 1]) else { continue };
        let value = values[band];
        let needed = match value {
            value if is_marker(value) => RATIOS[0],
            value if value < 0.0 => RATIOS[1],
            _ => RATIOS[2],
        };
        if ratio < needed {
            continue;
        }
        if is_marker(value) {
            return Err(refused(band, "which is a number by which missing values are marked"));
        }
        if value < 0.0 {
            return Err(refused(band, "which lies far outside the other values"));
        }
        // A laser line is as high, but it has a foot.
        let foot =
            |near: Option<usize>| near.and_then(|i| values.get(i)).is_some_and(|v| v.abs() * 100.0 > value);
        if !foot(band.checked_sub(1)) && !foot(Some(band + 1)) {
            return Err(refused(band, "which lies far outside the other values"));
        }
    }
    if let Some(band) = values.iter().position(|v| v.abs() >= 1e30) {
        return Err(refused(band, "which is a number by which missing values are marked"));
    }
    // Noise below 0 is no whole number again and again.
    let negative: Vec<usize> = (0..values.len()).filter(|&band| values[band] < 0.0).collect();
    let is_one_marker = |mark: f64| negative.iter().all(|&band| values[band] == mark);
    if let Some(&band) = negative.first()
        && negative.len() < values.len()
        && [-1.0, -9.0, -99.0].into_iter().any(is_one_marker)
    {
        return Err(refused(band, "as is every value below 0"));
    }
    Ok(())
}

/// Refuses bands that are zero in every spectrum, where the grid needs them: tables are padded with zeros.
fn zeros(table: &Table, grid: &Grid) -> Result<(), DatasetError> {
    if table.len() < 2 {
        return Ok(()); // a lamp may well be dark
    }
    let measured = table.wavelengths();
    let start = measured.partition_point(|&w| w <= grid.first()).saturating_sub(1);
    let end = measured.partition_point(|&w| w < grid.last()).min(measured.len() - 1);
    let is_on_grid = |w: f64| w >= grid.first() && w <= grid.last();
    let is_dark = |band: usize| (0..table.len()).all(|j| table.spectrum(j)[band] == 0.0);
    let dark: Vec<usize> =
        (start..=end).filter(|&band| is_on_grid(measured[band]) && is_dark(band)).collect();
    let (Some(&first), Some(&last)) = (dark.first(), dark.last()) else { return Ok(()) };
    if dark.len() == end + 1 - start {
        return Ok(()); // a table of zeros is refused for that
    }
    let range = if first == last {
        format!("at {} nm", measured[first])
    } else {
        format!("at {} wavelengths from {} to {} nm", dark.len(), measured[first], measured[last])
    };
    Err(DatasetError::Spectrum {
        place: table.name().to_owned(),
        reason: format!(
            "every spectrum is 0 {range}, as in tables that are padded where nothing was measured: choose a grid without \
             these wavelengths, or say that 0 marks what was not measured"
        ),
        remedy: Remedy::Wavelengths,
    })
}

impl Dataset {
    /// Checks that the spectra can be of this kind; returns how many have values that are unusual, and no error.
    pub fn judge(&self, kind: SpectrumKind) -> Result<SpectraCounts, Unphysical> {
        match kind {
            SpectrumKind::Reflectance => self.judge_reflectances(),
            SpectrumKind::Illuminant => self.judge_illuminants(),
        }
    }

    /// An error of one value of a spectrum.
    fn unphysical(&self, spectrum: usize, band: usize, reason: &str, remedy: Remedy) -> Unphysical {
        let value = self.spectra[(band, spectrum)];
        let wavelength = self.grid.wavelength(band);
        let reason = format!("the value at {wavelength} nm is {value}, {reason}");
        Unphysical { place: self.place(spectrum), reason, remedy }
    }

    fn judge_reflectances(&self) -> Result<SpectraCounts, Unphysical> {
        let mut counts = SpectraCounts::default();
        let bands = self.spectra.nrows();
        let mut tops: Vec<f64> = self.spectra.column_iter().map(|spectrum| spectrum.max()).collect();
        for (j, spectrum) in self.spectra.column_iter().enumerate() {
            let above = spectrum.iter().filter(|v| **v > 1.0).count();
            let below = spectrum.iter().filter(|v| **v < 0.0).count();
            counts.above_one += usize::from(above > 0);
            counts.below_zero += usize::from(below > 0);
            let (high, low) = (spectrum.imax(), spectrum.imin());
            if 2 * above > bands {
                let (mean, others) = (spectrum.mean(), self.spectra.mean());
                let scale = match spectrum[high] {
                    ..150.0 => 0.01,
                    ..1500.0 => 0.001,
                    ..15_000.0 => 1e-4,
                    _ => 1.0 / spectrum[high],
                };
                let reason = format!(
                    "most of its values are above 1 ({mean:.4} on average; {others:.4} over all spectra), where reflectances \
                     are between 0 and 1: it may be on another scale than the others; where all are, multiply them by {scale}"
                );
                return Err(Unphysical { place: self.place(j), reason, remedy: Remedy::Scale(scale) });
            }
            if spectrum[high] > MAX_REFLECTANCE {
                let reason = "far above 1, which no reflectance is: where it marks what was not measured, say so; else \
                              remove the spectrum";
                return Err(self.unphysical(j, high, reason, Remedy::MissingValue(spectrum[high])));
            }
            if spectrum[low] < MIN_REFLECTANCE {
                let reason = "far below 0, which no reflectance is: where it marks what was not measured, say so; else \
                              remove the spectrum";
                return Err(self.unphysical(j, low, reason, Remedy::MissingValue(spectrum[low])));
            }
            if 2 * below > bands {
                let reason =
                    "and most of its values are below 0, which reflectances are not: remove the spectrum";
                return Err(self.unphysical(j, low, reason, Remedy::None));
            }
            if spectrum[high] == 0.0 && spectrum[low] == 0.0 {
                let reason = "as are all of its values: remove the spectrum";
                return Err(self.unphysical(j, 0, reason, Remedy::None));
            }
        }
        // Over a few wavelengths a surface may well be dark.
        let is_broad = self.grid.last() - self.grid.first() >= BROAD_NM;
        let dark = tops.iter().position(|top| *top <= DARKEST).filter(|_| is_broad);
        tops.sort_unstable_by(f64::total_cmp);
        if let Some(dark) = dark.filter(|_| tops[tops.len() / 2] >= 0.2) {
            let high = self.spectra.column(dark).imax();
            let reason = "its largest: it may be on another scale than the others (a fraction among percentages?); multiply \
                          it by 100, or remove it";
            return Err(self.unphysical(dark, high, reason, Remedy::None));
        }
        Ok(counts)
    }

    fn judge_illuminants(&self) -> Result<SpectraCounts, Unphysical> {
        let mut counts = SpectraCounts::default();
        for (j, spectrum) in self.spectra.column_iter().enumerate() {
            let below = spectrum.iter().filter(|v| **v < 0.0).count();
            counts.below_zero += usize::from(below > 0);
            let low = spectrum.imin();
            if spectrum[low] < MIN_POWER * spectrum.max().max(0.0) && below > 0 {
                let reason = "which no light has, and noise hardly makes beside its largest value: where it marks what was \
                              not measured, say so; else remove the spectrum";
                return Err(self.unphysical(j, low, reason, Remedy::MissingValue(spectrum[low])));
            }
        }
        Ok(counts)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::grid::Extrapolation;

    fn smooth(level: f64) -> Vec<f64> {
        (0..31).map(|i| level * (0.5 + 0.3 * (f64::from(i) / 7.0).sin())).collect()
    }

    fn data(spectra: &[Vec<f64>]) -> Result<Dataset, DatasetError> {
        let wavelengths = Grid::DEFAULT.wavelengths().collect();
        Dataset::new(&[Table::new("t.csv", wavelengths, spectra)?], Grid::DEFAULT, Extrapolation::Error)
    }

    fn ten() -> Vec<Vec<f64>> {
        (1..=10).map(|i| smooth(0.1 * f64::from(i))).collect()
    }

    #[test]
    fn markers_are_refused_by_place_and_value() {
        for value in [
            -999.0,
            -9999.0,
            -99.0,
            -1.23e34,
            9.96921e36,
            65535.0,
            32767.0,
            -32768.0,
            999.0,
            1e20,
            -3.4028235e38,
            -7.5,
            5000.0,
            -1.0,
        ] {
            for spectrum in [0, 9] {
                let mut spectra = ten();
                spectra[spectrum][14] = value;
                let error = data(&spectra).unwrap_err();
                let text = error.to_string();
                let place = format!("spectrum {} of t.csv: the value at 540 nm is {value}", spectrum + 1);
                assert!(text.starts_with(&place), "{value}: {text}");
                assert_eq!(error.remedy(), Remedy::MissingValue(value));
            }
        }
    }

    #[test]
    fn measurements_are_left_alone() {
        // Noise below 0, fluorescence above 1, a laser line with its foot, and lights of all magnitudes.
        let mut spectra = ten();
        spectra[0][0] = -0.004;
        spectra[3][20] = 1.3;
        let counts = data(&spectra).unwrap().judge(SpectrumKind::Reflectance).unwrap();
        assert_eq!(counts, SpectraCounts { above_one: 1, below_zero: 1 });
        let mut lights: Vec<Vec<f64>> = (0..8).map(|i| smooth(10f64.powi(i - 4))).collect();
        lights[2][15] = 2000.0 * lights[2][10];
        lights[2][16] = 30.0 * lights[2][10];
        assert!(data(&lights).unwrap().judge(SpectrumKind::Illuminant).is_ok());
    }

    #[test]
    fn scales_are_told_apart() {
        let mut spectra = ten();
        spectra[4].iter_mut().for_each(|v| *v *= 100.0);
        let error = data(&spectra).unwrap().judge(SpectrumKind::Reflectance).unwrap_err();
        assert!(
            error.place.starts_with("spectrum 5 of t.csv") && error.remedy == Remedy::Scale(0.01),
            "{error}"
        );
        let mut spectra = ten();
        spectra[6].iter_mut().for_each(|v| *v *= 0.01);
        let error = data(&spectra).unwrap().judge(SpectrumKind::Reflectance).unwrap_err();
        assert!(
            error.to_string().starts_with("spectrum 7 of t.csv") && error.reason.contains("another scale"),
            "{error}"
        );
        let negative: Vec<_> = ten().iter().map(|s| s.iter().map(|v| -0.1 * v).collect()).collect();
        assert!(data(&negative).unwrap().judge(SpectrumKind::Reflectance).is_err());
        assert!(data(&negative).unwrap().judge(SpectrumKind::Illuminant).is_err());
    }

    #[test]
    fn padding_and_wavelengths_that_are_none() {
        let mut spectra = ten();
        spectra.iter_mut().for_each(|spectrum| spectrum[..3].fill(0.0));
        let text = data(&spectra).unwrap_err().to_string();
        assert!(text.contains("every spectrum is 0 at 3 wavelengths from 400 to 420 nm"), "{text}");
        for (wavelengths, message, remedy) in [
            ((1..=1000).map(f64::from).collect::<Vec<_>>(), "they count from 1 to 1000", Remedy::None),
            (
                (0..31).map(|i| 0.4 + 0.01 * f64::from(i)).collect(),
                "in um?",
                Remedy::Unit(WavelengthUnit::Um),
            ),
            (
                (0..31).map(|i| 4000.0 + 100.0 * f64::from(i)).collect(),
                "in angstrom",
                Remedy::Unit(WavelengthUnit::Angstrom),
            ),
        ] {
            let spectra = vec![vec![0.5; wavelengths.len()]; 2];
            let table = Table::new("t.csv", wavelengths, &spectra).unwrap();
            let error = Dataset::new(&[table], Grid::DEFAULT, Extrapolation::Hold).unwrap_err();
            assert!(error.to_string().contains(message) && error.remedy() == remedy, "{error}");
        }
    }
}
