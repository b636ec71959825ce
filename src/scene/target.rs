//! Targets, drawn on the CPU: there is one or a few in a scene, and each may aim at something of its own, for which no
//! shader is worth compiling.

use crate::affine::Affine;
use crate::colorimetry;
use crate::cpu::Kernel;
use crate::dataset::SpectrumKind;
use crate::draw_status::DrawStatus;
use crate::program::condition::Condition;
use crate::program::{Bounds, LrvLaw, LrvTarget, Program};
use crate::random::real::DrawOperations;
use crate::random::stream::{self, Stream};
use crate::recipe::{
    DEFAULT_MAX_ATTEMPTS, PointlessSetting, ProposalKind, Recipe, RecipeBuilder, RecipeError,
};

use super::error::SceneErrorKind;
use super::group::{Copies, Hue, LrvLevels, TargetConstraint, Targets, Viewing};
use super::plan::viewed;

/// Method of drawing targets.
pub(super) enum TargetPlan {
    /// At the luminous reflectance of each level.
    Levels { kernels: Vec<Kernel<f32>>, levels: Vec<f64> },
    /// At the largest level, in one draw a round through the levels, each scaled to its own.
    Rounds { kernel: Kernel<f32>, levels: Vec<f64> },
    /// At the largest level, in one draw for all scenes, each scaled to its own.
    Once { shapes: Vec<DrawnTarget>, levels: LrvLevels },
    /// At luminous reflectances between the two.
    Uniform { program: Box<Program>, target: LrvTarget, low: f64, high: f64 },
    /// At tristimulus values.
    Xyz { kernel: Kernel<f32>, y: f64 },
    /// At the tristimulus values of a hue.
    Hue { program: Box<Program>, condition: Condition, spectrum: Affine, hue: Hue },
    /// Nothing is drawn.
    Flat { levels: LrvLevels, bands: usize },
}

/// A target.
#[derive(Clone)]
pub(super) struct DrawnTarget {
    pub(super) spectrum: Vec<f32>,
    pub(super) lrv: f32,
    /// The tristimulus values that were given.
    pub(super) xyz: Option<[f32; 3]>,
    /// Status of the draw; `None` where nothing was drawn.
    pub(super) status: Option<DrawStatus>,
}

