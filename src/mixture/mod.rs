//! Candidates from normal distributions about many centres: of a model whose weights are not normal. GPU twin:
//! `shaders/mixture_looped.wgsl` and, in straight lines, `src/wgsl/mixture.rs`, with the same numbers from a buffer.
//!
//! In the frame of the standard normals z, in which the model's mean is 0 and its covariance 1, a candidate is
//! `c + F z`: one word chooses the centre c and its lower triangular factor F, and the normals are those of the same
//! attempt. All maps of z are then maps of it. The word is the one that follows the pairs of the normals. Where all centres
//! have the same standard deviation h in every direction, the frame is that of `z / h`, so that a candidate is `c / h + z`:
//! one sum, and no product that a driver could join with another.
//!
//! The choice is weighted by the reciprocal of each centre's acceptance, so that after rejection every centre has the
//! share of the draws that the model gives it ([`acceptances`]).

#![allow(clippy::needless_range_loop)] // a lane is an index, of several arrays at once

mod acceptance;
mod bandwidth;
mod normals;

pub(crate) use acceptance::acceptances;
pub(crate) use bandwidth::bandwidth;
pub(crate) use normals::{Normal, normals};

use crate::cover::HalfSpace;
use crate::random::alias::{Alias, nearest_odds};
use crate::random::real::Real;

/// The most centres: of up to 28 components, the table of as many fits the 128 MiB that every adapter binds.
pub(crate) const MOST_CENTRES: usize = 1 << 20;

/// The least acceptance of a centre's candidates. A centre with less has no share: its candidates, nearly all of which
/// would be rejected, would cost more than all others'.
const LEAST_ACCEPTANCE: f64 = 1.0 / 64.0;

/// The smallest unit of a frame. A bandwidth of 0 is one of a millionth: no centre is then at an infinite distance.
const LEAST_UNIT: f64 = 1e-6;

/// Standard deviations of candidates about centres.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Spread {
    /// One about all, in every direction.
    Same(f64),
    /// The rows of a lower triangular factor for each centre: k (k + 1) / 2 numbers.
    Own(Vec<f64>),
}

/// Centres with what a draw chooses among them by.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Mixture<R> {
    pub(crate) alias: Alias,
    /// The numbers of each centre, in rows of four: its coordinates, and its factor where it has one of its own.
    rows: Vec<[R; 4]>,
    has_factors: bool,
    /// Number of coordinates, k.
    components: usize,
}

/// Normal distributions in the frame of the standard normals, each with its share of the draws.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Centres {
    /// k coordinates each.
    pub(crate) coordinates: Vec<f64>,
    pub(crate) spread: Spread,
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
        let mixture = Mixture {
            alias: Alias::new(&nearest_odds(&weights)),
            rows: self.rows(),
            has_factors: matches!(self.spread, Spread::Own(_)),
            components: self.components,
        };
        Some((mixture, left_out))
    }

    /// The unit of the frame in which the mixture is, in standard deviations.
    pub(crate) fn unit(&self) -> f64 {
        match self.spread {
            Spread::Same(spread) => spread.max(LEAST_UNIT),
            Spread::Own(_) => 1.0,
        }
    }

    /// The numbers of all centres, each in rows of four.
    fn rows(&self) -> Vec<[f64; 4]> {
        let (k, unit) = (self.components, self.unit());
        let of_centre = |(i, coordinates): (usize, &[f64])| {
            let mut numbers: Vec<f64> = coordinates.iter().map(|c| c / unit).collect();
            if let Spread::Own(factors) = &self.spread {
                numbers.extend_from_slice(&factors[i * triangle(k)..][..triangle(k)]);
            }
            numbers.resize(numbers.len().next_multiple_of(4), 0.0);
            numbers.as_chunks::<4>().0.to_vec()
        };
        self.coordinates.chunks_exact(k).enumerate().flat_map(of_centre).collect()
    }
}

impl Mixture<f64> {
    /// Rounds all numbers to the type R.
    pub(crate) fn rounded<R: Real>(&self) -> Mixture<R> {
        Mixture {
            alias: self.alias.clone(),
            rows: self.rows.iter().map(|row| row.map(R::from_f64)).collect(),
            has_factors: self.has_factors,
            components: self.components,
        }
    }
}

impl Mixture<f32> {
    /// Words that a shader reads, in vectors of four: the numbers of each centre, and a word for each column of the alias table.
    pub(crate) fn words(&self) -> Vec<[u32; 4]> {
        let mut words: Vec<_> = self.rows.iter().map(|row| row.map(f32::to_bits)).collect();
        let mut columns = self.alias.packed();
        columns.resize(columns.len().next_multiple_of(4), 0);
        words.extend(columns.as_chunks::<4>().0);
        words
    }
}

impl<R: Real> Mixture<R> {
    /// Number of coordinates, k.
    pub(crate) fn components(&self) -> usize {
        self.components
    }

    /// Whether each centre has a factor of its own.
    pub(crate) fn has_factors(&self) -> bool {
        self.has_factors
    }

    /// Number of centres.
    pub(crate) fn len(&self) -> usize {
        self.rows.len() / self.rows_of_each()
    }

