//! The draw on the CPU, generic over the arithmetic: in f32 it is the shader's twin, bit for bit where the adapter
//! neither fuses multiply and add nor rounds division and roots its own way; in f64 it is the oracle that both are
//! judged by. The order of operations is part of the definition: what looks like it could be summed another way must
//! not be.
//!
//! Candidates are made in lanes: L of them at a time, each step in a loop over lanes that the compiler turns into
//! vector instructions. A lane works on one draw, and takes the next one when it is done, so none waits for its
//! neighbours' retries. With one lane this is the plain scalar draw; there is no other. [`fill`] is compiled for
//! several levels of instructions, of which the best is chosen at run time; multiplications and additions are never
//! fused, so all of them give the same bytes.

use multiversion::multiversion;
use rayon::prelude::*;

use crate::dataset::Kind;
use crate::normal::Real;
use crate::program::{self, Program, Tally};
use crate::stream::{self, Draws, Stream};

/// How many lanes the f32 engine has: a vector register of AVX-512, two of AVX2.
const LANES: usize = 16;

/// How many draws a core takes at once, at most: enough that lanes which idle at the end do not count.
const CHUNK: usize = 4096;

/// A [`Program`] with its numbers rounded to `R`.
pub(crate) struct Kernel<R> {
    offset: Vec<R>,
    /// What each standard normal adds, band by band: k values for each.
    gain: Vec<R>,
    components: usize,
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

/// The candidates that are being made, a lane each.
struct Candidates<R, const L: usize> {
    normals: Vec<[R; L]>,
    spectrum: Vec<[R; L]>,
}

impl<R: Real, const L: usize> Candidates<R, L> {
    /// Copies the spectrum of a lane. By fours, and not inlined: with AVX-512 LLVM would make gathers of it, at
    /// several times the cost of plain loads.
    #[inline(never)]
    fn copy(&self, lane: usize, row: &mut [R]) {
        let (from, from_rest) = self.spectrum.as_chunks::<4>();
        let (to, to_rest) = row.as_chunks_mut::<4>();
        for (to, from) in to.iter_mut().zip(from) {
            *to = [from[0][lane], from[1][lane], from[2][lane], from[3][lane]];
        }
        for (to, from) in to_rest.iter_mut().zip(from_rest) {
            *to = from[lane];
        }
    }
}

/// What candidates came to, a lane each.
struct Verdicts<const L: usize> {
    accepted: [bool; L],
    above_one: [bool; L],
}

impl<R: Real> Kernel<R> {
    pub(crate) fn new(program: &Program) -> Kernel<R> {
        let round = |values: &[f64]| values.iter().map(|&v| R::from_f64(v)).collect();
        let target = |t: &program::Target| Target { lrv: R::from_f64(t.lrv), weights: round(&t.weights) };
        let by_band = (0..program.bands()).flat_map(|b| program.gain.iter().map(move |gain| gain[b]));
        Kernel {
            offset: round(&program.offset),
            gain: by_band.map(R::from_f64).collect(),
            components: program.components(),
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
        let mut tally = [Tally::FAILED];
        let draws = Draws { stream, first: index, count: 1 };
        self.fill_in_lanes::<1>(draws, spectrum, &mut tally);
        tally[0]
    }

    /// The candidate of the words that `block` gives. `None` where it is rejected; else whether scaling took it to 1.
    pub(crate) fn candidate(
        &self,
        mut block: impl FnMut(u32) -> [u32; 4],
        spectrum: &mut [R],
    ) -> Option<bool> {
        let mut candidates = self.candidates::<1>();
        let verdicts = self.judge(&mut candidates, |b| block(b).map(|word| [word]));
        spectrum.iter_mut().zip(&candidates.spectrum).for_each(|(to, [from])| *to = *from);
        verdicts.accepted[0].then_some(verdicts.above_one[0])
    }

    /// All of `draws`, in order; `spectra` and `tallies` are exactly as long as they need be.
    #[inline(always)]
    fn fill_in_lanes<const L: usize>(&self, draws: Draws, spectra: &mut [R], tallies: &mut [Tally]) {
        let mut candidates = self.candidates::<L>();
        let mut rows = spectra.chunks_exact_mut(self.bands()).zip(tallies).enumerate();
        let mut next = || {
            let (i, row) = rows.next()?;
            Some((draws.first.wrapping_add(i as u64), row))
        };
        let mut lanes: [_; L] = std::array::from_fn(|_| next());
        let (mut low, mut high, mut attempts) = ([0; L], [0; L], [0; L]);
        for (l, lane) in lanes.iter().enumerate() {
            [low[l], high[l]] = index_words(lane);
        }
        while lanes.iter().any(Option::is_some) {
            let verdicts = self.judge(&mut candidates, |b| draws.stream.blocks([low, high], attempts, b));
            for l in 0..L {
                let Some((_, (row, tally))) = &mut lanes[l] else { continue };
                attempts[l] += 1;
                if verdicts.accepted[l] {
                    candidates.copy(l, row);
                    **tally = Tally::accepted(attempts[l], verdicts.above_one[l]);
                } else if attempts[l] == self.max_attempts {
                    row.fill(R::ZERO);
                    **tally = Tally::FAILED;
                } else {
                    continue;
                }
                attempts[l] = 0;
                lanes[l] = next();
                [low[l], high[l]] = index_words(&lanes[l]);
            }
        }
    }

    fn candidates<const L: usize>(&self) -> Candidates<R, L> {
        Candidates {
            normals: vec![[R::ZERO; L]; self.components.next_multiple_of(2)],
            spectrum: vec![[R::ZERO; L]; self.bands()],
        }
    }

    /// Makes the candidates of the words that `block` gives for each block, and judges them.
    #[inline(always)]
    fn judge<const L: usize>(
        &self,
        candidates: &mut Candidates<R, L>,
        block: impl FnMut(u32) -> [[u32; L]; 4],
    ) -> Verdicts<L> {
        make_normals(&mut candidates.normals, block);
        let mut physical = Range::new();
        for (b, s) in candidates.spectrum.iter_mut().enumerate() {
            *s = self.band(b, &candidates.normals);
            physical.include(s);
        }
        let mut verdicts = Verdicts { accepted: [true; L], above_one: [false; L] };
        if self.tests_base {
            verdicts.accepted = std::array::from_fn(|l| physical.is_within(l, self.limit));
        }
        if let Some(target) = &self.target {
            let scaled = target.scale(&mut candidates.spectrum);
            for l in 0..L {
                verdicts.accepted[l] &= !self.tests_scaled || scaled.is_within(l, self.limit);
                verdicts.above_one[l] = self.may_exceed_one && scaled.high[l] >= R::ONE;
            }
        }
        verdicts
    }

    /// offset + gain . z of a band, in the order of the components.
    #[inline(always)]
    fn band<const L: usize>(&self, band: usize, normals: &[[R; L]]) -> [R; L] {
        let gains = &self.gain[band * self.components..(band + 1) * self.components];
        let mut sum = [self.offset[band]; L];
        for (&gain, z) in gains.iter().zip(normals) {
            for l in 0..L {
                sum[l] = sum[l] + gain * z[l];
            }
        }
        sum
    }
}

impl<R: Real> Target<R> {
    /// Scales spectra to the target, and says what values they have then.
    #[inline(always)]
    fn scale<const L: usize>(&self, spectrum: &mut [[R; L]]) -> Range<R, L> {
        let mut lrv = [R::ZERO; L];
        for (b, (&weight, s)) in self.weights.iter().zip(&*spectrum).enumerate() {
            for l in 0..L {
                let product = weight * s[l];
                lrv[l] = if b == 0 { product } else { lrv[l] + product }; // in the order of the bands
            }
        }
        // Floored, so that it may divide; a candidate of negative LRV is not physical anyway.
        let factor: [R; L] =
            std::array::from_fn(|l| self.lrv / if lrv[l] > R::FLOOR { lrv[l] } else { R::FLOOR });
        let mut range = Range::new();
        for s in spectrum {
            for l in 0..L {
                s[l] = s[l] * factor[l];
            }
            range.include(s);
        }
        range
    }
}

/// The least and the largest value of each lane.
struct Range<R, const L: usize> {
    low: [R; L],
    high: [R; L],
}

impl<R: Real, const L: usize> Range<R, L> {
    fn new() -> Self {
        Range { low: [R::INFINITY; L], high: [R::ZERO; L] }
    }

