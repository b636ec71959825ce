//! Fits to data that strain them: the units of the data, outliers, data without variation or rank.

use nalgebra::DMatrix;

use super::examine::*;
use super::{Answer, Case, case, good, within};
use crate::dataset::{BuiltinTable, Dataset, SpectrumKind, Table};
use crate::engine::Engine;
use crate::grid::{Extrapolation, Grid};
use crate::model::{Fit, FitError};
use crate::model::{Model, Normalization};
use crate::recipe::{Recipe, RecipeError};

pub(super) const CASES: &[Case] = &[
    case("spectra times 10^-30 to 10^30, normalised", "squares that vanish or overflow", units),
    case("spectra times 10^-30 to 10^30, as they are", "values that f32 does not hold", raw_units),
    case("reflectances of 10^-30 to 10^-10, scaled to LRV 0.4", "the LRV in the divisor vanishes", dark),
    case("one spectrum a million times as bright, normalised", "it outweighs all others", outlier),
    case("one spectrum a million times as bright, as it is", "the other directions drown", raw_outlier),
    case("constant data", "a division by a variance of 0", constant),
    case("M = k + 1 spectra, and M = k", "as many directions as spectra", few),
    case("collinear data", "directions made of rounding errors", collinear),
];

fn surfaces() -> Vec<Vec<f64>> {
    let table = BuiltinTable::Vrhel.table();
    let data =
        Dataset::new(&[table], Grid::DEFAULT, Extrapolation::Error).expect("the table covers the grid");
    data.spectra().column_iter().map(|c| c.iter().copied().collect()).collect()
}

fn dataset(spectra: &[Vec<f64>]) -> Dataset {
    let wavelengths = Grid::DEFAULT.wavelengths().collect();
    let table = Table::new("data", wavelengths, spectra).expect("the values are finite");
    Dataset::new(&[table], Grid::DEFAULT, Extrapolation::Error).expect("the grid is the table's")
}

fn times(spectra: &[Vec<f64>], factor: f64) -> Vec<Vec<f64>> {
    spectra.iter().map(|s| s.iter().map(|v| v * factor).collect()).collect()
}

fn fit(kind: SpectrumKind, normalization: Normalization, spectra: &[Vec<f64>]) -> Result<Model, String> {
    let fitted = Fit::new(kind).normalization(normalization).fit(&dataset(spectra));
    fitted.map_err(|e| format!("the fit was refused: {e}"))
}

/// Distance of two models, relative to the largest entry of each part, once the second is divided by `scale`.
fn distance(a: &Model, b: &Model, scale: f64) -> f64 {
    let (a, b) = (a.parts(), b.parts());
    // A part of each deviation, since directions of small variance matter as much.
    let relative = |x: &DMatrix<f64>, y: DMatrix<f64>| (x - y).amax() / x.amax();
    let mean = (&a.mean - &b.mean / scale).amax() / a.mean.amax();
    let variances = (0..a.weight_covariance.nrows())
        .map(|j| (b.weight_covariance[(j, j)] / scale / scale / a.weight_covariance[(j, j)] - 1.0).abs());
    variances.fold(mean.max(relative(&a.basis, b.basis.clone())), f64::max)
}

const SCALES: [f64; 5] = [1e-30, 1e-15, 1.0, 1e15, 1e30];

fn units(engine: &Engine) -> Answer {
    let spectra = surfaces();
    let plain = fit(SpectrumKind::Illuminant, Normalization::Mean, &spectra)?;
    let parts =
        SCALES.map(|scale| {
            let answer = fit(SpectrumKind::Illuminant, Normalization::Mean, &times(&spectra, scale))
                .and_then(|model| match distance(&plain, &model, 1.0) {
                    apart if apart > 1e-9 => {
                        Err(format!("the model is {apart:.1e} from the one of plain units"))
                    }
                    _ => drawn(engine, Recipe::builder(&model), ERROR),
                });
            (format!("{scale:e}"), answer)
        });
    all(parts)
}

fn raw_units(engine: &Engine) -> Answer {
    let spectra = surfaces();
    let plain = fit(SpectrumKind::Illuminant, Normalization::None, &spectra)?;
    let parts = SCALES.map(|scale| {
        let answer =
            fit(SpectrumKind::Illuminant, Normalization::None, &times(&spectra, scale)).and_then(|model| {
                let apart = distance(&plain, &model, scale);
                if apart > 1e-9 {
                    return Err(format!("the model is {apart:.1e} from the scaled one of plain units"));
                }
                match Recipe::builder(&model).build() {
                    Err(RecipeError::Scale { .. }) if !(1e-20..1e20).contains(&scale) => {
                        good("refused, beyond f32")
                    }
                    _ => drawn(engine, Recipe::builder(&model), ERROR),
                }
            });
        (format!("{scale:e}"), answer)
    });
    all(parts)
}

