//! Common parts of all pictures: colours, axes, headings, shapes, and the files they become.
//!
//! It is public for the program, and no part of the library's interface.

use std::path::Path;

use kuva::RasterBackend;
use kuva::prelude::{Layout, SvgBackend, Theme};
use kuva::render::render::{Primitive, Scene, TextAnchor};

use crate::colorimetry;

/// Colour of text and axes.
pub const INK: &str = "#2b2f36";
/// Colour of the names of axes.
pub const LABEL_INK: &str = "#5b626c";
/// Colour of guides.
pub const QUIET: &str = "#8a9099";
/// Ground for colours that would drown on white.
pub const DARK: &str = "#17181c";
/// Colour of grid lines, and ground for what has colours of its own.
pub const PALE: &str = "#e6e8eb";

/// Colours of Okabe and Ito, told apart by the colour-blind too, without their yellow, and two more.
pub const COLOURS: [&str; 8] =
    ["#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#6b4c9a", "#7f7f7f"];

/// Size of the text on axes and in keys.
pub const LABEL_SIZE: u32 = 12;

/// Pixels of a PNG for each unit of an SVG.
const SCALE: f32 = 1.5;

/// Format of a picture.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Vectors.
    Svg,
    /// Pixels.
    Png,
}

impl PictureFormat {
    /// Returns the format that the extension of `path` names, if it does.
    pub fn of(path: &Path) -> Option<PictureFormat> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "svg" => Some(PictureFormat::Svg),
            "png" => Some(PictureFormat::Png),
            _ => None,
        }
    }

    /// Encodes a drawing as a file.
    pub fn bytes(self, drawing: &Scene) -> Result<Vec<u8>, String> {
        match self {
            PictureFormat::Svg => Ok(svg(drawing).into_bytes()),
            PictureFormat::Png => RasterBackend::new().with_scale(SCALE).render_scene(drawing),
        }
    }
}

/// Encodes a drawing as SVG.
pub fn svg(drawing: &Scene) -> String {
    SvgBackend::new().render_scene(drawing)
}

/// Makes axes with exactly these limits, in the style that all plots share. `margins` are the room for text on the
/// left, right, top and bottom.
pub fn axes(x: (f64, f64), y: (f64, f64), margins: [f64; 4], title_size: u32) -> Layout {
    let theme = Theme {
        axis_color: INK.into(),
        tick_color: INK.into(),
        text_color: INK.into(),
        grid_color: PALE.into(),
        legend_border: "none".into(),
        ..Theme::light()
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
        .with_title_size(title_size)
        .with_label_size(LABEL_SIZE)
        .with_tick_size(LABEL_SIZE - 1)
}

/// Place of a plot's heading: its title, and below that the name of its vertical axis.
#[derive(Clone, Copy, Debug)]
pub struct Heading {
    /// Size of the title, which tells it from other text.
    pub title_size: u32,
    /// Left end of both.
    pub x: f64,
    /// Base line of the title.
    pub title: f64,
    /// Base line of the axis' name.
    pub label: f64,
}

impl Heading {
    /// Moves titles, and the names of vertical axes, to the upper left corner of their plot, level: turned text is
    /// drawn badly by the rasterizer, and read badly anywhere.
    pub fn set(&self, drawing: &mut Scene) {
        for element in &mut drawing.elements {
            self.move_text(element);
        }
    }

    fn move_text(&self, element: &mut Primitive) {
        if let Primitive::Text { x, y, size, anchor, rotate, color, .. } = element {
            let is_title = *size == self.title_size;
            if is_title || rotate.is_some() {
                (*x, *y) = (self.x, if is_title { self.title } else { self.label });
                (*anchor, *rotate) = (TextAnchor::Start, None);
                *color = (!is_title).then(|| LABEL_INK.into());
            }
        }
    }
}

/// A line that joins points.
pub fn line(points: &[(f64, f64)], stroke: &str, stroke_width: f64) -> Primitive {
    Primitive::PolyLine {
        points: points.to_vec(),
        stroke: stroke.into(),
        stroke_width,
        stroke_dasharray: None,
    }
}

/// The mark of a line in a key, from `x` on.
pub fn mark((x, y): (f64, f64), length: f64, stroke: &str, width: f64, dashes: Option<&str>) -> Primitive {
    Primitive::Line {
        x1: x,
        y1: y,
        x2: x + length,
        y2: y,
        stroke: stroke.into(),
        stroke_width: width,
        stroke_dasharray: dashes.map(Into::into),
    }
}

/// A filled rectangle.
pub fn rectangle((x, y): (f64, f64), (width, height): (f64, f64), fill: &str) -> Primitive {
    Primitive::Rect {
        x,
        y,
        width,
        height,
        fill: fill.into(),
        stroke: None,
        stroke_width: None,
        opacity: None,
    }
}

/// A line of text, in the colour of the theme unless one is given.
pub fn text(
    (x, y): (f64, f64),
    size: u32,
    content: &str,
    anchor: TextAnchor,
    colour: Option<&str>,
) -> Primitive {
    let (content, color) = (content.to_owned(), colour.map(Into::into));
    Primitive::Text { x, y, content, size, anchor, rotate: None, bold: false, color }
}

/// The sRGB colour of linear components as `#rrggbb`, darker where one of them would exceed 1.
pub fn hex(linear: [f64; 3]) -> String {
    let largest = linear.into_iter().fold(1.0, f64::max);
    exact_hex(linear.map(|v| v / largest))
}

/// The sRGB colour of linear components as `#rrggbb`, each of them cut to 0 to 1.
pub fn exact_hex(linear: [f64; 3]) -> String {
    let [r, g, b] = colorimetry::encode_srgb(linear);
    format!("#{r:02x}{g:02x}{b:02x}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_picture_is_named_svg_or_png() {
        assert_eq!(PictureFormat::of(Path::new("a.PNG")), Some(PictureFormat::Png));
        assert_eq!(PictureFormat::of(Path::new("a.b.svg")), Some(PictureFormat::Svg));
        assert_eq!([Path::new("a.jpg"), Path::new("svg")].map(PictureFormat::of), [None, None]);
    }

    #[test]
    fn what_is_too_light_keeps_its_hue() {
        assert_eq!(hex([2.0, 1.0, 0.0]), exact_hex([1.0, 0.5, 0.0]));
        assert_eq!([hex([1.0; 3]), exact_hex([2.0; 3])], ["#ffffff", "#ffffff"]);
    }
}
