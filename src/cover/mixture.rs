//! Candidates from a cover. GPU twin: `shaders/cover.wgsl`, which reads the same numbers from a buffer.
//!
//! An attempt's words, block by block: the first chooses a box, one follows for each axis, and the last thins.

use crate::random::alias::Alias;
use crate::random::real::Real;
use crate::random::stream::Blocks;

/// Boxes of a cover, with the numbers that a draw uses.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct BoxMixture<R> {
    pub(crate) alias: Alias,
    /// Cost of a candidate of each box before any axis is drawn.
    pub(super) costs: Vec<R>,
    /// The axes of each box.
    pub(super) axes: Vec<[R; 4]>,
    /// Number of axes of a box, k.
    pub(crate) components: usize,
}

impl BoxMixture<f64> {
    /// Rounds all numbers to the type R.
    pub(crate) fn rounded<R: Real>(&self) -> BoxMixture<R> {
        BoxMixture {
            alias: self.alias.clone(),
            costs: self.costs.iter().map(|&v| R::from_f64(v)).collect(),
            axes: self.axes.iter().map(|axis| axis.map(R::from_f64)).collect(),
            components: self.components,
        }
    }
}

impl BoxMixture<f32> {
    /// Words that `shaders/cover.wgsl` reads: for each column of the alias table k + 1 vectors of four words. The
    /// first has the column's threshold, its alias, and the cost of the box of its number; the others are the axes of
    /// that box. Columns beyond the boxes have axes that nothing reads.
    pub(crate) fn words(&self) -> Vec<[u32; 4]> {
        let mut words = Vec::with_capacity(self.alias.columns.len() * (self.components + 1));
        for (i, column) in self.alias.columns.iter().enumerate() {
            let cost = self.costs.get(i).map_or(0, |cost| cost.to_bits());
            words.push([column.threshold, column.alias, cost, 0]);
            let axes = (0..self.components).map(|j| self.axes.get(i * self.components + j));
            words.extend(axes.map(|axis| axis.map_or([0; 4], |numbers| numbers.map(f32::to_bits))));
        }
        words
    }
}

impl<R: Real> BoxMixture<R> {
    /// Number of bytes of the [`words`](BoxMixture::words).
    pub(crate) fn bytes(&self) -> usize {
        16 * self.alias.columns.len() * (self.components + 1)
    }

    /// Number of blocks of random words that a candidate takes.
    pub(crate) fn blocks(&self) -> u32 {
        (self.components as u32 + 2).div_ceil(4)
    }

    /// Proposes a candidate in each of L lanes, from the words of `from`: `coordinates` receives its k coordinates in
    /// the frame, relative to its centre; the result is whether thinning keeps it.
    #[inline(always)]
    pub(crate) fn propose<const L: usize>(
        &self,
        coordinates: &mut [[R; L]],
        mut from: impl Blocks<L>,
    ) -> [bool; L] {
        let k = self.components;
        let mut words = from.block(0);
        let (mut boxes, mut cost) = ([0; L], [R::ZERO; L]);
        for l in 0..L {
            boxes[l] = self.alias.choose(words[0][l]) as usize;
            cost[l] = self.costs[boxes[l]];
        }
        for (j, coordinate) in coordinates[..k].iter_mut().enumerate() {
            let word = (j + 1) % 4;
            if word == 0 {
                words = from.block((j as u32 + 1) / 4);
            }
            let axes = self.axes_in_lanes(&boxes, j);
            for l in 0..L {
                let axis = [axes[0][l], axes[1][l], axes[2][l], axes[3][l]];
                let [value, price] = R::truncated(axis, words[word][l]);
                coordinate[l] = value;
                cost[l] = cost[l] + price;
            }
        }
        let word = (k + 1) % 4;
        if word == 0 {
            words = from.block((k as u32 + 1) / 4);
        }
        let mut kept = [false; L];
        for l in 0..L {
            kept[l] = cost[l] < R::chi_square(words[word][l]);
        }
        kept
    }

    /// The numbers of an axis, number by number, in lanes. Not inlined: the compiler would make vectors of the four
    /// numbers rather than of the lanes, in all that follows.
    #[inline(never)]
    fn axes_in_lanes<const L: usize>(&self, boxes: &[usize; L], axis: usize) -> [[R; L]; 4] {
        let mut numbers = [[R::ZERO; L]; 4];
        for (l, chosen) in boxes.iter().enumerate() {
            let axis = self.axes[chosen * self.components + axis];
            for (i, number) in axis.into_iter().enumerate() {
                numbers[i][l] = number;
            }
        }
        numbers
    }
}
