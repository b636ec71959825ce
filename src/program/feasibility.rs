//! Feasibility of draws before any is made: whether any is acceptable, and how light a reflectance can be.
//!
//! All bounds are linear in the standard normals z, so the accepted region is a polytope, and a small linear program
//! answers exactly what a pilot run could only suspect. Points beyond [`REACH`] standard deviations are left out:
//! their mass is below 1e-37 a component. The room is the radius of the largest ball of acceptable z, in standard
//! deviations: a set without volume is empty.

use microlp::{ComparisonOp, OptimizationDirection, Problem, Variable};

use super::{Bounds, Program};
use crate::affine::Affine;
use crate::cover::{HalfSpace, REACH, physical};
use crate::dataset::SpectrumKind;

/// Coefficients of unit rows below this are dropped: together they move no bound by 1e-7, the solver's tolerance.
const NEGLIGIBLE: f64 = 1e-12;

/// Room that a set of half-spaces leaves.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Room {
    /// The largest ball within all of them, in standard deviations.
    Ball { centre: Vec<f64>, radius: f64 },
    /// None: the set is empty or has no volume, because of the bounds at these bands, as indices.
    None { bands: Vec<usize> },
    /// The linear program's solver found no answer.
    Unknown,
}

/// The room that half-spaces leave.
pub(crate) fn room(half_spaces: &[HalfSpace]) -> Room {
    let impossible = half_spaces.iter().filter(|h| h.is_constant() && h.room <= 0.0);
    let bands = distinct(impossible.map(|h| h.band).collect());
    if !bands.is_empty() {
        return Room::None { bands };
    }
    let k = half_spaces.first().map_or(0, |h| h.normal.len());
    let cuts: Vec<_> = half_spaces.iter().filter(|h| h.cuts()).collect();

    let mut problem = Problem::new(OptimizationDirection::Maximize);
    let z: Vec<Variable> = (0..k).map(|_| problem.add_var(0.0, (-REACH, REACH))).collect();
    let radius = problem.add_var(1.0, (-1e6, 1.0));
    for cut in &cuts {
        let terms = z.iter().copied().zip(cut.normal.iter().copied());
        let mut terms: Vec<_> = terms.filter(|(_, c)| c.abs() > NEGLIGIBLE).collect();
        terms.push((radius, 1.0));
        problem.add_constraint(&terms, ComparisonOp::Le, cut.room);
    }
    let Some(solution) = problem.solve().ok().and_then(|outcome| outcome.into_solution().ok()) else {
        return Room::Unknown;
    };
    let centre: Vec<f64> = z.iter().map(|&z| solution.var_value(z)).collect();
    let largest = solution.var_value(radius);
    if largest > 1e-7 {
        return Room::Ball { centre, radius: largest };
    }
    let tight = cuts.iter().filter(|cut| {
        let value: f64 = cut.normal.iter().zip(&centre).map(|(c, z)| c * z).sum();
        value + largest > cut.room - 1e-5
    });
    Room::None { bands: distinct(tight.map(|cut| cut.band).collect()) }
}

/// The largest luminous reflectance at which some spectrum of the model's shapes is still at most 1 everywhere.
///
/// With t = s / max(s) this is a linear program in t = c tau + F y, where tau = 1 / max(s): maximise the LRV of t
/// under 0 <= t <= 1 and tau >= 0. It is a supremum, approached but not reached where the optimum has tau = 0.
pub(crate) fn largest_lrv(program: &Program, weights: &[f64]) -> Option<f64> {
    let mut problem = Problem::new(OptimizationDirection::Maximize);
    let lrv_of = |values: &[f64]| values.iter().zip(weights).map(|(v, w)| v * w).sum::<f64>();
    let tau = problem.add_var(lrv_of(&program.spectrum.offset), (0.0, f64::INFINITY));
    let mut columns = vec![(tau, program.spectrum.offset.as_slice())];
    for gain in program.spectrum.gain.iter().filter(|gain| gain.iter().any(|&g| g != 0.0)) {
        columns.push((problem.add_var(lrv_of(gain), (f64::NEG_INFINITY, f64::INFINITY)), gain));
    }
    for band in 0..program.bands() {
        let terms: Vec<_> =
            columns.iter().map(|(v, column)| (*v, column[band])).filter(|(_, c)| *c != 0.0).collect();
        if !terms.is_empty() {
            problem.add_constraint(&terms, ComparisonOp::Ge, 0.0);
            problem.add_constraint(&terms, ComparisonOp::Le, 1.0);
        }
    }
    Some(problem.solve().ok()?.into_solution().ok()?.objective())
}

