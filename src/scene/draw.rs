//! Scenes from an engine, window by window.

use std::borrow::Cow;
use std::ops::Range;

use rayon::prelude::*;
use serde::Serialize;

use crate::cpu::Kernel;
use crate::engine::{Batch, Engine, EngineError, Ensemble, Member, Summary};
use crate::program::Tally;
use crate::quantity::Quantity;
use crate::stream::Draws;

use super::Scene;
use super::cast::{Array, Cast, Content, Drawing, Shapes};
use super::group::Sharing;

/// About how many bytes a window has where no engine draws it.
const WINDOW_BYTES: u64 = 8 << 20;

/// Some scenes, with every array that differs between scenes.
#[derive(Debug)]
pub struct Window<'a> {
    /// Which scenes these are.
    pub scenes: Range<u64>,
    arrays: Vec<(&'a Array, Cow<'a, [u8]>)>,
}

/// An engine with a scene. See [`Scene::drawer`].
pub struct SceneDrawer<'a> {
    scene: &'a Scene,
    /// For the groups that the engine draws, where there are any.
    ensemble: Option<Ensemble<'a>>,
    /// What was drawn once, of each group.
    once: Vec<Option<Once>>,
}

/// What a group took.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct GroupSummary {
    /// The group.
    pub group: String,
    /// What its draws took.
    #[serde(flatten)]
    pub summary: Summary,
}

/// Spectra and tallies that serve all scenes, one for each element.
pub(super) struct Once {
    pub(super) spectra: Vec<f32>,
    pub(super) tallies: Vec<Tally>,
}

/// The arrays of a group in a window, as they come: some are those of the engine.
#[derive(Default)]
pub(super) struct Columns<'a> {
    pub(super) spectra: Cow<'a, [f32]>,
    attempts: Cow<'a, [u32]>,
    intensity: Vec<f32>,
    lrv: Vec<f32>,
    xyz: Vec<f32>,
}

impl<'a> Window<'a> {
    /// The arrays, group by group, as they are in memory: 4 bytes a value in this machine's order, scene by scene.
    pub fn arrays(&self) -> impl Iterator<Item = (&'a Array, &[u8])> {
        self.arrays.iter().map(|(array, bytes)| (*array, &**bytes))
    }

    /// The bytes of an array by its name; none where it does not differ between scenes, or is none.
    pub fn bytes(&self, name: &str) -> &[u8] {
        self.arrays.iter().find(|(array, _)| array.name == name).map_or(&[], |(_, bytes)| bytes)
    }

    /// The values of an array of f32.
    ///
    /// # Panics
    /// Where they are attempts, which are u32.
    pub fn values(&self, name: &str) -> &[f32] {
        let counts = |(array, _): &&(&Array, _)| array.name == name && array.content == Content::Attempts;
        assert!(!self.arrays.iter().any(|array| counts(&array)), "{name} are integers");
        bytemuck::cast_slice(self.bytes(name))
    }
}

impl Scene {
    /// Gets ready to draw: compiles what the engine needs for the groups that it draws, and draws what serves all
    /// scenes.
    pub fn drawer<'a>(&'a self, engine: &'a Engine) -> Result<SceneDrawer<'a>, EngineError> {
        let drawings = self.casts.iter().filter_map(Cast::drawn_by_engine);
        let members: Vec<_> = drawings
            .map(|drawing| Member { recipe: &drawing.recipe, per_step: drawing.places.into() })
            .collect();
        let ensemble = (!members.is_empty()).then(|| engine.ensemble(&members)).transpose()?;
        Ok(SceneDrawer { scene: self, ensemble, once: self.once()? })
    }

    /// What serves all scenes, of each group.
    pub(super) fn once(&self) -> Result<Vec<Option<Once>>, EngineError> {
        let once = |cast: &Cast| match &cast.shapes {
            Shapes::Once(drawing) => Once::new(cast, drawing).map(Some),
            _ => Ok(None),
        };
        self.casts.iter().map(once).collect()
    }
}

impl Once {
    fn new(cast: &Cast, drawing: &Drawing) -> Result<Once, EngineError> {
        let kernel = Kernel::<f32>::new(&drawing.recipe.program().spectra_alone());
        let stream = cast.stream.in_rows(drawing.places);
        let drawn = (0..u64::from(drawing.places)).into_par_iter().map(|place| kernel.draw(stream, place));
        let (values, tallies): (Vec<_>, Vec<_>) = drawn.unzip();
        check(cast, drawing.places, 0, &tallies)?;
        let mut spectra = values.into_iter().flatten().flatten().collect::<Vec<f32>>();
        let mut tallies = tallies;
        if drawing.places < cast.count {
            spectra = spectra.repeat(cast.count as usize);
            tallies = tallies.repeat(cast.count as usize);
        }
        Ok(Once { spectra, tallies })
    }

