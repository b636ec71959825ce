//! Scenes as a data set: a row per scene, its arrays as columns, and beside them the arrays that all scenes share.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::io;
use std::ops::{ControlFlow, Range};

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use super::provenance::{Sum, model_sum};
use super::{Companions, Destination, ExportError, Output, Rows, Window, Writing};
use crate::dataset::SpectrumKind;
use crate::engine::{Engine, EngineError};
use crate::output::{Field, LrvLabel, Schema, SharedArray, SpectraArray};
use crate::quantity::Quantity;
use crate::scene::{Array, GroupKind, GroupSummary, Scene, SceneSession};

/// Approximate number of spectra that tell how an engine rounds, and the largest number of scenes for them.
const ROUNDED: (u64, u64) = (4096, 64);

/// The arrays of a scene that are wanted.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ArraySelection {
    /// The only group, where one is named.
    pub only: Option<String>,
    /// The names of the arrays; all where none is named.
    #[serde(default)]
    pub arrays: Vec<String>,
}

/// Error returned by [`ArraySelection::apply`].
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("there is no {what} {name:?}{}; there are {}", suggestion(name, known), known.join(", "))]
pub struct SelectionError {
    what: &'static str,
    name: String,
    known: Vec<String>,
}

fn suggestion(name: &str, known: &[String]) -> String {
    let nearest = crate::suggestion::closest(name, known.iter().map(String::as_str));
    nearest.map_or_else(String::new, |near| format!(", did you mean {near:?}?"))
}

impl ArraySelection {
    /// The scene with the groups alone that these arrays need.
    pub fn apply(&self, mut scene: Scene) -> Result<Scene, SelectionError> {
        let unknown = |what, name: &str, known| SelectionError { what, name: name.to_owned(), known };
        if let Some(only) = &self.only {
            let known: Vec<_> = scene.groups().map(str::to_owned).collect();
            scene = scene.only(only).ok_or_else(|| unknown("group", only, known))?;
        }
        let known: Vec<_> = scene.arrays().map(|array| array.name.clone()).collect();
        if let Some(name) = self.arrays.iter().find(|name| !known.contains(name)) {
            return Err(unknown("array", name, known));
        }
        let wanted: Vec<_> =
            scene.arrays().filter(|array| self.has(array)).map(|array| array.group.clone()).collect();
        Ok(scene.keep(|group| wanted.iter().any(|name| name == group)).expect("every array is of a group"))
    }

    /// Whether an array is wanted.
    pub fn has(&self, array: &Array) -> bool {
        self.arrays.is_empty() || self.arrays.contains(&array.name)
    }
}

/// Scenes that are to be written.
#[derive(Clone)]
pub struct SceneExport<'a> {
    scene: &'a Scene,
    scenes: Range<u64>,
    selection: ArraySelection,
    /// The name and the text of the scene file.
    file: Option<(String, String)>,
}

