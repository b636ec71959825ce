//! `spectroll fit`: a model file from measured spectra.

use std::path::{Path, PathBuf};

use spectroll::output::write_file;
use spectroll::suggestion::closest;
use spectroll::{
    BuiltinTable, Dataset, Extrapolation, Fit, Grid, Missing, Model, Normalization, ResampleMethod,
    Resampling, SpectrumKind, Table,
};

use super::exit::Usage;
use super::if_exists;
use super::parse::grouped;
use super::run::Waiting;
use super::wavelengths::{Wavelengths, wavelengths};

/// Fit a model to measured spectra
///
/// Files are MATLAB's (a matrix X of spectra in columns, and S_X = [start step count] or a vector wavelength beside it;
/// FILE.mat:X picks one of several), .h5 (the same, spectra in rows), CSV (wavelengths in the first column, a spectrum
/// in each other one) or .npy (spectra in rows, at --wavelengths). The names munsell, vrhel, granada and others stand for
/// built-in tables. Several are fitted together.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Files of spectra, or munsell, vrhel, granada, macbeth, koivisto, krinov, houser
    #[arg(required = true, value_name = "FILE")]
    files: Vec<String>,
    /// The number of components, or the share of the variance that they must explain, as in 99.9%
    #[arg(short = 'k', long, default_value = "6", value_name = "K", value_parser = components,
          allow_hyphen_values = true)]
    components: Components,
    /// Kind of the spectra [default: as the name of the variable says: sur_X, spd_X, daylightX]
    #[arg(long, value_enum)]
    kind: Option<SpectrumKind>,
    /// The wavelengths of the model, in nm: start:step:stop, a list as in 443,490,560, a file of them, or as-measured
    /// [default: 400:10:700]
    #[arg(long, value_name = "GRID|FILE|as-measured", value_parser = wavelengths)]
    wavelengths: Option<Wavelengths>,
    /// Bring data to these wavelengths by
    #[arg(long, value_enum, default_value = "auto")]
    resample: ResampleMethod,
    /// Treat spectra that lack a value which these wavelengths need as
    #[arg(long, value_enum, default_value = "error")]
    missing: Missing,
    /// Multiply the data by this: 0.01 makes reflectances of percentages
    #[arg(long, default_value_t = 1.0, value_name = "FACTOR", value_parser = factor,
          allow_negative_numbers = true)]
    scale: f64,
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

/// Size of a model.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Components {
    Count(usize),
    /// As many as explain this share of the variance.
    Share(f64),
}

fn components(text: &str) -> Result<Components, String> {
    let parsed = match text.strip_suffix('%') {
        Some(percent) => percent.trim().parse().ok().map(|percent: f64| Components::Share(percent / 100.0)),
        None => text.parse().ok().map(Components::Count),
    };
    parsed.ok_or_else(|| "expected a number of components, or a share of the variance as in 99.9%".to_owned())
}

pub(super) fn factor(text: &str) -> Result<f64, String> {
    let factor = text.parse().ok().filter(|factor: &f64| factor.is_finite() && *factor > 0.0);
    factor.ok_or_else(|| "expected a number above 0".to_owned())
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    if let Some(extension) = arguments.output.extension().filter(|e| !e.eq_ignore_ascii_case("json")) {
        let name = arguments.output.with_extension("json");
        return Err(Usage(format!(
            "a model is a JSON file, not .{}: pass -o {}",
            extension.display(),
            name.display()
        ))
        .into());
    }
    let given = match &arguments.wavelengths {
        Some(Wavelengths::Grid(grid)) => Some(grid.clone()),
        Some(Wavelengths::AsMeasured) | None => None,
    };
    let tables = arguments
        .files
        .iter()
        .map(|file| Ok(table(file, given.clone())?.scaled(arguments.scale)))
        .collect::<anyhow::Result<Vec<_>>>()?;
    let kind = kind(arguments, &tables)?;
    let grid = match &arguments.wavelengths {
        Some(Wavelengths::AsMeasured) => Dataset::measured_grid(&tables)?,
        _ => given.unwrap_or(Grid::DEFAULT),
    };
    let settings = Resampling::default()
        .method(arguments.resample)
        .extrapolation(arguments.extrapolate)
        .missing(arguments.missing);
    let data = Dataset::new(&tables, grid, settings)?;
    let mut fit = match arguments.components {
        Components::Count(components) => Fit::new(kind).components(components),
        Components::Share(share) => Fit::new(kind).explain(share),
    };
    if let Some(normalize) = arguments.normalize {
        fit = fit.normalization(normalize);
    }
    let waiting = Waiting::begin("fitting the model", false);
    let model = fit.fit(&data)?;
    drop(waiting);
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
    for note in data.notes() {
        tell!("  {note}");
    }
}

/// The table of a built-in name, a file, or file:variable; at these wavelengths where the file does not say.
pub(super) fn table(name: &str, grid: Option<Grid>) -> anyhow::Result<Table> {
    if let Some(builtin) = BuiltinTable::named(name) {
        return Ok(builtin.table());
    }
    let (path, variable) = match name.rsplit_once(':') {
        Some((file, variable)) if !Path::new(name).exists() => (file, Some(variable)),
        _ => (name, None),
    };
    if Path::new(path).extension().is_none() && !Path::new(path).exists() {
        return Err(Usage(no_data(name)).into());
    }
    Ok(Table::open_on(Path::new(path), variable, grid)?)
}

/// Says what a name that is no file's may have meant.
fn no_data(name: &str) -> String {
    if Model::BUILTIN.contains(&name) {
        return format!(
            "{name} is a model, fitted already, and measured spectra are wanted here; `spectroll sample {name} --wavelengths \
             START:STEP:STOP` fits it at another grid"
        );
    }
    let tables = || BuiltinTable::ALL.iter().map(|table| table.name());
    let known = tables().collect::<Vec<_>>().join(", ");
    let meant = closest(name, tables()).map_or(String::new(), |meant| format!(", did you mean {meant}?"));
    format!("{name:?} is neither a file nor a built-in table ({known}){meant}")
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
