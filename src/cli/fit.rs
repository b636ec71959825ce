//! `spectroll fit`: a model file from measured spectra.

use std::path::{Path, PathBuf};

use spectroll::output::write_file;
use spectroll::wording::counted;
use spectroll::{
    Dataset, Distribution, Extrapolation, Fit, FitDistribution, Grid, Missing, Model, Normalization,
    ResampleMethod, Resampling, SpectraCounts, SpectrumKind, Table,
};

use super::exit::Usage;
use super::if_exists;
use super::options::DataArguments;
use super::run::Waiting;
use super::wavelengths::{Wavelengths, wavelengths};

/// Fit a model to measured spectra
///
/// Files are text of any dialect with spectra in columns or rows, MATLAB's, HDF5, NumPy's (.npy, .npz), Parquet, Zarr,
/// spreadsheets, ENVI libraries, JCAMP-DX or TM-27, told by their content; `spectroll look` shows how one is read.
/// FILE:ARRAY picks one of several matrices, FILE:ARRAY@NAME its wavelengths, and FILE@380:5:780 says at which wavelengths
/// it was measured where it does not. The names munsell, vrhel, granada and others stand for built-in tables. Several are
/// fitted together.
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
    /// Divide each spectrum by this first [default: mean for illuminants, none for reflectances]
    #[arg(long, value_enum)]
    normalize: Option<Normalization>,
    /// Treat wavelengths outside a spectrum's measurements as
    #[arg(long, value_enum, default_value = "error")]
    extrapolate: Extrapolation,
    /// Distribution of the weights: a Gaussian, a normal distribution about each spectrum, which keeps draws to the shape of
    /// the data (kernel), or a few of them (mixture)
    #[arg(long, value_enum, default_value = "gaussian")]
    distribution: DistributionKind,
    /// The width of each spectrum's normal distribution, from 0 (the spectra themselves) to 1 (the Gaussian); auto takes
    /// that under which the spectra are most likely [default: auto]
    #[arg(long, value_name = "H|auto", value_parser = bandwidth, allow_hyphen_values = true)]
    bandwidth: Option<Bandwidth>,
    /// The number of normal distributions of a mixture [default: 3]
    #[arg(short = 'g', long, value_name = "G")]
    mixture_components: Option<usize>,
    /// The model file
    #[arg(short, long, value_name = "MODEL.json")]
    output: PathBuf,
    /// Replace the model file if it exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    data: DataArguments,
}

/// Kind of a distribution.
#[derive(Clone, Copy, Debug, PartialEq, clap::ValueEnum)]
enum DistributionKind {
    Gaussian,
    Kernel,
    Mixture,
}

/// Bandwidth of a kernel.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Bandwidth {
    Auto,
    Fixed(f64),
}

fn bandwidth(text: &str) -> Result<Bandwidth, String> {
    match text.parse() {
        Ok(bandwidth) => Ok(Bandwidth::Fixed(bandwidth)),
        Err(_) if text == "auto" => Ok(Bandwidth::Auto),
        Err(_) => Err("expected auto, or a number from 0 to 1".to_owned()),
    }
}

impl Arguments {
    /// The distribution that is asked for.
    fn distribution(&self) -> anyhow::Result<FitDistribution> {
        let needs =
            |option: &str, kind: &str| Err(Usage(format!("{option} needs --distribution {kind}")).into());
        match (self.distribution, self.bandwidth, self.mixture_components) {
            (DistributionKind::Gaussian | DistributionKind::Mixture, Some(_), _) => {
                needs("--bandwidth", "kernel")
            }
            (DistributionKind::Gaussian | DistributionKind::Kernel, _, Some(_)) => {
                needs("--mixture-components", "mixture")
            }
            (DistributionKind::Gaussian, ..) => Ok(FitDistribution::Gaussian),
            (DistributionKind::Kernel, Some(Bandwidth::Fixed(bandwidth)), _) => {
                Ok(FitDistribution::Kernel(Some(bandwidth)))
            }
            (DistributionKind::Kernel, ..) => Ok(FitDistribution::Kernel(None)),
            (DistributionKind::Mixture, _, normals) => {
                Ok(FitDistribution::Mixture(normals.unwrap_or(FitDistribution::MIXTURE_COMPONENTS)))
            }
        }
    }
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
    let distribution = arguments.distribution()?;
    let given = match &arguments.wavelengths {
        Some(Wavelengths::Grid(grid)) => Some(grid.clone()),
        Some(Wavelengths::AsMeasured) | None => None,
    };
    let mut tables = Vec::new();
    for file in &arguments.files {
        let (table, notes) = arguments.data.table(file, given.as_ref())?;
        notes.iter().for_each(|note| tell!("{}: {note}", table.name()));
        tables.push(table);
    }
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
    fit = fit.distribution(distribution);
    if let Some(normalize) = arguments.normalize {
        fit = fit.normalization(normalize);
    }
    let waiting = Waiting::begin("fitting the model", false);
    let model = fit.fit(&data)?;
    drop(waiting);
    write_file(&arguments.output, if_exists(arguments.force), (model.to_json() + "\n").as_bytes())?;
    if let Ok(counts) = data.judge(kind) {
        unusual(counts);
    }
    report(&model, &data, &arguments.output);
    Ok(())
}

/// Says how many spectra have values that are unusual, and no error.
fn unusual(counts: SpectraCounts) {
    for (count, values) in [(counts.above_one, "above 1"), (counts.below_zero, "below 0")] {
        if count > 0 {
            tell!("{} with values {values}", counted(count as u64, "spectrum", "spectra"));
        }
    }
}

fn report(model: &Model, data: &Dataset, path: &Path) {
    let kind = model.kind().to_string();
    let explained: f64 = model.parts().explained_variance.iter().sum();
    tell!(
        "{}: {} {:.2} % of {} at {} nm",
        path.display(),
        counted(model.components() as u64, "component explains", "components explain"),
        100.0 * explained,
        counted(data.spectra().ncols() as u64, &kind, &format!("{kind}s")),
        model.grid(),
    );
    for note in data.notes() {
        tell!("  {note}");
    }
    if *model.distribution() != Distribution::Gaussian {
        tell!("  {}", model.distribution());
    }
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
