//! Models.

use std::path::PathBuf;

use numpy::{PyArray1, PyArray2, PyReadonlyArray1, PyReadonlyArray2};
use pyo3::prelude::*;

use spectroll::output::IfExists;
use spectroll::suggestion::closest;
use spectroll::{
    Dataset, Distribution, Fit, FitDistribution, Grid, Model as Fitted, ModelError, Normalization,
    SpectrumKind, Table,
};

use crate::data::Onto;
use crate::error::{self, Error, Result};

/// A grid of wavelengths, as text (`400:10:700`) or as the wavelengths themselves.
#[derive(FromPyObject)]
pub(crate) enum Wavelengths {
    Text(String),
    Each(Vec<f64>),
}

impl Wavelengths {
    pub(crate) fn grid(&self) -> Result<Grid> {
        Ok(match self {
            Wavelengths::Text(text) => text.parse::<Grid>()?,
            Wavelengths::Each(each) => Grid::from_wavelengths(each)?,
        })
    }
}

/// A Gaussian model of spectra.
#[pyclass(frozen, module = "spectroll._spectroll")]
pub(crate) struct Model {
    pub(crate) model: Fitted,
    /// Name in data sets: a built-in model's or a file's, without folders.
    pub(crate) name: String,
}

#[pymethods]
impl Model {
    /// The model of a name: a built-in one, at these wavelengths where some are given, or a file.
    #[staticmethod]
    #[pyo3(signature = (name, wavelengths=None))]
    fn open(py: Python<'_>, name: PathBuf, wavelengths: Option<Wavelengths>) -> PyResult<Model> {
        Ok(py.detach(|| open(name, wavelengths))?)
    }

    /// The model of the text of a model file.
    #[staticmethod]
    fn from_json(text: &str, name: String) -> PyResult<Model> {
        let model = Fitted::from_json(if name.is_empty() { "the text" } else { &name }, text);
        Ok(Model { model: model.map_err(Error::from)?, name })
    }

    /// A fit to tables, each a matrix of spectra in rows with its wavelengths and its name.
    #[staticmethod]
    #[allow(clippy::too_many_arguments)] // the arguments of a fit
    fn fit(
        py: Python<'_>,
        tables: Vec<(PyReadonlyArray2<'_, f64>, PyReadonlyArray1<'_, f64>, String)>,
        grid: Wavelengths,
        kind: &str,
        components: Option<usize>,
        explain: Option<f64>,
        normalize: Option<&str>,
        weights: (&str, Option<f64>, Option<usize>),
        onto: Onto,
    ) -> PyResult<Model> {
        let kind = self::kind(kind)?;
        let mut fit = Fit::new(kind).distribution(distribution(weights)?);
        if let Some(components) = components {
            fit = fit.components(components);
        }
        if let Some(share) = explain {
            fit = fit.explain(share);
        }
        if let Some(name) = normalize {
            fit = fit.normalization(normalization(name)?);
        }
        let resampling = onto.resampling()?;
        let tables = tables.iter().map(table).collect::<Result<Vec<_>>>()?;
        let model = py.detach(|| -> Result<Fitted> {
            let grid = match &grid {
                Wavelengths::Text(text) if text == "as-measured" => Dataset::measured_grid(&tables)?,
                grid => grid.grid()?,
            };
            let data = Dataset::new(&tables, grid, resampling)?;
            Ok(fit.fit(&data)?)
        })?;
        Ok(Model { model, name: String::new() })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.name
    }

    #[getter]
    fn kind(&self) -> String {
        self.model.kind().to_string()
    }

    #[getter]
    fn distribution(&self) -> &'static str {
        self.model.distribution().name()
    }

    #[getter]
    fn bandwidth(&self) -> Option<f64> {
        match self.model.distribution() {
            Distribution::Kernel { bandwidth, .. } => Some(*bandwidth),
            _ => None,
        }
    }

    #[getter]
    fn components(&self) -> usize {
        self.model.components()
    }

    #[getter]
    fn wavelengths<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.model.grid().wavelengths().collect())
    }

    #[getter]
    fn mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.model.parts().mean.as_slice())
    }

    #[getter]
    fn basis<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.model.parts().basis)
    }

    #[getter]
    fn weight_mean<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.model.parts().weight_mean.as_slice())
    }

    #[getter]
    fn weight_covariance<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        matrix(py, &self.model.parts().weight_covariance)
    }

    #[getter]
    fn explained_variance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, &self.model.parts().explained_variance)
    }

    #[getter]
    fn sources(&self) -> Vec<String> {
        self.model.parts().sources.clone()
    }

    fn to_json(&self) -> String {
        self.model.to_json()
    }

    fn save(&self, py: Python<'_>, path: PathBuf, overwrite: bool) -> PyResult<()> {
        let if_exists = if overwrite { IfExists::Replace } else { IfExists::Refuse };
        Ok(py.detach(|| self.model.save(path, if_exists).map_err(Error::from))?)
    }
}

