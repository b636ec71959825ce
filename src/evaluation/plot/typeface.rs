//! DejaVu Sans, in which the plot library measures text: its bytes, and the outlines of text that is turned.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use kuva::prelude::SvgBackend;
use kuva::render::color::Color;
use kuva::render::render::{PathData, Primitive, Scene, TextAnchor};
use ttf_parser::{Face, OutlineBuilder};

/// Pieces that a curve is cut into.
const PIECES: u16 = 6;

/// The typeface as a file. The plot library gives it away only inside an SVG.
pub(super) fn bytes() -> Result<Vec<u8>, String> {
    let svg = SvgBackend::new().with_embedded_font(true).render_scene(&Scene::new(1.0, 1.0));
    let encoded = svg.split_once("base64,").and_then(|(_, rest)| rest.split('\'').next());
    STANDARD.decode(encoded.ok_or("no typeface was found")?).map_err(|e| e.to_string())
}

/// Advance of a character, relative to the size of the text.
pub(super) fn advance(face: &Face, character: char) -> f64 {
    let glyph = face.glyph_index(character).unwrap_or_default();
    f64::from(face.glyph_hor_advance(glyph).unwrap_or_default()) / f64::from(face.units_per_em())
}

/// Length of what stands before the anchor of a text of this length.
pub(super) fn before(anchor: TextAnchor, length: f64) -> f64 {
    match anchor {
        TextAnchor::Start => 0.0,
        TextAnchor::Middle => length / 2.0,
        TextAnchor::End => length,
    }
}

/// A drawing whose turned text is outlines. The plot library's rasterizer blends turned text with black, which looks
/// bold on white. It fills every contour of a path, so the counters of letters are filled with the ground.
pub(super) fn outlined(drawing: &Scene) -> Result<Scene, String> {
    let bytes = bytes()?;
    let face = Face::parse(&bytes, 0).map_err(|e| e.to_string())?;
    let mut outlined = Scene::new(drawing.width, drawing.height);
    outlined.background_color.clone_from(&drawing.background_color);
    outlined.text_color.clone_from(&drawing.text_color);
    let ground = drawing.background_color.as_deref().unwrap_or("#ffffff");
    let ink = drawing.text_color.as_deref().unwrap_or("#000000");
    for element in &drawing.elements {
        match element {
            Primitive::Text { x, y, content, size, anchor, rotate: Some(degrees), color, .. } => {
                let length: f64 = content.chars().map(|c| advance(&face, c)).sum();
                let mut pen = Contours::new((*x, *y), f64::from(*size), *degrees, &face);
                pen.start = -before(*anchor, length) * f64::from(face.units_per_em());
                for character in content.chars() {
                    face.outline_glyph(face.glyph_index(character).unwrap_or_default(), &mut pen);
                    pen.start += advance(&face, character) * f64::from(face.units_per_em());
                }
                let ink = color.clone().unwrap_or_else(|| Color::from(ink));
                outlined.elements.extend(pen.filled(&ink, &Color::from(ground)));
            }
            other => outlined.elements.push(other.clone()),
        }
    }
    Ok(outlined)
}

/// Contours of glyphs, in units of the typeface.
struct Contours {
    /// Anchor of the text, units of the drawing for one of the typeface, and sine and cosine of the turn.
    origin: (f64, f64),
    scale: f64,
    turn: (f64, f64),
    /// Place at which the next glyph begins.
    start: f64,
    all: Vec<Vec<(f64, f64)>>,
}

impl Contours {
    fn new(origin: (f64, f64), size: f64, degrees: f64, face: &Face) -> Contours {
        let scale = size / f64::from(face.units_per_em());
        Contours { origin, scale, turn: degrees.to_radians().sin_cos(), start: 0.0, all: Vec::new() }
    }

    /// Letters in ink, and after them their counters in the colour of the ground.
    fn filled(&self, ink: &Color, ground: &Color) -> Vec<Primitive> {
        // Twice the area: TrueType's outer contours are clockwise, and its inner ones are not.
        let area = |points: &[(f64, f64)]| {
            let next = points.iter().cycle().skip(1);
            points.iter().zip(next).map(|(a, b)| a.0 * b.1 - b.0 * a.1).sum::<f64>()
        };
        let (outer, inner): (Vec<_>, Vec<_>) = self.all.iter().partition(|points| area(points) < 0.0);
        let ((sine, cosine), (x, y)) = (self.turn, self.origin);
        let placed = |&(u, v): &(f64, f64)| {
            let (u, v) = (self.scale * u, self.scale * v);
            format!("{:.3} {:.3}", x + cosine * u + sine * v, y + sine * u - cosine * v)
        };
        let path = |(points, colour): (&Vec<(f64, f64)>, &Color)| {
            let points: Vec<String> = points.iter().map(placed).collect();
            Primitive::Path(Box::new(PathData {
                d: format!("M {} Z", points.join(" L ")),
                fill: Some(colour.clone()),
                stroke: Color::None,
                stroke_width: 0.0,
                opacity: None,
                stroke_dasharray: None,
            }))
        };
        let outer = outer.into_iter().map(|points| (points, ink));
        outer.chain(inner.into_iter().map(|points| (points, ground))).map(path).collect()
    }

    fn last(&self) -> (f64, f64) {
        let last = self.all.last().and_then(|contour| contour.last());
        last.copied().unwrap_or_default()
    }

    fn push(&mut self, (x, y): (f64, f64)) {
        if let Some(contour) = self.all.last_mut() {
            contour.push((x, y));
        }
    }
}

impl OutlineBuilder for Contours {
    fn move_to(&mut self, x: f32, y: f32) {
        self.all.push(vec![(self.start + f64::from(x), f64::from(y))]);
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.push((self.start + f64::from(x), f64::from(y)));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        let a = self.last();
        let b = (self.start + f64::from(x1), f64::from(y1));
        let c = (self.start + f64::from(x), f64::from(y));
        for piece in 1..=PIECES {
            let t = f64::from(piece) / f64::from(PIECES);
            let at = |a: f64, b: f64, c: f64| (1.0 - t).powi(2) * a + 2.0 * t * (1.0 - t) * b + t * t * c;
            self.push((at(a.0, b.0, c.0), at(a.1, b.1, c.1)));
        }
    }

    fn curve_to(&mut self, _: f32, _: f32, _: f32, _: f32, _: f32, _: f32) {
        unreachable!("TrueType has no cubic curves");
    }

    fn close(&mut self) {}
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::plot::{self, Theme};

    #[test]
    fn turned_letters_are_contours_and_their_counters_have_the_ground() {
        let mut drawing = Theme::Light.canvas(50.0, 90.0);
        let text = |content| plot::text((20.0, 80.0), 20, content, TextAnchor::Start, "#010203");
        drawing.elements.push(text("level"));
        drawing.elements.push(plot::upright(text("oi")));
        let outlined = outlined(&drawing).unwrap();
        let fills: Vec<String> = outlined
            .elements
            .iter()
            .filter_map(|element| match element {
                Primitive::Path(path) => path.fill.as_ref().map(Color::to_svg_string),
                _ => None,
            })
            .collect();
        assert_eq!(fills, ["#010203", "#010203", "#010203", "#ffffff"]);
        assert!(matches!(&outlined.elements[0], Primitive::Text { content, .. } if content == "level"));
    }
}
