//! A fitted model, its file format, and the models that are built in.
//!
//! A model is checked when it is made, whether by a fit, from a file or by hand, so what holds one may rely on its
//! shapes, on an orthonormal basis and on a covariance that has a square root.

use std::path::Path;

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use serde::{Deserialize, Serialize};

mod builtin;
mod decomposition;
mod distribution;
mod fit;

pub use builtin::BuiltinData;
pub use distribution::{Distribution, MixtureComponent};
pub use fit::{Fit, FitDistribution, FitError};

use distribution::DistributionRecord;

use crate::affine::Affine;
use crate::dataset::{SpectrumKind, Table};
use crate::grid::{Grid, GridError};
use crate::plain_file;
use crate::wording::counted;

/// The most components a model may have: what the counter layout of a draw has blocks for (see
/// [`Stream::block`](crate::Stream::block)).
pub const MAX_COMPONENTS: usize = 1000;

/// The largest model file that is read, in bytes: 1,000 components of 10,000 bands have some 200 MB.
const MAX_FILE_BYTES: u64 = 512 << 20;

/// The version of the file format that this program writes, and the newest that it reads.
const SCHEMA: u32 = 1;

/// Choice of what each spectrum is divided by before the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
pub enum Normalization {
    /// Its mean power over the grid (eq. 1).
    Mean,
    /// Its integral over the grid: the sum of its values times the step in nm.
    Integral,
    /// Nothing.
    None,
}

/// A Gaussian model of spectra: a spectrum is mean + sum over components of weight x basis vector, and the weights
/// are normal with a mean and a covariance (Singh et al. 2018, appendix, eq. 2-8).
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    parts: ModelParts,
    basis_correction: Option<f64>,
}

/// Parts of a model; [`Model::new`] checks them.
#[derive(Clone, Debug, PartialEq)]
pub struct ModelParts {
    /// Kind of the spectra.
    pub kind: SpectrumKind,
    /// The wavelengths, n of them.
    pub grid: Grid,
    /// The mean spectrum, n values.
    pub mean: DVector<f64>,
    /// k orthonormal rows of n values. Rows that are orthonormal to 1e-5, as single precision leaves them, are made so in
    /// double precision.
    pub basis: DMatrix<f64>,
    /// The mean of the weights, k values.
    pub weight_mean: DVector<f64>,
    /// The covariance of the weights, k x k, positive semi-definite.
    pub weight_covariance: DMatrix<f64>,
    /// The share of the data's variance that each component explains, k values.
    pub explained_variance: Vec<f64>,
    /// Divisor of the spectra.
    pub normalization: Normalization,
    /// Divisor of each of the spectra, positive; empty where they are not known or nothing was divided.
    pub powers: Vec<f64>,
    /// Distribution of the weights.
    pub distribution: Distribution,
    /// Sources of the data, a line each.
    pub sources: Vec<String>,
}

/// Error returned where something is not a model.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum ModelError {
    #[error("cannot read model {path}: {source}")]
    Read { path: String, source: std::io::Error },
    #[error("{path} holds measured data, not a model: fit a model to it first")]
    Data { path: String },
    #[error("{path} is not a model file: {source}")]
    Json { path: String, source: serde_json::Error },
    #[error("{path} is a model of schema {found}, and this program reads up to {SCHEMA}: update spectroll")]
    Schema { path: String, found: u32 },
    #[error("{path}: {source}")]
    Invalid { path: String, source: Box<ModelError> },
    #[error("the wavelengths are not a grid: {0}")]
    Grid(#[from] GridError),
    #[error("{field} has {} where the rest of the model needs {expected}", counted(*found as u64, "value", "values"))]
    Shape { field: &'static str, found: usize, expected: usize },
    #[error("{field} holds {value}; every value must be finite")]
    NotFinite { field: &'static str, value: f64 },
    #[error(
        "a model has 1 to {MAX_COMPONENTS} components, and no more than bands; this one has {components} for {}",
        counted(*bands as u64, "band", "bands")
    )]
    Components { components: usize, bands: usize },
    #[error(
        "basis vectors {row} and {column} have the product {product} where an orthonormal basis has {expected} (to 1e-5)"
    )]
    NotOrthonormal { row: usize, column: usize, product: f64, expected: f64 },
    #[error(
        "a distribution of {found} parts ({name}): there are 1 to {} of them; take a part of the spectra",
        crate::mixture::MOST_CENTRES
    )]
    Centres { name: &'static str, found: usize },
    #[error(
        "a bandwidth of {0}: it is from 0, which repeats the measured spectra, to 1, which is the Gaussian"
    )]
    Bandwidth(f64),
    #[error("a component of the mixture has the share {0}; it must be above 0")]
    Share(f64),
    #[error("powers holds {0}; what spectra are divided by is finite and above 0")]
    Power(f64),
    #[error(
        "explained_variance holds {0}: each is a share of the data's variance, at least 0, and together they are at most 1"
    )]
    ExplainedVariance(f64),
    #[error("weight_covariance is not symmetric: entries {row},{column} and {column},{row} differ")]
    NotSymmetric { row: usize, column: usize },
    #[error(
        "weight_covariance is not positive semi-definite: it has the eigenvalue {smallest} beside {largest}"
    )]
    NotPositive { smallest: f64, largest: f64 },
    #[error("there is no built-in model {name:?}; there are {}", Model::BUILTIN.join(", "))]
    NoBuiltin { name: String },
    #[error(
        "{name} was measured from {first} to {last} nm, which does not cover the grid {grid}: choose one within it, or \
         fit a model to data that cover it"
    )]
    BuiltinRange { name: String, first: f64, last: f64, grid: Grid },
    #[error("{name} cannot be fitted at {grid} nm, choose a grid of more bands or a wider one: {source}")]
    BuiltinFit { name: String, grid: Grid, source: Box<FitError> },
}

