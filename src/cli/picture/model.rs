//! The picture of a model, four panels: its mean, its basis, what that leaves out, and what it draws.
//!
//! Every line of the last panel has the colour of its spectrum, because that is the quickest check there is: a model
//! of surfaces that draws no browns, or one of daylights that draws green, is wrong before any number says so.

use std::sync::Arc;

use kuva::prelude::{
    BandPlot, Figure, Layout, LinePlot, Plot, ReferenceLine, ScatterPlot, ShadedRegion, TextAnnotation,
    TickFormat,
};
use kuva::render::render::{Primitive, Scene, TextAnchor};
use spectroll::evaluation::plot::{self, COLOURS, DARK, Heading, LABEL_SIZE, QUIET};
use spectroll::{Grid, Model, Recipe, SpectrumKind, Stream, colorimetry};

/// The size of a panel; two by two make a picture.
const PANEL: (f64, f64) = (480.0, 350.0);

/// Margins of a panel for text on its left, right, top and bottom: the same for all, so that their axes align.
const MARGINS: [f64; 4] = [50.0, 16.0, 62.0, 46.0];

const HEADING: Heading = Heading { title_size: 16, x: 10.0, title: 24.0, label: 45.0 };

/// Between panels and around them.
const GAP: f64 = 14.0;

/// The draws in the last panel.
const DRAWS: u64 = 200;

/// The most basis vectors that are shown: beyond these they hide each other.
const MAX_SHOWN: usize = COLOURS.len();

/// The most components whose cumulated variance is written beside its point.
const MAX_LABELLED: usize = 8;

/// The luminance that lights are shown at, where white is 1: bright, with room for their colours.
const LIGHT_LUMINANCE: f64 = 0.6;

/// Shares of variance below this are not shown: on a logarithmic axis the rounding errors of a complete basis would
/// take all the room.
const NOTHING: f64 = 1e-8;

const ACCENT: &str = "#3b5b7c";

/// Contents of a picture.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Picture<'a> {
    /// The model.
    pub(in crate::cli) model: &'a Model,
    /// Its plain recipe, where it has one.
    pub(in crate::cli) recipe: Option<&'a Recipe>,
    /// The seed of the draws.
    pub(in crate::cli) seed: u64,
}

/// One panel: what is drawn, and on what axes.
type Panel = (Vec<Plot>, Layout);

