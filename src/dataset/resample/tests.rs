use super::*;
use crate::dataset::Dataset;

const NAN: f64 = f64::NAN;

fn table(wavelengths: Vec<f64>, spectra: &[Vec<f64>]) -> Table {
    Table::new("swatches", wavelengths, spectra).unwrap()
}

fn nm(first: u32, step: usize, last: u32) -> Vec<f64> {
    (first..=last).step_by(step).map(f64::from).collect()
}

fn on(table: &Table, grid: &str, settings: Resampling) -> Result<Resampled, DatasetError> {
    resample(table, &grid.parse().unwrap(), settings)
}

fn by(method: ResampleMethod) -> Resampling {
    Resampling::default().method(method)
}

fn line(at: f64, centre: f64, width: f64) -> f64 {
    (-0.5 * ((at - centre) / width).powi(2)).exp()
}

/// Against the sums that the triangular weights are, one by one.
#[test]
fn averages_are_sums_by_triangular_weights() {
    let wavelengths = nm(390, 1, 715);
    let values: Vec<f64> =
        wavelengths.iter().map(|&w| 0.3 + line(w, 546.0, 1.0) + line(w, 434.0, 0.7)).collect();
    let table = table(wavelengths.clone(), std::slice::from_ref(&values));
    let averaged = on(&table, "400:10:700", by(ResampleMethod::Average)).unwrap();
    for (band, &found) in averaged.spectra.iter().enumerate() {
        let centre = 400.0 + 10.0 * band as f64;
        let weights: Vec<f64> =
            wavelengths.iter().map(|w| (1.0 - (w - centre).abs() / 10.0).max(0.0)).collect();
        let sum: f64 = weights.iter().zip(&values).map(|(w, v)| w * v).sum();
        assert!((found - sum / weights.iter().sum::<f64>()).abs() < 1e-14, "at {centre} nm");
    }
    // The lines' energy, beside 0.3 in 31 bands of 10 nm.
    let energy = 10.0 * averaged.spectra.sum();
    let expected = 0.3 * 310.0 + values.iter().map(|value| value - 0.3).sum::<f64>();
    assert!((energy - expected).abs() < 1e-9, "{energy} {expected}");
    let plain = on(&table, "400:10:700", by(ResampleMethod::Interpolate)).unwrap();
    assert!((10.0 * plain.spectra.sum() - expected).abs() > 1.0, "plain values lose the lines");
    // Auto sees it, and says so.
    let auto = on(&table, "400:10:700", Resampling::default()).unwrap();
    assert_eq!(auto.spectra, averaged.spectra);
    assert!(
        auto.notes[0].contains("structure finer than the grid, as at 434 nm in spectrum 1"),
        "{:?}",
        auto.notes
    );
    assert!(auto.notes[0].contains("averaged over bands of 10 nm"), "{:?}", auto.notes);
}

/// On a grid as uneven as that of a spectrometer, too.
#[test]
fn energy_is_kept_on_uneven_grids() {
    let wavelengths = nm(350, 1, 800);
    for centre in [440.0, 502.3, 547.0, 611.0] {
        let values = wavelengths.iter().map(|&w| line(w, centre, 1.0)).collect();
        let table = table(wavelengths.clone(), &[values]);
        let uneven: Vec<f64> =
            (0..60).map(|i| 398.0 + 5.3 * f64::from(i) - 0.004 * f64::from(i * i)).collect();
        let grid = Grid::from_wavelengths(&uneven).unwrap();
        let auto = resample(&table, &grid, Resampling::default()).unwrap();
        let energy: f64 = auto.spectra.iter().zip(grid.widths()).map(|(value, width)| value * width).sum();
        assert!((energy / std::f64::consts::TAU.sqrt() - 1.0).abs() < 0.01, "{centre}: {energy}");
        assert!(auto.notes[0].contains("averaged over the bands of the grid"), "{:?}", auto.notes);
    }
}

/// Data that are smooth, or no finer than the grid, keep their plain values to the last bit.
#[test]
fn smooth_data_are_taken_as_they_stand() {
    for (builtin, grid) in [
        (crate::BuiltinTable::Munsell, "400:10:700"),
        (crate::BuiltinTable::Vrhel, "400:10:700"),
        (crate::BuiltinTable::Vrhel, "395:7:724"),
        (crate::BuiltinTable::Granada, "400:10:700"),
    ] {
        let table = builtin.table();
        let auto = on(&table, grid, Resampling::default()).unwrap();
        assert!(auto.notes.is_empty(), "{:?}", auto.notes);
        assert!(auto.spectra == on(&table, grid, by(ResampleMethod::Interpolate)).unwrap().spectra);
    }
    // As coarse as the grid, on it or beside it: there is nothing to average.
    let coarse = table(nm(400, 10, 700), &[(0..31).map(|i| f64::from(i % 3)).collect()]);
    let averaged = on(&coarse, "400:10:700", by(ResampleMethod::Average)).unwrap();
    assert_eq!(averaged.spectra.as_slice(), coarse.spectrum(0));
}

