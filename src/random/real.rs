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
        (f64::from(x) + 0.5) * 2f64.powi(-32)
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
