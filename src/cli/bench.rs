//! `spectroll bench`: how fast this machine draws.
//!
//! In-process rates: spectra are computed and mapped for reading in order, and nothing is done with them. The median
//! of several runs is what to quote; their spread tells how quiet the machine was.

use std::io::Write;
use std::time::Instant;

use serde::Serialize;
use spectroll::{Choice, Engine, Recipe, Stream, adapters};

use super::{EngineArguments, check_interrupt, model, watch_interrupts};

/// How long one run should take, seconds.
const RUN: f64 = 0.4;

/// Measure how fast spectra are drawn, by every adapter and by the CPU
#[derive(clap::Args)]
pub(crate) struct Arguments {
    /// A model file or the name of a built-in model
    #[arg(value_name = "MODEL", default_value = "munsell-vrhel")]
    model: String,
    #[command(flatten)]
    engine: EngineArguments,
    /// How many runs
    #[arg(long, default_value_t = 7, value_parser = clap::value_parser!(u32).range(5..))]
    runs: u32,
    /// Print the rates as JSON
    #[arg(long)]
    json: bool,
}

/// The rates of one engine, million draws a second.
#[derive(Serialize)]
struct Rates {
    model: String,
    engine: String,
    bands: usize,
    components: usize,
    draws_per_run: u64,
    median: f64,
    least: f64,
    most: f64,
}

pub(crate) fn run(arguments: &Arguments) -> anyhow::Result<()> {
    let choice = arguments.engine.choice();
    let model = model(&arguments.model)?;
    let recipe = Recipe::new(&model).build()?;
    let choices = match choice {
        Some(choice) => vec![choice],
        None => (0..adapters().len()).map(|i| Choice::Adapter(i.to_string())).chain([Choice::Cpu]).collect(),
    };
    watch_interrupts();
    let mut all = Vec::new();
    for choice in choices {
        let engine = Engine::with_threads(&choice, arguments.engine.threads)?;
        let rates = measure(&engine, &recipe, arguments)?;
        if !arguments.json {
            let mut out = std::io::stdout();
            writeln!(
                out,
                "{:8.2} million/s (least {:.2}, most {:.2}; {} runs of {})  {}",
                rates.median, rates.least, rates.most, arguments.runs, rates.draws_per_run, rates.engine
            )?;
        }
        all.push(rates);
    }
    if arguments.json {
        writeln!(std::io::stdout(), "{}", serde_json::to_string_pretty(&all)?)?;
    }
    Ok(())
}

fn measure(engine: &Engine, recipe: &Recipe, arguments: &Arguments) -> anyhow::Result<Rates> {
    let mut drawer = engine.drawer(recipe)?;
    let mut time = |count: u64| {
        let start = Instant::now();
        drawer.draw(Stream::new(0).draws(0..count), |_| anyhow::Ok(check_interrupt()?))?;
        anyhow::Ok(start.elapsed().as_secs_f64())
    };
    // The first run pays for compiling the shader; the second says how many draws fill the time.
    time(1)?;
    let trial = 200_000;
    let count = (trial as f64 * RUN / time(trial)?) as u64;
    let mut rates = (0..arguments.runs)
        .map(|_| Ok(count as f64 / time(count)? / 1e6))
        .collect::<anyhow::Result<Vec<f64>>>()?;
    rates.sort_by(f64::total_cmp);
    Ok(Rates {
        model: arguments.model.clone(),
        engine: engine.to_string(),
        bands: recipe.model().bands(),
        components: recipe.model().components(),
        draws_per_run: count,
        median: rates[rates.len() / 2],
        least: rates[0],
        most: rates[rates.len() - 1],
    })
}
