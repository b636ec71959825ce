//! Scene files.

use std::collections::HashMap;
use std::ops::Range;
use std::path::Path;

use toml::de::DeTable;

use crate::colorimetry::{self, Illuminant, IlluminantError, Observer};
use crate::dataset::{Dataset, DatasetError, Table};
use crate::grid::{Extrapolation, Grid};
use crate::model::Model;
use crate::plain_file;
use crate::program::Bounds;
use crate::quantity::Quantity;
use crate::recipe::{DEFAULT_MAX_ATTEMPTS, Intensity};
use crate::sensors::{ResponseScale, Sensors};

use super::error::{SceneError, SceneErrorKind, SceneErrorPlace};
use super::group::{
    Base, Copies, Group, Hue, Illuminants, IntensityScope, LrvLevels, QUANTITIES, Surfaces, TargetConstraint,
    Targets, Viewing,
};
use super::reader::{Entry, Section, Wrong};
use super::target::{FLAT_IS_NOT_DRAWN, bounds_without_lrv};
use super::{Scene, SceneBuilder};
use crate::suggestion::closest;

/// The scene files that are built in, by name: the conditions of Singh et al. (2018).
pub const PRESETS: [(&str, &str); 3] = [
    ("condition1", include_str!("presets/condition1.toml")),
    ("condition2", include_str!("presets/condition2.toml")),
    ("condition3", include_str!("presets/condition3.toml")),
];

const SCENE: [&str; 6] = ["scenes", "seed", "wavelengths", "illuminant", "surface", "target"];
const ILLUMINANT: [&str; 12] = [
    "name",
    "model",
    "count",
    "intensity",
    "mean",
    "cov_scale",
    "same_shape",
    "fixed",
    "max_attempts",
    "quantities",
    "sensors",
    "observer",
];
const SURFACE: [&str; 12] = [
    "name",
    "model",
    "count",
    "cov_scale",
    "fixed",
    "max_attempts",
    "quantities",
    "sensors",
    "response_scale",
    "observer",
    "illuminant",
    "under",
];
const TARGET: [&str; 17] = [
    "name",
    "model",
    "count",
    "lrv",
    "xyz",
    "hue",
    "flat",
    "bounds",
    "copies",
    "cov_scale",
    "max_attempts",
    "quantities",
    "sensors",
    "response_scale",
    "observer",
    "illuminant",
    "under",
];

/// The largest scene file that is read, in bytes.
pub const MAX_FILE_BYTES: u64 = 16 << 20;

impl Scene {
    /// Reads a scene file. Models and spectra that it names are sought in its folder.
    pub fn open(path: impl AsRef<Path>) -> Result<Scene, SceneError> {
        let path = path.as_ref();
        let name = path.display().to_string();
        let text = plain_file::read_text(path, MAX_FILE_BYTES).map_err(|e| {
            let place = SceneErrorPlace { file: Some(name.clone()), ..SceneErrorPlace::default() };
            SceneError::new(place, SceneErrorKind::Read(e))
        })?;
        Scene::parse(&name, &text, path.parent().unwrap_or(Path::new("")))
    }

    /// Reads the text of a scene file; `name` is what messages call it.
    ///
    /// ```
    /// use std::path::Path;
    ///
    /// use spectroll::scene::Scene;
    ///
    /// let text = "scenes = 10\n[[surface]]\nname = \"wall\"\nmodel = \"munsell-vrhel\"\ncuont = 5";
    /// let error = Scene::parse("wall.toml", text, Path::new("")).err().unwrap().to_string();
    /// assert!(error.starts_with(r#"wall.toml, line 5, cuont of "wall": there is no such key, did you mean "count"?"#));
    /// ```
    pub fn parse(name: &str, text: &str, folder: &Path) -> Result<Scene, SceneError> {
        Scene::read(name, text, folder, None)
    }

    /// Reads the text of a scene file, whose scenes are to be drawn with another seed than it says.
    pub fn parse_seeded(name: &str, text: &str, folder: &Path, seed: u64) -> Result<Scene, SceneError> {
        Scene::read(name, text, folder, Some(seed))
    }

