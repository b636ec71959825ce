//! Targets, drawn on the CPU: there is one or a few in a scene, and each may aim at something of its own, for which no
//! shader is worth compiling.

use crate::colorimetry;
use crate::condition::Condition;
use crate::cpu::Kernel;
use crate::dataset::Kind;
use crate::level;
use crate::normal::Real;
use crate::program::{self, Affine, Program, Tally, Target};
use crate::recipe::{Proposal, Recipe, RecipeBuilder, RecipeError};
use crate::stream::Stream;

use super::error::Problem;
use super::group::{Aim, Copies, Hue, Levels, Targets};

/// How targets are drawn.
pub(super) enum Aimed {
    /// At the luminous reflectance of each level.
    Levels { kernels: Vec<Kernel<f32>>, levels: Vec<f64> },
    /// At the largest level, in one draw a round through the levels, each scaled to its own.
    Rounds { kernel: Kernel<f32>, levels: Vec<f64> },
    /// At the largest level, in one draw for all scenes, each scaled to its own.
    Once { shapes: Vec<Drawn>, levels: Levels },
    /// At luminous reflectances between the two.
    Uniform { program: Box<Program>, target: Target, low: f64, high: f64 },
    /// At tristimulus values.
    Xyz { kernel: Kernel<f32>, y: f64 },
    /// At those of a hue.
    Hue { program: Box<Program>, condition: Condition, spectrum: Affine, hue: Hue },
    /// Nothing is drawn.
    Flat { levels: Levels, bands: usize },
}

/// A target.
#[derive(Clone)]
pub(super) struct Drawn {
    pub(super) spectrum: Vec<f32>,
    pub(super) lrv: f32,
    /// The tristimulus values that were given.
    pub(super) xyz: Option<[f32; 3]>,
    /// What it took; none where nothing was drawn.
    pub(super) tally: Option<Tally>,
}

impl Aimed {
    /// How to draw these targets on a grid of so many bands, of a stream in rows; or the key that is wrong, and why.
    pub(super) fn new(
        targets: &Targets,
        bands: usize,
        stream: Stream,
    ) -> Result<Aimed, (&'static str, Problem)> {
        check(targets)?;
        let model = match (&targets.aim, &targets.base.model) {
            (Aim::Flat(levels), _) => return Ok(Aimed::Flat { levels: levels.clone(), bands }),
            (_, model) => model.as_ref().expect("only flat targets have none"),
        };
        let builder = Recipe::new(model)
            .covariance_scale(targets.base.covariance_scale)
            .max_attempts(targets.base.max_attempts);
        let built = |recipe: Result<Recipe, RecipeError>| recipe.map_err(|e| (key(&e), Problem::Recipe(e)));
        match &targets.aim {
            Aim::Lrv(levels) => {
                let builder = builder.bounds(targets.bounds);
                // The lightest is the hardest to accept, for what is within bounds there is within them at all levels.
                // What proposes for one level need not do for another, unless it is the model's own Gaussian.
                let largest = match levels {
                    Levels::Each(_) => builder.clone(),
                    Levels::Uniform(..) => builder.clone().proposal(Proposal::Plain),
                };
                let recipe = built(largest.lrv(levels.largest()).build())?;
                let kernel = Kernel::new(recipe.program());
                let at = |lrv: f64| {
                    if recipe.program().proposal.is_some() {
                        return built(builder.clone().lrv(lrv).build()).map(|r| Kernel::new(r.program()));
                    }
                    let target = recipe.program().target.clone().map(|target| Target { lrv, ..target });
                    Ok(Kernel::new(&Program { target, ..recipe.program().clone() }))
                };
                Ok(match (levels, targets.copies) {
                    (levels, Copies::SameShape) => {
                        let shapes = 0..u64::from(stream.row());
                        let shapes = shapes.map(|place| drawn(&kernel, stream, place, levels.largest()));
                        Aimed::Once { shapes: shapes.collect(), levels: levels.clone() }
                    }
                    (Levels::Each(levels), Copies::Scaled) => {
                        Aimed::Rounds { kernel, levels: levels.clone() }
                    }
                    (Levels::Each(levels), Copies::Independent) => Aimed::Levels {
                        kernels: levels.iter().map(|&lrv| at(lrv)).collect::<Result<_, _>>()?,
                        levels: levels.clone(),
                    },
                    (&Levels::Uniform(low, high), _) => Aimed::Uniform {
                        target: recipe.program().target.clone().expect("the recipe has one"),
                        program: Box::new(recipe.program().clone()),
                        low,
                        high,
                    },
                })
            }
            Aim::Xyz(xyz) => {
                let recipe = built(builder.xyz(*xyz).build())?;
                Ok(Aimed::Xyz { kernel: Kernel::new(recipe.program()), y: xyz[1] })
            }
            Aim::Hue(hue) => {
                // The colours of a hue are a quadrilateral, and the logarithm of the acceptance is concave over it
                // (Prékopa 1973), so what can be drawn at its corners can be drawn everywhere in it.
                let builder = builder.proposal(Proposal::Plain);
                for level in 0..hue.levels {
                    for (saturation, lightness) in corners(hue) {
                        let xyz = hue.xyz(level, saturation, lightness);
                        if let Err(source) = builder.clone().xyz(xyz).build() {
                            let hue = f64::from(level) / f64::from(hue.levels);
                            return Err(("hue", Problem::Hue { hue, saturation, lightness, source }));
                        }
                    }
                }
                let recipe =
                    built(builder.clone().xyz(hue.xyz(0, hue.saturation.0, hue.lightness.1)).build())?;
                let weights = program::weights(model, targets.base.covariance_scale);
                let condition = built_condition(&builder, &weights)?;
                let spectrum = Program::new(model, &weights).spectrum;
                let program = Box::new(recipe.program().clone());
                Ok(Aimed::Hue { program, condition, spectrum, hue: *hue })
            }
            Aim::Flat(_) => unreachable!("it was returned"),
        }
    }