impl Model {
    /// A model of these parts.
    pub fn new(mut parts: ModelParts) -> Result<Model, ModelError> {
        let (k, n) = (parts.basis.nrows(), parts.grid.len());
        if k == 0 || k > n.min(MAX_COMPONENTS) {
            return Err(ModelError::Components { components: k, bands: n });
        }
        let fields: [(&str, &[f64], usize); 5] = [
            ("mean", parts.mean.as_slice(), n),
            ("basis", parts.basis.as_slice(), k * n),
            ("weight_mean", parts.weight_mean.as_slice(), k),
            ("weight_covariance", parts.weight_covariance.as_slice(), k * k),
            ("explained_variance", &parts.explained_variance, k),
        ];
        for (field, values, expected) in fields {
            has_shape(field, values.len(), expected)?;
            are_finite(field, values)?;
        }
        has_shape("a column of weight_covariance", parts.weight_covariance.nrows(), k)?;
        let mut explained = 0.0;
        for &share in &parts.explained_variance {
            explained += share;
            if share < 0.0 || explained > 1.0 + 1e-5 {
                return Err(ModelError::ExplainedVariance(share));
            }
        }
        if let Some(&value) = parts.powers.iter().find(|power| !(power.is_finite() && **power > 0.0)) {
            return Err(ModelError::Power(value));
        }
        parts.distribution.check(k)?;
        let basis_correction = orthonormalise(&mut parts.basis)?;
        check_covariance(&parts.weight_covariance)?;
        // Halves that agree to rounding are made to agree exactly, so that a factor of either is the same.
        let given = &parts.weight_covariance;
        parts.weight_covariance = DMatrix::from_fn(k, k, |row, column| {
            match (given[(row, column)], given[(column, row)]) {
                (above, below) if above == below => above, // half a subnormal number may not be one
                (above, below) => above / 2.0 + below / 2.0,
            }
        });
        Ok(Model { parts, basis_correction })
    }

