//! Sources of candidates other than plain normals, with a table that draws read.

use crate::cover::BoxMixture;
use crate::mixture::Mixture;
use crate::random::real::Real;

/// Source of candidates.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Proposal<R> {
    /// Boxes that cover what is acceptable.
    Boxes(BoxMixture<R>),
    /// Normal distributions about the centres of a model.
    Centres(Mixture<R>),
}

impl Proposal<f64> {
    /// Rounds all numbers to the type R.
    pub(crate) fn rounded<R: Real>(&self) -> Proposal<R> {
        match self {
            Proposal::Boxes(boxes) => Proposal::Boxes(boxes.rounded()),
            Proposal::Centres(mixture) => Proposal::Centres(mixture.rounded()),
        }
    }

    /// Words of the table that a shader reads, in vectors of four.
    pub(crate) fn words(&self) -> Vec<[u32; 4]> {
        match self {
            Proposal::Boxes(boxes) => boxes.rounded().words(),
            Proposal::Centres(mixture) => mixture.rounded().words(),
        }
    }
}
