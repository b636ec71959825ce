//! Lanes: the draw that each works on, and the draws that are done.

use super::Verdicts;
use crate::draw_status::DrawStatus;
use crate::random::real::Real;
use crate::random::stream::{Attempts, Draws};

/// A draw that is done, and the lane of the candidates that it is in. Where it failed they are those of its last
/// attempt.
#[derive(Clone, Copy)]
pub(super) struct Done {
    /// Its number, from the first that was asked for on.
    pub(super) number: usize,
    pub(super) lane: usize,
    pub(super) status: DrawStatus,
}

/// Lanes that share the work on some draws: one that is done takes the next.
pub(super) struct Lanes<'a, const L: usize> {
    draws: Draws<'a>,
    /// The number of each lane's draw, from the first on.
    numbers: [u64; L],
    /// Its index, low words and high ones.
    index: [[u32; L]; 2],
    /// Number of candidates made for it.
    attempts: [u32; L],
    /// The number of the first draw that no lane has taken.
    next: u64,
    /// Lanes that have a draw, as bits. The others go on with one beyond the last, to no effect.
    busy: u64,
    done: [Done; L],
}

impl<'a, const L: usize> Lanes<'a, L> {
    #[inline(always)]
    pub(super) fn new(draws: Draws<'a>) -> Self {
        const { assert!(0 < L && L <= 64, "a lane is a bit of a word") };
        let mut lanes = Lanes {
            draws,
            numbers: [0; L],
            index: [[0; L]; 2],
            attempts: [0; L],
            next: 0,
            busy: u64::MAX >> (64 - L),
            done: [Done { number: 0, lane: 0, status: DrawStatus::FAILED }; L],
        };
        for lane in 0..L {
            lanes.take_next(lane);
        }
        lanes
    }

    #[inline(always)]
    pub(super) fn are_busy(&self) -> bool {
        self.busy != 0
    }

    /// Puts the responses that each lane's draw is given into `inputs`, as many as these.
    #[inline(always)]
    pub(super) fn give<R: Real>(&self, inputs: &mut [[R; L]]) {
        for l in 0..L {
            let given = self.draws.given(self.numbers[l], inputs.len());
            for (input, given) in inputs.iter_mut().zip(given) {
                input[l] = R::from_f64(f64::from(*given));
            }
        }
    }

    /// Source of the words of the next candidates.
    #[inline(always)]
    pub(super) fn words(&self) -> Attempts<L> {
        Attempts { stream: self.draws.range.stream, index: self.index, attempts: self.attempts }
    }

    /// Counts an attempt in each lane. Those whose candidate was accepted or was the last allowed are done, and go on
    /// with other draws.
    #[inline(always)]
    pub(super) fn advance(&mut self, verdicts: &Verdicts<L>, max_attempts: u32) -> &[Done] {
        // As bits: a branch for each lane would often be mispredicted.
        let mut ended = 0;
        for l in 0..L {
            self.attempts[l] += 1;
            ended |= u64::from(verdicts.accepted[l] | (self.attempts[l] == max_attempts)) << l;
        }
        ended &= self.busy;
        let mut count = 0;
        while ended != 0 {
            let lane = ended.trailing_zeros() as usize;
            ended &= ended - 1;
            let status = match verdicts.accepted[lane] {
                true => DrawStatus::accepted(self.attempts[lane], verdicts.above_one[lane]),
                false => DrawStatus::FAILED,
            };
            self.done[count] = Done { number: self.numbers[lane] as usize, lane, status };
            count += 1;
            self.take_next(lane);
        }
        &self.done[..count]
    }

    #[inline(always)]
    fn take_next(&mut self, lane: usize) {
        if self.next >= self.draws.range.count {
            self.busy &= !(1 << lane);
        }
        self.numbers[lane] = self.next;
        self.attempts[lane] = 0;
        let [low, high] = self.draws.range.stream.index_words(self.draws.index(self.next));
        self.index[0][lane] = low;
        self.index[1][lane] = high;
        self.next += 1;
    }
}