impl<'a> SceneExport<'a> {
    /// An export of some scenes, with all their arrays.
    pub fn new(scene: &'a Scene, scenes: Range<u64>) -> SceneExport<'a> {
        SceneExport { scene, scenes, selection: ArraySelection::default(), file: None }
    }

    /// The arrays that are wanted, of a scene that [`ArraySelection::apply`] gave.
    pub fn selection(self, selection: ArraySelection) -> Self {
        SceneExport { selection, ..self }
    }

    /// The name and the text of the file that the scene was read from, which the data set records so that it can be
    /// verified.
    pub fn file(self, name: &str, text: &str) -> Self {
        SceneExport { file: Some((name.to_owned(), text.to_owned())), ..self }
    }

    /// Schema of the data set: its columns, and the scene and seed it is made from. The shared arrays have no values
    /// yet.
    pub fn schema(&self, output: &Output) -> Schema {
        let holds_shared = output.destination().holds_shared_arrays();
        let is_text = output.destination() == Destination::SpdFolder;
        let has = |array: &Array| match is_text {
            true => self.is_text(array),
            false => self.selection.has(array),
        };
        let wanted = || self.scene.arrays().filter(|array| has(array));
        let varying = wanted().filter(|array| array.per_scene);
        let (shared, repeated): (Vec<_>, Vec<_>) =
            wanted().filter(|array| !array.per_scene).partition(|_| holds_shared);
        Schema {
            fields: varying
                .chain(repeated)
                .map(|array| field(array).stored_as(output.stored(array.quantity)))
                .collect(),
            row: "scene".to_owned(),
            shared: shared.into_iter().map(|array| description(array, output)).collect(),
            count: self.scenes.end - self.scenes.start,
            wavelengths: self.scene.grid().wavelengths().collect(),
            attributes: self.attributes(),
        }
    }

    /// Files beside the rows.
    pub fn companions(&self) -> Companions {
        let files = self.file.iter().map(|(_, text)| ("_scene.toml", text.clone())).collect();
        Companions { spectra: self.spectra().collect(), first: self.scenes.start, files }
    }

    /// The arrays of spectra that are wanted.
    fn spectra(&self) -> impl Iterator<Item = SpectraArray> {
        let is_spectra = |array: &&Array| array.quantity == Quantity::Spectra && self.selection.has(array);
        self.scene.arrays().filter(is_spectra).map(|array| SpectraArray {
            name: array.name.clone(),
            group: Some(array.group.clone()),
            kind: match array.kind {
                GroupKind::Illuminant => SpectrumKind::Illuminant,
                GroupKind::Surface | GroupKind::Target => SpectrumKind::Reflectance,
            },
            lrv: self.lrv(&array.group).map_or(LrvLabel::None, |lrv| LrvLabel::Field(lrv.name.clone())),
        })
    }

    /// The luminous reflectances of a group, where they are known.
    fn lrv(&self, group: &str) -> Option<&Array> {
        self.scene.arrays().find(|array| array.group == group && array.quantity == Quantity::Lrv)
    }

    /// Whether a folder of text files has an array, be it in their names: where none is named, all spectra and their
    /// labels.
    fn is_text(&self, array: &Array) -> bool {
        let labels = |spectra: &SpectraArray| spectra.lrv == LrvLabel::Field(array.name.clone());
        let is_named = !self.selection.arrays.is_empty() && self.selection.has(array);
        is_named || self.spectra().any(|spectra| spectra.name == array.name || labels(&spectra))
    }

    /// The rows, to be drawn by an engine.
    pub fn rows(&self, engine: &'a Engine, schema: &Schema) -> Result<SceneRows<'a>, EngineError> {
        SceneRows::new(self.scene, engine, schema, self.scenes.start)
    }

    /// Draws and writes the whole.
    pub fn write(&self, engine: &'a Engine, output: &Output) -> Result<Vec<GroupSummary>, ExportError> {
        let (schema, companions) = (self.schema(output), self.companions());
        output.check(&schema, &companions)?;
        output.check_space(&schema, &companions)?;
        let mut rows = self.rows(engine, &schema)?;
        let writing = Writing::open(output, schema, &companions, engine, &mut rows)?;
        writing.run(&mut rows, &mut |_| ControlFlow::Continue(()))?;
        Ok(rows.drawn)
    }

    fn attributes(&self) -> Map<String, Value> {
        let (name, text) = self.file.clone().unwrap_or_default();
        let attributes = json!({
            "scene_file": name,
            "scene": text,
            "models_blake3": model_sums(self.scene),
            "selection": self.selection,
            "seed": self.scene.seed(),
            "start": self.scenes.start,
            "program": concat!("spectroll ", env!("CARGO_PKG_VERSION")),
        });
        let Value::Object(attributes) = attributes else { unreachable!("it is written as one") };
        attributes
    }
}

/// The BLAKE3 sum of each group's model, where it has one, by the name of the group.
pub fn model_sums(scene: &Scene) -> BTreeMap<String, String> {
    scene.models().map(|(group, model)| (group.to_owned(), model_sum(model))).collect()
}

/// Scenes as rows of a data set.
pub struct SceneRows<'a> {
    scene: &'a Scene,
    session: SceneSession<'a>,
    /// The first scene of the data set.
    first: u64,
    /// The names of the columns.
    columns: Vec<String>,
    /// The columns among them that are the same in every row, each with an entry of it.
    repeated: Vec<(String, Vec<u8>)>,
    /// A summary of each group's draws.
    pub drawn: Vec<GroupSummary>,
}

impl<'a> SceneRows<'a> {
    /// The rows of a schema, from scene `first` on.
    pub fn new(
        scene: &'a Scene,
        engine: &'a Engine,
        schema: &Schema,
        first: u64,
    ) -> Result<SceneRows<'a>, EngineError> {
        let session = scene.session(engine)?;
        let columns: Vec<String> = schema.fields.iter().map(|field| field.name.clone()).collect();
        let shared = session.constants().into_iter();
        let repeated = shared
            .filter(|(array, _)| columns.contains(&array.name))
            .map(|(array, bytes)| (array.name.clone(), bytes))
            .collect();
        let drawn = session.taken_once();
        Ok(SceneRows { scene, session, first, columns, repeated, drawn })
    }
}

