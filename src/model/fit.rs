//! The fit of a [`Model`] to a [`Dataset`] (Singh et al. 2018, appendix, eq. 1-4 and 6-7): principal components by a
//! singular value decomposition, in f64.

use nalgebra::{DMatrix, DVector, DVectorView};

use super::decomposition::Decomposition;
use super::distribution::{Distribution, MixtureComponent};
use crate::dataset::{Dataset, SpectrumKind, Unphysical};
use crate::grid::Grid;
use crate::mixture;
use crate::model::{MAX_COMPONENTS, Model, ModelParts, Normalization};
use crate::wording::counted;

/// Settings of a fit.
///
/// ```
/// use spectroll::{BuiltinTable, Dataset, Extrapolation, Fit, Grid, SpectrumKind};
///
/// let data = Dataset::new(&[BuiltinTable::Munsell.table()], Grid::DEFAULT, Extrapolation::Error)?;
/// let model = Fit::new(SpectrumKind::Reflectance).components(3).fit(&data)?;
/// assert_eq!(model.components(), 3);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug)]
pub struct Fit {
    kind: SpectrumKind,
    size: Size,
    normalization: Normalization,
    distribution: FitDistribution,
}

/// Distribution of the weights that a [`Fit`] gives a model: see [`Distribution`].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum FitDistribution {
    /// One normal distribution, as in the appendix.
    #[default]
    Gaussian,
    /// A normal distribution about each measured spectrum, with this bandwidth; where it is `None`, with the one under
    /// which the spectra are most likely, each judged by the others' truncated density of the components that have
    /// 99 % of the variance.
    Kernel(Option<f64>),
    /// This many normal distributions, by expectation maximisation.
    Mixture(usize),
}

impl FitDistribution {
    /// Number of normal distributions of a mixture, unless another is asked for.
    pub const MIXTURE_COMPONENTS: usize = 3;
}

/// Number of components to keep.
#[derive(Clone, Copy, Debug)]
enum Size {
    Components(usize),
    /// As many as explain at least this share of the variance.
    Share(f64),
}

/// Error returned where a model cannot be fitted.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum FitError {
    #[error("a model of {0} components: it needs at least 1 component, and has at most {MAX_COMPONENTS}")]
    Components(usize),
    #[error("a share of the variance of {0}: it must be above 0 and at most 1")]
    Share(f64),
    #[error(
        "a fit of {} takes at least {} spectra, and the data have {spectra}: {}",
        counted(*components as u64, "component", "components"),
        components + 1,
        if *spectra > 1 { "ask for fewer" } else { "give more files, all at once" }
    )]
    TooFewSpectra { components: usize, spectra: usize },
    #[error("all {spectra} spectra are identical: there is no variation to model")]
    NoVariation { spectra: usize },
    #[error("the data have rank {rank}, which is less than {components} components: ask for {rank} or fewer")]
    Rank { components: usize, rank: usize },
    #[error(
        "{place}: its mean power is {power}, and only a positive one can be normalised; remove it, or fit without normalization"
    )]
    Power { place: String, power: f64 },
    #[error(
        "reflectances of {mean:.4} on average, where they are between 0 and 1: these look like percentages, so divide \
         them by 100; or fit them as illuminants"
    )]
    NotReflectances { mean: f64 },
    #[error(transparent)]
    Unphysical(#[from] Unphysical),
    #[error(
        "a bandwidth of {0}: it is from 0, which repeats the measured spectra, to 1, which is the Gaussian"
    )]
    Bandwidth(f64),
    #[error(
        "a mixture of {normals} of {spectra} spectra: it takes at least 1, and at most half as many as spectra"
    )]
    Normals { normals: usize, spectra: usize },
    #[error("the principal components of these data could not be found to 1e-10: please report the data")]
    Decomposition,
    #[error("the values are too large or too small to square in f64: rescale the data, or normalise")]
    Scale,
}

