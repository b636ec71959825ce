//! `spectroll bench`: the speed of drawing on this machine, and the cost of each part of a draw.
//!
//! In-process rates: values are computed and mapped for reading in order, and nothing is done with them. The median of
//! several runs is what to quote; their spread tells how quiet the machine was.

use std::io::Write;
use std::time::{Duration, Instant};

use serde::Serialize;
use spectroll::evaluation::costs::{Costs, Share};
use spectroll::{
    Bounds, BuiltinTable, Dataset, Dtype, Engine, EngineChoice, Extrapolation, Fit, Grid, Intensity, Layout,
    Model, Quantity, Recipe, RecipeBuilder, SpectrumKind, Stream, adapters,
};

use super::options::EngineArguments;
use super::parse::between;
use super::{interrupt, model};

/// Duration of one run, seconds.
const RUN: f64 = 0.4;

/// Duration of one run where there are many recipes to measure, seconds.
const SHORT_RUN: f64 = 0.1;

/// Measure how fast spectra are drawn, by every adapter and by the CPU
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file or the name of a built-in model
    #[arg(value_name = "MODEL", default_value = "munsell-vrhel")]
    model: String,
    #[command(flatten)]
    engine: EngineArguments,
    /// Measure what each quantity, rule and size of model costs, of the built-in models
    #[arg(long, conflicts_with = "model")]
    costs: bool,
    /// Number of runs
    #[arg(long, default_value_t = 7, value_parser = between::<5, 1_000_000>,
          allow_negative_numbers = true)]
    runs: u32,
    /// Print the rates as JSON
    #[arg(long)]
    json: bool,
}

/// All that was measured.
#[derive(Default, Serialize)]
struct Measured {
    rates: Vec<Rates>,
    /// Cost of each part of a draw, for each adapter.
    shares: Vec<Shares>,
}

#[derive(Serialize)]
struct Shares {
    engine: String,
    parts: Vec<Share>,
}

/// The rates of one engine.
#[derive(Serialize)]
struct Rates {
    recipe: String,
    engine: String,
    bands: usize,
    components: usize,
    bytes_per_draw: u64,
    acceptance: f64,
    draws_per_run: u64,
    draws_per_second: Spread,
}

/// The middle and the ends of what several runs gave.
#[derive(Clone, Copy, Serialize)]
struct Spread {
    median: f64,
    least: f64,
    most: f64,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let choices = match arguments.engine.choice() {
        Some(choice) => vec![choice],
        None => (0..adapters()?.len())
            .map(|i| EngineChoice::Adapter(i.to_string()))
            .chain([EngineChoice::Cpu])
            .collect(),
    };
    let recipes = match arguments.costs {
        true => costs()?,
        false => vec![(arguments.model.clone(), Recipe::builder(&model(&arguments.model)?))],
    };
    let recipes = recipes.into_iter().map(|(name, builder)| Ok((name, builder.build()?)));
    let recipes = recipes.collect::<anyhow::Result<Vec<_>>>()?;
    let seconds = if arguments.costs { SHORT_RUN } else { RUN };
    let width = recipes.iter().map(|(name, _)| name.len()).max().unwrap_or(0);
    interrupt::watch();
    let mut all = Measured::default();
    for choice in choices {
        let engine = arguments.engine.open_as(&choice)?;
        if arguments.costs && !arguments.json {
            writeln!(std::io::stdout(), "{engine}, million draws a second:")?;
        }
        for (name, recipe) in &recipes {
            let rates = measure(&engine, name, recipe, arguments.runs, seconds)?;
            if !arguments.json {
                let Rates { draws_per_second: rate, draws_per_run, engine, .. } = &rates;
                let [median, least, most] = [rate.median, rate.least, rate.most].map(|rate| rate / 1e6);
                let mut out = std::io::stdout();
                match arguments.costs {
                    true => writeln!(out, "  {name:width$}  {median:7.2} ({least:.2} to {most:.2})")?,
                    false => writeln!(
                        out,
                        "{median:8.2} million/s (least {least:.2}, most {most:.2}; {} runs of {draws_per_run})  {engine}",
                        arguments.runs
                    )?,
                }
            }
            all.rates.push(rates);
        }
        if arguments.costs
            && let Some(parts) = parts(&engine, arguments.runs)?
        {
            if !arguments.json {
                let mut out = std::io::stdout();
                writeln!(
                    out,
                    "  without a part, where no candidate is rejected, a draw takes so much less time:"
                )?;
                for Share { part, median, least, most } in &parts {
                    let [median, least, most] = [median, least, most].map(|share| 100.0 * share);
                    let name = part.name();
                    writeln!(out, "    {name:14}  {median:3.0} % ({least:.0} to {most:.0})")?;
                }
            }
            all.shares.push(Shares { engine: engine.to_string(), parts });
        }
    }
    if arguments.json {
        writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&all)?)?;
    }
    Ok(())
}

