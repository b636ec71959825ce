//! The outcome in a few lines: for a terminal, and for the head of the page.

use std::fmt::{self, Write};

use serde::Serialize;

use super::Report;
use super::figures::number;

/// Counts of right answers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Stiff and extreme cases with their right answer, and all.
    pub cases: [usize; 2],
    /// Checks of distributions that raise no alarm, and all.
    pub checks: [usize; 2],
    /// Known answers of the generator, and all.
    pub answers: [usize; 2],
}

impl Verdict {
    /// Whether all answers are right.
    pub fn is_good(&self) -> bool {
        [self.cases, self.checks, self.answers].iter().all(|[good, all]| good == all)
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let [cases, checks, answers] = [self.cases, self.checks, self.answers];
        write!(
            f,
            "{} of {} stiff and extreme cases have their right answer; {} of {} checks of distributions raise no alarm; \
             {} of {} known answers of the generator",
            cases[0], cases[1], checks[0], checks[1], answers[0], answers[1]
        )
    }
}

impl Report {
    /// Counts the right answers.
    pub fn verdict(&self) -> Verdict {
        let outcomes = || self.stress.iter().flat_map(|run| &run.outcomes);
        let checks = &self.randomness.checks;
        Verdict {
            cases: [outcomes().filter(|o| o.passed).count(), outcomes().count()],
            checks: [checks.iter().filter(|c| c.alarm.is_none()).count(), checks.len()],
            answers: self.randomness.known_answers,
        }
    }

    /// Writes the outcome in a few lines for a terminal.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        for model in &self.models {
            let _ = writeln!(text, "{}: {} bands, {} components", model.name, model.bands, model.components);
            for merit in &model.convergence.merits {
                let _ = writeln!(
                    text,
                    "  {:<24} {:>8.1} ns a draw, error² × time {} (slope {:.3})",
                    self.engines[merit.engine].name,
                    merit.nanoseconds,
                    number(merit.error2_seconds.value),
                    merit.slope.value
                );
            }
            for variant in &model.accuracy.variants {
                let _ = writeln!(
                    text,
                    "  {:<42} error {} at most, {} flips per million",
                    variant.name,
                    number(variant.spectra.max),
                    number(variant.flips_per_million)
                );
            }
        }
        let _ = writeln!(text, "{}", self.verdict());
        for outcome in self.stress.iter().flat_map(|run| &run.outcomes).filter(|o| !o.passed) {
            let _ = writeln!(text, "WRONG: {}: {}", outcome.name, outcome.result);
        }
        for check in self.randomness.checks.iter().filter(|c| c.alarm.is_some()) {
            let alarm = check.alarm.as_deref().unwrap_or_default();
            let _ = writeln!(text, "ALARM: {}, {}: {alarm}", check.scenario, check.check);
        }
        text
    }
}
