//! Stiff and extreme cases, each with a definite right answer: values within a stated bound, or an error of a stated
//! kind. None may hang, give what is not a number, or give a spectrum that is not physical.
//!
//! Tests demand every answer, and the report shows them for its user's adapter. Values are judged against the draw in
//! f64 from the same words, relative to the largest terms that they are made of, because that is what f32 rounds.

mod bounds;
mod counters;
mod examine;
mod fits;
mod models;

use std::time::Instant;

use serde::Serialize;

use crate::engine::Engine;

/// A case, to be run on an engine.
#[derive(Clone, Copy, Debug)]
pub struct Case {
    /// Description of what is stiff or extreme.
    pub name: &'static str,
    /// Description of what could break.
    pub could_break: &'static str,
    run: fn(&Engine) -> Answer,
}

/// Answer of a case, or a description of what is wrong.
type Answer = Result<Good, String>;

/// A right answer.
#[derive(Debug, Default)]
struct Good {
    result: String,
    /// The largest error found, and its bound.
    error: Option<(f64, f64)>,
}

/// Outcome of a case.
#[derive(Clone, Debug, Serialize)]
pub struct Outcome {
    /// Description of what is stiff or extreme.
    pub name: &'static str,
    /// Description of what could break.
    pub could_break: &'static str,
    /// Whether the answer is the right one.
    pub passed: bool,
    /// The answer in words.
    pub result: String,
    /// The largest error found, where there are values: relative to the largest mean and deviation of a band, or to
    /// the spectrum's peak where there is a target LRV, unless `result` says otherwise.
    pub error: Option<f64>,
    /// Bound on the error.
    pub bound: Option<f64>,
    /// Duration, seconds.
    pub seconds: f64,
}

/// Every case.
pub fn cases() -> impl Iterator<Item = &'static Case> {
    [models::CASES, fits::CASES, bounds::CASES, counters::CASES].into_iter().flatten()
}

impl Case {
    /// Runs the case.
    pub fn run(&self, engine: &Engine) -> Outcome {
        let start = Instant::now();
        let answer = (self.run)(engine);
        let seconds = start.elapsed().as_secs_f64();
        let (answer, wrong) = match answer {
            Ok(good) => (good, false),
            Err(result) => (Good { result, error: None }, true),
        };
        Outcome {
            name: self.name,
            could_break: self.could_break,
            passed: !wrong && answer.error.is_none_or(|(error, bound)| error <= bound),
            result: answer.result,
            error: answer.error.map(|(error, _)| error),
            bound: answer.error.map(|(_, bound)| bound),
            seconds,
        }
    }
}

const fn case(name: &'static str, could_break: &'static str, run: fn(&Engine) -> Answer) -> Case {
    Case { name, could_break, run }
}

/// An answer without values.
fn good(result: impl Into<String>) -> Answer {
    Ok(Good { result: result.into(), error: None })
}

/// An answer with the largest error and its bound.
fn within(result: impl Into<String>, error: f64, bound: f64) -> Answer {
    Ok(Good { result: result.into(), error: Some((error, bound)) })
}