/// The responses nearest to `target` that a spectrum within the bounds has, by the largest of the differences in them.
/// `responses` is their map.
pub(crate) fn nearest(program: &Program, responses: &Affine, target: &[f64]) -> Option<Vec<f64>> {
    let mut problem = Problem::new(OptimizationDirection::Minimize);
    let z: Vec<Variable> = responses.gain.iter().map(|_| problem.add_var(0.0, (-REACH, REACH))).collect();
    let distance = problem.add_var(1.0, (0.0, f64::INFINITY));
    let terms = |coefficients: &[f64]| -> Vec<_> {
        z.iter().copied().zip(coefficients.iter().copied()).filter(|(_, c)| c.abs() > NEGLIGIBLE).collect()
    };
    for bound in half_spaces(program) {
        problem.add_constraint(terms(&bound.normal), ComparisonOp::Le, bound.room);
    }
    for (axis, target) in target.iter().enumerate() {
        let value = responses.value(axis);
        let mut terms = terms(&value.gain.concat());
        let difference = target - value.offset[0];
        terms.push((distance, -1.0));
        problem.add_constraint(&terms, ComparisonOp::Le, difference);
        terms.last_mut().expect("it was pushed").1 = 1.0;
        problem.add_constraint(&terms, ComparisonOp::Ge, difference);
    }
    let solution = problem.solve().ok()?.into_solution().ok()?;
    let z: Vec<f64> = z.iter().map(|&z| solution.var_value(z)).collect();
    let value = |axis: usize| {
        let gains = responses.gain.iter().zip(&z);
        responses.offset[axis] + gains.map(|(gain, z)| gain[axis] * z).sum::<f64>()
    };
    Some((0..target.len()).map(value).collect())
}

/// The bounds that a program's rule sets: those of the largest target, where each draw has its own.
pub(crate) fn half_spaces(program: &Program) -> Vec<HalfSpace> {
    let is_below_one = program.kind == SpectrumKind::Reflectance && program.tests_base();
    let mut half_spaces = physical(&program.spectrum, is_below_one);
    if let Some(target) = program.target.as_ref().filter(|t| t.bounds != Bounds::Base) {
        let lrv_of = |values: &[f64]| values.iter().zip(&target.weights).map(|(v, w)| v * w).sum::<f64>();
        let (lrv_offset, lrv_gain) =
            (lrv_of(&program.spectrum.offset), program.spectrum.gain.iter().map(|g| lrv_of(g)));
        let lrv_gain: Vec<f64> = lrv_gain.collect();
        let lrv = target.lrv.largest();
        for band in 0..program.bands() {
            // lrv . s < LRV(s)
            let gains = program.spectrum.gain.iter().map(|gain| gain[band]);
            let coefficients = gains.zip(&lrv_gain).map(|(g, l)| lrv * g - l).collect();
            let room = lrv_offset - lrv * program.spectrum.offset[band];
            half_spaces.push(HalfSpace::new(band, coefficients, room));
        }
    }
    half_spaces
}

