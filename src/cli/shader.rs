//! `spectroll shader`: the draw as WGSL functions, for shaders of others.

use std::io::Write;

use spectroll::Grid;

use super::model_at;
use super::options::RecipeArguments;

/// Print the draw as WGSL functions, for a shader of your own
///
/// The text has no bindings and no entry points, needs no optional feature, and starts every name with PREFIX_:
/// PREFIX_draw(seed: vec2<u32>, index: vec2<u32>) makes the draw that `spectroll sample` makes, and PREFIX_at(draw,
/// band), PREFIX_spectrum, PREFIX_weights, PREFIX_xyz, PREFIX_srgb, PREFIX_lrv and PREFIX_intensity, as far as
/// --quantities asks for them, tell what came of it.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file or the name of a built-in model
    #[arg(value_name = "MODEL")]
    model: String,
    /// Fit a built-in model at these wavelengths first, start:step:stop in nm
    #[arg(long, value_name = "GRID")]
    wavelengths: Option<Grid>,
    #[command(flatten)]
    request: RecipeArguments,
    /// What every name starts with
    #[arg(long, default_value = "spectroll")]
    prefix: String,
    /// Start with the line that naga_oil imports the module by, as spectroll::PREFIX
    #[arg(long)]
    naga_oil: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let model = model_at(&arguments.model, arguments.wavelengths)?;
    let recipe = arguments.request.recipe(&model)?;
    let text = recipe.wgsl(&arguments.prefix)?;
    let mut out = std::io::stdout().lock();
    if arguments.naga_oil {
        writeln!(out, "#define_import_path spectroll::{}\n", arguments.prefix)?;
    }
    writeln!(out, "// {} ({}): spectroll {}", arguments.model, model.kind(), env!("CARGO_PKG_VERSION"))?;
    out.write_all(text.as_bytes())?;
    Ok(())
}