    fn read(name: &str, text: &str, folder: &Path, seed: Option<u64>) -> Result<Scene, SceneError> {
        let error = |span: Option<Range<usize>>, group: Option<String>, key: String, problem| {
            let line = span.map(|span| 1 + text[..span.start.min(text.len())].matches('\n').count());
            SceneError::new(SceneErrorPlace { file: Some(name.to_owned()), line, group, key }, problem)
        };
        let table = DeTable::parse(text).map_err(|e| {
            error(e.span(), None, String::new(), SceneErrorKind::Syntax(e.message().replace('\n', "; ")))
        })?;
        let mut file = Reader { folder, wavelengths: None, models: HashMap::new() }
            .scene(table.get_ref())
            .map_err(|wrong| error(Some(wrong.span), wrong.group, wrong.key, *wrong.problem))?;
        file.builder.seed = seed.unwrap_or(file.builder.seed);
        file.builder.checked().map_err(|fault| {
            let spans = fault.group.map_or(&file.spans, |group| &file.groups[group].spans);
            let own = spans.iter().find(|(key, _)| *key == fault.key).map(|(_, span)| span.clone());
            let header = fault.group.map(|group| file.groups[group].header.clone());
            let group = fault.group.map(|group| file.builder.groups[group].base().name.clone());
            error(own.or(header), group, fault.key.to_owned(), *fault.problem)
        })
    }

    /// A built-in scene (see [`PRESETS`]).
    pub fn preset(name: &str) -> Option<Scene> {
        let (name, text) = PRESETS.iter().find(|(preset, _)| *preset == name)?;
        Some(Scene::parse(name, text, Path::new("")).expect("they are possible"))
    }
}

/// Places of a table's keys.
type Spans = Vec<(String, Range<usize>)>;

/// Contents of a file.
struct File {
    builder: SceneBuilder,
    spans: Spans,
    groups: Vec<Located>,
}

/// Place of a group.
struct Located {
    header: Range<usize>,
    spans: Spans,
}

struct Reader<'a> {
    folder: &'a Path,
    /// The scene's, which built-in models take.
    wavelengths: Option<Grid>,
    /// Models that were read.
    models: HashMap<String, Model>,
}

