//! Errors of scenes: the problem, its place, and the remedy.

use std::fmt;

use crate::colorimetry::{Illuminant, IlluminantError};
use crate::dataset::{DatasetError, SpectrumKind};
use crate::grid::{Grid, GridError};
use crate::model::ModelError;
use crate::quantity::Quantity;
use crate::recipe::RecipeError;
use crate::sensors::{SensorError, Sensors};
use crate::suggestion::closest;
use crate::wording::counted;

use super::group::QUANTITIES;

/// Error returned where a scene cannot be drawn.
#[derive(Debug, thiserror::Error)]
#[error("{place}: {problem}")]
pub struct SceneError {
    place: SceneErrorPlace,
    problem: Box<SceneErrorKind>,
}

/// Place of an error.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct SceneErrorPlace {
    /// The file, where there is one.
    pub file: Option<String>,
    /// The line in it, from 1.
    pub line: Option<usize>,
    /// The group.
    pub group: Option<String>,
    /// The key, as scene files have it; none where no key is to blame.
    pub key: String,
}

/// Kind of an error. The messages say what to do about it.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum SceneErrorKind {
    #[error("cannot read it: {0}")]
    Read(std::io::Error),
    #[error("this is not TOML: {0}")]
    Syntax(String),
    #[error("there is no such key{}; there are {known}", meant(suggestion))]
    UnknownKey { suggestion: Option<String>, known: String },
    #[error("it is missing: write {example}")]
    Missing { example: &'static str },
    #[error("this is {found}, and it takes {expected}")]
    Type { expected: &'static str, found: String },
    #[error("there is no {found:?}{}; there are {known}", meant(suggestion))]
    Choice { found: String, suggestion: Option<String>, known: String },
    #[error("{with:?} says the same in another way: keep one of the two")]
    Both { with: &'static str },
    #[error("it means nothing {with}: leave it out")]
    Pointless { with: &'static str },
    #[error("a scene needs something to draw: add an [[illuminant]], a [[surface]] or a [[target]]")]
    NoGroups,
    #[error("{0} scenes: it takes 1 to 4294967296")]
    Scenes(u64),
    #[error("{0:?} is no name for a group: use letters, digits, - and _, a letter first")]
    Name(String),
    #[error("{0:?} is what data sets call an array of their own: use another name")]
    Reserved(String),
    #[error("two groups are called {0:?}: rename one, for its draws depend on its name")]
    SameName(String),
    #[error("the arrays of {0:?} and of this group would have one name: rename one of them")]
    SameArray(String),
    #[error("by its hash {0:?} has the same random numbers: rename one of the two groups")]
    SameStream(String),
    #[error(
        "{0:?} has by its hash the random numbers of stream 0, which are those of draws without a stream: use another \
         name"
    )]
    StreamZero(String),
    #[error("{0} a scene: it takes 1 to {MAX_COUNT}; what needs more can be several groups")]
    Count(u64),
    #[error("{draws:.2e} draws in all: at most {MAX_DRAWS:.0e} fit into one data set, so draw fewer scenes")]
    Draws { draws: f64 },
    #[error("{name:?} is neither a file nor a built-in model ({}){}", builtin(), meant(suggestion))]
    NoModel { name: String, suggestion: Option<String> },
    #[error(transparent)]
    Model(ModelError),
    #[error("this model is of {found}s, and the group is of {wanted}s: choose another model")]
    Kind { found: SpectrumKind, wanted: SpectrumKind },
    #[error("the model is on {model} nm, and the scene on {scene} nm: {}", same_grid(model))]
    Grid { model: Grid, scene: Grid },
    #[error(transparent)]
    Wavelengths(GridError),
    #[error("{0}; name a built-in one (d65, flat), or a table of one spectrum")]
    Mean(DatasetError),
    #[error("there are no lights {name:?}{}; {}", meant(&near(name, known)), lights(known))]
    NoLights { name: String, known: Vec<String> },
    #[error(transparent)]
    Sensors(Box<SensorError>),
    #[error(transparent)]
    Illuminant(#[from] IlluminantError),
    #[error("{0:?} is neither a built-in set of sensors ({known}) nor a file", known = Sensors::BUILTIN.join(", "))]
    NoSensors(String),
    #[error(
        "{0:?} is neither an illuminant ({known}, or a daylight as in 5600K) nor a file",
        known = Illuminant::NAMED.map(|(name, _)| name).join(", ")
    )]
    NoIlluminant(String),
    #[error("{0}; name an illuminant (d65, f11, 5600K), or a table of one spectrum")]
    Power(DatasetError),
    #[error("{found} spectra, and an illuminant is one: leave the others out of the table")]
    Powers { found: usize },
    #[error("{0}; name a built-in set (ss2, cie1931), or a table of a spectrum for each sensor")]
    SensorTable(DatasetError),
    #[error("{found} spectra, and a mean is one: leave the others out of the table")]
    Means { found: usize },
    #[error(
        "{} where the model has {}: give one a band",
        counted(*found as u64, "value", "values"),
        counted(*expected as u64, "band", "bands")
    )]
    MeanLength { found: usize, expected: usize },
    #[error("its mean power is {0}, and must be above 0: give the spectrum of a light")]
    DarkMean(f64),
    #[error(
        "its power at {wavelength} nm is {power}, and that of a light is never negative: raise it to 0 or leave mean out"
    )]
    NegativeMean { power: f64, wavelength: f64 },
    #[error("{0}: every level must be above 0 and below 1, where 1 is a perfect white")]
    Level(f64),
    #[error("{0} levels: it takes 1 to 10000")]
    Levels(u64),
    #[error(
        "1 level from {from} to {to} leaves out which of the two: write lrv = {from}, or 2 levels or more"
    )]
    OneLevel { from: f64, to: f64 },
    #[error(
        "luminous reflectances from {from} to {to}: {source}; or write a list of levels, as in lrv = {{ from = {from}, \
         to = {to}, levels = 10 }}, for each of which another way to draw can be found"
    )]
    HopelessRange { from: f64, to: f64, source: RecipeError },
    #[error("from {from} to {to}: the first must be below the second")]
    Order { from: f64, to: f64 },
    #[error("{from} to {to}: {what} is between 0 and 1, and the first no more than the second")]
    Share { what: &'static str, from: f64, to: f64 },
    #[error(
        "copies are scaled to levels, and there are none: write lrv as a list or as {{ from, to, levels }}"
    )]
    NoLevels,
    #[error("there is none: name one at least, of {}", quantities())]
    NoQuantities,
    #[error("a group has no {quantity} to give; there are {}", quantities())]
    NotOfGroups { quantity: Quantity },
    #[error("hue {hue}, saturation {saturation}, lightness {lightness}: {source}; narrow the ranges")]
    Hue { hue: f64, saturation: f64, lightness: f64, source: RecipeError },
    #[error("{0}")]
    Recipe(#[from] RecipeError),
}

