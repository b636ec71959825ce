//! Bandwidth of normal distributions about measured spectra, by leave-one-out likelihood.
//!
//! What is drawn has a truncated density, so that is judged: within the bounds, the mean over the centres c of
//! `phi((x - a c) / h) / (h^j A(c))`, with `a = sqrt(1 - h^2)` and the acceptance A of the candidates about c. Each
//! spectrum is judged by the others' density (Habbema, Hermans & van den Broek 1974; Duin 1976). Repeated spectra would
//! take h to 0, so a spectrum is judged without its repetitions too.
//!
//! Only the first j components are judged, those that have nearly all of the variance. The others are many and close to
//! normal, and would ask for a bandwidth that smooths the shape of the first ones away.

use super::{Centres, LEAST_ACCEPTANCE, Spread, acceptances};
use crate::cover::HalfSpace;
use crate::threads;

/// The smallest bandwidth that is tried.
const LEAST: f64 = 0.02;

/// Number of bandwidths that are tried first, evenly spaced in their logarithms from [`LEAST`] to 1.
const TRIED: usize = 12;

/// Number of times that the interval about the best is then narrowed, each time to 0.62 of its width: to 1 %.
const NARROWED: usize = 8;

/// The most spectra that are judged, and that judge. Of more, every so many-th is taken, and the bandwidth is
/// made smaller as its asymptotic rate, M^(-1 / (j + 4)), says.
const MOST: usize = 4096;

/// Number of spectra that are worth a thread.
const GRAIN: u64 = 16;

/// Standard deviation of the normal distributions about each spectrum that makes the spectra most likely, in units of
/// theirs, by the first `judged` of k components. `coordinates` has k of each spectrum, in the frame in which their mean is
/// 0 and their covariance 1; it is 1 where fewer than two spectra are within the bounds.
pub(crate) fn bandwidth(coordinates: &[f64], [k, judged]: [usize; 2], half_spaces: &[HalfSpace]) -> f64 {
    let all: Vec<&[f64]> = coordinates.chunks_exact(k).collect();
    let stride = all.len().div_ceil(MOST);
    let spectra: Vec<&[f64]> = all.iter().copied().step_by(stride).collect();
    let within: Vec<&[f64]> =
        spectra.iter().copied().filter(|spectrum| is_within(spectrum, half_spaces)).collect();
    if within.len() < 2 {
        return 1.0;
    }
    let likelihood = |log: f64| log_likelihood(log.exp(), judged, &within, &spectra, half_spaces);
    let place = |i: usize| LEAST.ln() * (1.0 - i as f64 / (TRIED - 1) as f64);
    let tried: Vec<f64> = (0..TRIED).map(|i| likelihood(place(i))).collect();
    let best = (0..TRIED).max_by(|&a, &b| tried[a].total_cmp(&tried[b])).expect("some are tried");
    // Golden section.
    let (mut low, mut high) = (place(best.saturating_sub(1)), place((best + 1).min(TRIED - 1)));
    let golden = (5f64.sqrt() - 1.0) / 2.0;
    let inner = |low: f64, high: f64| [high - golden * (high - low), low + golden * (high - low)];
    let mut points = inner(low, high);
    let mut values = points.map(likelihood);
    for _ in 0..NARROWED {
        if values[0] < values[1] {
            low = points[0];
            points = [points[1], inner(low, high)[1]];
            values = [values[1], likelihood(points[1])];
        } else {
            high = points[1];
            points = [inner(low, high)[0], points[0]];
            values = [likelihood(points[0]), values[0]];
        }
    }
    let found = ((low + high) / 2.0).exp() * (stride as f64).powf(-1.0 / (judged as f64 + 4.0));
    (found * 1e3).round().max(1.0) / 1e3
}

fn is_within(coordinates: &[f64], half_spaces: &[HalfSpace]) -> bool {
    half_spaces
        .iter()
        .all(|bound| bound.normal.iter().zip(coordinates).map(|(gain, z)| gain * z).sum::<f64>() < bound.room)
}

