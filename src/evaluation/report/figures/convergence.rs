//! Figures of the error against run time.

use super::super::chart::{Axis, COLOURS, Chart, GUIDE, Series, Style};
use super::super::format::number;
use super::super::{Convergence, Curve, Point, Section, Source};
use super::{Drawing, Figure};
use crate::wording::grouped;

/// Quantities whose errors are plotted.
const QUANTITIES: [(&str, &str); 3] =
    [("mean spectrum", ""), ("covariance", " (relative to it)"), ("acceptance", "")];

pub(super) fn figures(drawing: &Drawing, convergence: &Convergence) -> Vec<Figure> {
    let errors = Errors { drawing, convergence };
    // Where nothing is rejected the acceptance has no error, and a logarithm none of that.
    let has_error = |quantity: &usize| errors.points().any(|p| p.errors[*quantity].value > 0.0);
    let against_time = (0..QUANTITIES.len()).filter(has_error).map(|quantity| errors.against_time(quantity));
    against_time.chain([errors.beside_theory()]).collect()
}

struct Errors<'a> {
    drawing: &'a Drawing<'a>,
    convergence: &'a Convergence,
}

impl Errors<'_> {
    fn points(&self) -> impl Iterator<Item = &Point> {
        self.convergence.curves.iter().flat_map(|curve| &curve.points)
    }

    fn name(&self, curve: &Curve) -> &str {
        self.drawing.report.source_name(self.convergence, curve.source)
    }

    fn colour(&self, curve: &Curve) -> &'static str {
        let index = match curve.source {
            Source::Engine(index) => index,
            Source::Peer(index) => self.drawing.report.engines.len() + index,
        };
        COLOURS[index % COLOURS.len()]
    }

    /// The name in a key, with the time that the same error takes.
    fn key(&self, curve: &Curve) -> String {
        let times = curve.merit.relative_time.median;
        match std::ptr::eq(curve, &self.convergence.curves[0]) {
            true => self.name(curve).to_owned(),
            false => format!("{}: {} × the time", self.name(curve), times_text(times)),
        }
    }

    fn against_time(&self, quantity: usize) -> Figure {
        let (what, unit) = QUANTITIES[quantity];
        let convergence = self.convergence;
        let (mut lines, mut bars) = (Vec::new(), Vec::new());
        for curve in &convergence.curves {
            let colour = self.colour(curve);
            let points: Vec<&Point> =
                curve.points.iter().filter(|p| p.errors[quantity].value > 0.0).collect();
            let (Some(first), Some(last)) = (points.first(), points.last()) else { continue };
            let (seconds, error) = (last.seconds.median, last.errors[quantity].value);
            let guide = [first.seconds.median, seconds].map(|t| (t, error * (seconds / t).sqrt()));
            lines.push(Series::new("", colour, Style::Dashed, guide.to_vec()));
            let line = points.iter().map(|p| (p.seconds.median, p.errors[quantity].value)).collect();
            lines.push(Series::new(&self.key(curve), colour, Style::Line, line));
            for p in &points {
                let (error, seconds) = (p.errors[quantity], p.seconds);
                let low = if error.low > 0.0 { error.low } else { error.value };
                let across = vec![(seconds.low, error.value), (seconds.high, error.value)];
                let along = vec![(seconds.median, low), (seconds.median, error.high)];
                bars.extend([across, along].map(|bar| Series::new("", colour, Style::Bar, bar)));
            }
        }
        let mut series = vec![Series::new("slope −½", GUIDE, Style::Dashed, Vec::new())];
        series.extend(bars);
        series.extend(lines);
        let values: Vec<_> = series.iter().flat_map(|s| s.points.iter()).copied().collect();
        let (low, high) = values.iter().fold((f64::INFINITY, 0f64), |(a, b), p| (a.min(p.0), b.max(p.0)));
        let own = convergence.reference.errors[quantity];
        series.push(Series::new(
            "error of the reference",
            GUIDE,
            Style::Dotted,
            vec![(low, own), (high, own)],
        ));
        let chart = Chart {
            title: format!("Error of the {what} against run time"),
            x: Axis::decades("run time (s)", values.iter().map(|p| p.0)),
            y: Axis::decades(
                &format!("root mean square error{unit}"),
                values.iter().map(|p| p.1).chain([own]),
            ),
            series,
        };
        let see = match quantity {
            0 => format!(
                "The farther left a curve, the sooner its user has the same error. {}An error of chance falls as one over the \
                 root of the time: along the broken lines of slope −½, once starting up no longer counts. All engines draw \
                 from the same words, so their errors are equal and only their times differ.{}",
                self.gain(),
                self.floor()
            ),
            1 => "The same for the covariance of the weights (Frobenius norm): it too is known to one over the root \
                  of the time."
                .to_owned(),
            _ => "The same for the share of candidates that are accepted.".to_owned(),
        };
        let (least, most) = self.replicates();
        let draws = || self.points().map(|p| p.draws);
        let numbers = format!(
            "{} to {} draws, {least} to {most} replicates each. Points are at the median time; bars across are the quartiles of \
             the time, bars along the 95 % bootstrap intervals of the error. The reference is of {} draws from a stream of its \
             own",
            grouped(draws().min().unwrap_or(0)),
            grouped(draws().max().unwrap_or(0)),
            grouped(convergence.reference.draws)
        );
        let file = ["error-mean", "error-covariance", "error-acceptance"][quantity];
        self.drawing.figure(file, Section::Convergence, &chart, see, &numbers)
    }

    fn replicates(&self) -> (usize, usize) {
        let replicates = || self.points().map(|p| p.replicates);
        (replicates().min().unwrap_or(0), replicates().max().unwrap_or(0))
    }

    /// Describes how long each maker of draws takes for the error of the first.
    fn gain(&self) -> String {
        let curves = &self.convergence.curves;
        let told: Vec<_> = curves[1..]
            .iter()
            .map(|curve| {
                let times = curve.merit.relative_time;
                let [low, high] = [times.low, times.high].map(times_text);
                format!(
                    "{} takes {} ({low} to {high}) times as long",
                    self.name(curve),
                    times_text(times.median)
                )
            })
            .collect();
        if told.is_empty() {
            return String::new();
        }
        format!(
            "For the error of {}: {} (medians and quartiles of the turns). ",
            self.name(&curves[0]),
            told.join("; ")
        )
    }

    /// Describes the number of draws at which the bias of f32 would show.
    fn floor(&self) -> String {
        let Some(accuracy) = &self.drawing.model.accuracy else { return String::new() };
        let deviation = self.convergence.reference.deviation;
        let told = accuracy.variants.iter().filter(|v| v.nanoseconds.is_some()).map(|v| {
            let draws = (deviation / v.bias.max(2.0 * v.bias_error)).powi(2);
            let relation = if v.bias > 2.0 * v.bias_error { "about" } else { "more than" };
            format!("for {} at {relation} {} draws", v.name, number(draws))
        });
        let told = told.collect::<Vec<_>>().join(", ");
        format!(" The bias of f32 would bend a curve to the level, by paired draws {told}.")
    }

    fn beside_theory(&self) -> Figure {
        let reference = &self.convergence.reference;
        let (mut series, mut covered, mut all) = (Vec::new(), 0, 0);
        for (index, curve) in self.convergence.curves.iter().enumerate() {
            let colour = self.colour(curve);
            // Side by side, so that none hides another.
            let shift = 1.0 + 0.25 * index as f64;
            // The reference errs too.
            let scale =
                |p: &Point| reference.errors[0] * (1.0 + reference.draws as f64 / p.draws as f64).sqrt();
            let points = curve.points.iter().map(|p| (p.draws as f64 * shift, p.errors[0].value / scale(p)));
            series.push(Series::new(self.name(curve), colour, Style::Points, points.collect()));
            for p in &curve.points {
                let (x, low, high) =
                    (p.draws as f64 * shift, p.errors[0].low / scale(p), p.errors[0].high / scale(p));
                series.push(Series::new("", colour, Style::Bar, vec![(x, low), (x, high)]));
                all += 1;
                covered += u32::from((low..=high).contains(&1.0));
            }
        }
        let draws = || self.points().map(|p| p.draws as f64);
        let (first, last) = (draws().fold(f64::INFINITY, f64::min), draws().fold(0.0, f64::max));
        series.push(Series::new(
            "chance alone",
            GUIDE,
            Style::Dashed,
            vec![(first / 2.0, 1.0), (3.0 * last, 1.0)],
        ));
        let most = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(1.4, f64::max);
        let slopes = self.convergence.curves.iter().map(|curve| {
            let slope = curve.merit.slope;
            format!("{} {:.3} ({:.3} to {:.3})", self.name(curve), slope.value, slope.low, slope.high)
        });
        let chart = Chart {
            title: "Error of the mean spectrum relative to that of chance alone".to_owned(),
            x: Axis { limits: (first / 2.0, 3.0 * last), ..Axis::decades("number of draws", [first, last]) },
            y: Axis::linear("error × √draws ÷ that of the reference", (0.0, 1.05 * most)),
            series,
        };
        let see = format!(
            "A maker of draws whose only error is that of chance lies at 1 whatever the number of draws: {covered} of {all} \
             intervals cover it. Bootstrap intervals of so few replicates are somewhat narrow, and engines share their words, \
             so that they stray together. Fitted slopes of log error over log draws, with 95 % intervals: {}; of chance \
             alone −0.500.",
            slopes.collect::<Vec<_>>().join(", ")
        );
        let (least, most) = self.replicates();
        let numbers = format!("{least} to {most} replicates, 95 % bootstrap intervals");
        self.drawing.figure("error-theory", Section::Convergence, &chart, see, &numbers)
    }
}

/// A ratio of times to two or three digits.
pub(in super::super) fn times_text(times: f64) -> String {
    if times < 9.95 { format!("{times:.1}") } else { format!("{times:.0}") }
}
