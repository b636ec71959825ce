//! Sources of a set, from which it can be drawn again.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use anyhow::Context;
use serde::de::DeserializeOwned;
use serde_json::Value;
use spectroll::export::provenance::model_sum;
use spectroll::export::{
    ArraySelection, Companions, Destination, DrawExport, DrawRows, ExportError, Output, Rows, SceneExport,
    SceneRows, model_sums,
};
use spectroll::output::{Schema, SetAudit, SharedArray, Sidecar};
use spectroll::scene::Scene;
use spectroll::{DrawRange, Engine, EngineChoice, EngineError, Grid, Model, Recipe, RecipeSettings, Stream};

use crate::cli::exit::Unverified;
use crate::cli::options::EngineArguments;
use crate::cli::{interrupt, run as runs};

/// Data set to draw again, and what was asked of that.
#[derive(Clone, Copy)]
pub(super) struct Request<'a> {
    /// Folder of the set, or the file.
    pub(super) path: &'a Path,
    pub(super) schema: &'a Schema,
    pub(super) destination: Destination,
    /// Sum that engines share which round as the one that drew it, and the text of the model, where a sidecar has them.
    pub(super) sidecar: Option<&'a Sidecar>,
    /// Folder of the files that the set does not hold.
    pub(super) files: Option<&'a Path>,
    pub(super) engine: &'a EngineArguments,
}

/// Sources of a set.
pub(super) enum Sources {
    Draws { recipe: Box<Recipe>, draws: DrawRange },
    Scenes { scene: Box<Scene>, selection: ArraySelection, first: u64 },
}

impl<'a> Request<'a> {
    fn value(&self, name: &str) -> anyhow::Result<&'a Value> {
        let unusable = || format!("{:?} does not say how it was drawn; pass --redraw 0", self.path);
        self.schema.attributes.get(name).with_context(unusable)
    }

    fn read<T: DeserializeOwned>(&self, name: &str) -> anyhow::Result<T> {
        let wrong =
            |e| format!("{:?} does not say how it was drawn ({name}: {e}); pass --redraw 0", self.path);
        serde_json::from_value(self.value(name)?.clone()).map_err(|e| anyhow::anyhow!(wrong(e)))
    }

    /// Text of the scene file that the set records, if it is one of scenes.
    pub(super) fn scene_text(&self) -> Option<&'a str> {
        self.schema.attributes.get("scene").and_then(Value::as_str)
    }

    /// The model of the draws: that in the set, or where it is damaged the built-in one or file that it was made from.
    pub(super) fn model(&self) -> anyhow::Result<Model> {
        let sum: String = self.read("model_blake3")?;
        let name: String = self.read("model")?;
        let is_model = |model: &Model| model_sum(model) == sum;
        let load = |path: PathBuf| match path.is_file() {
            true => Model::load(&path).ok().filter(is_model),
            false => None,
        };
        let builtin = || {
            let grid = Grid::from_wavelengths(&self.schema.wavelengths).ok()?;
            Model::BUILTIN
                .contains(&name.as_str())
                .then(|| Model::builtin_at(&name, grid).ok())?
                .filter(is_model)
        };
        let found = match self.sidecar.and_then(Sidecar::model) {
            Some(text) => Model::from_json(&name, text).ok().filter(is_model),
            None => load(self.path.join("_model.json")),
        };
        let found = found.or_else(|| self.files.and_then(|folder| load(folder.join(&name)))).or_else(builtin);
        found.ok_or_else(|| {
            let text = format!(
                "{:?}: _model.json is not what was written, and {name:?} is not at hand: name the folder of the model \
                 file with --files",
                self.path
            );
            Unverified(text).into()
        })
    }

    /// Reads the sources of the set; a text says which is missing.
    pub(super) fn sources(&self) -> anyhow::Result<Result<Sources, String>> {
        if self.schema.attributes.contains_key("metamers_of") {
            return Ok(Err(
                "metamers are drawn again by the command that drew them, from their colours".to_owned()
            ));
        }
        let sources = match self.schema.attributes.contains_key("scene") {
            true => self.scenes()?,
            false => Ok(self.draws()?),
        };
        if let Ok(sources) = &sources {
            let of = |schema: &Schema| -> Vec<_> {
                schema.fields.iter().map(|field| (field.name.clone(), field.width, field.dtype)).collect()
            };
            if of(&self.expected(sources)) != of(self.schema) {
                let text = format!("{:?}: the arrays of its manifest are not those of its recipe", self.path);
                return Err(Unverified(text).into());
            }
        }
        Ok(sources)
    }

    /// Schema of a set of these sources.
    fn expected(&self, sources: &Sources) -> Schema {
        let output = Output::at(self.path, self.destination);
        match sources {
            Sources::Draws { recipe, draws } => DrawExport::new(recipe, *draws).schema(&output),
            Sources::Scenes { scene, selection, first } => {
                let scenes = *first..first.saturating_add(self.schema.count);
                SceneExport::new(scene, scenes).selection(selection.clone()).schema(&output)
            }
        }
    }

    fn draws(&self) -> anyhow::Result<Sources> {
        let model = self.model()?;
        let recipe = Box::new(self.read::<RecipeSettings>("recipe")?.builder(&model).build()?);
        let (seed, count) = (self.read("seed")?, self.schema.count);
        let stream = match self.read::<Option<String>>("stream")? {
            Some(name) => Stream::named(seed, &name),
            None => Stream::new(seed),
        };
        Ok(Sources::Draws { recipe, draws: DrawRange { stream, first: self.read("start")?, count } })
    }

    /// A set has the text of its scene file, but not the files that this names.
    fn scenes(&self) -> anyhow::Result<Result<Sources, String>> {
        let (name, text): (String, String) = (self.read("scene_file")?, self.read("scene")?);
        let models: BTreeMap<String, String> = self.read("models_blake3")?;
        let beside = self.path.parent().unwrap_or(Path::new(""));
        let folder = self.files.unwrap_or(beside);
        let remedy = "name the folder of the scene file with --files";
        let selection: ArraySelection = self.read("selection")?;
        let scene = match Scene::parse_seeded(&name, &text, folder, self.read("seed")?) {
            Ok(scene) => selection.apply(scene)?,
            Err(error) => return Ok(Err(format!("{error}; {remedy}"))),
        };
        if let Some((group, _)) =
            model_sums(&scene).iter().find(|(group, sum)| models.get(*group) != Some(sum))
        {
            let what = format!("the model or the mean of {group:?} in {folder:?} is not that of the set");
            return Ok(Err(format!("{what}; {remedy}")));
        }
        Ok(Ok(Sources::Scenes { scene: Box::new(scene), selection, first: self.read("start")? }))
    }
}

