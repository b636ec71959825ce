//! The picture of measured spectra beside draws, four panels: the range of both and of the candidates before any is
//! rejected, their weights one by one, and of data and draws the first two together, and the chromaticities.

use std::sync::Arc;

use kuva::plot::line::LineStyle;
use kuva::prelude::{BandPlot, Layout, LinePlot, Plot, ScatterPlot, TickFormat};
use kuva::render::render::{Primitive, Scene, TextAnchor};
use nalgebra::DMatrix;
use spectroll::Model;
use spectroll::evaluation::comparison::{Comparison, Sample};
use spectroll::evaluation::plot::{self, Caption, TICK_SIZE, Theme};

use super::panel::{self, Axes, MARGINS, PANEL, Panel, curve};

/// The most weights that are shown one by one.
const MAX_WEIGHTS: usize = 8;

/// Dashes of the lines of candidates.
const DASHES: &str = "4 3";

/// The most points of a kind in a panel: beyond these they hide each other.
const MAX_POINTS: usize = 1500;

/// Shares of the spectra below the ends of a range, from the outer to the inner, and below their middle.
const SHARES: [f64; 5] = [0.05, 0.25, 0.5, 0.75, 0.95];

/// Contents of a picture.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Picture<'a> {
    /// Name of the model.
    pub(in crate::cli) name: &'a str,
    /// Describes the data and the draws.
    pub(in crate::cli) note: &'a str,
    /// The model.
    pub(in crate::cli) model: &'a Model,
    /// The data and the draws.
    pub(in crate::cli) comparison: &'a Comparison,
    /// The ground.
    pub(in crate::cli) theme: Theme,
}

