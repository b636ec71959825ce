//! The factor that scales reflectances to their target luminous reflectance, which may be each draw's own.

use super::acceptance::least;
use super::{floored, round};
use crate::program::{self, LrvLaw};
use crate::random::real::Real;

/// A [`program::LrvTarget`] with its numbers rounded to `R`.
pub(super) struct LrvTarget<R> {
    lrv: LrvLaw<R>,
    weights: Vec<R>,
}

impl<R: Real> LrvTarget<R> {
    pub(super) fn new(target: &program::LrvTarget) -> LrvTarget<R> {
        LrvTarget { lrv: target.lrv.rounded(), weights: round(&target.weights) }
    }

    /// The targets of draws, of a word of each.
    #[inline(always)]
    pub(super) fn of<const L: usize>(&self, words: &[u32; L]) -> [R; L] {
        let mut lrv = [R::ZERO; L];
        for l in 0..L {
            lrv[l] = self.lrv.of(words[l]);
        }
        lrv
    }

    /// Factor that scales spectra to their targets.
    #[inline(always)]
    pub(super) fn factor<const L: usize>(&self, spectrum: &[[R; L]], targets: &[R; L]) -> [R; L] {
        let mut lrv = [R::ZERO; L];
        for (b, (&weight, s)) in self.weights.iter().zip(spectrum).enumerate() {
            for l in 0..L {
                let product = weight * s[l];
                lrv[l] = if b == 0 { product } else { lrv[l] + product }; // in the order of the bands
            }
        }
        for l in 0..L {
            lrv[l] = targets[l] / floored(lrv[l]);
        }
        lrv
    }
}

impl LrvLaw {
    /// The law with its numbers rounded to `R`.
    pub(crate) fn rounded<R: Real>(&self) -> LrvLaw<R> {
        match *self {
            LrvLaw::Fixed(lrv) => LrvLaw::Fixed(R::from_f64(lrv)),
            LrvLaw::Uniform { low, span, high } => {
                LrvLaw::Uniform { low: R::from_f64(low), span: R::from_f64(span), high: R::from_f64(high) }
            }
        }
    }
}

impl<R: Real> LrvLaw<R> {
    /// The target of the draw that the word is of. Never above the highest, at which the recipe was tried.
    #[inline(always)]
    fn of(&self, word: u32) -> R {
        match *self {
            LrvLaw::Fixed(lrv) => lrv,
            LrvLaw::Uniform { low, span, high } => least(low + span * R::uniform(word), high),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_the_range() {
        let law = LrvLaw::uniform(0.2, 0.6);
        let (single, double) = (law.rounded::<f32>(), law.rounded::<f64>());
        for word in [0, 1, 0x8000_0000, u32::MAX] {
            let (a, b) = (single.of(word), double.of(word));
            assert!((f64::from(a) - b).abs() < 1e-7, "{a} {b}");
            assert!((0.2f32..=0.6).contains(&a) && 0.2 < b && b < 0.6, "{a} {b}");
        }
        assert_eq!([0, u32::MAX].map(|word| single.of(word)), [0.2, 0.6]);
        assert_eq!(double.of(0x8000_0000), 0.2 + (0.6 - 0.2) * (0.5 + 0.5f64.powi(33)));
    }

    /// No sum exceeds the upper end, even where f32 has no room between the ends: those that round past it stay at
    /// it.
    #[test]
    fn no_target_is_above_the_range() {
        for step in 0..2000 {
            let low = 1e-3 + 3.7e-4 * f64::from(step);
            for width in [1e-9, 1e-7, 3.3e-7, 0.1] {
                let law = LrvLaw::uniform(low, low + width).rounded::<f32>();
                for word in [0, 0x7FFF_FFFF, u32::MAX - 200, u32::MAX] {
                    assert!((low as f32..=(low + width) as f32).contains(&law.of(word)), "{low} {width}");
                }
            }
        }
    }
}
