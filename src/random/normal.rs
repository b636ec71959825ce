//! Box-Muller transform: two uniform words to two standard normals. GPU twin: `shaders/normal.wgsl`.
//!
//! In f32 the logarithm, sine and cosine are polynomials in + - * alone, the same operations in the same order as in
//! the shader: an adapter that does not fuse multiply and add (Mesa's lavapipe is one) gives the same bits. WGSL's
//! built-in functions promise no more than 2^-21 and 2^-11. In f64 they are the platform's own, so that the oracle
//! shares none of the arithmetic that it judges.
//!
//! The first word x is the uniform u = (x + 1/2) 2^-32 of the radius sqrt(-2 ln u), the second, y, the angle
//! 2 pi (y + 1/2) 2^-32: neither end of either interval is ever reached.
//!
//! Over all 2^32 words (`make exhaustive`) the radius in f32 is off by at most 5.4e-7, and by 1.4e-7 of itself; a sine or
//! cosine by 1.3e-7.

use std::f32::consts::LN_2;
use std::f64::consts::TAU;

use crate::random::log_uniform::exact_uniform;

/// log(1 + t) for t in [sqrt(1/2) - 1, sqrt(2) - 1]. The coefficients are a minimax fit in f64, rounded one by one
/// with the rest fitted again; relative error of the polynomial 3e-8.
#[inline(always)]
pub(crate) fn log1p_reduced(t: f32) -> f32 {
    let mut p = 0.087404214;
    p = p * t - 0.14309816;
    p = p * t + 0.14916772;
    p = p * t - 0.16570035;
    p = p * t + 0.19962157;
    p = p * t - 0.25001785;
    p = p * t + 0.33333948;
    p = p * t - 0.4999999;
    t + t * t * p
}

/// sqrt(-2 ln u) of a word. In the upper half u = 1 - w, and w is what is known exactly: forming u would cancel, and
/// the smallest radii would lose all their digits.
#[inline(always)]
pub(crate) fn radius(x: u32) -> f32 {
    let upper = x >= 0x8000_0000;
    // Below 2^31, so signed: unsigned conversions are not in every vector unit.
    let w = ((if upper { !x } else { x }) as i32 as f32 + 0.5) * 2.3283064e-10; // in (0, 1/2]
    // Lower half: w = (1 + t) 2^e with 1 + t in [sqrt(1/2), sqrt(2)).
    let bits = w.to_bits();
    let exponent = bits.wrapping_sub(0x3F35_04F3) & 0xFF80_0000;
    let lower_t = f32::from_bits(bits.wrapping_sub(exponent)) - 1.0;
    let lower_e = (exponent as i32 >> 23) as f32;
    // Upper half: 1 - w is 1 + t as it stands, or half of it.
    let near_one = w < 0.29289323;
    let upper_t = if near_one { -w } else { 1.0 - 2.0 * w };
    let upper_e = if near_one { 0.0 } else { -1.0 };
    let t = if upper { upper_t } else { lower_t };
    let e = if upper { upper_e } else { lower_e };
    (-2.0 * (e * LN_2 + log1p_reduced(t))).sqrt()
}

/// The cosine and sine of a word. The quarter turn is integer arithmetic, which leaves an angle in [-pi/4, pi/4] for
/// the polynomials; their errors are 1e-10 and 4e-9.
#[inline(always)]
pub(crate) fn circle(y: u32) -> [f32; 2] {
    let quarter = y.wrapping_add(0x2000_0000) >> 30;
    let rest = y.wrapping_sub(quarter << 30) as i32;
    let a = (rest as f32 + 0.5) * 1.4629181e-9;
    let b = a * a;
    let sine = a + a * b * (-0.16666655 + b * (0.008332192 + b * -0.00019518791));
    let cosine = 1.0 - 0.5 * b + b * b * (0.041666646 + b * (-0.0013887301 + b * 2.4430665e-5));
    let odd = quarter & 1 != 0;
    let (x, y) = if odd { (sine, cosine) } else { (cosine, sine) };
    let x_sign = ((quarter + 1) & 2) << 30;
    let y_sign = (quarter & 2) << 30;
    [f32::from_bits(x.to_bits() ^ x_sign), f32::from_bits(y.to_bits() ^ y_sign)]
}