impl TargetPlan {
    /// Plans the drawing of targets on a grid of `bands` bands, from a stream in rows; an error has the key that is
    /// wrong.
    pub(super) fn new(
        targets: &Targets,
        bands: usize,
        stream: Stream,
    ) -> Result<TargetPlan, (&'static str, SceneErrorKind)> {
        check(targets)?;
        let model = match (&targets.aim, &targets.base.model) {
            (TargetConstraint::Flat(levels), _) => {
                return Ok(TargetPlan::Flat { levels: levels.clone(), bands });
            }
            (_, model) => model.as_ref().expect("only flat targets have none"),
        };
        let builder = Recipe::builder(model)
            .covariance_scale(targets.base.covariance_scale)
            .max_attempts(targets.base.max_attempts);
        // What is seen of a target is no matter of its recipe, but what it is aimed at.
        let aimed = Viewing { sensors: None, response_scale: None, ..targets.base.viewing.clone() };
        let builder = viewed(builder, &aimed);
        let built = |recipe: Result<Recipe, RecipeError>| recipe.map_err(|e| because_of(&targets.aim, e));
        match &targets.aim {
            TargetConstraint::Lrv(levels) => {
                let builder = builder.bounds(targets.bounds);
                // The lightest is the hardest to accept, for what is within bounds there is within them at all levels.
                // What proposes for one level need not do for another, unless it is the model's own Gaussian.
                let largest = match levels {
                    LrvLevels::Each(_) => builder.clone(),
                    LrvLevels::Uniform(..) => builder.clone().proposal(ProposalKind::Plain),
                };
                let recipe = built(largest.lrv(levels.largest()).build())?;
                let is_own = matches!(levels, LrvLevels::Uniform(..)) && recipe.program().tests_scaled();
                if is_own && let Some(error) = recipe.centres_at_own_targets() {
                    return Err(because_of(&targets.aim, error));
                }
                let kernel = Kernel::new(recipe.program());
                let at = |lrv: f64| {
                    if recipe.program().proposal.is_some() {
                        return built(builder.clone().lrv(lrv).build()).map(|r| Kernel::new(r.program()));
                    }
                    let target = recipe.program().target.clone();
                    let target = target.map(|target| LrvTarget { lrv: LrvLaw::Fixed(lrv), ..target });
                    Ok(Kernel::new(&Program { target, ..recipe.program().clone() }))
                };
                Ok(match (levels, targets.copies) {
                    (levels, Copies::SameShape) => {
                        let shapes = 0..u64::from(stream.row());
                        let shapes = shapes.map(|place| drawn(&kernel, stream, place, levels.largest()));
                        TargetPlan::Once { shapes: shapes.collect(), levels: levels.clone() }
                    }
                    (LrvLevels::Each(levels), Copies::Scaled) => {
                        TargetPlan::Rounds { kernel, levels: levels.clone() }
                    }
                    (LrvLevels::Each(levels), Copies::Independent) => TargetPlan::Levels {
                        kernels: levels.iter().map(|&lrv| at(lrv)).collect::<Result<_, _>>()?,
                        levels: levels.clone(),
                    },
                    (&LrvLevels::Uniform(low, high), _) => TargetPlan::Uniform {
                        target: recipe.program().target.clone().expect("the recipe has one"),
                        program: Box::new(recipe.program().clone()),
                        low,
                        high,
                    },
                })
            }
            TargetConstraint::Xyz(xyz) => {
                let recipe = built(builder.xyz(*xyz).build())?;
                Ok(TargetPlan::Xyz { kernel: Kernel::new(recipe.program()), y: xyz[1] })
            }
            TargetConstraint::Hue(hue) => {
                // The colours of a hue are a quadrilateral, and the logarithm of the acceptance is concave over it
                // (Prékopa 1973), so what can be drawn at its corners can be drawn everywhere in it.
                let builder = builder.proposal(ProposalKind::Plain);
                for level in 0..hue.levels {
                    for (saturation, lightness) in corners(hue) {
                        let xyz = hue.xyz(level, saturation, lightness);
                        if let Err(source) = builder.clone().xyz(xyz).build() {
                            let hue = f64::from(level) / f64::from(hue.levels);
                            return Err(("hue", SceneErrorKind::Hue { hue, saturation, lightness, source }));
                        }
                    }
                }
                let recipe =
                    built(builder.clone().xyz(hue.xyz(0, hue.saturation.0, hue.lightness.1)).build())?;
                let weights = model.weight_map(targets.base.covariance_scale);
                let condition = built_condition(&builder, &weights)?;
                let spectrum = Program::new(model, &weights).spectrum;
                let program = Box::new(recipe.program().clone());
                Ok(TargetPlan::Hue { program, condition, spectrum, hue: *hue })
            }
            TargetConstraint::Flat(_) => unreachable!("it was returned"),
        }
    }

    /// Statuses of the draws that serve all scenes.
    pub(super) fn statuses_once(&self) -> Vec<DrawStatus> {
        match self {
            TargetPlan::Once { shapes, .. } => shapes.iter().filter_map(|shape| shape.status).collect(),
            _ => Vec::new(),
        }
    }

    /// Number of scenes in a row whose targets are copies of one draw; `None` where all scenes' are.
    pub(super) fn round(&self) -> Option<u64> {
        match self {
            TargetPlan::Once { .. } => None,
            TargetPlan::Rounds { levels, .. } => Some(levels.len() as u64),
            _ => Some(1),
        }
    }

    /// Whether the targets of `scene` are those that are drawn, rather than copies of another scene's, in a run whose
    /// first scene is `first`.
    pub(super) fn is_drawn_for(&self, scene: u64, first: u64) -> bool {
        self.round().is_some_and(|round| scene == first || scene.is_multiple_of(round))
    }

