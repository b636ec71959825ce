//! Pictures of metamers: an image under several lights, in which spectra of one colour part; and the spectra of a table's
//! colours, with their chromaticities under these lights.

use kuva::plot::scatter::MarkerShape;
use kuva::prelude::{LinePlot, ScatterPlot};
use kuva::render::render::Scene;
use spectroll::evaluation::plot::{self, Caption, Theme};
use spectroll::{Grid, Illuminant, Observer, SpectrumKind, colorimetry};

use super::colours::Colours;
use super::panel::{self, Axes, MARGINS, Panel, curve};

/// Lights of the pictures, with their names.
const LIGHTS: [(&str, Illuminant); 3] =
    [("D65", Illuminant::D65), ("A", Illuminant::A), ("F11", Illuminant::F11)];

/// Marks of a chart for each light, and the words for these.
const MARKS: [(MarkerShape, &str); 3] = [
    (MarkerShape::Diamond, "diamonds"),
    (MarkerShape::Circle, "circles"),
    (MarkerShape::Triangle, "triangles"),
];

/// Pixels between the images.
const GAP: usize = 8;

/// Image of spectra under each of the lights, side by side, as the bytes of a .png; adapted to each light, so that white
/// stays white and only what parts is seen to part. `None` where the grid has no visible light.
pub(in crate::cli) fn triptych(spectra: &[f32], width: usize, grid: &Grid) -> Option<Vec<u8>> {
    let bands = grid.len();
    let height = spectra.len() / bands / width;
    let full = 3 * width + 2 * GAP;
    let mut pixels = vec![255u8; 3 * full * height];
    let white = colorimetry::linear_srgb_to_xyz([1.0; 3]);
    for (number, (_, light)) in LIGHTS.iter().enumerate() {
        let weights = Observer::Cie1931.xyz_weights_under(&light.power(grid), grid)?;
        let whites = weights.each_ref().map(|weights| weights.iter().sum::<f64>());
        for (at, spectrum) in spectra.chunks_exact(bands).enumerate() {
            let (row, column) = (at / width, at % width + number * (width + GAP));
            let xyz = [0, 1, 2].map(|i| {
                let sum: f64 = weights[i].iter().zip(spectrum).map(|(w, s)| w * f64::from(*s)).sum();
                sum / whites[i] * white[i]
            });
            let rgb = colorimetry::encode_srgb(colorimetry::linear_srgb(xyz));
            pixels[3 * (row * full + column)..][..3].copy_from_slice(&rgb);
        }
    }
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, full as u32, height as u32);
    encoder.set_color(png::ColorType::Rgb);
    let mut writer = encoder.write_header().expect("memory takes it");
    writer.write_image_data(&pixels).expect("there are as many bytes");
    drop(writer);
    Some(bytes)
}

/// Contents of a chart.
pub(in crate::cli) struct Chart<'a> {
    /// Name of the table.
    pub(in crate::cli) name: &'a str,
    /// Origin of the spectra, in words.
    pub(in crate::cli) note: &'a str,
    /// The spectra, as they were drawn.
    pub(in crate::cli) spectra: Vec<Vec<f64>>,
    /// The kind of the spectra.
    pub(in crate::cli) kind: SpectrumKind,
    /// Their wavelengths.
    pub(in crate::cli) grid: &'a Grid,
    /// The ground.
    pub(in crate::cli) theme: Theme,
}

impl Chart<'_> {
    /// The chart, drawn.
    pub(in crate::cli) fn drawing(&self) -> Scene {
        let mut drawing = panel::arrange([self.lines(), self.parted()], self.theme);
        plot::head(&mut drawing, &super::title(self.name), self.note, self.theme);
        drawing
    }

    fn lines(&self) -> Panel {
        let axes = Axes { kind: self.kind, grid: self.grid.clone(), theme: self.theme };
        let colours = Colours::new(self.kind, self.grid, self.theme);
        let line = |spectrum: &Vec<f64>| {
            LinePlot::new()
                .with_data(curve(self.grid, spectrum))
                .with_color(colours.of(spectrum))
                .with_stroke_width(1.0)
                .into()
        };
        let limits = axes.limits(self.spectra.iter().flatten());
        let caption = Caption {
            title: format!("{} spectra", self.spectra.len()),
            note: colours.note().to_owned(),
            vertical: axes.label().to_owned(),
        };
        (self.spectra.iter().map(line).collect(), axes.values(limits), caption)
    }

    /// Chromaticities relative to white under each light: where all of one colour lie on a point, and where they part.
    fn parted(&self) -> Panel {
        let mut plots = Vec::new();
        let (mut x, mut y) = ((f64::INFINITY, f64::NEG_INFINITY), (f64::INFINITY, f64::NEG_INFINITY));
        // The first on top, where a colour's spectra lie on one point.
        for (number, (_, light)) in LIGHTS.iter().enumerate().rev() {
            let weights = Observer::Cie1931.xyz_weights_under(&light.power(self.grid), self.grid);
            let Some(weights) = weights else { continue };
            let whites = weights.each_ref().map(|weights| weights.iter().sum::<f64>());
            let points: Vec<(f64, f64)> = self
                .spectra
                .iter()
                .map(|spectrum| {
                    let dot = |i: usize| {
                        weights[i].iter().zip(spectrum).map(|(w, s)| w * s).sum::<f64>() / whites[i]
                    };
                    let xyz = [dot(0), dot(1), dot(2)];
                    let all: f64 = xyz.iter().sum();
                    (xyz[0] / all, xyz[1] / all)
                })
                .collect();
            for point in &points {
                (x, y) = ((x.0.min(point.0), x.1.max(point.0)), (y.0.min(point.1), y.1.max(point.1)));
            }
            let colour = self.theme.colours()[number];
            let plot = ScatterPlot::new().with_data(points).with_color(colour).with_marker(MARKS[number].0);
            plots.push(plot.with_size(if number == 0 { 5.0 } else { 3.0 }).into());
        }
        let pad =
            |(low, high): (f64, f64)| (low - 0.1 * (high - low) - 1e-3, high + 0.1 * (high - low) + 1e-3);
        let layout = self.theme.axes(pad(x), pad(y), MARGINS).with_x_label("x, relative to white");
        let names: Vec<_> =
            LIGHTS.iter().zip(MARKS).map(|((name, _), (_, mark))| format!("{name} ({mark})")).collect();
        let caption = Caption {
            title: "Where metamers part".to_owned(),
            note: format!("chromaticity under {}", names.join(", ")),
            vertical: "y, relative to white".to_owned(),
        };
        (plots, layout, caption)
    }
}