impl Picture<'_> {
    /// The picture, drawn.
    pub(in crate::cli) fn drawing(&self) -> Scene {
        let draws = self.draws();
        let panels = [self.mean(), self.basis(), self.unexplained(), self.drawn(&draws)];
        let (plots, layouts) = panels.into_iter().unzip();
        let mut scene = Figure::new(2, 2)
            .with_plots(plots)
            .with_layouts(layouts)
            .with_cell_size(PANEL.0, PANEL.1)
            .with_spacing(GAP)
            .with_padding(GAP)
            .render();
        HEADING.set(&mut scene);
        scene.elements.extend(self.key((2.0 * GAP + PANEL.0, GAP)));
        scene
    }

    fn draws(&self) -> Vec<Vec<f64>> {
        let stream = Stream::new(self.seed);
        self.recipe.map_or_else(Vec::new, |recipe| {
            (0..DRAWS).map(|i| recipe.draw(stream, i).spectrum().to_vec()).collect()
        })
    }

    /// The mean, and how far spectra of the model lie from it.
    fn mean(&self) -> Panel {
        let (grid, parts) = (self.model.grid(), self.model.parts());
        let mean = self.model.reconstruct(parts.weight_mean.as_slice());
        let deviation = deviation(self.model);
        let low: Vec<f64> = mean.iter().zip(&deviation).map(|(m, d)| m - d).collect();
        let high: Vec<f64> = mean.iter().zip(&deviation).map(|(m, d)| m + d).collect();
        let (x, edges) = (curve(grid, &low), curve(grid, &high));
        let band = BandPlot::new(x.iter().map(|p| p.0), x.iter().map(|p| p.1), edges.iter().map(|p| p.1))
            .with_color(ACCENT)
            .with_opacity(0.22);
        let line =
            LinePlot::new().with_data(curve(grid, mean.as_slice())).with_color(ACCENT).with_stroke_width(2.4);
        let limits = self.value_limits(low.iter().chain(&high));
        let layout = spectra(grid, limits)
            .with_title(format!("The mean {} ± 1 standard deviation", self.model.kind()))
            .with_y_label(self.value_label());
        (vec![band.into(), line.into()], layout)
    }

    /// The first basis vectors.
    fn basis(&self) -> Panel {
        let (grid, parts) = (self.model.grid(), self.model.parts());
        let rows: Vec<Vec<f64>> =
            parts.basis.row_iter().take(MAX_SHOWN).map(|row| row.iter().copied().collect()).collect();
        let line = |(index, row): (usize, &Vec<f64>)| {
            LinePlot::new()
                .with_data(curve(grid, row))
                .with_color(COLOURS[index])
                .with_stroke_width(if index == 0 { 2.6 } else { 1.6 })
                .into()
        };
        let plots = rows.iter().enumerate().map(line).collect();
        let title = match self.model.components() {
            1 => "The basis vector".to_owned(),
            k if k <= MAX_SHOWN => format!("The {k} basis vectors"),
            k => format!("The first {MAX_SHOWN} of {k} basis vectors"),
        };
        let limit = 1.06 * rows.iter().flatten().fold(0.0, |a: f64, v| a.max(v.abs()));
        let covered = key_height(rows.len()) / (PANEL.1 - MARGINS[2] - MARGINS[3]);
        let top = limit + 2.0 * limit * covered / (1.0 - covered);
        let layout = spectra(grid, (-limit, top))
            .with_title(title)
            .with_y_label("unit vectors, and the share of variance that each explains")
            .with_reference_line(ReferenceLine::horizontal(0.0).with_color(QUIET).with_stroke_width(0.8));
        (plots, layout)
    }

    /// The key to the basis vectors: a few rows above the curves of a panel whose upper left corner is given. The
    /// legends of the plot library are one column wide, and would take a third of the panel.
    fn key(&self, (x, y): (f64, f64)) -> Vec<Primitive> {
        let [left, right, top, _] = MARGINS;
        let explained = &self.model.parts().explained_variance;
        let count = explained.len().min(MAX_SHOWN);
        let column = (PANEL.0 - left - right) / KEY_COLUMNS as f64;
        let (width, height) = (PANEL.0 - left - right, key_height(count));
        let mut elements = vec![plot::rectangle((x + left + 1.0, y + top - 1.0), (width, height), "#ffffff")];
        for (index, share) in explained.iter().take(count).enumerate() {
            let (row, place) = (index / key_columns(count), index % key_columns(count));
            let x = x + left + 8.0 + column * place as f64;
            let y = y + top + 8.0 + KEY_ROW * row as f64;
            elements.push(plot::mark((x, y), 20.0, COLOURS[index], 2.6, None));
            let name = format!("{}: {}", index + 1, percent(*share));
            elements.push(plot::text((x + 27.0, y + 4.0), LABEL_SIZE - 1, &name, TextAnchor::Start, None));
        }
        elements
    }

    /// The share of variance that the first components leave, from 1 down.
    fn unexplained(&self) -> Panel {
        let left = unexplained(&self.model.parts().explained_variance);
        let shown: Vec<(f64, f64)> = left
            .iter()
            .enumerate()
            .filter(|(_, left)| **left > NOTHING)
            .map(|(k, left)| (k as f64, 100.0 * left))
            .collect();
        let k = self.model.components();
        let lowest = shown.iter().fold(100.0, |a: f64, p| a.min(p.1));
        let floor = 10f64.powf((lowest / 1.5).log10().floor());
        let colour = |&(x, _): &(f64, f64)| match x as usize {
            k @ 1..=MAX_SHOWN => COLOURS[k - 1],
            _ => QUIET,
        };
        let line = LinePlot::new().with_data(shown.clone()).with_color(QUIET).with_stroke_width(1.4);
        let points = ScatterPlot::new()
            .with_data(shown.clone())
            .with_colors(shown.iter().map(colour))
            .with_size(if k <= MAX_SHOWN { 5.0 } else { 3.0 });
        let width = k as f64;
        let mut layout = panel((-0.04 * width, 1.16 * width), (floor, 200.0))
            .with_log_y()
            .with_y_tick_format(TickFormat::Custom(Arc::new(decimal)))
            .with_x_tick_format(TickFormat::Custom(Arc::new(move |x| {
                if x > width { String::new() } else { format!("{x:.0}") }
            })))
            .with_x_label("components")
            .with_y_label("variance left unexplained (%)")
            .with_title(match (k, 1.0 - left[k]) {
                (1, share) => format!("One component explains {} of the variance", percent(share)),
                (k, share) => format!("{k} components explain {} of the variance", percent(share)),
            });
        if k <= 20 {
            layout = layout.with_x_tick_step(if k <= 10 { 1.0 } else { 2.0 });
        }
        if k <= MAX_LABELLED {
            for &(x, y) in shown.iter().skip(1) {
                // Above and right of its point, where the falling line is not.
                let text = percent(1.0 - y / 100.0);
                let text = TextAnnotation::new(text, x + 0.08 * width, y).with_font_size(LABEL_SIZE - 1);
                layout = layout.with_annotation(text);
            }
        }
        (vec![line.into(), points.into()], layout)
    }

    /// Draws, each in its own colour.
    fn drawn(&self, draws: &[Vec<f64>]) -> Panel {
        let grid = self.model.grid();
        let colours = Colours::new(self.model);
        let stroke = match self.model.kind() {
            SpectrumKind::Reflectance => 1.15,
            SpectrumKind::Illuminant => 0.9, // they lie close together
        };
        let line = |draw: &Vec<f64>| {
            LinePlot::new()
                .with_data(curve(grid, draw))
                .with_color(colours.of(draw))
                .with_stroke_width(stroke)
                .into()
        };
        let limits = self.value_limits(draws.iter().flatten());
        let title = match (draws.len(), self.model.kind(), &colours) {
            (0, ..) => "No draws: the plain recipe is refused".to_owned(),
            (n, _, Colours::Unseen) => format!("{n} draws"),
            (n, SpectrumKind::Reflectance, _) => format!("{n} draws, in their colours under D65"),
            (n, SpectrumKind::Illuminant, _) => format!("{n} draws, in the colours of their light"),
        };
        // On white, pale surfaces and all lights would drown.
        let night = ShadedRegion::horizontal(limits.0, limits.1).with_color(DARK).with_opacity(1.0);
        let layout = spectra(grid, limits)
            .with_title(title)
            .with_y_label(self.value_label())
            .with_shaded_region(night);
        // A panel without any line would not be drawn at all.
        let none = draws.is_empty().then(|| LinePlot::new().into());
        (draws.iter().map(line).chain(none).collect(), layout)
    }

    fn value_label(&self) -> &'static str {
        match self.model.kind() {
            SpectrumKind::Reflectance => "reflectance",
            SpectrumKind::Illuminant => "relative power",
        }
    }

    /// The limits of an axis of spectral values.
    fn value_limits<'v>(&self, values: impl Iterator<Item = &'v f64>) -> (f64, f64) {
        let (low, high) = values.fold((0.0, 0.0), |(a, b): (f64, f64), &v| (a.min(v), b.max(v)));
        match self.model.kind() {
            SpectrumKind::Reflectance if high <= 1.0 => (1.05 * low, 1.0),
            SpectrumKind::Illuminant if high <= 0.0 => (1.05 * low, 1.0),
            _ => (1.05 * low, 1.05 * high),
        }
    }
}

