//! The picture of a model, four panels: its mean, its basis, what that leaves out, and what it draws.
//!
//! Every line of the last panel has the colour of its spectrum, because that is the quickest check there is: a model
//! of surfaces that draws no browns, or one of daylights that draws green, is wrong before any number says so.

use std::sync::Arc;

use clap::ValueEnum as _;
use kuva::prelude::{BandPlot, LinePlot, ScatterPlot, TextAnnotation, TickFormat};
use kuva::render::render::{Primitive, Scene, TextAnchor};
use spectroll::evaluation::plot::{self, Caption, TICK_SIZE, Theme};
use spectroll::{Intensity, Model, Recipe, RecipeSettings, SpectrumKind, Stream};

use super::colours::Colours;
use super::panel::{self, Axes, MARGINS, PANEL, Panel, curve};

/// The draws in the last panel.
const DRAWS: u64 = 200;

/// The most basis vectors that are shown: beyond these they hide each other.
const MAX_SHOWN: usize = 8;

/// The most components whose remaining variance is written beside its point.
const MAX_LABELLED: usize = 8;

/// Shares of variance below this are not shown: on a logarithmic axis the rounding errors of a complete basis would
/// take all the room.
const NOTHING: f64 = 1e-8;

/// Contents of a picture.
#[derive(Clone, Copy, Debug)]
pub(in crate::cli) struct Picture<'a> {
    /// Name of the model.
    pub(in crate::cli) name: &'a str,
    /// The model.
    pub(in crate::cli) model: &'a Model,
    /// The recipe of the draws, unless it was refused.
    pub(in crate::cli) recipe: Option<&'a Recipe>,
    /// The seed of the draws.
    pub(in crate::cli) seed: u64,
    /// The ground.
    pub(in crate::cli) theme: Theme,
}

