//! The test of candidates: whether their spectra are physical, before scaling, after it or both. GPU twin:
//! `src/wgsl/acceptance.rs`.

#![allow(clippy::needless_range_loop)] // a lane is an index, of several arrays at once

use super::{Candidates, Kernel, Unit, Value, Verdicts, floored};
use crate::random::real::Real;

impl<R: Real> Kernel<R> {
    /// Makes the candidates that were proposed, each with the word of its draw's own if one is read, and judges those
    /// that were kept.
    #[inline(always)]
    pub(super) fn judge<const L: usize>(
        &self,
        candidates: &mut Candidates<R, L>,
        kept: [bool; L],
        word: [u32; L],
    ) -> Verdicts<L> {
        self.spectrum.apply(&candidates.normals, &mut candidates.spectrum);
        let physical = Range::of(&candidates.spectrum);
        let mut verdicts = Verdicts { accepted: kept, above_one: [false; L] };
        // A loop, as everywhere here: array::from_fn and map may stay calls, which no lane code survives.
        for l in 0..L {
            verdicts.accepted[l] &= physical.is_within(l, self.limit);
        }
        if let Some(target) = &self.target {
            candidates.target_lrv = target.of(&word);
            candidates.scale = target.factor(&candidates.spectrum, &candidates.target_lrv);
            for l in 0..L {
                let peak = physical.high[l] * candidates.scale[l];
                verdicts.accepted[l] &= !self.tests_scaled || peak < R::ONE;
                verdicts.above_one[l] = self.may_exceed_one && peak >= R::ONE;
            }
        } else if let Some(law) = &self.intensity {
            for l in 0..L {
                candidates.scale[l] = law.of(word[l]);
            }
        }
        for (output, mapped) in self.outputs.iter().zip(&mut candidates.maps) {
            let Value::Map(map, unit) = &output.value else { continue };
            map.apply(&candidates.normals, &mut mapped.values);
            match unit {
                Unit::One => {}
                Unit::Scale => mapped.unit = candidates.scale,
                Unit::Over(over) => {
                    let mut values = [[R::ZERO; L]; 4];
                    over.apply(&candidates.normals, &mut values);
                    for l in 0..L {
                        mapped.unit[l] = R::ONE / floored(values[0][l]);
                    }
                }
            }
        }
        verdicts
    }
}

#[inline(always)]
pub(super) fn least<R: Real>(a: R, b: R) -> R {
    if b < a { b } else { a }
}

#[inline(always)]
fn largest<R: Real>(a: R, b: R) -> R {
    if b > a { b } else { a }
}

/// Smallest and largest value of each lane.
struct Range<R, const L: usize> {
    low: [R; L],
    high: [R; L],
}

impl<R: Real, const L: usize> Range<R, L> {
    /// Range of values, four by four: a comparison waits for the last.
    #[inline(always)]
    fn of(values: &[[R; L]]) -> Self {
        let mut range = Range { low: [R::INFINITY; L], high: [R::ZERO; L] };
        for [a, b, c, d] in values.as_chunks::<4>().0 {
            for l in 0..L {
                range.low[l] = least(range.low[l], least(least(a[l], b[l]), least(c[l], d[l])));
                range.high[l] = largest(range.high[l], largest(largest(a[l], b[l]), largest(c[l], d[l])));
            }
        }
        range
    }

    /// Whether all values of a lane are positive and below `limit`.
    #[inline(always)]
    fn is_within(&self, lane: usize, limit: R) -> bool {
        (self.low[lane] > R::ZERO) & (self.high[lane] < limit)
    }
}
