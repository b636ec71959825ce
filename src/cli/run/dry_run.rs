//! `spectroll sample --dry-run`: a forecast of what would be made, and whether it can be.

use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use serde::Serialize;
use spectroll::export::{Companions, Destination, Output};
use spectroll::output::{Field, FileFormat, Schema};
use spectroll::{Engine, Recipe, Stream};

use crate::cli::folder;
use crate::cli::parse::{grouped, size};

/// Duration of the trial of drawing.
const TRIAL: Duration = Duration::from_millis(300);

/// Bytes of a number as text, with what sets it apart: ours have 8 digits or so.
const TEXT: u64 = 11;

/// Forecast of a run.
#[derive(Serialize)]
pub(in crate::cli) struct DryRun {
    output: String,
    draws: u64,
    arrays: Vec<Array>,
    /// Size in bytes; approximate for text.
    bytes: u64,
    /// Number of text files, in a folder.
    files: Option<u64>,
    /// Number of chunks, and of draws in each; `None` for a single file.
    chunks: Option<(u64, u64)>,
    /// The share of candidates that are accepted.
    acceptance: f64,
    engine: String,
    /// In a short trial, of the drawing alone.
    draws_per_second: f64,
    /// Free bytes where it would be; nothing of standard output, nor where there is no such folder.
    free: Option<u64>,
    #[serde(skip)]
    destination: Destination,
}

#[derive(Serialize)]
struct Array {
    name: String,
    shape: Vec<u64>,
    dtype: &'static str,
}

impl DryRun {
    pub(in crate::cli) fn new(
        output: &Output,
        (schema, companions): (&Schema, &Companions),
        recipe: &Recipe,
        engine: &Engine,
    ) -> anyhow::Result<DryRun> {
        let array = |field: &Field| Array {
            name: field.name.clone(),
            shape: field.shape(schema.count),
            dtype: field.stored.name(),
        };
        let is_text = matches!(
            output.destination(),
            Destination::Stdout(FileFormat::Csv)
                | Destination::SpdFolder
                | Destination::File(FileFormat::Csv)
        );
        let row = match is_text {
            true => schema.fields.iter().map(|field| TEXT * field.width as u64).sum(),
            false => schema.row_bytes(),
        };
        let chunks = output.plan(schema).map(|plan| (plan.chunks(), plan.chunk));
        Ok(DryRun {
            output: output.path().display().to_string(),
            draws: schema.count,
            arrays: schema.fields.iter().map(array).collect(),
            bytes: schema.count.saturating_mul(row),
            files: output.text_files(schema, companions),
            chunks,
            acceptance: recipe.acceptance(),
            engine: engine.to_string(),
            draws_per_second: rate(recipe, engine)?,
            free: if matches!(output.destination(), Destination::Stdout(_)) {
                None
            } else {
                free(output.path())
            },
            destination: output.destination(),
        })
    }

    pub(in crate::cli) fn print(&self, json: bool) -> anyhow::Result<()> {
        let mut out = std::io::stdout();
        if json {
            return Ok(writeln!(out, "{}", serde_json::to_string_pretty(self)?)?);
        }
        writeln!(out, "{}: {} draws", self.output, grouped(self.draws))?;
        for Array { name, shape, dtype } in &self.arrays {
            writeln!(out, "  {name}: {shape:?} {dtype}")?;
        }
        let bytes = size(self.bytes);
        if let Some(files) = self.files {
            writeln!(out, "  {}, about {bytes} of text", folder_of(files))?;
        }
        match (self.chunks, self.destination) {
            (Some((chunks, draws)), _) => {
                writeln!(out, "  {bytes} in {} chunks of {} draws", grouped(chunks), grouped(draws))?;
            }
            (None, Destination::SpdFolder) => {}
            (None, Destination::Stdout(FileFormat::Csv) | Destination::File(FileFormat::Csv)) => {
                writeln!(out, "  about {bytes} of text")?
            }
            (None, _) => writeln!(out, "  {bytes}")?,
        }
        let (engine, accepted) = (&self.engine, 100.0 * self.acceptance);
        writeln!(out, "  drawn by {engine}, about {accepted:.2} % of the candidates accepted")?;
        let (rate, seconds) = (self.draws_per_second / 1e6, self.draws as f64 / self.draws_per_second);
        writeln!(out, "  {seconds:.1} s of drawing at {rate:.1} million a second, besides the writing")?;
        if !matches!(self.destination, Destination::Stdout(_)) {
            writeln!(out, "  {}", room(Path::new(&self.output), self.bytes, self.free))?;
        }
        Ok(())
    }
}

/// Describes the folder to be made, where its name may look like that of a file.
pub(in crate::cli) fn folder_of(files: u64) -> String {
    let plural = if files == 1 { "" } else { "s" };
    format!("a folder of {} file{plural}", grouped(files))
}

/// Draws a second, of a short trial.
fn rate(recipe: &Recipe, engine: &Engine) -> anyhow::Result<f64> {
    let mut session = engine.session(recipe)?;
    let mut count = 1000;
    loop {
        let start = Instant::now();
        session.draw(Stream::named(0, "trial").draws(0..count), |_| anyhow::Ok(()))?;
        let taken = start.elapsed();
        if taken > TRIAL {
            return Ok(count as f64 / taken.as_secs_f64());
        }
        count *= 4;
    }
}

/// Free bytes in the folder of a path, if there is such a folder.
pub(in crate::cli) fn free(path: &Path) -> Option<u64> {
    fs4::available_space(folder(path)).ok()
}

/// Describes whether the disk has room, with `free` bytes of it free.
pub(in crate::cli) fn room(path: &Path, bytes: u64, free: Option<u64>) -> String {
    let folder = folder(path);
    match free {
        Some(free) => {
            let enough = if free > bytes { "enough" } else { "not enough" };
            format!("{} are free in {folder:?}, which is {enough}", size(free))
        }
        None => format!("{folder:?} does not exist: create it first"),
    }
}