impl Picture<'_> {
    /// The picture, drawn.
    pub(in crate::cli) fn drawing(&self) -> Scene {
        let draws = self.draws();
        let panels = [self.mean(), self.basis(), self.unexplained(), self.drawn(&draws)];
        let mut drawing = panel::arrange(panels, self.theme);
        drawing.elements.extend(self.key(panel::place(1).corner));
        plot::head(&mut drawing, &super::title(self.name), &self.facts(), self.theme);
        drawing
    }

    /// Describes the model, and the draws that are shown.
    fn facts(&self) -> String {
        let model = self.model;
        let components = match model.components() {
            1 => "1 component".to_owned(),
            k => format!("{k} components"),
        };
        format!("{}s at {} nm, {components}; draws of seed {}", model.kind(), model.grid(), self.seed)
    }

    fn axes(&self) -> Axes {
        Axes { kind: self.model.kind(), grid: self.model.grid().clone(), theme: self.theme }
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
        let colour = self.theme.colours()[0];
        let band = BandPlot::new(x.iter().map(|p| p.0), x.iter().map(|p| p.1), edges.iter().map(|p| p.1))
            .with_color(colour)
            .with_opacity(0.22);
        let line =
            LinePlot::new().with_data(curve(grid, mean.as_slice())).with_color(colour).with_stroke_width(2.2);
        let limits = self.axes().limits(low.iter().chain(&high));
        let caption = Caption {
            title: format!("Mean {} ± 1 standard deviation", self.model.kind()),
            note: "of the model, before any recipe".to_owned(),
            vertical: self.axes().label().to_owned(),
        };
        (vec![band.into(), line.into()], self.axes().values(limits), caption)
    }

    /// The first basis vectors.
    fn basis(&self) -> Panel {
        let (grid, parts) = (self.model.grid(), self.model.parts());
        let rows: Vec<Vec<f64>> =
            parts.basis.row_iter().take(MAX_SHOWN).map(|row| row.iter().copied().collect()).collect();
        let line = |(index, row): (usize, &Vec<f64>)| {
            LinePlot::new()
                .with_data(curve(grid, row))
                .with_color(self.theme.colours()[index])
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
        let layout = self.axes().spectra((-limit, top)).with_reference_line(self.axes().guide(0.0));
        let caption = Caption {
            title,
            note: "and the share of variance that each explains".to_owned(),
            vertical: "basis vector (unit length)".to_owned(),
        };
        (plots, layout, caption)
    }

    /// The key to the basis vectors: a few rows above the curves of a panel whose upper left corner is given. The
    /// legends of the plot library are one column wide, and would take a third of the panel.
    fn key(&self, (x, y): (f64, f64)) -> Vec<Primitive> {
        let [left, right, top, _] = MARGINS;
        let explained = &self.model.parts().explained_variance;
        let count = explained.len().min(MAX_SHOWN);
        let column = (PANEL.0 - left - right) / KEY_COLUMNS as f64;
        let (width, height) = (PANEL.0 - left - right, key_height(count));
        let ground = self.theme.ground();
        let mut elements = vec![plot::rectangle((x + left + 1.0, y + top - 1.0), (width, height), ground)];
        for (index, share) in explained.iter().take(count).enumerate() {
            let (row, place) = (index / key_columns(count), index % key_columns(count));
            let x = x + left + 8.0 + column * place as f64;
            let y = y + top + 8.0 + KEY_ROW * row as f64;
            elements.push(plot::mark((x, y), 16.0, self.theme.colours()[index], 2.6, None));
            let (at, name) = ((x + 21.0, y + 4.0), format!("{}: {}", index + 1, percent(*share)));
            elements.push(plot::text(at, TICK_SIZE, &name, TextAnchor::Start, self.theme.ink()));
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
            k @ 1..=MAX_SHOWN => self.theme.colours()[k - 1],
            _ => self.theme.quiet(),
        };
        let line =
            LinePlot::new().with_data(shown.clone()).with_color(self.theme.quiet()).with_stroke_width(1.4);
        let points = ScatterPlot::new()
            .with_data(shown.clone())
            .with_colors(shown.iter().map(colour))
            .with_size(if k <= MAX_SHOWN { 5.0 } else { 3.0 });
        let width = k as f64;
        let mut layout = self
            .theme
            .axes((-0.04 * width, 1.16 * width), (floor, 200.0), MARGINS)
            .with_log_y()
            .with_y_tick_format(TickFormat::Custom(Arc::new(decimal)))
            .with_x_tick_format(TickFormat::Custom(Arc::new(move |x| {
                if x > width { String::new() } else { format!("{x:.0}") }
            })))
            .with_x_label("number of components");
        let rest = percent(left[k].max(0.0));
        let caption = Caption {
            title: match k {
                1 => format!("One component leaves {rest} of the variance"),
                k => format!("{k} components leave {rest} of the variance"),
            },
            vertical: "variance unexplained (%)".to_owned(),
            ..Caption::default()
        };
        if k <= 20 {
            layout = layout.with_x_tick_step(if k <= 10 { 1.0 } else { 2.0 });
        }
        if k <= MAX_LABELLED {
            for &(x, y) in shown.iter().skip(1) {
                // Above and right of its point, where the falling line is not.
                let text = TextAnnotation::new(percent(y / 100.0), x + 0.09 * width, y);
                layout = layout.with_annotation(text.with_font_size(TICK_SIZE).with_color(self.theme.ink()));
            }
        }
        (vec![line.into(), points.into()], layout, caption)
    }

    /// Draws, each in its own colour.
    fn drawn(&self, draws: &[Vec<f64>]) -> Panel {
        let grid = self.model.grid();
        let colours = Colours::new(self.model.kind(), self.model.grid(), self.theme);
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
        let recipe = self.recipe.map(|recipe| described(recipe.settings())).unwrap_or_default();
        let title = match (draws.len(), recipe.as_str()) {
            (0, _) => "No draws: the recipe is refused".to_owned(),
            (n, "") => format!("{n} draws"),
            (n, recipe) => format!("{n} draws: {recipe}"),
        };
        let mut note = colours.note().to_owned();
        let above = draws.iter().filter(|draw| draw.iter().any(|&v| v > 1.0)).count();
        if self.model.kind() == SpectrumKind::Reflectance && above > 0 {
            note += &format!("; {above} exceed 1");
        }
        let caption = Caption { title, note, vertical: self.axes().label().to_owned() };
        // A panel without any line would not be drawn at all.
        let none = draws.is_empty().then(|| LinePlot::new().into());
        let limits = self.axes().limits(draws.iter().flatten());
        (draws.iter().map(line).chain(none).collect(), self.axes().values(limits), caption)
    }
}

