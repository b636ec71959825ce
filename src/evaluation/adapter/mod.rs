//! Measurements that a new adapter owes: its arithmetic, draws of every kind held against the CPU's, the costs of a draw's
//! parts, and how near drawing comes to the rates of its memory and of its bus.

mod memory;
mod rows;
mod tuning;
mod twins;

use std::time::{Duration, Instant};

use chrono::Utc;
use serde::Serialize;

pub use memory::Bandwidth;
pub use rows::rows;
pub use tuning::{WindowRate, WorkgroupRate};
pub use twins::Twin;

use super::costs::{CostError, Costs, Share};
use super::statistics::{Sample, Scenario, battery, oracle};
use crate::engine::{Adapter, Engine, EngineChoice, EngineError, Probe, probe};
use crate::model::Model;
use crate::recipe::RecipeError;
use crate::sampler::SamplerError;

/// Number of draws of each scenario's checks.
const CHECK_DRAWS: u64 = 1 << 16;

/// Number of runs of each measurement, of which the median counts.
const RUNS: usize = 7;

/// Measurements of an adapter.
#[derive(Clone, Debug, Serialize)]
pub struct AdapterReport {
    /// Version of the program.
    pub version: &'static str,
    /// Day of the measurements, UTC.
    pub date: String,
    /// Duration of the measurements, seconds.
    pub seconds: f64,
    /// The adapter, with its driver.
    pub adapter: Adapter,
    /// Form of arithmetic, and traits that the self-test found.
    pub probe: Probe,
    /// Draws of every kind of recipe in both forms of arithmetic, beside those of the CPU.
    pub twins: Vec<Twin>,
    /// Checks of the distribution of draws that raise no alarm, and all of them.
    pub checks: [usize; 2],
    /// Descriptions of those that raise one.
    pub alarms: Vec<String>,
    /// Cost of each part of a draw.
    pub costs: Vec<Share>,
    /// Rates of memory, of the bus and of draws.
    pub bandwidth: Bandwidth,
    /// Rates of draws to the host in windows of several sizes.
    pub windows: Vec<WindowRate>,
    /// Rates of draws in workgroups of several sizes.
    pub workgroups: Vec<WorkgroupRate>,
}

/// Error returned where an adapter cannot be measured.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum AdapterError {
    /// The engine cannot be opened, or failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// A recipe cannot be built.
    #[error(transparent)]
    Recipe(#[from] RecipeError),
    /// The device has no room.
    #[error(transparent)]
    Sampler(#[from] SamplerError),
    /// The choice is the CPU.
    #[error("the CPU is no adapter: choose one of `spectroll adapters`")]
    Cpu,
    /// The caller's watch asked for an end.
    #[error("stopped")]
    Stopped,
}

impl From<CostError> for AdapterError {
    fn from(error: CostError) -> Self {
        match error {
            CostError::Recipe(e) => e.into(),
            CostError::Engine(e) => e.into(),
        }
    }
}

/// Measures an adapter. `watch` is told of each step, and returns whether to go on.
pub fn measure(choice: &EngineChoice, watch: &dyn Fn(&str) -> bool) -> Result<AdapterReport, AdapterError> {
    let (start, date) = (Instant::now(), Utc::now().format("%Y-%m-%d").to_string());
    let say = |step: &str| if watch(step) { Ok(()) } else { Err(AdapterError::Stopped) };
    let engine = Engine::new(choice)?;
    let Some((device, queue)) = engine.device() else { return Err(AdapterError::Cpu) };
    say("the self-test")?;
    let probe = probe(device, queue)?;
    let twins = twins::measure(choice, &say)?;
    let (checks, alarms) = checks(&engine, &say)?;
    say("the cost of each part of a draw")?;
    let model = Model::builtin("munsell-vrhel").expect("it is built in");
    let mut costs = Costs::new(&engine, &model, Duration::from_millis(100))?.expect("it is an adapter's");
    (0..RUNS).try_for_each(|_| costs.run())?;
    say("memory and the bus")?;
    let bandwidth = memory::measure(&engine)?;
    say("windows and workgroups")?;
    Ok(AdapterReport {
        version: env!("CARGO_PKG_VERSION"),
        date,
        adapter: engine.adapter().expect("it is an adapter's").clone(),
        probe,
        twins,
        checks,
        alarms,
        costs: costs.shares(),
        windows: tuning::windows(&engine)?,
        workgroups: tuning::workgroups(&engine)?,
        bandwidth,
        seconds: start.elapsed().as_secs_f64(),
    })
}

/// Checks of distributions that raise no alarm and all of them, on every scenario, and the alarms.
fn checks(
    engine: &Engine,
    say: &dyn Fn(&str) -> Result<(), AdapterError>,
) -> Result<([usize; 2], Vec<String>), AdapterError> {
    let (mut all, mut alarms) = (0, Vec::new());
    for scenario in Scenario::all() {
        say(&format!("the distribution of draws: {}", scenario.name))?;
        let expected = oracle(&scenario, 1, CHECK_DRAWS);
        let sampler = |stream, first, count| Sample::of_engine(&scenario, engine, stream, first, count);
        for (check, finding) in battery(&sampler, &expected, 0)? {
            all += 1;
            let alarm = finding.alarm().map(|alarm| format!("{}, {}: {alarm}", scenario.name, check.name));
            alarms.extend(alarm);
        }
    }
    Ok(([all - alarms.len(), all], alarms))
}

/// Median of some rates.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_middle_one_counts() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
    }
}
