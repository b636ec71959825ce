//! The comparison of a model's draws with measured spectra, as a table.

use std::fmt::Write as _;

use spectroll::evaluation::comparison::{
    ColourFigures, Comparison, ComparisonFigures, JointFigures, Moments, WeightFigures,
};
use spectroll::wording::grouped;
use spectroll::{Dataset, Extrapolation, Model, Recipe, SpectrumKind, Stream, Table};

use crate::cli::exit::Usage;
use crate::cli::options::DataArguments;

/// Number of draws that are compared with the data.
const DRAWS: u64 = 20_000;

/// Data to compare draws with.
// A group has the name of its type, which is that of the command's as well.
#[derive(clap::Args)]
#[group(skip)]
pub(super) struct Arguments {
    /// Compare the draws with these measured spectra: files as `fit` reads them, or
    /// the name of a built-in table
    #[arg(long, value_name = "FILE", num_args = 1..)]
    data: Vec<String>,
    #[command(flatten)]
    reading: DataArguments,
}

impl Arguments {
    /// Whether there are data.
    pub(super) fn is_asked(&self) -> bool {
        !self.data.is_empty()
    }

    /// Compares the data with draws of `seed`; `None` where there are no data.
    pub(super) fn compare(&self, recipe: &Recipe, seed: u64) -> anyhow::Result<Option<Compared>> {
        if !self.is_asked() {
            if self.reading.is_asked() {
                return Err(Usage(
                    "the options of reading files need some: name them with --data".to_owned(),
                )
                .into());
            }
            return Ok(None);
        }
        let model = recipe.model();
        let mut tables: Vec<Table> = Vec::new();
        for name in &self.data {
            let (table, notes) = self.reading.table(name, Some(model.grid()))?;
            notes.iter().for_each(|note| tell!("{}: {note}", table.name()));
            tables.push(table);
        }
        if let Some(other) = tables.iter().find(|table| table.kind().is_some_and(|kind| kind != model.kind()))
        {
            return Err(Usage(format!(
                "--data {}: the model is one of {}s, and these are not",
                other.name(),
                model.kind()
            ))
            .into());
        }
        let data = Dataset::new(&tables, model.grid().clone(), Extrapolation::Error)?;
        let mean = data.spectra().mean();
        if model.kind() == SpectrumKind::Reflectance && mean > 1.0 {
            return Err(Usage(format!(
                "the data are reflectances of {mean:.4} on average; where these are percentages, pass --scale 0.01"
            ))
            .into());
        }
        data.judge(model.kind())?;
        let comparison = Comparison::new(recipe, &data, Stream::new(seed), DRAWS)?;
        Ok(Some(Compared {
            figures: comparison.figures(),
            comparison,
            sources: data.sources().join(", "),
            seed,
        }))
    }
}

/// A comparison and its sources.
pub(super) struct Compared {
    pub(super) comparison: Comparison,
    pub(super) figures: ComparisonFigures,
    sources: String,
    seed: u64,
}

impl Compared {
    /// Describes what is compared.
    pub(super) fn note(&self) -> String {
        format!("{} and {} draws of seed {}", self.sources, grouped(self.figures.draws as u64), self.seed)
    }