/// Describes the settings of a recipe, for a title.
fn described(settings: &RecipeSettings) -> String {
    let bounds = settings.bounds.to_possible_value().expect("none is hidden");
    let bounds = bounds.get_name();
    let mut parts = Vec::new();
    if let Some(lrv) = settings.lrv {
        parts.push(format!("LRV {lrv}, bounds {bounds}"));
    }
    if let Some([x, y, z]) = settings.xyz {
        parts.push(format!("XYZ {x}, {y}, {z}, bounds {bounds}"));
    }
    if settings.covariance_scale != 1.0 {
        parts.push(format!("covariance × {}", settings.covariance_scale));
    }
    match settings.intensity {
        None => {}
        Some(Intensity::Fixed(factor)) => parts.push(format!("intensity {factor}")),
        Some(Intensity::LogUniform(low, high)) => parts.push(format!("intensity {low} to {high}")),
        Some(Intensity::Data) => parts.push("intensity of the data".to_owned()),
    }
    parts.join(", ")
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

/// A power of ten, in full.
fn decimal(value: f64) -> String {
    format!("{value:.*}", (-value.log10().floor()).clamp(0.0, 12.0) as usize)
}

#[cfg(test)]
mod tests {
    use spectroll::colorimetry;

    use super::*;

    fn drawing(model: &Model, recipe: Option<&Recipe>) -> String {
        plot::svg(&Picture { name: "this one", model, recipe, seed: 3, theme: Theme::Light }.drawing())
    }

    fn svg(model: &Model) -> String {
        drawing(model, Recipe::builder(model).build().as_ref().ok())
    }

    #[test]
    fn a_picture_shows_what_the_model_leaves_and_explains() {
        let svg = svg(&Model::builtin("munsell-vrhel").unwrap());
        assert_eq!(svg.split('>').next().map(|head| head.matches("font-family").count()), Some(1));
        for text in [
            "this one",
            "draws of seed 3",
            "6 components leave 0.24 % of the variance",
            "1: 78.7 %",
            "6: 0.21 %",
            ">21.3 %<",
            ">200 draws<",
            ">reflectance<",
        ] {
            assert!(svg.contains(text), "no {text:?}");
        }
    }

    #[test]
    fn the_recipe_is_in_the_title_and_what_exceeds_1_is_told() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        let recipe = Recipe::builder(&model).lrv(0.8).covariance_scale(2.0).build().unwrap();
        let svg = drawing(&model, Some(&recipe));
        assert!(svg.contains("200 draws: LRV 0.8, bounds base, covariance × 2"));
        let exceeds = |i: &u64| recipe.draw::<f64>(Stream::new(3), *i).spectrum().iter().any(|&v| v > 1.0);
        let above = (0..DRAWS).filter(exceeds);
        assert!(svg.contains(&format!("; {} exceed 1", above.count())));
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
        assert!(svg(&model(0.5, 550.0)).contains("One component leaves 0 %"));
        assert!(svg(&model(0.5, 900.0)).contains("outside the visible"));
        assert!(svg(&model(1.5, 550.0)).contains("No draws"));
    }

    #[test]
    fn a_perfect_reflector_is_white_on_dark_and_grey_on_white() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        let white = |theme: Theme| Colours::new(model.kind(), model.grid(), theme).of(&[1.0; 31]);
        assert_eq!(white(Theme::Dark), "#ffffff");
        let grey = white(Theme::Light);
        let channels = [1, 3, 5].map(|i| u8::from_str_radix(&grey[i..i + 2], 16).unwrap());
        let [half, ..] = colorimetry::encode_srgb([0.5; 3]);
        assert!(channels.iter().all(|&c| c.abs_diff(half) <= 1), "{grey}");
    }

    #[test]
    fn percentages_have_the_decimals_that_matter() {
        let shares = [0.787, 0.9976, 0.00208, 1.0, 0.99995, 1.0 - 1e-9];
        assert_eq!(shares.map(percent), ["78.7 %", "99.76 %", "0.21 %", "100 %", "99.995 %", "100 %"]);
    }
}