impl Sources {
    /// Files beside the rows.
    pub(super) fn companions(&self) -> Companions {
        match self {
            Sources::Draws { recipe, draws } => DrawExport::new(recipe, *draws).companions(),
            Sources::Scenes { scene, selection, first } => {
                SceneExport::new(scene, *first..*first).selection(selection.clone()).companions()
            }
        }
    }

    /// Prepares to draw the set again.
    pub(super) fn rows<'a>(
        &'a self,
        engine: &'a Engine,
        schema: &Schema,
    ) -> Result<Box<dyn Rows + 'a>, EngineError> {
        Ok(match self {
            Sources::Draws { recipe, draws } => Box::new(DrawRows::new(recipe, engine, *draws)?),
            Sources::Scenes { scene, first, .. } => Box::new(SceneRows::new(scene, engine, schema, *first)?),
        })
    }

    /// An engine that rounds as the one that drew the set: the one asked for, or the first that does. Sets name their
    /// rounding where it was not the CPU's; those of earlier versions always do.
    pub(super) fn engine(&self, request: Request) -> anyhow::Result<Engine> {
        let rounding: Option<String> = match request.sidecar {
            Some(sidecar) => sidecar.rounding().map(str::to_owned),
            None if request.schema.attributes.contains_key("rounding") => Some(request.read("rounding")?),
            None => None,
        };
        let choice = request.engine.choice();
        for choice in choice.map_or(vec![EngineChoice::Auto, EngineChoice::Cpu], |choice| vec![choice]) {
            let engine = request.engine.open_as(&choice)?;
            let mut rows = self.rows(&engine, request.schema)?;
            let is_alike = match &rounding {
                Some(rounding) => rows.rounding()? == *rounding,
                None => engine.is_exact(),
            };
            drop(rows);
            if is_alike {
                return Ok(engine);
            }
        }
        anyhow::bail!(
            "{:?} was drawn by an adapter that rounds otherwise than what draws here: choose one with --adapter, or \
             another --arithmetic, or pass --redraw 0",
            request.path
        )
    }

    /// The arrays that all rows share, drawn again.
    pub(super) fn shared(&self, engine: &Engine, schema: &Schema) -> anyhow::Result<Vec<SharedArray>> {
        Ok(self.rows(engine, schema)?.shared(&schema.shared)?)
    }
}

/// Draws a chunk again.
pub(super) fn chunk(rows: &mut dyn Rows, audit: &SetAudit, chunk: u64) -> anyhow::Result<Vec<Vec<u8>>> {
    let mut columns = vec![Vec::new(); audit.plan().schema.fields.len()];
    rows.draw(audit.plan().draws(chunk), &mut |window, _| {
        if interrupt::flow().is_break() {
            return Err(ExportError::Interrupted);
        }
        columns.iter_mut().zip(window).for_each(|(column, bytes)| column.extend_from_slice(bytes));
        Ok(())
    })
    .map_err(runs::failed)?;
    Ok(columns)
}
