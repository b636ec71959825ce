//! `spectroll sample --dry-run`: a forecast of what would be made, and whether it can be.

use std::io::Write;
use std::time::{Duration, Instant};

use serde::Serialize;
use spectroll::export::{Companions, Destination, Output, Space};
use spectroll::output::{ByteCount, Field, FileFormat, Schema};
use spectroll::wording::counted;
use spectroll::{Engine, Recipe, Stream};

use super::{part, room};

/// Duration of the trial of drawing.
const TRIAL: Duration = Duration::from_millis(300);

/// Forecast of a run.
#[derive(Serialize)]
pub(in crate::cli) struct DryRun<'a> {
    #[serde(rename = "output")]
    name: String,
    draws: u64,
    arrays: Vec<Array>,
    #[serde(flatten)]
    space: Space,
    /// Number of text files, in a folder.
    files: Option<u64>,
    /// Number of chunks, and of draws in each; `None` for a single file.
    chunks: Option<(u64, u64)>,
    /// The part of them that this run would make, where there are several.
    part: Option<String>,
    /// The share of candidates that are accepted.
    acceptance: f64,
    engine: String,
    /// In a short trial, of the drawing alone.
    draws_per_second: f64,
    /// Number of them that this run would draw.
    #[serde(skip)]
    own_draws: u64,
    #[serde(skip)]
    output: &'a Output,
}

#[derive(Serialize)]
struct Array {
    name: String,
    shape: Vec<u64>,
    dtype: &'static str,
}

impl<'a> DryRun<'a> {
    pub(in crate::cli) fn new(
        output: &'a Output,
        (schema, companions): (&Schema, &Companions),
        recipe: &Recipe,
        engine: &Engine,
    ) -> anyhow::Result<DryRun<'a>> {
        let array = |field: &Field| Array {
            name: field.name.clone(),
            shape: field.shape(schema.count),
            dtype: field.stored.name(),
        };
        let plan = output.plan(schema);
        let own_draws = plan.as_ref().map_or(schema.count, |plan| {
            let chunks = output.part().of(plan.chunks());
            let first = |chunk: u64| chunk.saturating_mul(plan.chunk).min(schema.count);
            first(chunks.end) - first(chunks.start)
        });
        Ok(DryRun {
            name: output.path().display().to_string(),
            draws: schema.count,
            arrays: schema.fields.iter().map(array).collect(),
            space: output.space(schema, companions),
            files: output.text_files(schema, companions),
            chunks: plan.map(|plan| (plan.chunks(), plan.chunk)),
            part: part(output, schema),
            acceptance: recipe.acceptance(),
            engine: engine.to_string(),
            draws_per_second: rate(recipe, engine)?,
            own_draws,
            output,
        })
    }

    pub(in crate::cli) fn print(&self, json: bool) -> anyhow::Result<()> {
        let mut out = std::io::stdout();
        if json {
            return Ok(writeln!(out, "{}", serde_json::to_string_pretty(self)?)?);
        }
        writeln!(out, "{}: {}", self.name, counted(self.draws, "draw", "draws"))?;
        for Array { name, shape, dtype } in &self.arrays {
            writeln!(out, "  {name}: {shape:?} {dtype}")?;
        }
        let bytes = ByteCount(self.space.bytes);
        if let Some(files) = self.files {
            writeln!(out, "  {}, about {bytes} of text", folder_of(files))?;
        }
        match (self.chunks, self.output.destination()) {
            (Some((chunks, draws)), _) => {
                let (chunks, draws) = (counted(chunks, "chunk", "chunks"), counted(draws, "draw", "draws"));
                let packed = if self.space.least < self.space.bytes { " before they are packed" } else { "" };
                match &self.part {
                    Some(part) => {
                        writeln!(out, "  {chunks} of {draws}")?;
                        writeln!(out, "  {part}: {bytes}{packed}")?;
                    }
                    None => writeln!(out, "  {bytes} in {chunks} of {draws}{packed}")?,
                }
            }
            (None, Destination::SpdFolder) => {}
            (None, Destination::Stdout(FileFormat::Csv) | Destination::File(FileFormat::Csv)) => {
                writeln!(out, "  about {bytes} of text")?
            }
            (None, _) => writeln!(out, "  {bytes}")?,
        }
        let (engine, accepted) = (&self.engine, 100.0 * self.acceptance);
        writeln!(out, "  drawn by {engine}, about {accepted:.2} % of the candidates accepted")?;
        let (rate, seconds) = (self.draws_per_second / 1e6, self.own_draws as f64 / self.draws_per_second);
        writeln!(out, "  {seconds:.1} s of drawing at {rate:.1} million a second, besides the writing")?;
        if let Some(room) = room(self.output, self.space) {
            writeln!(out, "  {room}")?;
        }
        Ok(())
    }
}

/// Describes the folder to be made, where its name may look like that of a file.
pub(in crate::cli) fn folder_of(files: u64) -> String {
    format!("a folder of {}", counted(files, "file", "files"))
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
