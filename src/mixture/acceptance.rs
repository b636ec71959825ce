//! Acceptance of the candidates about each centre, in f64.
//!
//! All centres share the same normals, so what a bound sees of them is made once: a centre's candidates are within a
//! bound where `n . F z` is below the room that its centre leaves. With one spread for all that is a comparison of numbers
//! that are there already, and most centres have few bounds near enough to need it.

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
    let bounds: Vec<Bound> =
        half_spaces.iter().map(|half_space| Bound::new(half_space, centres, &normals)).collect();
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

/// Products of a half-space and all normals, where all centres have the same spread; nothing elsewhere.
struct Bound {
    seen: Vec<f64>,
    most: f64,
}

impl Bound {
    fn new(half_space: &HalfSpace, centres: &Centres, normals: &[Vec<f64>]) -> Bound {
        let Spread::Same(spread) = centres.spread else { return Bound { seen: Vec::new(), most: 0.0 } };
        let gains: Vec<f64> = half_space.normal.iter().map(|gain| spread * gain).collect();
        let seen = weighted(&gains, normals);
        Bound { most: seen.iter().copied().fold(f64::NEG_INFINITY, f64::max), seen }
    }
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
    let mut within = vec![true; normals[0].len()];
    for (half_space, bound) in half_spaces.iter().zip(bounds) {
        let at_centre: f64 = half_space.normal.iter().zip(coordinates).map(|(gain, c)| gain * c).sum();
        let room = half_space.room - at_centre;
        let own;
        let (seen, most) = match &centres.spread {
            Spread::Same(_) => (&bound.seen, bound.most),
            Spread::Own(factors) => {
                own = weighted(
                    &turned(&half_space.normal, &factors[centre * triangle(k)..][..triangle(k)]),
                    normals,
                );
                (&own, f64::INFINITY)
            }
        };
        if most < room {
            continue;
        }
        within.iter_mut().zip(seen).for_each(|(within, seen)| *within &= *seen < room);
    }
    within.into_iter().filter(|within| *within).count()
}

/// The gains of z in `normal . F z`.
fn turned(normal: &[f64], factor: &[f64]) -> Vec<f64> {
    let k = normal.len();
    (0..k).map(|i| (i..k).map(|j| normal[j] * factor[triangle(j) + i]).sum()).collect()
}