pub(crate) fn exact_radius(x: u32) -> f64 {
    (-2.0 * exact_uniform(x).ln()).sqrt()
}

pub(crate) fn exact_circle(y: u32) -> [f64; 2] {
    let (sine, cosine) = (exact_uniform(y) * TAU).sin_cos();
    [cosine, sine]
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    /// Bounds on the errors, which no word exceeds.
    const RADIUS_ERROR: f64 = 5.4e-7;
    const RADIUS_RELATIVE_ERROR: f64 = 1.4e-7;
    const CIRCLE_ERROR: f64 = 1.3e-7;

    /// Every 1,009th word and both ends of every power of two: 4.3 million.
    fn words() -> impl Iterator<Item = u32> {
        let ends = (0..32).flat_map(|bit| [1u32 << bit, (1 << bit) - 1, !(1 << bit), !((1 << bit) - 1)]);
        (0..u32::MAX).step_by(1009).chain(ends)
    }

    #[test]
    fn the_radius_is_good_to_5_4e_7() {
        let (mut absolute, mut relative) = (0f64, 0f64);
        for x in words() {
            let (value, exact) = (f64::from(radius(x)), exact_radius(x));
            absolute = absolute.max((value - exact).abs());
            relative = relative.max((value - exact).abs() / exact);
        }
        println!("radius: largest error {absolute:.2e} absolute, {relative:.2e} relative");
        assert!(absolute < RADIUS_ERROR && relative < RADIUS_RELATIVE_ERROR, "{absolute:e} {relative:e}");
    }

    #[test]
    fn the_circle_is_good_to_1_3e_7() {
        let mut largest = 0f64;
        for y in words() {
            let ([c, s], [exact_c, exact_s]) = (circle(y), exact_circle(y));
            largest = largest.max((f64::from(c) - exact_c).abs()).max((f64::from(s) - exact_s).abs());
        }
        println!("circle: largest error {largest:.2e}");
        assert!(largest < CIRCLE_ERROR, "{largest:e}");
    }

    /// All 2^32 words; a matter of minutes, and part of `make exhaustive`.
    #[test]
    #[ignore = "takes minutes"]
    fn every_word_has_the_stated_errors() {
        let half = || 0..1u32 << 16;
        let words = || half().into_par_iter().flat_map_iter(|high| half().map(move |low| high << 16 | low));
        let largest = |a: (f64, u32), b: (f64, u32)| if b.0 > a.0 { b } else { a };
        let of = |error: &(dyn Fn(u32) -> f64 + Sync)| {
            words().map(|word| (error(word), word)).reduce(|| (0.0, 0), largest)
        };
        let radius_error = |x| (f64::from(radius(x)) - exact_radius(x)).abs();
        let (absolute, at) = of(&radius_error);
        println!("radius: largest error {absolute:.4e}, at word {at}");
        let (relative, at) = of(&|x| radius_error(x) / exact_radius(x));
        println!("radius: largest relative error {relative:.4e}, at word {at}");
        let (circular, at) = of(&|y| {
            let ([c, s], [exact_c, exact_s]) = (circle(y), exact_circle(y));
            (f64::from(c) - exact_c).abs().max((f64::from(s) - exact_s).abs())
        });
        println!("circle: largest error {circular:.4e}, at word {at}");
        let falls = words().filter(|&x| x > 0 && radius(x) > radius(x - 1)).count();
        println!("radius: rises {falls} times, where it should fall");
        let infinite = words().filter(|&x| !radius(x).is_finite() || radius(x) <= 0.0).count();
        assert_eq!(infinite, 0);
        assert!(absolute < RADIUS_ERROR && relative < RADIUS_RELATIVE_ERROR && circular < CIRCLE_ERROR);
    }

    #[test]
    fn the_ends_are_finite_and_ordered() {
        assert_eq!(radius(0), (66.0 * 2f32.ln()).sqrt()); // u = 2^-33
        assert!(radius(u32::MAX) > 0.0 && radius(u32::MAX) < 1.6e-5);
        for x in (0..u32::MAX - 4099).step_by(4099) {
            assert!(radius(x) >= radius(x + 4099), "{x}");
        }
        assert_eq!(circle(0)[0], 1.0);
    }
}
