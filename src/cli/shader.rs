//! `spectroll shader`: the draw as WGSL functions, for other people's shaders.

use std::io::Write;
use std::path::PathBuf;

use spectroll::Grid;
use spectroll::output::write_file;

use super::options::RecipeArguments;
use super::wavelengths::grid;
use super::{if_exists, model_at};

/// Print WGSL functions that draw spectra, for a shader of your own
///
/// The text has no bindings and no entry points, needs no optional feature, and starts every name with PREFIX_:
/// PREFIX_draw(seed: vec2<u32>, index: vec2<u32>) makes the draw that `spectroll sample` makes, and PREFIX_at(draw,
/// band), PREFIX_spectrum, PREFIX_weights, PREFIX_xyz, PREFIX_linear_srgb, PREFIX_chromaticity, PREFIX_lrv and PREFIX_intensity, as far as
/// --quantities asks for them, tell what came of it.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file or the name of a built-in model
    #[arg(value_name = "MODEL")]
    model: String,
    /// The wavelengths of a built-in model, in nm, at which it is fitted: a grid, a list as in 443,490,560, or a file of
    /// them [default: those of its name]
    #[arg(long, value_name = "START:STEP:STOP|FILE", value_parser = grid)]
    wavelengths: Option<Grid>,
    #[command(flatten)]
    request: RecipeArguments,
    /// Begin every name with this
    #[arg(long, default_value = "spectroll")]
    prefix: String,
    /// Start with the line that naga_oil imports the module by, as spectroll::PREFIX
    #[arg(long)]
    naga_oil: bool,
    /// Write the text to this file [default: standard output]
    #[arg(short, long, value_name = "FILE.wgsl")]
    output: Option<PathBuf>,
    /// Replace the file if it exists
    #[arg(long, requires = "output")]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let model = model_at(&arguments.model, arguments.wavelengths.as_ref())?;
    let recipe = arguments.request.recipe(&model)?;
    let text = recipe.wgsl(&arguments.prefix)?;
    let import = match arguments.naga_oil {
        true => format!("#define_import_path spectroll::{}\n\n", arguments.prefix),
        false => String::new(),
    };
    let (name, kind, version) = (&arguments.model, model.kind(), env!("CARGO_PKG_VERSION"));
    let text = format!("{import}// {name} ({kind}): spectroll {version}\n{text}");
    match &arguments.output {
        Some(path) => write_file(path, if_exists(arguments.force), text.as_bytes())?,
        None => std::io::stdout().lock().write_all(text.as_bytes())?,
    }
    Ok(())
}
