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

#![allow(clippy::needless_range_loop)] // a lane is an index, of several arrays at once

mod acceptance;
mod columns;
mod intensity;
mod lanes;
mod target;

pub(crate) use columns::{fill, fill_here};

use lanes::{Done, Lanes};
use target::LrvTarget;

use crate::affine::Affine;
use crate::dataset::SpectrumKind;
use crate::draw_status::DrawStatus;
use crate::program::{self, IntensityLaw, Program, Proposal, Source};
use crate::quantity::{ArrayFormat, ValueRange};
use crate::random::real::Real;
use crate::random::stream::{self, Attempts, Blocks, DrawRange, Draws, Stream};

/// A [`Program`] with its numbers rounded to `R`.
pub(crate) struct Kernel<R> {
    spectrum: Map<R>,
    target: Option<LrvTarget<R>>,
    intensity: Option<IntensityLaw<R>>,
    /// Whether a word of a draw's own has a part in it.
    reads_draw_block: bool,
    proposal: Option<Proposal<R>>,
    /// Upper limit of a physical value before scaling.
    limit: R,
    tests_scaled: bool,
    may_exceed_one: bool,
    max_attempts: u32,
    /// Range of values that spectra may take.
    range: ValueRange,
    /// Number of responses that each draw is given, which come before its normals.
    given: usize,
    outputs: Vec<Output<R>>,
}

/// An [`Affine`] map of the normals, by four values: four sums at once keep a core busy, and share what is read of
/// the normals. The last value fills the last four up, so that it is no special case.
struct Map<R> {
    offset: Vec<[R; 4]>,
    /// k gains for each four values.
    gain: Vec<[R; 4]>,
    components: usize,
}

struct Output<R> {
    format: ArrayFormat,
    value: Value<R>,
}

/// A [`Source`].
enum Value<R> {
    Spectrum,
    Map(Map<R>, Unit<R>),
    Intensity,
    TargetLrv,
    Status,
}

/// A [`program::Unit`].
enum Unit<R> {
    One,
    Scale,
    Over(Map<R>),
}

/// The candidates that are being made, a lane each.
struct Candidates<R, const L: usize> {
    /// Standard normals, after the responses that are given.
    normals: Vec<[R; L]>,
    /// The spectrum before it is multiplied by the scale.
    spectrum: Vec<[R; L]>,
    scale: [R; L],
    /// The targets of their draws; 0 where there are none.
    target_lrv: [R; L],
    /// For each output; empty where it is no map.
    maps: Vec<Mapped<R, L>>,
}

/// Values of a map, and the factor to multiply them by.
struct Mapped<R, const L: usize> {
    values: Vec<[R; L]>,
    unit: [R; L],
}

impl<R: Real, const L: usize> Candidates<R, L> {
    /// The values of output `number`, without a status's, and what each is to be multiplied by as it is stored: most
    /// candidates are not, and LLVM makes scatters of such products in lanes.
    #[inline(always)]
    fn output(&self, number: usize, value: &Value<R>) -> (&[[R; L]], [R; L]) {
        match value {
            Value::Spectrum => (&self.spectrum, self.scale),
            Value::Map(..) => (&self.maps[number].values, self.maps[number].unit),
            Value::Intensity => (std::slice::from_ref(&self.scale), [R::ONE; L]),
            Value::TargetLrv => (std::slice::from_ref(&self.target_lrv), [R::ONE; L]),
            Value::Status => (&[], [R::ONE; L]),
        }
    }
}

/// Destination of draws. A trait and not a closure, for the reason of [`Blocks`].
trait Take<R, const L: usize> {
    fn take(&mut self, done: &[Done], candidates: &Candidates<R, L>);
}

/// Results of judging candidates, one per lane.
struct Verdicts<const L: usize> {
    accepted: [bool; L],
    above_one: [bool; L],
}