    /// Target `element` of `scene`. The stream is in rows of as many as a scene has.
    pub(super) fn draw(&self, stream: Stream, scene: u64, element: u32) -> DrawnTarget {
        let row = u64::from(stream.row());
        let at = |scene: u64| scene * row + u64::from(element);
        let uniform = |word: usize| f64::uniform(stream.block(at(scene), 0, stream::DRAW_BLOCK)[word]);
        let number = |count: usize| (scene % count as u64) as usize;
        match self {
            TargetPlan::Levels { kernels, levels } => {
                let level = number(levels.len());
                drawn(&kernels[level], stream, at(scene), levels[level])
            }
            TargetPlan::Rounds { kernel, levels } => {
                let largest = levels.iter().fold(0.0, |a: f64, &b| a.max(b));
                let drawn = drawn(kernel, stream, at(scene / levels.len() as u64), largest);
                drawn.scaled(largest, levels[number(levels.len())])
            }
            TargetPlan::Once { shapes, levels } => {
                let lrv = levels.at(scene, || uniform(0));
                shapes[element as usize].clone().scaled(levels.largest(), lrv)
            }
            TargetPlan::Uniform { program, target, low, high } => {
                let lrv = low + (high - low) * uniform(0);
                let target = Some(LrvTarget { lrv: LrvLaw::Fixed(lrv), ..target.clone() });
                drawn(&Kernel::new(&Program { target, ..(**program).clone() }), stream, at(scene), lrv)
            }
            TargetPlan::Xyz { kernel, y } => drawn(kernel, stream, at(scene), *y),
            TargetPlan::Hue { program, condition, spectrum, hue } => {
                let between = |(from, to): (f64, f64), u: f64| from + (to - from) * u;
                let level = number(hue.levels as usize) as u32;
                let xyz =
                    hue.xyz(level, between(hue.saturation, uniform(0)), between(hue.lightness, uniform(1)));
                let spectrum = condition.given(&xyz, spectrum);
                let kernel = Kernel::new(&Program { spectrum, ..(**program).clone() });
                DrawnTarget { xyz: Some(xyz.map(|v| v as f32)), ..drawn(&kernel, stream, at(scene), xyz[1]) }
            }
            TargetPlan::Flat { levels, bands } => {
                let lrv = levels.at(scene, || uniform(0)) as f32;
                DrawnTarget { spectrum: vec![lrv; *bands], lrv, xyz: None, status: None }
            }
        }
    }
}