fn open(path: PathBuf, wavelengths: Option<Wavelengths>) -> Result<Model> {
    let grid = wavelengths.map(|wavelengths| wavelengths.grid()).transpose()?;
    let text = path.to_string_lossy().into_owned();
    if Fitted::BUILTIN.contains(&text.as_str()) {
        let model = match grid {
            Some(grid) => Fitted::builtin_at(&text, grid),
            None => Fitted::builtin(&text),
        };
        return Ok(Model { model: model?, name: text });
    }
    // What is no path was meant as the name of a built-in model.
    if path.components().count() == 1 && path.extension().is_none() && !path.exists() {
        let builtin = Fitted::BUILTIN.join(", ");
        let meant = closest(&text, Fitted::BUILTIN.iter().copied());
        let meant = meant.map_or(String::new(), |meant| format!(", did you mean {meant:?}?"));
        return Err(error::value(format!(
            "{text:?} is neither a file nor a built-in model ({builtin}){meant}"
        )));
    }
    let model = Fitted::load(&path).map_err(|e| match e {
        ModelError::Data { .. } => error::data(format!("{e}: Model.fit(spectroll.read({text:?})) does")),
        other => other.into(),
    })?;
    if let Some(grid) = grid.filter(|grid| !grid.wavelengths().eq(model.grid().wavelengths())) {
        let own = model.grid();
        return Err(error::value(format!(
            "wavelengths={grid}: the grid belongs to the model {text:?}, and is {own}: fit it with Model.fit"
        )));
    }
    let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Model { model, name })
}

/// A table of the spectra in the rows of an array.
pub(crate) fn table(
    (spectra, wavelengths, name): &(PyReadonlyArray2<'_, f64>, PyReadonlyArray1<'_, f64>, String),
) -> Result<Table> {
    let rows: Vec<Vec<f64>> = spectra.as_array().rows().into_iter().map(|row| row.to_vec()).collect();
    Ok(Table::new(name, wavelengths.as_array().to_vec(), &rows)?)
}

/// A matrix as an array, row by row.
fn matrix<'py>(
    py: Python<'py>,
    matrix: &spectroll::nalgebra::DMatrix<f64>,
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let rows: Vec<Vec<f64>> = matrix.row_iter().map(|row| row.iter().copied().collect()).collect();
    PyArray2::from_vec2(py, &rows).map_err(|e| error::value(e).into())
}

pub(crate) fn kind(name: &str) -> Result<SpectrumKind> {
    choice(
        "kind",
        name,
        &[("reflectance", SpectrumKind::Reflectance), ("illuminant", SpectrumKind::Illuminant)],
    )
}

fn normalization(name: &str) -> Result<Normalization> {
    let all =
        [("mean", Normalization::Mean), ("integral", Normalization::Integral), ("none", Normalization::None)];
    choice("normalize", name, &all)
}

/// The distribution of a name, with a bandwidth or a number of normal distributions.
fn distribution((name, bandwidth, normals): (&str, Option<f64>, Option<usize>)) -> Result<FitDistribution> {
    let all = ["gaussian", "kernel", "mixture"].map(|name| (name, name));
    let name = choice("distribution", name, &all)?;
    if bandwidth.is_some() && name != "kernel" {
        return Err(error::value(format!("bandwidth= belongs to distribution=\"kernel\", not to {name:?}")));
    }
    if normals.is_some() && name != "mixture" {
        return Err(error::value(format!(
            "mixture_components= belongs to distribution=\"mixture\", not to {name:?}"
        )));
    }
    Ok(match name {
        "kernel" => FitDistribution::Kernel(bandwidth),
        "mixture" => FitDistribution::Mixture(normals.unwrap_or(FitDistribution::MIXTURE_COMPONENTS)),
        _ => FitDistribution::Gaussian,
    })
}

/// The value of a name among some, or a `ValueError` that lists them.
pub(crate) fn choice<T: Copy>(argument: &str, name: &str, all: &[(&str, T)]) -> Result<T> {
    let found = all.iter().find(|(known, _)| known.eq_ignore_ascii_case(name));
    found.map(|(_, value)| *value).ok_or_else(|| {
        let names: Vec<_> = all.iter().map(|(name, _)| format!("{name:?}")).collect();
        let meant = closest(name, all.iter().map(|(name, _)| *name));
        let meant = meant.map_or(String::new(), |meant| format!("; did you mean {meant:?}?"));
        error::value(format!("{argument}={name:?}: it is one of {}{meant}", names.join(", ")))
    })
}