impl Fit {
    /// A fit of 6 components; illuminants are divided by their mean power, reflectances are left alone.
    pub fn new(kind: SpectrumKind) -> Fit {
        let normalization = match kind {
            SpectrumKind::Illuminant => Normalization::Mean,
            SpectrumKind::Reflectance => Normalization::None,
        };
        Fit { kind, size: Size::Components(6), normalization, distribution: FitDistribution::Gaussian }
    }

    /// Keeps `components` principal components (k).
    pub fn components(self, components: usize) -> Fit {
        Fit { size: Size::Components(components), ..self }
    }

    /// Keeps the least number of principal components that explain at least this share of the data's variance, from
    /// 0 to 1.
    pub fn explain(self, share: f64) -> Fit {
        Fit { size: Size::Share(share), ..self }
    }

    /// Divides each spectrum by `normalization` first.
    pub fn normalization(self, normalization: Normalization) -> Fit {
        Fit { normalization, ..self }
    }

    /// Gives the weights this distribution.
    pub fn distribution(self, distribution: FitDistribution) -> Fit {
        Fit { distribution, ..self }
    }

    /// Fits the model.
    pub fn fit(&self, data: &Dataset) -> Result<Model, FitError> {
        let (bands, spectra) = data.spectra().shape();
        let least = match self.size {
            Size::Components(k) if !(1..=MAX_COMPONENTS).contains(&k) => return Err(FitError::Components(k)),
            Size::Components(k) => k,
            Size::Share(share) if !(share > 0.0 && share <= 1.0) => return Err(FitError::Share(share)),
            Size::Share(_) => 1,
        };
        if spectra < least + 1 {
            return Err(FitError::TooFewSpectra { components: least, spectra });
        }
        match self.distribution {
            FitDistribution::Kernel(Some(bandwidth)) if !(0.0..=1.0).contains(&bandwidth) => {
                return Err(FitError::Bandwidth(bandwidth));
            }
            FitDistribution::Mixture(normals) if !(1..=spectra / 2).contains(&normals) => {
                return Err(FitError::Normals { normals, spectra });
            }
            _ => {}
        }
        let (mut centred, powers) = self.normalization.divide(data)?;
        let mean = centred.mean();
        // Where only some are, they are named.
        let percents = centred.column_iter().filter(|spectrum| spectrum.mean() > 1.0).count();
        let are_percents = 2 * percents > centred.ncols();
        if self.kind == SpectrumKind::Reflectance && are_percents && mean.is_finite() && mean > 1.0 {
            return Err(FitError::NotReflectances { mean });
        }
        if centred.iter().all(|v| v.is_finite()) {
            data.judge(self.kind)?;
        }
        let mean = centred.column_mean(); // eq. 2, 6
        centred.column_iter_mut().for_each(|mut spectrum| spectrum -= &mean);

        // A decomposition of what is not finite would not end.
        if !centred.iter().chain(&mean).all(|v| v.is_finite()) {
            return Err(FitError::Scale);
        }
        // Spectra that differ by no more than rounding do not differ. A mean is as good as the sum that it comes from.
        let size = mean.amax().max(centred.amax());
        let rounding = size * f64::EPSILON * spectra as f64;
        if centred.amax() <= rounding {
            return Err(FitError::NoVariation { spectra });
        }
        // Squares of the data must neither overflow nor vanish; scaling by a power of two costs no digits.
        let scale = 2f64.powi(-(centred.amax().log2().floor() as i32));
        if !scale.is_finite() {
            return Err(FitError::Scale);
        }
        let Some(Decomposition { values, basis }) = Decomposition::of(&(&centred * scale)) else {
            return Err(FitError::Decomposition);
        };
        let singular = values / scale;
        let largest = singular[0] * singular[0];
        if !largest.is_normal() {
            return Err(FitError::Scale);
        }
        // As MATLAB's and NumPy's rank: what rounding alone can leave is not a component.
        let noise = bands.max(spectra) as f64 * f64::EPSILON * singular[0].max(size);
        let rank = singular.iter().filter(|&&s| s > noise).count();
        let total: f64 = singular.iter().map(|s| s * s).sum();
        let k = match self.size {
            Size::Components(k) if k > rank => return Err(FitError::Rank { components: k, rank }),
            Size::Components(k) => k,
            Size::Share(share) => enough(singular.iter().take(rank).map(|s| s * s), share * total),
        };
        if k > MAX_COMPONENTS {
            return Err(FitError::Components(k));
        }
        // In the principal frame the weights have mean zero and a diagonal covariance (eq. 4, with 1/M).
        let variances = singular.rows(0, k).map(|s| s * s / spectra as f64);
        let basis = basis.rows(0, k).into_owned();
        let model = Model::new(ModelParts {
            kind: self.kind,
            grid: data.grid().clone(),
            mean,
            basis,
            weight_mean: DVector::zeros(k),
            weight_covariance: DMatrix::from_diagonal(&variances),
            explained_variance: singular.iter().take(k).map(|s| s * s / total).collect(),
            normalization: self.normalization,
            powers,
            distribution: Distribution::Gaussian,
            sources: data.sources().to_vec(),
        });
        let model = model.expect("singular vectors are orthonormal and variances are not negative");
        Ok(self.distribution.of(model, &centred))
    }
}

