//! `spectroll verify` and `spectroll merge`: sets that were written before.

use std::collections::BTreeSet;
use std::path::PathBuf;
use std::time::{SystemTime, UNIX_EPOCH};

use anyhow::Context;
use rand::Rng;
use serde_json::Value;
use spectroll::output::{Audit, merge};
use spectroll::provenance::model_sum;
use spectroll::{Choice, Draws, Element, Engine, Model, Recipe, Stream};

use super::request::{self, Request};
use super::{EngineArguments, Unverified, check_interrupt, grouped, watch_interrupts};

/// Check a .zarr or a folder of parts against its manifest, and draw some of it again
#[derive(clap::Args)]
pub(crate) struct VerifyArguments {
    /// The set; an unfinished one is NAME.partial
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The share of the chunks that is drawn again and compared, 0 to 1
    #[arg(long, default_value_t = 0.01, value_name = "SHARE", value_parser = share)]
    redraw: f64,
    #[command(flatten)]
    engine: EngineArguments,
    /// Print nothing where all is well
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
    watch_interrupts();
    let audit = Audit::open(&arguments.path)?;
    let chunks = audit.chunks();
    let mut faults = Vec::new();
    for &chunk in &chunks {
        check_interrupt()?;
        faults.extend(audit.fault(chunk));
    }
    let again = chosen(&chunks, arguments.redraw);
    if !again.is_empty() && faults.is_empty() {
        let drawn = Redrawing::new(arguments, &audit)?;
        let engine = drawn.engine()?;
        for &chunk in &again {
            faults.extend(drawn.difference(&engine, &audit, chunk)?);
        }
    }
    if !faults.is_empty() {
        let [first, rest @ ..] = faults.as_slice() else { unreachable!("it is not empty") };
        let more = if rest.is_empty() { String::new() } else { format!(" (and {} more)", rest.len()) };
        return Err(Unverified(format!("{:?}: {first}{more}", arguments.path)).into());
    }
    if !arguments.quiet {
        let (done, all) = (grouped(chunks.len() as u64), grouped(audit.plan().chunks()));
        let again = grouped(again.len() as u64);
        eprintln!("{}: {done} of {all} chunks are as they were written", arguments.path.display());
        eprintln!("  {again} of them drawn again, with the same bytes");
    }
    Ok(())
}

/// So many of the chunks, at random, and at least one unless none is wanted.
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

/// What it takes to draw a set again.
struct Redrawing {
    recipe: Recipe,
    stream: Stream,
    first: u64,
    rounding: String,
    choice: Option<Choice>,
    threads: Option<std::num::NonZeroUsize>,
    path: PathBuf,
}

impl Redrawing {
    fn new(arguments: &VerifyArguments, audit: &Audit) -> anyhow::Result<Redrawing> {
        let attributes = &audit.plan().schema.attributes;
        let unusable = || format!("{:?} does not say how it was drawn; pass --redraw 0", arguments.path);
        let text = |name: &str| attributes.get(name).and_then(Value::as_str).with_context(unusable);
        let number = |name: &str| attributes.get(name).and_then(Value::as_u64).with_context(unusable);
        let sum = text("model_blake3")?;
        let model = Model::load(&arguments.path.join("model.json"))?;
        if model_sum(&model) != sum {
            return Err(
                Unverified(format!("{:?}: model.json is not what was written", arguments.path)).into()
            );
        }
        let request = attributes.get("recipe").cloned().with_context(unusable)?;
        let request: Request = serde_json::from_value(request)?;
        let seed = number("seed")?;
        Ok(Redrawing {
            recipe: request.recipe(&model)?,
            stream: text("stream").map_or(Stream::new(seed), |name| Stream::named(seed, name)),
            first: number("start")?,
            rounding: text("rounding")?.to_owned(),
            choice: arguments.engine.choice(),
            threads: arguments.engine.threads,
            path: arguments.path.clone(),
        })
    }

    /// An engine that rounds as the one that drew the set: the one asked for, or the first that does.
    fn engine(&self) -> anyhow::Result<Engine> {
        let choices = self.choice.clone().map_or(vec![Choice::Auto, Choice::Cpu], |choice| vec![choice]);
        for choice in choices {
            let engine = Engine::with_threads(&choice, self.threads)?;
            if request::rounding(&self.recipe, &mut engine.drawer(&self.recipe)?)? == self.rounding {
                return Ok(engine);
            }
        }
        anyhow::bail!(
            "{:?} was drawn by an adapter that rounds otherwise than what draws here: choose one with --adapter, \
             or pass --redraw 0",
            self.path
        )
    }

    fn difference(&self, engine: &Engine, audit: &Audit, chunk: u64) -> anyhow::Result<Option<String>> {
        let draws = audit.plan().draws(chunk);
        let schema = request::schema(&self.recipe, audit.plan().schema.count, Element::F32);
        let mut columns = vec![Vec::new(); schema.fields.len()];
        let draws = Draws {
            stream: self.stream,
            first: self.first.wrapping_add(draws.start),
            count: draws.end - draws.start,
        };
        engine.draw(&self.recipe, draws, |batch| {
            check_interrupt()?;
            for (column, bytes) in columns.iter_mut().zip(request::columns(&self.recipe, &batch)) {
                column.extend_from_slice(&bytes);
            }
            anyhow::Ok(())
        })?;
        Ok(audit.difference(chunk, &columns)?)
    }
}
