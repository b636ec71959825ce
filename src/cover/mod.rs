//! Exact draws of regions that hold next to none of the candidates.
//!
//! The accepted points form a polytope in the standard normals z. Where its probability p is small, plain rejection
//! costs 1 / p candidates a draw. A cover proposes better ones: disjoint boxes that hold the whole polytope, in
//! coordinates that suit it ([`Frame`]); one of them chosen by its probability ([`Alias`]), and in it a normal for
//! each axis, truncated to the box ([`crate::random::truncated`]). Its accepted candidates are distributed exactly as
//! those of plain rejection: both have the standard normal density on the polytope. Only the acceptance changes, to
//! p / (the probability of the boxes), a tenth or more for any p. Points beyond [`REACH`] are left out.
//!
//! The half-spaces are open and the boxes closed, but faces have no probability; what a box loses or gains by
//! rounding to f32 is 1e-7 of it. A draw's physical test is the same as without a cover, on the same f32 spectrum.

mod frame;
mod half_space;
mod hat;
mod mixture;
mod partition;
mod simplex;
#[cfg(test)]
pub(crate) mod tests;

use hat::Axis;
use partition::partition;
#[cfg(test)]
use simplex::Polytope;
use simplex::Sides;

pub(crate) use frame::Frame;
pub(crate) use half_space::{HalfSpace, REACH, physical};
pub(crate) use mixture::BoxMixture;

use crate::random::alias::{Alias, odds};
#[cfg(test)]
use crate::random::stream::Stream;

/// Largest number of boxes of a cover. Twice as many would accept a tenth more, from a table twice the size.
const BOXES: usize = 1024;

/// Largest number of components for which a cover is built. The time grows from 0.1 s for 6 to 0.3 s for 8 and 2 s
/// for 12, and the acceptance falls: boxes fit a polytope worse the more corners they have.
pub(crate) const MOST_COMPONENTS: usize = 12;

/// Cost of a cover's candidate relative to one of plain rejection: 135 ns and 69 ns on the CPU, for 6 components and
/// 31 bands.
const COST: f64 = 2.0;

/// Disjoint boxes that together hold all that half-spaces accept.
#[derive(Clone, Debug)]
pub(crate) struct Cover {
    frame: Frame,
    /// The accepted region, in the frame's coordinates relative to its centre.
    #[cfg(test)]
    polytope: Polytope,
    boxes: Vec<Sides>,
    proposal: BoxMixture<f64>,
    /// Probability mass of all proposals; the accepted region's share of it is the acceptance.
    mass: f64,
}

/// Estimate of a region's probability from candidates.
#[cfg(test)]
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Estimate {
    /// The share of candidates that are accepted.
    pub(crate) acceptance: f64,
    /// The probability that a standard normal is in the region, which is the acceptance of plain rejection.
    pub(crate) probability: f64,
    /// The relative standard error of both.
    pub(crate) error: f64,
}

impl Cover {
    /// Builds the cover of the region that half-spaces accept, from a point within. `None` where it would be empty,
    /// or there are more than [`MOST_COMPONENTS`].
    pub(crate) fn new(half_spaces: &[HalfSpace], within: &[f64]) -> Option<Cover> {
        (within.len() <= MOST_COMPONENTS).then(|| Cover::of_boxes(half_spaces, within, BOXES)).flatten()
    }

    /// Whether a cover could be cheaper than plain rejection with the acceptance `plain`.
    pub(crate) fn could_pay(plain: f64) -> bool {
        plain < 1.0 / COST
    }

    /// Whether a cover with this acceptance is cheaper than plain rejection with the acceptance `plain`.
    pub(crate) fn pays(acceptance: f64, plain: f64) -> bool {
        acceptance > COST * plain
    }

    fn of_boxes(half_spaces: &[HalfSpace], within: &[f64], most: usize) -> Option<Cover> {
        let cuts: Vec<_> = half_spaces.iter().filter(|h| h.cuts()).collect();
        let frame = Frame::new(&cuts, within);
        let polytope = frame.polytope(&cuts);
        let boxes = partition(&polytope, most);
        if boxes.is_empty() {
            return None;
        }
        let axes: Vec<Vec<Axis>> = boxes.iter().map(|sides| axes(sides, &frame)).collect();
        let masses: Vec<f64> = axes.iter().map(|axes| axes.iter().map(|a| a.mass).product()).collect();
        let (odds, excess, unit) = odds(&masses);
        let proposal = BoxMixture {
            alias: Alias::new(&odds),
            // Thinned by what rounding added to the odds, so that it costs acceptance and not exactness.
            costs: excess.iter().map(|e| 2.0 * e.ln()).collect(),
            axes: axes.iter().flatten().map(|axis| axis.numbers).collect(),
            components: within.len(),
        };
        Some(Cover {
            #[cfg(test)]
            polytope: polytope.around(frame.centre.as_slice()),
            frame,
            boxes,
            proposal,
            mass: 2f64.powi(32) / unit,
        })
    }

    /// The coordinates in which candidates are proposed.
    pub(crate) fn frame(&self) -> &Frame {
        &self.frame
    }

    /// The boxes that candidates are drawn from.
    pub(crate) fn proposal(&self) -> &BoxMixture<f64> {
        &self.proposal
    }

    /// Number of boxes.
    pub(crate) fn len(&self) -> usize {
        self.boxes.len()
    }

    /// Probability of the boxes, with their hats; the region's share of it is the acceptance.
    pub(crate) fn mass(&self) -> f64 {
        self.mass
    }

    /// Tries the first `count` candidates of a stream, in f64.
    #[cfg(test)]
    pub(crate) fn estimate(&self, stream: Stream, count: u64) -> Estimate {
        let mut coordinates = vec![[0.0]; self.proposal.components];
        let accepted = (0..count).filter(|&i| {
            let words = |block| stream.block(i, 0, block);
            let [kept] = self.proposal.propose(&mut coordinates, words);
            kept && self.polytope.contains(coordinates.as_flattened())
        });
        let accepted = accepted.count() as f64;
        let acceptance = accepted / count as f64;
        Estimate {
            acceptance,
            probability: acceptance * self.mass,
            error: ((1.0 - acceptance) / accepted.max(1.0)).sqrt(),
        }
    }
}

fn axes(sides: &Sides, frame: &Frame) -> Vec<Axis> {
    let ends = sides.low.iter().zip(&sides.high);
    ends.zip(&frame.centre).map(|((&low, &high), &centre)| Axis::new(low, high, centre)).collect()
}
