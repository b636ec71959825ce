//! Acceptance of the candidates about each centre, in f64.
//!
//! All centres share the same normals, so with one spread for all, what a bound sees of them is made once: a centre's
//! candidates are within a bound where `n . F z` is below the room that its centre leaves. Those that are not are the first
//! of the candidates in the order of what the bound sees, and sets of the first of them are made once as well.

use super::{Centres, Spread, triangle};
use crate::cover::HalfSpace;
use crate::random::real::Real;
use crate::random::stream::Stream;
use crate::threads;

/// Number of candidates of all centres together, about.
const CANDIDATES: usize = 1 << 23;

/// Smallest and largest number of candidates of a centre, which leave its acceptance `a` a standard error of
/// `sqrt(a (1 - a) / candidates)`, much the same for centres that are alike.
const EACH: [usize; 2] = [256, 4096];

/// Number of centres that are worth a thread.
const GRAIN: u64 = 64;

/// The share of each centre's candidates that half-spaces accept.
pub(crate) fn acceptances(centres: &Centres, half_spaces: &[HalfSpace]) -> Vec<f64> {
    let k = centres.components;
    let count = centres.shares.len();
    let each = (CANDIDATES / count).clamp(EACH[0], EACH[1]).next_power_of_two();
    let normals = normals(k, each);
    let bounds = match centres.spread {
        Spread::Same(spread) => threads::map(half_spaces.len() as u64, 1, |number| {
            Bound::new(&half_spaces[number as usize], spread, &normals)
        }),
        Spread::Own(_) => Vec::new(),
    };
    let accepted = threads::map(count as u64, GRAIN, |centre| {
        accepted(centres, centre as usize, half_spaces, &bounds, &normals)
    });
    accepted.into_iter().map(|accepted| accepted as f64 / each as f64).collect()
}

/// `each` vectors of k standard normals, coordinate by coordinate: half of them, and then their opposites, so that their
/// mean is 0.
fn normals(k: usize, each: usize) -> Vec<Vec<f64>> {
    let stream = Stream::named(0, "acceptance");
    let mut coordinates = vec![Vec::with_capacity(each); k];
    for index in 0..each as u64 / 2 {
        for (block, coordinates) in coordinates.chunks_mut(4).enumerate() {
            let words = stream.block(index, 0, block as u32);
            let pairs = [
                <f64 as Real>::normal_pair(words[0], words[1]),
                <f64 as Real>::normal_pair(words[2], words[3]),
            ];
            coordinates
                .iter_mut()
                .zip(pairs.as_flattened())
                .for_each(|(column, normal)| column.push(*normal));
        }
    }
    for column in &mut coordinates {
        column.extend_from_within(..);
        let half = column.len() / 2;
        column[half..].iter_mut().for_each(|normal| *normal = -*normal);
    }
    coordinates
}

/// Candidates in a word of a set.
const WORD: usize = u64::BITS as usize;

/// Candidates from one set of the first to the next.
const STEP: usize = 16;

/// A half-space as it sees the normals, where all centres have the same spread.
struct Bound {
    /// Products with the normals, falling.
    seen: Vec<f64>,
    /// The candidate of each.
    order: Vec<u32>,
    /// For each multiple of [`STEP`] the set of as many candidates, the first in that order.
    first: Vec<u64>,
}

impl Bound {
    fn new(half_space: &HalfSpace, spread: f64, normals: &[Vec<f64>]) -> Bound {
        let gains: Vec<f64> = half_space.normal.iter().map(|gain| spread * gain).collect();
        let seen = weighted(&gains, normals);
        let mut order: Vec<u32> = (0..seen.len() as u32).collect();
        order.sort_unstable_by(|&a, &b| seen[b as usize].total_cmp(&seen[a as usize]));
        let mut set = vec![0; seen.len() / WORD];
        let mut first = set.clone();
        for candidates in order.chunks(STEP) {
            candidates.iter().for_each(|&candidate| insert(&mut set, candidate));
            first.extend(&set);
        }
        Bound { seen: order.iter().map(|&candidate| seen[candidate as usize]).collect(), order, first }
    }

