//! The measurements of an adapter as rows for `docs/measurements.md`.

use std::fmt::Write;

use super::AdapterReport;
use crate::wgsl::Arithmetic;

/// Section of the page on measurements, in Markdown.
pub fn rows(report: &AdapterReport) -> String {
    let mut text = String::new();
    let mut line = |line: String| writeln!(text, "{line}").expect("a string takes all");
    let AdapterReport { adapter, date, probe, checks, bandwidth, .. } = report;
    line(format!("## {adapter}\n"));
    line(format!("Measured on {date} by `spectroll report --adapter` of version {}.\n", report.version));
    line(format!(
        "Arithmetic: {probe}. {} of {} checks of distributions raise no alarm.\n",
        checks[0], checks[1]
    ));
    line("| recipe | draws | differing, plain | exact |\n|---|---|---|---|".to_owned());
    for pair in report.twins.chunks(2) {
        let of = |form| pair.iter().find(|twin| twin.arithmetic == form).map_or(0, |twin| twin.differing);
        let (plain, exact) = (of(Arithmetic::Plain), of(Arithmetic::Exact));
        line(format!("| {} | {} | {plain} | {exact} |", pair[0].recipe, pair[0].draws));
    }
    line("\n| rate | GB/s |\n|---|---|".to_owned());
    for (name, rate) in [
        ("writing, 128 MiB", bandwidth.write),
        ("copying", bandwidth.copy),
        ("spectra on the device, plain", bandwidth.draw),
        ("spectra on the device, exact", bandwidth.draw_exact),
        ("reading back", bandwidth.readback),
        ("spectra to the host", bandwidth.draw_to_host),
    ] {
        line(format!("| {name} | {:.2} |", rate / 1e9));
    }
    let [device, host] =
        [bandwidth.share_of_writing(), bandwidth.share_of_readback()].map(|share| 100.0 * share);
    line(format!(
        "\nSpectra reach {device:.0} % of writing on the device, and {host:.0} % of reading back to the host.\n"
    ));
    line("| part of a draw | time saved without it |\n|---|---|".to_owned());
    for share in &report.costs {
        line(format!("| {} | {:.0} % |", share.part.name(), 100.0 * share.median));
    }
    line("\n| window, MiB | million draws a second |\n|---|---|".to_owned());
    for window in &report.windows {
        let rate = window.draws_per_second.map_or("-".to_owned(), |rate| format!("{:.1}", rate / 1e6));
        line(format!("| {} | {rate} |", window.mebibytes));
    }
    line("\n| threads in a workgroup | million draws a second |\n|---|---|".to_owned());
    for size in &report.workgroups {
        line(format!("| {} | {:.1} |", size.threads, size.draws_per_second / 1e6));
    }
    text
}
