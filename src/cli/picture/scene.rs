//! The picture of a scene file: some scenes as they would look, and where their colours lie.
//!
//! A scene is a tile: its lights above, and below them chips of its surfaces under the sum of its lights, with the
//! target in their middle. Nothing adapts to the light, so a bluish light shows; but its luminance is taken out, or most
//! scenes of a wide range of intensities would be black or white.

use std::ops::Range;

use kuva::render::render::{Primitive, Scene as Drawing, TextAnchor};
use spectroll::evaluation::plot::{self, DARK, INK, PALE, QUIET, line, rectangle};
use spectroll::scene::{GroupKind, Scene, Window};
use spectroll::{Engine, EngineError, Grid, Quantity, colorimetry};

/// Tiles in a row, and rows of them.
const TILES: (usize, usize) = (5, 2);

/// The scenes whose colours are in the diagram.
const SCENES: u64 = 100;

/// The most points of a kind in the diagram.
const POINTS: usize = 4000;

/// The size of a tile without its caption, and the distance between tiles.
const TILE: (f64, f64) = (186.0, 190.0);
const GAP: f64 = 16.0;
const CAPTION: f64 = 34.0;
const HEAD: f64 = 46.0;

/// The height of the strip of lights.
const STRIP: f64 = 26.0;

/// Chips in a row, and rows of them; the target covers the middle ones.
const CHIPS: (usize, usize) = (15, 13);
const TARGET: usize = 5;

/// The width of the diagram.
const DIAGRAM: f64 = 470.0;

/// The ends of its axes.
const X: (f64, f64) = (0.0, 0.8);
const Y: (f64, f64) = (0.0, 0.9);

/// Scenes, and what they look like.
pub(in crate::cli) struct Preview {
    first: u64,
    tiles: Vec<Tile>,
    lights: Vec<Point>,
    surfaces: Vec<Point>,
    targets: Vec<Point>,
}

/// A scene. Colours are `#rrggbb`.
#[derive(Default)]
struct Tile {
    lights: Vec<String>,
    chips: Vec<String>,
    targets: Vec<String>,
    /// The least and the largest of its targets'.
    lrv: Option<[f32; 2]>,
    /// Smallest and largest intensity of its lights.
    intensity: Option<[f32; 2]>,
}

/// A colour and its chromaticity.
struct Point {
    x: f64,
    y: f64,
    colour: String,
}

impl Preview {
    pub(in crate::cli) fn new(
        scene: &Scene,
        engine: &Engine,
        scenes: &Range<u64>,
    ) -> anyhow::Result<Preview> {
        let mut preview = Preview {
            first: scenes.start,
            tiles: Vec::new(),
            lights: Vec::new(),
            surfaces: Vec::new(),
            targets: Vec::new(),
        };
        let scenes = scenes.start..scenes.end.min(scenes.start + SCENES);
        let mut session = scene.session(engine)?;
        let constants: Vec<(String, Vec<f32>)> = session
            .constants()
            .into_iter()
            .map(|(array, bytes)| (array.name.clone(), bytemuck::pod_collect_to_vec(&bytes)))
            .collect();
        session.draw(scenes, |window| {
            for number in 0..(window.scenes.end - window.scenes.start) as usize {
                preview.add(scene, &Values { window: &window, constants: &constants, number });
            }
            Ok::<_, EngineError>(())
        })?;
        Ok(preview)
    }

    /// Adds a scene.
    fn add(&mut self, scene: &Scene, values: &Values) {
        let grid = scene.grid();
        let groups = scene.workload(1).groups;
        let of = |kind: GroupKind| {
            let names =
                groups.iter().filter(move |group| group.kind == kind).map(|group| group.name.as_str());
            names.flat_map(|name| values.of(name).chunks_exact(grid.len())).collect::<Vec<_>>()
        };
        let lights = of(GroupKind::Illuminant);
        let light: Vec<f64> = match lights.as_slice() {
            [] => colorimetry::d65(grid),
            lights => (0..grid.len()).map(|band| lights.iter().map(|l| f64::from(l[band])).sum()).collect(),
        };
        let Some(weights) = colorimetry::xyz_weights_under(&light, grid) else { return };
        let shone: Vec<_> = lights.iter().map(|light| xyz(light, &emitted(grid))).collect();
        let reflected = |kind| of(kind).into_iter().map(|s| xyz(s, &weights)).collect::<Vec<_>>();
        let (surfaces, targets) = (reflected(GroupKind::Surface), reflected(GroupKind::Target));
        if self.tiles.len() < TILES.0 * TILES.1 {
            // The lights of a scene keep their ratios.
            let brightest = shone.iter().map(|xyz| xyz[1]).fold(0.0, f64::max);
            let known = |quantity: Quantity| {
                let arrays = groups.iter().flat_map(|group| &group.arrays);
                let array = arrays.into_iter().find(|array| array.quantity == quantity)?;
                let values = values.of(&array.name);
                let least = values.iter().copied().reduce(f32::min)?;
                Some([least, values.iter().copied().fold(least, f32::max)])
            };
            self.tiles.push(Tile {
                lights: shone.iter().map(|xyz| colour(xyz.map(|v| 0.7 * v / brightest))).collect(),
                chips: surfaces.iter().take(CHIPS.0 * CHIPS.1).map(|&xyz| colour(xyz)).collect(),
                targets: targets.iter().map(|&xyz| colour(xyz)).collect(),
                lrv: known(Quantity::Lrv),
                intensity: known(Quantity::Intensity),
            });
        }
        let each = POINTS / SCENES as usize;
        self.lights.extend(shone.iter().take(each).map(|&xyz| point(xyz.map(|v| 0.7 * v / xyz[1]))));
        self.surfaces.extend(surfaces.iter().take(each).map(|&xyz| point(xyz)));
        self.targets.extend(targets.iter().take(each).map(|&xyz| point(xyz)));
    }

