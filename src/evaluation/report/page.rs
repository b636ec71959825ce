//! The report as one page of HTML: text, tables and plots, without any external resource.

use std::fmt::Write;

use super::figures::Figure;
use super::tables;
use super::{Effort, ModelReport, Report, Section};

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
.unfinished{border:2px solid #b3261e;padding:0 1em;margin:1em 0;color:#b3261e}\
.good{color:#00694e}.bad{color:#b3261e;font-weight:600}caption{text-align:left;padding:.4em 0;color:#5b626c}";

/// Writes the page, with these figures in it. Sections that were not measured are not on it.
pub fn page(report: &Report, figures: &[Figure]) -> String {
    let mut html = String::new();
    let title = report.models.iter().map(|m| m.name.as_str()).collect::<Vec<_>>().join(", ");
    let mark = if report.finished { "" } else { "UNFINISHED: " };
    let title = format!("{mark}Spectroll on {}", escape(&title));
    let _ = write!(
        html,
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\">\
         <meta name=\"viewport\" content=\"width=device-width\"><title>{title}</title>\
         <style>{STYLE}</style></head><body>\n<h1>{title}</h1>\n"
    );
    html += &unfinished(report);
    html += &summary_html(report);
    html += &tables::sections(report);
    for (index, model) in report.models.iter().enumerate() {
        let sections = model_sections(report, model);
        if sections.is_empty() {
            continue;
        }
        let _ = write!(
            html,
            "<h1>{}</h1><p>{}s: {} bands at {} nm, {} components.</p>",
            escape(&model.name),
            model.kind,
            model.bands,
            model.grid,
            model.components
        );
        for (section, text) in sections {
            html += &heading(section);
            html += &text;
            html += &plots(figures, section, Some(index));
        }
    }
    let sections = shared_sections(report);
    if !sections.is_empty() {
        html += "<h1>All models</h1>";
    }
    for (section, text) in sections {
        html += &heading(section);
        html += &text;
        html += &plots(figures, section, None);
    }
    html += "</body></html>\n";
    html
}

/// Says that a report is unfinished, and what it lacks.
fn unfinished(report: &Report) -> String {
    if report.finished {
        return String::new();
    }
    let missing: String = report.missing.iter().map(|name| format!("<li>{}</li>", escape(name))).collect();
    format!(
        "<div class=\"unfinished\"><p><b>UNFINISHED.</b> The measurements were interrupted. These sections are \
         missing:</p><ul>{missing}</ul></div>\n"
    )
}

fn heading(section: Section) -> String {
    format!("<h2>{}. {}</h2>\n", section.number(), section.title())
}

/// Text and tables of the sections of a model that were measured.
fn model_sections(report: &Report, model: &ModelReport) -> Vec<(Section, String)> {
    let mut all = Vec::new();
    if let Some(measured) = &model.convergence {
        let text = "<p>What a user pays for: how long until the draws say what the distribution is. The error is the root \
                    mean square distance from a reference whose own error is a fifth of the smallest one expected. That \
                    is shown, and nothing below it can be told.</p>";
        let tables = tables::merits(report, measured) + &tables::rule(measured);
        all.push((Section::Convergence, text.to_owned() + &tables));
    }
    if let Some(measured) = &model.accuracy {
        let text = "<p>Each draw beside the one in f64 of the same random words, so that chance plays no part. Errors are \
                    of the worst value of a draw; a flip is a draw for which rounding took another candidate.</p>";
        let tables = tables::variants(measured) + &tables::functions(report, measured);
        all.push((Section::Accuracy, text.to_owned() + &tables));
    }
    if model.difficulty.is_some() {
        let text = "<p>Rejection makes unlikely spectra dear. Two ways to make them unlikely: more covariance, and a target \
                    luminous reflectance near the largest that the model reaches.</p>";
        all.push((Section::Difficulty, text.to_owned()));
    }
    if let Some(measured) = &model.fidelity {
        let text = "<p>What the components explain of the data, what the Gaussian makes of them, what rejection makes of \
                    the Gaussian, and how far the draws that are left are from the data.</p>";
        let tables = tables::spreads(measured, model.components) + &tables::data(measured, model.kind);
        all.push((Section::Fidelity, text.to_owned() + &tables));
    }
    all
}

/// Text and tables of the sections of all models that were measured.
fn shared_sections(report: &Report) -> Vec<(Section, String)> {
    let mut all = Vec::new();
    if let Some(measured) = &report.randomness {
        all.push((Section::Randomness, tables::randomness(report, measured)));
    }
    if let Some(measured) = &report.stress {
        let text = "<p>Each has one right answer: values within a bound, or a refusal with the reason. The error is \
                    relative to the largest mean and deviation of a band, or to the spectrum’s peak where there is a target, \
                    unless the result says otherwise.</p>";
        all.push((Section::Stress, text.to_owned() + &tables::stress(report, measured)));
    }
    all
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
    // The peers are the same for all models.
    let convergence = report.models.iter().find_map(|model| model.convergence.as_ref());
    for peer in convergence.iter().flat_map(|measured| &measured.peers) {
        let _ = write!(rows, "<li><b>{}</b>: {}</li>", escape(&peer.name), escape(&peer.description()));
    }
    for missing in convergence.iter().flat_map(|measured| &measured.missing_peers) {
        let _ = write!(rows, "<li>left out: {}</li>", escape(missing));
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

fn plots(figures: &[Figure], section: Section, model: Option<usize>) -> String {
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

pub(super) fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Raises the powers in a text: 10^-9.
pub(super) fn powers(text: &str) -> String {
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
