//! Covers of the regions that recipes accept, against plain rejection, against a Markov chain, and with faults.

use std::sync::LazyLock;

use super::*;
use crate::affine::Affine;
use crate::colorimetry::lrv_weights;
use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
use crate::grid::{Extrapolation, Grid};
use crate::model::{Fit, Model};
use crate::program::feasibility::{Room, half_spaces, room};
use crate::program::{Bounds, LrvLaw, LrvTarget, Program};
use crate::random::real::Real;
use crate::random::stream::StreamRng;
use rand::Rng;

/// Probability of a false alarm, in each of some 50 comparisons.
const ALARM: f64 = 1e-8;

static SURFACES: LazyLock<Model> = LazyLock::new(|| Model::builtin("munsell-vrhel").unwrap());

fn program(lrv: Option<f64>, covariance_scale: f64) -> Program {
    let weights = lrv_weights(SURFACES.grid()).unwrap();
    let target = lrv.map(|lrv| LrvTarget { lrv: LrvLaw::Fixed(lrv), weights, bounds: Bounds::Scaled });
    Program { target, max_attempts: 1000, ..Program::new(&SURFACES, &SURFACES.weight_map(covariance_scale)) }
}

fn cover_of(program: &Program, boxes: usize) -> Cover {
    let half_spaces = half_spaces(program);
    let Room::Ball { centre, .. } = room(&half_spaces) else { panic!("there is no room") };
    Cover::of_boxes(&half_spaces, &centre, boxes).unwrap()
}

/// The cover of reflectances that are scaled to a luminous reflectance of 0.99.
pub(crate) fn near_white() -> Cover {
    cover_of(&program(Some(0.99), 1.0), BOXES)
}

/// The program in the coordinates that a cover proposes.
fn in_frame(program: &Program, cover: &Cover) -> Program {
    Program { spectrum: cover.frame().turned(&program.spectrum), ..program.clone() }
}

/// The extreme regions, their covers' least acceptance, and their probabilities from other methods (plain rejection,
/// another cover and an exponential tilt of the whole, which agree to 1e-4 within their range).
const REGIONS: [(Option<f64>, f64, f64, f64); 9] = [
    (Some(0.95), 1.0, 0.27, 8.74e-3),
    (Some(0.98), 1.0, 0.18, 9.45e-5),
    (Some(0.985), 1.0, 0.16, 9.30e-6),
    (Some(0.99), 1.0, 0.165, 3.841e-8),
    (Some(0.992), 1.0, 0.15, 9.654e-11),
    (None, 25.0, 0.36, 0.0322),
    (None, 100.0, 0.20, 1.585e-3),
    (None, 1e4, 0.125, 2.842e-9),
    (None, 1e6, 0.12, 2.861e-15),
];

#[test]
fn probabilities_are_those_of_other_methods() {
    for (lrv, scale, least, probability) in REGIONS {
        let cover = cover_of(&program(lrv, scale), BOXES);
        let estimate = cover.estimate(Stream::new(1), 1 << 17);
        println!(
            "LRV {lrv:?}, covariance x{scale}: {} boxes, acceptance {:.3}, probability {:.3e} +- {:.1} %",
            cover.len(),
            estimate.acceptance,
            estimate.probability,
            100.0 * estimate.error
        );
        assert!(estimate.acceptance > least);
        // The last digit of those that are known to three, and six standard errors.
        let error = (estimate.probability / probability - 1.0).abs();
        assert!(error < 0.5e-2 + 6.0 * estimate.error, "{error}");
        assert!(cover.proposal().rounded::<f32>().words().as_flattened().len() * 4 <= 256 << 10);
    }
}

/// Integral of a density from `low` to `high`, by Simpson's rule.
fn integral(low: f64, high: f64, density: impl Fn(f64) -> f64) -> f64 {
    const STEPS: u32 = 8000;
    let width = (high - low) / f64::from(STEPS);
    let term = |i: u32| {
        let factor = if i == 0 || i == STEPS { 1.0 } else { f64::from(2 + 2 * (i % 2)) };
        factor * density(low + f64::from(i) * width)
    };
    width / 3.0 * (0..=STEPS).map(term).sum::<f64>()
}

