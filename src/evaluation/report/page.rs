//! The report as one page of HTML: text, tables and plots, without any external resource.

use std::fmt::Write;

use super::figures::{Figure, grouped, number};
use super::{CheckRow, Effort, ModelReport, Report};
use crate::evaluation::stress::Outcome;
use crate::random::normal::radius;

const STYLE: &str = "\
body{font:16px/1.5 system-ui,sans-serif;color:#2b2f36;background:#fff;max-width:1340px;margin:2em auto;padding:0 1.5em}\
h1{font-size:1.7em;margin-bottom:.2em}h2{margin-top:2.2em;border-bottom:1px solid #d7dade;padding-bottom:.2em}\
p{max-width:52em}figure{margin:0 0 1.2em;max-width:640px}figure svg{width:100%;height:auto}\
figcaption{font-size:.92em}figcaption small{display:block;color:#5b626c;margin-top:.3em}\
.plots{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,520px),1fr));gap:1.2em}\
table{border-collapse:collapse;font-size:.9em;margin:1em 0;display:block;overflow-x:auto}\
th,td{padding:.3em .7em;text-align:right;border-bottom:1px solid #e6e8eb;vertical-align:top;\
white-space:nowrap}\
th{background:#f4f5f7;font-weight:600}td.text,th.text{text-align:left;max-width:34em;\
white-space:normal}\
.good{color:#00694e}.bad{color:#b3261e;font-weight:600}caption{text-align:left;padding:.4em 0;color:#5b626c}";

/// Writes the page, with these figures in it.
pub fn page(report: &Report, figures: &[Figure]) -> String {
    let mut html = String::new();
    let title = report.models.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
    let title = escape(&title);
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>Spectroll on {title}</title>\
         <style>{STYLE}</style></head><body>\n<h1>Spectroll on {title}</h1>\n"
    );
    html += &summary_html(report);
    for (index, model) in report.models.iter().enumerate() {
        let plots = |section| plots(figures, section, Some(index));
        let _ = write!(
            html,
            "<h1>{}</h1><p>{}s: {} bands at {} nm, {} components.</p>",
            escape(&model.name),
            model.kind,
            model.bands,
            model.grid,
            model.components
        );
        html += "<h2>1. Statistical error against run time</h2>\n\
                 <p>What a user pays for: how long until the draws say what the distribution is. The error is the root \
                 mean square distance from a reference in f64 with ten times the most draws; the reference’s own error \
                 is shown, and nothing below it can be told.</p>";
        html += &merits(report, model);
        html += &plots(1);
        html += "<h2>2. Numerical error against cost</h2>\n\
                 <p>Each draw beside the one in f64 of the same random words, so that chance plays no part. Errors are of \
                 the worst value of a draw; a flip is a draw for which rounding took another candidate.</p>";
        html += &variants(model);
        html += &functions(report, model);
        html += &plots(2);
        html += "<h2>3. Cost against difficulty</h2>\n\
                 <p>Rejection makes unlikely spectra dear. Two ways to make them unlikely: more covariance, and a target \
                 luminous reflectance near the largest that the model reaches.</p>";
        html += &plots(3);
        html += "<h2>4. Fidelity to the method</h2>\n\
                 <p>What the components explain of the data, what the Gaussian makes of them, and what rejection makes of \
                 the Gaussian.</p>";
        html += &spreads(model);
        html += &plots(4);
    }
    html += "<h1>All models</h1>\n<h2>5. Randomness</h2>";
    html += &randomness(report);
    html += &plots(figures, 5, None);
    html += "<h2>6. Stiff and extreme cases</h2>\n\
             <p>Each has one right answer: values within a bound, or a refusal with the reason. The error is relative to \
             the largest mean and deviation of a band, or to the spectrum’s peak where there is a target, unless the \
             result says otherwise.</p>";
    html += &stress(report);
    html += "</body></html>\n";
    html
}

fn summary_html(report: &Report) -> String {
    let effort = match report.effort {
        Effort::Quick => "quick",
        Effort::Usual => "usual",
        Effort::Full => "full",
    };
    let mut rows = String::new();
    for engine in &report.engines {
        let _ = write!(rows, "<li><b>{}</b>: {}</li>", escape(&engine.name), escape(&engine.description));
    }
    let verdict = report.verdict();
    let class = if verdict.is_good() { "good" } else { "bad" };
    format!(
        "<p>Spectroll {}, {}. {effort} effort, {:.0} s on {} cores, seed {}.</p><ul>{rows}</ul>\
         <p class=\"{class}\">{}</p><p>Times are of this machine as it was then: other work on it shows as spread. All \
         numbers are in report.json.</p>",
        report.version,
        report.date,
        report.seconds,
        report.cores,
        report.seed,
        escape(&verdict.to_string())
    )
}

fn plots(figures: &[Figure], section: usize, model: Option<usize>) -> String {
    let mut html = String::from("<div class=\"plots\">\n");
    for figure in figures.iter().filter(|f| f.section == section && f.model == model) {
        let _ = writeln!(
            html,
            "<figure id=\"{}\">{}<figcaption>{}<small>{}</small></figcaption></figure>",
            figure.name,
            figure.svg,
            escape(&figure.see),
            escape(&figure.facts)
        );
    }
    html + "</div>\n"
}

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