impl Reader<'_> {
    fn scene(&mut self, table: &DeTable) -> Result<File, Wrong> {
        let section = Section::new(table, 0..0, "", &SCENE)?;
        let mut builder = Scene::builder(section.need("scenes", "scenes = 1000")?.whole()?);
        if let Some(entry) = section.get("seed") {
            builder = builder.seed(entry.whole()?);
        }
        if let Some(entry) = section.get("wavelengths") {
            let grid = match entry.list() {
                Some(list) => Grid::from_wavelengths(&list?),
                None => entry.text()?.parse(),
            };
            let grid = grid.map_err(|e| entry.wrong(SceneErrorKind::Wavelengths(e)))?;
            builder = builder.wavelengths(grid.clone());
            self.wavelengths = Some(grid);
        }
        let mut groups = Vec::new();
        for (key, known) in [("illuminant", &ILLUMINANT[..]), ("surface", &SURFACE), ("target", &TARGET)] {
            let Some(entry) = section.get(key) else { continue };
            for (table, header) in entry.tables()? {
                let section = Section::new(table, header.clone(), "", known)?;
                let group = match key {
                    "illuminant" => self.illuminants(&section)?.into(),
                    "surface" => self.surfaces(&section)?.into(),
                    _ => Group::from(self.targets(&section)?),
                };
                groups.push((Located { header, spans: spans(&section) }, group));
            }
        }
        groups.sort_by_key(|(located, _)| located.header.start);
        let (groups, made): (Vec<_>, Vec<_>) = groups.into_iter().unzip();
        builder.groups = made;
        Ok(File { builder, spans: spans(&section), groups })
    }

    fn illuminants(&mut self, section: &Section) -> Result<Illuminants, Wrong> {
        let base = self.base(section, None)?;
        let intensity = section.get("intensity").map(|entry| intensity(&entry)).transpose()?;
        let model = base.model.as_ref().expect("it is needed");
        let mean = section.get("mean").map(|entry| self.mean(&entry, model)).transpose()?;
        let (fixed, same_shape) = (flag(section, "fixed")?, flag(section, "same_shape")?);
        Ok(Illuminants { fixed, intensity, mean, same_shape, base })
    }

    fn surfaces(&mut self, section: &Section) -> Result<Surfaces, Wrong> {
        Ok(Surfaces { base: self.base(section, None)?, fixed: flag(section, "fixed")? })
    }

    fn targets(&mut self, section: &Section) -> Result<Targets, Wrong> {
        let flat = flag(section, "flat")?;
        let given: Vec<_> =
            ["lrv", "xyz", "hue"].into_iter().filter_map(|key| Some((key, section.get(key)?))).collect();
        if let [(first, _), (_, second), ..] = given.as_slice() {
            return Err(second.wrong(SceneErrorKind::Both { with: first }));
        }
        let aim = match (given.first(), flat) {
            (None, true) => TargetConstraint::Flat(LrvLevels::Uniform(0.0, 1.0)),
            (Some(("lrv", entry)), true) => TargetConstraint::Flat(levels(entry)?),
            (Some(("lrv", entry)), false) => TargetConstraint::Lrv(levels(entry)?),
            (Some((_, entry)), true) => return Err(entry.wrong(SceneErrorKind::Both { with: "flat" })),
            (Some(("xyz", entry)), _) => {
                TargetConstraint::Xyz(entry.numbers("three numbers, as in [0.3, 0.3, 0.3]")?)
            }
            (Some((_, entry)), _) => TargetConstraint::Hue(hue(entry)?),
            (None, false) => {
                let example = "lrv = 0.4, lrv = { from = 0.2, to = 0.6, levels = 10 }, xyz, hue or flat = true; \
                               reflectances with nothing given are a [[surface]]";
                return Err(section.wrong("lrv", SceneErrorKind::Missing { example }));
            }
        };
        let mut of_draws = ["model", "cov_scale", "max_attempts"].into_iter().filter(|_| flat);
        if let Some(entry) = of_draws.find_map(|key| section.get(key)) {
            return Err(entry.wrong(SceneErrorKind::Pointless { with: FLAT_IS_NOT_DRAWN }));
        }
        let base = self.base(section, Some((1, flat)))?;
        let bounds = section.get("bounds");
        if let Some(entry) = bounds.as_ref().filter(|_| !matches!(aim, TargetConstraint::Lrv(_))) {
            return Err(entry.wrong(SceneErrorKind::Pointless { with: bounds_without_lrv(&aim) }));
        }
        let names = [("base", Bounds::Base), ("scaled", Bounds::Scaled), ("both", Bounds::Both)];
        let bounds = bounds.map_or(Ok(Bounds::default()), |entry| entry.choice(&names))?;
        let names = [
            ("independent", Copies::Independent),
            ("scaled", Copies::Scaled),
            ("same_shape", Copies::SameShape),
        ];
        let copies = section.get("copies").map_or(Ok(Copies::default()), |entry| entry.choice(&names))?;
        Ok(Targets { base, aim, bounds, copies })
    }

    /// Settings that all groups have. Targets have a count unless one is said, and flat ones need no model.
    fn base(&mut self, section: &Section, target: Option<(u64, bool)>) -> Result<Base, Wrong> {
        let name = section.need("name", "name = \"background\"")?.text()?;
        let model = match (section.get("model"), target) {
            (None, Some((_, true))) => None,
            (Some(entry), _) => Some(self.model(&entry)?),
            (None, _) => Some(self.model(&section.need("model", "model = \"munsell-vrhel\"")?)?),
        };
        let count = match (section.get("count"), target) {
            (None, Some((count, _))) => count,
            _ => section.need("count", "count = 3, for as many in each scene")?.whole()?,
        };
        let covariance_scale = section.get("cov_scale").map_or(Ok(1.0), |entry| entry.number())?;
        let max_attempts = match section.get("max_attempts") {
            None => DEFAULT_MAX_ATTEMPTS,
            Some(entry) => u32::try_from(entry.whole()?).unwrap_or(u32::MAX), // which is refused
        };
        let quantities = match section.get("quantities") {
            None => vec![Quantity::Spectra],
            Some(entry) => entry.choices(
                &QUANTITIES.map(|quantity| (quantity.name(), quantity)),
                "a list, as in [\"spectra\", \"xyz\"]",
            )?,
        };
        let viewing = self.viewing(section, model.as_ref())?;
        Ok(Base { name: name.to_owned(), model, count, covariance_scale, max_attempts, quantities, viewing })
    }

    /// Settings of what is seen of a group.
    fn viewing(&self, section: &Section, model: Option<&Model>) -> Result<Viewing, Wrong> {
        let grid =
            model.map(|model| model.grid().clone()).or(self.wavelengths.clone()).unwrap_or(Grid::DEFAULT);
        let sensors = section.get("sensors").map(|entry| self.sensors(&entry)).transpose()?;
        let scales = [("white", ResponseScale::White), ("absolute", ResponseScale::Absolute)];
        let response_scale = section.get("response_scale").map(|entry| entry.choice(&scales)).transpose()?;
        let observers = [Observer::Cie1931, Observer::Cie1964].map(|observer| (observer.name(), observer));
        let observer = section.get("observer").map(|entry| entry.choice(&observers)).transpose()?;
        let observer = observer.filter(|observer| *observer != Observer::default());
        let illuminant = section.get("illuminant").map(|entry| self.illuminant(&entry, &grid)).transpose()?;
        let illuminant = illuminant.filter(|illuminant| *illuminant != Illuminant::default());
        let under = section.get("under").map(|entry| entry.text().map(str::to_owned)).transpose()?;
        Ok(Viewing { sensors, response_scale, observer, illuminant, under })
    }

    /// A set of sensors: a built-in one, or a file.
    fn sensors(&self, entry: &Entry) -> Result<Sensors, Wrong> {
        let name = entry.text()?;
        if let Some(builtin) = Sensors::builtin(name) {
            return Ok(builtin);
        }
        let path = self.folder.join(name);
        if !path.exists() {
            return Err(entry.wrong(SceneErrorKind::NoSensors(name.to_owned())));
        }
        let table = Table::open(&path, None).map_err(|e| entry.wrong(SceneErrorKind::SensorTable(e)))?;
        let file = path.file_name().unwrap_or_default().to_string_lossy();
        Sensors::from_table(&file, &table).map_err(|e| entry.wrong(e.into()))
    }

    /// An illuminant: a name, a temperature, or a file of one spectrum.
    fn illuminant(&self, entry: &Entry, grid: &Grid) -> Result<Illuminant, Wrong> {
        let name = entry.text()?;
        match Illuminant::named(name) {
            Ok(illuminant) => return Ok(illuminant),
            Err(error @ IlluminantError::Temperature(_)) => {
                return Err(entry.wrong(SceneErrorKind::Illuminant(error)));
            }
            Err(_) => {}
        }
        let path = self.folder.join(name);
        if !path.exists() {
            return Err(entry.wrong(SceneErrorKind::NoIlluminant(name.to_owned())));
        }
        let wrong = |e: DatasetError| entry.wrong(SceneErrorKind::Power(e));
        let tables = [Table::open(&path, None).map_err(wrong)?];
        let data = Dataset::new(&tables, grid.clone(), Extrapolation::Error).map_err(wrong)?;
        let found = data.spectra().ncols();
        if found != 1 {
            return Err(entry.wrong(SceneErrorKind::Powers { found }));
        }
        // A spline between zeros and a peak may dip below 0, which no light does.
        Ok(Illuminant::Power(data.spectra().column(0).iter().map(|power| power.max(0.0)).collect()))
    }

    fn model(&mut self, entry: &Entry) -> Result<Model, Wrong> {
        let name = entry.text()?;
        if let Some(model) = self.models.get(name) {
            return Ok(model.clone());
        }
        let path = self.folder.join(name);
        let model = if Model::BUILTIN.contains(&name) {
            self.wavelengths
                .clone()
                .map_or_else(|| Model::builtin(name), |grid| Model::builtin_at(name, grid))
        } else if path.is_file() {
            Model::load(&path)
        } else {
            let suggestion = closest(name, Model::BUILTIN.iter().copied());
            return Err(entry.wrong(SceneErrorKind::NoModel { name: name.to_owned(), suggestion }));
        };
        let model = model.map_err(|e| entry.wrong(SceneErrorKind::Model(e)))?;
        self.models.insert(name.to_owned(), model.clone());
        Ok(model)
    }

    /// A mean spectrum on the grid of a model.
    fn mean(&self, entry: &Entry, model: &Model) -> Result<Vec<f64>, Wrong> {
        let grid = model.grid();
        let table = match entry.text()? {
            "d65" => return Ok(colorimetry::d65(grid)),
            "flat" => return Ok(vec![1.0; grid.len()]),
            path => Table::open(self.folder.join(path), None),
        };
        let wrong = |e: DatasetError| entry.wrong(SceneErrorKind::Mean(e));
        let tables = [table.map_err(wrong)?];
        let data = Dataset::new(&tables, grid.clone(), Extrapolation::Error).map_err(wrong)?;
        let found = data.spectra().ncols();
        if found != 1 {
            return Err(entry.wrong(SceneErrorKind::Means { found }));
        }
        let mut measured = tables[0].wavelengths().iter().zip(tables[0].spectrum(0));
        if let Some((&wavelength, &power)) = measured.find(|(_, power)| **power < 0.0) {
            return Err(entry.wrong(SceneErrorKind::NegativeMean { power, wavelength }));
        }
        // A spline between zeros and a peak may dip below 0, which no light does.
        Ok(data.spectra().column(0).iter().map(|power| power.max(0.0)).collect())
    }
}

