//! The choice of a proposal for a program, and the share of candidates that it accepts.

use super::RecipeBuilder;
use crate::cover::{Cover, HalfSpace};
use crate::mixture::Centres;
use crate::program::feasibility::{self, Room};
use crate::program::{Program, Proposal};
use crate::recipe::pilot::{TOLERABLE_FAILURE, failure, pilot, pilot_of_draws};
use crate::recipe::{CoverSize, Lrv, ProposalKind, Recipe, RecipeError, ResponseTarget};

/// Setting under which the acceptance about a centre differs from draw to draw.
pub(in crate::recipe) const OWN_TARGETS: &str = "bounds on what is scaled to a target of each draw's own";

impl RecipeBuilder {
    /// The recipe of a program, with the proposal that suits it.
    pub(super) fn with_proposal(self, program: Program) -> Result<Recipe, RecipeError> {
        if program.given > 0 {
            return self.given_its_own(program);
        }
        let half_spaces = feasibility::half_spaces(&program);
        let centre = self.centre(&program, &half_spaces)?;
        if let Some(centres) = self.model.centres() {
            return self.about_centres(program, centres, &half_spaces);
        }
        if program.tests_own_targets() {
            return self.reject_by_own_targets(program);
        }
        let recipe = self.propose(program, &half_spaces, centre)?;
        check_hope(recipe.acceptance, recipe.program.max_attempts)?;
        Ok(recipe)
    }

    /// A point in the middle of the accepted region; `None` where that is for the pilot run to find out.
    fn centre(&self, program: &Program, half_spaces: &[HalfSpace]) -> Result<Option<Vec<f64>>, RecipeError> {
        if let Some(target) = &program.target {
            let lrv = target.lrv.largest();
            let largest = feasibility::largest_lrv(program, &target.weights);
            if let Some(largest) = largest.filter(|&largest| lrv >= largest) {
                return Err(match &self.target {
                    None => RecipeError::UnreachableLrv { lrv, largest },
                    Some(target) => {
                        RecipeError::UnreachableResponse { sensor: target.sensor(), response: lrv, largest }
                    }
                });
            }
        }
        match (feasibility::room(half_spaces), self.xyz) {
            (Room::Ball { centre, .. }, _) => Ok(Some(centre)),
            (Room::Unknown, _) => Ok(None),
            (Room::None { .. }, Some(xyz)) => {
                Err(RecipeError::UnreachableXyz { xyz, nearest: self.nearest(xyz) })
            }
            (Room::None { bands }, None) => {
                let wavelengths = bands.into_iter().map(|band| self.model.grid().wavelength(band)).collect();
                Err(RecipeError::Empty { wavelengths })
            }
        }
    }

    /// The recipe with the proposal that was asked for, or is expected to cost less.
    fn propose(
        self,
        program: Program,
        half_spaces: &[HalfSpace],
        centre: Option<Vec<f64>>,
    ) -> Result<Recipe, RecipeError> {
        let (may_be_plain, may_be_covered) = match self.proposal {
            ProposalKind::Auto => (true, true),
            ProposalKind::Plain => (true, false),
            ProposalKind::Cover => (false, true),
        };
        let plain = if may_be_plain { pilot(&program) } else { 0.0 };
        if may_be_covered
            && (!may_be_plain || Cover::could_pay(plain))
            && let Some(cover) = centre.and_then(|centre| Cover::new(half_spaces, &centre))
        {
            let covered = program.clone().covered(&cover);
            let acceptance = pilot(&covered);
            if Cover::pays(acceptance, plain) {
                let probability = acceptance * cover.mass();
                let cover = Some(CoverSize { boxes: cover.len(), bytes: cover.proposal().bytes() });
                return Ok(Recipe { cover, probability, ..self.recipe(covered, acceptance) });
            }
        } else if !may_be_plain {
            return Err(RecipeError::NoCover { components: program.components() });
        }
        Ok(self.recipe(program, plain))
    }

