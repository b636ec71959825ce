//! A coordinate of a box: a uniform word to a standard normal between two ends, or to the exponential that hugs it
//! from above. GPU twin: `shaders/truncated.wgsl`.
//!
//! The inverse of the normal's distribution function serves wide intervals. Its error is absolute, 5e-7, so in a
//! narrow interval it would leave gaps; there the density is nearly an exponential, which is drawn to a relative
//! error of 3e-7 and thinned to the normal. An axis is four numbers:
//!
//! - wide: the probability above the interval, that below it, that of the interval, and -centre. The coordinate is the
//!   quantile of a share of the interval; it costs nothing.
//! - narrow: start - slope, -1 / slope, -(1 - exp(-|slope| width)) and slope - centre, for a hat proportional to
//!   exp(-slope y) that falls from its start. Where the coordinate before centring is y, it costs (y - slope)^2:
//!   the density over the hat is exp(-cost / 2), and the slope lies within the interval, so the hat touches it.
//!
//! A candidate stays if the sum of its costs is below [`Real::chi_square`] of one more word. Coordinates are relative
//! to a centre that is subtracted in f64 beforehand, so that thin regions far from the mean keep their digits.
//!
//! In f32 all of it is + - * / and sqrt; in f64 it is the platform's own functions (see [`crate::random::normal`]).

use std::f32::consts::LN_2;
use std::f64::consts::{PI, SQRT_2};

use crate::random::log_uniform::exact_uniform;
use crate::random::normal::{log1p_reduced, radius};
#[cfg(doc)]
use crate::random::real::Real;

/// The two tails of a word: u and 1 - u, u = (x + 1/2) 2^-32. The smaller is exact to the last bit, so neither is
/// ever 0.
#[inline(always)]
fn tails(x: u32) -> [f32; 2] {
    let upper = x >= 0x8000_0000;
    // Below 2^31, so signed: unsigned conversions are not in every vector unit.
    let w = ((if upper { !x } else { x }) as i32 as f32 + 0.5) * 2.3283064e-10; // in (0, 1/2]
    if upper { [1.0 - w, w] } else { [w, 1.0 - w] }
}

/// log p, where p + q = 1: near p = 1 it is q that is known exactly.
#[inline(always)]
fn log_of(p: f32, q: f32) -> f32 {
    let near_one = q < 0.29289323;
    let bits = p.to_bits();
    let exponent = bits.wrapping_sub(0x3F35_04F3) & 0xFF80_0000;
    let t = if near_one { -q } else { f32::from_bits(bits.wrapping_sub(exponent)) - 1.0 };
    let e = if near_one { 0.0 } else { (exponent as i32 >> 23) as f32 };
    e * LN_2 + log1p_reduced(t)
}

/// The normal that has the probability `lower` below it and `upper` above it; `log` is that of the smaller. Two
/// rational functions with positive coefficients (the form of Wichura's algorithm AS 241), minimax fits with relative
/// errors of 5e-8 in the centre and 8e-8 in the tails, down to 1e-22.
#[inline(always)]
fn quantile(lower: f32, upper: f32, log: f32) -> f32 {
    let x = lower - upper;
    let central = x.abs() <= 0.85;
    let select = |tail: f32, centre: f32| if central { centre } else { tail };
    let v = select((-log).sqrt() - 1.5, 0.7225 - x * x);
    let scale = select(if x < 0.0 { -1.0 } else { 1.0 }, x);
    let mut n = select(0.20628026, 0.46179056);
    n = n * v + select(1.4338166, 4.9778395);
    n = n * v + select(2.7394726, 6.3042803);
    n = n * v + select(1.2513746, 1.6935664);
    let mut d = select(1.142422e-5, 1.049803);
    d = d * v + select(0.14548507, 4.9223533);
    d = d * v + select(0.80339384, 4.47379);
    d = d * v + 1.0;
    scale * n / d
}

/// [`Real::truncated`] of the shader's twin.
#[inline(always)]
pub(crate) fn truncated(axis: [f32; 4], word: u32) -> [f32; 2] {
    let [u, v] = tails(word);
    let hat = axis[2] < 0.0;
    let mass = axis[2].abs();
    let upper = (if hat { 1.0 - mass } else { axis[0] }) + v * mass;
    let lower = (if hat { 0.0 } else { axis[1] }) + u * mass;
    let swap = !hat && lower < upper;
    let log = log_of(if swap { lower } else { upper }, if swap { upper } else { lower });
    let y = if hat { axis[0] + axis[1] * log } else { quantile(lower, upper, log) };
    [y + axis[3], if hat { y * y } else { 0.0 }]
}

/// [`Real::chi_square`] of the shader's twin.
#[inline(always)]
pub(crate) fn chi_square(x: u32) -> f32 {
    let r = radius(x);
    r * r
}

fn exact_tails(x: u32) -> [f64; 2] {
    [x, !x].map(exact_uniform)
}

/// [`Real::truncated`] of the oracle.
pub(crate) fn exact_truncated(axis: [f64; 4], word: u32) -> [f64; 2] {
    let [u, v] = exact_tails(word);
    let [start, step, mass, shift] = axis;
    if mass < 0.0 {
        let q = u * -mass;
        let log = if q < 0.25 { (-q).ln_1p() } else { (1.0 + mass + v * -mass).ln() };
        let y = start + step * log;
        return [y + shift, y * y];
    }
    let [above, below, ..] = axis;
    [exact_quantile(below + u * mass, above + v * mass) + shift, 0.0]
}