/// A grid of a sensor's bands says nothing about their widths, so that lines are named and not averaged.
#[test]
fn separate_bands_are_not_averaged_unless_asked() {
    let wavelengths = nm(400, 1, 900);
    let values = wavelengths.iter().map(|&w| 0.1 + 5.0 * line(w, 561.0, 2.0)).collect();
    let table = table(wavelengths, &[values]);
    let auto = on(&table, "443,490,560,665,705,740,783,842,865", Resampling::default()).unwrap();
    assert!(auto.notes[0].contains("interpolated all the same"), "{:?}", auto.notes);
    assert_eq!(auto.spectra[2], table.spectrum(0)[160]);
}

fn gappy() -> Table {
    let wavelengths = nm(400, 10, 700);
    let row = |i: u32| wavelengths.iter().map(|w| 0.3 + 0.01 * f64::from(i) + (w - 400.0) / 1000.0).collect();
    let mut spectra: Vec<Vec<f64>> = (0..6).map(row).collect();
    spectra[1][0] = NAN; // 400 nm
    spectra[3][14] = NAN; // 540 nm
    table(wavelengths, &spectra)
}

#[test]
fn what_the_grid_does_not_need_is_no_error() {
    let gappy = gappy();
    for grid in ["410:10:530", "550:10:700", "420:20:500,", "560:5:700"] {
        let Ok(grid) = grid.trim_end_matches(',').parse::<Grid>() else { panic!() };
        let found = resample(&gappy, &grid, Resampling::default()).unwrap();
        assert_eq!((found.numbers.len(), found.notes.len()), (6, 0), "{grid}");
    }
    // Between the grid's wavelengths, at 540 nm.
    assert!(on(&gappy, "410:20:690", Resampling::default()).is_ok());
    let around = Grid::from_wavelengths(&[410.0, 430.0, 530.0, 550.0, 570.0]).unwrap();
    assert!(resample(&gappy, &around, Resampling::default()).is_ok());
}

#[test]
fn what_the_grid_needs_is_named_dropped_or_filled() {
    let gappy = gappy();
    let message = on(&gappy, "400:10:700", Resampling::default()).err().unwrap().to_string();
    assert!(message.contains("spectrum 2 of swatches has no value at 400 nm"), "{message}");
    assert!(message.contains("its first is at 410 nm") && !message.contains("interpolation"), "{message}");
    let message = on(&gappy, "410:10:700", Resampling::default()).err().unwrap().to_string();
    assert!(message.contains("spectrum 4 of swatches has no value at 540 nm"), "{message}");
    assert!(message.contains("those at 530 and 550 nm") && message.contains("fill the gap"), "{message}");
    // Beside the gap the spline has no neighbour.
    let message = on(&gappy, "415:10:695", Resampling::default()).err().unwrap().to_string();
    assert!(message.contains("spectrum 4 of swatches has no value at 535 nm"), "{message}");

    let dropped = on(&gappy, "400:10:700", Resampling::default().missing(Missing::Drop)).unwrap();
    assert_eq!(dropped.numbers, [1, 3, 5, 6]);
    assert_eq!(
        dropped.notes,
        ["swatches: left out 2 of 6 spectra that lack a value, the first spectrum 2 at 400 nm"]
    );
    let filling = Resampling::default().missing(Missing::Interpolate);
    let filled = on(&gappy, "410:10:700", filling).unwrap();
    assert!((filled.spectra[(13, 3)] - 0.47).abs() < 1e-12);
    assert_eq!(filled.notes, ["swatches: filled gaps of 1 of 6 spectra by interpolation"]);
    // An end is no gap, however gaps are treated; it is extrapolated where that is asked for.
    assert!(on(&gappy, "400:10:700", filling).is_err());
    let held = on(&gappy, "400:10:700", filling.extrapolation(Extrapolation::Hold)).unwrap();
    assert!((held.spectra[(0, 1)] - 0.32).abs() < 1e-12);

    let none = table(nm(400, 10, 450), &[vec![0.1; 6], vec![NAN; 6]]);
    let message = on(&none, "400:10:450", Resampling::default()).err().unwrap().to_string();
    assert!(
        message.contains("spectrum 2 of swatches has no value at 400 nm") && message.contains("none at all")
    );
    let all = table(nm(400, 10, 450), &[vec![NAN, 0.1, 0.1, 0.2, 0.1, 0.3]]);
    let message =
        on(&all, "400:10:450", Resampling::default().missing(Missing::Drop)).err().unwrap().to_string();
    assert!(message.contains("no spectrum of swatches"), "{message}");
}

