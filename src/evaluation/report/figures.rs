//! Figures of a report: each with a caption and its sources.

use super::chart::{Axis, COLOURS, Chart, GUIDE, Series, Style};
use super::{Difficult, ModelReport, Point, Report};

/// Figure of a report.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its file, without the extension.
    pub name: String,
    /// The model, as an index into the report's; `None` where it is of no model.
    pub model: Option<usize>,
    /// Section of the report that it belongs to, from 1.
    pub section: usize,
    /// The plot.
    pub svg: String,
    /// Caption: what it shows.
    pub see: String,
    /// Sources: numbers of draws, seed, engines, drivers, date.
    pub facts: String,
}

/// Number of cells of the histogram of p-values.
const BINS: usize = 20;

/// Makes all figures, in order.
pub fn figures(report: &Report) -> Vec<Figure> {
    let mut all = Vec::new();
    for (index, model) in report.models.iter().enumerate() {
        let drawing = Drawing { report, model, index };
        all.extend((0..3).map(|quantity| drawing.error_against_time(quantity)));
        all.push(drawing.error_beside_theory());
        all.push(drawing.functions());
        all.push(drawing.cost_against_acceptance());
        all.push(drawing.attempts());
        all.push(drawing.explained());
        all.push(drawing.shrinkage());
        all.extend(drawing.above_one());
    }
    all.push(p_values(report));
    all
}

/// Facts that any number depends on: engines with their drivers, the seed and the date.
fn facts(report: &Report, numbers: &str) -> String {
    let engines = report.engines.iter().map(|e| e.description.as_str()).collect::<Vec<_>>().join("; ");
    format!("{numbers}. Seed {}. {engines}. {}.", report.seed, report.date)
}

struct Drawing<'a> {
    report: &'a Report,
    model: &'a ModelReport,
    index: usize,
}

/// Quantities whose errors are plotted.
const QUANTITIES: [(&str, &str); 3] =
    [("mean spectrum", ""), ("covariance", " (relative to it)"), ("acceptance", "")];

