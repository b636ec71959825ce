//! Candidates from normal distributions about many centres: of a model whose weights are not normal. GPU twin:
//! `shaders/mixture.wgsl`, which reads the same numbers from a buffer.
//!
//! In the frame of the standard normals z, in which the model's mean is 0 and its covariance 1, a candidate is
//! `c + F z`: one word chooses the centre c and its lower triangular factor F, and the normals are those of the same
//! attempt. All maps of z are then maps of it. The word is the one that follows the pairs of the normals.
//!
//! The choice is weighted by the reciprocal of each centre's acceptance, so that after rejection every centre has the
//! share of the draws that the model gives it ([`acceptances`]).

mod acceptance;
mod bandwidth;
mod normals;

pub(crate) use acceptance::acceptances;
pub(crate) use bandwidth::bandwidth;
pub(crate) use normals::{Normal, normals};

use crate::cover::HalfSpace;
use crate::random::alias::{Alias, nearest_odds};
use crate::random::real::Real;

/// The most centres: what the table of a buffer of 128 MiB, which every adapter has, holds of 6 components.
pub(crate) const MOST_CENTRES: usize = 1 << 20;

/// The least acceptance of a centre's candidates. A centre with less has no share: its candidates, nearly all of which
/// would be rejected, would cost more than all others'.
const LEAST_ACCEPTANCE: f64 = 1.0 / 64.0;

/// Standard deviations of a candidate about its centre.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Spread<R> {
    /// The same about all, in every direction.
    Same(R),
    /// The rows of a lower triangular factor for each centre: k (k + 1) / 2 numbers.
    Own(Vec<R>),
}

/// Centres with what a draw chooses among them by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mixture<R> {
    pub(crate) alias: Alias,
    /// The coordinates of each centre.
    centres: Vec<R>,
    spread: Spread<R>,
    /// Number of coordinates, k.
    components: usize,
}

/// Normal distributions in the frame of the standard normals, each with its share of the draws.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Centres {
    /// k coordinates each.
    pub(crate) coordinates: Vec<f64>,
    pub(crate) spread: Spread<f64>,
    pub(crate) shares: Vec<f64>,
    pub(crate) components: usize,
}

impl Centres {
    /// The mixture whose accepted candidates have the shares, and the number of centres without one: those of which next
    /// to nothing is accepted. `None` where all are.
    pub(crate) fn within(self, half_spaces: &[HalfSpace]) -> Option<(Mixture<f64>, usize)> {
        let acceptances = acceptances(&self, half_spaces);
        let weight = |(acceptance, share): (&f64, &f64)| match acceptance {
            acceptance if *acceptance >= LEAST_ACCEPTANCE => share / acceptance,
            _ => 0.0,
        };
        let weights: Vec<f64> = acceptances.iter().zip(&self.shares).map(weight).collect();
        let left_out = weights.iter().filter(|weight| **weight == 0.0).count();
        if left_out == weights.len() {
            return None;
        }
        let Centres { coordinates: centres, spread, components, .. } = self;
        Some((Mixture { alias: Alias::new(&nearest_odds(&weights)), centres, spread, components }, left_out))
    }
}

impl Mixture<f64> {
    /// Rounds all numbers to the type R.
    pub(crate) fn rounded<R: Real>(&self) -> Mixture<R> {
        let round = |values: &[f64]| values.iter().map(|&v| R::from_f64(v)).collect::<Vec<R>>();
        Mixture {
            alias: self.alias.clone(),
            centres: round(&self.centres),
            spread: match &self.spread {
                Spread::Same(spread) => Spread::Same(R::from_f64(*spread)),
                Spread::Own(factors) => Spread::Own(round(factors)),
            },
            components: self.components,
        }
    }
}

impl Mixture<f32> {
    /// Words that `shaders/mixture.wgsl` reads: for each column of the alias table [`rows`](Mixture::rows) vectors of four
    /// words: the column's threshold, its alias, and the numbers of the centre of its number, its coordinates and its
    /// factor. Columns beyond the centres have numbers that nothing reads.
    pub(crate) fn words(&self) -> Vec<[u32; 4]> {
        let (k, rows) = (self.components, self.rows());
        let mut words = Vec::with_capacity(self.alias.columns.len() * rows);
        for (i, column) in self.alias.columns.iter().enumerate() {
            let part = |numbers: &[f32], width: usize| numbers.get(i * width..(i + 1) * width).map(<[f32]>::to_vec);
            let coordinates = part(&self.centres, k).unwrap_or_default();
            let factor = match &self.spread {
                Spread::Same(_) => Vec::new(),
                Spread::Own(factors) => part(factors, triangle(k)).unwrap_or_default(),
            };
            let numbers = coordinates.into_iter().chain(factor).map(f32::to_bits);
            let mut row: Vec<u32> = [column.threshold, column.alias].into_iter().chain(numbers).collect();
            row.resize(4 * rows, 0);
            words.extend(row.as_chunks::<4>().0);
        }
        words
    }
}

impl<R: Real> Mixture<R> {
    /// Number of coordinates, k.
    pub(crate) fn components(&self) -> usize {
        self.components
    }

    /// Standard deviations of a candidate about its centre.
    pub(crate) fn spread(&self) -> &Spread<R> {
        &self.spread
    }

    /// Number of vectors of four [`words`](Mixture::words) of a column.
    pub(crate) fn rows(&self) -> usize {
        let factor = if let Spread::Own(_) = self.spread { triangle(self.components) } else { 0 };
        (2 + self.components + factor).div_ceil(4)
    }

    /// Number of the word that chooses the centre, from the first of an attempt on.
    pub(crate) fn choice(&self) -> usize {
        self.components.next_multiple_of(2)
    }

    /// Turns normals into candidates about the centres that the words choose, in each of L lanes.
    #[inline(always)]
    pub(crate) fn place<const L: usize>(&self, normals: &mut [[R; L]], words: &[u32; L]) {
        let k = self.components;
        let mut chosen = [0; L];
        for l in 0..L {
            chosen[l] = self.alias.choose(words[l]) as usize;
        }
        match &self.spread {
            Spread::Same(spread) => {
                for (j, normal) in normals[..k].iter_mut().enumerate() {
                    let centres = in_lanes(&self.centres, &chosen, k, j);
                    for l in 0..L {
                        normal[l] = centres[l] + *spread * normal[l];
                    }
                }
            }
            // From the last on, since each takes the normals before it.
            Spread::Own(factors) => {
                for j in (0..k).rev() {
                    let mut sum = in_lanes(&self.centres, &chosen, k, j);
                    for i in 0..=j {
                        let gain = in_lanes(factors, &chosen, triangle(k), triangle(j) + i);
                        for l in 0..L {
                            sum[l] = sum[l] + gain[l] * normals[i][l];
                        }
                    }
                    normals[j] = sum;
                }
            }
        }
    }
}

/// Number of entries of a lower triangle with this number of rows.
pub(crate) fn triangle(rows: usize) -> usize {
    rows * (rows + 1) / 2
}

/// One number of each lane's centre, of `width` each. Not inlined: the compiler would make gathers of the loads, at several
/// times their cost.
#[inline(never)]
fn in_lanes<R: Real, const L: usize>(numbers: &[R], chosen: &[usize; L], width: usize, number: usize) -> [R; L] {
    std::array::from_fn(|l| numbers[chosen[l] * width + number])
}
