//! Streams of random words, and ranges of their draws.
//!
//! Draw i is a pure function of the model, the recipe, the seed, the stream and i. The generator's key is the seed
//! (low word, high word); its counter is (i low, i high, attempt, stream << 8 | block). Attempts 0, 1, 2, ... are the
//! candidates of draw i, of which the first acceptable one wins. Blocks 0, 1, ... of an attempt hold the words of its
//! normals, four a block; block 255 of attempt 0 is kept for uniforms that belong to a draw rather than to an
//! attempt, and block 254 of attempt 0 feeds [`StreamRng`].
//!
//! Where draws come in rows, as the objects of scenes do, the row is the high word of i and the place in it the low
//! one. A row can then be drawn alone, and may grow or shrink without changing another draw.

use std::convert::Infallible;
use std::ops::{Bound, RangeBounds};

use rand::TryRng;

use crate::random::philox::philox_in_lanes;

/// The block of attempt 0 whose words belong to a draw and not to an attempt: intensities, levels, hues.
pub(crate) const DRAW_BLOCK: u32 = 255;

/// The block that [`StreamRng`] reads, beyond any that normals use.
const RNG_BLOCK: u32 = 254;

/// A source of random words: a seed, and one of 2^24 streams under it. Draws of different streams or seeds are
/// independent.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct Stream {
    seed: u64,
    id: u32,
    /// Number of draws in a row; 0 where there are no rows.
    row: u32,
}

impl Stream {
    /// The stream 0 of a seed.
    pub const fn new(seed: u64) -> Stream {
        Stream { seed, id: 0, row: 0 }
    }

    /// The stream of a name, so that adding a group of draws to a scene does not change another: its 32-bit FNV-1a
    /// hash h, folded to 24 bits as (h >> 24) ^ (h & 0xffffff).
    pub fn named(seed: u64, name: &str) -> Stream {
        let hash =
            name.bytes().fold(0x811C_9DC5, |h: u32, byte| (h ^ u32::from(byte)).wrapping_mul(0x0100_0193));
        Stream { seed, id: (hash >> 24) ^ (hash & 0x00FF_FFFF), row: 0 }
    }

    /// Arranges the stream's draws in rows of `length`: index i is then draw i % length of row i / length, which does
    /// not depend on the length.
    ///
    /// ```
    /// use spectroll::Stream;
    ///
    /// let (short, long) = (Stream::new(1).in_rows(3), Stream::new(1).in_rows(1000));
    /// assert_eq!(short.block(2 * 3 + 1, 0, 0), long.block(2 * 1000 + 1, 0, 0));
    /// ```
    ///
    /// # Panics
    /// Where the length is 0 or above 2^31.
    pub fn in_rows(self, length: u32) -> Stream {
        assert!((1..=1 << 31).contains(&length), "a row has 1 to 2^31 draws, not {length}");
        Stream { row: length, ..self }
    }

    /// The length of rows; 0 where there are none.
    pub(crate) fn row(&self) -> u32 {
        self.row
    }

    /// The words of the counter that stand for draw `index`: its low and high ones, or its place and its row.
    #[inline(always)]
    pub(crate) fn index_words(&self, index: u64) -> [u32; 2] {
        match self.row {
            0 => words(index),
            row => [(index % u64::from(row)) as u32, (index / u64::from(row)) as u32],
        }
    }

    /// The seed.
    pub fn seed(&self) -> u64 {
        self.seed
    }

    /// The stream's number, below 2^24.
    pub fn id(&self) -> u32 {
        self.id
    }

    /// The key: the seed's low and high words.
    #[inline(always)]
    pub(crate) fn key(&self) -> [u32; 2] {
        words(self.seed)
    }

    /// The four words of a block, below 256, of an attempt of draw `index`.
    pub fn block(&self, index: u64, attempt: u32, block: u32) -> [u32; 4] {
        assert!(block < 256, "block {block} would be one of another stream");
        let index = self.index_words(index).map(|word| [word]);
        Attempts { stream: *self, index, attempts: [attempt] }.block(block).map(|[word]| word)
    }

    /// The draws of a range of indices, `0..1000` or `5..=u64::MAX`.
    pub fn draws(self, range: impl RangeBounds<u64>) -> DrawRange {
        let first = match range.start_bound() {
            Bound::Included(&first) => first,
            Bound::Excluded(&before) => before.saturating_add(1),
            Bound::Unbounded => 0,
        };
        let count = match range.end_bound() {
            Bound::Included(&last) if last < first => 0,
            Bound::Included(&last) => (last - first).saturating_add(1),
            Bound::Excluded(&end) => end.saturating_sub(first),
            Bound::Unbounded => (u64::MAX - first).saturating_add(1),
        };
        DrawRange { stream: self, first, count }
    }