/// Checks that the target holds whatever the unit of the data, or that the recipe is refused.
fn dark(engine: &Engine) -> Answer {
    let spectra = surfaces();
    let parts = [1e-30, 1e-29, 1e-28, 1e-20, 1e-10].map(|scale| {
        let answer =
            fit(SpectrumKind::Reflectance, Normalization::None, &times(&spectra, scale)).and_then(|model| {
                let builder = target(&model, 0.4, crate::program::Bounds::Scaled);
                let recipe = match builder.build() {
                    Err(RecipeError::Scale { .. }) => return good("refused, beyond f32"),
                    other => other.map_err(|e| format!("refused: {e}"))?,
                };
                let draws = crate::random::stream::Stream::named(3, "stress").draws(0..DRAWS);
                let examined = examine(engine, &recipe, draws)?;
                within("the LRV holds (error relative to it)", examined.lrv_error, SCALED_ERROR)
            });
        (format!("{scale:e}"), answer)
    });
    all(parts)
}

fn brightened() -> (Vec<Vec<f64>>, Vec<Vec<f64>>) {
    let spectra = surfaces();
    let mut brightened = spectra.clone();
    brightened[17].iter_mut().for_each(|v| *v *= 1e6);
    (spectra, brightened)
}

fn outlier(engine: &Engine) -> Answer {
    let (plain, bright) = brightened();
    let fitted = |spectra| fit(SpectrumKind::Illuminant, Normalization::Mean, spectra);
    let (plain, bright) = (fitted(&plain)?, fitted(&bright)?);
    match distance(&plain, &bright, 1.0) {
        apart if apart > 1e-9 => Err(format!("the model is {apart:.1e} from the one without it")),
        _ => drawn(engine, Recipe::builder(&bright), ERROR),
    }
}

/// Checks that the first component is the outlying spectrum, and explains all to 10^-9.
fn raw_outlier(engine: &Engine) -> Answer {
    let (_, bright) = brightened();
    let model = fit(SpectrumKind::Illuminant, Normalization::None, &bright)?;
    let explained = model.parts().explained_variance[0];
    if explained < 1.0 - 1e-9 {
        return Err(format!("its direction explains only {explained}"));
    }
    drawn(engine, Recipe::builder(&model), ERROR)
}

fn refused_fit(fit: Result<Model, FitError>, reason: fn(&FitError) -> bool) -> Answer {
    match fit {
        Err(e) if reason(&e) => good(format!("refused: {e}")),
        other => Err(format!("{:?}", other.map(|_| "fitted"))),
    }
}

fn constant(_: &Engine) -> Answer {
    let fit = Fit::new(SpectrumKind::Reflectance).fit(&dataset(&vec![vec![0.1 + 0.2; 31]; 20]));
    refused_fit(fit, |e| matches!(e, FitError::NoVariation { .. }))
}

fn few(engine: &Engine) -> Answer {
    let spectra = &surfaces()[..7];
    let enough = fit(SpectrumKind::Reflectance, Normalization::None, spectra)
        .and_then(|model| drawn(engine, Recipe::builder(&model), ERROR));
    let short = Fit::new(SpectrumKind::Reflectance).fit(&dataset(&spectra[..6]));
    let short = refused_fit(short, |e| matches!(e, FitError::TooFewSpectra { .. }));
    all([("M = 7, k = 6".to_owned(), enough), ("M = 6".to_owned(), short)])
}

fn collinear(engine: &Engine) -> Answer {
    let shape = |b: usize| 0.4 + 0.01 * b as f64;
    let spectra: Vec<Vec<f64>> =
        (0..50).map(|i| (0..31).map(|b| (0.5 + 0.01 * f64::from(i)) * shape(b)).collect()).collect();
    let data = dataset(&spectra);
    let two = Fit::new(SpectrumKind::Reflectance).components(2).fit(&data);
    let two = refused_fit(two, |e| matches!(e, FitError::Rank { rank: 1, .. }));
    let one = Fit::new(SpectrumKind::Reflectance).components(1).fit(&data).map_err(|e| e.to_string());
    let one = one.and_then(|model| drawn(engine, Recipe::builder(&model), ERROR));
    all([("k = 2".to_owned(), two), ("k = 1".to_owned(), one)])
}
