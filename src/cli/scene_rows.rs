//! Scenes as a data set: a row a scene, its arrays as columns, and beside them what all scenes share.

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::ops::Range;

use serde::{Deserialize, Serialize};
use serde_json::Map;
use spectroll::export::provenance::{Sum, model_sum};
use spectroll::output::{ChunkFormat, Field, FileFormat, Schema, SharedArray};
use spectroll::scene::{Array, GroupKind, GroupSummary, Scene, SceneSession};
use spectroll::{Dtype, Engine, EngineError};

use super::Usage;
use super::run::{Source, Window};
use super::sink::Destination;

/// About how many spectra tell how an engine rounds, and in how many scenes at most.
const ROUNDED: (u64, u64) = (4096, 64);

/// Which arrays of a scene file are wanted.
#[derive(Clone, Debug, Default, clap::Args, Serialize, Deserialize)]
pub(super) struct Selection {
    /// Draw this group alone
    #[arg(long, value_name = "GROUP")]
    only: Option<String>,
    /// Write these arrays alone, by the names that --dry-run lists
    #[arg(long, value_name = "NAME,...", value_delimiter = ',')]
    #[serde(default)]
    arrays: Vec<String>,
}

impl Selection {
    /// The scene with the groups alone that this needs.
    pub(super) fn of(&self, mut scene: Scene) -> Result<Scene, Usage> {
        if let Some(only) = &self.only {
            let known: Vec<_> = scene.groups().map(str::to_owned).collect();
            scene = scene.only(only).ok_or_else(|| unknown("group", only, &known))?;
        }
        let known: Vec<_> = scene.arrays().map(|array| array.name.clone()).collect();
        if let Some(name) = self.arrays.iter().find(|name| !known.contains(name)) {
            return Err(unknown("array", name, &known));
        }
        let groups = scene.workload(1).groups;
        let wanted = |name: &str| {
            let group = groups.iter().find(|group| group.name == name);
            group.is_some_and(|group| group.arrays.iter().any(|array| self.has(array)))
        };
        Ok(scene.keep(wanted).expect("every array is of a group"))
    }

    /// Whether an array of the scene is wanted.
    pub(super) fn has(&self, array: &Array) -> bool {
        self.arrays.is_empty() || self.arrays.contains(&array.name)
    }
}

/// The error of a name that nothing has, with the nearest of those that there are.
fn unknown(what: &str, name: &str, known: &[String]) -> Usage {
    let distance = |other: &&String| strsim::osa_distance(name, other);
    let near = known.iter().min_by_key(distance).filter(|near| distance(near) <= 1 + near.len() / 4);
    let meant = near.map_or(String::new(), |near| format!(", did you mean {near:?}?"));
    Usage(format!("there is no {what} {name:?}{meant}; there are {}", known.join(", ")))
}

/// The sum of each group's model, where it has one.
pub(super) fn models(scene: &Scene) -> BTreeMap<String, String> {
    scene.models().map(|(group, model)| (group.to_owned(), model_sum(model))).collect()
}

/// Whether what all scenes share is kept once, rather than in every row, for want of any other place.
pub(super) fn shares(target: Destination) -> bool {
    !matches!(
        target,
        Destination::Stdout
            | Destination::Spd
            | Destination::File(FileFormat::Csv | FileFormat::Parquet | FileFormat::Npy)
            | Destination::Set(ChunkFormat::Parquet)
    )
}

/// What `count` scenes are as a data set, without the values of the constants and what all was made from.
pub(super) fn schema(
    scene: &Scene,
    selection: &Selection,
    (target, stored): (Destination, Dtype),
    count: u64,
) -> Schema {
    let wanted = || scene.arrays().filter(|array| selection.has(array));
    let varying = wanted().filter(|array| array.per_scene);
    let (shared, repeated): (Vec<_>, Vec<_>) =
        wanted().filter(|array| !array.per_scene).partition(|_| shares(target));
    Schema {
        fields: varying.chain(repeated).map(|array| field(array).stored_as(stored)).collect(),
        row: "scene".to_owned(),
        constants: shared.into_iter().map(constant).collect(),
        count,
        wavelengths: scene.grid().wavelengths().collect(),
        attributes: Map::new(),
    }
}

