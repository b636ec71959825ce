//! Subjects of measurement in one form: engines in f32, and the CPU in f64.

use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::Serialize;

use super::estimate::Moments;
use super::{Bench, ReportError};
use crate::cpu::Kernel;
use crate::draw_status::DrawStatus;
use crate::engine::{Adapter, Batch, Engine, EngineError, Session};
use crate::evaluation::statistics::rows;
use crate::random::stream::DrawRange;
use crate::recipe::Recipe;

/// Number of draws of a window in f64.
const WINDOW: u64 = 1 << 15;

/// Facts about an engine.
#[derive(Clone, Debug, Serialize)]
pub struct EngineFacts {
    /// Short name.
    pub name: String,
    /// Floating-point type of its draws.
    pub precision: &'static str,
    /// Full name, with the driver.
    pub description: String,
    /// Adapter; `None` on the CPU.
    pub adapter: Option<Adapter>,
}

/// Subject of a measurement.
pub(super) struct Subject {
    pub(super) facts: EngineFacts,
    /// Engine; `None` for f64.
    engine: Option<Engine>,
}

/// Spectra one after another.
pub(super) enum Values<'a> {
    Single(&'a [f32]),
    Double(&'a [f64]),
}

impl Subject {
    pub(super) fn single(engine: Engine) -> Subject {
        let name = match engine.adapter() {
            // Drivers say much in brackets.
            Some(adapter) => adapter.name.split('(').next().unwrap_or_default().trim().to_owned(),
            None => "CPU".to_owned(),
        };
        let facts = EngineFacts {
            name: format!("{name}, f32"),
            precision: "f32",
            description: engine.to_string(),
            adapter: engine.adapter().cloned(),
        };
        Subject { facts, engine: Some(engine) }
    }

    pub(super) fn double() -> Subject {
        let facts = EngineFacts {
            name: "CPU, f64".to_owned(),
            precision: "f64",
            description: format!("CPU ({} threads), draw by draw", rayon::current_num_threads()),
            adapter: None,
        };
        Subject { facts, engine: None }
    }

    /// The engine, where draws are in f32.
    pub(super) fn engine(&self) -> Option<&Engine> {
        self.engine.as_ref()
    }

    pub(super) fn runner<'a>(&'a self, recipe: &'a Recipe) -> Result<Runner<'a>, EngineError> {
        match &self.engine {
            Some(engine) => Ok(Runner::Single(engine.session(recipe)?)),
            None => Ok(Runner::Double(Kernel::new(&recipe.program().spectra_alone()))),
        }
    }
}

/// A subject with a recipe.
pub(super) enum Runner<'a> {
    Single(Session<'a>),
    Double(Kernel<f64>),
}

impl Runner<'_> {
    /// Draws a range and hands it to `sink` in order. Returns the number of candidates that took.
    pub(super) fn draw(
        &mut self,
        bench: &Bench,
        draws: DrawRange,
        sink: &mut dyn FnMut(Values, &[DrawStatus]),
    ) -> Result<u64, ReportError> {
        match self {
            Runner::Single(session) => {
                let summary = session.draw(draws, |batch| {
                    bench.agenda.beat()?;
                    let (values, statuses) = contents(&batch);
                    sink(Values::Single(values), statuses);
                    Ok::<_, ReportError>(())
                })?;
                Ok(summary.attempts)
            }
            Runner::Double(kernel) => {
                let (mut values, mut statuses, mut attempts) = (Vec::new(), Vec::new(), 0);
                for offset in (0..draws.count).step_by(WINDOW as usize) {
                    bench.agenda.beat()?;
                    let part = draws.part(offset, WINDOW.min(draws.count - offset));
                    fill(kernel, part, &mut values, &mut statuses);
                    attempts += statuses.iter().map(|t: &DrawStatus| u64::from(t.attempts())).sum::<u64>();
                    sink(Values::Double(&values), &statuses);
                }
                Ok(attempts)
            }
        }
    }

    /// Measures the time to draw a range without further work, and the number of candidates.
    pub(super) fn time(&mut self, bench: &Bench, draws: DrawRange) -> Result<(f64, u64), ReportError> {
        let start = Instant::now();
        let attempts = self.draw(bench, draws, &mut |_, _| {})?;
        Ok((start.elapsed().as_secs_f64(), attempts))
    }

    /// Measures the time to draw a range without further work, and sums the draws.
    pub(super) fn measure<'m>(
        &mut self,
        bench: &Bench,
        draws: DrawRange,
        mut moments: Moments<'m>,
    ) -> Result<(f64, Moments<'m>), ReportError> {
        let is_double = matches!(self, Runner::Double(_));
        // Windows in f64 come one by one, so that the work between them can be told from them. An engine draws the next
        // one meanwhile: it draws twice.
        let mut seconds = if is_double { 0.0 } else { self.time(bench, draws)?.0 };
        let (start, mut summing) = (Instant::now(), Duration::ZERO);
        let attempts = self.draw(bench, draws, &mut |values, _| {
            let start = Instant::now();
            moments.add(values);
            summing += start.elapsed();
        })?;
        if is_double {
            seconds = (start.elapsed() - summing).as_secs_f64();
        }
        moments.attempts = attempts as f64;
        Ok((seconds, moments))
    }
}

/// Spectra and statuses of a batch.
fn contents<'b>(batch: &'b Batch) -> (&'b [f32], &'b [DrawStatus]) {
    debug_assert_eq!(rows(batch).count() as u64, batch.draws.count);
    (batch.spectra(), batch.statuses())
}

/// Draws in f64, on all cores.
pub(super) fn fill(
    kernel: &Kernel<f64>,
    draws: DrawRange,
    values: &mut Vec<f64>,
    statuses: &mut Vec<DrawStatus>,
) {
    let bands = kernel.width();
    values.resize(draws.count as usize * bands, 0.0);
    statuses.resize(draws.count as usize, DrawStatus::FAILED);
    let rows = values.par_chunks_exact_mut(bands).zip(statuses).enumerate();
    rows.with_min_len(256).for_each(|(i, (row, status))| {
        let (drawn, took) = kernel.draw(draws.stream, draws.first.wrapping_add(i as u64));
        row.copy_from_slice(&drawn[0]);
        *status = took;
    });
}
