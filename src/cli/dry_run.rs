//! `spectroll sample --dry-run`: what would be made, and whether it can be.

use std::io::Write;
use std::path::Path;
use std::time::{Duration, Instant};

use spectroll::output::Schema;
use spectroll::{Engine, Recipe, Stream};

use super::grouped;
use super::sink::{OutputArguments, Target};

/// How long the drawing is tried.
const TRIAL: Duration = Duration::from_millis(300);

pub(super) fn report(
    output: &OutputArguments,
    target: Target,
    schema: &Schema,
    recipe: &Recipe,
    engine: &Engine,
) -> anyhow::Result<()> {
    let mut out = std::io::stdout();
    writeln!(out, "{}: {} draws", output.output.display(), grouped(schema.count))?;
    for field in &schema.fields {
        writeln!(out, "  {}: {:?} {}", field.name, field.shape(schema.count), field.stored.name())?;
    }
    let bytes = schema.count * schema.row_bytes();
    match target {
        Target::Set(layout) => {
            let plan = output.plan(layout, schema);
            let chunks = grouped(plan.chunks());
            writeln!(out, "  {} in {chunks} chunks of {} draws", size(bytes), grouped(plan.chunk))?;
        }
        Target::Spd => writeln!(out, "  {} files of text", grouped(schema.count))?,
        Target::Stdout | Target::File(_) => writeln!(out, "  {}", size(bytes))?,
    }
    writeln!(
        out,
        "  drawn by {engine}, about {:.2} % of the candidates accepted",
        100.0 * recipe.acceptance()
    )?;
    let rate = rate(recipe, engine)?;
    let seconds = schema.count as f64 / rate;
    writeln!(out, "  {seconds:.1} s to draw at {:.1} million a second", rate / 1e6)?;
    if target != Target::Stdout {
        writeln!(out, "  {}", room(&output.output, bytes)?)?;
    }
    Ok(())
}

/// Draws a second, of a short trial.
fn rate(recipe: &Recipe, engine: &Engine) -> anyhow::Result<f64> {
    let mut drawer = engine.drawer(recipe)?;
    let mut count = 1000;
    loop {
        let start = Instant::now();
        drawer.draw(Stream::named(0, "trial").draws(0..count), |_| anyhow::Ok(()))?;
        let taken = start.elapsed();
        if taken > TRIAL {
            return Ok(count as f64 / taken.as_secs_f64());
        }
        count *= 4;
    }
}

/// Whether the disk has room.
pub(super) fn room(path: &Path, bytes: u64) -> anyhow::Result<String> {
    let folder = path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."));
    if !folder.is_dir() {
        return Ok(format!("{folder:?} does not exist: create it first"));
    }
    let free = fs4::available_space(folder)?;
    let enough = if free > bytes { "enough" } else { "not enough" };
    Ok(format!("{} are free in {folder:?}, which is {enough}", size(free)))
}

/// Bytes in the unit that suits them.
pub(super) fn size(bytes: u64) -> String {
    let units = ["bytes", "kB", "MB", "GB", "TB", "PB", "EB"];
    let power = (bytes.max(1).ilog10() / 3) as usize;
    match power {
        0 => format!("{bytes} bytes"),
        _ => format!("{:.1} {}", bytes as f64 / 1000f64.powi(power as i32), units[power]),
    }
}