fn merits(report: &Report, model: &ModelReport) -> String {
    let best = model.convergence.merits.iter().map(|m| m.error2_seconds.value).fold(f64::INFINITY, f64::min);
    let rows = model.convergence.merits.iter().map(|m| {
        let interval = m.error2_seconds;
        vec![
            escape(&report.engines[m.engine].name),
            number(m.first_draw),
            format!("{:.1}", m.nanoseconds),
            format!("{:.3} ({:.3} to {:.3})", m.slope.value, m.slope.low, m.slope.high),
            format!("{} ({} to {})", number(interval.value), number(interval.low), number(interval.high)),
            format!("{:.2}", interval.value / best),
        ]
    });
    let draws = model.convergence.points.iter().map(|p| p.draws).max().unwrap_or(0);
    table(
        &format!(
            "Error² × time of the mean spectrum at {} draws: the one figure that does not depend on how many draws are \
             made. Half of it is half the time for the same error.",
            grouped(draws)
        ),
        &["engine", "first draw (s)", "ns a draw", "slope", "error² × time (s)", "relative to the best"],
        1,
        rows,
    )
}

fn variants(model: &ModelReport) -> String {
    let triple = |e: super::Errors| format!("{}<br>{}<br>{}", number(e.max), number(e.p999), number(e.rms));
    let rows = model.accuracy.variants.iter().map(|v| {
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
            grouped(model.accuracy.draws),
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

fn functions(report: &Report, model: &ModelReport) -> String {
    let rows = model.accuracy.functions.iter().map(|f| {
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

fn spreads(model: &ModelReport) -> String {
    let weights: Vec<String> = (1..=model.components).map(|j| format!("weight {j}")).collect();
    let head: Vec<&str> = ["of", "spectra"]
        .into_iter()
        .chain(weights.iter().map(String::as_str))
        .chain(["largest correlation"])
        .collect();
    let rows = model.fidelity.spreads.iter().map(|s| {
        let count = s.count.map_or("formula".to_owned(), grouped);
        let deviations = s.deviations.iter().map(|d| format!("{d:.4}"));
        [s.name.clone(), count].into_iter().chain(deviations).chain([number(s.correlation)]).collect()
    });
    table("Standard deviations of the weights.", &head, 1, rows)
}

fn randomness(report: &Report) -> String {
    let randomness = &report.randomness;
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
    html += &checks(report);
    html
}

/// Writes the checks of draws, a row for each scenario and check, a column for each engine.
fn checks(report: &Report) -> String {
    let randomness = &report.randomness;
    let mut engines: Vec<usize> = randomness.checks.iter().map(|c| c.engine).collect();
    engines.sort_unstable();
    engines.dedup();
    let names: Vec<String> =
        engines.iter().map(|&e| format!("{}: p", escape(&report.engines[e].name))).collect();
    let head =
        ["draws of", "check", "compares", "comparisons"].into_iter().chain(names.iter().map(String::as_str));
    let first = randomness.checks.iter().filter(|c| c.engine == engines[0]);
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
            smallest(report)
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
fn smallest(report: &Report) -> String {
    let Some(s) = report.randomness.smallest else { return String::new() };
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

fn stress(report: &Report) -> String {
    let Some(first) = report.stress.first() else { return String::new() };
    let mut head = vec!["case", "what could break", "result"];
    let names: Vec<String> = report
        .stress
        .iter()
        .flat_map(|run| {
            let name = &report.engines[run.engine].name;
            [format!("{name}: error (bound)"), format!("{name}: time (s)")]
        })
        .collect();
    head.extend(names.iter().map(String::as_str));
    let rows = first.outcomes.iter().enumerate().map(|(i, outcome)| {
        let all = || report.stress.iter().map(|run| &run.outcomes[i]);
        let wrong = all().find(|o| !o.passed).unwrap_or(outcome);
        let class = if wrong.passed { "good" } else { "bad" };
        let cells = all().flat_map(|o| [error(o), format!("{:.2}", o.seconds)]);
        let texts = [
            powers(outcome.name),
            powers(outcome.could_break),
            format!("<span class=\"{class}\">{}</span>", powers(&wrong.result)),
        ];
        texts.into_iter().chain(cells).collect()
    });
    let left_out = match report.effort {
        Effort::Quick => " In a quick report only the CPU runs them.",
        _ => "",
    };
    table(&format!("{} cases.{left_out}", first.outcomes.len()), &head, 3, rows)
}

fn error(outcome: &Outcome) -> String {
    match (outcome.error, outcome.bound) {
        (Some(error), Some(bound)) => format!("{} ({bound:.0e})", number(error)),
        _ => "–".to_owned(),
    }
}

fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Raises the powers in a text: 10^-9.
fn powers(text: &str) -> String {
    let text = escape(text);
    let mut parts = text.split('^');
    let mut html = parts.next().unwrap_or_default().to_owned();
    for part in parts {
        let end = part.find(|c: char| !(c.is_ascii_digit() || c == '-')).unwrap_or(part.len());
        let (exponent, rest) = part.split_at(end);
        let _ = write!(html, "<sup>{}</sup>{rest}", exponent.replace('-', "−"));
    }
    html
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_raised_and_markup_is_text() {
        assert_eq!(powers("10^-9 < 2^32, k"), "10<sup>−9</sup> &lt; 2<sup>32</sup>, k");
    }
}