    /// The draws of a list of indices, in its order: any indices, any number of times.
    pub fn at(self, indices: &[u64]) -> Draws<'_> {
        let range = DrawRange { stream: self, first: 0, count: indices.len() as u64 };
        Draws { range, indices: Some(indices), given: &[] }
    }

    /// A sequential generator over the stream, for code that wants one of `rand`'s. Its words are not those of any
    /// draw of the stream.
    pub fn rng(self) -> StreamRng {
        StreamRng { stream: self, next: 0, words: [0; 4], used: 4 }
    }
}

/// Source of the words of candidates, one in each of L lanes. A trait and not a closure, which could not be told to
/// be inlined: what is not inlined is compiled for the least of all machines, and at a fraction of the speed.
pub(crate) trait Blocks<const L: usize> {
    /// The four words of a block, below 256.
    fn block(&mut self, number: u32) -> [[u32; L]; 4];
}

/// In one lane speed is no matter, and words may come from anywhere.
impl<F: FnMut(u32) -> [u32; 4]> Blocks<1> for F {
    fn block(&mut self, number: u32) -> [[u32; 1]; 4] {
        self(number).map(|word| [word])
    }
}

/// Attempts at draws of a stream.
#[derive(Clone, Copy)]
pub(crate) struct Attempts<const L: usize> {
    pub(crate) stream: Stream,
    /// The draws, as [`Stream::index_words`] has them.
    pub(crate) index: [[u32; L]; 2],
    pub(crate) attempts: [u32; L],
}

impl<const L: usize> Blocks<L> for Attempts<L> {
    #[inline(always)]
    fn block(&mut self, number: u32) -> [[u32; L]; 4] {
        debug_assert!(number < 256);
        let [low, high] = self.index;
        philox_in_lanes([low, high, self.attempts, [self.stream.id << 8 | number; L]], self.stream.key())
    }
}

/// The low and high words of a 64-bit number: the order in which the counter and the shader hold them.
#[inline(always)]
fn words(x: u64) -> [u32; 2] {
    [x as u32, (x >> 32) as u32]
}

/// A range of `count` draws, from index `first` of a stream on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DrawRange {
    /// Source of their random words.
    pub stream: Stream,
    /// Index of the first draw.
    pub first: u64,
    /// Number of draws. Indices are 64-bit numbers, and those beyond the last follow as 0, 1, ...
    pub count: u64,
}

impl DrawRange {
    /// The part of the range that starts `offset` draws in and has `count` of them.
    pub(crate) fn part(&self, offset: u64, count: u64) -> DrawRange {
        DrawRange { first: self.first.wrapping_add(offset), count, ..*self }
    }
}

/// Draws of a stream: those of a [`DrawRange`], or those of a list of indices ([`Stream::at`]).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Draws<'a> {
    /// The range; where there is a list, its indices are places in the list.
    pub(crate) range: DrawRange,
    pub(crate) indices: Option<&'a [u64]>,
    /// Responses that each draw is given, draw by draw; none of recipes without such.
    pub(crate) given: &'a [f32],
}

impl From<DrawRange> for Draws<'_> {
    fn from(range: DrawRange) -> Self {
        Draws { range, indices: None, given: &[] }
    }
}

impl<'a> Draws<'a> {
    /// Number of draws.
    pub fn count(&self) -> u64 {
        self.range.count
    }

    /// The index of the draw of this number, from 0. Beyond the last there is some other draw.
    #[inline(always)]
    pub(crate) fn index(&self, number: u64) -> u64 {
        let place = self.range.first.wrapping_add(number);
        match self.indices {
            None => place,
            Some(indices) => indices.get(place as usize).copied().unwrap_or(0),
        }
    }

    /// The part of the draws that starts `offset` in and has `count` of them.
    pub fn part(&self, offset: u64, count: u64) -> Draws<'a> {
        let width = self.given.len() / (self.count().max(1) as usize);
        let end = |number: u64| (width * number as usize).min(self.given.len());
        let given = &self.given[end(offset)..end(offset + count)];
        Draws { range: self.range.part(offset, count), given, ..*self }
    }

    /// The draws with these responses, which are given to each of them.
    pub(crate) fn with_given<'b>(self, given: &'b [f32]) -> Draws<'b>
    where
        'a: 'b,
    {
        Draws { given, ..self }
    }

    /// The responses that the draw of this number is given, `width` of them; those of the last beyond it.
    #[inline(always)]
    pub(crate) fn given(&self, number: u64, width: usize) -> &'a [f32] {
        let number = number.min(self.range.count - 1) as usize;
        &self.given[number * width..][..width]
    }
}

/// Generator for `rand`'s traits over a [`Stream`]: 2^66 words before it repeats.
#[derive(Clone, Debug)]
pub struct StreamRng {
    stream: Stream,
    next: u64,
    words: [u32; 4],
    used: usize,
}

impl TryRng for StreamRng {
    type Error = Infallible;

