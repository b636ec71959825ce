//! Colours of pictures on a white or a dark ground, and the axes, names and headings drawn in them.

use kuva::prelude::Layout;
use kuva::render::render::{Primitive, Scene, TextAnchor};

use super::{text, upright};

/// Size of the names of axes and of captions.
pub const LABEL_SIZE: u32 = 13;
/// Size of the numbers on axes and of the text in keys.
pub const TICK_SIZE: u32 = 12;
/// Size of a panel's title.
pub const TITLE_SIZE: u32 = 15;

/// Colours that the colour-blind too tell apart (Okabe and Ito's without their yellow), and two more.
const ON_WHITE: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6b4c9a", "#7f7f7f"];
/// Lighter shades of the hues.
const ON_DARK: [&str; 8] =
    ["#4aa3df", "#ff8c42", "#2ec4a0", "#e3a0c6", "#f2c14e", "#a6dcf9", "#a88bd6", "#a9adb5"];

/// The ground of a picture, and the colours that show on it.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Theme {
    /// White ground, for print.
    #[default]
    Light,
    /// Dark ground, for screens and slides.
    Dark,
}

impl Theme {
    /// Colour of the ground.
    pub const fn ground(self) -> &'static str {
        self.pick("#ffffff", "#17181c")
    }

    /// Colour of text and axes.
    pub const fn ink(self) -> &'static str {
        self.pick("#1f2328", "#e4e6ea")
    }

    /// Colour of notes, and of lines that only guide the eye.
    pub const fn quiet(self) -> &'static str {
        self.pick("#6a717b", "#9aa1ab")
    }

    /// Colour of grid lines, and the ground of what has colours of its own.
    pub const fn pale(self) -> &'static str {
        self.pick("#e6e8eb", "#30333b")
    }

    /// Colours of series, in the order in which they are used.
    pub const fn colours(self) -> [&'static str; 8] {
        match self {
            Theme::Light => ON_WHITE,
            Theme::Dark => ON_DARK,
        }
    }

    /// Luminance of a perfect white drawn as a line or a point, where the white of the display has 1. On a white
    /// ground it must be darker than the ground, and everything else with it.
    pub const fn white_luminance(self) -> f64 {
        match self {
            Theme::Light => 0.5,
            Theme::Dark => 1.0,
        }
    }

    /// Luminance of colours that are drawn for their chromaticity alone, as those of lights are: bright enough to tell
    /// hues apart, and different from the ground.
    pub const fn chromatic_luminance(self) -> f64 {
        match self {
            Theme::Light => 0.3,
            Theme::Dark => 0.6,
        }
    }

    const fn pick(self, light: &'static str, dark: &'static str) -> &'static str {
        match self {
            Theme::Light => light,
            Theme::Dark => dark,
        }
    }

    /// An empty drawing.
    pub fn canvas(self, width: f64, height: f64) -> Scene {
        let mut drawing = Scene::new(width, height);
        drawing.background_color = Some(self.ground().to_owned());
        drawing.text_color = Some(self.ink().to_owned());
        drawing
    }

    /// Axes with exactly these limits. `margins` are left for text on the left, right, top and bottom.
    pub fn axes(self, x: (f64, f64), y: (f64, f64), margins: [f64; 4]) -> Layout {
        self.layout([x, y], margins, self.ink(), self.pale())
    }

    /// A ground of the same size without axes, for words.
    pub fn blank(self, margins: [f64; 4]) -> Layout {
        self.layout([(0.0, 1.0); 2], margins, self.ground(), self.ground())
    }

    fn layout(self, [x, y]: [(f64, f64); 2], margins: [f64; 4], ink: &str, grid: &str) -> Layout {
        let theme = kuva::prelude::Theme {
            background: self.ground().into(),
            axis_color: ink.into(),
            tick_color: ink.into(),
            text_color: ink.into(),
            grid_color: grid.into(),
            legend_border: "none".into(),
            ..kuva::prelude::Theme::light()
        };
        let [left, right, top, bottom] = margins;
        Layout::new(x, y)
            .with_x_axis_min(x.0)
            .with_x_axis_max(x.1)
            .with_y_axis_min(y.0)
            .with_y_axis_max(y.1)
            .with_theme(theme)
            .with_force_margins(left, right)
            .with_force_margins_y(top, bottom)
            .with_label_size(LABEL_SIZE)
            .with_tick_size(TICK_SIZE)
    }
}

/// Place of a panel in a picture: its upper left corner, its size, and what its axes leave on the left, right, top and
/// bottom.
#[derive(Clone, Copy, Debug)]
pub struct Place {
    /// Upper left corner.
    pub corner: (f64, f64),
    /// Width and height.
    pub size: (f64, f64),
    /// Margins around the axes.
    pub margins: [f64; 4],
}

impl Place {
    /// Sentences within the axes, for a panel that has nothing to show and a reason for it.
    pub fn paragraph(&self, lines: &[String], theme: Theme) -> Vec<Primitive> {
        let Place { corner: (x, y), margins: [left, _, top, _], .. } = *self;
        let line = |(row, line): (usize, &String)| {
            let at = (x + left + 14.0, y + top + 26.0 + 18.0 * row as f64);
            text(at, LABEL_SIZE, line, TextAnchor::Start, theme.ink())
        };
        lines.iter().enumerate().map(line).collect()
    }
}

/// Text around the axes of a panel: a title, a note below it, and the name of the vertical axis. The plot library
/// centres titles and has no notes, and sets names of vertical axes at a distance that differs from panel to panel.
#[derive(Clone, Debug, Default)]
pub struct Caption {
    /// The title.
    pub title: String,
    /// Further remarks that a reader of the panel needs.
    pub note: String,
    /// Name and unit of the vertical axis.
    pub vertical: String,
}

impl Caption {
    /// The text of a panel at `place`.
    pub fn draw(&self, place: &Place, theme: Theme) -> Vec<Primitive> {
        let Place { corner: (x, y), size, margins: [_, _, top, bottom] } = *place;
        let at = |dx: f64, dy: f64| (x + dx, y + dy);
        let mut all = vec![
            text(at(8.0, 20.0), TITLE_SIZE, &self.title, TextAnchor::Start, theme.ink()),
            text(at(8.0, 39.0), TICK_SIZE, &self.note, TextAnchor::Start, theme.quiet()),
            upright(text(
                at(16.0, (top + size.1 - bottom) / 2.0),
                LABEL_SIZE,
                &self.vertical,
                TextAnchor::Middle,
                theme.ink(),
            )),
        ];
        all.retain(|text| !matches!(text, Primitive::Text { content, .. } if content.is_empty()));
        all
    }
}

/// Height of a picture's head.
const HEAD: f64 = 54.0;

/// Moves a drawing down, and writes above it what it is of and how it was made.
pub fn head(drawing: &mut Scene, title: &str, note: &str, theme: Theme) {
    drawing.height += HEAD;
    let transform = Some(format!("translate(0,{HEAD})"));
    drawing.elements.insert(0, Primitive::GroupStart { transform, title: None, extra_attrs: None });
    drawing.elements.push(Primitive::GroupEnd);
    drawing.elements.push(text((22.0, 32.0), TITLE_SIZE + 4, title, TextAnchor::Start, theme.ink()));
    drawing.elements.push(text((22.0, 54.0), LABEL_SIZE, note, TextAnchor::Start, theme.quiet()));
}
