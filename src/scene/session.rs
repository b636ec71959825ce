//! Scenes from an engine, window by window.

use std::borrow::Cow;
use std::ops::Range;
use std::sync::Arc;

use rayon::ThreadPool;
use rayon::prelude::*;
use serde::Serialize;

use crate::cpu::Kernel;
use crate::draw_status::DrawStatus;
use crate::engine::{Batch, DrawSummary, Engine, EngineError, Job, Schedule};
use crate::quantity::Quantity;
use crate::random::stream::{DrawRange, Draws};

use super::Scene;
use super::array::{Array, is_multiplied};
use super::group::IntensityScope;
use super::plan::{Drawing, GroupPlan, Shapes};

/// Approximate size of a window in bytes, where no engine draws it.
const WINDOW_BYTES: u64 = 8 << 20;

/// Some scenes, with every array that differs between scenes.
#[derive(Debug)]
pub struct Window<'a> {
    /// Range of the scenes.
    pub scenes: Range<u64>,
    arrays: Vec<(&'a Array, Cow<'a, [u8]>)>,
}

/// An engine with a scene. See [`Scene::session`].
pub struct SceneSession<'a> {
    scene: &'a Scene,
    /// For the groups that the engine draws, where there are any.
    schedule: Option<Schedule<'a>>,
    /// Spectra of each group that were drawn once.
    once: Vec<Option<SharedSpectra>>,
    /// Threads for what the engine does not draw.
    pool: Arc<ThreadPool>,
}

/// Summary of a group's draws.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct GroupSummary {
    /// The group.
    pub group: String,
    /// Summary of its draws.
    #[serde(flatten)]
    pub summary: DrawSummary,
}

/// Values and tallies that serve all scenes, of each element: spectra, and the quantities that its recipe asks for.
pub(super) struct SharedSpectra {
    values: Vec<(Quantity, Vec<f32>)>,
    pub(super) statuses: Vec<DrawStatus>,
}

/// The arrays of a group in a window, as they come: some are those of the engine.
#[derive(Default)]
pub(super) struct Columns<'a> {
    /// Every quantity of f32.
    values: Vec<(Quantity, Cow<'a, [f32]>)>,
    attempts: Cow<'a, [u32]>,
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
        let counts = |(array, _): &&(&Array, _)| array.name == name && array.quantity == Quantity::Attempts;
        assert!(!self.arrays.iter().any(|array| counts(&array)), "{name} are integers");
        bytemuck::cast_slice(self.bytes(name))
    }
}

impl Scene {
    /// Gets ready to draw: compiles what the engine needs for the groups that it draws, and draws what serves all
    /// scenes.
    pub fn session<'a>(&'a self, engine: &'a Engine) -> Result<SceneSession<'a>, EngineError> {
        let drawings = self.plans.iter().filter_map(GroupPlan::drawn_by_engine);
        let members: Vec<_> = drawings
            .map(|drawing| Job { recipe: &drawing.recipe, per_step: drawing.places.into() })
            .collect();
        let schedule = (!members.is_empty()).then(|| engine.schedule(&members)).transpose()?;
        let pool = engine.pool()?;
        Ok(SceneSession { scene: self, schedule, once: pool.install(|| self.once())?, pool })
    }

    /// Draws the spectra that serve all scenes, for each group, in the rayon pool that it is called in.
    pub(super) fn once(&self) -> Result<Vec<Option<SharedSpectra>>, EngineError> {
        let once = |plan: &GroupPlan| match &plan.shapes {
            Shapes::Once(drawing) => SharedSpectra::new(plan, drawing).map(Some),
            _ => Ok(None),
        };
        self.plans.iter().map(once).collect()
    }
}

impl SharedSpectra {
    fn new(plan: &GroupPlan, drawing: &Drawing) -> Result<SharedSpectra, EngineError> {
        let kernel = Kernel::<f32>::new(drawing.recipe.program());
        let stream = plan.stream.in_rows(drawing.places);
        let drawn = (0..u64::from(drawing.places)).into_par_iter().map(|place| kernel.draw(stream, place));
        let (drawn, statuses): (Vec<_>, Vec<_>) = drawn.unzip();
        check(plan, drawing.places, 0, &statuses)?;
        // One for each element, or one for all.
        let copies = (plan.count / drawing.places) as usize;
        let formats = drawing.recipe.formats().into_iter().enumerate();
        let values = formats.map(|(number, format)| {
            let values: Vec<f32> = drawn.iter().flat_map(|values| &values[number]).copied().collect();
            (format.quantity, values.repeat(copies))
        });
        Ok(SharedSpectra { values: values.collect(), statuses: statuses.repeat(copies) })
    }

