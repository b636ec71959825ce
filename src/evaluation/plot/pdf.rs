//! Drawings as PDF: one page of vectors, with the glyphs it needs.
//!
//! The plot library's own way goes through an SVG renderer of some ninety crates. Its drawings hold few kinds of shapes,
//! all of which PDF has, and so does this file: what is missing is an error, not a gap in the picture.

use std::collections::{BTreeMap, BTreeSet};
use std::io::Write as _;

use flate2::Compression;
use flate2::write::ZlibEncoder;
use kuva::render::color::Color;
use kuva::render::render::{Primitive, Scene, TextAnchor};
use pdf_writer::types::{CidFontType, FontFlags, LineJoinStyle, SystemInfo, UnicodeCmap};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str};
use subsetter::GlyphRemapper;
use ttf_parser::Face;

use super::typeface;

/// Points of a page for each unit of a drawing: 72 of the one are an inch, and 96 of the other.
const POINT: f64 = 0.75;

/// Name of the subset: six capitals, by the rules of PDF, and the typeface.
const FONT: Name = Name(b"SPECTR+DejaVuSans");

/// Name in the page's resources.
const FONT_KEY: Name = Name(b"F");

/// Distance of the control points of a quarter circle from its ends, relative to the radius.
const QUARTER: f32 = 0.552_284_8;

/// The drawing as a document.
pub(super) fn document(drawing: &Scene) -> Result<Vec<u8>, String> {
    let typeface = typeface::bytes()?;
    let face = Face::parse(&typeface, 0).map_err(|e| e.to_string())?;
    let mut page = Page::new(drawing, face)?;
    for element in &drawing.elements {
        page.add(element)?;
    }
    page.finish(&typeface)
}

/// Painting of a shape.
#[derive(Clone, Copy, Default)]
struct Paint<'a> {
    fill: Option<&'a Color>,
    fill_opacity: Option<f64>,
    stroke: Option<&'a Color>,
    stroke_opacity: Option<f64>,
    width: f64,
    dashes: Option<&'a str>,
}

/// A page that is being drawn.
struct Page<'a> {
    size: (f32, f32),
    /// The colour of text that has none of its own.
    ink: Color,
    content: Content,
    face: Face<'a>,
    glyphs: GlyphRemapper,
    /// The glyphs of the subset, and the characters that they are of.
    characters: BTreeMap<u16, (char, f32)>,
    /// Pairs of opacities of fills and strokes, in thousandths.
    opacities: BTreeSet<(u16, u16)>,
}