/// Conversion of a spectrum to a colour.
enum Colours {
    /// Weights of X, Y and Z that make white of a perfect reflector.
    Reflected([Vec<f64>; 3]),
    /// Weights of X, Y and Z; the luminance is [`LIGHT_LUMINANCE`] whatever the power.
    Emitted([Vec<f64>; 3]),
    /// The grid has no light that the eye sees.
    Unseen,
}

impl Colours {
    fn new(model: &Model) -> Colours {
        let grid = model.grid();
        match (colorimetry::xyz_weights(grid), model.kind()) {
            (None, _) => Colours::Unseen,
            (Some(weights), SpectrumKind::Reflectance) => Colours::Reflected(weights),
            (Some(_), SpectrumKind::Illuminant) => Colours::Emitted(colorimetry::cmf(grid)),
        }
    }

    /// The colour of a spectrum, as `#rrggbb`.
    fn of(&self, spectrum: &[f64]) -> String {
        let xyz = |weights: &[Vec<f64>; 3]| {
            [0, 1, 2].map(|i| weights[i].iter().zip(spectrum).map(|(w, s)| w * s).sum::<f64>())
        };
        let linear = match self {
            Colours::Reflected(weights) => colorimetry::linear_srgb(xyz(weights)),
            Colours::Emitted(weights) => shown_light(xyz(weights)),
            Colours::Unseen => return QUIET.to_owned(),
        };
        plot::exact_hex(linear)
    }
}

/// Linear components of a light at [`LIGHT_LUMINANCE`], or below it where a component would exceed 1.
fn shown_light(xyz: [f64; 3]) -> [f64; 3] {
    if xyz[1] <= 0.0 {
        return [0.5; 3];
    }
    let linear = colorimetry::linear_srgb(xyz.map(|v| v * LIGHT_LUMINANCE / xyz[1]));
    let largest = linear.into_iter().fold(1.0, f64::max);
    linear.map(|v| v / largest)
}

/// The standard deviation of the model's spectra, band by band: the root of the diagonal of basis' . covariance .
/// basis.
fn deviation(model: &Model) -> Vec<f64> {
    let parts = model.parts();
    let columns = &parts.weight_covariance * &parts.basis;
    let variance = |band| parts.basis.column(band).dot(&columns.column(band));
    (0..model.bands()).map(|band| variance(band).max(0.0).sqrt()).collect()
}