impl<R: Real> Kernel<R> {
    pub(crate) fn new(program: &Program) -> Kernel<R> {
        let output = |output: &program::Output| Output {
            format: output.format,
            value: match &output.source {
                Source::Spectrum => Value::Spectrum,
                Source::Map(map, program::Unit::One) => Value::Map(Map::new(map), Unit::One),
                Source::Map(map, program::Unit::Scale) => Value::Map(Map::new(map), Unit::Scale),
                Source::Map(map, program::Unit::Over(over)) => {
                    Value::Map(Map::new(map), Unit::Over(Map::new(over)))
                }
                Source::Intensity => Value::Intensity,
                Source::TargetLrv => Value::TargetLrv,
                Source::Status => Value::Status,
            },
        };
        let limit = match program.kind {
            SpectrumKind::Reflectance if program.tests_base() => R::ONE,
            _ => R::INFINITY,
        };
        Kernel {
            spectrum: Map::new(&program.spectrum),
            target: program.target.as_ref().map(LrvTarget::new),
            intensity: program.intensity.as_ref().map(IntensityLaw::rounded),
            reads_draw_block: program.reads_draw_block(),
            proposal: program.proposal.as_ref().map(Proposal::rounded),
            limit,
            tests_scaled: program.tests_scaled(),
            may_exceed_one: program.may_exceed_one(),
            max_attempts: program.max_attempts,
            range: program.value_range(),
            given: program.given,
            outputs: program.outputs.iter().map(output).collect(),
        }
    }

    /// Number of values of the first output.
    #[cfg(feature = "report")]
    pub(crate) fn width(&self) -> usize {
        self.outputs[0].format.width
    }

    /// Draw `index` of a stream: the values of each output, zeros where it failed. The status has none.
    pub(crate) fn draw(&self, stream: Stream, index: u64) -> (Vec<Vec<R>>, DrawStatus) {
        self.draw_given(stream, index, &[])
    }