impl<'a> Page<'a> {
    fn new(drawing: &Scene, face: Face<'a>) -> Result<Page<'a>, String> {
        let size = ((POINT * drawing.width) as f32, (POINT * drawing.height) as f32);
        let mut page = Page {
            size,
            ink: drawing.text_color.as_deref().map_or(Color::Rgb(0, 0, 0), Color::from),
            content: Content::new(),
            face,
            glyphs: GlyphRemapper::new(),
            characters: BTreeMap::new(),
            opacities: BTreeSet::new(),
        };
        // Drawings count from the top, pages from the bottom.
        let unit = POINT as f32;
        page.content.transform([unit, 0.0, 0.0, -unit, 0.0, size.1]);
        page.content.set_line_join(LineJoinStyle::RoundJoin);
        if let Some(ground) = &drawing.background_color {
            let [r, g, b] = rgb(&Color::from(ground.as_str()))?;
            let (width, height) = (drawing.width as f32, drawing.height as f32);
            page.content.set_fill_rgb(r, g, b).rect(0.0, 0.0, width, height).fill_nonzero();
        }
        Ok(page)
    }

    fn add(&mut self, element: &Primitive) -> Result<(), String> {
        match element {
            Primitive::Circle { cx, cy, r, fill, fill_opacity, stroke, stroke_width } => {
                let paint = Paint {
                    fill: Some(fill),
                    fill_opacity: *fill_opacity,
                    stroke: stroke.as_ref(),
                    width: stroke_width.unwrap_or(1.0),
                    ..Paint::default()
                };
                self.shape(paint, |page| {
                    circle(page, *cx, *cy, *r);
                    Ok(())
                })
            }
            Primitive::CircleBatch { cx, cy, r, fill, fill_opacity, stroke, stroke_width } => {
                let paint = Paint {
                    fill: Some(fill),
                    fill_opacity: *fill_opacity,
                    stroke: stroke.as_ref(),
                    width: stroke_width.unwrap_or(1.0),
                    ..Paint::default()
                };
                // One by one, so that translucent ones darken each other.
                cx.iter().zip(cy).try_for_each(|(&x, &y)| {
                    self.shape(paint, |page| {
                        circle(page, x, y, *r);
                        Ok(())
                    })
                })
            }
            Primitive::Line { x1, y1, x2, y2, stroke, stroke_width, stroke_dasharray } => {
                let points = [(*x1, *y1), (*x2, *y2)];
                self.lines(&points, stroke, *stroke_width, stroke_dasharray.as_deref())
            }
            Primitive::PolyLine { points, stroke, stroke_width, stroke_dasharray } => {
                self.lines(points, stroke, *stroke_width, stroke_dasharray.as_deref())
            }
            Primitive::Path(path) => {
                let paint = Paint {
                    fill: path.fill.as_ref(),
                    fill_opacity: path.opacity,
                    stroke: Some(&path.stroke),
                    stroke_opacity: path.opacity,
                    width: path.stroke_width,
                    dashes: path.stroke_dasharray.as_deref(),
                };
                self.shape(paint, |content| trace(content, &path.d))
            }
            Primitive::Rect { x, y, width, height, fill, stroke, stroke_width, opacity } => {
                let paint = Paint {
                    fill: Some(fill),
                    fill_opacity: *opacity,
                    stroke: stroke.as_ref(),
                    stroke_opacity: *opacity,
                    width: stroke_width.unwrap_or(1.0),
                    ..Paint::default()
                };
                self.shape(paint, |content| {
                    content.rect(*x as f32, *y as f32, *width as f32, *height as f32);
                    Ok(())
                })
            }
            Primitive::Text { x, y, content, size, anchor, rotate, bold: false, color } => {
                self.text((*x, *y), content, *size as f32, *anchor, rotate.unwrap_or(0.0), color.as_ref())
            }
            Primitive::GroupStart { transform, .. } => {
                self.content.save_state();
                if let Some(transform) = transform {
                    let numbers = transform.strip_prefix("translate(").and_then(|t| t.strip_suffix(')'));
                    let [x, y] = numbers
                        .and_then(|t| numbers_of(t)?.try_into().ok())
                        .ok_or_else(|| format!("{transform:?} has no form in PDF"))?;
                    self.content.transform([1.0, 0.0, 0.0, 1.0, x, y]);
                }
                Ok(())
            }
            Primitive::ClipStart { x, y, width, height, .. } => {
                self.content.save_state();
                self.content.rect(*x as f32, *y as f32, *width as f32, *height as f32);
                self.content.clip_nonzero().end_path();
                Ok(())
            }
            Primitive::GroupEnd | Primitive::ClipEnd => {
                self.content.restore_state();
                Ok(())
            }
            other => Err(format!("no form in PDF for {other:?}")),
        }
    }

    fn lines(
        &mut self,
        points: &[(f64, f64)],
        stroke: &Color,
        width: f64,
        dashes: Option<&str>,
    ) -> Result<(), String> {
        let paint = Paint { stroke: Some(stroke), width, dashes, ..Paint::default() };
        self.shape(paint, |content| {
            for (i, &(x, y)) in points.iter().enumerate() {
                let (x, y) = (x as f32, y as f32);
                if i == 0 {
                    content.move_to(x, y)
                } else {
                    content.line_to(x, y)
                };
            }
            Ok(())
        })
    }

    /// Paints what `outline` traces.
    fn shape(
        &mut self,
        paint: Paint,
        outline: impl FnOnce(&mut Content) -> Result<(), String>,
    ) -> Result<(), String> {
        let seen =
            |colour: Option<&'_ Color>| colour.filter(|c| !matches!(c, Color::None)).map(rgb).transpose();
        let (fill, stroke) = (seen(paint.fill)?, seen(paint.stroke)?);
        self.content.save_state();
        let thousandths = |opacity: Option<f64>| (1000.0 * opacity.unwrap_or(1.0)).round() as u16;
        let opacities = (thousandths(paint.fill_opacity), thousandths(paint.stroke_opacity));
        if opacities != (1000, 1000) {
            self.opacities.insert(opacities);
            self.content.set_parameters(Name(opacity_key(opacities).as_bytes()));
        }
        if let Some([r, g, b]) = fill {
            self.content.set_fill_rgb(r, g, b);
        }
        if let Some([r, g, b]) = stroke {
            self.content.set_stroke_rgb(r, g, b).set_line_width(paint.width as f32);
            if let Some(dashes) = paint.dashes {
                let dashes = numbers_of(dashes).ok_or_else(|| format!("dashes {dashes:?}"))?;
                self.content.set_dash_pattern(dashes, 0.0);
            }
        }
        outline(&mut self.content)?;
        match (fill, stroke) {
            (Some(_), Some(_)) => self.content.fill_nonzero_and_stroke(),
            (Some(_), None) => self.content.fill_nonzero(),
            (None, Some(_)) => self.content.stroke(),
            (None, None) => self.content.end_path(),
        };
        self.content.restore_state();
        Ok(())
    }

    fn text(
        &mut self,
        (x, y): (f64, f64),
        text: &str,
        size: f32,
        anchor: TextAnchor,
        degrees: f64,
        colour: Option<&Color>,
    ) -> Result<(), String> {
        let mut codes = Vec::with_capacity(2 * text.len());
        let mut length = 0.0;
        for character in text.chars() {
            let glyph = self.face.glyph_index(character).unwrap_or_default();
            let advance = typeface::advance(&self.face, character);
            let code = self.glyphs.remap(glyph.0);
            self.characters.insert(code, (character, advance as f32));
            codes.extend(code.to_be_bytes());
            length += advance * f64::from(size);
        }
        let before = typeface::before(anchor, length);
        let (sine, cosine) = degrees.to_radians().sin_cos();
        let (x, y) = ((x - before * cosine) as f32, (y - before * sine) as f32);
        let (sine, cosine) = (sine as f32, cosine as f32);
        let [r, g, b] = rgb(colour.unwrap_or(&self.ink))?;
        self.content.set_fill_rgb(r, g, b);
        self.content.begin_text();
        // Letters stand upright on a page that counts from the top.
        self.content.set_font(FONT_KEY, size).set_text_matrix([cosine, sine, sine, -cosine, x, y]);
        self.content.show(Str(&codes));
        self.content.end_text();
        Ok(())
    }

    fn finish(self, typeface: &[u8]) -> Result<Vec<u8>, String> {
        let mut next = 1..;
        let mut id = || Ref::new(next.next().expect("there are more"));
        let [catalog, pages, page, content, font, cid_font, descriptor, file, unicode] =
            [(); 9].map(|()| id());
        let mut pdf = Pdf::new();
        pdf.catalog(catalog).pages(pages);
        pdf.pages(pages).kids([page]).count(1);
        let mut sheet = pdf.page(page);
        sheet.media_box(Rect::new(0.0, 0.0, self.size.0, self.size.1)).parent(pages).contents(content);
        let mut resources = sheet.resources();
        resources.fonts().pair(FONT_KEY, font);
        let mut states = resources.ext_g_states();
        for &(fill, stroke) in &self.opacities {
            let alpha = |thousandths| f32::from(thousandths) / 1000.0;
            states
                .insert(Name(opacity_key((fill, stroke)).as_bytes()))
                .start::<pdf_writer::writers::ExtGraphicsState>()
                .non_stroking_alpha(alpha(fill))
                .stroking_alpha(alpha(stroke));
        }
        states.finish();
        resources.finish();
        sheet.finish();
        stream(&mut pdf, content, &self.content.finish())?;

        let system = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };
        pdf.type0_font(font)
            .base_font(FONT)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(cid_font)
            .to_unicode(unicode);
        let mut cids = pdf.cid_font(cid_font);
        cids.subtype(CidFontType::Type2).base_font(FONT).system_info(system).font_descriptor(descriptor);
        cids.default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        let mut widths = cids.widths();
        for (&code, &(_, advance)) in &self.characters {
            widths.consecutive(code, [1000.0 * advance]);
        }
        widths.finish();
        cids.finish();
        let face = &self.face;
        let thousand = |units: i16| 1000.0 * f32::from(units) / f32::from(face.units_per_em());
        let bounds = face.global_bounding_box();
        let corners = [bounds.x_min, bounds.y_min, bounds.x_max, bounds.y_max].map(thousand);
        pdf.font_descriptor(descriptor)
            .name(FONT)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Rect::new(corners[0], corners[1], corners[2], corners[3]))
            .italic_angle(0.0)
            .ascent(thousand(face.ascender()))
            .descent(thousand(face.descender()))
            .cap_height(thousand(face.capital_height().unwrap_or(face.ascender())))
            .stem_v(80.0)
            .font_file2(file);
        let subset = subsetter::subset(typeface, 0, &self.glyphs).map_err(|e| e.to_string())?;
        stream(&mut pdf, file, &subset)?;
        let mut map = UnicodeCmap::new(Name(b"Spectroll"), system);
        for (&code, &(character, _)) in &self.characters {
            map.pair(code, character);
        }
        stream(&mut pdf, unicode, &map.finish())?;
        Ok(pdf.finish())
    }
}

