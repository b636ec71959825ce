//! `spectroll models`: the models that are built in.

use std::io::Write;

use serde::Serialize;
use spectroll::wording::grouped;
use spectroll::{BuiltinData, Model, SpectrumKind};

/// List the built-in models
///
/// Each has a grid that it is on unless --wavelengths says otherwise, and can be fitted on any grid within the
/// wavelengths at which its spectra were measured.
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

/// A built-in model, for people and programs.
#[derive(Serialize)]
struct Row {
    name: &'static str,
    kind: SpectrumKind,
    /// The number of spectra that it is fitted to.
    spectra: usize,
    /// The grid that it is on unless another is asked for.
    wavelengths: String,
    /// Range of the wavelengths of its spectra, nm.
    measured: String,
    components: usize,
    /// The share of the variance that the components explain on that grid.
    explained_variance: f64,
}

impl Row {
    fn new(name: &'static str) -> anyhow::Result<Row> {
        let model = Model::builtin(name)?;
        let BuiltinData { kind, spectra, first, last, step, .. } = Model::builtin_data(name)?;
        Ok(Row {
            name,
            kind,
            spectra,
            wavelengths: model.grid().to_string(),
            measured: format!("{first}:{step}:{last}"),
            components: model.components(),
            explained_variance: model.parts().explained_variance.iter().sum(),
        })
    }
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let rows = Model::BUILTIN.iter().map(|name| Row::new(name)).collect::<anyhow::Result<Vec<_>>>()?;
    let mut out = std::io::stdout();
    if arguments.json {
        writeln!(out, "{}", serde_json::to_string_pretty(&rows)?)?;
        return Ok(());
    }
    let head = ["model", "kind", "spectra", "grid, nm", "measured, nm", "explained"];
    let cells = |row: &Row| {
        let explained = format!("{:.2} % by {}", 100.0 * row.explained_variance, row.components);
        let spectra = grouped(row.spectra as u64);
        [
            row.name.to_owned(),
            row.kind.to_string(),
            spectra,
            row.wavelengths.clone(),
            row.measured.clone(),
            explained,
        ]
    };
    for [name, kind, spectra, grid, measured, explained] in
        std::iter::once(head.map(str::to_owned)).chain(rows.iter().map(cells))
    {
        writeln!(out, "{name:<20} {kind:<11} {spectra:>7}  {grid:<10} {measured:<12} {explained}")?;
    }
    Ok(())
}
