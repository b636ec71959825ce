//! The picture of a scene file: some scenes as they would look, and where their colours lie.
//!
//! A scene is a tile: its lights above, and below them chips of its surfaces under the sum of its lights, with the
//! target in their middle. Nothing adapts to the light, so a bluish light shows; but its luminance is taken out, or most
//! scenes of a wide range of intensities would be black or white.

use std::ops::Range;

use kuva::render::render::{Primitive, Scene as Drawing, TextAnchor};
use spectroll::evaluation::plot::{self, LABEL_SIZE, TICK_SIZE, TITLE_SIZE, Theme, line, rectangle};
use spectroll::scene::{GroupKind, Scene, Window};
use spectroll::{Engine, EngineError, Grid, Quantity, colorimetry};

/// Tiles in a row, and rows of them.
const TILES: (usize, usize) = (4, 3);

/// The scenes whose colours are in the diagram.
const SCENES: u64 = 100;

/// The most points of a kind in the diagram.
const POINTS: usize = 4000;

/// The size of a tile without its caption, and the distance between tiles.
const TILE: (f64, f64) = (150.0, 160.0);
const GAP: f64 = 16.0;
const CAPTION: f64 = 34.0;
const HEAD: f64 = 34.0;

/// The height of the strip of lights, and its distance from the chips.
const STRIP: (f64, f64) = (26.0, 4.0);

/// The luminance of the brightest light of a scene in its strip, where white is 1.
const BRIGHTEST: f64 = 0.7;

/// Chips in a row, and rows of them; the target covers the middle ones.
const CHIPS: (usize, usize) = (15, 13);
const TARGET: usize = 5;

/// The width of the diagram with what is written around it.
const DIAGRAM: f64 = 452.0;

/// The ends of its axes, and the length of a tenth.
const X: (f64, f64) = (0.0, 0.8);
const Y: (f64, f64) = (0.0, 0.9);
const TENTH: f64 = 48.0;

/// Space for the numbers on the vertical axis and for its name.
const LEFT: f64 = 52.0;

/// Scenes, and what they look like.
pub(in crate::cli) struct Preview {
    title: String,
    theme: Theme,
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
    /// Draws what is shown of these scenes of the file called `name`.
    pub(in crate::cli) fn new(
        name: &str,
        scene: &Scene,
        engine: &Engine,
        scenes: &Range<u64>,
        theme: Theme,
    ) -> anyhow::Result<Preview> {
        let mut preview = Preview {
            title: format!("{}, seed {}, {} nm", super::title(name), scene.seed(), scene.grid()),
            theme,
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
        let shone: Vec<_> =
            lights.iter().map(|light| xyz(light, &colorimetry::emitted_xyz_weights(grid))).collect();
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
                lights: shone.iter().map(|xyz| colour(xyz.map(|v| BRIGHTEST * v / brightest))).collect(),
                chips: surfaces.iter().take(CHIPS.0 * CHIPS.1).map(|&xyz| colour(xyz)).collect(),
                targets: targets.iter().map(|&xyz| colour(xyz)).collect(),
                lrv: known(Quantity::Lrv),
                intensity: known(Quantity::Intensity),
            });
        }
        let each = POINTS / SCENES as usize;
        let luminance = self.theme.chromatic_luminance();
        let points = |xyz: Vec<[f64; 3]>| xyz.into_iter().take(each).map(move |xyz| point(xyz, luminance));
        self.lights.extend(points(shone));
        self.surfaces.extend(points(surfaces));
        self.targets.extend(points(targets));
    }

    /// The picture, drawn.
    pub(in crate::cli) fn drawing(&self) -> Drawing {
        let rows = self.tiles.len().div_ceil(TILES.0).max(1);
        let top = HEAD + 30.0;
        let tiles = TILES.0 as f64 * (TILE.0 + GAP);
        let diagram = 10.0 * TENTH * (Y.1 - Y.0) + 60.0;
        let height = top + (rows as f64 * (TILE.1 + CAPTION + GAP)).max(diagram);
        let mut drawing = self.theme.canvas(GAP + tiles + DIAGRAM, height);
        let all = &mut drawing.elements;
        let ink = self.theme.ink();
        all.push(text((GAP, 28.0), TITLE_SIZE + 4, &self.title, ink));
        let note =
            "lights above, surfaces under them, target in the middle; luminance of lights not to scale";
        all.push(text((GAP, 50.0), LABEL_SIZE, note, self.theme.quiet()));
        for (i, tile) in self.tiles.iter().enumerate() {
            let x = GAP + (i % TILES.0) as f64 * (TILE.0 + GAP);
            let y = top + (i / TILES.0) as f64 * (TILE.1 + CAPTION + GAP);
            tile.draw(all, (x, y), self.first + i as u64, self.theme);
        }
        self.diagram(all, (GAP + tiles + LEFT, top));
        drawing
    }

    /// The chromaticities, on the diagram of CIE 1931.
    fn diagram(&self, all: &mut Vec<Primitive>, (left, top): (f64, f64)) {
        let theme = self.theme;
        let (ink, quiet) = (theme.ink(), theme.quiet());
        let at = |x: f64, y: f64| (left + 10.0 * TENTH * (x - X.0), top + 10.0 * TENTH * (Y.1 - y));
        let ((x_end, y_end), bottom) = (at(X.1, Y.1), at(X.0, Y.0).1);
        for tick in 0..=9 {
            let value = f64::from(tick) / 10.0;
            let ((x, _), (_, y)) = (at(value, 0.0), at(0.0, value));
            if value <= X.1 {
                all.push(line(&[(x, y_end), (x, bottom)], theme.pale(), 0.8));
            }
            all.push(line(&[(left, y), (x_end, y)], theme.pale(), 0.8));
            if tick % 2 == 0 {
                all.push(plot::text(
                    (x, bottom + 17.0),
                    TICK_SIZE,
                    &format!("{value:.1}"),
                    TextAnchor::Middle,
                    ink,
                ));
                all.push(plot::text(
                    (left - 6.0, y + 4.0),
                    TICK_SIZE,
                    &format!("{value:.1}"),
                    TextAnchor::End,
                    ink,
                ));
            }
        }
        all.push(line(&[(left, y_end), (left, bottom), (x_end, bottom)], ink, 1.0));
        let name = |axis: char| format!("CIE 1931 chromaticity {axis}");
        all.push(plot::text(
            ((left + x_end) / 2.0, bottom + 38.0),
            LABEL_SIZE,
            &name('x'),
            TextAnchor::Middle,
            ink,
        ));
        let place = (left - 36.0, (y_end + bottom) / 2.0);
        all.push(plot::upright(plot::text(place, LABEL_SIZE, &name('y'), TextAnchor::Middle, ink)));
        let locus = Grid::new(400.0, 1.0, 301).expect("it is a grid");
        let [x, y, z] = colorimetry::cmf(&locus);
        let mut border: Vec<_> = (0..locus.len())
            .map(|i| (x[i] / (x[i] + y[i] + z[i]), y[i] / (x[i] + y[i] + z[i])))
            .map(|(x, y)| at(x, y))
            .collect();
        border.push(border[0]);
        all.push(line(&border, ink, 1.2));
        for wavelength in [460, 480, 520, 540, 560, 580, 600, 620] {
            let (x, y) = border[wavelength - 400];
            let (dx, dy, anchor) = match wavelength {
                ..500 => (-6.0, 2.0, TextAnchor::End),
                _ => (6.0, -3.0, TextAnchor::Start),
            };
            let (at, name) = ((x + dx, y + dy), wavelength.to_string());
            all.push(plot::text(at, TICK_SIZE - 1, &name, anchor, quiet));
        }
        let corners = [(0.64, 0.33), (0.30, 0.60), (0.15, 0.06), (0.64, 0.33)].map(|(x, y)| at(x, y));
        all.push(line(&corners, quiet, 0.8));
        let symbols = [
            (Symbol::Surface, &self.surfaces, "surfaces"),
            (Symbol::Target, &self.targets, "targets"),
            (Symbol::Light, &self.lights, "lights"),
        ];
        for (symbol, points, _) in symbols {
            all.extend(points.iter().map(|point| symbol.draw(at(point.x, point.y), &point.colour, ink)));
        }
        let mut y = y_end + 20.0;
        for (symbol, points, name) in symbols {
            if !points.is_empty() {
                all.push(symbol.draw((x_end - 96.0, y - 4.0), quiet, ink));
                all.push(text((x_end - 84.0, y), TICK_SIZE, name, ink));
                y += 18.0;
            }
        }
        all.push(line(&[(x_end - 102.0, y - 4.0), (x_end - 90.0, y - 4.0)], quiet, 0.8));
        all.push(text((x_end - 84.0, y), TICK_SIZE, "sRGB gamut", ink));
    }
}

