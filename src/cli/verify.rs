//! `spectroll verify` and `spectroll merge`: checks and completion of sets that were written before.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use rand::Rng;
use serde::de::DeserializeOwned;
use serde_json::Value;
use spectroll::export::provenance::model_sum;
use spectroll::export::{ArraySelection, DrawRows, ExportError, Rows, SceneRows, model_sums};
use spectroll::output::{Schema, SetAudit, merge};
use spectroll::scene::Scene;
use spectroll::{DrawRange, Engine, EngineChoice, EngineError, Model, Recipe, RecipeSettings, Stream};

use super::exit::Unverified;
use super::options::EngineArguments;
use super::parse::grouped;
use super::{interrupt, run as runs};

/// Check a .zarr or a folder of parts against its manifest, and draw some of it again
#[derive(clap::Args)]
pub(crate) struct VerifyArguments {
    /// The set; an unfinished one is NAME.partial
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The share of the chunks that is drawn again and compared, 0 to 1
    #[arg(long, default_value_t = 0.01, value_name = "SHARE", value_parser = share,
          allow_negative_numbers = true)]
    redraw: f64,
    /// Folder of the files that a scene names [default: the folder that holds the set]
    #[arg(long, value_name = "FOLDER")]
    files: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Print nothing unless something is wrong
    #[arg(short, long)]
    quiet: bool,
}

/// Complete a set whose parts were made by several processes
///
/// The last of them does this itself; this is for when it could not.
#[derive(clap::Args)]
pub(crate) struct MergeArguments {
    /// The set, with or without .partial
    #[arg(value_name = "PATH")]
    path: PathBuf,
}

pub(crate) fn join(arguments: &MergeArguments) -> anyhow::Result<()> {
    Ok(merge(&arguments.path)?)
}

pub(crate) fn run(arguments: &VerifyArguments) -> anyhow::Result<()> {
    interrupt::watch();
    let audit = SetAudit::open(&arguments.path)?;
    let chunks = audit.chunks();
    let mut faults = Vec::new();
    for &chunk in &chunks {
        interrupt::check()?;
        faults.extend(audit.fault(chunk));
    }
    let again = chosen(&chunks, arguments.redraw);
    let mut left = None;
    if !again.is_empty() && faults.is_empty() {
        match Made::from(arguments, &audit)? {
            Ok(made) => faults = made.differences(arguments, &audit, &again)?,
            Err(reason) => left = Some(reason),
        }
    }
    if !faults.is_empty() {
        let [first, rest @ ..] = faults.as_slice() else { unreachable!("it is not empty") };
        let more = if rest.is_empty() { String::new() } else { format!(" (and {} more)", rest.len()) };
        return Err(Unverified(format!("{:?}: {first}{more}", arguments.path)).into());
    }
    if !arguments.quiet {
        let (done, all) = (grouped(chunks.len() as u64), grouped(audit.plan().chunks()));
        tell!("{}: {done} of {all} chunks are as they were written", arguments.path.display());
        match left {
            Some(reason) => tell!("  none of them drawn again: {reason}"),
            None => tell!("  {} of them drawn again, with the same bytes", grouped(again.len() as u64)),
        }
    }
    Ok(())
}

/// Chooses this share of the chunks, at random, and at least one unless none is wanted.
fn chosen(chunks: &[u64], share: f64) -> BTreeSet<u64> {
    let wanted = ((chunks.len() as f64 * share).ceil() as usize).min(chunks.len());
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as u64);
    let mut random = Stream::named(now, "verify").rng();
    let mut left = chunks.to_vec();
    (0..wanted).map(|_| left.swap_remove((random.next_u64() % left.len() as u64) as usize)).collect()
}

fn share(text: &str) -> Result<f64, String> {
    let share = text.parse().ok().filter(|share| (0.0..=1.0).contains(share));
    share.ok_or_else(|| "expected a share from 0 to 1".to_owned())
}

/// Sources of a set.
enum Made {
    Draws { recipe: Box<Recipe>, draws: DrawRange },
    Scenes { scene: Box<Scene>, first: u64 },
}

/// Attributes that a set records.
struct Attributes<'a> {
    path: &'a Path,
    schema: &'a Schema,
}

impl Attributes<'_> {
    fn value(&self, name: &str) -> anyhow::Result<&Value> {
        let unusable = || format!("{:?} does not say how it was drawn; pass --redraw 0", self.path);
        self.schema.attributes.get(name).with_context(unusable)
    }

    fn read<T: DeserializeOwned>(&self, name: &str) -> anyhow::Result<T> {
        let wrong =
            |e| format!("{:?} does not say how it was drawn ({name}: {e}); pass --redraw 0", self.path);
        serde_json::from_value(self.value(name)?.clone()).map_err(|e| anyhow::anyhow!(wrong(e)))
    }
}