fn spans(section: &Section) -> Spans {
    section.spans().map(|(key, span)| (key.to_owned(), span)).collect()
}

fn flag(section: &Section, key: &str) -> Result<bool, Wrong> {
    section.get(key).map_or(Ok(false), |entry| entry.flag())
}

/// Two numbers, the first the smaller.
fn range(entry: &Entry) -> Result<(f64, f64), Wrong> {
    let [from, to] = entry.numbers("two numbers, as in [0.2, 0.6]")?;
    Ok((from, to))
}

fn intensity(entry: &Entry) -> Result<(Intensity, IntensityScope), Wrong> {
    let Some(section) = entry.section(&["log_uniform", "from_data", "shared"]).transpose()? else {
        let expected = "a number, { log_uniform = [0.15, 150] } or { from_data = true }";
        let number = entry.number().map_err(|wrong| wrong.expecting(expected))?;
        return Ok((Intensity::Fixed(number), IntensityScope::Scene));
    };
    let scope = if flag(&section, "shared")? { IntensityScope::Scene } else { IntensityScope::Light };
    match (section.get("log_uniform"), section.get("from_data")) {
        (Some(_), Some(data)) => Err(data.wrong(SceneErrorKind::Both { with: "log_uniform" })),
        (Some(entry), None) => {
            let (low, high) = range(&entry)?;
            Ok((Intensity::LogUniform(low, high), scope))
        }
        (None, Some(entry)) if entry.flag()? => Ok((Intensity::Data, scope)),
        _ => Err(section.wrong(
            "",
            SceneErrorKind::Missing {
                example: "intensity = { log_uniform = [0.15, 150] } or { from_data = true }",
            },
        )),
    }
}