/// The most draws of a group in one scene: what a window of draws has room for.
pub(super) const MAX_COUNT: u64 = 10_000_000;

/// The most draws of one scene file: more is a slip of the pen, of 12 TB at 31 bands.
pub(super) const MAX_DRAWS: f64 = 1e11;

/// A problem, and whose it is.
#[derive(Debug)]
pub(super) struct Fault {
    /// The number of the group.
    pub(super) group: Option<usize>,
    pub(super) key: &'static str,
    pub(super) problem: Box<SceneErrorKind>,
}

impl From<SensorError> for SceneErrorKind {
    fn from(error: SensorError) -> SceneErrorKind {
        SceneErrorKind::Sensors(Box::new(error))
    }
}

impl Fault {
    /// A problem of the scene as a whole.
    pub(super) fn of_scene(key: &'static str, problem: SceneErrorKind) -> Fault {
        Fault { group: None, key, problem: Box::new(problem) }
    }

    /// A problem of a group.
    pub(super) fn of_group(group: usize, key: &'static str, problem: SceneErrorKind) -> Fault {
        Fault { group: Some(group), key, problem: Box::new(problem) }
    }
}

impl SceneError {
    pub(super) fn new(place: SceneErrorPlace, problem: SceneErrorKind) -> SceneError {
        SceneError { place, problem: Box::new(problem) }
    }

    /// Place of the error.
    pub fn place(&self) -> &SceneErrorPlace {
        &self.place
    }

    /// Kind of the error.
    pub fn problem(&self) -> &SceneErrorKind {
        &self.problem
    }
}

impl fmt::Display for SceneErrorPlace {
    fn fmt(&self, f: &mut fmt::Formatter) -> fmt::Result {
        if let Some(file) = &self.file {
            write!(f, "{file}")?;
            if let Some(line) = self.line {
                write!(f, ", line {line}")?;
            }
        }
        let separator = if self.file.is_some() { ", " } else { "" };
        match (self.key.as_str(), &self.group) {
            ("", None) if self.file.is_none() => write!(f, "the scene"),
            ("", None) => Ok(()),
            ("", Some(group)) => write!(f, "{separator}group {group:?}"),
            (key, None) => write!(f, "{separator}{key}"),
            (key, Some(group)) => write!(f, "{separator}{key} of {group:?}"),
        }
    }
}

fn meant(suggestion: &Option<String>) -> String {
    suggestion.as_ref().map_or_else(String::new, |suggestion| format!(", did you mean {suggestion:?}?"))
}

fn near(name: &str, known: &[String]) -> Option<String> {
    closest(name, known.iter().map(String::as_str))
}

fn lights(known: &[String]) -> String {
    match known {
        [] => "the scene has none: add an [[illuminant]]".to_owned(),
        known => format!("there are {}", known.join(", ")),
    }
}

fn builtin() -> String {
    crate::model::Model::BUILTIN.join(", ")
}

fn quantities() -> String {
    QUANTITIES.map(Quantity::name).join(", ")
}

fn same_grid(model: &Grid) -> String {
    if model.to_string().parse().as_ref() != Ok(model) {
        return "leave out wavelengths, or name a model on the scene's".to_owned();
    }
    format!(
        "set wavelengths = \"{model}\", or name a model on the scene's (some built-in ones end in -5nm; \
         others can be fitted)"
    )
}