impl Picture<'_> {
    /// The picture, drawn.
    pub(in crate::cli) fn drawing(&self) -> Scene {
        let mut drawing =
            panel::arrange([self.ranges(), self.weights(), self.pairs(), self.chromaticities()], self.theme);
        for panel in 0..4 {
            drawing.elements.extend(self.key(panel));
        }
        plot::head(&mut drawing, &super::title(self.name), self.note, self.theme);
        drawing
    }

    fn samples(&self) -> [&Sample; 3] {
        [&self.comparison.measured, &self.comparison.drawn, &self.comparison.candidates]
    }

    /// Colours of the data, of the draws and of the candidates.
    fn colours(&self) -> [&'static str; 3] {
        let [data, draws, ..] = self.theme.colours();
        [data, draws, self.theme.quiet()]
    }

    /// The key, at the right of a panel's title.
    fn key(&self, panel: usize) -> Vec<Primitive> {
        let (x, y) = panel::place(panel).corner;
        let (mut x, y) = (x + PANEL.0 - MARGINS[1], y + 20.0);
        let entries =
            [("data", 62.0, None), ("draws", 70.0, None), ("before rejection", 130.0, Some(DASHES))];
        let shown = if panel < 2 { 3 } else { 2 };
        let entry = |(index, (name, width, dashes)): (usize, (&str, f64, Option<&str>))| {
            x -= width;
            let text = plot::text((x + 20.0, y + 4.0), TICK_SIZE, name, TextAnchor::Start, self.theme.ink());
            [plot::mark((x, y), 14.0, self.colours()[index], 2.6, dashes), text]
        };
        entries[..shown].iter().copied().enumerate().rev().flat_map(entry).collect()
    }

    /// The middle nine tenths of the spectra, band by band, and their medians.
    fn ranges(&self) -> Panel {
        let grid = self.model.grid();
        let axes = Axes { kind: self.model.kind(), grid: grid.clone(), theme: self.theme };
        let mut plots: Vec<Plot> = Vec::new();
        let mut shown = Vec::new();
        for (index, (sample, colour)) in self.samples().into_iter().zip(self.colours()).enumerate() {
            let rows = sample.spectra.row_iter();
            let bands: Vec<[f64; 5]> = rows.map(|row| quantiles(row.iter().copied())).collect();
            let at = |share: usize| curve(grid, &bands.iter().map(|band| band[share]).collect::<Vec<_>>());
            let (low, middle, high) = (at(0), at(2), at(4));
            shown.extend(low.iter().chain(&high).map(|p| p.1));
            if index == 2 {
                let dashed = |points| {
                    let line = LinePlot::new().with_data(points).with_color(colour).with_stroke_width(1.6);
                    line.with_line_style(LineStyle::Custom(DASHES.to_owned())).into()
                };
                plots.extend([low, middle, high].map(dashed));
                continue;
            }
            let x = low.iter().map(|p| p.0);
            let band = BandPlot::new(x, low.iter().map(|p| p.1), high.iter().map(|p| p.1));
            plots.push(band.with_color(colour).with_opacity(0.2).into());
            plots.push(LinePlot::new().with_data(middle).with_color(colour).with_stroke_width(2.2).into());
        }
        let caption = Caption {
            title: "Spectra".to_owned(),
            note: "median, and the range of the middle 90 % in each band".to_owned(),
            vertical: axes.label().to_owned(),
        };
        (plots, axes.values(axes.limits(shown.iter())), caption)
    }

    /// The middle half and nine tenths of each weight: the data's, the draws' below, and the candidates' at the bottom.
    fn weights(&self) -> Panel {
        let measured = &self.comparison.measured.weights;
        let count = measured.nrows().min(MAX_WEIGHTS);
        let (mut plots, mut reach): (Vec<Plot>, f64) = (Vec::new(), 0.0);
        for weight in 0..count {
            let mean = measured.row(weight).mean();
            let sd = measured.row(weight).variance().sqrt();
            for (of, (sample, colour)) in self.samples().into_iter().zip(self.colours()).enumerate() {
                let scaled = sample.weights.row(weight).iter().map(|w| (w - mean) / sd).collect::<Vec<_>>();
                let [low, left, middle, right, high] = quantiles(scaled.into_iter());
                let y = (count - weight) as f64 + [0.25, 0.0, -0.25][of];
                let line = |a: f64, b: f64, width: f64| {
                    LinePlot::new().with_data([(a, y), (b, y)]).with_color(colour).with_stroke_width(width)
                };
                plots.push(line(low, high, 1.6).into());
                plots.push(line(left, right, 5.0).into());
                let dot = ScatterPlot::new().with_data([(middle, y)]).with_color(self.theme.ink());
                plots.push(dot.with_size(2.6).into());
                reach = reach.max(low.abs()).max(high.abs());
            }
        }
        let number = move |y: f64| match y.fract() == 0.0 && (1.0..=count as f64).contains(&y) {
            true => format!("{}", count + 1 - y as usize),
            false => String::new(),
        };
        let layout = self
            .theme
            .axes((-1.06 * reach, 1.06 * reach), (0.4, count as f64 + 0.6), MARGINS)
            .with_y_tick_step(1.0)
            .with_y_tick_format(TickFormat::Custom(Arc::new(number)))
            .with_x_label("weight (standard deviations of the data)");
        let caption = Caption {
            title: "Weights".to_owned(),
            note: "median, and the ranges of the middle 50 % and 90 %".to_owned(),
            vertical: "component".to_owned(),
        };
        (plots, layout, caption)
    }

    /// The first two weights of each spectrum.
    fn pairs(&self) -> Panel {
        let pairs = |weights: &DMatrix<f64>| {
            let second = weights.nrows().min(2) - 1;
            weights.column_iter().take(MAX_POINTS).map(|w| (w[0], w[second])).collect::<Vec<_>>()
        };
        let points = [&self.comparison.measured, &self.comparison.drawn].map(|sample| pairs(&sample.weights));
        let (plots, layout) = self.scatter(&points);
        let caption = Caption {
            title: "First two weights".to_owned(),
            note: "a point for each spectrum".to_owned(),
            vertical: "weight of component 2".to_owned(),
        };
        (plots, layout.with_x_label("weight of component 1"), caption)
    }

    /// The chromaticity of each spectrum.
    fn chromaticities(&self) -> Panel {
        let points = |sample: &Sample| {
            let chromaticities = self.comparison.chromaticities(sample).into_iter();
            chromaticities.take(MAX_POINTS).map(|[x, y]| (x, y)).collect::<Vec<_>>()
        };
        let points = [&self.comparison.measured, &self.comparison.drawn].map(points);
        let seen = !points[0].is_empty();
        let (plots, layout) = self.scatter(&points);
        let caption = Caption {
            title: "Chromaticities".to_owned(),
            note: match (seen, self.model.kind()) {
                (false, _) => "none: outside the visible".to_owned(),
                (true, spectroll::SpectrumKind::Reflectance) => "under D65".to_owned(),
                (true, spectroll::SpectrumKind::Illuminant) => "of the light".to_owned(),
            },
            vertical: "CIE 1931 y".to_owned(),
        };
        (plots, layout.with_x_label("CIE 1931 x"), caption)
    }

    /// Points of the data over those of the draws, and axes that hold them all.
    fn scatter(&self, points: &[Vec<(f64, f64)>; 2]) -> (Vec<Plot>, Layout) {
        let all = || points.iter().flatten();
        let limits = |pick: fn(&(f64, f64)) -> f64| {
            let ends = |(a, b): (f64, f64), v: f64| (a.min(v), b.max(v));
            let (low, high) = all().map(pick).fold((f64::INFINITY, f64::NEG_INFINITY), ends);
            let pad = 0.05 * (high - low);
            if low < high { (low - pad, high + pad) } else { (0.0, 1.0) }
        };
        let dots = |of: usize, size: f64| {
            let dots =
                ScatterPlot::new().with_data(points[of].iter().copied()).with_color(self.colours()[of]);
            dots.with_size(size).into()
        };
        (vec![dots(1, 1.5), dots(0, 1.8)], self.theme.axes(limits(|p| p.0), limits(|p| p.1), MARGINS))
    }
}