/// The share of variance that the first 0, 1, ... k components leave.
fn unexplained(explained: &[f64]) -> Vec<f64> {
    let mut left = 1.0;
    let rest = explained.iter().map(|share| {
        left -= share;
        left
    });
    std::iter::once(1.0).chain(rest).collect()
}

/// A share as a percentage, with the decimals that still tell it from 100 % or from nothing.
fn percent(share: f64) -> String {
    let percent = 100.0 * share;
    let decimals = match percent.min(100.0 - percent).abs() {
        d if d >= 1.0 => 1,
        d if d >= 0.01 => 2,
        d if d >= 0.0005 => 3,
        _ => 0,
    };
    format!("{percent:.decimals$} %")
}

/// The points of a spectrum's line. A single band is a line as wide as its step.
fn curve(grid: Grid, values: &[f64]) -> Vec<(f64, f64)> {
    match values {
        [value] => [-0.5, 0.5].map(|side| (grid.first() + side * grid.step(), *value)).to_vec(),
        _ => grid.wavelengths().zip(values.iter().copied()).collect(),
    }
}

/// The ends of an axis of wavelengths.
fn limits(grid: Grid) -> (f64, f64) {
    let pad = if grid.len() == 1 { grid.step() } else { 0.0 };
    (grid.first() - pad, grid.last() + pad)
}

/// Axes for spectra.
fn spectra(grid: Grid, y: (f64, f64)) -> Layout {
    panel(limits(grid), y)
        .with_x_label("wavelength (nm)")
        .with_y_tick_format(TickFormat::Custom(Arc::new(spectral_value)))
}

/// The most entries in a row of the key, and the height of a row.
const KEY_COLUMNS: usize = 4;
const KEY_ROW: f64 = 18.0;

/// The entries in a full row of a key of `count`, such that its rows are equally long.
fn key_columns(count: usize) -> usize {
    count.div_ceil(count.div_ceil(KEY_COLUMNS))
}

/// The height of a key of `count` entries.
fn key_height(count: usize) -> f64 {
    count.div_ceil(KEY_COLUMNS) as f64 * KEY_ROW + 4.0
}

/// A value of a spectrum, short enough for the left margin.
fn spectral_value(value: f64) -> String {
    if value.abs() < 1e5 { TickFormat::Auto.format(value) } else { TickFormat::Sci.format(value) }
}

/// A power of ten, in full.
fn decimal(value: f64) -> String {
    format!("{value:.*}", (-value.log10().floor()).clamp(0.0, 12.0) as usize)
}

/// Axes with exactly these limits, in the style that all panels share.
fn panel(x: (f64, f64), y: (f64, f64)) -> Layout {
    plot::axes(x, y, MARGINS, HEADING.title_size)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn svg(model: &Model) -> String {
        let recipe = Recipe::builder(model).build();
        let picture = Picture { model, recipe: recipe.as_ref().ok(), seed: 0 };
        plot::svg(&picture.drawing())
    }

    #[test]
    fn a_picture_shows_what_the_model_explains() {
        let svg = svg(&Model::builtin("munsell-vrhel").unwrap());
        for text in ["6 components explain 99.76 % of the variance", "1: 78.7 %", "6: 0.21 %", "200 draws"] {
            assert!(svg.contains(text), "no {text:?}");
        }
    }

    #[test]
    fn odd_models_have_pictures() {
        let model = |mean: f64, wavelength: f64| {
            let text = format!(
                r#"{{"schema": 1, "kind": "reflectance", "wavelengths": [{wavelength}], "mean": [{mean}],
                "basis": [[1]], "weight_mean": [0], "weight_covariance": [[1e-4]], "explained_variance": [1],
                "normalization": "none", "sources": []}}"#
            );
            Model::from_json("test", &text).unwrap()
        };
        assert!(svg(&model(0.5, 550.0)).contains("One component explains 100 %"));
        assert!(svg(&model(0.5, 900.0)).contains("200 draws<"));
        assert!(svg(&model(1.5, 550.0)).contains("No draws"));
    }

    #[test]
    fn a_perfect_reflector_is_white_and_lights_are_not_clipped() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        assert_eq!(Colours::new(&model).of(&[1.0; 31]), "#ffffff");
        let blue = shown_light([0.2, 0.05, 1.0]);
        assert!((blue[2] - 1.0).abs() < 1e-12, "{blue:?}");
        let day = shown_light([95.05, 100.0, 108.9]);
        assert!(day.iter().all(|v| (v - LIGHT_LUMINANCE).abs() < 1e-3), "{day:?}");
    }

    #[test]
    fn percentages_have_the_decimals_that_matter() {
        let shares = [0.787, 0.9976, 0.00208, 1.0, 0.99995, 1.0 - 1e-9];
        assert_eq!(shares.map(percent), ["78.7 %", "99.76 %", "0.21 %", "100 %", "99.995 %", "100 %"]);
    }
}