    /// Reads a model file.
    pub fn load(path: impl AsRef<Path>) -> Result<Model, ModelError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        if Table::may_open(path) {
            return Err(ModelError::Data { path: name });
        }
        let text = plain_file::read_text(path, MAX_FILE_BYTES)
            .map_err(|source| ModelError::Read { path: name.clone(), source })?;
        Model::from_json(&name, &text)
    }

    /// Reads the text of a model file; `path` is what messages call it.
    pub fn from_json(path: &str, text: &str) -> Result<Model, ModelError> {
        let json = |source| ModelError::Json { path: path.to_owned(), source };
        let Version { schema } = serde_json::from_str(text).map_err(json)?;
        if schema > SCHEMA {
            return Err(ModelError::Schema { path: path.to_owned(), found: schema });
        }
        let file: File = serde_json::from_str(text).map_err(json)?;
        let invalid = |e| ModelError::Invalid { path: path.to_owned(), source: Box::new(e) };
        file.into_parts().and_then(Model::new).map_err(invalid)
    }

    /// The text of a model file. Reading it gives the same model, to the last bit.
    pub fn to_json(&self) -> String {
        serde_json::to_string_pretty(&File::from_parts(&self.parts))
            .expect("numbers and strings are always JSON")
    }

    /// Parts of the model.
    pub fn parts(&self) -> &ModelParts {
        &self.parts
    }

    /// The largest error of a product of two vectors of the basis that was given, where that was changed into the nearest
    /// orthonormal one; `None` where it was taken as it was.
    pub fn basis_correction(&self) -> Option<f64> {
        self.basis_correction
    }

    /// Kind of the spectra.
    pub fn kind(&self) -> SpectrumKind {
        self.parts.kind
    }

    /// The wavelengths.
    pub fn grid(&self) -> &Grid {
        &self.parts.grid
    }

    /// The number of wavelengths, n.
    pub fn bands(&self) -> usize {
        self.parts.grid.len()
    }

    /// The number of components, k.
    pub fn components(&self) -> usize {
        self.parts.basis.nrows()
    }

    /// The weights of a spectrum (n values): basis . (spectrum - mean), eq. 3 and 7.
    pub fn project(&self, spectrum: &[f64]) -> DVector<f64> {
        &self.parts.basis * (DVector::from_column_slice(spectrum) - &self.parts.mean)
    }

    /// The spectrum of weights (k values): mean + weights . basis, eq. 5 and 8.
    pub fn reconstruct(&self, weights: &[f64]) -> DVector<f64> {
        &self.parts.mean + self.parts.basis.transpose() * DVector::from_column_slice(weights)
    }

    /// The wavelength and the value of the mean spectrum where that is furthest from what spectra can be: below 0 or, of
    /// reflectances, above 1. `None` where it is neither. Draws, which keep to these bounds, have another mean than such a
    /// model.
    pub fn impossible_mean(&self) -> Option<(f64, f64)> {
        let mean = self.reconstruct(self.parts.weight_mean.as_slice());
        let most = if self.parts.kind == SpectrumKind::Reflectance { 1.0 } else { f64::INFINITY };
        let excess = |value: f64| (-value).max(value - most);
        let (band, &value) =
            mean.iter().enumerate().max_by(|(_, a), (_, b)| excess(**a).total_cmp(&excess(**b)))?;
        // A mean of zeros may be a little below after rounding.
        (excess(value) > 1e-9 * mean.amax()).then(|| (self.parts.grid.wavelength(band), value))
    }

    /// The factor that turns k standard normals into centred weights: a square root of the covariance. Diagonal where
    /// the covariance is; else the symmetric root, which exists where a Cholesky factor does not (deficient rank).
    pub fn weight_factor(&self) -> DMatrix<f64> {
        let covariance = &self.parts.weight_covariance;
        if is_diagonal(covariance) {
            return covariance.map(|v| v.max(0.0).sqrt());
        }
        let eigen = SymmetricEigen::new(covariance.clone());
        let roots = eigen.eigenvalues.map(|v| v.max(0.0).sqrt());
        &eigen.eigenvectors * DMatrix::from_diagonal(&roots) * eigen.eigenvectors.transpose()
    }
}

impl Model {
    /// The weights as a map of k standard normals.
    pub(crate) fn weight_map(&self, covariance_scale: f64) -> Affine {
        let factor = self.weight_factor() * covariance_scale.sqrt();
        Affine {
            offset: self.parts.weight_mean.as_slice().to_vec(),
            gain: factor.column_iter().map(|column| column.iter().copied().collect()).collect(),
        }
    }

    /// The spectrum as a map of what the weights are one of.
    pub(crate) fn spectrum_map(&self, weights: &Affine) -> Affine {
        let columns: Vec<_> =
            self.parts.basis.column_iter().map(|c| c.iter().copied().collect::<Vec<_>>()).collect();
        let mut spectrum = weights.project(&columns);
        spectrum.offset.iter_mut().zip(&self.parts.mean).for_each(|(s, mean)| *s += mean);
        spectrum
    }
}

fn is_diagonal(matrix: &DMatrix<f64>) -> bool {
    matrix.row_iter().enumerate().all(|(i, row)| row.iter().enumerate().all(|(j, &v)| i == j || v == 0.0))
}

/// The error of products of basis vectors up to which they are taken as they are.
const ORTHONORMAL: f64 = 1e-9;

/// The error up to which they are made orthonormal: what principal components in single precision have.
const NEARLY_ORTHONORMAL: f64 = 1e-5;