    /// Number of rows of four numbers of a centre.
    pub(crate) fn rows_of_each(&self) -> usize {
        let factor = if self.has_factors() { triangle(self.components) } else { 0 };
        (self.components + factor).div_ceil(4)
    }

    /// Number of the word that chooses the centre, from the first of an attempt on.
    pub(crate) fn choice(&self) -> usize {
        self.components.next_multiple_of(2)
    }

    /// Turns normals into candidates about the centres that the words choose, in each of L lanes.
    #[inline(always)]
    pub(crate) fn place<const L: usize>(&self, normals: &mut [[R; L]], words: &[u32; L]) {
        let (k, each) = (self.components, self.rows_of_each());
        let mut first = [0; L];
        for l in 0..L {
            first[l] = self.alias.choose(words[l]) as usize * each;
        }
        if self.has_factors {
            return self.place_by_factors(normals, &first);
        }
        for (row, normals) in normals[..k].chunks_mut(4).enumerate() {
            let centres = self.row_in_lanes(&first, row);
            for (normal, centre) in normals.iter_mut().zip(centres) {
                for l in 0..L {
                    normal[l] = centre[l] + normal[l];
                }
            }
        }
    }

    /// [`place`](Mixture::place) by factors: from the last coordinate on, since each takes the normals before it.
    #[inline(always)]
    fn place_by_factors<const L: usize>(&self, normals: &mut [[R; L]], first: &[usize; L]) {
        let k = self.components;
        let number = |i: usize| self.row_in_lanes(first, i / 4)[i % 4];
        for j in (0..k).rev() {
            let mut sum = number(j);
            for i in 0..=j {
                let gain = number(k + triangle(j) + i);
                for l in 0..L {
                    sum[l] = sum[l] + gain[l] * normals[i][l];
                }
            }
            normals[j] = sum;
        }
    }

    /// The four numbers of a row of each lane's centre, number by number.
    #[inline(always)]
    fn row_in_lanes<const L: usize>(&self, first: &[usize; L], row: usize) -> [[R; L]; 4] {
        let mut numbers = [[R::ZERO; L]; 4];
        let (fours, rest) = first.as_chunks::<4>();
        for (i, four) in fours.iter().enumerate() {
            // Each by its number: `map` is not inlined here.
            let [a, b, c, d] = [four[0], four[1], four[2], four[3]];
            let [a, b, c, d] =
                [self.rows[a + row], self.rows[b + row], self.rows[c + row], self.rows[d + row]];
            for j in 0..4 {
                numbers[j][4 * i..][..4].copy_from_slice(&[a[j], b[j], c[j], d[j]]);
            }
        }
        for (i, first) in rest.iter().enumerate() {
            let row = self.rows[first + row];
            numbers.iter_mut().zip(row).for_each(|(numbers, number)| numbers[4 * fours.len() + i] = number);
        }
        numbers
    }
}

/// Number of entries of a lower triangle with this number of rows.
pub(crate) fn triangle(rows: usize) -> usize {
    rows * (rows + 1) / 2
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Candidates by hand, of three centres with three coordinates, in nine lanes.
    #[test]
    fn candidates_are_centres_and_factors_times_normals() {
        let coordinates: Vec<f64> = (0..9).map(|i| f64::from(i) - 4.0).collect();
        let factors: Vec<f64> = (0..18).map(|i| f64::from(i * i % 11) / 8.0).collect();
        const LANES: usize = 9;
        let normals: [[f64; LANES]; 3] =
            [0.5, 2.0, -1.5].map(|z| std::array::from_fn(|l| z + l as f64 / 4.0));
        for spread in [Spread::Same(0.5), Spread::Own(factors.clone())] {
            let is_same = spread == Spread::Same(0.5);
            let centres = Centres {
                coordinates: coordinates.clone(),
                spread,
                shares: vec![0.2, 0.5, 0.3],
                components: 3,
            };
            let (mixture, left_out) = centres.within(&[]).expect("nothing is rejected");
            assert_eq!(
                (mixture.len(), left_out, mixture.rows_of_each()),
                (3, 0, if is_same { 1 } else { 3 })
            );
            let mut seen = [false; 3];
            for first in 0..64u32 {
                let words = std::array::from_fn(|l| (first + 7 * l as u32) << 26);
                let mut placed = normals;
                mixture.place(&mut placed, &words);
                for l in 0..LANES {
                    let centre = mixture.alias.choose(words[l]) as usize;
                    seen[centre] = true;
                    let c = &coordinates[3 * centre..][..3];
                    for j in 0..3 {
                        let row = &factors[6 * centre + triangle(j)..][..j + 1];
                        let turned: f64 =
                            row.iter().zip(normals).map(|(gain, normal)| gain * normal[l]).sum();
                        let expected = if is_same { c[j] / 0.5 + normals[j][l] } else { c[j] + turned };
                        assert_eq!(placed[j][l], expected, "coordinate {j} about centre {centre}");
                    }
                }
            }
            assert_eq!(seen, [true; 3]);
        }
    }
}
