//! Pictures as files, for the commands that make some.

mod colours;
pub(super) mod comparison;
pub(super) mod look;
pub(super) mod metamers;
pub(super) mod model;
mod panel;
pub(super) mod scene;

use std::path::Path;

use anyhow::anyhow;
use kuva::render::render::Scene;
use spectroll::evaluation::plot::{PictureFormat, Theme};
use spectroll::output::{IfExists, write_file};

use super::exit::Usage;

/// The ground of a picture.
#[derive(clap::Args)]
pub(super) struct Ground {
    /// Draw the picture on a dark ground, for screens and slides
    #[arg(long)]
    dark: bool,
}

impl Ground {
    pub(super) fn theme(&self) -> Theme {
        if self.dark { Theme::Dark } else { Theme::Light }
    }
}

/// The format that the extension of `path` names.
pub(super) fn format(path: &Path) -> Result<PictureFormat, Usage> {
    let unknown = || Usage(format!("{path:?}: a picture is an .svg, a .png or a .pdf file; name it so"));
    PictureFormat::of(path).ok_or_else(unknown)
}

/// Name in a picture of the file or built-in model that it shows: no folders, which mean nothing to readers of a picture.
fn title(name: &str) -> String {
    Path::new(name).file_name().map_or_else(|| name.to_owned(), |name| name.to_string_lossy().into_owned())
}

/// Writes a picture, which appears only when it is complete, and names it on standard error.
pub(super) fn write(
    drawing: &Scene,
    path: &Path,
    format: PictureFormat,
    existing: IfExists,
) -> anyhow::Result<()> {
    let bytes = format.bytes(drawing).map_err(|e| anyhow!("cannot draw {path:?}: {e}"))?;
    write_file(path, existing, &bytes)?;
    tell!("wrote {}", path.display());
    Ok(())
}
