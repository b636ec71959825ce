//! `spectroll inspect`: the contents of a model, as a table and, where asked, as a picture.
//!
//! A fit is judged by how much it explains, by how its weights spread and by how many of its draws are physical, so
//! that is what the table holds. The picture is made first: a name that cannot be written is reported before anything
//! is printed.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::PathBuf;

use serde::Serialize;
use spectroll::evaluation::comparison::ComparisonFigures;
use spectroll::wording::{grouped, wrapped};
use spectroll::{Bounds, CoverSize, Distribution, Model, Normalization, Recipe, RecipeError, SpectrumKind};

mod comparison;

use self::comparison::Compared;
use super::options::{ModelArguments, RecipeArguments};
use super::parse::number;
use super::run::left_out;
use super::{if_exists, picture};

/// Show the contents of a model: a table, and a picture where asked
#[derive(clap::Args)]
pub(crate) struct Arguments {
    #[command(flatten)]
    pub(crate) model: ModelArguments,

    /// Draw the model, or its draws beside the data, into this file: .svg, .png or .pdf
    #[arg(short, long, value_name = "PATH")]
    pub(crate) output: Option<PathBuf>,

    #[command(flatten)]
    ground: picture::Ground,

    #[command(flatten)]
    data: comparison::Arguments,

    #[command(flatten)]
    request: RecipeArguments,

    /// The seed of the draws in the picture, and of those that are compared with data
    #[arg(long, default_value_t = 0, value_parser = number, allow_negative_numbers = true)]
    pub(crate) seed: u64,

    /// Print all of it as JSON
    #[arg(long)]
    json: bool,

    /// Replace the picture where it exists
    #[arg(long)]
    pub(crate) force: bool,
}

/// Prints the table, after making the picture where one is asked for.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let format = arguments.output.as_deref().map(picture::format).transpose()?;
    let model = arguments.model.load()?;
    let recipe = arguments.request.settings(&model)?.builder(&model).build();
    let compared = match &recipe {
        Ok(recipe) => arguments.data.compare(recipe, arguments.seed)?,
        Err(refused) if arguments.data.is_asked() => return Err(refused.clone().into()),
        Err(_) => None,
    };
    if let (Some(path), Some(format)) = (&arguments.output, format) {
        let (name, model, theme) = (arguments.model.name.as_str(), &model, arguments.ground.theme());
        let drawing = match &compared {
            Some(compared) => {
                let (note, comparison) = (&compared.note(), &compared.comparison);
                picture::comparison::Picture { name, note, model, comparison, theme }.drawing()
            }
            None => {
                let (recipe, seed) = (recipe.as_ref().ok(), arguments.seed);
                picture::model::Picture { name, model, recipe, seed, theme }.drawing()
            }
        };
        picture::write(&drawing, path, format, if_exists(arguments.force))?;
    }
    let text = match arguments.json {
        true => {
            serde_json::to_string_pretty(&Facts::of(
                &arguments.model.name,
                &model,
                &recipe,
                compared.as_ref(),
            ))? + "\n"
        }
        false => table(&arguments.model.name, &model, &recipe, compared.as_ref()),
    };
    std::io::stdout().lock().write_all(text.as_bytes())?;
    Ok(())
}

/// The table for programs.
#[derive(Serialize)]
struct Facts<'a> {
    model: &'a str,
    kind: SpectrumKind,
    wavelengths_nm: Vec<f64>,
    normalization: Normalization,
    /// gaussian, kernel or mixture.
    distribution: &'static str,
    /// The number of normal distributions, and of those that have no share of the draws.
    normal_distributions: usize,
    left_out: usize,
    sources: &'a [String],
    /// The largest luminous reflectance that scaled reflectances reach; nothing of illuminants.
    largest_lrv: Option<f64>,
    /// The estimated share of the model's candidates that are accepted.
    accepted_percent: Option<f64>,
    candidates_per_draw: Option<f64>,
    /// Reason for which the recipe cannot be drawn, where it cannot.
    refused: Option<String>,
    mean: &'a [f64],
    components: Vec<Component>,
    /// Draws beside measured spectra, where those are given.
    #[serde(skip_serializing_if = "Option::is_none")]
    comparison: Option<&'a ComparisonFigures>,
}

