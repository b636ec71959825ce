//! Workload of drawing a scene, and the work that is spared.

use serde::Serialize;

use super::Scene;
use super::array::Array;
use super::plan::{GroupKind, GroupPlan, Shapes};
use super::target::TargetPlan;
use crate::quantity::Quantity;

/// Workload of drawing a scene.
#[derive(Clone, Debug, Serialize)]
pub struct Workload {
    /// The groups, in order.
    pub groups: Vec<GroupWorkload>,
    /// Number of shaders compiled, where a graphics adapter draws.
    pub shaders: usize,
    /// Number of spectra drawn for all scenes.
    pub draws: u64,
    /// Work that is spared, and why.
    pub left_out: Vec<String>,
    /// Size of all arrays in bytes.
    pub bytes: u64,
}

/// Workload of drawing a group.
#[derive(Clone, Debug, Serialize)]
pub struct GroupWorkload {
    /// Its name.
    pub name: String,
    /// Kind of its spectra.
    pub kind: GroupKind,
    /// The number of the shader that draws it, from 1; none where the CPU does.
    pub shader: Option<usize>,
    /// Number of spectra drawn for each scene, or for each round of scenes.
    pub draws_per_scene: u64,
    /// Number of scenes in a row that share a draw and have copies of it; 1 where each scene has draws of its own.
    pub scenes_per_round: u64,
    /// Number of spectra drawn once for all scenes.
    pub draws_once: u64,
    /// Its arrays.
    pub arrays: Vec<Array>,
}

impl Scene {
    /// Computes the workload of drawing a number of scenes, the first of which begins a round where rounds share draws.
    pub fn workload(&self, scenes: u64) -> Workload {
        let mut programs: Vec<&crate::program::Program> = Vec::new();
        let mut left_out = Vec::new();
        let mut groups = Vec::new();
        for plan in &self.plans {
            let mut shader = None;
            if let Some(drawing) = plan.drawn_by_engine() {
                let program = drawing.recipe.program();
                let known = programs.iter().position(|known| *known == program);
                if let Some(known) = known {
                    left_out.push(format!(
                        "{}: no shader of its own, for its model and recipe are those of shader {}",
                        plan.name,
                        known + 1
                    ));
                }
                shader = Some(
                    1 + known.unwrap_or_else(|| {
                        programs.push(program);
                        programs.len() - 1
                    }),
                );
            }
            left_out.extend(spared(plan));
            if !plan.gives(Quantity::Spectra) {
                let drawn = if plan.drawn_by_engine().is_some() { "neither computed nor" } else { "not" };
                left_out.push(format!(
                    "{}: its spectra are {drawn} stored, for quantities does not name them",
                    plan.name
                ));
            }
            let (draws_per_scene, draws_once) = draws(plan);
            groups.push(GroupWorkload {
                name: plan.name.clone(),
                kind: plan.kind,
                shader,
                draws_per_scene,
                scenes_per_round: plan.round(),
                draws_once,
                arrays: plan.arrays.clone(),
            });
        }
        for (kind, name) in [
            (GroupKind::Illuminant, "illuminants"),
            (GroupKind::Surface, "surfaces"),
            (GroupKind::Target, "targets"),
        ] {
            if self.plans.iter().all(|plan| plan.kind != kind) {
                left_out
                    .push(format!("{name}: the scene has none, and nothing is compiled or drawn for them"));
            }
        }
        Workload {
            shaders: programs.len(),
            draws: groups.iter().map(|group| group.draws(scenes)).sum(),
            bytes: self.arrays().map(|a| a.bytes() as u64 * if a.per_scene { scenes } else { 1 }).sum(),
            groups,
            left_out,
        }
    }
}

impl GroupWorkload {
    /// Number of spectra drawn for a number of scenes.
    fn draws(&self, scenes: u64) -> u64 {
        self.draws_once + scenes.div_ceil(self.scenes_per_round) * self.draws_per_scene
    }
}

/// Number of spectra drawn for each scene or round, and number drawn once.
fn draws(plan: &GroupPlan) -> (u64, u64) {
    match &plan.shapes {
        Shapes::Engine(drawing) => (drawing.places.into(), 0),
        Shapes::Once(drawing) => (0, drawing.places.into()),
        Shapes::Target(target) => match **target {
            TargetPlan::Once { .. } => (0, plan.count.into()),
            TargetPlan::Flat { .. } => (0, 0),
            _ => (plan.count.into(), 0),
        },
    }
}

/// Describes the work that a group spares.
fn spared(plan: &GroupPlan) -> Option<String> {
    let name = &plan.name;
    Some(match &plan.shapes {
        Shapes::Once(_) if plan.intensity.is_some() => {
            format!(
                "{name}: its spectra are fixed, so they are drawn once, on the CPU, and only scaled for each scene"
            )
        }
        Shapes::Once(_) => {
            format!("{name}: it is fixed, so it is drawn and stored once, on the CPU without a shader")
        }
        Shapes::Engine(drawing) if drawing.places < plan.count => {
            format!("{name}: its lights have the same shape, so one of {} is drawn", plan.count)
        }
        Shapes::Engine(_) => return None,
        Shapes::Target(target) => match **target {
            TargetPlan::Flat { .. } => format!("{name}: flat spectra are not drawn"),
            TargetPlan::Once { .. } => format!("{name}: its copies have the same shape, so it is drawn once"),
            TargetPlan::Rounds { .. } => {
                format!(
                    "{name}: each round through its levels has copies of one draw, made on the CPU without a shader"
                )
            }
            _ => format!("{name}: targets are few, so they are drawn on the CPU without a shader"),
        },
    })
}