/// The mass of an axis by its numbers alone: of the normal that it draws, or of the exponential above it.
fn mass(numbers: [f64; 4], low: f64, high: f64) -> f64 {
    let root = std::f64::consts::TAU.sqrt();
    match numbers[2] < 0.0 {
        true => {
            let slope = -1.0 / numbers[1];
            integral(low, high, |y| (slope * slope / 2.0 - slope * y).exp() / root)
        }
        false => {
            let mass = integral(low, high, |y| (-y * y / 2.0).exp() / root);
            assert!((mass / numbers[2] - 1.0).abs() < 1e-9, "{mass} {numbers:?}");
            mass
        }
    }
}

/// Sampling cannot see an error of a thousandth in the odds of a box; integrals can.
#[test]
fn every_box_is_proposed_as_often_as_it_has_mass() {
    for (lrv, scale) in [(Some(0.95), 1.0), (Some(0.99), 1.0), (None, 25.0), (None, 1e6)] {
        let cover = cover_of(&program(lrv, scale), BOXES);
        let (proposal, k) = (cover.proposal(), cover.proposal().components);
        let shares = proposal.alias.shares();
        assert_eq!(shares.iter().sum::<u64>(), 1 << 32);
        let mut worst = 0f64;
        for (i, sides) in cover.boxes.iter().enumerate() {
            let axes = (0..k).map(|j| mass(proposal.axes[i * k + j], sides.low[j], sides.high[j]));
            let wanted: f64 = axes.product();
            // The share of words, thinned by the cost that a candidate of the box has before its axes are drawn.
            let found = cover.mass() * shares[i] as f64 / 2f64.powi(32) * (-proposal.costs[i] / 2.0).exp();
            // Both to 10^-9; and words come one at a time.
            let error = (found - wanted).abs() - 2f64.powi(-32) * cover.mass();
            let cost = proposal.costs[i];
            assert!(
                cost > -1e-12 && error < 1e-9 * wanted,
                "box {i}: {found:e} for {wanted:e}, cost {cost:e}"
            );
            worst = worst.max((found / wanted - 1.0).abs());
        }
        println!("LRV {lrv:?}, covariance x{scale}: odds of {} boxes to {worst:.1e}", cover.len());
        assert!(shares[cover.len()..].iter().all(|&share| share == 0));
    }
}

/// Of the words of a candidate the first chooses the box, one each draws an axis, and the last thins: a word that
/// served two of these would make them depend on each other. Where k + 1 is a multiple of 4, the last begins a block.
#[test]
fn no_word_serves_two_choices() {
    let data = Dataset::new(&[BuiltinTable::Vrhel.table()], Grid::DEFAULT, Extrapolation::Error).unwrap();
    for k in 1..=8 {
        let model = Fit::new(SpectrumKind::Reflectance).components(k).fit(&data).unwrap();
        let program = Program::new(&model, &model.weight_map(25.0));
        let cover = cover_of(&program, 64);
        assert_eq!(cover.proposal().components, k);
        each_word_serves_one_choice(&cover);
    }
}

fn each_word_serves_one_choice(cover: &Cover) {
    let (proposal, k) = (cover.proposal(), cover.proposal().components);
    let propose = |words: &[[u32; 4]]| {
        let mut coordinates = vec![[0.0]; k];
        let [kept] = proposal.propose(&mut coordinates, |block: u32| words[block as usize]);
        (coordinates, kept)
    };
    let mut seen = vec![[false; 2]; 4 * proposal.blocks() as usize];
    for i in 0..1000 {
        let words: Vec<_> = (0..proposal.blocks()).map(|block| Stream::new(9).block(i, 0, block)).collect();
        let (point, kept) = propose(&words);
        for (word, seen) in seen.iter_mut().enumerate().skip(1) {
            // Its ends too: of the last word they keep nearly all that there is, and nearly nothing that costs anything.
            for value in [words[word / 4][word % 4] ^ 0xA5A5_5A5A, 0, !0] {
                let mut changed = words.clone();
                changed[word / 4][word % 4] = value;
                let (other, other_kept) = propose(&changed);
                let moved: Vec<_> = (0..k).filter(|&axis| other[axis] != point[axis]).collect();
                // In an axis as narrow as a rounding error, nothing moves.
                let may_move: &[usize] = if word <= k { &[word - 1] } else { &[] };
                assert!(moved.iter().all(|axis| may_move.contains(axis)), "word {word} moves {moved:?}");
                *seen = [seen[0] | !moved.is_empty(), seen[1] | (kept != other_kept)];
            }
        }
    }
    // Wide intervals alone, as of one axis, cost nothing.
    let is_thinned = proposal.axes.iter().any(|axis| axis[2] < 0.0);
    assert_eq!(is_thinned, k > 1);
    // Every axis moves by its word, and the last word alone, with the axes, says whether a candidate stays.
    for (word, [moves, thins]) in seen.into_iter().enumerate().skip(1) {
        assert_eq!(moves, word <= k, "word {word} of {k} axes");
        assert!(word <= k || thins == (word == k + 1 && is_thinned), "word {word} of {k} axes");
    }
}