/// What the spectra of a scene's first wanted group are, for the names of their files.
pub(super) fn role(scene: &Scene) -> GroupKind {
    scene.workload(1).groups[0].role
}

/// Scenes that are drawn as rows of a data set.
pub(super) struct Rows<'a> {
    scene: &'a Scene,
    session: SceneSession<'a>,
    /// The first scene of the data set.
    first: u64,
    /// The names of the columns.
    columns: Vec<String>,
    /// The columns among them that are the same in every row, each with an entry of it.
    repeated: Vec<(String, Vec<u8>)>,
    /// What those took that were drawn.
    pub(super) drawn: Vec<GroupSummary>,
}

impl<'a> Rows<'a> {
    pub(super) fn new(
        scene: &'a Scene,
        engine: &'a Engine,
        schema: &Schema,
        first: u64,
    ) -> Result<Rows<'a>, EngineError> {
        let session = scene.session(engine)?;
        let columns: Vec<String> = schema.fields.iter().map(|field| field.name.clone()).collect();
        let constants = session.constants().into_iter();
        let repeated = constants
            .filter(|(array, _)| columns.contains(&array.name))
            .map(|(array, bytes)| (array.name.clone(), bytes))
            .collect();
        let drawn = session.taken_once();
        Ok(Rows { scene, session, first, columns, repeated, drawn })
    }

    /// The constants of a schema, with their values.
    pub(super) fn constants(&self, schema: &Schema) -> Vec<SharedArray> {
        let drawn = self.session.constants();
        let bytes = |name: &str| drawn.iter().find(|(array, _)| array.name == name);
        let filled = |constant: &SharedArray| {
            let bytes = bytes(&constant.name).map_or_else(Vec::new, |(_, bytes)| bytes.clone());
            SharedArray { bytes, ..constant.clone() }
        };
        schema.constants.iter().map(filled).collect()
    }
}

impl Source for Rows<'_> {
    fn rounding(&mut self) -> Result<String, EngineError> {
        let workload = self.scene.workload(1);
        let each: u64 = workload.groups.iter().map(|group| group.draws_per_scene).sum();
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

    fn draw(&mut self, rows: Range<u64>, window: &mut Window) -> anyhow::Result<()> {
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
}

/// The type of an array's values.
pub(super) fn element(array: &Array) -> Dtype {
    match array.quantity {
        Quantity::Attempts => Dtype::U32,
        _ => Dtype::F32,
    }
}

fn constant(array: &Array) -> SharedArray {
    let extents = array.shape.iter().map(|&extent| extent as u64);
    let axes = axes(array).into_iter().zip(extents).collect();
    SharedArray { name: array.name.clone(), axes, element: element(array), bytes: Vec::new() }
}

/// The names of the dimensions of an entry of an array.
fn axes(array: &Array) -> Vec<String> {
    // Not that of the group alone: xarray takes a dimension of an array's name for its coordinates.
    let group = array.name.strip_suffix(array.quantity.suffix()).unwrap_or(&array.name);
    let mut axes = Vec::new();
    let inner = array.quantity.axis();
    if array.shape.len() > usize::from(inner.is_some()) {
        axes.push(format!("{group}_number"));
    }
    axes.extend(inner.map(str::to_owned));
    axes
}

fn field(array: &Array) -> Field {
    let inner = array.quantity.axis();
    let last = array.shape.last().copied().unwrap_or(1);
    let field = match inner {
        Some(axis) => Field::vector(&array.name, axis, last, element(array)),
        None => Field::scalar(&array.name, element(array)),
    };
    let field = match array.interval {
        Some(interval) => field.within(interval),
        None => field,
    };
    match axes(array).first() {
        Some(outer) if array.shape.len() > usize::from(inner.is_some()) => {
            field.repeated(outer, array.shape[0])
        }
        _ => field,
    }
}