/// The sum of the logarithms of the density at each spectrum within the bounds, by the other spectra.
fn log_likelihood(
    bandwidth: f64,
    judged: usize,
    within: &[&[f64]],
    spectra: &[&[f64]],
    half_spaces: &[HalfSpace],
) -> f64 {
    let shrinkage = (1.0 - bandwidth * bandwidth).max(0.0).sqrt();
    let components = spectra[0].len();
    let centres = Centres {
        coordinates: spectra.iter().flat_map(|c| c.iter().map(|c| shrinkage * c)).collect(),
        spread: Spread::Same(bandwidth),
        shares: vec![1.0; spectra.len()],
        components,
    };
    let acceptances = acceptances(&centres, half_spaces);
    let per_variance = -0.5 / (bandwidth * bandwidth);
    let log_of = |number: u64| {
        let spectrum = within[number as usize];
        let (mut others, mut terms) = (0.0, Vec::with_capacity(spectra.len()));
        let places = centres.coordinates.chunks_exact(components);
        for ((other, place), acceptance) in spectra.iter().zip(places).zip(&acceptances) {
            if other == &spectrum || *acceptance < LEAST_ACCEPTANCE {
                continue;
            }
            let distance: f64 = place[..judged].iter().zip(spectrum).map(|(c, x)| (x - c) * (x - c)).sum();
            others += 1.0;
            terms.push(per_variance * distance - acceptance.ln());
        }
        let largest = terms.iter().copied().fold(f64::NEG_INFINITY, f64::max);
        if largest == f64::NEG_INFINITY {
            return 0.0; // nothing to judge it by: all spectra are alike
        }
        // Terms of less than 1e-16 of the largest add nothing.
        let near = terms.into_iter().map(|term| term - largest).filter(|term| *term > -37.0);
        largest + (near.map(f64::exp).sum::<f64>() / others).ln()
    };
    let logs = threads::map(within.len() as u64, GRAIN, log_of);
    logs.iter().sum::<f64>() - (within.len() * judged) as f64 * bandwidth.ln()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::real::Real;
    use crate::random::stream::Stream;

    fn normal(count: u64) -> Vec<f64> {
        let stream = Stream::named(1, "bandwidth");
        (0..count).map(|i| f64::normal_pair(stream.block(i, 0, 0)[0], stream.block(i, 0, 0)[1])[0]).collect()
    }

    /// Of normal data the best estimate is the Gaussian; of two narrow clusters, about their width.
    #[test]
    fn data_say_how_far_they_are_from_normal() {
        let values = normal(400);
        assert!(bandwidth(&values, [1, 1], &[]) > 0.35);
        let clusters: Vec<f64> = values
            .iter()
            .enumerate()
            .map(|(i, z)| if i % 2 == 0 { 0.999 } else { -0.999 } + 0.03 * z)
            .collect();
        let found = bandwidth(&clusters, [1, 1], &[]);
        assert!((0.005..0.04).contains(&found), "{found}");
    }

    #[test]
    fn repetitions_do_not_take_it_to_zero() {
        let values = normal(300);
        let repeated: Vec<f64> = values.iter().chain(&values).copied().collect();
        let (once, twice) = (bandwidth(&values, [1, 1], &[]), bandwidth(&repeated, [1, 1], &[]));
        assert!((once - twice).abs() < 0.02, "{once} {twice}");
        assert_eq!(bandwidth(&[0.5; 8], [1, 1], &[]), bandwidth(&[0.5; 9], [1, 1], &[]));
    }

    /// The formula above, as NumPy has it: of both components, of the first alone, and of a narrow spread, where all but
    /// the nearest term are nothing.
    #[test]
    fn the_likelihood_is_that_of_the_formula() {
        let spectra = [[0.3, -1.2], [1.1, 0.4], [-0.7, 0.9], [2.0, 0.1]];
        let spectra: Vec<&[f64]> = spectra.iter().map(<[f64; 2]>::as_slice).collect();
        for (bandwidth, judged, expected) in
            [(0.5, 2, -13.640101439212167), (0.5, 1, -6.42427601972722), (0.02, 2, -10583.498461150455)]
        {
            let found = log_likelihood(bandwidth, judged, &spectra, &spectra, &[]);
            assert!((found / expected - 1.0).abs() < 1e-12, "{bandwidth} {judged}: {found}");
        }
    }

    #[test]
    fn one_spectrum_says_nothing_of_its_spread() {
        assert_eq!(bandwidth(&[0.5], [1, 1], &[]), 1.0);
        assert!(bandwidth(&[1.0, 1.01], [1, 1], &[]) < 0.5);
    }

    /// Of twice as many spectra every second is judged, and the bandwidth is smaller by 2^(1/5).
    #[test]
    fn more_spectra_than_are_judged_have_a_smaller_bandwidth() {
        let values = normal(2 * MOST as u64);
        let second: Vec<f64> = values.iter().copied().step_by(2).collect();
        let (all, some) = (bandwidth(&values, [1, 1], &[]), bandwidth(&second, [1, 1], &[]));
        assert!((all / some - 2f64.powf(-0.2)).abs() < 3e-3, "{all} {some}");
    }

    /// A bound that cuts the data's density at its mode: what is judged is what is left of each normal distribution, so
    /// the bandwidth is about that of the same data without the bound, mirrored.
    #[test]
    fn the_truncated_density_is_judged() {
        let half: Vec<f64> = normal(600).into_iter().map(f64::abs).collect();
        let bound = [HalfSpace::new(0, vec![-1.0], 0.0)];
        let (bounded, free) = (bandwidth(&half, [1, 1], &bound), bandwidth(&half, [1, 1], &[]));
        assert!(bounded > 1.2 * free, "{bounded} {free}");
    }
}
