//! Scenes.

use std::path::PathBuf;

use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;

use spectroll::scene::{Array, PRESETS, Scene as Described};
use spectroll::suggestion::closest;

use crate::error::{Error, Result, check_signals, os, value};
use crate::sampler::{EngineRequest, Request};

/// A scene file that was read, and the engine that is to draw it.
#[pyclass(frozen, module = "spectroll._spectroll")]
pub(crate) struct Scene {
    pub(crate) scene: Described,
    pub(crate) request: EngineRequest,
    /// Name of the file without its folder, for data sets.
    pub(crate) file_name: String,
    pub(crate) text: String,
}

/// Name, shape, type and bytes of an array, whether it has an entry for each scene, and the name of its group.
type Drawn<'py> = (String, Vec<usize>, &'static str, Bound<'py, PyArray1<u8>>, bool);

#[pymethods]
impl Scene {
    /// The scene of a file, or of an example.
    #[new]
    fn new(py: Python<'_>, name: PathBuf, seed: Option<u64>, engine: Request) -> PyResult<Scene> {
        let request = EngineRequest::new(engine)?;
        Ok(py.detach(|| open(name, seed, request))?)
    }

    #[getter]
    fn count(&self) -> u64 {
        self.scene.scenes()
    }

    #[getter]
    fn seed(&self) -> u64 {
        self.scene.seed()
    }

    #[getter]
    fn text(&self) -> &str {
        &self.text
    }

    #[getter]
    fn wavelengths<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_vec(py, self.scene.grid().wavelengths().collect())
    }

    #[getter]
    fn groups(&self) -> Vec<String> {
        self.scene.groups().map(str::to_owned).collect()
    }

    /// Name, group, quantity, shape of an entry, and whether it has one for each scene.
    fn arrays(&self) -> Vec<(String, String, &'static str, Vec<usize>, bool)> {
        let arrays = self.scene.arrays();
        arrays
            .map(|a| (a.name.clone(), a.group.clone(), a.quantity.name(), a.shape.clone(), a.per_scene))
            .collect()
    }

    /// Draws some scenes: every array.
    fn draw<'py>(&self, py: Python<'py>, start: u64, stop: u64) -> PyResult<Vec<Drawn<'py>>> {
        let count = (stop - start) as usize;
        let arrays: Vec<&Array> = self.scene.arrays().collect();
        let entry = |array: &Array| if array.per_scene { count } else { 1 };
        let made: Vec<_> = arrays
            .iter()
            .map(|array| PyArray1::<u8>::zeros(py, entry(array) * array.bytes(), false))
            .collect();
        let mut held: Vec<_> = made.iter().map(|array| array.readwrite()).collect();
        let slices = held.iter_mut().map(|array| array.as_slice_mut());
        let mut slices = slices.collect::<std::result::Result<Vec<_>, _>>().map_err(value)?;
        py.detach(|| self.fill(start..stop, &arrays, &mut slices))?;
        drop(held);
        let drawn = arrays.iter().zip(made).map(|(array, bytes)| {
            let first = array.per_scene.then_some(count);
            let shape = first.into_iter().chain(array.shape.iter().copied()).collect();
            (array.name.clone(), shape, array.dtype().name(), bytes, array.per_scene)
        });
        Ok(drawn.collect())
    }
}

impl Scene {
    fn fill(&self, scenes: std::ops::Range<u64>, arrays: &[&Array], slices: &mut [&mut [u8]]) -> Result<()> {
        let engine = self.request.engine()?;
        let mut session = self.scene.session(&engine)?;
        let place = |name: &str| arrays.iter().position(|array| array.name == name).expect("it is listed");
        for (array, bytes) in session.constants() {
            slices[place(&array.name)].copy_from_slice(&bytes);
        }
        let start = scenes.start;
        session.draw(scenes, |window| -> Result<()> {
            for (array, bytes) in window.arrays() {
                let done = (window.scenes.start - start) as usize * array.bytes();
                slices[place(&array.name)][done..][..bytes.len()].copy_from_slice(bytes);
            }
            Ok(check_signals()?)
        })?;
        Ok(())
    }
}

fn open(path: PathBuf, seed: Option<u64>, request: EngineRequest) -> Result<Scene> {
    let name = path.to_string_lossy().into_owned();
    let (name, text, folder) = match PRESETS.iter().find(|(preset, _)| *preset == name) {
        Some((_, text)) => (name, (*text).to_owned(), PathBuf::new()),
        None if path.components().count() == 1 && path.extension().is_none() && !path.exists() => {
            let known = || PRESETS.iter().map(|(preset, _)| *preset);
            let meant = closest(&name, known());
            let meant = meant.map_or(String::new(), |meant| format!(", did you mean {meant:?}?"));
            let known: Vec<_> = known().collect();
            let known = known.join(", ");
            return Err(value(format!("{name:?} is neither a file nor an example ({known}){meant}")));
        }
        None => {
            let text = std::fs::read_to_string(&path)
                .map_err(|e| os(&e, format!("cannot read the scene file {path:?}: {e}")))?;
            let folder = path.parent().map(ToOwned::to_owned).unwrap_or_default();
            (name, text, folder)
        }
    };
    let scene = match seed {
        Some(seed) => Described::parse_seeded(&name, &text, &folder, seed),
        None => Described::parse(&name, &text, &folder),
    };
    let file_name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
    Ok(Scene { scene: scene.map_err(Error::from)?, request, file_name, text })
}
