//! Metamers of colours, into memory of Python's.

use numpy::{PyArray1, PyReadonlyArray1, PyReadwriteArray1};
use pyo3::prelude::*;

use spectroll::export::{ColourShape, Colours, ExportError, MetamerExport, Rows};
use spectroll::{
    ColourConversion, ColourSpace, HardColours, Quantity, RecipeSettings, Sensors, UnreachableColours,
};

use crate::error::{Result, check_signals, value};
use crate::model::{Model, choice};
use crate::sampler::{EngineRequest, Request};

/// Kind of the answer to each colour, and the distance of it.
type Answers<'py> = (Bound<'py, PyArray1<u32>>, Bound<'py, PyArray1<f32>>);

/// Draws spectra of colours into an array of f32: `each` of every colour, or the most probable one where that is 0. `given`
/// are sensors as JSON, where colours are responses of these. Returns the kind of the answer to each, and its distance.
#[pyfunction]
#[allow(clippy::too_many_arguments)] // the arguments of `Sampler.given`
pub(crate) fn metamers<'py>(
    py: Python<'py>,
    model: &Bound<'py, Model>,
    settings: &str,
    given: Option<&str>,
    colours: (&str, PyReadonlyArray1<'py, f64>),
    draws: (u64, u64),
    answers: (&str, bool),
    engine: Request,
    mut spectra: PyReadwriteArray1<'py, f32>,
) -> PyResult<Answers<'py>> {
    let settings: RecipeSettings = serde_json::from_str(settings).map_err(value)?;
    let all = [("mode", HardColours::Mode), ("skip", HardColours::Skip), ("error", HardColours::Error)];
    let hard = choice("hard", answers.0, &all)?;
    let unreachable = if answers.1 { UnreachableColours::Nearest } else { UnreachableColours::Leave };
    let space = choice("space", colours.0, &ColourSpace::NAMED)?;
    let request = EngineRequest::new(engine)?;
    let given = match given {
        Some(text) => serde_json::from_str(text).map_err(value)?,
        None => Sensors::builtin(settings.observer.name()).expect("every observer is a set of sensors"),
    };
    let values = colours.1.as_slice().map_err(value)?;
    let spectra = spectra.as_slice_mut().map_err(value)?;
    let model = &model.get().model;
    let (statuses, distances) = py.detach(|| -> Result<_> {
        let invisible = || value(format!("space: the grid {} has no light that the eye sees", model.grid()));
        let conversion = ColourConversion::new(space, settings.observer, &settings.illuminant, model.grid());
        let conversion = conversion.ok_or_else(invisible)?;
        let responses = match space {
            ColourSpace::Responses => values.iter().map(|&value| value as f32).collect(),
            _ => values
                .chunks_exact(3)
                .flat_map(|c| conversion.responses([c[0], c[1], c[2]]).map(|response| response as f32))
                .collect(),
        };
        let colours = Colours { responses, shape: ColourShape::List };
        let recipe = RecipeSettings { given: Some(given), quantities: vec![Quantity::Spectra], ..settings };
        let recipe = recipe.builder(model).build()?;
        let engine = request.engine()?;
        let (seed, each) = draws;
        let export = MetamerExport::new(&recipe, &colours, each).seed(seed).answers(hard, unreachable);
        let count = (spectra.len() / model.bands()) as u64 / each.max(1);
        let (mut statuses, mut distances) = (Vec::new(), Vec::new());
        let mut rest = &mut *spectra;
        export.rows(&engine)?.draw(0..count, &mut |columns, _| {
            let (window, after) = std::mem::take(&mut rest).split_at_mut(columns[0].len() / 4);
            bytemuck::cast_slice_mut(window).copy_from_slice(columns[0]);
            rest = after;
            statuses.extend(bytemuck::pod_collect_to_vec::<u8, u32>(columns[1]));
            if unreachable == UnreachableColours::Nearest {
                distances.extend(bytemuck::pod_collect_to_vec::<u8, f32>(columns[2]));
            }
            check_signals().map_err(|_| ExportError::Interrupted)
        })?;
        Ok((statuses, distances))
    })?;
    Ok((PyArray1::from_vec(py, statuses), PyArray1::from_vec(py, distances)))
}