/// Values below which these [shares](SHARES) of all are.
fn quantiles(values: impl Iterator<Item = f64>) -> [f64; 5] {
    let mut sorted: Vec<f64> = values.collect();
    sorted.sort_unstable_by(f64::total_cmp);
    SHARES.map(|share| sorted[((sorted.len() as f64 * share) as usize).min(sorted.len() - 1)])
}

#[cfg(test)]
mod tests {
    use spectroll::{BuiltinTable, Dataset, Extrapolation, Recipe, Stream};

    use super::*;

    #[test]
    fn the_panels_show_data_and_draws() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        let data =
            Dataset::new(&[BuiltinTable::Vrhel.table()], model.grid().clone(), Extrapolation::Error).unwrap();
        let recipe = Recipe::builder(&model).build().unwrap();
        let comparison = Comparison::new(&recipe, &data, Stream::new(0), 300).unwrap();
        let picture = Picture {
            name: "m.json",
            note: "a note",
            model: &model,
            comparison: &comparison,
            theme: Theme::Dark,
        };
        let svg = plot::svg(&picture.drawing());
        for text in ["m.json", "a note", ">data<", ">draws<", ">reflectance<", "CIE 1931 x", ">under D65<"] {
            assert!(svg.contains(text), "no {text:?}");
        }
        // A point for each spectrum in two panels, and one for each median of six weights.
        assert!(svg.matches("<circle").count() >= 2 * (170 + 300), "{}", svg.matches("<circle").count());
    }

    #[test]
    fn quantiles_are_values_of_the_sample() {
        assert_eq!(quantiles((0..100).map(f64::from)), [5.0, 25.0, 50.0, 75.0, 95.0]);
        assert_eq!(quantiles([7.0].into_iter()), [7.0; 5]);
    }
}