    /// The recipe of a model whose weights are distributed about centres. What accepts or changes a part of them alone
    /// would change their shares, and is refused.
    fn about_centres(
        self,
        program: Program,
        centres: Centres,
        half_spaces: &[HalfSpace],
    ) -> Result<Recipe, RecipeError> {
        let name = self.model.distribution().name();
        let others = [
            ("target tristimulus values", self.xyz.is_some()),
            ("a cover", self.proposal == ProposalKind::Cover),
            (OWN_TARGETS, program.tests_own_targets()),
        ];
        if let Some((other, _)) = others.into_iter().find(|(_, is_set)| *is_set) {
            return Err(RecipeError::CentresAnd { name, other });
        }
        let (count, unit) = (centres.shares.len(), centres.unit());
        let (mixture, left_out) =
            centres.within(half_spaces).ok_or(RecipeError::NoCentres { name, count })?;
        let program = Program { proposal: Some(Proposal::Centres(mixture)), ..program.in_units(unit) };
        let acceptance = pilot(&program);
        check_hope(acceptance, program.max_attempts)?;
        Ok(Recipe { left_out, ..self.recipe(program, acceptance) })
    }

    /// The recipe of plain rejection where the target of each draw bounds its spectrum. A cover is of one region, and
    /// each target has its own, so what plain rejection cannot draw at the hardest target is refused.
    fn reject_by_own_targets(self, program: Program) -> Result<Recipe, RecipeError> {
        let own = self.lrv.or(self.target.as_ref().map(|target| target.response));
        let Some(Lrv::Uniform(low, high)) = own else { unreachable!("the program has targets of draws") };
        let sensor = self.target.as_ref().map(ResponseTarget::sensor);
        if self.proposal == ProposalKind::Cover {
            let what = sensor.map_or("luminous reflectance".to_owned(), |of| format!("response of {of}"));
            return Err(RecipeError::CoverOfLrvRange { what: what.into(), low, high });
        }
        let (hardest, max_attempts) = (pilot(&program.at_largest_target()), program.max_attempts);
        if failure(hardest, max_attempts) > TOLERABLE_FAILURE {
            let what = sensor.map_or("luminous reflectances".to_owned(), |of| format!("responses of {of}"));
            let what = what.into();
            return Err(RecipeError::HopelessLrvRange { what, low, high, acceptance: hardest, max_attempts });
        }
        let (probability, acceptance) = (pilot(&program), pilot_of_draws(&program, hardest));
        Ok(Recipe { probability, ..self.recipe(program, acceptance) })
    }

    /// The recipe of draws that are given responses, tried at those of the model's mean.
    fn given_its_own(self, program: Program) -> Result<Recipe, RecipeError> {
        let sensors = self.given.as_ref().expect("the program is given responses");
        let weights = self.model.weight_map(self.covariance_scale);
        let mean = self.responses(sensors, &weights)?.offset;
        let program_of_mean = program.at(&mean);
        self.centre(&program_of_mean, &feasibility::half_spaces(&program_of_mean))?;
        let probability = pilot(&program_of_mean);
        let acceptance = probability.max(1.0 / f64::from(self.max_attempts));
        Ok(Recipe { probability, ..self.recipe(program, acceptance) })
    }

    /// The recipe of a program without a cover.
    fn recipe(self, program: Program, acceptance: f64) -> Recipe {
        Recipe {
            settings: self.settings(),
            model: self.model,
            program,
            probability: acceptance,
            acceptance,
            cover: None,
            left_out: 0,
        }
    }
}

fn check_hope(acceptance: f64, max_attempts: u32) -> Result<(), RecipeError> {
    let is_hopeless = failure(acceptance, max_attempts) > TOLERABLE_FAILURE;
    if is_hopeless { Err(RecipeError::Hopeless { acceptance, max_attempts }) } else { Ok(()) }
}