/// Adds a compressed stream.
fn stream(pdf: &mut Pdf, id: Ref, bytes: &[u8]) -> Result<(), String> {
    let mut encoder = ZlibEncoder::new(Vec::new(), Compression::default());
    let packed = encoder.write_all(bytes).and_then(|()| encoder.finish()).map_err(|e| e.to_string())?;
    pdf.stream(id, &packed).filter(Filter::FlateDecode).pair(Name(b"Length1"), bytes.len() as i32);
    Ok(())
}

fn opacity_key((fill, stroke): (u16, u16)) -> String {
    format!("O{fill}-{stroke}")
}

fn rgb(colour: &Color) -> Result<[f32; 3], String> {
    match colour {
        Color::Rgb(r, g, b) => Ok([*r, *g, *b].map(|v| f32::from(v) / 255.0)),
        other => Err(format!("the colour {other:?} has no form in PDF")),
    }
}

fn circle(content: &mut Content, x: f64, y: f64, r: f64) {
    let (x, y, r) = (x as f32, y as f32, r as f32);
    let k = QUARTER * r;
    content
        .move_to(x + r, y)
        .cubic_to(x + r, y + k, x + k, y + r, x, y + r)
        .cubic_to(x - k, y + r, x - r, y + k, x - r, y)
        .cubic_to(x - r, y - k, x - k, y - r, x, y - r)
        .cubic_to(x + k, y - r, x + r, y - k, x + r, y)
        .close_path();
}