/// Whether the spectrum of a point is accepted, in either arithmetic, as src/cpu computes it.
fn is_physical<R: Real>(program: &Program, z: &[R]) -> bool {
    let spectrum: Vec<R> = (0..program.bands())
        .map(|b| {
            let gains = program.spectrum.gain.iter().zip(z);
            gains.fold(R::from_f64(program.spectrum.offset[b]), |sum, (gain, &z)| {
                sum + R::from_f64(gain[b]) * z
            })
        })
        .collect();
    let factor = program.target.as_ref().map_or(R::ONE, |target| {
        let products = target.weights.iter().zip(&spectrum).map(|(&w, &s)| R::from_f64(w) * s);
        R::from_f64(target.lrv.largest()) / products.reduce(|a, b| a + b).unwrap()
    });
    spectrum.iter().all(|&s| s * factor > R::ZERO && s * factor < R::ONE)
}

/// Judges candidates of the same words in both arithmetics; returns the number that f32 judges otherwise, and of all.
fn flips(program: &Program, cover: &Cover, count: u64) -> u64 {
    let program = in_frame(program, cover);
    let (exact, rounded) = (cover.proposal(), cover.proposal().rounded::<f32>());
    let (mut d, mut r) = (vec![[0.0f64]; 6], vec![[0.0f32]; 6]);
    let flipped = (0..count).filter(|&i| {
        let words = |block| Stream::new(3).block(i, 0, block);
        let [kept] = exact.propose(&mut d, words);
        let [kept_rounded] = rounded.propose(&mut r, words);
        let judged = kept && is_physical(&program, d.as_flattened());
        judged != (kept_rounded && is_physical(&program, r.as_flattened()))
    });
    flipped.count() as u64
}

/// The spectrum that f32 judges is the one returned, relative to the centre, so thin regions fare no worse than
/// others.
#[test]
fn single_precision_judges_as_double_does() {
    const CANDIDATES: u64 = 100_000;
    for (lrv, scale, ..) in REGIONS {
        let program = program(lrv, scale);
        let flips = flips(&program, &cover_of(&program, BOXES), CANDIDATES);
        println!("LRV {lrv:?}, covariance x{scale}: {flips} of {CANDIDATES} candidates");
        assert!(flips <= 20);
    }
}

/// Points of a sample, in the coordinates of a cover.
type Points = Vec<Vec<f64>>;

fn accepted(cover: &Cover, proposal: &BoxMixture<f64>, candidates: u64) -> Points {
    let mut d = vec![[0.0]; proposal.components];
    let points = (0..candidates).filter_map(|i| {
        let [kept] = proposal.propose(&mut d, |block| Stream::new(4).block(i, 0, block));
        let point = d.as_flattened();
        (kept && cover.polytope.contains(point)).then(|| point.to_vec())
    });
    points.collect()
}

/// The points that plain rejection accepts, in the coordinates of the cover.
fn plain(cover: &Cover, candidates: u64) -> Points {
    let points = (0..candidates).filter_map(|i| {
        let words = [0, 1].map(|block| Stream::new(5).block(i, 0, block)).concat();
        let z: Vec<f64> = words.chunks_exact(2).flat_map(|w| f64::normal_pair(w[0], w[1])).collect();
        // A rotation of normals is normals.
        let y: Vec<f64> = z.iter().zip(&cover.frame.centre).map(|(z, c)| z - c).collect();
        cover.polytope.contains(&y).then_some(y)
    });
    points.collect()
}

