//! A mixture's candidates as WGSL text.

use super::proposal::choice;
use super::shader::kept;
use super::writer::float;
use crate::mixture::{Mixture, Spread, triangle};

const LOOPED: &str = include_str!("../../shaders/mixture_looped.wgsl");

const LETTERS: [&str; 4] = ["x", "y", "z", "w"];

impl Mixture<f32> {
    /// `choose(word) -> u32`, of the table of [`words`](Self::words).
    pub(super) fn chooser(&self) -> String {
        choice(&self.alias, self.rows())
    }

    /// The lines that read the centre which a word chooses, in straight-line code: `word` is the expression for it.
    pub(super) fn read(&self, word: &str) -> String {
        let rows = (0..self.rows()).map(|r| format!("let c{r} = proposal_row(row + {r}u);\n"));
        format!("let row = choose({word});\n{}", rows.collect::<String>().trim_end())
    }

    /// Coordinate `j` of the candidate, where `normal` names each normal.
    pub(super) fn coordinate(&self, j: usize, normal: impl Fn(usize) -> String) -> String {
        let number = |i: usize| format!("bitcast<f32>(c{}.{})", (i + 2) / 4, LETTERS[(i + 2) % 4]);
        let k = self.components();
        let first = number(j);
        match self.spread() {
            Spread::Same(spread) => {
                let spread = float(f64::from(*spread));
                format!("rounded({first} + rounded({spread} * {}))", normal(j))
            }
            Spread::Own(_) => (0..=j).fold(first, |sum, i| {
                format!("rounded({sum} + rounded({} * {}))", number(k + triangle(j) + i), normal(i))
            }),
        }
    }

    /// `place(z, row)`, which turns normals into a candidate in a loop.
    pub(super) fn looped(&self) -> String {
        let is_own = matches!(self.spread(), Spread::Own(_));
        let text = kept(LOOPED, |word| match word {
            "own" => is_own,
            "alike" => !is_own,
            other => unreachable!("mixture_looped.wgsl has a line for mixtures that are {other:?}"),
        });
        let spread = match self.spread() {
            Spread::Same(spread) => format!("const SPREAD = {};\n", float(f64::from(*spread))),
            Spread::Own(_) => String::new(),
        };
        format!("const COMPONENTS = {}u;\n{spread}{}\n{text}\n", self.components(), self.chooser())
    }

    /// The line that calls it, at the end of what makes normals in a loop.
    pub(super) fn call(&self) -> String {
        let word = self.choice();
        let letter = LETTERS[word % 4];
        let block = word / 4;
        format!("    place(&z, choose(philox(vec4(index, attempt, stream | {block}u), key).{letter}));\n")
    }

    /// Number of times that the loops of a candidate go round.
    pub(super) fn iterations(&self) -> usize {
        let k = self.components();
        match self.spread() {
            Spread::Same(_) => k,
            Spread::Own(_) => k + triangle(k),
        }
    }
}