impl FitDistribution {
    /// The Gaussian model with its weights so distributed, where these are the data less their mean, a spectrum a column.
    pub(super) fn of(self, model: Model, centred: &DMatrix<f64>) -> Model {
        let k = model.components();
        let weights = || projected(&model.parts().basis, centred);
        let distribution = match self {
            FitDistribution::Gaussian => return model,
            FitDistribution::Kernel(bandwidth) => {
                let weights = weights();
                let auto = || {
                    let explained = &model.parts().explained_variance;
                    let judged = enough(explained.iter().copied(), MOST * explained.iter().sum::<f64>());
                    mixture::bandwidth(&model.whitened(&weights), [k, judged], &model.half_spaces())
                };
                Distribution::Kernel { bandwidth: bandwidth.unwrap_or_else(auto), weights }
            }
            FitDistribution::Mixture(normals) => {
                let (factor, mean) = (model.weight_factor(), &model.parts().weight_mean);
                let component = |normal: mixture::Normal| MixtureComponent {
                    share: normal.share,
                    mean: mean + &factor * normal.mean,
                    covariance: &factor * normal.covariance * factor.transpose(),
                };
                let found = mixture::normals(&model.whitened(&weights()), k, normals);
                Distribution::Mixture(found.into_iter().map(component).collect())
            }
        };
        model.with_distribution(distribution).expect("it was made for the model")
    }
}

/// The share of the variance in a model that the components have by which a bandwidth is judged.
const MOST: f64 = 0.99;

/// The weights of centred spectra, a column each; of the weights, a row each. Sums in one order, so that they are the same
/// to the last bit on every machine.
fn projected(basis: &DMatrix<f64>, centred: &DMatrix<f64>) -> DMatrix<f64> {
    DMatrix::from_fn(centred.ncols(), basis.nrows(), |spectrum, component| {
        (0..basis.ncols()).map(|band| basis[(component, band)] * centred[(band, spectrum)]).sum()
    })
}

impl Normalization {
    /// Divides the spectra, a column each (eq. 1), and returns them with their divisors: none for
    /// [`None`](Normalization::None).
    pub fn divide(self, data: &Dataset) -> Result<(DMatrix<f64>, Vec<f64>), FitError> {
        let mut spectra = data.spectra().clone();
        let mut powers = Vec::new();
        if self == Normalization::None {
            return Ok((spectra, powers));
        }
        for (i, mut spectrum) in spectra.column_iter_mut().enumerate() {
            let mean = spectrum.mean();
            let divisor = self.divisor(spectrum.as_slice(), data.grid());
            if !(mean > 0.0 && divisor.is_finite()) {
                return Err(FitError::Power { place: data.place(i), power: mean });
            }
            spectrum /= divisor;
            powers.push(divisor);
        }
        Ok((spectra, powers))
    }