/// Makes nearly orthonormal rows so, and returns their error where it did: the nearest orthonormal rows are the square
/// root of the inverse of their products times them (Löwdin 1950).
fn orthonormalise(basis: &mut DMatrix<f64>) -> Result<Option<f64>, ModelError> {
    let products = &*basis * basis.transpose();
    let mut largest = 0f64;
    for (row, column) in (0..basis.nrows()).flat_map(|i| (0..=i).map(move |j| (i, j))) {
        let (product, expected) = (products[(row, column)], f64::from(row == column));
        let error = (product - expected).abs();
        if error > NEARLY_ORTHONORMAL {
            return Err(ModelError::NotOrthonormal { row: row + 1, column: column + 1, product, expected });
        }
        largest = largest.max(error);
    }
    if largest <= ORTHONORMAL {
        return Ok(None);
    }
    let eigen = SymmetricEigen::new(products);
    let roots = DMatrix::from_diagonal(&eigen.eigenvalues.map(|value| value.sqrt().recip()));
    *basis = &eigen.eigenvectors * roots * eigen.eigenvectors.transpose() * &*basis;
    Ok(Some(largest))
}

/// Symmetric and positive semi-definite, to rounding: 1e-9 of the largest entry or eigenvalue.
fn check_covariance(covariance: &DMatrix<f64>) -> Result<(), ModelError> {
    let tolerance = 1e-9 * covariance.amax();
    let asymmetry = covariance - covariance.transpose();
    if asymmetry.amax() > tolerance {
        let (row, column) = asymmetry.iamax_full();
        return Err(ModelError::NotSymmetric { row: row + 1, column: column + 1 });
    }
    let eigenvalues = covariance.symmetric_eigenvalues();
    let (smallest, largest) = (eigenvalues.min(), eigenvalues.amax());
    if smallest < -1e-9 * largest {
        return Err(ModelError::NotPositive { smallest, largest });
    }
    Ok(())
}

/// The version alone: read first, so that a newer file is told from a broken one.
#[derive(Deserialize)]
struct Version {
    schema: u32,
}

/// A model file.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct File {
    schema: u32,
    kind: SpectrumKind,
    wavelengths: Vec<f64>,
    mean: Vec<f64>,
    basis: Vec<Vec<f64>>,
    weight_mean: Vec<f64>,
    weight_covariance: Vec<Vec<f64>>,
    explained_variance: Vec<f64>,
    normalization: Normalization,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    powers: Vec<f64>,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    distribution: Option<DistributionRecord>,
    sources: Vec<String>,
}

impl File {
    fn from_parts(parts: &ModelParts) -> File {
        File {
            schema: SCHEMA,
            kind: parts.kind,
            wavelengths: parts.grid.wavelengths().collect(),
            mean: parts.mean.as_slice().to_vec(),
            basis: rows(&parts.basis),
            weight_mean: parts.weight_mean.as_slice().to_vec(),
            weight_covariance: rows(&parts.weight_covariance),
            explained_variance: parts.explained_variance.clone(),
            normalization: parts.normalization,
            powers: parts.powers.clone(),
            distribution: DistributionRecord::of(&parts.distribution),
            sources: parts.sources.clone(),
        }
    }

    fn into_parts(self) -> Result<ModelParts, ModelError> {
        if self.basis.is_empty() {
            return Err(ModelError::Components { components: 0, bands: self.wavelengths.len() });
        }
        let k = self.basis.len();
        let distribution = self.distribution.map(|record| record.into_distribution(k)).transpose()?;
        Ok(ModelParts {
            kind: self.kind,
            basis: matrix("basis", &self.basis, self.wavelengths.len())?,
            weight_covariance: matrix("weight_covariance", &self.weight_covariance, self.basis.len())?,
            grid: Grid::from_wavelengths(&self.wavelengths)?,
            mean: self.mean.into(),
            weight_mean: self.weight_mean.into(),
            explained_variance: self.explained_variance,
            normalization: self.normalization,
            powers: self.powers,
            distribution: distribution.unwrap_or_default(),
            sources: self.sources,
        })
    }
}

fn has_shape(field: &'static str, found: usize, expected: usize) -> Result<(), ModelError> {
    if found == expected { Ok(()) } else { Err(ModelError::Shape { field, found, expected }) }
}

fn are_finite(field: &'static str, values: &[f64]) -> Result<(), ModelError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(ModelError::NotFinite { field, value }),
        None => Ok(()),
    }
}

fn rows(matrix: &DMatrix<f64>) -> Vec<Vec<f64>> {
    matrix.row_iter().map(|row| row.iter().copied().collect()).collect()
}

/// A matrix of rows that must each have `columns` values.
fn matrix(field: &'static str, rows: &[Vec<f64>], columns: usize) -> Result<DMatrix<f64>, ModelError> {
    match rows.iter().find(|row| row.len() != columns) {
        Some(row) => Err(ModelError::Shape { field, found: row.len(), expected: columns }),
        None => Ok(DMatrix::from_row_iterator(rows.len(), columns, rows.iter().flatten().copied())),
    }
}