impl Rows for SceneRows<'_> {
    fn rounding(&mut self) -> Result<String, EngineError> {
        let groups = self.scene.workload(1).groups;
        let each: u64 = groups.iter().map(|group| group.draws_per_scene).sum();
        let scenes = (ROUNDED.0 / each.max(1)).clamp(1, ROUNDED.1).min(self.scene.scenes());
        let mut sum = Sum::default();
        self.session.draw(0..scenes, |window| {
            // Scene by scene, so that it does not matter how many windows there are.
            for scene in 0..window.scenes.end - window.scenes.start {
                for (array, bytes) in window.arrays() {
                    let start = scene as usize * array.bytes();
                    sum.update(&bytes[start..start + array.bytes()]);
                }
            }
            Ok::<_, EngineError>(())
        })?;
        Ok(sum.finish())
    }

    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> Result<(), ExportError> {
        let scenes = self.first + rows.start..self.first + rows.end;
        let (columns, repeated) = (&self.columns, &self.repeated);
        let drawn = self.session.draw(scenes, |drawn| {
            let count = drawn.scenes.end - drawn.scenes.start;
            let column = |name: &String| match repeated.iter().find(|(other, _)| other == name) {
                Some((_, entry)) => Cow::Owned(entry.repeat(count as usize)),
                None => Cow::Borrowed(drawn.bytes(name)),
            };
            let columns: Vec<_> = columns.iter().map(column).collect();
            window(&columns.iter().map(|column| &**column).collect::<Vec<_>>(), count)
        })?;
        for (all, part) in self.drawn.iter_mut().zip(drawn) {
            all.summary += part.summary;
        }
        Ok(())
    }

    fn shared(&self, described: &[SharedArray]) -> io::Result<Vec<SharedArray>> {
        let drawn = self.session.constants();
        let filled = |shared: &SharedArray| {
            let found = drawn.iter().find(|(array, _)| array.name == shared.name);
            let bytes = match found {
                Some((array, bytes)) => field(array).stored_as(shared.dtype).store(bytes)?.into_owned(),
                None => Vec::new(),
            };
            Ok(SharedArray { bytes, ..shared.clone() })
        };
        described.iter().map(filled).collect()
    }
}

/// Description of an array that all scenes share, in the type in which it is written.
fn description(array: &Array, output: &Output) -> SharedArray {
    let extents = array.shape.iter().map(|&extent| extent as u64);
    let axes = axes(array).into_iter().zip(extents).collect();
    let dtype = field(array).stored_as(output.stored(array.quantity)).stored;
    SharedArray { name: array.name.clone(), axes, dtype, bytes: Vec::new() }
}

/// The names of the dimensions of an entry of an array.
fn axes(array: &Array) -> Vec<String> {
    let inner = array.quantity.axis();
    let lights = array.under.iter().map(|lights| format!("{lights}_number"));
    // Not the name of the group alone: xarray takes a dimension of an array's name for its coordinates.
    let outer = (array.shape.len() > usize::from(inner.is_some())).then(|| format!("{}_number", array.group));
    lights.chain(outer).chain(inner.map(str::to_owned)).collect()
}

fn field(array: &Array) -> Field {
    let inner = array.quantity.axis();
    let field = match inner {
        Some(axis) => {
            let width = array.shape.last().copied().unwrap_or(1);
            Field::vector(&array.name, axis, width, array.dtype()).with_channels(&array.channels)
        }
        None => Field::scalar(&array.name, array.dtype()),
    };
    let field = match array.range {
        Some(range) => field.within(range),
        None => field,
    };
    // From the innermost axis of elements outwards.
    let axes = axes(array);
    let rows = axes.iter().zip(&array.shape).take(array.shape.len() - usize::from(inner.is_some()));
    rows.rev().fold(field, |field, (axis, extent)| field.repeated(axis, *extent))
}