    /// Divisor of a spectrum on this grid: 1 for [`None`](Normalization::None).
    pub fn divisor(self, spectrum: &[f64], grid: &Grid) -> f64 {
        let spectrum = DVectorView::from_slice(spectrum, spectrum.len());
        match self {
            Normalization::None => 1.0,
            Normalization::Mean => spectrum.mean(),
            Normalization::Integral => match grid.step() {
                Some(step) => spectrum.sum() * step,
                None => spectrum.iter().zip(grid.widths()).map(|(value, width)| value * width).sum(),
            },
        }
    }
}

/// Number of these parts, in order, that sum to `wanted`; all of them where rounding leaves less.
fn enough(parts: impl ExactSizeIterator<Item = f64>, wanted: f64) -> usize {
    let all = parts.len();
    let sums = parts.scan(0.0, |sum, part| {
        *sum += part;
        Some(*sum)
    });
    (sums.take_while(|&sum| sum < wanted).count() + 1).min(all)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::Table;
    use crate::grid::Extrapolation;

    #[test]
    fn spectra_are_divided_by_what_was_asked_for() {
        let grid = Grid::new(400.0, 10.0, 3).unwrap();
        let spectra = [[1.0, 2.0, 6.0], [2.0, 2.0, 2.0], [4.0, 1.0, 1.0]];
        let table = Table::new("three", grid.wavelengths().collect(), &spectra.map(|s| s.to_vec())).unwrap();
        let data = Dataset::new(&[table], grid, Extrapolation::Error).unwrap();
        for (normalization, first, powers) in [
            (Normalization::Mean, [1.0 / 3.0, 2.0 / 3.0, 2.0], vec![3.0, 2.0, 2.0]),
            (Normalization::Integral, [1.0 / 90.0, 2.0 / 90.0, 6.0 / 90.0], vec![90.0, 60.0, 60.0]),
            (Normalization::None, [1.0, 2.0, 6.0], vec![]),
        ] {
            let (divided, found) = normalization.divide(&data).unwrap();
            assert_eq!(found, powers);
            assert!(divided.column(0).iter().zip(first).all(|(a, b)| (a - b).abs() < 1e-15), "{divided}");
            let fit = Fit::new(SpectrumKind::Illuminant).components(1).normalization(normalization);
            assert_eq!(fit.fit(&data).unwrap().parts().powers, powers);
        }
        let unasked = Fit::new(SpectrumKind::Illuminant).components(1).fit(&data).unwrap();
        assert_eq!(unasked.parts().normalization, Normalization::Mean);
        let unasked = Fit::new(SpectrumKind::Reflectance).components(1).fit(&data);
        assert!(
            matches!(unasked, Err(FitError::NotReflectances { mean }) if (mean - 7.0 / 3.0).abs() < 1e-15)
        );
    }

    /// A direction counts if its singular value is above max(bands, spectra) x epsilon x the largest, as in NumPy.
    #[test]
    fn a_direction_counts_from_the_tolerance_on() {
        let rank = |size: f64, unit: f64| {
            let spectra: Vec<_> = (0..8u32)
                .map(|i| {
                    // Centred, 0.25 and `size` with either sign.
                    let sign = |bit: u32| if i >> bit & 1 == 0 { 2.0 } else { 0.0 };
                    [0.25 * sign(0), 0.25 * sign(0), size * sign(1), 0.5, 0.5].map(|v| v * unit).to_vec()
                })
                .collect();
            let grid = Grid::new(400.0, 10.0, 5).unwrap();
            let table = Table::new("signs", grid.wavelengths().collect(), &spectra).unwrap();
            let data = Dataset::new(&[table], grid, Extrapolation::Error).unwrap();
            let fit = Fit::new(SpectrumKind::Illuminant).components(2).normalization(Normalization::None);
            fit.fit(&data).map(|model| model.components())
        };
        // Singular values are sqrt(8) x the sizes of the directions, of which the first has sqrt(2) / 4.
        let tolerance = 8.0 * f64::EPSILON * 2f64.sqrt() / 4.0;
        for unit in [1.0, 2f64.powi(-40), 2f64.powi(40)] {
            assert_eq!(rank(1.5 * tolerance, unit), Ok(2));
            assert_eq!(rank(0.5 * tolerance, unit), Err(FitError::Rank { components: 2, rank: 1 }));
        }
        // Squares of these vanish.
        assert_eq!(rank(1.0, 2f64.powi(-600)), Err(FitError::Scale));
    }

    #[test]
    fn percents_are_no_reflectances() {
        let percents: Vec<_> =
            (0..9).map(|i| vec![40.0 + f64::from(i), 50.0, 60.0 - f64::from(i * i)]).collect();
        let table = Table::new("percents.csv", vec![400.0, 410.0, 420.0], &percents).unwrap();
        let data = Dataset::new(&[table], Grid::new(400.0, 10.0, 3).unwrap(), Extrapolation::Error).unwrap();
        let message = Fit::new(SpectrumKind::Reflectance).components(2).fit(&data).unwrap_err().to_string();
        assert!(message.contains("look like percentages"), "{message}");
        assert!(Fit::new(SpectrumKind::Illuminant).components(2).fit(&data).is_ok());
    }

    #[test]
    fn a_spectrum_that_cannot_be_normalised_is_named_by_its_source() {
        let wavelengths = vec![400.0, 410.0, 420.0];
        let table = |name, spectra: &[[f64; 3]]| {
            let spectra: Vec<_> = spectra.iter().map(|s| s.to_vec()).collect();
            Table::new(name, wavelengths.clone(), &spectra).unwrap()
        };
        let tables = [
            table("a.csv", &[[1.0, 2.0, 3.0], [2.0, 1.0, 1.0]]),
            table("b.csv", &[[1.0, 1.0, 2.0], [0.0; 3]]),
        ];
        let data = Dataset::new(&tables, Grid::new(400.0, 10.0, 3).unwrap(), Extrapolation::Error).unwrap();
        let fit =
            Fit::new(SpectrumKind::Illuminant).components(1).normalization(Normalization::Mean).fit(&data);
        let message = fit.unwrap_err().to_string();
        assert!(message.contains("spectrum 2 of b.csv") && !message.contains("a.csv"), "{message}");
    }

    /// Finite, but not once they are centred, scaled or divided: a decomposition of such data would never end.
    #[test]
    fn data_at_the_ends_of_f64_are_refused() {
        for (size, normalization) in
            [(1e-310, Normalization::None), (1.7e308, Normalization::None), (1e-320, Normalization::Mean)]
        {
            let spectra: Vec<_> = (0..9)
                .map(|i| (0..4).map(|b| if (i + b) % 3 == 0 { size } else { -size / 2.0 }).collect())
                .collect();
            let wavelengths = vec![400.0, 410.0, 420.0, 430.0];
            let table = Table::new("extremes", wavelengths, &spectra).unwrap();
            let data = Dataset::new(&[table], Grid::new(400.0, 10.0, 4).unwrap(), Extrapolation::Error);
            let Ok(data) = data else {
                assert!(size > 1e300, "{size:e}: {data:?}"); // as a mark of missing values
                continue;
            };
            let fit =
                Fit::new(SpectrumKind::Reflectance).components(2).normalization(normalization).fit(&data);
            let expected =
                matches!(fit, Err(FitError::Scale | FitError::Power { .. } | FitError::Unphysical(_)));
            assert!(expected, "{size:e}: {fit:?}");
        }
    }
}