    pub(super) fn of(&self, quantity: Quantity) -> &[f32] {
        values_of(&self.values, quantity)
    }

    fn attempts(&self) -> Vec<u32> {
        self.statuses.iter().map(|status| status.attempts()).collect()
    }
}

impl SceneSession<'_> {
    /// The arrays that serve all scenes, as they are in memory.
    pub fn constants(&self) -> Vec<(&Array, Vec<u8>)> {
        let mut constants = Vec::new();
        for (plan, once) in self.scene.plans.iter().zip(&self.once) {
            if let Some((array, values)) = plan.fixed_intensities() {
                constants.push((array, bytemuck::cast_slice(&values).to_vec()));
            }
            let Some(once) = once else { continue };
            let is_drawn = |array: &&Array| !array.per_scene && array.quantity != Quantity::Intensity;
            for array in plan.arrays.iter().filter(is_drawn) {
                let bytes = match array.quantity {
                    Quantity::Attempts => bytemuck::cast_slice(&once.attempts()).to_vec(),
                    quantity => bytemuck::cast_slice(once.of(quantity)).to_vec(),
                };
                constants.push((array, bytes));
            }
        }
        constants
    }

    /// Summaries of the draws that serve all scenes, for each group.
    pub fn taken_once(&self) -> Vec<GroupSummary> {
        let summary = |(plan, once): (&GroupPlan, &Option<SharedSpectra>)| {
            let mut summary = DrawSummary::default();
            match (once, &plan.shapes) {
                (Some(once), Shapes::Once(drawing)) => {
                    summary.count(&once.statuses[..drawing.places as usize]);
                }
                (_, Shapes::Target(target)) => summary.count(&target.statuses_once()),
                _ => {}
            }
            GroupSummary { group: plan.name.clone(), summary }
        };
        self.scene.plans.iter().zip(&self.once).map(summary).collect()
    }

    /// Draws some scenes and hands them to `sink` in order, window by window. The first error ends it. Returns what that
    /// took, besides [`SceneSession::taken_once`].
    pub fn draw<E: From<EngineError>>(
        &mut self,
        scenes: Range<u64>,
        mut sink: impl FnMut(Window) -> Result<(), E>,
    ) -> Result<Vec<GroupSummary>, E> {
        let (scene, once, pool) = (self.scene, &self.once, &self.pool);
        let none = |plan: &GroupPlan| GroupSummary { group: plan.name.clone(), ..GroupSummary::default() };
        let mut summaries: Vec<_> = scene.plans.iter().map(none).collect();
        let (first, mut next) = (scenes.start, scenes.start);
        let mut window = |batches: &[Batch], count: u64| {
            let part = next..next + count;
            next = part.end;
            let mut batches = batches.iter();
            let mut all = Vec::new();
            for ((plan, once), summary) in scene.plans.iter().zip(once).zip(&mut summaries) {
                let drawing = plan.drawn_by_engine();
                let batch = drawing.and_then(|drawing| batches.next().map(|batch| (drawing, batch)));
                let (once, scenes) = (once.as_ref(), (first, part.clone()));
                all.push(pool.install(|| columns(plan, once, batch, scenes, &mut summary.summary))?);
            }
            pool.install(|| light(scene, once, &mut all, count as usize));
            let arrays =
                scene.plans.iter().zip(all).flat_map(|(plan, columns)| columns.arrays(plan)).collect();
            sink(Window { scenes: part, arrays })
        };
        match &mut self.schedule {
            Some(schedule) => {
                let drawings = || scene.plans.iter().filter_map(|plan| Some((plan, plan.drawn_by_engine()?)));
                let draws: Vec<_> = drawings()
                    .map(|(plan, drawing)| DrawRange {
                        stream: plan.stream.in_rows(drawing.places),
                        first: scenes.start * u64::from(drawing.places),
                        count: (scenes.end - scenes.start) * u64::from(drawing.places),
                    })
                    .map(Draws::from)
                    .collect();
                let places = drawings().next().map_or(1, |(_, drawing)| u64::from(drawing.places));
                schedule.draw(&draws, scenes.end - scenes.start, |batches| {
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

/// The columns of a group in some scenes, of a run whose first scene is `first`. What scenes share is counted in the
/// first of them that the run has. Works in the rayon pool that it is called in.
pub(super) fn columns<'a>(
    plan: &'a GroupPlan,
    once: Option<&'a SharedSpectra>,
    batch: Option<(&Drawing, &Batch<'a>)>,
    (first, scenes): (u64, Range<u64>),
    summary: &mut DrawSummary,
) -> Result<Columns<'a>, EngineError> {
    let count = (scenes.end - scenes.start) as usize;
    let mut columns = match (&plan.shapes, once, batch) {
        (_, _, Some((drawing, batch))) => {
            check(plan, drawing.places, scenes.start, batch.statuses())?;
            summary.count(batch.statuses());
            // These tallies are attempts and nothing else: nothing was scaled.
            let attempts: &[u32] = bytemuck::cast_slice(batch.bytes(Quantity::Attempts));
            let copies = (plan.count / drawing.places) as usize;
            let formats = drawing.recipe.formats().into_iter();
            let values = formats
                .map(|format| (format.quantity, copied(batch.values(format.quantity), format.width, copies)));
            Columns { values: values.collect(), attempts: copied(attempts, 1, copies) }
        }
        (_, Some(once), _) => {
            let varies = |quantity| plan.intensity.is_some() && is_multiplied(quantity);
            let varying = once.values.iter().filter(|(quantity, _)| varies(*quantity));
            let values = varying.map(|(quantity, values)| (*quantity, Cow::Owned(values.repeat(count))));
            Columns { values: values.collect(), ..Columns::default() }
        }
        (Shapes::Target(target), ..) => {
            let elements = (scenes.start..scenes.end).into_par_iter();
            let elements = elements.flat_map_iter(|scene| (0..plan.count).map(move |e| (scene, e)));
            let drawn: Vec<_> =
                elements.map(|(scene, element)| target.draw(plan.stream, scene, element)).collect();
            let statuses: Vec<DrawStatus> = drawn.iter().filter_map(|drawn| drawn.status).collect();
            check(plan, plan.count, scenes.start, &statuses)?;
            if !statuses.is_empty() {
                let rows = scenes.clone().zip(statuses.chunks_exact(plan.count as usize));
                let own = rows.filter(|(scene, _)| target.is_drawn_for(*scene, first));
                own.for_each(|(_, statuses)| summary.count(statuses));
            }
            let values = |quantity| -> Vec<f32> {
                match (quantity, &plan.eye) {
                    (Quantity::Spectra, _) => drawn.iter().flat_map(|d| &d.spectrum).copied().collect(),
                    (Quantity::Lrv, _) => drawn.iter().map(|d| d.lrv).collect(),
                    (Quantity::Xyz, _) if drawn.iter().all(|d| d.xyz.is_some()) => {
                        drawn.iter().filter_map(|d| d.xyz).flatten().collect()
                    }
                    (seen, Some(eye)) => {
                        drawn.par_iter().flat_map_iter(|d| eye.see(&d.spectrum, seen)).collect()
                    }
                    (other, None) => unreachable!("targets have no {other}"),
                }
            };
            let given = plan.arrays.iter().filter(|array| array.under.is_none()).map(|array| array.quantity);
            // A renderer takes the spectra, even where no array has them.
            let wanted = given.filter(|quantity| !matches!(quantity, Quantity::Attempts | Quantity::Spectra));
            let wanted = std::iter::once(Quantity::Spectra).chain(wanted);
            Columns {
                values: wanted.map(|quantity| (quantity, values(quantity).into())).collect(),
                attempts: statuses.iter().map(|status| status.attempts()).collect(),
            }
        }
        _ => unreachable!("the engine draws the others"),
    };
    if let Some(intensity) = &plan.intensity {
        let elements = match intensity.scope {
            IntensityScope::Scene => 1,
            IntensityScope::Light => plan.count,
        };
        let scenes = scenes.clone();
        let all = scenes.flat_map(|scene| (0..elements).map(move |element| (scene, element)));
        let levels: Vec<f32> = all.map(|(scene, e)| intensity.at(plan.stream, scene, e)).collect();
        for (_, values) in columns.values.iter_mut().filter(|(quantity, _)| is_multiplied(*quantity)) {
            let each = values.len() / levels.len();
            for (values, level) in values.to_mut().chunks_exact_mut(each).zip(&levels) {
                values.iter_mut().for_each(|value| *value *= level);
            }
        }
        columns.values.push((Quantity::Intensity, levels.into()));
    }
    Ok(columns)
}

/// Adds what is seen under lights to the columns of all groups.
fn light(scene: &Scene, once: &[Option<SharedSpectra>], columns: &mut [Columns], scenes: usize) {
    for (number, plan) in scene.plans.iter().enumerate() {
        let Some(lighting) = &plan.lighting else { continue };
        let lights = scene.plans.iter().position(|plan| plan.name == lighting.lights);
        let lights = lights.expect("lights are kept with what is seen under them");
        // Out of the list, so that the other is free.
        let mut own = std::mem::take(&mut columns[number]);
        lighting.add(
            (plan, &mut own, once[number].as_ref()),
            (&scene.plans[lights], &columns[lights], once[lights].as_ref()),
            scenes,
        );
        columns[number] = own;
    }
}

/// Values in rows of `width`, each row so many times.
fn copied<T: Copy>(values: &[T], width: usize, copies: usize) -> Cow<'_, [T]>
where
    [T]: ToOwned<Owned = Vec<T>>,
{
    match copies {
        1 => values.into(),
        copies => values.chunks_exact(width).flat_map(|row| row.repeat(copies)).collect::<Vec<T>>().into(),
    }
}

/// The values of a quantity; none where it is not there.
fn values_of<V: AsRef<[f32]>>(values: &[(Quantity, V)], quantity: Quantity) -> &[f32] {
    values.iter().find(|(other, _)| *other == quantity).map_or(&[], |(_, values)| values.as_ref())
}

impl<'a> Columns<'a> {
    /// The arrays of the group that have an entry a scene.
    fn arrays(mut self, plan: &'a GroupPlan) -> Vec<(&'a Array, Cow<'a, [u8]>)> {
        let mut bytes = |quantity| match quantity {
            Quantity::Attempts => cast_bytes(std::mem::take(&mut self.attempts)),
            quantity => {
                let values = self.values.iter_mut().find(|(other, _)| *other == quantity);
                cast_bytes(std::mem::take(&mut values.expect("the group gives it").1))
            }
        };
        plan.arrays.iter().filter(|a| a.per_scene).map(|array| (array, bytes(array.quantity))).collect()
    }

    pub(super) fn of(&self, quantity: Quantity) -> &[f32] {
        values_of(&self.values, quantity)
    }

    /// The values of a quantity, and whether they are those that all scenes share.
    pub(super) fn or_shared<'c>(
        &'c self,
        once: Option<&'c SharedSpectra>,
        quantity: Quantity,
    ) -> (&'c [f32], bool) {
        match (self.of(quantity), once) {
            ([], Some(once)) => (once.of(quantity), true),
            (values, _) => (values, false),
        }
    }

    /// Adds a quantity.
    pub(super) fn push(&mut self, quantity: Quantity, values: Vec<f32>) {
        self.values.push((quantity, values.into()));
    }

    /// The values of f32 besides spectra.
    pub(super) fn known<'c>(&self, plan: &'c GroupPlan) -> Vec<(&'c Array, Vec<f32>)> {
        let others = plan.arrays.iter().filter(|array| array.quantity != Quantity::Spectra);
        let known = others.map(|array| (array, self.of(array.quantity).to_vec()));
        known.filter(|(_, values)| !values.is_empty()).collect()
    }
}

/// The bytes of values, without a copy where they are borrowed.
fn cast_bytes<T: bytemuck::Pod>(values: Cow<'_, [T]>) -> Cow<'_, [u8]> {
    match values {
        Cow::Borrowed(values) => Cow::Borrowed(bytemuck::cast_slice(values)),
        Cow::Owned(values) => Cow::Owned(bytemuck::cast_slice(&values).to_vec()),
    }
}

/// An error where a draw failed. There are `places` a scene, from scene `first` on.
fn check(plan: &GroupPlan, places: u32, first: u64, statuses: &[DrawStatus]) -> Result<(), EngineError> {
    let Some(failed) = statuses.iter().position(|&status| status == DrawStatus::FAILED) else {
        return Ok(());
    };
    let (scene, element) = (failed as u64 / u64::from(places), failed as u64 % u64::from(places));
    let (group, attempts) = (plan.name.clone(), plan.max_attempts);
    Err(EngineError::ExhaustedInScene { group, scene: first + scene, element, attempts })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::model::Model;
    use crate::scene::Surfaces;

    #[test]
    fn a_failed_draw_is_named_by_its_scene() {
        let model = Model::builtin("munsell-vrhel").expect("it is built in");
        let scene =
            Scene::builder(10).group(Surfaces::new("wall", &model, 3)).build().expect("it is possible");
        let mut statuses = [DrawStatus::accepted(1, false); 12];
        assert_eq!(check(&scene.plans[0], 3, 5, &statuses).map_err(|error| error.to_string()), Ok(()));
        statuses[7..].fill(DrawStatus::FAILED);
        match check(&scene.plans[0], 3, 5, &statuses) {
            Err(EngineError::ExhaustedInScene { group, scene, element, .. }) => {
                assert_eq!((group.as_str(), scene, element), ("wall", 7, 1));
            }
            other => panic!("{other:?}"),
        }
    }
}