    /// The picture, drawn.
    pub(in crate::cli) fn drawing(&self) -> Drawing {
        let rows = self.tiles.len().div_ceil(TILES.0).max(1);
        let width = TILES.0 as f64 * (TILE.0 + GAP) + DIAGRAM + 2.0 * GAP;
        let height = HEAD + (rows as f64 * (TILE.1 + CAPTION + GAP)).max(DIAGRAM);
        let mut drawing = Drawing::new(width, height);
        drawing.background_color = Some("#ffffff".to_owned());
        let all = &mut drawing.elements;
        all.push(text(GAP, 28.0, 16, "Lights above, surfaces under them, and the target in their middle"));
        for (i, tile) in self.tiles.iter().enumerate() {
            let x = GAP + (i % TILES.0) as f64 * (TILE.0 + GAP);
            let y = HEAD + (i / TILES.0) as f64 * (TILE.1 + CAPTION + GAP);
            tile.draw(all, (x, y), self.first + i as u64);
        }
        self.diagram(all, (width - DIAGRAM - GAP + 40.0, HEAD), DIAGRAM - 50.0);
        drawing
    }

    /// The chromaticities, on the diagram of CIE 1931.
    fn diagram(&self, all: &mut Vec<Primitive>, (left, top): (f64, f64), size: f64) {
        let unit = size / (X.1 - X.0).max(Y.1 - Y.0);
        let bottom = top + unit * (Y.1 - Y.0) - 20.0;
        let unit = (bottom - top) / (Y.1 - Y.0);
        let at = |x: f64, y: f64| (left + unit * (x - X.0), bottom - unit * (y - Y.0));
        all.push(text(left - 28.0, 28.0, 16, "Chromaticities (CIE 1931)"));
        let (x_end, y_end) = at(X.1, Y.1);
        all.push(rectangle((left, y_end), (x_end - left, bottom - y_end), DARK));
        for tick in 1..=8 {
            let value = f64::from(tick) / 10.0;
            let ((x, _), (_, y)) = (at(value, 0.0), at(0.0, value));
            all.push(line(&[(x, y_end), (x, bottom)], "#2c2e35", 0.7));
            all.push(line(&[(left, y), (x_end, y)], "#2c2e35", 0.7));
            if tick % 2 == 0 {
                all.push(centred(x, bottom + 16.0, 11, &format!("{value:.1}")));
                all.push(centred(left - 14.0, y + 4.0, 11, &format!("{value:.1}")));
            }
        }
        all.push(centred((left + x_end) / 2.0, bottom + 32.0, 12, "x"));
        all.push(centred(left - 30.0, (y_end + bottom) / 2.0, 12, "y"));
        let locus = Grid::new(400.0, 1.0, 301).expect("it is a grid");
        let [x, y, z] = colorimetry::cmf(locus);
        let mut border: Vec<_> = (0..locus.len())
            .map(|i| (x[i] / (x[i] + y[i] + z[i]), y[i] / (x[i] + y[i] + z[i])))
            .map(|(x, y)| at(x, y))
            .collect();
        border.push(border[0]);
        all.push(line(&border, "#c9cdd3", 1.2));
        for wavelength in [460, 480, 520, 540, 560, 580, 600, 620] {
            let (x, y) = border[wavelength - 400];
            let (dx, anchor) =
                if wavelength < 500 { (-6.0, TextAnchor::End) } else { (6.0, TextAnchor::Start) };
            all.push(label((x + dx, y + 1.0), 10, &wavelength.to_string(), anchor, "#9aa1ab"));
        }
        let corners = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.64, 0.33)].map(|(x, y)| at(x, y));
        all.push(line(&corners, "#6b7079", 0.8));
        for (points, radius, ring) in [
            (&self.surfaces, 1.4, None),
            (&self.targets, 3.2, Some("#ffffff")),
            (&self.lights, 3.0, Some(DARK)),
        ] {
            let circle = |point: &Point| {
                let (cx, cy) = at(point.x, point.y);
                Primitive::Circle {
                    cx,
                    cy,
                    r: radius,
                    fill: point.colour.as_str().into(),
                    fill_opacity: None,
                    stroke: ring.map(Into::into),
                    stroke_width: ring.map(|_| 0.8),
                }
            };
            all.extend(points.iter().map(circle));
        }
        let key = [
            (self.surfaces.len(), "surfaces (small)"),
            (self.targets.len(), "targets (white rims)"),
            (self.lights.len(), "lights (dark rims)"),
            (1, "triangle: what sRGB shows"),
        ];
        for (row, (_, name)) in key.iter().filter(|(count, _)| *count > 0).enumerate() {
            let (y, anchor) = (y_end + 18.0 + 16.0 * row as f64, TextAnchor::End);
            all.push(label((x_end - 10.0, y), 11, name, anchor, "#c9cdd3"));
        }
    }
}