fn levels(entry: &Entry) -> Result<LrvLevels, Wrong> {
    if let Some(list) = entry.list().transpose()? {
        return Ok(LrvLevels::Each(list));
    }
    let Some(section) = entry.section(&["from", "to", "levels", "uniform"]).transpose()? else {
        let expected = "a number, a list, { from = 0.2, to = 0.6, levels = 10 } or { uniform = [0.2, 0.6] }";
        return entry.number().map(LrvLevels::from).map_err(|wrong| wrong.expecting(expected));
    };
    if let Some(uniform) = section.get("uniform") {
        if let Some(other) = ["from", "to", "levels"].into_iter().find_map(|key| section.get(key)) {
            return Err(other.wrong(SceneErrorKind::Both { with: "uniform" }));
        }
        let (from, to) = range(&uniform)?;
        return Ok(LrvLevels::Uniform(from, to));
    }
    let from = section.need("from", "{ from = 0.2, to = 0.6, levels = 10 }")?.number()?;
    let to = section.need("to", "{ from = 0.2, to = 0.6, levels = 10 }")?.number()?;
    let count = section.need("levels", "{ from = 0.2, to = 0.6, levels = 10 }")?;
    let levels = count.whole()?;
    if !(1..=10_000).contains(&levels) {
        return Err(count.wrong(SceneErrorKind::Levels(levels)));
    }
    if levels == 1 && from != to {
        return Err(count.wrong(SceneErrorKind::OneLevel { from, to }));
    }
    if levels > 1 && from >= to {
        return Err(entry.wrong(SceneErrorKind::Order { from, to }));
    }
    Ok(LrvLevels::even(from, to, levels as u32))
}

fn hue(entry: &Entry) -> Result<Hue, Wrong> {
    const EXAMPLE: &str = "hue = { levels = 10, saturation = [0.2, 0.6], lightness = [0.2, 0.6] }";
    let Some(section) = entry.section(&["levels", "saturation", "lightness"]).transpose()? else {
        return Err(entry.wrong(SceneErrorKind::Missing { example: EXAMPLE }));
    };
    let levels = section.need("levels", EXAMPLE)?.whole()?;
    let saturation = range(&section.need("saturation", EXAMPLE)?)?;
    let lightness = range(&section.need("lightness", EXAMPLE)?)?;
    Ok(Hue { levels: u32::try_from(levels).unwrap_or(u32::MAX), saturation, lightness })
}