    #[inline(always)]
    fn include(&mut self, values: &[R; L]) {
        for (l, &value) in values.iter().enumerate() {
            self.low[l] = if value < self.low[l] { value } else { self.low[l] };
            self.high[l] = if value > self.high[l] { value } else { self.high[l] };
        }
    }

    /// Whether all values of a lane are positive and below `limit`.
    #[inline(always)]
    fn is_within(&self, lane: usize, limit: R) -> bool {
        self.low[lane] > R::ZERO && self.high[lane] < limit
    }
}

/// The normals of the words of each block: four a block, two a pair of words.
#[inline(always)]
fn make_normals<R: Real, const L: usize>(
    normals: &mut [[R; L]],
    mut block: impl FnMut(u32) -> [[u32; L]; 4],
) {
    for (b, normals) in normals.chunks_mut(4).enumerate() {
        let words = block(b as u32);
        for (normals, words) in normals.chunks_exact_mut(2).zip(words.chunks_exact(2)) {
            for l in 0..L {
                [normals[0][l], normals[1][l]] = R::normal_pair(words[0][l], words[1][l]);
            }
        }
    }
}

/// The words of a lane's index. A lane without a draw goes on with those of 0, to no effect.
fn index_words<T>(lane: &Option<(u64, T)>) -> [u32; 2] {
    stream::words(lane.as_ref().map_or(0, |lane| lane.0))
}

/// All of `draws` in f32, in order, on all cores; `spectra` and `tallies` are exactly as long as they need be.
pub(crate) fn fill(kernel: &Kernel<f32>, draws: Draws, spectra: &mut [f32], tallies: &mut [Tally]) {
    let size = (tallies.len() / (4 * rayon::current_num_threads())).clamp(8 * LANES, CHUNK);
    let chunks = spectra.par_chunks_mut(size * kernel.bands()).zip(tallies.par_chunks_mut(size));
    chunks.enumerate().for_each(|(chunk, (spectra, tallies))| {
        let part = draws.part((chunk * size) as u64, tallies.len() as u64);
        fill_chunk(kernel, part, spectra, tallies);
    });
}

// x86-64-v4 and v3, by what of them matters here; on other architectures the baseline has vectors (NEON).
#[multiversion(targets(
    "x86_64+avx512f+avx512bw+avx512cd+avx512dq+avx512vl+avx2+bmi2+fma",
    "x86_64+avx2+bmi2+fma"
))]
fn fill_chunk(kernel: &Kernel<f32>, draws: Draws, spectra: &mut [f32], tallies: &mut [Tally]) {
    kernel.fill_in_lanes::<LANES>(draws, spectra, tallies);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::colorimetry::lrv_weights;
    use crate::model::Model;
    use crate::program::Bounds;

    /// Programs of every kind, some with draws that fail.
    fn programs() -> Vec<Program> {
        let [surface, light] = ["munsell-vrhel", "granada"].map(|name| Model::builtin(name).unwrap());
        let weights = lrv_weights(surface.grid()).unwrap();
        let target = |lrv, bounds| Some(program::Target { lrv, weights: weights.clone(), bounds });
        vec![
            Program::new(&light, 1.0, None, 100),
            Program::new(&surface, 1.0, None, 100),
            Program::new(&surface, 25.0, None, 3),
            Program::new(&surface, 1.0, target(0.6, Bounds::Base), 100),
            Program::new(&surface, 1.0, target(0.6, Bounds::Scaled), 100),
            Program::new(&surface, 1.0, target(0.8, Bounds::Both), 2),
        ]
    }

    fn in_lanes<R: Real, const L: usize>(kernel: &Kernel<R>, draws: Draws) -> (Vec<R>, Vec<Tally>) {
        let count = draws.count as usize;
        let (mut spectra, mut tallies) = (vec![R::ONE; count * kernel.bands()], vec![Tally::FAILED; count]);
        kernel.fill_in_lanes::<L>(draws, &mut spectra, &mut tallies);
        (spectra, tallies)
    }

    #[test]
    fn any_number_of_lanes_gives_the_scalar_draws() {
        for program in programs() {
            let (f32s, f64s) = (Kernel::<f32>::new(&program), Kernel::<f64>::new(&program));
            for count in [0, 1, 7, 15, 16, 17, 33, 1000] {
                let draws = Stream::new(1).draws((1 << 32) - 20..).part(0, count);
                let expected = in_lanes::<f32, 1>(&f32s, draws);
                assert_eq!(in_lanes::<f32, 2>(&f32s, draws), expected);
                assert_eq!(in_lanes::<f32, 7>(&f32s, draws), expected);
                assert_eq!(in_lanes::<f32, 16>(&f32s, draws), expected);
                assert_eq!(in_lanes::<f32, 32>(&f32s, draws), expected);
                assert_eq!(in_lanes::<f64, 8>(&f64s, draws), in_lanes::<f64, 1>(&f64s, draws));
            }
        }
    }

    /// `in_lanes` is compiled for the baseline, `fill` runs the best that this machine has.
    #[test]
    fn every_level_of_instructions_gives_the_same_bytes() {
        for program in programs() {
            let kernel = Kernel::<f32>::new(&program);
            let draws = Stream::new(2).draws(0..20_000);
            let expected = in_lanes::<f32, 1>(&kernel, draws);
            let (mut spectra, mut tallies) =
                (vec![0.0; 20_000 * kernel.bands()], vec![Tally::FAILED; 20_000]);
            fill(&kernel, draws, &mut spectra, &mut tallies);
            assert!((spectra, tallies) == expected);
        }
    }
}