    /// Target `element` of `scene`. The stream is in rows of so many as a scene has.
    pub(super) fn draw(&self, stream: Stream, scene: u64, element: u32) -> Drawn {
        let row = u64::from(stream.row());
        let at = |scene: u64| scene * row + u64::from(element);
        let uniform = |word: usize| f64::uniform(stream.block(at(scene), 0, level::BLOCK)[word]);
        let number = |count: usize| (scene % count as u64) as usize;
        match self {
            Aimed::Levels { kernels, levels } => {
                let level = number(levels.len());
                drawn(&kernels[level], stream, at(scene), levels[level])
            }
            Aimed::Rounds { kernel, levels } => {
                let largest = levels.iter().fold(0.0, |a: f64, &b| a.max(b));
                let drawn = drawn(kernel, stream, at(scene / levels.len() as u64), largest);
                drawn.scaled(largest, levels[number(levels.len())])
            }
            Aimed::Once { shapes, levels } => {
                let lrv = levels.at(scene, || uniform(0));
                shapes[element as usize].clone().scaled(levels.largest(), lrv)
            }
            Aimed::Uniform { program, target, low, high } => {
                let lrv = low + (high - low) * uniform(0);
                let target = Some(Target { lrv, ..target.clone() });
                drawn(&Kernel::new(&Program { target, ..(**program).clone() }), stream, at(scene), lrv)
            }
            Aimed::Xyz { kernel, y } => drawn(kernel, stream, at(scene), *y),
            Aimed::Hue { program, condition, spectrum, hue } => {
                let between = |(from, to): (f64, f64), u: f64| from + (to - from) * u;
                let level = number(hue.levels as usize) as u32;
                let xyz =
                    hue.xyz(level, between(hue.saturation, uniform(0)), between(hue.lightness, uniform(1)));
                let spectrum = condition.given(xyz, spectrum);
                let kernel = Kernel::new(&Program { spectrum, ..(**program).clone() });
                Drawn { xyz: Some(xyz.map(|v| v as f32)), ..drawn(&kernel, stream, at(scene), xyz[1]) }
            }
            Aimed::Flat { levels, bands } => {
                let lrv = levels.at(scene, || uniform(0)) as f32;
                Drawn { spectrum: vec![lrv; *bands], lrv, xyz: None, tally: None }
            }
        }
    }
}

impl Drawn {
    /// The same at another luminous reflectance.
    fn scaled(mut self, from: f64, to: f64) -> Drawn {
        let by = (to / from) as f32;
        self.spectrum.iter_mut().for_each(|value| *value *= by);
        self.lrv = to as f32;
        let (accepted, above_one) =
            (self.tally.map_or(0, Tally::attempts), self.spectrum.iter().any(|&value| value >= 1.0));
        self.tally = Some(if accepted == 0 { Tally::FAILED } else { Tally::accepted(accepted, above_one) });
        self
    }
}