impl Drawing<'_> {
    fn figure(&self, name: &str, section: usize, chart: &Chart, see: String, numbers: &str) -> Figure {
        Figure {
            name: format!("{}-{name}", file_stem(&self.model.name)),
            model: Some(self.index),
            section,
            svg: chart.svg(),
            see,
            facts: facts(self.report, &format!("{}: {numbers}", self.model.name)),
        }
    }

    fn engine(&self, index: usize) -> (&str, &'static str) {
        (&self.report.engines[index].name, COLOURS[index % COLOURS.len()])
    }

    fn points(&self, engine: usize) -> impl Iterator<Item = &Point> {
        self.model.convergence.points.iter().filter(move |p| p.engine == engine)
    }

    fn error_against_time(&self, quantity: usize) -> Figure {
        let (what, unit) = QUANTITIES[quantity];
        let convergence = &self.model.convergence;
        let mut series = Vec::new();
        for engine in 0..self.report.engines.len() {
            let (name, colour) = self.engine(engine);
            let points: Vec<&Point> = self.points(engine).collect();
            let last = points.last().expect("there are points");
            let (seconds, error) = (last.seconds[0], last.errors[quantity].value);
            let guide = [points[0].seconds[0], seconds].map(|t| (t, error * (seconds / t).sqrt()));
            series.push(Series::new("", colour, Style::Dashed, guide.to_vec()));
            let curve = points.iter().map(|p| (p.seconds[0], p.errors[quantity].value)).collect();
            let band = points.iter().map(|p| (p.errors[quantity].low, p.errors[quantity].high)).collect();
            series.push(Series::new(name, colour, Style::Line, curve).with_band(band));
        }
        let values = series.iter().flat_map(|s| s.points.iter()).copied().collect::<Vec<_>>();
        let (low, high) = values.iter().fold((f64::INFINITY, 0f64), |(a, b), p| (a.min(p.0), b.max(p.0)));
        let own = convergence.reference.errors[quantity];
        series.push(Series::new(
            "error of the reference",
            GUIDE,
            Style::Dotted,
            vec![(low, own), (high, own)],
        ));
        series.insert(0, Series::new("slope −½", GUIDE, Style::Dashed, Vec::new()));
        let bounds = self.points(0).flat_map(|p| [p.errors[quantity].low, p.errors[quantity].high]);
        let chart = Chart {
            title: format!("Error of the {what} against run time"),
            x: Axis::decades("run time (s), median of the replicates", values.iter().map(|p| p.0)),
            y: Axis::decades(
                &format!("root mean square error{unit}"),
                values.iter().map(|p| p.1).chain(bounds).chain([own]),
            ),
            series,
        };
        let see = match quantity {
            0 => format!(
                "An error of chance falls as one over the root of the time: along the broken lines of slope −½, once \
                 starting up no longer counts. The farther left a curve, the cheaper its engine. All engines draw from the \
                 same words, so their errors are equal and only their times differ. The bias of f32 would bend a curve to \
                 the level: {}",
                self.floor()
            ),
            1 => "The same for the covariance of the weights (Frobenius norm): it too is known to one over the root \
                  of the time."
                .to_owned(),
            _ => "The same for the share of candidates that are accepted.".to_owned(),
        };
        let (least, most) = self.replicates();
        let numbers = format!(
            "{} to {} draws, {least} to {most} replicates each, bands are 95 % bootstrap intervals; reference of {} draws \
             in f64 from a stream of its own",
            grouped(self.points(0).next().map_or(0, |p| p.draws)),
            grouped(self.points(0).last().map_or(0, |p| p.draws)),
            grouped(convergence.reference.draws)
        );
        let file = ["error-mean", "error-covariance", "error-acceptance"][quantity];
        self.figure(file, 1, &chart, see, &numbers)
    }

    fn replicates(&self) -> (u64, u64) {
        let replicates = self.model.convergence.points.iter().map(|p| p.replicates);
        (replicates.clone().min().unwrap_or(0), replicates.max().unwrap_or(0))
    }

    /// Describes the number of draws at which the bias of f32 would show.
    fn floor(&self) -> String {
        let deviation = self.model.convergence.reference.deviation;
        let told = self.model.accuracy.variants.iter().filter(|v| v.nanoseconds.is_some()).map(|v| {
            let draws = (deviation / v.bias.max(2.0 * v.bias_error)).powi(2);
            let relation = if v.bias > 2.0 * v.bias_error { "about" } else { "more than" };
            format!("for {} it would at {relation} {} draws", v.name, number(draws))
        });
        format!("{}, from paired draws.", told.collect::<Vec<_>>().join(", "))
    }

    fn error_beside_theory(&self) -> Figure {
        let reference = &self.model.convergence.reference;
        let (mut series, mut covered, mut all) = (Vec::new(), 0, 0);
        for engine in 0..self.report.engines.len() {
            let (name, colour) = self.engine(engine);
            // Side by side, so that none hides another.
            let shift = 1.0 + 0.25 * engine as f64;
            // The reference errs too.
            let scale =
                |p: &Point| reference.errors[0] * (1.0 + reference.draws as f64 / p.draws as f64).sqrt();
            let points = self.points(engine).map(|p| (p.draws as f64 * shift, p.errors[0].value / scale(p)));
            series.push(Series::new(name, colour, Style::Points, points.collect()));
            for p in self.points(engine) {
                let (x, low, high) =
                    (p.draws as f64 * shift, p.errors[0].low / scale(p), p.errors[0].high / scale(p));
                series.push(Series::new("", colour, Style::Plain, vec![(x, low), (x, high)]));
                all += 1;
                covered += u32::from((low..=high).contains(&1.0));
            }
        }
        let draws = || self.model.convergence.points.iter().map(|p| p.draws as f64);
        let (first, last) = (draws().fold(f64::INFINITY, f64::min), draws().fold(0.0, f64::max));
        series.push(Series::new(
            "chance alone",
            GUIDE,
            Style::Dashed,
            vec![(first / 2.0, 1.0), (3.0 * last, 1.0)],
        ));
        let most = series.iter().flat_map(|s| &s.points).map(|p| p.1).fold(1.4, f64::max);
        let slopes = self.model.convergence.merits.iter().map(|m| {
            let (name, _) = self.engine(m.engine);
            format!("{name} {:.3} ({:.3} to {:.3})", m.slope.value, m.slope.low, m.slope.high)
        });
        let chart = Chart {
            title: "Error of the mean spectrum relative to that of chance alone".to_owned(),
            x: Axis { limits: (first / 2.0, 3.0 * last), ..Axis::decades("number of draws", [first, last]) },
            y: Axis::linear("error × √draws ÷ the same of the reference", (0.0, 1.05 * most)),
            series,
        };
        let see = format!(
            "An engine whose only error is that of chance lies at 1 whatever the number of draws: {covered} of {all} \
             intervals cover it. Bootstrap intervals of so few replicates are somewhat narrow, and engines share their words, \
             so that they stray together. Fitted slopes of log error over log draws, with 95 % intervals: {}; of chance \
             alone −0.500.",
            slopes.collect::<Vec<_>>().join(", ")
        );
        let (least, most) = self.replicates();
        self.figure(
            "error-theory",
            1,
            &chart,
            see,
            &format!("{least} to {most} replicates, 95 % bootstrap intervals"),
        )
    }

    fn functions(&self) -> Figure {
        let functions = &self.model.accuracy.functions;
        let series = functions.iter().enumerate().map(|(i, f)| {
            let name = format!("{}, {}", self.engine(f.engine).0, f.name);
            Series::new(&name, COLOURS[i % COLOURS.len()], Style::Points, vec![(f.nanoseconds, f.normal)])
        });
        let chart = Chart {
            title: "What own polynomials buy: error of a normal against its cost".to_owned(),
            x: Axis::decades("nanoseconds for two normals", functions.iter().map(|f| f.nanoseconds)),
            y: Axis::decades("largest error of a normal", functions.iter().map(|f| f.normal)),
            series: series.collect(),
        };
        let see = "Lower is more accurate, left is cheaper. The same polynomials run everywhere; what built-in functions \
                   are good to is each adapter’s choice."
            .to_owned();
        let candidates = functions.first().map_or(0, |f| f.candidates);
        let numbers = format!("{} candidates of {} normals", grouped(candidates), self.model.components);
        self.figure("functions", 2, &chart, see, &numbers)
    }

    fn cost_against_acceptance(&self) -> Figure {
        let tasks = &self.model.difficulty.tasks;
        let mut series = Vec::new();
        for engine in 0..self.report.engines.len() {
            let (name, colour) = self.engine(engine);
            let of = |covered: bool| {
                let tasks = tasks.iter().filter(|t| t.engine == engine && t.covered == covered);
                let mut points: Vec<_> = tasks.map(|t| (t.probability, t.nanoseconds)).collect();
                points.sort_by(|a, b| a.0.total_cmp(&b.0));
                points
            };
            let points = of(false);
            let Some(&(easiest, cost)) = points.last() else { continue };
            let guide = [points[0].0, easiest].map(|a| (a, cost * easiest / a)).to_vec();
            series.push(Series::new("", colour, Style::Dashed, guide));
            series.push(Series::new(&format!("{name}, cover"), colour, Style::Line, of(true)));
            series.push(Series::new(name, colour, Style::Points, points));
        }
        series.push(Series::new(
            "plain rejection, at a constant cost of a candidate",
            GUIDE,
            Style::Dashed,
            Vec::new(),
        ));
        let values = || series.iter().flat_map(|s| &s.points);
        let chart = Chart {
            title: "Cost of an accepted draw against the probability of acceptance".to_owned(),
            x: Axis::decades("probability that a spectrum of the model is accepted", values().map(|p| p.0)),
            y: Axis::decades("nanoseconds for an accepted draw", values().map(|p| p.1)),
            series,
        };
        let see = format!(
            "Single points are of plain rejection: on its broken line a draw costs as much as its candidates, however \
             many they are, and points below it are of candidates that cost less than the easiest draw, since most are \
             not stored. Joined points are of a cover, which reaches where plain rejection cannot. {}",
            self.refused()
        );
        let draws = tasks.iter().map(|t| t.draws);
        let numbers = format!(
            "{} recipes, medians of 3 runs of {} to {} draws",
            tasks.len() / self.report.engines.len().max(1),
            grouped(draws.clone().min().unwrap_or(0)),
            grouped(draws.max().unwrap_or(0))
        );
        self.figure("difficulty", 3, &chart, see, &numbers)
    }

    fn refused(&self) -> String {
        match self.model.difficulty.refused.as_slice() {
            [] => String::new(),
            all => format!("Refused before any work: {}.", all.join("; ")),
        }
    }

    fn attempts(&self) -> Figure {
        let tasks = self.model.difficulty.tasks.iter().filter(|task| task.engine == 0 && !task.covered);
        let scales: Vec<_> = tasks
            .filter_map(|task| match task.setting {
                Difficult::CovarianceScale(factor) => Some((factor, task.attempts())),
                Difficult::Lrv(_) => None,
            })
            .collect();
        let chart = Chart {
            title: "Candidates for a draw against the spread asked for".to_owned(),
            x: Axis::decades("factor of the weights’ covariance", scales.iter().map(|p| p.0)),
            y: Axis::decades(
                "candidates for an accepted draw, mean",
                scales.iter().map(|p| p.1).chain([1.0]),
            ),
            series: vec![Series::new("", COLOURS[0], Style::Line, scales)],
        };
        let see = "A model spread wider than its data leaves the physical ever more often; the recipe says so before it \
                   draws, and refuses what its attempts would not reach."
            .to_owned();
        self.figure("attempts", 3, &chart, see, &format!("draws of {}", self.engine(0).0))
    }

    fn explained(&self) -> Figure {
        let mut left = 1.0;
        let rest = self.model.fidelity.explained.iter().enumerate().map(|(i, share)| {
            left -= share;
            (i as f64 + 1.0, 100.0 * left)
        });
        let points: Vec<(f64, f64)> =
            std::iter::once((0.0, 100.0)).chain(rest).filter(|p| p.1 > 1e-9).collect();
        let k = self.model.components;
        let chart = Chart {
            title: format!("Variance of the data that {k} components leave unexplained"),
            x: Axis::linear("components", (0.0, k as f64 + 0.5)),
            y: Axis::decades("unexplained (%)", points.iter().map(|p| p.1)),
            series: vec![Series::new("", COLOURS[0], Style::Line, points)],
        };
        let explained: f64 = self.model.fidelity.explained.iter().sum();
        let see = format!(
            "All {k} components explain {:.3} % of the variance; the paper asks for more than 90 %.",
            100.0 * explained
        );
        self.figure("explained", 4, &chart, see, "from the fit, without any draw")
    }

    fn shrinkage(&self) -> Figure {
        let all = &self.model.fidelity.shrinkage;
        let points = all.iter().map(|s| (s.scale, s.determinant_ratio)).collect();
        let band =
            all.iter().map(|s| (s.determinant_ratio - 2.0 * s.error, s.determinant_ratio + 2.0 * s.error));
        let chart = Chart {
            title: "What rejection does to the covariance".to_owned(),
            x: Axis {
                limits: (8e-4, 1.3),
                ..Axis::decades("factor of the weights’ covariance", [1e-3, 1.0])
            },
            y: Axis::linear("determinant of accepted ÷ of all candidates", (0.0, 1.1)),
            series: vec![Series::new("", COLOURS[0], Style::Line, points).with_band(band.collect())],
        };
        let last = all.last().map_or(1.0, |s| s.determinant_ratio);
        let see = format!(
            "Where nothing is rejected the ratio is 1. With the data’s own covariance (factor 1) it is {last:.3}: what is \
             rejected lies outside, so accepted draws vary less than the Gaussian that was fitted."
        );
        let draws = all.first().map_or(0, |s| s.draws);
        self.figure(
            "shrinkage",
            4,
            &chart,
            see,
            &format!("{} draws a point, band of 2 standard errors", grouped(draws)),
        )
    }

    fn above_one(&self) -> Option<Figure> {
        let all = &self.model.fidelity.above_one;
        let draws = all.first()?.draws;
        let points: Vec<_> = all.iter().map(|a| (a.lrv, 100.0 * a.share)).collect();
        let most = points.iter().map(|p| p.1).fold(1.0, f64::max);
        let chart = Chart {
            title: "How often draws under the bounds “base” exceed 1".to_owned(),
            x: Axis::linear("target luminous reflectance", (0.0, 1.0)),
            y: Axis::linear("draws that reach 1 in some band (%)", (0.0, (1.1 * most).min(105.0))),
            series: vec![Series::new("", COLOURS[0], Style::Line, points)],
        };
        let see = "Judged before it is scaled, a spectrum can leave the physical afterwards: rare for dark targets, the \
                   rule for light ones. Every draw that does is counted."
            .to_owned();
        Some(self.figure("above-one", 4, &chart, see, &format!("{} draws a point", grouped(draws))))
    }
}

