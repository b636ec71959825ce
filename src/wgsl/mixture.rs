//! A mixture's candidates as WGSL text.

use super::proposal::choice;
use super::shader::kept;
use super::writer::PARTS;
use crate::mixture::{Mixture, triangle};

const LOOPED: &str = include_str!("../../shaders/mixture_looped.wgsl");

impl Mixture<f32> {
    /// `choose(word) -> u32`: the first row of the centre that a word chooses, in the table of [`words`](Self::words).
    pub(super) fn chooser(&self) -> String {
        let columns = 4 * self.rows_of_each() * self.len();
        let column = format!(
            "let packed = proposal_word({columns}u + c);\n    let low = (1u << BITS) - 1u;\n    \
             return vec2(packed & ~low, packed & low);"
        );
        choice(&self.alias, self.rows_of_each(), &column)
    }

    /// The lines that read the centre which a word chooses, in straight-line code: `word` is the expression for it.
    pub(super) fn read(&self, word: &str) -> String {
        let rows = (0..self.rows_of_each())
            .map(|r| format!("\nlet c{r} = bitcast<vec4<f32>>(proposal_row(row + {r}u));"));
        format!("let row = choose({word});{}", rows.collect::<String>())
    }

    /// Coordinate `j` of the candidate, where `normal` names each normal.
    pub(super) fn coordinate(&self, j: usize, normal: impl Fn(usize) -> String) -> String {
        let number = |i: usize| format!("c{}.{}", i / 4, PARTS[i % 4]);
        let k = self.components();
        let first = number(j);
        match self.has_factors() {
            false => format!("rounded({first} + {})", normal(j)),
            true => (0..=j).fold(first, |sum, i| {
                format!("rounded({sum} + rounded({} * {}))", number(k + triangle(j) + i), normal(i))
            }),
        }
    }

    /// `place(z, row)`, which turns normals into a candidate in a loop.
    pub(super) fn looped(&self) -> String {
        let text = kept(LOOPED, |word| match word {
            "own" => self.has_factors(),
            "alike" => !self.has_factors(),
            other => unreachable!("mixture_looped.wgsl has a line for mixtures that are {other:?}"),
        });
        format!("const COMPONENTS = {}u;\n{}\n{text}\n", self.components(), self.chooser())
    }

    /// The line that calls it, at the end of what makes normals in a loop.
    pub(super) fn call(&self) -> String {
        let word = self.choice();
        let letter = PARTS[word % 4];
        let block = word / 4;
        format!("    place(&z, choose(philox(vec4(index, attempt, stream | {block}u), key).{letter}));\n")
    }

    /// Number of times that the loops of a candidate go round.
    pub(super) fn iterations(&self) -> usize {
        let k = self.components();
        if self.has_factors() { k + triangle(k) } else { k }
    }
}
