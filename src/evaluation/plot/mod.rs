//! Parts that all pictures share: themes, shapes, and how drawings become files.
//!
//! It is public for the program, and no part of the library's interface.

mod pdf;
mod theme;
mod typeface;

use std::path::Path;

use kuva::RasterBackend;
use kuva::prelude::SvgBackend;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};

use crate::colorimetry;
pub use theme::{Caption, LABEL_SIZE, Place, TICK_SIZE, TITLE_SIZE, Theme, head};

/// Pixels of a PNG for each unit of an SVG: a picture as wide as a page has some 300 dots an inch.
const SCALE: f32 = 2.0;

/// Typefaces of an SVG, the first that the viewer has. PNG and PDF files carry the first.
const FONTS: &str = "DejaVu Sans, Verdana, Liberation Sans, Arial, sans-serif";

/// A format of pictures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PictureFormat {
    /// Vectors, for the web.
    Svg,
    /// Pixels.
    Png,
    /// Vectors with their typeface, for print.
    Pdf,
}

impl PictureFormat {
    /// The format that the extension of `path` names, if it does.
    pub fn of(path: &Path) -> Option<PictureFormat> {
        match path.extension()?.to_str()?.to_ascii_lowercase().as_str() {
            "svg" => Some(PictureFormat::Svg),
            "png" => Some(PictureFormat::Png),
            "pdf" => Some(PictureFormat::Pdf),
            _ => None,
        }
    }

    /// The bytes of a drawing as a file, or why there are none.
    pub fn bytes(self, drawing: &Scene) -> Result<Vec<u8>, String> {
        match self {
            PictureFormat::Svg => Ok(svg(drawing).into_bytes()),
            PictureFormat::Png => {
                RasterBackend::new().with_scale(SCALE).render_scene(&typeface::outlined(drawing)?)
            }
            PictureFormat::Pdf => pdf::document(drawing),
        }
    }
}

/// A drawing as SVG that scales with the page it is on.
pub fn svg(drawing: &Scene) -> String {
    let (width, height) = (drawing.width.ceil(), drawing.height.ceil());
    // The plot library writes no view box, and the typeface only of drawings that name one.
    let mut head = format!(r#"<svg viewBox="0 0 {width} {height}" "#);
    if drawing.font_family.is_none() {
        head += &format!(r#"font-family="{FONTS}" "#);
    }
    SvgBackend::new().render_scene(drawing).replacen("<svg ", &head, 1)
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

/// A disc, with a rim where it has a colour.
pub fn disc((cx, cy): (f64, f64), r: f64, fill: &str, rim: Option<&str>) -> Primitive {
    Primitive::Circle {
        cx,
        cy,
        r,
        fill: fill.into(),
        fill_opacity: None,
        stroke: rim.map(Into::into),
        stroke_width: rim.map(|_| 0.9),
    }
}

/// A square on its corner, with a rim.
pub fn diamond((x, y): (f64, f64), r: f64, fill: &str, rim: &str) -> Primitive {
    Primitive::Path(Box::new(PathData {
        d: format!("M{} {y} L{x} {} L{} {y} L{x} {} Z", x - r, y - r, x + r, y + r),
        fill: Some(fill.into()),
        stroke: rim.into(),
        stroke_width: 0.9,
        opacity: None,
        stroke_dasharray: None,
    }))
}

/// A line of text.
pub fn text((x, y): (f64, f64), size: u32, content: &str, anchor: TextAnchor, colour: &str) -> Primitive {
    let (content, color) = (content.to_owned(), Some(colour.into()));
    Primitive::Text { x, y, content, size, anchor, rotate: None, bold: false, color }
}

/// Turns a line of text, to read from below to above.
pub fn upright(text: Primitive) -> Primitive {
    match text {
        Primitive::Text { x, y, content, size, anchor, bold, color, .. } => {
            Primitive::Text { x, y, content, size, anchor, rotate: Some(-90.0), bold, color }
        }
        other => other,
    }
}

/// The sRGB colour of tristimulus values at this luminance, or below it where a component would exceed 1. What has no
/// luminance is grey.
pub fn chromatic(xyz: [f64; 3], luminance: f64) -> String {
    match xyz[1] > 0.0 {
        true => hex(colorimetry::linear_srgb(xyz.map(|v| v * luminance / xyz[1]))),
        false => exact_hex([luminance; 3]),
    }
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
    fn the_extension_names_the_format() {
        assert_eq!(PictureFormat::of(Path::new("a.PNG")), Some(PictureFormat::Png));
        assert_eq!(PictureFormat::of(Path::new("a.b.svg")), Some(PictureFormat::Svg));
        assert_eq!(PictureFormat::of(Path::new("a.pdf")), Some(PictureFormat::Pdf));
        assert_eq!([Path::new("a.jpg"), Path::new("svg")].map(PictureFormat::of), [None, None]);
    }

    #[test]
    fn an_svg_scales_and_names_its_typeface() {
        let svg = svg(&Theme::Dark.canvas(300.0, 199.5));
        let head = svg.split_once('>').expect("it is an element").0;
        for part in [r#"viewBox="0 0 300 200""#, "DejaVu Sans", Theme::Dark.ink()] {
            assert!(head.contains(part), "no {part} in {head}");
        }
        assert_eq!(head.matches("font-family").count(), 1);
    }

    #[test]
    fn lights_have_their_luminance_unless_it_would_be_clipped() {
        assert_eq!(chromatic([95.05, 100.0, 108.9], 0.3), exact_hex([0.3; 3]));
        let blue = chromatic([0.2, 0.05, 1.0], 0.6);
        assert!(blue.ends_with("ff"), "{blue}");
        assert_eq!(chromatic([0.0; 3], 0.6), exact_hex([0.6; 3]));
    }

    #[test]
    fn what_is_too_light_keeps_its_hue() {
        assert_eq!(hex([2.0, 1.0, 0.0]), exact_hex([1.0, 0.5, 0.0]));
        assert_eq!([hex([1.0; 3]), exact_hex([2.0; 3])], ["#ffffff", "#ffffff"]);
    }
}
