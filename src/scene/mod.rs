//! Scenes: groups of lights, surfaces and targets that are drawn together, scene by scene.
//!
//! A [`Scene`] says what a data set of scenes has in each of them, in code or from a file ([`Scene::open`]). It is
//! checked as a whole when it is made, and what holds one can be drawn, by an engine ([`Scene::session`]) or in a host's
//! encoder ([`SceneSampler`]).
//!
//! What an element of a group is depends on the seed, the name of the group, the number of the scene and that of the
//! element alone (see [`Stream::in_rows`](crate::Stream::in_rows)): groups may come, go and change places, and any
//! scene can be drawn alone.
//!
//! Nothing is done that a scene does not need. Groups of one model and recipe share a shader, and all groups one
//! submission a window. What is drawn once for all scenes, and targets, of which there are few, are drawn on the CPU,
//! and no shader is compiled for them.
//!
//! ```
//! use spectroll::scene::{TargetConstraint, Illuminants, LrvLevels, Scene, IntensityScope, Surfaces, Targets};
//! use spectroll::{Bounds, EngineChoice, Engine, EngineError, Intensity, Model};
//!
//! let (daylight, surfaces) = (Model::builtin("granada")?, Model::builtin("munsell-vrhel")?);
//! let lights = Illuminants::new("lights", &daylight, 3);
//! let scene = Scene::builder(3000)
//!     .seed(1)
//!     .group(lights.intensity(Intensity::LogUniform(0.15, 150.0), IntensityScope::Scene))
//!     .group(Surfaces::new("background", &surfaces, 999))
//!     .group(
//!         Targets::new("target", &surfaces, TargetConstraint::Lrv(LrvLevels::even(0.2, 0.6, 10))).bounds(Bounds::Scaled),
//!     )
//!     .build()?;
//!
//! let engine = Engine::new(&EngineChoice::Cpu)?;
//! scene.session(&engine)?.draw(0..4, |window| {
//!     let background = window.values("background"); // (scene, surface, band)
//!     let scenes = (window.scenes.end - window.scenes.start) as usize;
//!     assert_eq!(background.len(), scenes * 999 * 31);
//!     Ok::<_, EngineError>(())
//! })?;
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

mod array;
mod error;
mod file;
mod group;
mod lighting;
mod plan;
mod reader;
mod sampler;
mod session;
mod target;
mod workload;

use crate::grid::Grid;
use crate::model::Model;
use crate::random::stream::Stream;

pub use array::Array;
use error::{Fault, MAX_COUNT, MAX_DRAWS};
pub use error::{SceneError, SceneErrorKind, SceneErrorPlace};
pub use file::{MAX_FILE_BYTES, PRESETS};
pub use group::{
    Copies, Group, Hue, Illuminants, IntensityScope, LrvLevels, Surfaces, TargetConstraint, Targets,
};
pub use plan::GroupKind;
use plan::GroupPlan;
pub use sampler::{PreparedScene, SceneSampler};
pub use session::{GroupSummary, SceneSession, Window};
pub use workload::{GroupWorkload, Workload};

/// Names of arrays that data sets have beside those of groups, in one format or another.
const RESERVED: [&str; 7] = ["wavelength", "wavelengths", "attributes", "X", "S_X", "data", "comment"];

/// A number of scenes, and the groups in each of them.
pub struct Scene {
    scenes: u64,
    seed: u64,
    grid: Grid,
    plans: Vec<GroupPlan>,
}

/// A scene under construction. See [`Scene::builder`].
#[derive(Clone, Debug)]
pub struct SceneBuilder {
    scenes: u64,
    seed: u64,
    wavelengths: Option<Grid>,
    groups: Vec<Group>,
}

impl Scene {
    /// Starts a data set of this number of scenes, without groups. [`SceneBuilder::build`] ends it.
    pub fn builder(scenes: u64) -> SceneBuilder {
        SceneBuilder { scenes, seed: 0, wavelengths: None, groups: Vec::new() }
    }

    /// Number of scenes.
    pub fn scenes(&self) -> u64 {
        self.scenes
    }

    /// The seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The wavelengths.
    pub fn grid(&self) -> &Grid {
        &self.grid
    }

    /// The names of the groups.
    pub fn groups(&self) -> impl Iterator<Item = &str> {
        self.plans.iter().filter(|plan| !plan.arrays.is_empty()).map(|plan| plan.name.as_str())
    }

    /// Every array, group by group.
    pub fn arrays(&self) -> impl Iterator<Item = &Array> {
        self.plans.iter().flat_map(|plan| &plan.arrays)
    }

    /// The scene with one of its groups alone, whose draws stay what they are; `None` where there is no such group.
    pub fn only(self, group: &str) -> Option<Scene> {
        self.keep(|name| name == group)
    }

