//! Tables of the page, and the sentences that go with them.

use std::fmt::Write;

use super::figures::times_text;
use super::format::{duration, number};
use super::page::{escape, powers};
use super::{
    Accuracy, CheckRow, Convergence, DataComparison, Errors, Fidelity, Quartiles, Randomness, Report, Stop,
    StressRun,
};
use crate::dataset::SpectrumKind;
use crate::evaluation::comparison::{Departure, WeightFigures};
use crate::evaluation::stress::Outcome;
use crate::random::normal::radius;
use crate::wording::grouped;

/// Writes a table. The first `texts` columns are text.
fn table(caption: &str, head: &[&str], texts: usize, rows: impl IntoIterator<Item = Vec<String>>) -> String {
    let class = |i: usize| if i < texts { " class=\"text\"" } else { "" };
    let mut html = format!("<table><caption>{caption}</caption><tr>");
    for (i, cell) in head.iter().enumerate() {
        let _ = write!(html, "<th{}>{cell}</th>", class(i));
    }
    html += "</tr>\n";
    for row in rows {
        html += "<tr>";
        for (i, cell) in row.iter().enumerate() {
            let _ = write!(html, "<td{}>{cell}</td>", class(i));
        }
        html += "</tr>\n";
    }
    html + "</table>\n"
}

/// Writes the sections with the time that they may take and took.
pub(super) fn sections(report: &Report) -> String {
    let rows = report.sections.iter().map(|section| {
        let seconds = section.seconds.map_or("<span class=\"bad\">missing</span>".to_owned(), duration);
        vec![escape(&section.name()), duration(section.budget), seconds]
    });
    table(
        "Time by section. A section ends before its time is over where its answer stands, and after it where something \
         cannot be divided.",
        &["section", "time it may take", "time it took"],
        1,
        rows,
    )
}

pub(super) fn merits(report: &Report, convergence: &Convergence) -> String {
    let rows = convergence.curves.iter().map(|curve| {
        let merit = curve.merit;
        let product = merit.error2_seconds;
        let last = curve.points.last().map_or(0, |p| p.draws);
        vec![
            escape(report.source_name(convergence, curve.source)),
            number(merit.first_draw),
            grouped(last),
            quartiles(merit.nanoseconds, |ns| format!("{ns:.1}")),
            quartiles(merit.relative_time, times_text),
            format!("{:.3} ({:.3} to {:.3})", merit.slope.value, merit.slope.low, merit.slope.high),
            format!("{} ({} to {})", number(product.value), number(product.low), number(product.high)),
        ]
    });
    let first = convergence.curves.first().map_or("", |curve| report.source_name(convergence, curve.source));
    table(
        &format!(
            "The time for the same error is relative to {}, as the ratio of times of the same turns at the largest number of \
             draws that both made. Error² × time of the mean spectrum is the one figure that does not depend on how many \
             draws are made: half of it is half the time for the same error. Times have their quartiles in brackets, slopes \
             and products their 95 % intervals.",
            escape(first)
        ),
        &[
            "draws by",
            "first draw (s)",
            "most draws",
            "ns a draw",
            "time for the same error",
            "slope",
            "error² × time (s)",
        ],
        1,
        rows,
    )
}

/// Says by which rule the replicates grew, and what came of it.
pub(super) fn rule(convergence: &Convergence) -> String {
    let (rule, reference) = (convergence.rule, &convergence.reference);
    let stop = match convergence.stop {
        Stop::Narrow => "All are: no more were needed.",
        Stop::Time => "Not all are: the time of the section was over.",
    };
    format!(
        "<p>At least {} replicates of each number of draws up to {}, in runs of up to {}, then more until the 95 % interval of \
         each error of the mean spectrum is narrower than {:.0} % of it, and that of each slope narrower than {}. {stop} The reference: \
         {} draws in f32, corrected by {} draws of the same words in f64, which moves the mean spectrum by {} ± {} (root mean \
         square). Its own error is {}.</p>",
        rule.least_replicates,
        grouped(rule.most_draws),
        duration(rule.longest_run),
        100.0 * rule.error_width,
        rule.slope_width,
        grouped(reference.draws),
        grouped(reference.exact_draws),
        number(reference.correction),
        number(reference.correction_error),
        number(reference.errors[0]),
    )
}

