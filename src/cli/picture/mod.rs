//! Pictures as files, for the commands that make some.

pub(super) mod model;
pub(super) mod scene;

use std::path::Path;

use anyhow::anyhow;
use kuva::render::render::Scene;
use spectroll::evaluation::plot::PictureFormat;
use spectroll::output::{IfExists, write_file};

use super::exit::Usage;

/// The format that the extension of `path` names.
pub(super) fn format(path: &Path) -> Result<PictureFormat, Usage> {
    let unknown = || Usage(format!("{path:?}: a picture is an .svg or a .png file; name it so"));
    PictureFormat::of(path).ok_or_else(unknown)
}

/// Writes a picture, which appears only when it is complete.
pub(super) fn write(
    drawing: &Scene,
    path: &Path,
    format: PictureFormat,
    existing: IfExists,
) -> anyhow::Result<()> {
    let bytes = format.bytes(drawing).map_err(|e| anyhow!("cannot draw {path:?}: {e}"))?;
    Ok(write_file(path, existing, &bytes)?)
}