/// A Markov chain on the region: hit and run, with slices of the density (Neal 2003) for the steps along a line. It
/// has in common with covers only the half-spaces.
fn chain(cover: &Cover, points: usize, thinning: usize) -> Points {
    let mut rng = Stream::new(6).rng();
    let uniform = |rng: &mut StreamRng| (f64::from(rng.next_u32()) + 0.5) / 2f64.powi(32);
    let k = cover.polytope.dimensions;
    let centre = cover.frame.centre.as_slice();
    let extent = |axis| {
        let high = cover.boxes.iter().map(|b| b.high[axis]).fold(f64::MIN, f64::max);
        high - cover.boxes.iter().map(|b| b.low[axis]).fold(f64::MAX, f64::min)
    };
    let extents: Vec<f64> = (0..k).map(extent).collect();
    let mut d = vec![0.0; k];
    let mut chain = Vec::new();
    for step in 0..points * thinning {
        let normals = (0..k).map(|_| f64::normal_pair(rng.next_u32(), rng.next_u32())[0]);
        let way: Vec<f64> = normals.zip(&extents).map(|(z, extent)| z * extent).collect();
        let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
        for (row, room) in cover.polytope.rooms.iter().enumerate() {
            let normal = cover.polytope.normal(row);
            let (speed, room) = (simplex::dot(normal, &way), room - simplex::dot(normal, &d));
            match speed > 0.0 {
                true => high = high.min(room / speed),
                false => low = low.max(room / speed),
            }
        }
        // Along the line the density is a normal around `middle`, and what exceeds a height is an interval around it.
        let square = simplex::dot(&way, &way);
        let y: Vec<f64> = d.iter().zip(centre).map(|(d, c)| d + c).collect();
        let middle = -simplex::dot(&y, &way) / square;
        let reach = (middle * middle - 2.0 * uniform(&mut rng).ln() / square).sqrt();
        let (low, high) = (low.max(middle - reach), high.min(middle + reach));
        let t = low + uniform(&mut rng) * (high - low);
        d.iter_mut().zip(&way).for_each(|(d, way)| *d += t * way);
        if step % thinning == 0 {
            chain.push(d.clone());
        }
    }
    chain
}

/// Smallest probability by the Kolmogorov-Smirnov test, over the coordinates and the distance from the mean.
fn agreement(cover: &Cover, a: &Points, b: &Points) -> f64 {
    let distance =
        |point: &Vec<f64>| point.iter().zip(&cover.frame.centre).map(|(d, c)| (d + c).powi(2)).sum::<f64>();
    let with = |points: &Points, value: &dyn Fn(&Vec<f64>) -> f64| -> Vec<f64> {
        let mut values: Vec<f64> = points.iter().map(value).collect();
        values.sort_by(f64::total_cmp);
        values
    };
    let axes = (0..cover.polytope.dimensions).map(|axis| {
        let value = move |point: &Vec<f64>| point[axis];
        kolmogorov_smirnov(&with(a, &value), &with(b, &value))
    });
    axes.chain([kolmogorov_smirnov(&with(a, &distance), &with(b, &distance))]).fold(1.0, f64::min)
}

/// The probability of a distance as large as that of two sorted samples.
fn kolmogorov_smirnov(a: &[f64], b: &[f64]) -> f64 {
    let (mut j, mut distance) = (0, 0f64);
    for (i, value) in a.iter().enumerate() {
        while j < b.len() && b[j] < *value {
            j += 1;
        }
        let [from, to] = [i, i + 1].map(|i| i as f64 / a.len() as f64);
        let share = j as f64 / b.len() as f64;
        distance = distance.max((from - share).abs()).max((to - share).abs());
    }
    let size = (a.len() * b.len()) as f64 / (a.len() + b.len()) as f64;
    let x = distance * (size.sqrt() + 0.12 + 0.11 / size.sqrt());
    let terms = (1..100).map(f64::from).map(|n| (-1f64).powf(n - 1.0) * (-2.0 * n * n * x * x).exp());
    (2.0 * terms.sum::<f64>()).clamp(0.0, 1.0)
}

