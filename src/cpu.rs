//! The draw on the CPU, generic over the arithmetic: in f32 it is the shader's twin, bit for bit where the adapter
//! does not fuse multiply and add; in f64 it is the oracle that both are judged by. The order of operations is
//! part of the definition: what looks like it could be summed another way must not be.

use rayon::prelude::*;

use crate::dataset::Kind;
use crate::normal::Real;
use crate::program::{self, Program, Tally};
use crate::stream::{Draws, Stream};

/// A [`Program`] with its numbers rounded to `R`.
pub(crate) struct Kernel<R> {
    offset: Vec<R>,
    gain: Vec<Vec<R>>,
    target: Option<Target<R>>,
    /// What a physical value is below.
    limit: R,
    tests_base: bool,
    tests_scaled: bool,
    may_exceed_one: bool,
    max_attempts: u32,
}

struct Target<R> {
    lrv: R,
    weights: Vec<R>,
}

impl<R: Real> Kernel<R> {
    pub(crate) fn new(program: &Program) -> Kernel<R> {
        let round = |values: &[f64]| values.iter().map(|&v| R::from_f64(v)).collect();
        let target = |t: &program::Target| Target { lrv: R::from_f64(t.lrv), weights: round(&t.weights) };
        Kernel {
            offset: round(&program.offset),
            gain: program.gain.iter().map(|row| round(row)).collect(),
            target: program.target.as_ref().map(target),
            limit: match program.kind {
                Kind::Illuminant => R::INFINITY,
                Kind::Reflectance => R::ONE,
            },
            tests_base: program.tests_base(),
            tests_scaled: program.tests_scaled(),
            may_exceed_one: program.may_exceed_one(),
            max_attempts: program.max_attempts,
        }
    }

    pub(crate) fn bands(&self) -> usize {
        self.offset.len()
    }

    /// Draw `index` of a stream, into `spectrum`.
    pub(crate) fn draw(&self, stream: Stream, index: u64, spectrum: &mut [R]) -> Tally {
        for attempt in 0..self.max_attempts {
            if let Some(above_one) = self.candidate(|block| stream.block(index, attempt, block), spectrum) {
                return Tally::accepted(attempt + 1, above_one);
            }
        }
        spectrum.fill(R::ZERO);
        Tally::FAILED
    }

    /// All of `draws`, in order, on all cores; `spectra` and `tallies` are exactly as long as they need be.
    pub(crate) fn fill(&self, draws: Draws, spectra: &mut [R], tallies: &mut [Tally]) {
        const CHUNK: usize = 1024;
        let chunks = spectra.par_chunks_mut(CHUNK * self.bands()).zip(tallies.par_chunks_mut(CHUNK));
        chunks.enumerate().for_each(|(chunk, (spectra, tallies))| {
            for (i, (row, tally)) in spectra.chunks_exact_mut(self.bands()).zip(tallies).enumerate() {
                let index = draws.first.wrapping_add((chunk * CHUNK + i) as u64);
                *tally = self.draw(draws.stream, index, row);
            }
        });
    }

    /// The candidate of the words that `block` gives. `None` where it is rejected; else whether scaling took it to 1.
    pub(crate) fn candidate(&self, block: impl FnMut(u32) -> [u32; 4], spectrum: &mut [R]) -> Option<bool> {
        self.reconstruct(block, spectrum);
        if self.tests_base && !self.is_physical(spectrum) {
            return None;
        }
        let Some(target) = &self.target else { return Some(false) };
        let factor = target.lrv / floored(weighted_sum(&target.weights, spectrum));
        spectrum.iter_mut().for_each(|s| *s = *s * factor);
        if self.tests_scaled && !self.is_physical(spectrum) {
            return None;
        }
        Some(self.may_exceed_one && spectrum.iter().any(|&s| s >= R::ONE))
    }

    fn is_physical(&self, spectrum: &[R]) -> bool {
        spectrum.iter().all(|&s| s > R::ZERO && s < self.limit)
    }

    /// offset + gain . z, in the order of the components.
    #[inline]
    fn reconstruct(&self, mut block: impl FnMut(u32) -> [u32; 4], spectrum: &mut [R]) {
        spectrum.copy_from_slice(&self.offset);
        for (b, gains) in self.gain.chunks(4).enumerate() {
            let [w0, w1, w2, w3] = block(b as u32);
            let ([z0, z1], [z2, z3]) = (R::normal_pair(w0, w1), R::normal_pair(w2, w3));
            for (gain, z) in gains.iter().zip([z0, z1, z2, z3]) {
                spectrum.iter_mut().zip(gain).for_each(|(s, &g)| *s = *s + g * z);
            }
        }
    }
}

/// The sum of products, in the order of the bands.
fn weighted_sum<R: Real>(weights: &[R], values: &[R]) -> R {
    let products = weights.iter().zip(values).map(|(&w, &v)| w * v);
    products.reduce(|sum, product| sum + product).unwrap_or(R::ZERO)
}

/// Not below [`Real::FLOOR`], so that it may divide.
fn floored<R: Real>(value: R) -> R {
    if value > R::FLOOR { value } else { R::FLOOR }
}