    /// Draw `index` of a stream, given these responses.
    pub(crate) fn draw_given(&self, stream: Stream, index: u64, given: &[f32]) -> (Vec<Vec<R>>, DrawStatus) {
        assert_eq!(given.len(), self.given, "responses are given to each draw");
        struct Only<'a, R>(&'a Kernel<R>, Option<(Vec<Vec<R>>, DrawStatus)>);
        impl<R: Real> Take<R, 1> for Only<'_, R> {
            fn take(&mut self, done: &[Done], candidates: &Candidates<R, 1>) {
                self.1 = done.first().map(|done| (self.0.values(candidates, done.status), done.status));
            }
        }
        let mut only = Only(self, None);
        let draws = Draws::from(DrawRange { stream, first: index, count: 1 });
        self.in_lanes(draws.with_given(given), &mut only);
        only.1.expect("one draw was asked for")
    }

    /// The candidate of the words that `block` gives for each block, the `attempt`-th of its draw: the values of each
    /// output, and what its draw took; `None` where it is rejected.
    pub(crate) fn candidate(
        &self,
        attempt: u32,
        mut block: impl FnMut(u32) -> [u32; 4],
    ) -> Option<(Vec<Vec<R>>, DrawStatus)> {
        let mut candidates = self.candidates::<1>();
        let kept = self.propose(&mut candidates, &mut block);
        let word = if self.reads_draw_block { [block(stream::DRAW_BLOCK)[0]] } else { [0] };
        let verdicts = self.judge(&mut candidates, kept, word);
        let status = DrawStatus::accepted(attempt, verdicts.above_one[0]);
        verdicts.accepted[0].then(|| (self.values(&candidates, status), status))
    }

    /// The spectrum of the candidate of those words, before it is scaled and whether it is accepted or not: its bands, and
    /// the last of them again up to a multiple of 4.
    #[cfg(feature = "report")]
    pub(crate) fn proposed(&self, mut block: impl FnMut(u32) -> [u32; 4]) -> Vec<R> {
        let mut candidates = self.candidates::<1>();
        self.propose(&mut candidates, &mut block);
        self.spectrum.apply(&candidates.normals, &mut candidates.spectrum);
        candidates.spectrum.into_flattened()
    }

    /// Whether the candidate of those words is accepted.
    pub(crate) fn accepts(&self, block: impl FnMut(u32) -> [u32; 4]) -> bool {
        self.candidate(1, block).is_some()
    }

    fn values(&self, candidates: &Candidates<R, 1>, status: DrawStatus) -> Vec<Vec<R>> {
        let values = self.outputs.iter().enumerate().map(|(number, output)| {
            let (values, [unit]) = candidates.output(number, &output.value);
            let width = values.len().min(output.format.width);
            match status {
                DrawStatus::FAILED => vec![R::ZERO; width],
                _ => values[..width].iter().map(|&[value]| value * unit).collect(),
            }
        });
        values.collect()
    }

    /// Makes draws; each goes to `to` when it is done.
    #[inline(always)]
    fn in_lanes<const L: usize>(&self, draws: Draws, to: &mut impl Take<R, L>) {
        let mut candidates = self.candidates::<L>();
        let mut lanes = Lanes::new(draws);
        while lanes.are_busy() {
            lanes.give(&mut candidates.normals[..self.given]);
            let words = lanes.words();
            let kept = self.propose(&mut candidates, words);
            let word = if self.reads_draw_block {
                Attempts { attempts: [0; L], ..words }.block(stream::DRAW_BLOCK)[0]
            } else {
                [0; L]
            };
            let verdicts = self.judge(&mut candidates, kept, word);
            to.take(lanes.advance(&verdicts, self.max_attempts), &candidates);
        }
    }

    fn candidates<const L: usize>(&self) -> Candidates<R, L> {
        let maps = self.outputs.iter().map(|output| match &output.value {
            Value::Map(map, _) => map.offset.len(),
            _ => 0,
        });
        let maps = maps.map(|fours| Mapped { values: vec![[R::ZERO; L]; 4 * fours], unit: [R::ONE; L] });
        Candidates {
            normals: vec![
                [R::ZERO; L];
                self.given + (self.spectrum.components - self.given).next_multiple_of(2)
            ],
            spectrum: vec![[R::ZERO; L]; 4 * self.spectrum.offset.len()],
            scale: [R::ONE; L],
            target_lrv: [R::ZERO; L],
            maps: maps.collect(),
        }
    }

    /// Proposes candidates, of the words of `from`. Returns whether each is to be judged.
    #[inline(always)]
    fn propose<const L: usize>(
        &self,
        candidates: &mut Candidates<R, L>,
        mut from: impl Blocks<L>,
    ) -> [bool; L] {
        match &self.proposal {
            Some(Proposal::Boxes(boxes)) => return boxes.propose(&mut candidates.normals, from),
            Some(Proposal::Centres(mixture)) => {
                let mut words = make_normals(&mut candidates.normals, &mut from);
                let word = mixture.choice() % 4;
                if word == 0 {
                    words = from.block(mixture.choice() as u32 / 4);
                }
                mixture.place(&mut candidates.normals, &words[word]);
            }
            None => {
                make_normals(&mut candidates.normals[self.given..], &mut from);
            }
        }
        [true; L]
    }
}

impl<R: Real> Map<R> {
    fn new(map: &Affine) -> Map<R> {
        let fours = |row: &[f64]| -> Vec<[R; 4]> {
            let four = |values: &[f64]| {
                // No -0: see `forms` of src/wgsl/arithmetic.rs.
                std::array::from_fn(|i| R::from_f64(values[i.min(values.len() - 1)] + 0.0))
            };
            row.chunks(4).map(four).collect()
        };
        let gains: Vec<_> = map.gain.iter().map(|row| fours(row)).collect();
        let offset = fours(&map.offset);
        let gain = (0..offset.len()).flat_map(|i| gains.iter().map(move |row| row[i])).collect();
        Map { offset, gain, components: map.gain.len() }
    }

    /// offset + gain . z, each value in the order of the components. Four values are made for each begun four.
    #[inline(always)]
    fn apply<const L: usize>(&self, normals: &[[R; L]], values: &mut [[R; L]]) {
        let (fours, _) = values.as_chunks_mut::<4>();
        for (i, (offset, values)) in self.offset.iter().zip(fours).enumerate() {
            let mut sums = [[R::ZERO; L]; 4];
            for (sum, &offset) in sums.iter_mut().zip(offset) {
                *sum = [offset; L];
            }
            for (gain, z) in self.gain[i * self.components..][..self.components].iter().zip(normals) {
                for (sum, &gain) in sums.iter_mut().zip(gain) {
                    for l in 0..L {
                        sum[l] = sum[l] + gain * z[l];
                    }
                }
            }
            *values = sums;
        }
    }
}

