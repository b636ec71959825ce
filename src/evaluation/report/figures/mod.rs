//! Figures of a report: each with a caption and its sources.

mod convergence;

pub(super) use convergence::times_text;

use super::chart::{Axis, COLOURS, Chart, GUIDE, Series, Style};
use super::format::file_stem;
use super::{Accuracy, Difficult, Difficulty, Fidelity, ModelReport, Randomness, Report, Section};
use crate::wording::grouped;

/// Figure of a report.
#[derive(Clone, Debug)]
pub struct Figure {
    /// Name of its file, without the extension.
    pub name: String,
    /// The model, as an index into the report's; `None` where it is of no model.
    pub model: Option<usize>,
    /// Section of the report that it belongs to.
    pub section: Section,
    /// The plot.
    pub svg: String,
    /// Caption: what it shows.
    pub see: String,
    /// Sources: numbers of draws, seed, engines, drivers, date.
    pub facts: String,
}

/// Number of cells of the histogram of p-values.
const BINS: usize = 20;

/// Makes the figures of all that was measured, in order.
pub fn figures(report: &Report) -> Vec<Figure> {
    let mut all = Vec::new();
    for (index, model) in report.models.iter().enumerate() {
        let drawing = Drawing { report, model, index };
        if let Some(measured) = &model.convergence {
            all.extend(convergence::figures(&drawing, measured));
        }
        all.extend(model.accuracy.iter().map(|measured| drawing.functions(measured)));
        if let Some(measured) = &model.difficulty {
            all.extend([drawing.cost_against_acceptance(measured), drawing.attempts(measured)]);
        }
        if let Some(measured) = &model.fidelity {
            all.extend([drawing.explained(measured), drawing.shrinkage(measured)]);
            all.extend(drawing.above_one(measured));
        }
    }
    all.extend(report.randomness.iter().map(|measured| p_values(report, measured)));
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

impl Drawing<'_> {
    fn figure(&self, name: &str, section: Section, chart: &Chart, see: String, numbers: &str) -> Figure {
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

    fn functions(&self, accuracy: &Accuracy) -> Figure {
        let functions = &accuracy.functions;
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
        self.figure("functions", Section::Accuracy, &chart, see, &numbers)
    }

    fn cost_against_acceptance(&self, difficulty: &Difficulty) -> Figure {
        let tasks = &difficulty.tasks;
        let mut series = Vec::new();
        for engine in 0..self.report.engines.len() {
            let (name, colour) = self.engine(engine);
            let of = |covered: bool| {
                let tasks = tasks.iter().filter(|t| t.engine == engine && t.covered == covered);
                let mut points: Vec<_> = tasks.map(|t| (t.probability, t.nanoseconds.median)).collect();
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
            not_drawn(difficulty)
        );
        let draws = tasks.iter().map(|t| t.draws);
        let numbers = format!(
            "{} recipes, medians of 3 runs of {} to {} draws",
            tasks.len() / self.report.engines.len().max(1),
            grouped(draws.clone().min().unwrap_or(0)),
            grouped(draws.max().unwrap_or(0))
        );
        self.figure("difficulty", Section::Difficulty, &chart, see, &numbers)
    }

    fn attempts(&self, difficulty: &Difficulty) -> Figure {
        let tasks = difficulty.tasks.iter().filter(|task| task.engine == 0 && !task.covered);
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
        self.figure("attempts", Section::Difficulty, &chart, see, &format!("draws of {}", self.engine(0).0))
    }

    fn explained(&self, fidelity: &Fidelity) -> Figure {
        let mut left = 1.0;
        let rest = fidelity.explained.iter().enumerate().map(|(i, share)| {
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
        let explained: f64 = fidelity.explained.iter().sum();
        let see = format!(
            "All {k} components explain {:.3} % of the variance; the paper asks for more than 90 %.",
            100.0 * explained
        );
        self.figure("explained", Section::Fidelity, &chart, see, "from the fit, without any draw")
    }

    fn shrinkage(&self, fidelity: &Fidelity) -> Figure {
        let all = &fidelity.shrinkage;
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
            Section::Fidelity,
            &chart,
            see,
            &format!("{} draws a point, band of 2 standard errors", grouped(draws)),
        )
    }

    fn above_one(&self, fidelity: &Fidelity) -> Option<Figure> {
        let all = &fidelity.above_one;
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
        Some(self.figure(
            "above-one",
            Section::Fidelity,
            &chart,
            see,
            &format!("{} draws a point", grouped(draws)),
        ))
    }
}

/// Describes the settings of which there is no point.
fn not_drawn(difficulty: &Difficulty) -> String {
    let list = |what: &str, all: &[String]| match all {
        [] => String::new(),
        all => format!("{what}: {}.", all.join("; ")),
    };
    let left_out = list(" The time did not suffice for", &difficulty.left_out);
    list("Refused before any work", &difficulty.refused) + &left_out
}

fn p_values(report: &Report, randomness: &Randomness) -> Figure {
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
        section: Section::Randomness,
        svg: chart.svg(),
        see,
        facts: facts(report, &numbers),
    }
}