#[derive(Serialize)]
struct Component {
    explained_variance_percent: f64,
    weight_mean: f64,
    weight_sd: f64,
    peak_nm: f64,
    basis: Vec<f64>,
}

impl<'a> Facts<'a> {
    fn of(
        name: &'a str,
        model: &'a Model,
        recipe: &Result<Recipe, RecipeError>,
        compared: Option<&'a Compared>,
    ) -> Facts<'a> {
        let parts = model.parts();
        let component = |index: usize| Component {
            explained_variance_percent: 100.0 * parts.explained_variance[index],
            weight_mean: parts.weight_mean[index],
            weight_sd: parts.weight_covariance[(index, index)].max(0.0).sqrt(),
            peak_nm: peak(model, index),
            basis: parts.basis.row(index).iter().copied().collect(),
        };
        let drawn = recipe.as_ref().ok();
        Facts {
            model: name,
            kind: model.kind(),
            wavelengths_nm: model.grid().wavelengths().collect(),
            normalization: parts.normalization,
            distribution: model.distribution().name(),
            normal_distributions: model.distribution().len(),
            left_out: drawn.map_or(0, Recipe::left_out),
            sources: &parts.sources,
            largest_lrv: Recipe::largest_lrv(model),
            accepted_percent: drawn.map(|recipe| 100.0 * recipe.probability()),
            candidates_per_draw: drawn.map(|recipe| 1.0 / recipe.acceptance()),
            refused: recipe.as_ref().err().map(RecipeError::to_string),
            mean: parts.mean.as_slice(),
            components: (0..model.components()).map(component).collect(),
            comparison: compared.map(|compared| &compared.figures),
        }
    }
}

/// Everything that is printed.
fn table(
    name: &str,
    model: &Model,
    recipe: &Result<Recipe, RecipeError>,
    compared: Option<&Compared>,
) -> String {
    let grid = model.grid();
    let mut text = String::new();
    line(&mut text, "model", name);
    line(&mut text, "kind", &model.kind().to_string());
    line(&mut text, "grid", &format!("{grid} nm"));
    line(&mut text, "bands", &model.bands().to_string());
    line(&mut text, "components", &model.components().to_string());
    if let Some(error) = model.basis_correction() {
        let said =
            format!("made orthonormal, which it was to {error:.0e} only, as single precision leaves it");
        line(&mut text, "basis", &said);
    }
    line(&mut text, "normalization", normalization(model.parts().normalization));
    line(&mut text, "distribution", &model.distribution().to_string());
    if let Some(left_out) = recipe.as_ref().ok().and_then(left_out) {
        line(&mut text, "", &left_out);
    }
    for (index, source) in model.parts().sources.iter().enumerate() {
        line(&mut text, if index == 0 { "sources" } else { "" }, source);
    }
    if let Some(largest) = Recipe::largest_lrv(model) {
        line(&mut text, "LRV", &format!("scaled reflectances reach any above 0 and below {largest:.6}"));
    }
    match recipe {
        Ok(recipe) => {
            line(&mut text, "accepted", &accepted(recipe));
            line(&mut text, "candidates", &candidates(recipe));
        }
        Err(e) => line(&mut text, "refused", &e.to_string()),
    }
    if let Some(compared) = compared {
        line(&mut text, "compared", &compared.note());
        line(&mut text, "", &compared.sentence());
    }
    text.push('\n');
    components(&mut text, model);
    if let Some(compared) = compared {
        text.push('\n');
        text += &compared.table(model);
    }
    text
}

/// Adds a line of a label and a value, and others below it where the value is long.
pub(super) fn line(text: &mut String, label: &str, value: &str) {
    const LABEL: usize = 15;
    let mut label = label;
    for part in wrapped(value, 80 - LABEL) {
        let _ = writeln!(text, "{label:<LABEL$}{part}");
        label = "";
    }
}

fn normalization(normalization: Normalization) -> &'static str {
    match normalization {
        Normalization::Mean => "each spectrum divided by its mean power",
        Normalization::Integral => "each spectrum divided by its integral over the grid",
        Normalization::None => "none",
    }
}

