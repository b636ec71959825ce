//! `spectroll fit`: a model file from measured spectra.

use std::path::{Path, PathBuf};

use spectroll::output::write_file;
use spectroll::{BuiltinTable, Dataset, Extrapolation, Fit, Grid, Model, Normalization, SpectrumKind, Table};

use super::exit::Usage;
use super::if_exists;
use super::parse::grouped;

/// Fit a model to measured spectra
///
/// Files are MATLAB's (a matrix X of spectra in columns, and S_X = [start step count] or a vector wavelength beside it;
/// FILE.mat:X picks one of several), .h5 (the same, spectra in rows), CSV (wavelengths in the first column, a spectrum
/// in each other one) or .npy (spectra in rows, at --wavelengths). The names munsell, vrhel and granada stand for
/// built-in tables. Several are fitted together.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Files of spectra, or munsell, vrhel, granada
    #[arg(required = true, value_name = "FILE")]
    files: Vec<String>,
    /// The number of components
    #[arg(short = 'k', long, default_value_t = 6, value_name = "K")]
    components: usize,
    /// Kind of the spectra [default: as the name of the variable says: sur_X, spd_X, daylightX]
    #[arg(long, value_enum)]
    kind: Option<SpectrumKind>,
    /// The wavelengths, start:step:stop in nm [default: 400:10:700]
    #[arg(long, value_name = "GRID")]
    wavelengths: Option<Grid>,
    /// Divide each spectrum by this first [default: mean for illuminants, none for reflectances]
    #[arg(long, value_enum)]
    normalize: Option<Normalization>,
    /// Treat wavelengths outside a spectrum's measurements as
    #[arg(long, value_enum, default_value = "error")]
    extrapolate: Extrapolation,
    /// The model file
    #[arg(short, long, value_name = "MODEL.json")]
    output: PathBuf,
    /// Replace the model file if it exists
    #[arg(long)]
    force: bool,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let tables = arguments
        .files
        .iter()
        .map(|file| table(file, arguments.wavelengths))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let kind = kind(arguments, &tables)?;
    let data = Dataset::new(&tables, arguments.wavelengths.unwrap_or(Grid::DEFAULT), arguments.extrapolate)?;
    let mut fit = Fit::new(kind).components(arguments.components);
    if let Some(normalize) = arguments.normalize {
        fit = fit.normalization(normalize);
    }
    let model = fit.fit(&data)?;
    write_file(&arguments.output, if_exists(arguments.force), (model.to_json() + "\n").as_bytes())?;
    report(&model, &data, &arguments.output);
    Ok(())
}

fn report(model: &Model, data: &Dataset, path: &Path) {
    let explained: f64 = model.parts().explained_variance.iter().sum();
    tell!(
        "{}: {} components explain {:.2} % of {} {}s at {} nm",
        path.display(),
        model.components(),
        100.0 * explained,
        grouped(data.spectra().ncols() as u64),
        model.kind(),
        model.grid(),
    );
}

/// The table of a built-in name, a file, or file:variable; at these wavelengths where the file does not say.
fn table(name: &str, grid: Option<Grid>) -> anyhow::Result<Table> {
    if let Some(builtin) = BuiltinTable::named(name) {
        return Ok(builtin.table());
    }
    let (path, variable) = match name.rsplit_once(':') {
        Some((file, variable)) if !Path::new(name).exists() => (file, Some(variable)),
        _ => (name, None),
    };
    Ok(Table::open_on(Path::new(path), variable, grid)?)
}

/// Kind of the spectra: as asked, else as their names say, if those agree.
fn kind(arguments: &Arguments, tables: &[Table]) -> anyhow::Result<SpectrumKind> {
    if let Some(kind) = arguments.kind {
        return Ok(kind);
    }
    let kinds: Vec<_> = tables.iter().map(Table::kind).collect();
    let first = kinds[0].filter(|first| kinds.iter().all(|kind| *kind == Some(*first)));
    let unknown = "cannot tell what these spectra are: pass --kind reflectance or --kind illuminant";
    Ok(first.ok_or_else(|| Usage(unknown.to_owned()))?)
}