    /// The scene with those of its groups that are wanted, whose draws stay what they are; `None` where none is. Lights
    /// that these are seen under are still drawn, but give no arrays.
    pub fn keep(mut self, wanted: impl Fn(&str) -> bool) -> Option<Scene> {
        let kept = |plan: &&GroupPlan| wanted(&plan.name);
        let lights =
            self.plans.iter().filter(kept).filter_map(|plan| Some(plan.lighting.as_ref()?.lights.clone()));
        let lights: Vec<String> = lights.collect();
        self.plans.retain(|plan| wanted(&plan.name) || lights.contains(&plan.name));
        let unwanted = self.plans.iter_mut().filter(|plan| !wanted(&plan.name));
        unwanted.for_each(|plan| plan.arrays.clear());
        if self.groups().next().is_some() { Some(self) } else { None }
    }

    /// The names of the groups that are drawn from a model, with that model: with the group's own mean where it has
    /// one.
    pub fn models(&self) -> impl Iterator<Item = (&str, &Model)> {
        self.plans.iter().filter_map(|plan| Some((plan.name.as_str(), plan.model.as_ref()?)))
    }
}

impl SceneBuilder {
    /// The seed (0).
    pub fn seed(self, seed: u64) -> Self {
        SceneBuilder { seed, ..self }
    }

    /// The wavelengths, which the models must have (those of the first model).
    pub fn wavelengths(self, grid: Grid) -> Self {
        SceneBuilder { wavelengths: Some(grid), ..self }
    }

    /// Adds a group.
    pub fn group(mut self, group: impl Into<Group>) -> Self {
        self.groups.push(group.into());
        self
    }

    /// The scene, if it can be drawn.
    pub fn build(self) -> Result<Scene, SceneError> {
        self.checked().map_err(|fault| {
            let group = fault.group.map(|group| self.groups[group].base().name.clone());
            let place = SceneErrorPlace { group, key: fault.key.to_owned(), ..SceneErrorPlace::default() };
            SceneError::new(place, *fault.problem)
        })
    }

    /// The scene, or what is wrong with it and whose it is.
    fn checked(&self) -> Result<Scene, Fault> {
        if !(1..=1 << 32).contains(&self.scenes) {
            return Err(Fault::of_scene("scenes", SceneErrorKind::Scenes(self.scenes)));
        }
        if self.groups.is_empty() {
            return Err(Fault::of_scene("", SceneErrorKind::NoGroups));
        }
        for (number, group) in self.groups.iter().enumerate() {
            let name = &group.base().name;
            let fault = |key, problem| Err(Fault::of_group(number, key, problem));
            let mut letters = name.chars();
            let is_name = letters.next().is_some_and(|c| c.is_ascii_alphabetic())
                && letters.all(|c| c.is_ascii_alphanumeric() || c == '-' || c == '_');
            if !is_name {
                return fault("name", SceneErrorKind::Name(name.clone()));
            }
            if RESERVED.contains(&name.as_str()) {
                return fault("name", SceneErrorKind::Reserved(name.clone()));
            }
            let id = |name: &str| Stream::named(0, name).id();
            if id(name) == Stream::new(0).id() {
                return fault("name", SceneErrorKind::StreamZero(name.clone()));
            }
            for other in self.groups[..number].iter().map(|other| &other.base().name) {
                if other == name {
                    return fault("name", SceneErrorKind::SameName(name.clone()));
                }
                if id(other) == id(name) {
                    return fault("name", SceneErrorKind::SameStream(other.clone()));
                }
            }
            if !(1..=MAX_COUNT).contains(&group.base().count) {
                return fault("count", SceneErrorKind::Count(group.base().count));
            }
        }
        let each = |group: &&Group| match group {
            Group::Illuminants(group) => !group.fixed,
            Group::Surfaces(group) => !group.fixed,
            Group::Targets(_) => true,
        };
        let per_scene = self.groups.iter().filter(each).map(|group| group.base().count as f64).sum::<f64>();
        let draws = per_scene * self.scenes as f64;
        if draws > MAX_DRAWS {
            return Err(Fault::of_scene("scenes", SceneErrorKind::Draws { draws }));
        }
        let grid = self.wavelengths.clone().or_else(|| {
            let mut models = self.groups.iter().filter_map(|group| group.base().model.as_ref());
            models.next().map(|model| model.grid().clone())
        });
        let grid = grid.unwrap_or(Grid::DEFAULT);
        let plans = 0..self.groups.len();
        let mut plans: Vec<_> =
            plans.map(|i| GroupPlan::new(i, &self.groups, &grid, self.seed)).collect::<Result<_, _>>()?;
        lighting::plan(&mut plans, &self.groups, &grid)?;
        let names = |plan: &'_ GroupPlan| plan.arrays.iter().map(|a| a.name.clone()).collect::<Vec<_>>();
        for (number, plan) in plans.iter().enumerate() {
            let clash =
                plans[..number].iter().find(|other| names(other).iter().any(|n| names(plan).contains(n)));
            if let Some(other) = clash {
                return Err(Fault::of_group(number, "name", SceneErrorKind::SameArray(other.name.clone())));
            }
        }
        Ok(Scene { scenes: self.scenes, seed: self.seed, grid, plans })
    }
}
