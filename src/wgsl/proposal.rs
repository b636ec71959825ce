//! The choice of a box or a centre by a word, as WGSL text.

use crate::random::alias::Alias;

const ALIAS: &str = include_str!("../../shaders/alias.wgsl");

/// `choose(word) -> u32`: the first row of what a word chooses. Reads a table of `rows` rows a column, of which
/// `proposal_row(i)` gives four words.
pub(super) fn choice(alias: &Alias, rows: usize) -> String {
    format!("const BITS = {}u;\nconst ROWS = {rows}u;\n\n{ALIAS}", alias.bits)
}