fn p_values(report: &Report) -> Figure {
    let randomness = &report.randomness;
    let all: Vec<f64> = randomness.groups.iter().flat_map(|g| g.p_values.iter().copied()).collect();
    let mut counts = [0u32; BINS];
    all.iter().for_each(|p| counts[((p * BINS as f64) as usize).min(BINS - 1)] += 1);
    let edge = |i: usize| i as f64 / BINS as f64;
    let expected = all.len() as f64 / BINS as f64;
    let spread = 1.96 * (expected * (1.0 - 1.0 / BINS as f64)).sqrt();
    let columns = (0..=BINS).map(|i| (edge(i), f64::from(counts[i.min(BINS - 1)]))).collect();
    let band = vec![(expected - spread, expected + spread); 2];
    let chart = Chart {
        title: format!("p-values of {} comparisons of the generator’s normals", all.len()),
        x: Axis::linear("p-value", (0.0, 1.0)),
        y: Axis::linear("comparisons", (0.0, 1.25 * counts.iter().copied().max().map_or(1.0, f64::from))),
        series: vec![
            Series::new(
                "expected, with the interval of 95 % of the columns",
                GUIDE,
                Style::Dashed,
                vec![(0.0, expected), (1.0, expected)],
            )
            .with_band(band),
            Series::new("found", COLOURS[0], Style::Steps, columns),
        ],
    };
    let see = format!(
        "Of a sound generator p-values are uniform, and one column in twenty leaves the band. All together they are, with \
         p = {:.3} (Kolmogorov-Smirnov); the smallest of {} is {:.1e}.",
        randomness.p_of_all,
        all.len(),
        all.iter().copied().fold(1.0, f64::min)
    );
    let numbers = format!("{} draws of each of {} seeds", grouped(randomness.draws), randomness.seeds);
    Figure {
        name: "p-values".to_owned(),
        model: None,
        section: 5,
        svg: chart.svg(),
        see,
        facts: facts(report, &numbers),
    }
}