impl Tile {
    fn draw(&self, all: &mut Vec<Primitive>, (x, y): (f64, f64), number: u64) {
        let strip = TILE.0 / self.lights.len().max(1) as f64;
        for (i, colour) in self.lights.iter().enumerate() {
            all.push(rectangle((x + i as f64 * strip, y), (strip, STRIP), colour));
        }
        let top = y + if self.lights.is_empty() { 0.0 } else { STRIP + 4.0 };
        let chip = (TILE.0 / CHIPS.0 as f64, (y + TILE.1 - top) / CHIPS.1 as f64);
        all.push(rectangle((x, top), (TILE.0, y + TILE.1 - top), PALE));
        for (i, colour) in self.chips.iter().enumerate() {
            let at = (x + (i % CHIPS.0) as f64 * chip.0, top + (i / CHIPS.0) as f64 * chip.1);
            all.push(rectangle(at, chip, colour));
        }
        let size = (TARGET as f64 * chip.0, TARGET as f64 * chip.1);
        let at = (x + (TILE.0 - size.0) / 2.0, top + ((CHIPS.1 - TARGET) / 2) as f64 * chip.1);
        let width = size.0 / self.targets.len().max(1) as f64;
        for (i, colour) in self.targets.iter().enumerate() {
            all.push(rectangle((at.0 + i as f64 * width, at.1), (width, size.1), colour));
        }
        let lrv = self.lrv.map(|lrv| format!("  LRV {}", range(lrv))).unwrap_or_default();
        all.push(text(x, y + TILE.1 + 15.0, 12, &format!("scene {number}{lrv}")));
        if let Some(intensity) = self.intensity {
            let text = format!("lights x {}", range(intensity));
            all.push(label((x, y + TILE.1 + 29.0), 11, &text, TextAnchor::Start, QUIET));
        }
    }
}

/// The ends of a range, or its only value.
fn range([least, largest]: [f32; 2]) -> String {
    match least == largest {
        true => format!("{least:.3}"),
        false => format!("{least:.3} to {largest:.3}"),
    }
}

/// The values of one scene.
struct Values<'a> {
    window: &'a Window<'a>,
    constants: &'a [(String, Vec<f32>)],
    number: usize,
}

impl Values<'_> {
    /// Values of an array of f32, of this scene or of all; empty where there is no such array.
    fn of(&self, name: &str) -> &[f32] {
        if let Some((_, values)) = self.constants.iter().find(|(constant, _)| constant == name) {
            return values;
        }
        let values = self.window.values(name);
        let each = values.len() / (self.window.scenes.end - self.window.scenes.start) as usize;
        &values[self.number * each..(self.number + 1) * each]
    }
}

/// The weights of the bands in the tristimulus values of a light.
fn emitted(grid: Grid) -> [Vec<f64>; 3] {
    colorimetry::cmf(grid).map(|weights| weights.into_iter().map(|w| w * grid.step()).collect())
}

fn xyz(spectrum: &[f32], weights: &[Vec<f64>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| weights[i].iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum())
}

/// The sRGB colour of tristimulus values, less light where a component would exceed 1.
fn colour(xyz: [f64; 3]) -> String {
    plot::hex(colorimetry::linear_srgb(xyz))
}

fn point(xyz: [f64; 3]) -> Point {
    let sum: f64 = xyz.iter().sum();
    Point { x: xyz[0] / sum, y: xyz[1] / sum, colour: colour(xyz) }
}

fn text(x: f64, y: f64, size: u32, content: &str) -> Primitive {
    label((x, y), size, content, TextAnchor::Start, INK)
}

fn centred(x: f64, y: f64, size: u32, content: &str) -> Primitive {
    label((x, y), size, content, TextAnchor::Middle, INK)
}

fn label((x, y): (f64, f64), size: u32, content: &str, anchor: TextAnchor, colour: &str) -> Primitive {
    plot::text((x, y), size, content, anchor, Some(colour))
}
