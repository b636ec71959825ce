//! The intensity of an illuminant, of one uniform word of its draw. GPU twin: `shaders/level.wgsl`.
//!
//! As with the normals, the exponential in f32 is a polynomial of our own: the shader's twin, to the bit.

use std::f32::consts::LN_2;

use crate::program;
use crate::real::Real;

/// Where the word comes from: block 255 of attempt 0, whichever attempt the draw takes.
pub(crate) const BLOCK: u32 = 255;

/// A [`program::Level`] with its numbers rounded to `R`.
pub(crate) enum Level<R> {
    LogUniform { low: R, octaves: R },
    OneOf(Vec<R>),
}

impl<R: Real> Level<R> {
    pub(crate) fn new(level: &program::Level) -> Level<R> {
        match level {
            program::Level::LogUniform { low, octaves } => {
                Level::LogUniform { low: R::from_f64(*low), octaves: R::from_f64(*octaves) }
            }
            program::Level::OneOf(values) => {
                Level::OneOf(values.iter().map(|&value| R::from_f64(value)).collect())
            }
        }
    }

    #[inline(always)]
    pub(crate) fn of(&self, word: u32) -> R {
        match self {
            Level::LogUniform { low, octaves } => *low * (R::uniform(word) * *octaves).exp2(),
            Level::OneOf(values) => values[((u64::from(word) * values.len() as u64) >> 32) as usize],
        }
    }
}

/// (x + 1/2) 2^-32: in (0, 1], for the last few words round to 1.
#[inline(always)]
pub(crate) fn uniform(word: u32) -> f32 {
    (word as f32 + 0.5) * 2.3283064e-10
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

    #[test]
    fn ends_of_the_range() {
        let level = program::Level::LogUniform { low: 0.15, octaves: 1000f64.log2() };
        let (single, double) = (Level::<f32>::new(&level), Level::<f64>::new(&level));
        for word in [0, 1, 0x8000_0000, u32::MAX] {
            let (a, b) = (f64::from(single.of(word)), double.of(word));
            assert!((a / b - 1.0).abs() < 2e-6, "{a} {b}");
            assert!((0.15..150.0).contains(&b));
        }
        let table = Level::<f32>::new(&program::Level::OneOf(vec![1.0, 2.0, 3.0]));
        assert_eq!([0, 0x5555_5555, 0x5555_5556, u32::MAX].map(|w| table.of(w)), [1.0, 1.0, 2.0, 3.0]);
    }
}