impl Made {
    /// Reads the sources of the set; an error says which is missing.
    fn from(arguments: &VerifyArguments, audit: &SetAudit) -> anyhow::Result<Result<Made, String>> {
        let schema = &audit.plan().schema;
        let attributes = Attributes { path: &arguments.path, schema };
        match schema.attributes.contains_key("scene") {
            true => Made::scenes(arguments, &attributes),
            false => Made::draws(&attributes).map(Ok),
        }
    }

    fn draws(attributes: &Attributes) -> anyhow::Result<Made> {
        let sum: String = attributes.read("model_blake3")?;
        let model = Model::load(&attributes.path.join("_model.json"))?;
        if model_sum(&model) != sum {
            let text = format!("{:?}: _model.json is not what was written", attributes.path);
            return Err(Unverified(text).into());
        }
        let recipe = Box::new(attributes.read::<RecipeSettings>("recipe")?.builder(&model).build()?);
        let (seed, count) = (attributes.read("seed")?, attributes.schema.count);
        let stream = match attributes.read::<Option<String>>("stream")? {
            Some(name) => Stream::named(seed, &name),
            None => Stream::new(seed),
        };
        Ok(Made::Draws { recipe, draws: DrawRange { stream, first: attributes.read("start")?, count } })
    }

    /// A set has the text of its scene file, but not the files that this names.
    fn scenes(arguments: &VerifyArguments, attributes: &Attributes) -> anyhow::Result<Result<Made, String>> {
        let (name, text): (String, String) = (attributes.read("scene_file")?, attributes.read("scene")?);
        let models: BTreeMap<String, String> = attributes.read("models_blake3")?;
        let beside = arguments.path.parent().unwrap_or(Path::new(""));
        let folder = arguments.files.as_deref().unwrap_or(beside);
        let remedy = "name the folder of the scene file with --files";
        let scene = match Scene::parse_seeded(&name, &text, folder, attributes.read("seed")?) {
            Ok(scene) => attributes.read::<ArraySelection>("selection")?.apply(scene)?,
            Err(error) => return Ok(Err(format!("{error}; {remedy}"))),
        };
        if let Some((group, _)) =
            model_sums(&scene).iter().find(|(group, sum)| models.get(*group) != Some(sum))
        {
            let what = format!("the model or the mean of {group:?} in {folder:?} is not that of the set");
            return Ok(Err(format!("{what}; {remedy}")));
        }
        Ok(Ok(Made::Scenes { scene: Box::new(scene), first: attributes.read("start")? }))
    }

    /// Prepares to draw the set again.
    fn source<'a>(&'a self, engine: &'a Engine, schema: &Schema) -> Result<Box<dyn Rows + 'a>, EngineError> {
        Ok(match self {
            Made::Draws { recipe, draws } => Box::new(DrawRows::new(recipe, engine, *draws)?),
            Made::Scenes { scene, first } => Box::new(SceneRows::new(scene, engine, schema, *first)?),
        })
    }

    /// An engine that rounds as the one that drew the set: the one asked for, or the first that does.
    fn engine(&self, arguments: &VerifyArguments, schema: &Schema) -> anyhow::Result<Engine> {
        let rounding: String = Attributes { path: &arguments.path, schema }.read("rounding")?;
        let choice = arguments.engine.choice();
        for choice in choice.map_or(vec![EngineChoice::Auto, EngineChoice::Cpu], |choice| vec![choice]) {
            let engine = Engine::with_threads(&choice, arguments.engine.threads)?;
            if self.source(&engine, schema)?.rounding()? == rounding {
                return Ok(engine);
            }
        }
        anyhow::bail!(
            "{:?} was drawn by an adapter that rounds otherwise than what draws here: choose one with --adapter, \
             or pass --redraw 0",
            arguments.path
        )
    }

    /// Lists the chunks that differ from what is drawn now, and the arrays that all rows share if they do.
    fn differences(
        &self,
        arguments: &VerifyArguments,
        audit: &SetAudit,
        chunks: &BTreeSet<u64>,
    ) -> anyhow::Result<Vec<String>> {
        let schema = &audit.plan().schema;
        let engine = self.engine(arguments, schema)?;
        let mut differences = Vec::new();
        if let Made::Scenes { scene, first } = self {
            let constants = SceneRows::new(scene, &engine, schema, *first)?.shared(&schema.shared)?;
            differences.extend(audit.shared_difference(constants)?);
        }
        let mut source = self.source(&engine, schema)?;
        for &chunk in chunks {
            let mut columns = vec![Vec::new(); schema.fields.len()];
            source
                .draw(audit.plan().draws(chunk), &mut |window, _| {
                    if interrupt::flow().is_break() {
                        return Err(ExportError::Interrupted);
                    }
                    columns
                        .iter_mut()
                        .zip(window)
                        .for_each(|(column, bytes)| column.extend_from_slice(bytes));
                    Ok(())
                })
                .map_err(runs::failed)?;
            differences.extend(audit.difference(chunk, &columns)?);
        }
        Ok(differences)
    }
}