/// Style of a point of the diagram.
#[derive(Clone, Copy)]
enum Symbol {
    Surface,
    Target,
    Light,
}

impl Symbol {
    fn draw(self, at: (f64, f64), colour: &str, rim: &str) -> Primitive {
        match self {
            Symbol::Surface => plot::disc(at, 1.4, colour, None),
            Symbol::Target => plot::disc(at, 3.4, colour, Some(rim)),
            Symbol::Light => plot::diamond(at, 4.0, colour, rim),
        }
    }
}

impl Tile {
    fn draw(&self, all: &mut Vec<Primitive>, (x, y): (f64, f64), number: u64, theme: Theme) {
        let strip = TILE.0 / self.lights.len().max(1) as f64;
        for (i, colour) in self.lights.iter().enumerate() {
            all.push(rectangle((x + i as f64 * strip, y), (strip, STRIP.0), colour));
        }
        let top = y + if self.lights.is_empty() { 0.0 } else { STRIP.0 + STRIP.1 };
        let chip = (TILE.0 / CHIPS.0 as f64, (y + TILE.1 - top) / CHIPS.1 as f64);
        all.push(rectangle((x, top), (TILE.0, y + TILE.1 - top), theme.pale()));
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
        let lrv = self.lrv.map(|lrv| format!(", LRV {}", range(lrv))).unwrap_or_default();
        all.push(text((x, y + TILE.1 + 15.0), TICK_SIZE, &format!("scene {number}{lrv}"), theme.ink()));
        if let Some(intensity) = self.intensity {
            let intensity = format!("intensity {}", range(intensity));
            all.push(text((x, y + TILE.1 + 30.0), TICK_SIZE, &intensity, theme.quiet()));
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

fn xyz(spectrum: &[f32], weights: &[Vec<f64>; 3]) -> [f64; 3] {
    [0, 1, 2].map(|i| weights[i].iter().zip(spectrum).map(|(w, &s)| w * f64::from(s)).sum())
}

/// The sRGB colour of tristimulus values, less light where a component would exceed 1.
fn colour(xyz: [f64; 3]) -> String {
    plot::hex(colorimetry::linear_srgb(xyz))
}

/// The chromaticity of tristimulus values, in a colour of this luminance.
fn point(xyz: [f64; 3], luminance: f64) -> Point {
    let sum: f64 = xyz.iter().sum();
    Point { x: xyz[0] / sum, y: xyz[1] / sum, colour: plot::chromatic(xyz, luminance) }
}

fn text(at: (f64, f64), size: u32, content: &str, colour: &str) -> Primitive {
    plot::text(at, size, content, TextAnchor::Start, colour)
}
