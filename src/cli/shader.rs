//! `spectroll shader`: the draw as WGSL functions, for other people's shaders.

use std::io::Write;
use std::path::PathBuf;

use clap::ValueEnum;
use spectroll::output::write_file;
use spectroll::{Arithmetic, ModuleOptions, TableStorage};

use super::exit::Usage;
use super::if_exists;
use super::options::{ModelArguments, RecipeArguments};

/// Print WGSL functions that draw spectra, for a shader of your own
///
/// The text has no entry points, no bindings but that of a large table, needs no optional feature, and starts every name
/// with PREFIX_: PREFIX_draw(seed: vec2<u32>, index: vec2<u32>), each a number's low and high word, makes the draw that
/// `spectroll sample` makes, and PREFIX_draw_in(stream, seed, index) that of a stream of this number. PREFIX_at(draw,
/// band), PREFIX_reflectance(draw, nm) or PREFIX_power(draw, nm), PREFIX_spectrum, PREFIX_weights, PREFIX_xyz,
/// PREFIX_linear_srgb, PREFIX_chromaticity, PREFIX_lrv and PREFIX_intensity, as far as --quantities asks for them, tell
/// what came of it; PREFIX_BANDS, PREFIX_FIRST_NM and PREFIX_STEP_NM are the grid.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    model: ModelArguments,
    #[command(flatten)]
    request: RecipeArguments,
    /// The arithmetic of the functions; in the exact one those that draw take one argument more, a zero that must be known
    /// at run time alone, as from a uniform
    #[arg(long, value_enum, default_value = "plain")]
    arithmetic: Arithmetic,
    /// The place of the numbers that intensities of the data, covers and models of more than 2,048 coefficients are read
    /// from: the text, or a storage buffer, which --table-bytes is for [default: in the text up to 2,047 words]
    #[arg(long, value_enum)]
    tables: Option<TablePlace>,
    /// The group and the binding of that buffer
    #[arg(long, value_name = "GROUP,BINDING", default_value = "0,0", value_parser = place, allow_hyphen_values = true)]
    binding: (u32, u32),
    /// Write the content of that buffer to this file: words of 32 bits, the lowest byte first
    #[arg(long, value_name = "FILE")]
    table_bytes: Option<PathBuf>,
    /// Begin every name with this
    #[arg(long, default_value = "spectroll")]
    prefix: String,
    /// Start with the line that naga_oil imports the module by, as spectroll::PREFIX
    #[arg(long)]
    naga_oil: bool,
    /// Write the text to this file [default: standard output]
    #[arg(short, long, value_name = "FILE.wgsl")]
    output: Option<PathBuf>,
    /// Replace the files if they exist
    #[arg(long)]
    force: bool,
}

/// Places that a table can be in.
#[derive(Clone, Copy, ValueEnum)]
enum TablePlace {
    /// A constant in the text
    Const,
    /// A storage buffer
    Buffer,
}

/// The numbers of a bind group and of a binding in it.
fn place(text: &str) -> Result<(u32, u32), String> {
    let numbers = text
        .split_once(',')
        .and_then(|(group, binding)| Some((group.trim().parse().ok()?, binding.trim().parse().ok()?)));
    numbers.ok_or_else(|| "expected two whole numbers, as in 1,0".to_owned())
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let model = arguments.model.load()?;
    let recipe = arguments.request.recipe(&model)?;
    if arguments.force && arguments.output.is_none() && arguments.table_bytes.is_none() {
        return Err(Usage("--force needs --output or --table-bytes".to_owned()).into());
    }
    let (group, binding) = arguments.binding;
    let tables = recipe.tables();
    // Without the option, the place is that of the library: only what is asked for may be refused.
    let buffer = TableStorage::Buffer { group, binding };
    let place = match arguments.tables {
        Some(TablePlace::Const) => Some(TableStorage::Const),
        Some(TablePlace::Buffer) => Some(buffer),
        None if !recipe.keeps_tables_constant() => Some(buffer),
        None => None,
    };
    let options = ModuleOptions { arithmetic: arguments.arithmetic, tables: place };
    let text = recipe.wgsl_with(&arguments.prefix, options)?;
    if let Some(path) = &arguments.table_bytes {
        if tables.is_empty() {
            return Err(Usage("this recipe reads no table: leave out --table-bytes".to_owned()).into());
        }
        write_file(path, if_exists(arguments.force), &tables)?;
    }
    let import = match arguments.naga_oil {
        true => format!("#define_import_path spectroll::{}\n\n", arguments.prefix),
        false => String::new(),
    };
    let (name, kind, version) = (&arguments.model.name, model.kind(), env!("CARGO_PKG_VERSION"));
    let text = format!("{import}// {name} ({kind}): spectroll {version}\n{text}");
    match &arguments.output {
        Some(path) => write_file(path, if_exists(arguments.force), text.as_bytes())?,
        None => std::io::stdout().lock().write_all(text.as_bytes())?,
    }
    Ok(())
}