/// Rows that a table lacks, as where water absorbs, are a gap of every spectrum.
#[test]
fn a_hole_in_the_wavelengths_is_a_gap() {
    let wavelengths: Vec<f64> =
        nm(1200, 10, 2000).into_iter().filter(|w| !(1350.0..1440.0).contains(w)).collect();
    let values: Vec<f64> = wavelengths.iter().map(|w| 0.2 + w / 10_000.0).collect();
    let table = table(wavelengths, &[values]);
    let message = on(&table, "1200:20:2000", Resampling::default()).err().unwrap().to_string();
    assert!(
        message.contains("no value at 1360 nm") && message.contains("those at 1340 and 1440 nm"),
        "{message}"
    );
    let filled = on(&table, "1200:20:2000", Resampling::default().missing(Missing::Interpolate)).unwrap();
    assert!((filled.spectra[10] - 0.34).abs() < 1e-9 && filled.notes.len() == 1);
    // Around it, also by averages.
    for method in [ResampleMethod::Auto, ResampleMethod::Average] {
        let around: Vec<f64> = nm(1200, 20, 1340).into_iter().chain(nm(1440, 20, 2000)).collect();
        let grid = Grid::from_wavelengths(&around).unwrap();
        let found = resample(&table, &grid, by(method)).unwrap();
        let expected = around.iter().map(|w| 0.2 + w / 10_000.0);
        assert!(found.spectra.iter().zip(expected).all(|(a, b)| (a - b).abs() < 6e-4), "{method:?}");
    }
    // One missing row of an even table is a hole, and what is merely uneven has none.
    assert!(Gaps::of(&[400.0, 410.0, 420.0, 430.0, 450.0, 460.0, 470.0]).is_between(430.0, 450.0));
    let uneven: Vec<f64> = (0..200).map(|i| 350.0 + 3.3 * f64::from(i) - 0.003 * f64::from(i * i)).collect();
    assert!(!Gaps::of(&uneven).is_between(0.0, 1e4));
    let regions: Vec<f64> =
        nm(350, 1, 1000).into_iter().chain(nm(1002, 2, 1800)).chain(nm(1810, 10, 2500)).collect();
    assert!(!Gaps::of(&regions).is_between(0.0, 1e4));
}

#[test]
fn averages_need_what_lies_between_the_wavelengths_of_the_grid() {
    let wavelengths = nm(400, 1, 700);
    let mut values: Vec<f64> = wavelengths.iter().map(|w| w / 1000.0).collect();
    values[135] = NAN;
    let table = table(wavelengths, &[values]);
    assert!(on(&table, "400:10:700", by(ResampleMethod::Interpolate)).is_ok());
    let message = on(&table, "400:10:700", by(ResampleMethod::Average)).err().unwrap().to_string();
    assert!(message.contains("no value at 535 nm"), "{message}");
    let filled = on(&table, "400:10:700", by(ResampleMethod::Average).missing(Missing::Interpolate)).unwrap();
    assert!((filled.spectra[13] - 0.53).abs() < 1e-12);
    // Beyond the grid it is not needed.
    assert!(on(&table, "540:10:700", by(ResampleMethod::Average)).is_ok());
}

/// Grids read in single precision begin a little before or after what was measured.
#[test]
fn wavelengths_in_single_precision_coincide() {
    let single: Vec<f64> = (0..40).map(|i| f64::from((399.7 + 7.7 * f64::from(i)) as f32)).collect();
    let table = table(single.clone(), &[(0..40).map(|i| f64::from(i * i % 7)).collect()]);
    let grid = Dataset::measured_grid(std::slice::from_ref(&table)).unwrap();
    assert_eq!(grid.to_string(), "399.7:7.7:700");
    let found = resample(&table, &grid, Resampling::default()).unwrap();
    assert_eq!(found.spectra.as_slice(), table.spectrum(0));
}

#[test]
fn tables_give_their_grid() {
    let mut spectra = vec![vec![0.5; 31], vec![0.4; 31]];
    (spectra[0][7], spectra[1][7], spectra[0][8]) = (NAN, NAN, NAN);
    let table = table(nm(400, 10, 700), &spectra);
    let grid = Dataset::measured_grid(std::slice::from_ref(&table)).unwrap();
    assert_eq!((grid.len(), grid.step(), grid.wavelength(7)), (30, None, 480.0));
    let other = Table::new("others", nm(400, 5, 700), &[vec![0.5; 61]]).unwrap();
    let message = Dataset::measured_grid(&[table, other]).unwrap_err().to_string();
    assert_eq!(message, "swatches and others were measured at different wavelengths: choose a grid for both");
}