fn round<R: Real>(values: &[f64]) -> Vec<R> {
    values.iter().map(|&v| R::from_f64(v)).collect()
}

/// Raised to where it may divide: a candidate that needs it is not physical anyway.
#[inline(always)]
fn floored<R: Real>(value: R) -> R {
    if value > R::FLOOR { value } else { R::FLOOR }
}

/// The normals of the words of each block: four a block, two a pair of words. Returns the words of the last.
#[inline(always)]
fn make_normals<R: Real, const L: usize>(normals: &mut [[R; L]], from: &mut impl Blocks<L>) -> [[u32; L]; 4] {
    let mut words = [[0; L]; 4];
    for (b, normals) in normals.chunks_mut(4).enumerate() {
        words = from.block(b as u32);
        for (normals, words) in normals.chunks_exact_mut(2).zip(words.chunks_exact(2)) {
            for l in 0..L {
                [normals[0][l], normals[1][l]] = R::normal_pair(words[0][l], words[1][l]);
            }
        }
    }
    words
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::dataset::{BuiltinTable, Dataset, SpectrumKind};
    use crate::grid::{Extrapolation, Grid};
    use crate::model::{Fit, FitDistribution};
    use crate::recipe::Recipe;

    /// Two words make each pair of normals, and the next chooses the centre: a word that served two choices would make
    /// them depend on each other.
    #[test]
    fn no_word_serves_two_choices() {
        let data = Dataset::new(&[BuiltinTable::Vrhel.table()], Grid::DEFAULT, Extrapolation::Error);
        let data = data.expect("the table has these wavelengths");
        let distributions =
            [FitDistribution::Gaussian, FitDistribution::Kernel(Some(0.5)), FitDistribution::Mixture(3)];
        for (distribution, k) in distributions.into_iter().flat_map(|d| (1..=9).map(move |k| (d, k))) {
            let fit = Fit::new(SpectrumKind::Reflectance).components(k).distribution(distribution);
            let model = fit.fit(&data).expect("surfaces can be fitted");
            let recipe = Recipe::builder(&model).build().expect("the model can be drawn");
            let kernel = Kernel::<f64>::new(recipe.program());
            let pairs = k.next_multiple_of(2);
            let mut moved = vec![vec![false; k]; 4 * 4];
            for index in 0..50 {
                let words: Vec<[u32; 4]> =
                    (0..4).map(|block| Stream::new(9).block(index, 0, block)).collect();
                let propose = |words: &[[u32; 4]]| {
                    let mut candidates = kernel.candidates::<1>();
                    kernel.propose(&mut candidates, |block: u32| words[block as usize]);
                    candidates.normals
                };
                let normals = propose(&words);
                for (word, moved) in moved.iter_mut().enumerate() {
                    let mut changed = words.clone();
                    changed[word / 4][word % 4] ^= 0xA5A5_5A5A;
                    let other = propose(&changed);
                    moved.iter_mut().enumerate().for_each(|(j, moved)| *moved |= other[j] != normals[j]);
                }
            }
            // A factor is lower triangular: a normal moves its own coordinate and those after it.
            let reach = |pair: usize| if distribution == FitDistribution::Mixture(3) { k } else { pair + 2 };
            for (word, moved) in moved.iter().enumerate() {
                let expected: Vec<bool> = match word {
                    _ if word < pairs => {
                        (0..k).map(|j| (word / 2 * 2..reach(word / 2 * 2)).contains(&j)).collect()
                    }
                    _ => vec![word == pairs && distribution != FitDistribution::Gaussian; k],
                };
                assert_eq!(moved, &expected, "word {word} of {k} components, {distribution:?}");
            }
        }
    }
}