impl DrawnTarget {
    /// Rescales the target to another luminous reflectance. Its status stays that of the draw.
    fn scaled(mut self, from: f64, to: f64) -> DrawnTarget {
        let by = (to / from) as f32;
        self.spectrum.iter_mut().for_each(|value| *value *= by);
        self.lrv = to as f32;
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

/// The key of a target that an error of its recipe is about, and the error.
fn because_of(aim: &TargetConstraint, error: RecipeError) -> (&'static str, SceneErrorKind) {
    let is_hopeless = matches!(error, RecipeError::Hopeless { .. } | RecipeError::Empty { .. });
    match aim {
        TargetConstraint::Lrv(LrvLevels::Uniform(from, to)) if is_hopeless => {
            ("lrv", SceneErrorKind::HopelessRange { from: *from, to: *to, source: error })
        }
        TargetConstraint::Lrv(_) if is_hopeless => ("lrv", SceneErrorKind::Recipe(error)),
        TargetConstraint::Xyz(_) if is_hopeless => ("xyz", SceneErrorKind::Recipe(error)),
        TargetConstraint::Hue(_) if is_hopeless => ("hue", SceneErrorKind::Recipe(error)),
        _ => (key(&error), SceneErrorKind::Recipe(error)),
    }
}

fn drawn(kernel: &Kernel<f32>, stream: Stream, index: u64, lrv: f64) -> DrawnTarget {
    let (mut values, status) = kernel.draw(stream, index);
    DrawnTarget { spectrum: values.swap_remove(0), lrv: lrv as f32, xyz: None, status: Some(status) }
}

fn built_condition(
    builder: &RecipeBuilder,
    weights: &Affine,
) -> Result<Condition, (&'static str, SceneErrorKind)> {
    builder.condition(weights).map_err(|e| ("hue", SceneErrorKind::Recipe(e)))
}

fn corners(hue: &Hue) -> [(f64, f64); 4] {
    let ((a, b), (c, d)) = (hue.saturation, hue.lightness);
    [(a, c), (a, d), (b, c), (b, d)]
}

/// Reason for which settings of draws mean nothing for flat targets.
pub(super) const FLAT_IS_NOT_DRAWN: &str = "for a flat target, which is drawn from no model";

/// Reason for which bounds mean nothing for targets without a luminous reflectance to scale to.
pub(super) fn bounds_without_lrv(aim: &TargetConstraint) -> &'static str {
    match aim {
        TargetConstraint::Flat(_) => {
            "for a flat target, which is the same in every band and never out of bounds"
        }
        _ => "without an lrv: a spectrum of given tristimulus values is not scaled",
    }
}

/// Checks the targets for errors that their recipe cannot find.
fn check(targets: &Targets) -> Result<(), (&'static str, SceneErrorKind)> {
    let level = |value: f64| match value > 0.0 && value < 1.0 {
        true => Ok(()),
        false => Err(("lrv", SceneErrorKind::Level(value))),
    };
    if let Some(model) = targets.base.model.as_ref().filter(|model| model.kind() == SpectrumKind::Illuminant)
    {
        let (found, wanted) = (model.kind(), SpectrumKind::Reflectance);
        return Err(("model", SceneErrorKind::Kind { found, wanted }));
    }
    let pointless = |key, with| Err((key, SceneErrorKind::Pointless { with }));
    if let TargetConstraint::Flat(_) = targets.aim {
        let base = &targets.base;
        let settings = [
            ("model", base.model.is_some()),
            ("cov_scale", base.covariance_scale != 1.0),
            ("max_attempts", base.max_attempts != DEFAULT_MAX_ATTEMPTS),
        ];
        if let Some((key, _)) = settings.into_iter().find(|(_, is_set)| *is_set) {
            return pointless(key, FLAT_IS_NOT_DRAWN);
        }
    }
    match &targets.aim {
        TargetConstraint::Lrv(levels) | TargetConstraint::Flat(levels) => match levels {
            LrvLevels::Each(levels) => {
                if !(1..=10_000).contains(&levels.len()) {
                    return Err(("lrv", SceneErrorKind::Levels(levels.len() as u64)));
                }
                levels.iter().try_for_each(|&value| level(value))?;
            }
            LrvLevels::Uniform(from, to) => {
                if !matches!(targets.aim, TargetConstraint::Flat(_)) || (*from, *to) != (0.0, 1.0) {
                    level(*from)?;
                    level(*to)?;
                }
                if from >= to {
                    return Err(("lrv", SceneErrorKind::Order { from: *from, to: *to }));
                }
                if targets.copies == Copies::Scaled {
                    return Err(("copies", SceneErrorKind::NoLevels));
                }
            }
        },
        TargetConstraint::Hue(hue) => {
            if !(1..=10_000).contains(&hue.levels) {
                return Err(("hue", SceneErrorKind::Levels(hue.levels.into())));
            }
            for (what, (from, to)) in [("saturation", hue.saturation), ("lightness", hue.lightness)] {
                if !(from >= 0.0 && from <= to && to <= 1.0) {
                    return Err(("hue", SceneErrorKind::Share { what, from, to }));
                }
            }
        }
        TargetConstraint::Xyz(_) => {}
    }
    let has_lrv = matches!(targets.aim, TargetConstraint::Lrv(_));
    if !has_lrv && targets.copies != Copies::Independent {
        return pointless("copies", "without an lrv to scale to");
    }
    if !has_lrv && targets.bounds != Bounds::default() {
        return pointless("bounds", bounds_without_lrv(&targets.aim));
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
        RecipeError::Sensors(_) => "sensors",
        RecipeError::Illuminant(_) | RecipeError::DarkLight | RecipeError::Light { .. } => "illuminant",
        RecipeError::Pointless(setting) => match setting {
            PointlessSetting::Illuminant => "illuminant",
            PointlessSetting::Observer => "observer",
            PointlessSetting::ResponseScale | PointlessSetting::WhiteResponseScale => "response_scale",
            _ => "",
        },
        _ => "",
    }
}