/// [`Real::chi_square`] of the oracle.
pub(crate) fn exact_chi_square(x: u32) -> f64 {
    -2.0 * exact_uniform(x).ln()
}

/// Newton's method on the smaller tail, from the f32 value: each step squares an error of 5e-6 or less.
fn exact_quantile(lower: f64, upper: f64) -> f64 {
    let tail = lower.min(upper);
    let mut y = -f64::from(quantile(tail as f32, (1.0 - tail) as f32, tail.ln() as f32));
    for _ in 0..2 {
        y += (0.5 * libm::erfc(y / SQRT_2) - tail) * (2.0 * PI).sqrt() * (y * y / 2.0).exp();
    }
    if lower < upper { -y } else { y }
}

#[cfg(test)]
mod tests {
    use statrs::distribution::{ContinuousCDF, Normal};

    use super::*;

    /// Every 4,099th word and both ends of every power of two.
    fn words() -> impl Iterator<Item = u32> {
        let ends = (0..32).flat_map(|bit| [1u32 << bit, (1 << bit) - 1, !(1 << bit), !((1 << bit) - 1)]);
        (0..u32::MAX).step_by(4099).chain(ends)
    }

    #[test]
    fn the_quantile_is_good_to_5e_7() {
        let (mut largest, mut of_oracle) = (0f64, 0f64);
        for x in words().filter(|&x| x != 0x8000_0000 && x != 0x7FFF_FFFF) {
            let ([u, v], [lower, upper]) = (tails(x), exact_tails(x));
            let exact = exact_quantile(lower, upper);
            let value = quantile(u, v, log_of(u.min(v), u.max(v)));
            largest = largest.max((f64::from(value) - exact).abs() / exact.abs().max(1.0));
            if (x >> 12) % 64 == 0 {
                let reference = Normal::standard().inverse_cdf(lower.min(upper)).copysign(exact);
                of_oracle = of_oracle.max((exact - reference).abs() / exact.abs().max(1.0));
            }
        }
        println!("quantile: largest error {largest:.2e}, the oracle's beside statrs {of_oracle:.2e}");
        assert!(largest < 5e-7 && of_oracle < 1e-14, "{largest:e} {of_oracle:e}");
    }

    #[test]
    fn the_quantile_reaches_far_into_the_tails() {
        for (tail, exact) in
            [(1e-12, 7.034483825301131), (1e-16, 8.222082216130435), (1e-20, 9.262340089798409)]
        {
            let value = quantile(1.0, tail as f32, log_of(tail as f32, 1.0));
            assert!((f64::from(value) / exact - 1.0).abs() < 5e-7, "{tail:e}: {value}");
            assert!((exact_quantile(1.0 - tail, tail) / exact - 1.0).abs() < 1e-12);
            assert_eq!(quantile(tail as f32, 1.0, log_of(tail as f32, 1.0)), -value);
        }
    }

    /// A uniform share of what lies between two ends, both ways of which may be the shorter tail.
    #[test]
    fn wide_intervals_are_shared_out_by_the_distribution_function() {
        let below = |x: f64| 0.5 * libm::erfc(-x / SQRT_2);
        for ([low, high], shift) in [([-1.5, 0.5], 0.25), ([0.1, 3.0], -2.0), ([-6.0, -1.0], 0.0)] {
            let axis = [below(-high), below(low), below(high) - below(low), shift];
            for x in words().step_by(997) {
                let [exact, cost] = exact_truncated(axis, x);
                let share = (below(exact - shift) - below(low)) / axis[2];
                assert!(
                    (share - exact_uniform(x)).abs() < 1e-13 && cost == 0.0,
                    "{low} to {high}, {x}: {share}"
                );
                let [value, cost] = truncated(axis.map(|v| v as f32), x);
                assert!(
                    (f64::from(value) - exact).abs() < 2e-6 && cost == 0.0,
                    "{low} to {high}, {x}: {value}"
                );
            }
        }
    }

    /// Shares of an interval of any width; the logarithm's relative error is that of a step along a hat.
    #[test]
    fn logarithms_keep_their_digits_near_1() {
        let mut largest = 0f64;
        for (x, mass) in words().zip([1.0, 0.999, 0.5, 1e-2, 1e-6, 1e-20].into_iter().cycle()) {
            let axis = [0.0, 1.0, -mass, 0.0];
            let [exact, _] = exact_truncated(axis, x);
            let [value, cost] = truncated(axis.map(|v| v as f32), x);
            assert!(value < 0.0 && cost >= 0.0);
            // The end of an interval that is nearly all of the exponential's is off by the rounding of its mass.
            if mass != 0.999 {
                largest = largest.max((f64::from(value) / exact - 1.0).abs());
            }
        }
        println!("logarithm: largest relative error {largest:.2e}");
        assert!(largest < 4e-7, "{largest:e}");
    }

    #[test]
    fn tails_are_never_0_and_sum_to_1() {
        for x in words() {
            let ([u, v], [exact_u, exact_v]) = (tails(x), exact_tails(x));
            assert!(u > 0.0 && v > 0.0 && u + v == 1.0, "{x}");
            for (value, exact) in [(u, exact_u), (v, exact_v)] {
                assert!((f64::from(value) / exact - 1.0).abs() < 1.2e-7);
            }
            let thinned = f64::from(chi_square(x)) / exact_chi_square(x) - 1.0;
            assert!(thinned.abs() < 5e-7, "{x}: {thinned}");
        }
    }
}
