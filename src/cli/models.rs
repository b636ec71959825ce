//! `spectroll models`: the models that are built in.

use std::io::Write;

use serde::Serialize;
use spectroll::{BuiltinModel, Model};

/// List the built-in models
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Print the list as JSON
    #[arg(long)]
    json: bool,
}

#[derive(Serialize)]
struct Row {
    #[serde(flatten)]
    builtin: BuiltinModel,
    /// The grid that it has unless another is asked for.
    default_wavelengths_nm: String,
    components: usize,
    explained_variance_percent: f64,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let rows = Model::BUILTIN.iter().copied().map(row).collect::<anyhow::Result<Vec<_>>>()?;
    let mut out = std::io::stdout();
    if arguments.json {
        return Ok(writeln!(out, "{}", serde_json::to_string_pretty(&rows)?)?);
    }
    writeln!(
        out,
        "{:<18} {:<11} {:>7}  {:<11} {:<11} {:>4}  explained",
        "model", "kind", "spectra", "default", "range", "step"
    )?;
    for Row { builtin, default_wavelengths_nm, components, explained_variance_percent } in &rows {
        let BuiltinModel { name, kind, spectra, first_nm, last_nm, step_nm } = builtin;
        let (kind, range) = (kind.to_string(), format!("{first_nm}-{last_nm} nm"));
        writeln!(
            out,
            "{name:<18} {kind:<11} {spectra:>7}  {default_wavelengths_nm:<11} {range:<11} {step_nm:>4}  \
             {explained_variance_percent:.2} % by {components}"
        )?;
    }
    writeln!(out, "\nAny grid within the range: --wavelengths START:STEP:STOP. `spectroll fit` makes models of other data.")?;
    Ok(())
}

fn row(name: &'static str) -> anyhow::Result<Row> {
    let model = Model::builtin(name)?;
    let explained: f64 = model.parts().explained_variance.iter().sum();
    Ok(Row {
        builtin: BuiltinModel::named(name).expect("every name has its data"),
        default_wavelengths_nm: model.grid().to_string(),
        components: model.components(),
        explained_variance_percent: 100.0 * explained,
    })
}