    /// Adds the candidates that are beyond this room.
    fn reject(&self, room: f64, rejected: &mut [u64]) {
        // Most centres are far from most bounds.
        if self.seen[0] < room {
            return;
        }
        let count = self.seen.partition_point(|&seen| seen >= room);
        let first = &self.first[count / STEP * rejected.len()..];
        rejected.iter_mut().zip(first).for_each(|(all, first)| *all |= first);
        self.order[count - count % STEP..count].iter().for_each(|&candidate| insert(rejected, candidate));
    }
}

fn insert(set: &mut [u64], candidate: u32) {
    set[candidate as usize / WORD] |= 1 << (candidate as usize % WORD);
}

/// The sums of all normals' coordinates, times these gains.
fn weighted(gains: &[f64], normals: &[Vec<f64>]) -> Vec<f64> {
    let mut sums = vec![0.0; normals[0].len()];
    for (gain, normals) in gains.iter().zip(normals) {
        sums.iter_mut().zip(normals).for_each(|(sum, normal)| *sum += gain * normal);
    }
    sums
}

/// Number of the candidates about a centre that all half-spaces accept.
fn accepted(
    centres: &Centres,
    centre: usize,
    half_spaces: &[HalfSpace],
    bounds: &[Bound],
    normals: &[Vec<f64>],
) -> usize {
    let k = centres.components;
    let coordinates = &centres.coordinates[centre * k..][..k];
    let mut rejected = vec![0; normals[0].len() / WORD];
    for (number, half_space) in half_spaces.iter().enumerate() {
        let at_centre: f64 = half_space.normal.iter().zip(coordinates).map(|(gain, c)| gain * c).sum();
        let room = half_space.room - at_centre;
        match &centres.spread {
            Spread::Same(_) => bounds[number].reject(room, &mut rejected),
            Spread::Own(factors) => {
                let gains = turned(&half_space.normal, &factors[centre * triangle(k)..][..triangle(k)]);
                let seen = weighted(&gains, normals);
                for (set, seen) in rejected.iter_mut().zip(seen.chunks(WORD)) {
                    let bit = |(bit, &seen): (usize, &f64)| u64::from(seen >= room) << bit;
                    *set |= seen.iter().enumerate().map(bit).sum::<u64>();
                }
            }
        }
    }
    normals[0].len() - rejected.iter().map(|set| set.count_ones() as usize).sum::<usize>()
}

/// The gains of z in `normal . F z`.
fn turned(normal: &[f64], factor: &[f64]) -> Vec<f64> {
    let k = normal.len();
    (0..k).map(|i| (i..k).map(|j| normal[j] * factor[triangle(j) + i]).sum()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, Normal};

    /// Two centres with a spread for all, and the same with factors of their own: the same candidates, and the share that
    /// the normal distribution function says.
    #[test]
    fn acceptances_are_those_of_the_distribution_function() {
        let (spread, room, normal) = (0.7, 0.5, [0.6, -1.1]);
        let coordinates = vec![0.2, 0.3, 0.8, 0.4];
        let of = |spread| {
            let centres =
                Centres { coordinates: coordinates.clone(), spread, shares: vec![0.5; 2], components: 2 };
            acceptances(&centres, &[HalfSpace::new(0, normal.to_vec(), room)])
        };
        let exact = |centre: &[f64], gains: [f64; 2]| {
            let above = room - (normal[0] * centre[0] + normal[1] * centre[1]);
            Normal::standard().cdf(above / gains[0].hypot(gains[1]))
        };
        let same = of(Spread::Same(spread));
        let diagonal = [spread, 0.0, spread];
        assert_eq!(of(Spread::Own([diagonal, diagonal].concat())), same);
        // Rows of a lower triangle: (a), (b, c).
        let (a, b, c) = (0.9, -0.5, 0.4);
        let turned = of(Spread::Own([diagonal, [a, b, c]].concat()));
        assert_eq!(turned[0], same[0]);
        for (found, centre, gains) in [
            (same[0], &coordinates[..2], normal.map(|gain| spread * gain)),
            (same[1], &coordinates[2..], normal.map(|gain| spread * gain)),
            (turned[1], &coordinates[2..], [a * normal[0] + b * normal[1], c * normal[1]]),
        ] {
            let exact = exact(centre, gains);
            assert!((0.05..0.95).contains(&exact));
            // Four standard errors of 4,096 candidates.
            assert!((found - exact).abs() < 4.0 * (exact * (1.0 - exact) / 4096.0).sqrt(), "{found} {exact}");
        }
    }
}