/// Makes a name that any file system takes.
fn file_stem(name: &str) -> String {
    let stem = std::path::Path::new(name).file_stem().unwrap_or_default().to_string_lossy();
    stem.chars().map(|c| if c.is_ascii_alphanumeric() { c } else { '-' }).collect()
}

/// Formats a number with its thousands set apart.
pub(super) fn grouped(n: u64) -> String {
    let digits = n.to_string();
    let groups: Vec<_> = digits.as_bytes().rchunks(3).rev().map(|g| String::from_utf8_lossy(g)).collect();
    groups.join(",")
}

/// Formats a number to two digits, with a power of ten where it needs one.
pub(super) fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    let exponent = value.abs().log10().floor() as i32;
    match exponent {
        -2..=-1 => format!("{value:.3}"),
        0..=1 => format!("{value:.2}"),
        2..=4 => format!("{value:.0}"),
        _ => {
            // Rounding may carry into the next power.
            let text = format!("{value:.1e}");
            let (digits, exponent) = text.split_once('e').expect("it is in that notation");
            let exponent = exponent.parse().expect("it is a whole number");
            format!("{digits} × 10{}", super::chart::superscript(exponent))
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        let texts = [0.0, 1.234e-7, 0.0123, 1.5, 99_960.0, 9.96e5, 1e9].map(number);
        assert_eq!(texts, ["0", "1.2 × 10⁻⁷", "0.012", "1.50", "99960", "1.0 × 10⁶", "1.0 × 10⁹"]);
        assert_eq!(grouped(1_234_567), "1,234,567");
        assert_eq!(file_stem("a/my model.json"), "my-model");
    }
}
