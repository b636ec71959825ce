//! A chart: series on two axes, linear or logarithmic, with a key above them.

use std::sync::Arc;

use kuva::prelude::{BandPlot, Layout, LinePlot, Plot, ScatterPlot, TickFormat};
use kuva::render::figure::Figure;
use kuva::render::render::{Primitive, TextAnchor};

use crate::evaluation::plot::{self, Caption, Place, TICK_SIZE, Theme};

/// The report is a white page.
const THEME: Theme = Theme::Light;

/// Size of a chart, and what it leaves for text on its left, right and bottom.
const SIZE: (f64, f64) = (640.0, 430.0);
const MARGINS: [f64; 3] = [84.0, 18.0, 50.0];

/// Height above the axes for the title, and for each row of the key.
const HEAD: f64 = 40.0;
const KEY_ROW: f64 = 19.0;

/// About the width of a character of the key.
const CHARACTER: f64 = 6.9;

/// Colour of what only guides the eye.
pub(super) const GUIDE: &str = THEME.quiet();

/// Colours that show on thin lines.
pub(super) const COLOURS: [&str; 6] = {
    let all = THEME.colours();
    [all[0], all[1], all[2], all[3], all[4], all[6]]
};

/// An axis.
pub(super) struct Axis {
    pub(super) label: String,
    pub(super) limits: (f64, f64),
    pub(super) logarithmic: bool,
}

/// Style of a series.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Style {
    /// Points joined by a line.
    Line,
    /// A bar of an error: a thin line without points.
    Bar,
    /// A broken one.
    Dashed,
    /// One of dots.
    Dotted,
    /// Points alone.
    Points,
    /// Columns of a histogram, given by their lower edges and one end.
    Steps,
}

/// Points, and where given how far down and up each may be.
pub(super) struct Series {
    pub(super) name: String,
    pub(super) colour: &'static str,
    pub(super) style: Style,
    pub(super) points: Vec<(f64, f64)>,
    pub(super) band: Option<Vec<(f64, f64)>>,
}

/// A chart.
pub(super) struct Chart {
    pub(super) title: String,
    pub(super) x: Axis,
    pub(super) y: Axis,
    pub(super) series: Vec<Series>,
}

impl Axis {
    pub(super) fn linear(label: &str, limits: (f64, f64)) -> Axis {
        Axis { label: label.to_owned(), limits, logarithmic: false }
    }

    /// A logarithmic axis that holds all positive values, from a 1, 2 or 5 to another.
    pub(super) fn decades(label: &str, values: impl IntoIterator<Item = f64>) -> Axis {
        let values = values.into_iter().filter(|&v| v > 0.0 && v.is_finite());
        let (low, high) = values.fold((f64::INFINITY, 0f64), |(a, b), v| (a.min(v), b.max(v)));
        let (low, high) = if low < high { (low, high) } else { (0.1, 1.0) };
        let limits = (round_down(low / 1.1), 1.0 / round_down(1.0 / (1.1 * high)));
        Axis { label: label.to_owned(), limits, logarithmic: true }
    }

    /// Divisor of values before plotting: kuva takes all below 1e-10 for that on a logarithmic axis.
    fn unit(&self) -> f64 {
        let decade = 10f64.powf(self.limits.0.log10().floor());
        if self.logarithmic && decade < 1e-9 { decade } else { 1.0 }
    }
}

/// The largest of ..., 0.1, 0.2, 0.5, 1, 2, 5, 10, ... that is at most `value`.
fn round_down(value: f64) -> f64 {
    let decade = 10f64.powf(value.log10().floor());
    [5.0, 2.0, 1.0].map(|m| m * decade).into_iter().find(|&v| v <= value).unwrap_or(decade)
}

impl Series {
    pub(super) fn new(name: &str, colour: &'static str, style: Style, points: Vec<(f64, f64)>) -> Series {
        Series { name: name.to_owned(), colour, style, points, band: None }
    }

    pub(super) fn with_band(self, band: Vec<(f64, f64)>) -> Series {
        Series { band: Some(band), ..self }
    }

    fn plots(&self, (x_unit, y_unit): (f64, f64)) -> Vec<Plot> {
        let mut plots = Vec::new();
        let points: Vec<_> = self.points.iter().map(|p| (p.0 / x_unit, p.1 / y_unit)).collect();
        if let Some(band) = &self.band {
            let x = points.iter().map(|p| p.0);
            let (low, high) = (band.iter().map(|b| b.0 / y_unit), band.iter().map(|b| b.1 / y_unit));
            plots.push(BandPlot::new(x, low, high).with_color(self.colour).with_opacity(0.2).into());
        }
        let line = || LinePlot::new().with_data(points.clone()).with_color(self.colour);
        match self.style {
            Style::Line => plots.push(line().with_stroke_width(1.8).into()),
            Style::Dashed => plots.push(line().with_stroke_width(1.3).with_dashed().into()),
            Style::Dotted => plots.push(line().with_stroke_width(1.6).with_dotted().into()),
            Style::Bar => plots.push(line().with_stroke_width(1.3).into()),
            Style::Steps => {
                let corners = points.windows(2).flat_map(|w| [w[0], (w[1].0, w[0].1)]);
                let steps = LinePlot::new().with_data(corners.collect::<Vec<_>>()).with_color(self.colour);
                plots.push(steps.with_stroke_width(1.8).into());
            }
            Style::Points => {}
        }
        if matches!(self.style, Style::Line | Style::Points) {
            let points = ScatterPlot::new().with_data(points.clone()).with_color(self.colour).with_size(3.6);
            plots.push(points.into());
        }
        plots
    }
}