    /// Describes in a sentence how far the draws are from the data.
    pub(super) fn sentence(&self) -> String {
        let weights = self.figures.weights.iter().enumerate();
        let farthest = weights.max_by(|a, b| a.1.drawn.distance.total_cmp(&b.1.drawn.distance));
        let (at, weight) = farthest.expect("a model has components");
        let JointFigures { mean_spectrum_shift, determinant_ratio, chromaticity_p_value } =
            self.figures.drawn;
        let mut text = format!(
            "draws are farthest from the data in weight {}: its mean is off by {:.2} standard deviations, and the two \
             distributions are {:.3} apart (Kolmogorov-Smirnov); their mean spectrum is off by {:.3} at {} nm",
            at + 1,
            weight.drawn.mean_shift.abs(),
            weight.drawn.distance,
            mean_spectrum_shift.0.abs(),
            mean_spectrum_shift.1
        );
        if let Some(ratio) = determinant_ratio {
            let _ =
                write!(text, "; the determinant of their covariance is {:.1} % of the data's", 100.0 * ratio);
            if let Some(before) = self.figures.candidates.determinant_ratio {
                let _ = write!(text, ", and {:.1} % before rejection", 100.0 * before);
            }
        }
        if let Some(p) = chromaticity_p_value {
            let told = if p < 0.05 {
                "tells their chromaticities apart"
            } else {
                "does not tell their chromaticities apart"
            };
            let _ = write!(text, "; an energy test {told} (p = {p:.3})");
        }
        text
    }

    /// A row a weight, and a row a coordinate of colours.
    pub(super) fn table(&self, model: &Model) -> String {
        let mut text = String::new();
        let _ = writeln!(
            text,
            "{:>6}{:>15}{:>14}{:>20}{:>14}{:>9}",
            "weight", "shift of mean", "ratio of sds", "skewness", "Kolmogorov", "p"
        );
        let _ = writeln!(text, "{:>6}{:>15}{:>48}", "", "in sds of data", "-Smirnov");
        let _ = writeln!(
            text,
            "{:>6}{:>8}{:>7}{:>7}{:>7}{:>6}{:>7}{:>7}{:>7}{:>7}{:>9}",
            "", "before", "draws", "before", "draws", "data", "before", "draws", "before", "draws", "draws"
        );
        for (index, WeightFigures { measured, candidates, drawn }) in self.figures.weights.iter().enumerate()
        {
            let _ = write!(text, "{:>6}", index + 1);
            let shifts = [candidates, drawn].map(|of| unsigned_zero(of.mean_shift, 3));
            let skewnesses = [measured, &candidates.moments, &drawn.moments];
            let skewnesses = skewnesses.map(|moments| unsigned_zero(moments.skewness, 2));
            let _ = write!(text, "{:>8.3}{:>7.3}", shifts[0], shifts[1]);
            let _ = write!(text, "{:>7.3}{:>7.3}", candidates.sd_ratio, drawn.sd_ratio);
            let _ = write!(text, "{:>6.2}{:>7.2}{:>7.2}", skewnesses[0], skewnesses[1], skewnesses[2]);
            let _ = write!(text, "{:>7.3}{:>7.3}", candidates.distance, drawn.distance);
            let _ = writeln!(text, "{:>9}", p_value(drawn.p_value));
        }
        let under = match model.kind() {
            SpectrumKind::Reflectance => "under D65",
            SpectrumKind::Illuminant => "of the light",
        };
        if !self.figures.colours.is_empty() {
            let _ = writeln!(
                text,
                "\n{:>6}{:>17}{:>17}{:>17}   CIE 1931, {under}",
                "", "data", "before", "draws"
            );
        }
        for ColourFigures { name, measured, candidates, drawn } in &self.figures.colours {
            let _ = write!(text, "{:>6}", if *name == "lrv" { "LRV" } else { name });
            for Moments { mean, sd, .. } in [measured, candidates, drawn] {
                let _ = write!(text, "{:>17}", format!("{mean:.4} ± {sd:.4}"));
            }
            text.push('\n');
        }
        text += "\nBefore: the model's candidates, before any is rejected.\n";
        text
    }
}

/// The value, without its sign where it rounds to zero.
fn unsigned_zero(value: f64, decimals: i32) -> f64 {
    if value.abs() < 0.5 * 10f64.powi(-decimals) { 0.0 } else { value }
}

fn p_value(p: f64) -> String {
    match p {
        ..1e-9 => "< 1e-9".to_owned(),
        ..0.001 => format!("{p:.0e}"),
        _ => format!("{p:.3}"),
    }
}