impl Hue {
    /// The tristimulus values of a hue, by number, at a saturation and a lightness.
    pub(super) fn xyz(&self, level: u32, saturation: f64, lightness: f64) -> [f64; 3] {
        let sixths = 6.0 * f64::from(level) / f64::from(self.levels);
        let component = |shift: f64| {
            let k = (shift + sixths) % 6.0;
            lightness * (1.0 - saturation * k.min(4.0 - k).clamp(0.0, 1.0))
        };
        colorimetry::linear_srgb_to_xyz([5.0, 3.0, 1.0].map(component))
    }
}

fn drawn(kernel: &Kernel<f32>, stream: Stream, index: u64, lrv: f64) -> Drawn {
    let (mut values, tally) = kernel.draw(stream, index);
    Drawn { spectrum: values.swap_remove(0), lrv: lrv as f32, xyz: None, tally: Some(tally) }
}

fn built_condition(builder: &RecipeBuilder, weights: &Affine) -> Result<Condition, (&'static str, Problem)> {
    builder.condition(weights).map_err(|e| ("hue", Problem::Recipe(e)))
}

fn corners(hue: &Hue) -> [(f64, f64); 4] {
    let ((a, b), (c, d)) = (hue.saturation, hue.lightness);
    [(a, c), (a, d), (b, c), (b, d)]
}

/// What a recipe of targets cannot know.
fn check(targets: &Targets) -> Result<(), (&'static str, Problem)> {
    let level = |value: f64| match value > 0.0 && value < 1.0 {
        true => Ok(()),
        false => Err(("lrv", Problem::Level(value))),
    };
    if let Some(model) = targets.base.model.as_ref().filter(|model| model.kind() == Kind::Illuminant) {
        let (found, wanted) = (model.kind(), Kind::Reflectance);
        return Err(("model", Problem::Kind { found, wanted }));
    }
    match &targets.aim {
        Aim::Lrv(levels) | Aim::Flat(levels) => match levels {
            Levels::Each(levels) => {
                if !(1..=10_000).contains(&levels.len()) {
                    return Err(("lrv", Problem::Levels(levels.len() as u64)));
                }
                levels.iter().try_for_each(|&value| level(value))?;
            }
            Levels::Uniform(from, to) => {
                if !matches!(targets.aim, Aim::Flat(_)) || (*from, *to) != (0.0, 1.0) {
                    level(*from)?;
                    level(*to)?;
                }
                if from >= to {
                    return Err(("lrv", Problem::Order { from: *from, to: *to }));
                }
                if targets.copies == Copies::Scaled {
                    return Err(("copies", Problem::NoLevels));
                }
            }
        },
        Aim::Hue(hue) => {
            if !(1..=10_000).contains(&hue.levels) {
                return Err(("hue", Problem::Levels(hue.levels.into())));
            }
            for (what, (from, to)) in [("saturation", hue.saturation), ("lightness", hue.lightness)] {
                if !(from >= 0.0 && from <= to && to <= 1.0) {
                    return Err(("hue", Problem::Share { what, from, to }));
                }
            }
        }
        Aim::Xyz(_) => {}
    }
    let has_lrv = matches!(targets.aim, Aim::Lrv(_));
    if !has_lrv && targets.copies != Copies::Independent {
        return Err(("copies", Problem::Pointless { with: "without an lrv to scale to" }));
    }
    Ok(())
}

/// The key that an error of a recipe is about.
pub(super) fn key(error: &RecipeError) -> &'static str {
    match error {
        RecipeError::Lrv(_) | RecipeError::LrvOfIlluminant | RecipeError::UnreachableLrv { .. } => "lrv",
        RecipeError::Xyz(_)
        | RecipeError::XyzOfIlluminant
        | RecipeError::XyzAndLrv
        | RecipeError::TooFewDirections
        | RecipeError::UnreachableXyz { .. } => "xyz",
        RecipeError::Intensity(_)
        | RecipeError::IntensityRange { .. }
        | RecipeError::IntensityOfReflectance
        | RecipeError::NoPowers => "intensity",
        RecipeError::CovarianceScale(_) => "cov_scale",
        RecipeError::MaxAttempts(_) => "max_attempts",
        RecipeError::Invisible(_) => "wavelengths",
        _ => "",
    }
}
