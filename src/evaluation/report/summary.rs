//! The outcome in a few lines: for a terminal, and for the head of the page.

use std::fmt::{self, Write};

use serde::Serialize;

use super::Report;
use super::figures::times_text;
use super::format::number;

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
    /// Counts what was judged.
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        let parts = [
            (self.cases, "stiff and extreme cases have their right answer"),
            (self.checks, "checks of distributions raise no alarm"),
            (self.answers, "known answers of the generator"),
        ];
        let judged = parts.iter().filter(|([_, all], _)| *all > 0);
        let told: Vec<_> = judged.map(|([good, all], what)| format!("{good} of {all} {what}")).collect();
        if told.is_empty() { write!(f, "no answers were judged") } else { write!(f, "{}", told.join("; ")) }
    }
}

impl Report {
    /// Counts the right answers among all that were judged.
    pub fn verdict(&self) -> Verdict {
        let outcomes = || self.stress.iter().flatten().flat_map(|run| &run.outcomes);
        let checks = || self.randomness.iter().flat_map(|randomness| &randomness.checks);
        Verdict {
            cases: [outcomes().filter(|o| o.passed).count(), outcomes().count()],
            checks: [checks().filter(|c| c.alarm.is_none()).count(), checks().count()],
            answers: self.randomness.as_ref().map_or([0, 0], |randomness| randomness.known_answers),
        }
    }

    /// Number of sections that were measured, and of all.
    pub fn measured(&self) -> [usize; 2] {
        [self.sections.len() - self.missing.len(), self.sections.len()]
    }

    /// Writes the outcome in a few lines for a terminal.
    pub fn summary(&self) -> String {
        let mut text = String::new();
        for model in &self.models {
            let _ = writeln!(text, "{}: {} bands, {} components", model.name, model.bands, model.components);
            if let Some(measured) = &model.convergence {
                for curve in &measured.curves {
                    let merit = curve.merit;
                    let _ = writeln!(
                        text,
                        "  {:<24} {:>8.1} ns a draw, {:>5} times as long for the same error (slope {:.3})",
                        self.source_name(measured, curve.source),
                        merit.nanoseconds.median,
                        times_text(merit.relative_time.median),
                        merit.slope.value
                    );
                }
                for missing in &measured.missing_peers {
                    let _ = writeln!(text, "  left out: {missing}");
                }
            }
            for variant in model.accuracy.iter().flat_map(|accuracy| &accuracy.variants) {
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
        for outcome in self.stress.iter().flatten().flat_map(|run| &run.outcomes).filter(|o| !o.passed) {
            let _ = writeln!(text, "WRONG: {}: {}", outcome.name, outcome.result);
        }
        let checks = self.randomness.iter().flat_map(|randomness| &randomness.checks);
        for check in checks.filter(|c| c.alarm.is_some()) {
            let alarm = check.alarm.as_deref().unwrap_or_default();
            let _ = writeln!(text, "ALARM: {}, {}: {alarm}", check.scenario, check.check);
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_judged_answers_are_counted() {
        let none = Verdict { cases: [0, 0], checks: [0, 0], answers: [0, 0] };
        assert_eq!(none.to_string(), "no answers were judged");
        let some = Verdict { answers: [3, 3], ..none };
        assert_eq!(some.to_string(), "3 of 3 known answers of the generator");
        assert!(some.is_good() && !Verdict { cases: [1, 2], ..some }.is_good());
    }
}
