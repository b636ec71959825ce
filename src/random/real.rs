//! Number types in which draws are computed: f32, as in the shader, or f64, for the oracle that judges both.

use std::ops::{Add, Div, Mul};

use super::log_uniform;
use crate::random::normal::{circle, exact_circle, exact_radius, radius};
use crate::random::truncated;

/// A floating-point type that draws can be computed in: f32, the shader's twin, or f64, its oracle.
pub trait Real: DrawOperations {
    /// Two independent standard normals of two independent uniform words.
    fn normal_pair(x: u32, y: u32) -> [Self; 2];
}

/// Operations of a draw, in a trait of its own that seals [`Real`]: only f32 and f64 have it.
pub trait DrawOperations:
    Copy + PartialOrd + Add<Output = Self> + Mul<Output = Self> + Div<Output = Self> + Send + Sync + 'static
{
    /// Zero.
    const ZERO: Self;
    /// One.
    const ONE: Self;
    /// Infinity.
    const INFINITY: Self;
    /// Smallest divisor, in place of one that might not be positive.
    const FLOOR: Self;
    /// The nearest value of this type.
    fn from_f64(value: f64) -> Self;
    /// The uniform number (x + 1/2) 2^-32 of a word.
    fn uniform(x: u32) -> Self;
    /// 2 to a power between 0 and 126.
    fn exp2(self) -> Self;
    /// A coordinate of a box from a uniform word, relative to a centre, and its cost. The four numbers of an axis and
    /// the cost are those of `src/random/truncated.rs`.
    fn truncated(axis: [Self; 4], word: u32) -> [Self; 2];
    /// -2 ln u of a uniform word u: a chi-square of two degrees of freedom.
    fn chi_square(word: u32) -> Self;
}

impl Real for f32 {
    #[inline(always)]
    fn normal_pair(x: u32, y: u32) -> [f32; 2] {
        let r = radius(x);
        circle(y).map(|v| r * v)
    }
}

impl DrawOperations for f32 {
    const ZERO: f32 = 0.0;
    const ONE: f32 = 1.0;
    const INFINITY: f32 = f32::INFINITY;
    const FLOOR: f32 = 1e-30;

    fn from_f64(value: f64) -> f32 {
        value as f32
    }

    #[inline(always)]
    fn uniform(x: u32) -> f32 {
        log_uniform::uniform(x)
    }

    #[inline(always)]
    fn exp2(self) -> f32 {
        log_uniform::exp2(self)
    }

    #[inline(always)]
    fn truncated(axis: [f32; 4], word: u32) -> [f32; 2] {
        truncated::truncated(axis, word)
    }

    #[inline(always)]
    fn chi_square(word: u32) -> f32 {
        truncated::chi_square(word)
    }
}

impl Real for f64 {
    fn normal_pair(x: u32, y: u32) -> [f64; 2] {
        let r = exact_radius(x);
        exact_circle(y).map(|v| r * v)
    }
}

impl DrawOperations for f64 {
    const ZERO: f64 = 0.0;
    const ONE: f64 = 1.0;
    const INFINITY: f64 = f64::INFINITY;
    const FLOOR: f64 = 1e-30;

    fn from_f64(value: f64) -> f64 {
        value
    }

    fn uniform(x: u32) -> f64 {
        log_uniform::exact_uniform(x)
    }

    fn exp2(self) -> f64 {
        f64::exp2(self)
    }

    fn truncated(axis: [f64; 4], word: u32) -> [f64; 2] {
        truncated::exact_truncated(axis, word)
    }

    fn chi_square(word: u32) -> f64 {
        truncated::exact_chi_square(word)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Words, and their normals and chi-square in 40 digits.
    #[test]
    fn the_oracle_is_right_to_the_last_digits() {
        let table = [
            ([0, 0], [6.763705635001895, 4.947373628142719e-9], 45.74771391695639),
            ([0x1234_5678, 0x9ABC_DEF0], [-1.8217534546447058, -1.4029389548741235], 5.287023360613218),
            ([0x9ABC_DEF0, 0x4000_0000], [-7.339749715792703e-10, 1.0034396074275749], 1.0068910457544056),
            ([!0, !0], [1.525878906294409e-5, -1.1161179193952455e-14], 2.3283064366742216e-10),
        ];
        for ([x, y], normals, chi_square) in table {
            // An angle near a multiple of pi/2 has the absolute error of its own rounding.
            for (value, exact) in f64::normal_pair(x, y).into_iter().zip(normals) {
                assert!((value - exact).abs() <= 1e-15 * exact_radius(x), "{x:#x} {y:#x}: {value} {exact}");
            }
            assert!((f64::chi_square(x) / chi_square - 1.0).abs() < 1e-15, "{x:#x}");
        }
    }
}