    fn attempts(&self) -> Vec<u32> {
        self.tallies.iter().map(|tally| tally.attempts()).collect()
    }
}

impl SceneDrawer<'_> {
    /// The arrays that serve all scenes, as they are in memory.
    pub fn constants(&self) -> Vec<(&Array, Vec<u8>)> {
        let mut constants = Vec::new();
        for (cast, once) in self.scene.casts.iter().zip(&self.once) {
            let Some(once) = once else { continue };
            for array in cast.arrays.iter().filter(|array| !array.per_scene) {
                let bytes = match array.content {
                    Content::Attempts => bytemuck::cast_slice(&once.attempts()).to_vec(),
                    _ => bytemuck::cast_slice(&once.spectra).to_vec(),
                };
                constants.push((array, bytes));
            }
        }
        constants
    }

    /// What the draws took that serve all scenes, of each group.
    pub fn taken_once(&self) -> Vec<GroupSummary> {
        let summary = |(cast, once): (&Cast, &Option<Once>)| {
            let mut summary = Summary::default();
            if let (Some(once), Shapes::Once(drawing)) = (once, &cast.shapes) {
                summary.count(&once.tallies[..drawing.places as usize]);
            }
            GroupSummary { group: cast.name.clone(), summary }
        };
        self.scene.casts.iter().zip(&self.once).map(summary).collect()
    }

    /// Draws some scenes and hands them to `sink` in order, window by window. The first error ends it. Returns what that
    /// took, besides [`SceneDrawer::taken_once`].
    pub fn draw<E: From<EngineError>>(
        &mut self,
        scenes: Range<u64>,
        mut sink: impl FnMut(Window) -> Result<(), E>,
    ) -> Result<Vec<GroupSummary>, E> {
        let (scene, once) = (self.scene, &self.once);
        let none = |cast: &Cast| GroupSummary { group: cast.name.clone(), ..GroupSummary::default() };
        let mut summaries: Vec<_> = scene.casts.iter().map(none).collect();
        let mut next = scenes.start;
        let mut window = |batches: &[Batch], count: u64| {
            let part = next..next + count;
            next = part.end;
            let mut batches = batches.iter();
            let mut arrays = Vec::new();
            for ((cast, once), summary) in scene.casts.iter().zip(once).zip(&mut summaries) {
                let drawing = cast.drawn_by_engine();
                let batch = drawing.and_then(|drawing| batches.next().map(|batch| (drawing, batch)));
                let columns = columns(cast, once.as_ref(), batch, part.clone(), &mut summary.summary)?;
                arrays.extend(columns.arrays(cast));
            }
            sink(Window { scenes: part, arrays })
        };
        match &mut self.ensemble {
            Some(ensemble) => {
                let drawings = || scene.casts.iter().filter_map(|cast| Some((cast, cast.drawn_by_engine()?)));
                let draws: Vec<_> = drawings()
                    .map(|(cast, drawing)| Draws {
                        stream: cast.stream.in_rows(drawing.places),
                        first: scenes.start * u64::from(drawing.places),
                        count: (scenes.end - scenes.start) * u64::from(drawing.places),
                    })
                    .collect();
                let places = drawings().next().map_or(1, |(_, drawing)| u64::from(drawing.places));
                ensemble.draw(&draws, scenes.end - scenes.start, |batches| {
                    window(batches, batches[0].draws.count / places)
                })?;
            }
            None => {
                let bytes: u64 = scene.arrays().filter(|a| a.per_scene).map(|a| a.bytes() as u64).sum();
                let most = (WINDOW_BYTES / bytes.max(1)).max(1);
                let mut start = scenes.start;
                while start < scenes.end {
                    let count = most.min(scenes.end - start);
                    window(&[], count)?;
                    start += count;
                }
            }
        }
        Ok(summaries)
    }
}

