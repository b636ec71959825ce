//! `spectroll look`: how files of spectra are read, before anything is fitted to them.
//!
//! Whoever knows the measurements sees at once whether the program understood them: where it found the wavelengths and
//! why, how many spectra there are, what was left out, and what `fit` would refuse.

use std::io::Write as _;
use std::path::PathBuf;

use serde::Serialize;
use spectroll::wording::{counted, grouped};
use spectroll::{Dataset, DatasetError, Extrapolation, Grid, Reading, SpectrumKind};

use super::exit;
use super::exit::Usage;
use super::inspect::line;
use super::options::DataArguments;
use super::wavelengths::grid;
use super::{if_exists, picture};

/// Show how files of spectra are read, before anything is fitted to them
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// Files of spectra, as `fit` takes them
    #[arg(required = true, value_name = "FILE")]
    files: Vec<String>,
    /// Kind of the spectra [default: as the file says, else both are tried]
    #[arg(long, value_enum)]
    kind: Option<SpectrumKind>,
    /// The wavelengths of the model that the spectra are for, in nm: start:step:stop, a list, or a file of them
    /// [default: 400:10:700]
    #[arg(long, value_name = "GRID|FILE", value_parser = grid)]
    wavelengths: Option<Grid>,
    /// Draw the spectra of one file, as measured and on the grid, into this file: .svg, .png or .pdf
    #[arg(short, long, value_name = "PATH")]
    output: Option<PathBuf>,
    #[command(flatten)]
    ground: picture::Ground,
    /// Print all of it as JSON
    #[arg(long)]
    json: bool,
    /// Replace the picture where it exists
    #[arg(long)]
    force: bool,
    #[command(flatten)]
    data: DataArguments,
}

/// Account of how a file was read, for programs.
#[derive(Serialize)]
struct Facts {
    file: String,
    format: String,
    dialect: Option<String>,
    layout: String,
    wavelengths: String,
    first_nm: f64,
    last_nm: f64,
    bands: usize,
    /// The step, where there is one.
    step_nm: Option<f64>,
    /// The smallest and the largest step, where they differ.
    steps_nm: Option<[f64; 2]>,
    spectra: usize,
    missing: usize,
    spectra_with_missing: usize,
    smallest: f64,
    largest: f64,
    mean: f64,
    kind: Option<SpectrumKind>,
    notes: Vec<String>,
    others: Vec<String>,
    /// Verdicts of `fit` on the spectra as reflectances and as illuminants.
    as_reflectances: Option<String>,
    as_illuminants: Option<String>,
}

const SOUND: &str = "nothing is wrong with them";

/// Prints how each file is read, and draws the spectra of one where asked.
pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let format = arguments.output.as_deref().map(picture::format).transpose()?;
    if arguments.output.is_some() && arguments.files.len() > 1 {
        return Err(Usage(format!(
            "-o draws one file, and there are {}: look at them one by one",
            arguments.files.len()
        ))
        .into());
    }
    let grid = arguments.wavelengths.clone().unwrap_or(Grid::DEFAULT);
    let mut all = Vec::new();
    for name in &arguments.files {
        let reading = match spectroll::BuiltinTable::named(name) {
            Some(builtin) => Reading::builtin(builtin),
            None => arguments.data.read(name, arguments.wavelengths.as_ref())?,
        };
        let scale = arguments.data.scale();
        let facts = facts(name, &reading, arguments, &grid);
        if let (Some(path), Some(format)) = (&arguments.output, format) {
            let table = reading.table.clone().scaled(scale);
            let gridded = Dataset::new(std::slice::from_ref(&table), grid.clone(), Extrapolation::Error);
            let refusal = gridded.as_ref().err().map(DatasetError::to_string).unwrap_or_default();
            let drawing = picture::look::Picture {
                name,
                note: &note(&facts),
                table: &table,
                gridded: gridded.as_ref().map_err(|_| refusal.as_str()),
                kind: arguments.kind.or(table.kind()),
                theme: arguments.ground.theme(),
            }
            .drawing();
            picture::write(&drawing, path, format, if_exists(arguments.force))?;
        }
        all.push(facts);
    }
    let text = match arguments.json {
        true => serde_json::to_string_pretty(&all)? + "\n",
        false => all.iter().map(text).collect::<Vec<_>>().join("\n"),
    };
    std::io::stdout().lock().write_all(text.as_bytes())?;
    Ok(())
}