fn quartiles(of: Quartiles, text: impl Fn(f64) -> String) -> String {
    format!("{} ({} to {})", text(of.median), text(of.low), text(of.high))
}

pub(super) fn variants(accuracy: &Accuracy) -> String {
    let triple = |e: Errors| format!("{}<br>{}<br>{}", number(e.max), number(e.p999), number(e.rms));
    let rows = accuracy.variants.iter().map(|v| {
        vec![
            escape(&v.name),
            v.nanoseconds.map_or("–".to_owned(), |ns| format!("{ns:.1}")),
            v.bytes.to_string(),
            number(v.flips_per_million),
            triple(v.spectra),
            triple(v.ulps),
            triple(v.weights),
            triple(v.luminance),
            triple(v.xyz),
            format!("{} ± {}", number(v.bias), number(v.bias_error)),
        ]
    });
    table(
        &format!(
            "{} draws. In each cell: the largest, what one draw in a thousand exceeds, the root mean square. Units in the \
             last place are of the value itself, and many where a value is close to 0; the absolute error is what a user \
             sees. Only engines have a cost: the variants are made one draw at a time. Besides, normals of 24-bit uniforms \
             end at {:.2} deviations, ours at {:.2}.",
            grouped(accuracy.draws),
            radius(0x80),
            radius(0)
        ),
        &[
            "draws",
            "ns a draw",
            "bytes a value",
            "flips per million",
            "spectrum",
            "units in the last place",
            "weights",
            "luminance",
            "XYZ",
            "bias of a band",
        ],
        1,
        rows,
    )
}

pub(super) fn functions(report: &Report, accuracy: &Accuracy) -> String {
    let rows = accuracy.functions.iter().map(|f| {
        vec![
            escape(&report.engines[f.engine].name),
            f.name.to_owned(),
            format!("{:.2}", f.nanoseconds),
            number(f.radius),
            number(f.circle),
            number(f.normal),
            number(f.spectrum),
            number(f.flips_per_million),
        ]
    });
    table(
        "The functions of Box-Muller alone, all else in f64: largest errors. A flip is a candidate that is accepted and \
         should not be, or the other way round.",
        &[
            "engine",
            "functions",
            "ns for two normals",
            "radius",
            "sine, cosine",
            "normal",
            "spectrum",
            "flips per million",
        ],
        2,
        rows,
    )
}

pub(super) fn spreads(fidelity: &Fidelity, components: usize) -> String {
    let weights: Vec<String> = (1..=components).map(|j| format!("weight {j}")).collect();
    let head: Vec<&str> = ["of", "spectra"]
        .into_iter()
        .chain(weights.iter().map(String::as_str))
        .chain(["largest correlation"])
        .collect();
    let rows = fidelity.spreads.iter().map(|s| {
        let count = s.count.map_or("formula".to_owned(), grouped);
        let deviations = s.deviations.iter().map(|d| format!("{d:.4}"));
        [s.name.clone(), count].into_iter().chain(deviations).chain([number(s.correlation)]).collect()
    });
    table("Standard deviations of the weights.", &head, 1, rows)
}