/// The columns of a group in some scenes.
pub(super) fn columns<'a>(
    cast: &'a Cast,
    once: Option<&'a Once>,
    batch: Option<(&Drawing, &Batch<'a>)>,
    scenes: Range<u64>,
    summary: &mut Summary,
) -> Result<Columns<'a>, EngineError> {
    let count = (scenes.end - scenes.start) as usize;
    let mut columns = match (&cast.shapes, once, batch) {
        (_, _, Some((drawing, batch))) => {
            check(cast, drawing.places, scenes.start, batch.tallies())?;
            summary.count(batch.tallies());
            // These tallies are attempts and nothing else: nothing was scaled.
            let attempts: &[u32] = bytemuck::cast_slice(batch.bytes(Quantity::Attempts));
            let (spectra, attempts) = (batch.values(Quantity::Spectra), attempts);
            if drawing.places == cast.count {
                Columns { spectra: spectra.into(), attempts: attempts.into(), ..Columns::default() }
            } else {
                let (bands, copies) = (spectra.len() / count, cast.count as usize);
                let spectra = spectra.chunks_exact(bands).flat_map(|s| s.repeat(copies)).collect::<Vec<_>>();
                let attempts = attempts.iter().flat_map(|&a| vec![a; copies]).collect::<Vec<_>>();
                Columns { spectra: spectra.into(), attempts: attempts.into(), ..Columns::default() }
            }
        }
        (_, Some(once), _) => match cast.intensity {
            Some(_) => Columns { spectra: once.spectra.repeat(count).into(), ..Columns::default() },
            None => Columns::default(),
        },
        (Shapes::Aimed(aimed), ..) => {
            let elements = (scenes.start..scenes.end).into_par_iter();
            let elements = elements.flat_map_iter(|scene| (0..cast.count).map(move |e| (scene, e)));
            let drawn: Vec<_> =
                elements.map(|(scene, element)| aimed.draw(cast.stream, scene, element)).collect();
            let tallies: Vec<Tally> = drawn.iter().filter_map(|drawn| drawn.tally).collect();
            check(cast, cast.count, scenes.start, &tallies)?;
            summary.count(&tallies);
            Columns {
                lrv: drawn.iter().map(|drawn| drawn.lrv).collect(),
                xyz: drawn.iter().filter_map(|drawn| drawn.xyz).flatten().collect(),
                attempts: tallies.iter().map(|tally| tally.attempts()).collect(),
                spectra: drawn.into_iter().flat_map(|drawn| drawn.spectrum).collect(),
                ..Columns::default()
            }
        }
        _ => unreachable!("the engine draws the others"),
    };
    if let Some(intensity) = &cast.intensity {
        let elements = match intensity.sharing {
            Sharing::Scene => 1,
            Sharing::Each => cast.count,
        };
        let scenes = scenes.clone();
        let all = scenes.flat_map(|scene| (0..elements).map(move |element| (scene, element)));
        columns.intensity = all.map(|(scene, e)| intensity.at(cast.stream, scene, e)).collect();
        let each = columns.spectra.len() / columns.intensity.len();
        let spectra = columns.spectra.to_mut().chunks_exact_mut(each);
        for (spectra, intensity) in spectra.zip(&columns.intensity) {
            spectra.iter_mut().for_each(|value| *value *= intensity);
        }
    }
    Ok(columns)
}

impl<'a> Columns<'a> {
    /// The arrays of the group that have an entry a scene.
    fn arrays(self, cast: &'a Cast) -> Vec<(&'a Array, Cow<'a, [u8]>)> {
        let bytes = |content| match content {
            Content::Spectra => cast_bytes(&self.spectra),
            Content::Attempts => cast_bytes(&self.attempts),
            Content::Intensity => Cow::Owned(bytemuck::cast_slice(&self.intensity).to_vec()),
            Content::Lrv => Cow::Owned(bytemuck::cast_slice(&self.lrv).to_vec()),
            Content::Xyz => Cow::Owned(bytemuck::cast_slice(&self.xyz).to_vec()),
        };
        cast.arrays.iter().filter(|a| a.per_scene).map(|array| (array, bytes(array.content))).collect()
    }
}

impl Columns<'_> {
    /// The values of f32 besides spectra.
    pub(super) fn known<'c>(&self, cast: &'c Cast) -> Vec<(&'c Array, Vec<f32>)> {
        let values = |array: &'c Array| {
            let values = match array.content {
                Content::Intensity => &self.intensity,
                Content::Lrv => &self.lrv,
                Content::Xyz => &self.xyz,
                Content::Spectra | Content::Attempts => return None,
            };
            Some((array, values.clone()))
        };
        cast.arrays.iter().filter_map(values).collect()
    }
}

/// The bytes of values, without a copy where they are borrowed.
fn cast_bytes<'a, T: bytemuck::Pod>(values: &Cow<'a, [T]>) -> Cow<'a, [u8]> {
    match values {
        Cow::Borrowed(values) => Cow::Borrowed(bytemuck::cast_slice(values)),
        Cow::Owned(values) => Cow::Owned(bytemuck::cast_slice(values).to_vec()),
    }
}

/// An error where a draw failed. There are `places` a scene, from scene `first` on.
fn check(cast: &Cast, places: u32, first: u64, tallies: &[Tally]) -> Result<(), EngineError> {
    let Some(failed) = tallies.iter().position(|&tally| tally == Tally::FAILED) else { return Ok(()) };
    let (scene, element) = (failed as u64 / u64::from(places), failed as u64 % u64::from(places));
    let (group, attempts) = (cast.name.clone(), cast.max_attempts);
    Err(EngineError::ExhaustedInScene { group, scene: first + scene, element, attempts })
}