/// Recipes that differ from the first in one thing each.
fn costs() -> anyhow::Result<Vec<(String, RecipeBuilder)>> {
    let (surface, light) = (Model::builtin("munsell-vrhel")?, Model::builtin("granada")?);
    let surfaces = || Recipe::builder(&surface);
    let lights = || Recipe::builder(&light);
    let of = |grid: &str, components| {
        let tables = [BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()];
        let data = Dataset::new(&tables, grid.parse::<Grid>()?, Extrapolation::Error)?;
        anyhow::Ok(Recipe::builder(&Fit::new(SpectrumKind::Reflectance).components(components).fit(&data)?))
    };
    let everything = Quantity::ALL.iter().copied().filter(|q| *q != Quantity::Intensity);
    Ok([
        ("reflectances: spectra, 31 bands, 6 components", surfaces()),
        ("  attempts alone", surfaces().quantities([Quantity::Attempts])),
        ("  lrv", surfaces().quantities([Quantity::Lrv])),
        ("  xyz", surfaces().quantities([Quantity::Xyz])),
        ("  srgb", surfaces().quantities([Quantity::LinearSrgb])),
        ("  weights", surfaces().quantities([Quantity::Weights])),
        ("  everything", surfaces().quantities(everything)),
        ("  spectra in 16 bits", surfaces().spectra_dtype(Dtype::F16)),
        ("  spectra in padded rows", surfaces().layout(Layout::PaddedRows)),
        ("  spectra in planes", surfaces().layout(Layout::Planes)),
        ("  spectra, nothing rejected (covariance x 0.01)", surfaces().covariance_scale(0.01)),
        ("  spectra, covariance x 4", surfaces().covariance_scale(4.0)),
        ("  spectra at LRV 0.4, base", surfaces().lrv(0.4)),
        ("  spectra at LRV 0.4, scaled", surfaces().lrv(0.4).bounds(Bounds::Scaled)),
        ("  spectra, 3 components", of("400:10:700", 3)?),
        ("  spectra, 12 components", of("400:10:700", 12)?),
        ("  spectra, 61 bands", of("400:5:700", 6)?),
        ("illuminants: spectra", lights()),
        ("  spectra of log-uniform intensity", lights().intensity(Intensity::LogUniform(0.15, 150.0))),
        ("  spectra of the data's intensities", lights().intensity(Intensity::Data)),
        ("  xyz", lights().quantities([Quantity::Xyz])),
    ]
    .map(|(name, builder)| (name.to_owned(), builder))
    .into())
}

/// Measures the cost of each part of a draw; `None` where it cannot be measured.
fn parts(engine: &Engine, runs: u32) -> anyhow::Result<Option<Vec<Share>>> {
    let model = Model::builtin("munsell-vrhel")?;
    let Some(mut costs) = Costs::new(engine, &model, Duration::from_secs_f64(SHORT_RUN))? else {
        return Ok(None);
    };
    for _ in 0..runs {
        interrupt::check()?;
        costs.run()?;
    }
    Ok(Some(costs.shares()))
}

fn measure(engine: &Engine, name: &str, recipe: &Recipe, runs: u32, seconds: f64) -> anyhow::Result<Rates> {
    let mut session = engine.session(recipe)?;
    let mut time = |count: u64| {
        let start = Instant::now();
        session.draw(Stream::new(0).draws(0..count), |_| anyhow::Ok(interrupt::check()?))?;
        anyhow::Ok(start.elapsed().as_secs_f64())
    };
    // The first run pays for compiling the shader; the second says how many draws fill the time.
    time(1)?;
    let trial = 200_000;
    let count = (trial as f64 * seconds / time(trial)?).max(1.0) as u64;
    let mut rates =
        (0..runs).map(|_| Ok(count as f64 / time(count)?)).collect::<anyhow::Result<Vec<f64>>>()?;
    rates.sort_by(f64::total_cmp);
    Ok(Rates {
        recipe: name.trim().to_owned(),
        engine: engine.to_string(),
        bands: recipe.model().bands(),
        components: recipe.model().components(),
        bytes_per_draw: recipe.formats().iter().map(|format| format.bytes(4) / 4).sum(),
        acceptance: recipe.acceptance(),
        draws_per_run: count,
        draws_per_second: Spread {
            median: rates[rates.len() / 2],
            least: rates[0],
            most: rates[rates.len() - 1],
        },
    })
}