    fn try_next_u32(&mut self) -> Result<u32, Infallible> {
        if self.used == self.words.len() {
            self.words = self.stream.block(self.next, 0, RNG_BLOCK);
            self.next = self.next.wrapping_add(1);
            self.used = 0;
        }
        let word = self.words[self.used];
        self.used += 1;
        Ok(word)
    }

    fn try_next_u64(&mut self) -> Result<u64, Infallible> {
        rand::rand_core::utils::next_u64_via_u32(self)
    }

    fn try_fill_bytes(&mut self, out: &mut [u8]) -> Result<(), Infallible> {
        for chunk in out.chunks_mut(4) {
            chunk.copy_from_slice(&self.try_next_u32()?.to_le_bytes()[..chunk.len()]);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::ops::RangeInclusive;

    use super::*;
    use crate::random::philox::philox;
    use rand::Rng;

    /// The first word is the low half, as `rand` has it for every generator of 32-bit words.
    #[test]
    fn long_words_are_two_short_ones() {
        let (mut long, mut short) = (Stream::named(3, "x").rng(), Stream::named(3, "x").rng());
        for _ in 0..9 {
            let (low, high) = (u64::from(short.next_u32()), u64::from(short.next_u32()));
            assert_eq!(long.next_u64(), low | high << 32);
        }
    }

    /// FNV-1a of "" is its offset basis, and of "a" a published test vector: 811c9dc5 and e40c292c.
    #[test]
    fn streams_are_named_by_fnv() {
        assert_eq!(Stream::named(0, "").id(), 0x81 ^ 0x001C_9DC5);
        assert_eq!(Stream::named(0, "a").id(), 0xE4 ^ 0x000C_292C);
        assert_eq!(Stream::new(7).id(), 0);
    }

    #[test]
    fn the_counter_holds_index_attempt_stream_and_block() {
        let stream = Stream { seed: 0x0123_4567_89AB_CDEF, id: 0x00AB_CDEF, row: 0 };
        let expected = philox([0x5566_7788, 0x1122_3344, 9, 0xABCD_EF03], [0x89AB_CDEF, 0x0123_4567]);
        assert_eq!(stream.block(0x1122_3344_5566_7788, 9, 3), expected);
        let row = stream.in_rows(1000);
        assert_eq!(row.block(7 * 1000 + 5, 9, 3), stream.block(7 << 32 | 5, 9, 3));
    }

    #[test]
    fn ranges_of_draws() {
        let stream = Stream::new(1);
        let parts = |d: DrawRange| (d.first, d.count);
        assert_eq!(parts(stream.draws(3..10)), (3, 7));
        assert_eq!(parts(stream.draws(..5)), (0, 5));
        assert_eq!(parts(stream.draws(u64::MAX - 2..=u64::MAX)), (u64::MAX - 2, 3));
        assert_eq!(parts(stream.draws(5..5)), (5, 0));
        assert_eq!(
            [parts(stream.draws(5..=5)), parts(stream.draws(RangeInclusive::new(5, 4)))],
            [(5, 1), (5, 0)]
        );
        assert_eq!([stream.seed(), Stream::named(7, "wall").seed()], [1, 7]);
        assert_eq!(parts(stream.draws(3..10).part(2, 4)), (5, 4));
    }

    #[test]
    fn parts_have_their_own_responses() {
        let given = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0];
        let draws = Draws::from(Stream::new(1).draws(5..9)).with_given(&given);
        let part = draws.part(1, 2);
        assert_eq!((part.range.first, part.given), (6, &given[2..6]));
        assert_eq!(part.part(1, 1).given, &given[4..6]);
        assert!(Draws::from(Stream::new(1).draws(5..9)).part(1, 2).given.is_empty());
    }

    #[test]
    fn lists_of_draws() {
        let stream = Stream::new(1);
        let list = stream.at(&[7, u64::MAX, 7]);
        let indices = |draws: Draws| (0..draws.count()).map(|n| draws.index(n)).collect::<Vec<_>>();
        assert_eq!(indices(list), [7, u64::MAX, 7]);
        assert_eq!(indices(list.part(1, 2)), [u64::MAX, 7]);
        assert_eq!(indices(Draws::from(stream.draws(3..6)).part(1, 2)), [4, 5]);
    }

    #[test]
    fn the_generator_gives_the_words_of_its_blocks() {
        let stream = Stream::new(5);
        let mut rng = stream.rng();
        let words: Vec<u32> = (0..8).map(|_| rng.next_u32()).collect();
        assert_eq!(words, [stream.block(0, 0, 254), stream.block(1, 0, 254)].concat());
        let mut bytes = [0; 6];
        stream.rng().fill_bytes(&mut bytes);
        assert_eq!(bytes, [words[0].to_le_bytes().as_slice(), &words[1].to_le_bytes()[..2]].concat()[..]);
    }
}