/// Writes a table of draws beside the data.
pub(super) fn data(fidelity: &Fidelity, kind: SpectrumKind) -> String {
    let Some(DataComparison { sources, figures }) = &fidelity.data else { return String::new() };
    let weights =
        figures.weights.iter().enumerate().flat_map(|(i, WeightFigures { measured, candidates, drawn })| {
            let row = |name: &str, of: &Departure| {
                vec![
                    (i + 1).to_string(),
                    name.to_owned(),
                    format!("{:.3}", of.mean_shift),
                    format!("{:.3}", of.sd_ratio),
                    format!("{:.2}", measured.skewness),
                    format!("{:.2}", of.moments.skewness),
                    format!("{:.3}", of.distance),
                    if of.p_value < 1e-9 { "&lt; 10<sup>−9</sup>".to_owned() } else { number(of.p_value) },
                ]
            };
            [row("candidates", candidates), row("draws", drawn)]
        });
    let (shift, nm) = figures.drawn.mean_spectrum_shift;
    let ratio = match [figures.candidates, figures.drawn].map(|figures| figures.determinant_ratio) {
        [Some(candidates), Some(drawn)] => format!(
            " The determinant of the covariance is {:.1} % of the data’s before rejection, and {:.1} % of draws.",
            100.0 * candidates,
            100.0 * drawn
        ),
        _ => String::new(),
    };
    let html = table(
        &format!(
            "Weights of {} draws, and of as many candidates before any is rejected, beside those of the {} spectra of the \
             data ({}). The mean spectrum of draws is off by {:.3} at {nm} nm.{ratio}",
            grouped(figures.draws as u64),
            grouped(figures.spectra as u64),
            sources.join(", "),
            shift.abs()
        ),
        &[
            "weight",
            "of",
            "shift of the mean, in standard deviations of the data",
            "deviation ÷ the data’s",
            "skewness of the data",
            "skewness",
            "Kolmogorov-Smirnov distance",
            "p",
        ],
        2,
        weights,
    );
    let under = match kind {
        SpectrumKind::Reflectance => "under D65",
        SpectrumKind::Illuminant => "of the lights",
    };
    let colours = figures.colours.iter().map(|colour| {
        let name = if colour.name == "lrv" { "LRV" } else { colour.name };
        let moments = [colour.measured, colour.candidates, colour.drawn].into_iter();
        let values = moments.map(|m| format!("{:.4} ± {:.4}", m.mean, m.sd));
        std::iter::once(name.to_owned()).chain(values).collect()
    });
    let head = ["", "data", "candidates", "draws"];
    html + &table(
        &format!("Chromaticity and luminous reflectance (CIE 1931), {under}: means and standard deviations."),
        &head,
        1,
        colours,
    )
}

pub(super) fn randomness(report: &Report, randomness: &Randomness) -> String {
    let mut html = format!(
        "<p>The generator gives {} of {} known answers of Random123. ",
        randomness.known_answers[0], randomness.known_answers[1]
    );
    for (engine, same, all) in &randomness.same_bits {
        let _ = write!(
            html,
            "{} of {} draws of {} have the bits of the CPU’s in f32. ",
            grouped(*same),
            grouped(*all),
            escape(&report.engines[*engine].name)
        );
    }
    html += "</p>";
    let groups = randomness.groups.iter().map(|g| {
        let smallest = g.p_values.iter().copied().fold(1.0, f64::min);
        let below = g.p_values.iter().filter(|&&p| p < 0.05).count();
        vec![
            g.name.to_owned(),
            g.p_values.len().to_string(),
            number(smallest),
            number((smallest * g.p_values.len() as f64).min(1.0)),
            format!("{:.1} %", 100.0 * below as f64 / g.p_values.len() as f64),
        ]
    });
    html += &table(
        &format!(
            "The generator’s normals in f32: {} draws of each of {} seeds.",
            grouped(randomness.draws),
            randomness.seeds
        ),
        &["comparison", "number", "smallest p", "times their number", "p below 0.05"],
        1,
        groups,
    );
    html += &checks(report, randomness);
    html
}