/// Describes the source of candidates, and its cost.
fn candidates(recipe: &Recipe) -> String {
    let each = 1.0 / recipe.acceptance();
    match recipe.cover() {
        None => {
            let from = match recipe.model().distribution() {
                Distribution::Gaussian => "Gaussian",
                _ => "normal distributions",
            };
            format!("the model's {from}: {each:.2} for each draw")
        }
        Some(CoverSize { boxes, bytes, .. }) => format!(
            "{} boxes, a table of {} KB: {each:.2} for each draw, at about twice the cost of the Gaussian's, of which \
             a draw would take {:.3e}",
            grouped(boxes as u64),
            bytes / 1000,
            1.0 / recipe.probability()
        ),
    }
}

/// Share of the model's candidates that are accepted, and the rule.
fn accepted(recipe: &Recipe) -> String {
    let rule = match (recipe.model().kind(), recipe.settings().lrv, recipe.settings().bounds) {
        (SpectrumKind::Illuminant, ..) => "power above 0 in every band",
        (SpectrumKind::Reflectance, None, _) | (_, _, Bounds::Base) => "0 < reflectance < 1 in every band",
        (_, _, Bounds::Scaled) => "0 < scaled reflectance < 1 in every band",
        (_, _, Bounds::Both) => "0 < reflectance < 1 in every band, before and after scaling",
    };
    let share = match recipe.probability() {
        probability @ 0.01.. => format!("{:.2} %", 100.0 * probability),
        probability => format!("{probability:.3e}"),
    };
    format!("{share} of the model's candidates, by an estimate ({rule})")
}

/// A row a component.
fn components(text: &mut String, model: &Model) {
    let parts = model.parts();
    let deviation: Vec<f64> = parts.weight_covariance.diagonal().iter().map(|v| v.max(0.0).sqrt()).collect();
    let weight = Notation::of(&deviation);
    let _ = writeln!(
        text,
        "{:>9}{:>13}{:>12}{:>14}{:>14}{:>11}",
        "component", "explained", "cumulated", "sd of weight", "mean weight", "peak"
    );
    let _ = writeln!(text, "{:>9}{:>13}{:>12}{:>14}{:>14}{:>11}", "", "%", "%", "", "", "nm");
    let mut cumulated = 0.0;
    for (index, explained) in parts.explained_variance.iter().enumerate() {
        cumulated += explained;
        let _ = writeln!(
            text,
            "{:>9}{:>13.3}{:>12.3}{:>14}{:>14}{:>11}",
            index + 1,
            100.0 * explained,
            100.0 * cumulated,
            weight.format(deviation[index]),
            weight.format(parts.weight_mean[index]),
            peak(model, index),
        );
    }
}

/// The wavelength where a basis vector is farthest from zero, in nm.
fn peak(model: &Model, component: usize) -> f64 {
    model.grid().wavelength(model.parts().basis.row(component).transpose().iamax())
}

/// Notation of a column of numbers, so that their points align.
#[derive(Clone, Copy)]
enum Notation {
    Fixed,
    Scientific,
}

impl Notation {
    /// Four decimals, where they show what the largest value is.
    fn of(values: &[f64]) -> Notation {
        let largest = values.iter().fold(0.0, |a: f64, v| a.max(v.abs()));
        if largest == 0.0 || (0.01..1e6).contains(&largest) { Notation::Fixed } else { Notation::Scientific }
    }

    fn format(self, value: f64) -> String {
        match self {
            // What rounds to zero loses its sign: a mean of -1e-17 is not "-0.0000".
            Notation::Fixed if value.abs() < 0.5e-4 => format!("{:.4}", 0.0),
            Notation::Fixed => format!("{value:.4}"),
            Notation::Scientific => format!("{value:.3e}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_fits_80_columns_and_has_a_row_a_component() {
        for &name in Model::BUILTIN {
            let model = Model::builtin(name).unwrap();
            let table = table(name, &model, &Recipe::builder(&model).build(), None);
            assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
            let rows = table.lines().skip_while(|line| !line.starts_with("component ")).count();
            assert_eq!(rows, 2 + model.components(), "{table}");
            assert!(!table.contains("-0.0000"), "{table}");
        }
    }
}