fn facts(name: &str, reading: &Reading, arguments: &Arguments, grid: &Grid) -> Facts {
    let table = &reading.table;
    let wavelengths = table.wavelengths();
    let steps: Vec<f64> = wavelengths.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let (mut least, mut most) = (f64::INFINITY, 0.0f64);
    steps.iter().for_each(|step| (least, most) = (least.min(*step), most.max(*step)));
    let is_even = !steps.is_empty() && most - least <= 1e-6 * most;
    let scaled = table.clone().scaled(arguments.data.scale());
    let (mut low, mut high, mut sum, mut count) = (f64::INFINITY, f64::NEG_INFINITY, 0.0, 0usize);
    let mut with_missing = 0;
    for index in 0..scaled.len() {
        let spectrum = scaled.spectrum(index);
        with_missing += usize::from(spectrum.iter().any(|v| v.is_nan()));
        for value in spectrum.iter().filter(|v| !v.is_nan()) {
            (low, high, sum, count) = (low.min(*value), high.max(*value), sum + value, count + 1);
        }
    }
    let kind = arguments.kind.or(table.kind());
    let judged = |of: SpectrumKind| {
        kind.is_none_or(|kind| kind == of).then(|| {
            let judge = || -> anyhow::Result<String> {
                let data = Dataset::new(std::slice::from_ref(&scaled), grid.clone(), Extrapolation::Error)?;
                let counts = data.judge(of)?;
                let mut said = data.notes().to_vec();
                for (count, values) in [(counts.above_one, "above 1"), (counts.below_zero, "below 0")] {
                    if count > 0 {
                        said.push(format!(
                            "{} with values {values}",
                            counted(count as u64, "spectrum", "spectra")
                        ));
                    }
                }
                Ok(if said.is_empty() { SOUND.to_owned() } else { said.join(", ") })
            };
            judge().unwrap_or_else(|error| {
                format!("refused: {error}{}", exit::data_remedy(&error).unwrap_or_default())
            })
        })
    };
    Facts {
        file: name.to_owned(),
        format: reading.format.clone(),
        dialect: reading.dialect.clone(),
        layout: reading.layout.clone(),
        wavelengths: reading.wavelengths.clone(),
        first_nm: wavelengths[0],
        last_nm: wavelengths[wavelengths.len() - 1],
        bands: wavelengths.len(),
        step_nm: is_even.then(|| (wavelengths[wavelengths.len() - 1] - wavelengths[0]) / steps.len() as f64),
        steps_nm: (!is_even && !steps.is_empty()).then_some([least, most]),
        spectra: table.len(),
        missing: table.missing(),
        spectra_with_missing: with_missing,
        smallest: low,
        largest: high,
        mean: sum / count as f64,
        kind: table.kind(),
        notes: reading.notes.clone(),
        others: reading.others.clone(),
        as_reflectances: judged(SpectrumKind::Reflectance),
        as_illuminants: judged(SpectrumKind::Illuminant),
    }
}

/// Account of how a file was read, in a line that fits above a picture.
fn note(facts: &Facts) -> String {
    let layout = facts.layout.split(": ").next().unwrap_or_default();
    let note =
        format!("{}; {layout}; {} to {} nm", facts.format, short(facts.first_nm), short(facts.last_nm));
    note.chars().take(100).collect()
}

/// Everything that is printed of a file.
fn text(facts: &Facts) -> String {
    let mut text = String::new();
    line(&mut text, "file", &facts.file);
    line(&mut text, "format", &facts.format);
    if let Some(dialect) = &facts.dialect {
        line(&mut text, "dialect", dialect);
    }
    line(&mut text, "layout", &facts.layout);
    let steps = match (facts.step_nm, facts.steps_nm) {
        (Some(step), _) => format!(" by {}", short(step)),
        (None, Some([least, most])) => format!(", unevenly: by {} to {}", short(least), short(most)),
        (None, None) => String::new(),
    };
    let count = counted(facts.bands as u64, "wavelength", "wavelengths");
    let range = format!("{} to {} nm{steps}: {count}", short(facts.first_nm), short(facts.last_nm));
    line(&mut text, "wavelengths", &range);
    line(&mut text, "", &facts.wavelengths);
    line(&mut text, "spectra", &grouped(facts.spectra as u64));
    let missing = match facts.missing {
        0 => "none".to_owned(),
        n => format!(
            "{} in {}",
            counted(n as u64, "value", "values"),
            counted(facts.spectra_with_missing as u64, "spectrum", "spectra")
        ),
    };
    line(&mut text, "missing", &missing);
    let values =
        format!("{} to {}, {} on average", short(facts.smallest), short(facts.largest), short(facts.mean));
    line(&mut text, "values", &values);
    let kind =
        facts.kind.map_or("not told by the file: pass --kind to fit".to_owned(), |kind| format!("{kind}s"));
    line(&mut text, "kind", &kind);
    for (index, note) in facts.notes.iter().enumerate() {
        line(&mut text, if index == 0 { "notes" } else { "" }, note);
    }
    if !facts.others.is_empty() {
        line(&mut text, "also there", &facts.others.join(", "));
    }
    for (label, verdict) in [("reflectances", &facts.as_reflectances), ("illuminants", &facts.as_illuminants)]
    {
        if let Some(verdict) = verdict {
            line(&mut text, label, verdict);
        }
    }
    text
}

/// A number of few digits.
fn short(value: f64) -> String {
    let size = value.abs();
    match size {
        0.0 => "0".to_owned(),
        1e-3..1e6 => {
            let decimals = (5 - size.log10().floor() as i32).clamp(0, 8) as usize;
            let text = format!("{value:.decimals$}");
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
        _ => format!("{value:.4e}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in [
            (400.0, "400"),
            (0.123456789, "0.123457"),
            (399.70001220703125, "399.7"),
            (0.0, "0"),
            (-0.5, "-0.5"),
            (1.23e34, "1.2300e34"),
            (100000.0, "100000"),
        ] {
            assert_eq!(short(value), text);
        }
    }
}