impl Chart {
    /// The chart as SVG.
    pub(super) fn svg(&self) -> String {
        let keys = self.keys();
        let rows = keys.iter().map(|key| key.row + 1).max().unwrap_or(0);
        let top = HEAD + KEY_ROW * rows as f64;
        let units = (self.x.unit(), self.y.unit());
        let plots: Vec<Plot> = self.series.iter().flat_map(|series| series.plots(units)).collect();
        let mut scene = Figure::new(1, 1)
            .with_plots(vec![plots])
            .with_layouts(vec![self.layout(top)])
            .with_cell_size(SIZE.0, SIZE.1)
            .with_spacing(0.0)
            .with_padding(0.0)
            .render();
        let [left, right, bottom] = MARGINS;
        let place = Place { corner: (0.0, 0.0), size: SIZE, margins: [left, right, top, bottom] };
        let caption =
            Caption { title: self.title.clone(), vertical: self.y.label.clone(), ..Caption::default() };
        scene.elements.extend(caption.draw(&place, THEME));
        for key in keys {
            scene.elements.extend(key.draw(HEAD));
        }
        plot::svg(&scene)
    }

    fn layout(&self, top: f64) -> Layout {
        let plotted = |axis: &Axis| (axis.limits.0 / axis.unit(), axis.limits.1 / axis.unit());
        let [left, right, bottom] = MARGINS;
        let margins = [left, right, top, bottom];
        let mut layout =
            THEME.axes(plotted(&self.x), plotted(&self.y), margins).with_x_label(self.x.label.clone());
        if self.x.logarithmic {
            layout = layout.with_log_x().with_x_tick_format(powers(&self.x));
        }
        if self.y.logarithmic {
            layout = layout.with_log_y().with_y_tick_format(powers(&self.y));
        }
        layout
    }

    /// The key: a mark and a name for each named series, in rows.
    fn keys(&self) -> Vec<Key<'_>> {
        let (mut x, mut row) = (MARGINS[0], 0);
        let named = self.series.iter().filter(|s| !s.name.is_empty());
        named
            .map(|series| {
                let width = 44.0 + CHARACTER * series.name.chars().count() as f64;
                if x > MARGINS[0] && x + width > SIZE.0 - MARGINS[1] {
                    (x, row) = (MARGINS[0], row + 1);
                }
                let key = Key { series, x, row };
                x += width;
                key
            })
            .collect()
    }
}

/// An entry of the key.
struct Key<'a> {
    series: &'a Series,
    x: f64,
    row: usize,
}

impl Key<'_> {
    fn draw(&self, top: f64) -> Vec<Primitive> {
        let y = top + KEY_ROW * self.row as f64;
        let mark = match self.series.style {
            Style::Points => plot::disc((self.x + 11.0, y), 3.6, self.series.colour, None),
            style => {
                let dashes = match style {
                    Style::Dashed => Some("6 3"),
                    Style::Dotted => Some("2 3"),
                    _ => None,
                };
                plot::mark((self.x, y), 22.0, self.series.colour, 2.4, dashes)
            }
        };
        let (at, name) = ((self.x + 28.0, y + 4.0), &self.series.name);
        let text = plot::text(at, TICK_SIZE, name, TextAnchor::Start, THEME.ink());
        vec![mark, text]
    }
}

/// Powers of ten as such, unless all are short. What lies between them is named where there is room, on axes of two
/// decades or less.
fn powers(axis: &Axis) -> TickFormat {
    let ((low, high), unit) = (axis.limits, axis.unit());
    let (few, short) = (high / low < 101.0, low > 0.9e-3 && high < 1.1e4);
    TickFormat::Custom(Arc::new(move |value| {
        let value = value * unit;
        let exponent = value.log10().floor() as i32;
        let digit = (value / 10f64.powi(exponent)).round();
        let (digit, exponent) = if digit == 10.0 { (1.0, exponent + 1) } else { (digit, exponent) };
        match (digit == 1.0, exponent) {
            (false, _) if !few => String::new(),
            _ if short => format!("{}", (value * 1e6).round() / 1e6),
            (true, 0) => "1".to_owned(),
            (true, 1) => "10".to_owned(),
            (true, n) => format!("10{}", superscript(n)),
            (false, n) => format!("{digit}·10{}", superscript(n)),
        }
    }))
}

/// A number in superscript.
pub(super) fn superscript(n: i32) -> String {
    let digit = |c: char| match c {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        c => char::from_u32(0x2070 + u32::from(c) - u32::from('0')).unwrap_or(c),
    };
    n.to_string().chars().map(digit).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn exponents_are_raised() {
        assert_eq!([-12, 3, 40].map(superscript), ["⁻¹²", "³", "⁴⁰"]);
    }

    #[test]
    fn axes_end_on_round_numbers() {
        assert_eq!([0.99, 1.0, 3.4, 7e-5].map(round_down), [0.5, 1.0, 2.0, 5e-5]);
        assert_eq!(Axis::decades("", [0.0017, 1.0]).limits, (1e-3, 2.0));
    }

    #[test]
    fn a_chart_names_its_axes_and_series() {
        let series = Series::new("draws", COLOURS[0], Style::Line, vec![(1e-3, 0.5), (1.0, 0.25)]);
        let chart = Chart {
            title: "Errors fall".to_owned(),
            x: Axis::decades("run time (s)", [1e-3, 1.0]),
            y: Axis::linear("share", (0.0, 1.0)),
            series: vec![series.with_band(vec![(0.4, 0.6), (0.2, 0.3)])],
        };
        let svg = chart.svg();
        for text in ["Errors fall", "run time (s)", "share", "draws", "10⁻³"] {
            assert!(svg.contains(text), "no {text:?}");
        }
    }
}
