//! Intensity of an illuminant, from one uniform word of its draw.

use crate::program::IntensityLaw;
use crate::random::real::Real;

impl IntensityLaw {
    /// The law with its numbers rounded to `R`.
    pub(crate) fn rounded<R: Real>(&self) -> IntensityLaw<R> {
        match self {
            IntensityLaw::LogUniform { low, octaves } => {
                IntensityLaw::LogUniform { low: R::from_f64(*low), octaves: R::from_f64(*octaves) }
            }
            IntensityLaw::OneOf(values) => {
                IntensityLaw::OneOf(values.iter().map(|&value| R::from_f64(value)).collect())
            }
        }
    }
}

impl<R: Real> IntensityLaw<R> {
    #[inline(always)]
    pub(crate) fn of(&self, word: u32) -> R {
        match self {
            IntensityLaw::LogUniform { low, octaves } => *low * (R::uniform(word) * *octaves).exp2(),
            IntensityLaw::OneOf(values) => values[((u64::from(word) * values.len() as u64) >> 32) as usize],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ends_of_the_range() {
        let law = IntensityLaw::<f64>::LogUniform { low: 0.15, octaves: 1000f64.log2() };
        let (single, double) = (law.rounded::<f32>(), law);
        for word in [0, 1, 0x8000_0000, u32::MAX] {
            let (a, b) = (f64::from(single.of(word)), double.of(word));
            assert!((a / b - 1.0).abs() < 2e-6, "{a} {b}");
            assert!((0.15..150.0).contains(&b));
        }
        let table = IntensityLaw::<f64>::OneOf(vec![1.0, 2.0, 3.0]).rounded::<f32>();
        assert_eq!([0, 0x5555_5555, 0x5555_5556, u32::MAX].map(|w| table.of(w)), [1.0, 1.0, 2.0, 3.0]);
    }
}