fn distinct(mut bands: Vec<usize>) -> Vec<usize> {
    bands.sort_unstable();
    bands.dedup();
    bands
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The bands that leave no room, where no z is acceptable.
    fn blocking_bands(program: &Program) -> Option<Vec<usize>> {
        match room(&half_spaces(program)) {
            Room::None { bands } => Some(bands),
            Room::Ball { .. } => None,
            Room::Unknown => panic!("the solver found no answer"),
        }
    }
    use crate::colorimetry::lrv_weights;
    use crate::model::Model;
    use crate::program::{LrvLaw, LrvTarget};

    /// Reflectances of 3 bands that vary in one shape: 0.5 + 0.1 z, 0.5 + 0.2 z, 0.5 - 0.1 z.
    fn ramp(target: Option<(f64, Bounds)>) -> Program {
        let weights = vec![0.25, 0.5, 0.25];
        let target = target.map(|(lrv, bounds)| LrvTarget { lrv: LrvLaw::Fixed(lrv), weights, bounds });
        Program { target, ..varying(vec![0.5; 3], vec![0.1, 0.2, -0.1]) }
    }

    /// Reflectances that vary in one shape.
    fn varying(offset: Vec<f64>, shape: Vec<f64>) -> Program {
        Program::of(SpectrumKind::Reflectance, Affine { offset, gain: vec![shape] })
    }

    #[test]
    fn room_and_no_room() {
        assert_eq!(blocking_bands(&ramp(None)), None);
        let above = varying(vec![0.5, 1.5, 1.5], vec![0.1, 0.2, -0.1]);
        assert_eq!(blocking_bands(&above), Some(vec![1, 2]), "one needs z < -2.5, the other z > 5");
        let constant = varying(vec![0.5, -0.1, 0.5], vec![0.0; 3]);
        assert_eq!(blocking_bands(&constant), Some(vec![1]));
        let touching = varying(vec![0.0, 0.5, 1.0], vec![-0.1, 0.0, 0.1]);
        assert_eq!(blocking_bands(&touching), None, "z < 0 is room");
        let pinched = varying(vec![0.0, 0.5, 1.0], vec![0.1, 0.0, 0.1]);
        assert_eq!(blocking_bands(&pinched), Some(vec![0, 2]), "z > 0 and z < 0");
    }

    /// The ramp's second band ends at z = 2.5 and -2.5.
    #[test]
    fn the_nearest_responses_of_a_ramp() {
        let responses = Affine { offset: vec![0.5, 0.3], gain: vec![vec![0.1, -0.1]] };
        for (target, expected) in [
            ([2.0, -1.0], [0.75, 0.05]),
            ([-1.0, 2.0], [0.25, 0.55]),
            ([0.6, 0.2], [0.6, 0.2]),
            // The larger of the differences is least in the middle.
            ([0.7, 0.4], [0.55, 0.25]),
        ] {
            let found = nearest(&ramp(None), &responses, &target).expect("there is room");
            let is_close = found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-6);
            assert!(is_close && found.len() == 2, "{target:?}: {found:?}");
        }
    }

    /// By hand: t = s / max(s) is lightest where two bands tie at 1. At z = 0 all tie, so the largest LRV is 1.
    #[test]
    fn the_largest_lrv_of_a_ramp() {
        let program = ramp(Some((0.9, Bounds::Scaled)));
        let largest = |p: &Program| largest_lrv(p, &p.target.as_ref().unwrap().weights).unwrap();
        assert!((largest(&program) - 1.0).abs() < 1e-6);
        let tilted =
            Program { target: program.target, ..varying(vec![0.25, 0.5, 0.5], vec![0.1, 0.2, -0.1]) };
        let by_search = (-5000..5000)
            .map(|i| i as f64 * 1e-3)
            .map(|z| [0.25 + 0.1 * z, 0.5 + 0.2 * z, 0.5 - 0.1 * z])
            .filter(|s| s.iter().all(|&v| v > 0.0))
            .map(|s| (0.25 * s[0] + 0.5 * s[1] + 0.25 * s[2]) / s.iter().copied().fold(0.0, f64::max))
            .fold(0.0, f64::max);
        assert!((largest(&tilted) - by_search).abs() < 1e-3, "{} {by_search}", largest(&tilted));
    }

    #[test]
    fn the_largest_lrv_of_munsell_and_vrhel() {
        let model = Model::builtin("munsell-vrhel").unwrap();
        let weights = lrv_weights(model.grid()).unwrap();
        let largest = largest_lrv(&Program::new(&model, &model.weight_map(1.0)), &weights).unwrap();
        assert!((largest - 0.995928).abs() < 1e-6, "{largest}");
    }
}