/// Writes the checks of draws, a row for each scenario and check, a column for each engine.
fn checks(report: &Report, randomness: &Randomness) -> String {
    let mut engines: Vec<usize> = randomness.checks.iter().map(|c| c.engine).collect();
    engines.sort_unstable();
    engines.dedup();
    let names: Vec<String> =
        engines.iter().map(|&e| format!("{}: p", escape(&report.engines[e].name))).collect();
    let head =
        ["draws of", "check", "compares", "comparisons"].into_iter().chain(names.iter().map(String::as_str));
    let first = randomness.checks.iter().filter(|c| Some(&c.engine) == engines.first());
    let rows = first.map(|c| {
        let cells = engines.iter().map(|&engine| {
            let same = |other: &&CheckRow| {
                (other.engine, &other.scenario, other.check) == (engine, &c.scenario, c.check)
            };
            randomness.checks.iter().find(same).map_or(String::new(), verdict)
        });
        let texts = [escape(&c.scenario), c.check.to_owned(), powers(c.compares), c.comparisons.to_string()];
        texts.into_iter().chain(cells).collect()
    });
    table(
        &format!(
            "Draws beside those of an independent sampler: {} draws each. A check of sound draws raises a false alarm once \
             in {} times; p is the probability that they look as bad in any of the comparisons. A check without \
             comparisons leaves nothing to chance.{}",
            grouped(randomness.check_draws),
            number(1.0 / randomness.false_alarms),
            smallest(randomness)
        ),
        &head.collect::<Vec<_>>(),
        3,
        rows,
    )
}

fn verdict(check: &CheckRow) -> String {
    match &check.alarm {
        Some(alarm) => format!("<span class=\"bad\">{}</span>", escape(alarm)),
        None if check.comparisons > 0 => number(check.p),
        None => "<span class=\"good\">sound</span>".to_owned(),
    }
}

/// Writes the smallest errors that the checks see.
fn smallest(randomness: &Randomness) -> String {
    let Some(s) = randomness.smallest else { return String::new() };
    format!(
        " The smallest errors that they see, in all but one of 1,000 cases: {:.1} % of the acceptance, {:.3} standard \
         deviations of a mean, {:.3} of a correlation, {:.1} % of a variance, {:.3} of a distribution function ({:.3} where \
         there is a formula), {:.3} of a correlation of neighbours or streams.",
        100.0 * s.acceptance,
        s.mean,
        s.correlation,
        100.0 * s.variance,
        s.distribution,
        s.gaussian,
        s.independence
    )
}

pub(super) fn stress(report: &Report, runs: &[StressRun]) -> String {
    let mut head = vec!["case", "what could break", "result"];
    let name = |run: &StressRun| &report.engines[run.engine].name;
    let columns =
        runs.iter().flat_map(|run| ["error (bound)", "time (s)"].map(|of| format!("{}: {of}", name(run))));
    let columns: Vec<String> = columns.map(|column| escape(&column)).collect();
    head.extend(columns.iter().map(String::as_str));
    // All run the same cases in the same order, some fewer of them.
    let Some(longest) = runs.iter().max_by_key(|run| run.outcomes.len()) else { return String::new() };
    let rows = longest.outcomes.iter().enumerate().map(|(i, outcome)| {
        let wrong = runs.iter().filter_map(|run| run.outcomes.get(i)).find(|o| !o.passed).unwrap_or(outcome);
        let class = if wrong.passed { "good" } else { "bad" };
        let cells = runs.iter().flat_map(|run| match run.outcomes.get(i) {
            Some(outcome) => [error(outcome), format!("{:.2}", outcome.seconds)],
            None => ["not run", ""].map(str::to_owned),
        });
        let texts = [
            powers(outcome.name),
            powers(outcome.could_break),
            format!("<span class=\"{class}\">{}</span>", powers(&wrong.result)),
        ];
        texts.into_iter().chain(cells).collect()
    });
    let fewer = runs.iter().filter(|run| run.outcomes.len() < run.cases);
    let fewer =
        fewer.map(|run| format!(" The time sufficed for {} by {}.", run.outcomes.len(), escape(name(run))));
    table(&format!("{} cases.{}", longest.cases, fewer.collect::<String>()), &head, 3, rows)
}

fn error(outcome: &Outcome) -> String {
    match (outcome.error, outcome.bound) {
        (Some(error), Some(bound)) => format!("{} ({bound:.0e})", number(error)),
        _ => "–".to_owned(),
    }
}
