//! Uniform numbers and powers of two, from which log-uniform numbers are made. GPU twin: `shaders/log_uniform.wgsl`.
//!
//! As with the normals, the exponential in f32 is a polynomial of our own: the shader's twin, to the bit.

use std::f32::consts::LN_2;

/// The uniform number (x + 1/2) 2^-32 of a word, in (0, 1]: for the last few words it rounds to 1.
#[inline(always)]
pub(crate) fn uniform(word: u32) -> f32 {
    (word as f32 + 0.5) * 2.3283064e-10
}

/// [`uniform`] in f64, which has its 33 bits exactly, so that the logarithm of one near 1 keeps its digits.
pub(crate) fn exact_uniform(word: u32) -> f64 {
    (f64::from(word) + 0.5) * 2f64.powi(-32)
}

/// 2^t for t in [0, 126]; the relative error of the polynomial is 1.4e-8.
#[inline(always)]
pub(crate) fn exp2(t: f32) -> f32 {
    let whole = (t + 0.5) as i32;
    let r = t - whole as f32;
    let mut p = 0.00015812136;
    p = p * r + 0.0013411191;
    p = p * r + 0.009617189;
    p = p * r + 0.055503115;
    p = p * r + 0.2402265;
    p = p * r + LN_2;
    (1.0 + r * p) * f32::from_bits(((whole + 127) as u32) << 23)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_of_two() {
        let worst = (0..=1_260_000)
            .map(|i| i as f32 * 1e-4)
            .map(|t| (f64::from(exp2(t)) / f64::from(t).exp2() - 1.0).abs())
            .fold(0.0, f64::max);
        println!("exp2: largest relative error {worst:.1e}");
        assert!(worst < 1.5e-7, "{worst:e}");
        assert_eq!([exp2(0.0), exp2(1.0), exp2(126.0)], [1.0, 2.0, 2f32.powi(126)]);
    }
}