#[test]
fn a_cover_draws_what_plain_rejection_draws() {
    for (lrv, scale, candidates) in [(Some(0.95), 1.0, 1 << 20), (None, 100.0, 1 << 21)] {
        let cover = cover_of(&program(lrv, scale), BOXES);
        let plain = plain(&cover, candidates);
        let agreement = agreement(&cover, &accepted(&cover, cover.proposal(), 1 << 17), &plain);
        println!("LRV {lrv:?}, covariance x{scale}: {} of plain rejection, {agreement:.2e}", plain.len());
        assert!(agreement > ALARM);
    }
}

/// At p = 4e-8, where plain rejection has nothing to say; and the faults that the comparison is there for.
#[test]
fn a_cover_draws_what_a_markov_chain_draws() {
    let cover = near_white();
    let chain = chain(&cover, 20_000, 50);
    let agreement =
        |proposal: &BoxMixture<f64>| agreement(&cover, &accepted(&cover, proposal, 1 << 18), &chain);
    let sound = agreement(cover.proposal());
    println!("sound: {sound:.2e}");
    assert!(sound > ALARM);

    let mut broken = [(); 3].map(|()| cover.proposal().clone());
    let mut along: Vec<f64> = chain.iter().map(|point| point[0] + cover.frame.centre[0]).collect();
    along.sort_by(f64::total_cmp);
    for (i, sides) in cover.boxes.iter().enumerate() {
        broken[0].axes.swap(6 * i, 6 * i + 1); // two axes are swapped
        if sides.low[0] > along[along.len() * 9 / 10] {
            broken[1].costs[i] = f64::INFINITY; // boxes far out along an axis are left out
        }
    }
    broken[2].axes.iter_mut().for_each(|axis| axis[1] *= 1.3); // hats are too wide
    for (fault, broken) in broken.iter().enumerate() {
        let agreement = agreement(broken);
        println!("fault {fault}: {agreement:.2e}");
        assert!(agreement < ALARM);
    }
}

/// Number of boxes that a point is in.
fn boxes_around(cover: &Cover, point: &[f64]) -> usize {
    let y: Vec<f64> = point.iter().zip(&cover.frame.centre).map(|(d, c)| d + c).collect();
    cover.boxes.iter().filter(|sides| sides.contains(&y)).count()
}

#[test]
fn every_point_of_a_region_is_in_one_box() {
    let wide = cover_of(&program(None, 25.0), BOXES);
    for (cover, points) in
        [(near_white(), chain(&near_white(), 5000, 10)), (wide.clone(), plain(&wide, 200_000))]
    {
        assert!(points.len() > 4000);
        assert!(points.iter().all(|point| boxes_around(&cover, point) == 1));
        let without_one = Cover { boxes: cover.boxes[1..].to_vec(), ..cover };
        assert!(points.iter().any(|point| boxes_around(&without_one, point) == 0));
    }
}

#[test]
fn what_pays_is_what_costs_less() {
    assert!(Cover::could_pay(0.3) && !Cover::could_pay(0.6));
    assert!(Cover::pays(0.28, 8.7e-3) && !Cover::pays(0.89, 0.756));
}

/// A region without corners to cover: of one component, and of none of those there are.
#[test]
fn intervals_and_free_axes_are_covered() {
    let one = |gain| Program::of(SpectrumKind::Reflectance, Affine { offset: vec![0.5; 3], gain });
    // |z| < 2.5, of probability 0.98758.
    let interval = cover_of(&one(vec![vec![0.1, 0.2, -0.1]]), BOXES);
    assert_eq!(interval.len(), 1);
    let free = cover_of(&one(vec![vec![0.1, 0.2, -0.1], vec![0.0; 3]]), BOXES);
    assert_eq!(free.len(), 1);
    for cover in [interval, free] {
        let estimate = cover.estimate(Stream::new(1), 1000);
        assert!(
            estimate.acceptance == 1.0 && (estimate.probability - 0.987_580_7).abs() < 1e-6,
            "{estimate:?}"
        );
    }
}