/// Traces a path of straight lines that is written as in SVG.
fn trace(content: &mut Content, path: &str) -> Result<(), String> {
    let bad = || format!("the path {path:?} has no form in PDF");
    let mut rest = path.trim_start();
    while let Some(command) = rest.chars().next() {
        let end = rest[1..].find(|c: char| c.is_ascii_alphabetic()).map_or(rest.len(), |i| i + 1);
        let numbers = numbers_of(&rest[1..end]).ok_or_else(bad)?;
        match (command, numbers.as_slice()) {
            ('M', &[x, y]) => content.move_to(x, y),
            ('L', &[x, y]) => content.line_to(x, y),
            ('Z', []) => content.close_path(),
            _ => return Err(bad()),
        };
        rest = rest[end..].trim_start();
    }
    Ok(())
}

/// Numbers with commas or spaces between them.
fn numbers_of(text: &str) -> Option<Vec<f32>> {
    let words = text.split([',', ' ']).filter(|word| !word.is_empty());
    words.map(|word| word.parse().ok()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::plot::{self, Theme};

    #[test]
    fn a_page_has_the_size_of_its_drawing_and_the_glyphs_of_its_text() {
        let mut drawing = Theme::Light.canvas(400.0, 200.0);
        drawing.elements.push(plot::text((9.0, 9.0), 12, "10⁻³ ± 1", TextAnchor::End, "#1f2328"));
        drawing.elements.push(plot::disc((50.0, 50.0), 4.0, "#0072b2", Some("#000000")));
        drawing.elements.push(plot::diamond((50.0, 50.0), 4.0, "#0072b2", "#000000"));
        let pdf = document(&drawing).unwrap();
        let text = String::from_utf8_lossy(&pdf);
        for part in ["%PDF-1.7", "/MediaBox [0 0 300 150]", "/FontFile2", "/ToUnicode"] {
            assert!(text.contains(part), "no {part}");
        }
        // The whole typeface has 750 KB.
        assert!(pdf.len() < 20_000, "{} bytes", pdf.len());
    }

    #[test]
    fn what_a_page_cannot_show_is_an_error() {
        let mut drawing = Theme::Light.canvas(9.0, 9.0);
        drawing.elements.push(plot::disc((5.0, 5.0), 4.0, "url(#gradient)", None));
        assert!(document(&drawing).unwrap_err().contains("gradient"));
        let curve = trace(&mut Content::new(), "M 0 0 C 1 1 2 2 3 3");
        assert!(curve.unwrap_err().contains("C 1 1"));
    }

    #[test]
    fn paths_may_stand_close() {
        let mut content = Content::new();
        trace(&mut content, "M1 2 L 3,4 Z").unwrap();
        assert_eq!(content.finish().as_slice(), b"1 2 m\n3 4 l\nh");
    }
}
