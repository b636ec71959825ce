//! What drawing a scene takes, and what it is spared.

use serde::Serialize;

use super::Scene;
use super::aim::Aimed;
use super::cast::{Array, Cast, Role, Shapes};

/// What drawing a scene takes.
#[derive(Clone, Debug, Serialize)]
pub struct Outline {
    /// The groups, in order.
    pub groups: Vec<GroupOutline>,
    /// How many shaders are compiled, where a graphics adapter draws.
    pub shaders: usize,
    /// How many spectra are drawn for so many scenes, those of all scenes included.
    pub draws: u64,
    /// What is not done, and why.
    pub left_out: Vec<String>,
    /// How many bytes all arrays have.
    pub bytes: u64,
}

/// What drawing a group takes.
#[derive(Clone, Debug, Serialize)]
pub struct GroupOutline {
    /// Its name.
    pub name: String,
    /// What its spectra are.
    pub role: Role,
    /// The number of the shader that draws it, from 1; none where the CPU does.
    pub shader: Option<usize>,
    /// How many spectra are drawn for each scene.
    pub draws_per_scene: u64,
    /// How many are drawn once for all.
    pub draws_once: u64,
    /// Its arrays.
    pub arrays: Vec<Array>,
}

impl Scene {
    /// What drawing so many scenes takes.
    pub fn outline(&self, scenes: u64) -> Outline {
        let mut programs: Vec<&crate::program::Program> = Vec::new();
        let mut left_out = Vec::new();
        let mut groups = Vec::new();
        for cast in &self.casts {
            let mut shader = None;
            if let Some(drawing) = cast.drawn_by_engine() {
                let program = drawing.recipe.program();
                let known = programs.iter().position(|known| *known == program);
                if let Some(known) = known {
                    left_out.push(format!(
                        "{}: no shader of its own, for its model and recipe are those of shader {}",
                        cast.name,
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
            left_out.extend(spared(cast));
            let (draws_per_scene, draws_once) = draws(cast);
            groups.push(GroupOutline {
                name: cast.name.clone(),
                role: cast.role,
                shader,
                draws_per_scene,
                draws_once,
                arrays: cast.arrays.clone(),
            });
        }
        for (role, kind) in
            [(Role::Illuminant, "illuminants"), (Role::Surface, "surfaces"), (Role::Target, "targets")]
        {
            if self.casts.iter().all(|cast| cast.role != role) {
                left_out
                    .push(format!("{kind}: the scene has none, and nothing is compiled or drawn for them"));
            }
        }
        Outline {
            shaders: programs.len(),
            draws: groups.iter().map(|group| group.draws_once + scenes * group.draws_per_scene).sum(),
            bytes: self.arrays().map(|a| a.bytes() as u64 * if a.per_scene { scenes } else { 1 }).sum(),
            groups,
            left_out,
        }
    }
}

/// How many spectra are drawn for each scene, and how many once.
fn draws(cast: &Cast) -> (u64, u64) {
    match &cast.shapes {
        Shapes::Engine(drawing) => (drawing.places.into(), 0),
        Shapes::Once(drawing) => (0, drawing.places.into()),
        Shapes::Aimed(aimed) => match **aimed {
            Aimed::Once { .. } => (0, cast.count.into()),
            Aimed::Flat { .. } => (0, 0),
            _ => (cast.count.into(), 0),
        },
    }
}

/// What a group spares.
fn spared(cast: &Cast) -> Option<String> {
    let name = &cast.name;
    Some(match &cast.shapes {
        Shapes::Once(_) if cast.intensity.is_some() => {
            format!(
                "{name}: its spectra are fixed, so they are drawn once, on the CPU, and only scaled for each scene"
            )
        }
        Shapes::Once(_) => {
            format!("{name}: it is fixed, so it is drawn and stored once, on the CPU without a shader")
        }
        Shapes::Engine(drawing) if drawing.places < cast.count => {
            format!("{name}: its lights have the same shape, so one of {} is drawn", cast.count)
        }
        Shapes::Engine(_) => return None,
        Shapes::Aimed(aimed) => match **aimed {
            Aimed::Flat { .. } => format!("{name}: flat spectra are not drawn"),
            Aimed::Once { .. } => format!("{name}: its copies have the same shape, so it is drawn once"),
            _ => format!("{name}: targets are few, so they are drawn on the CPU without a shader"),
        },
    })
}
