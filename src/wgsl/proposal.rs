//! The choice of a box or a centre by a word, as WGSL text.

use crate::random::alias::Alias;

const ALIAS: &str = include_str!("../../shaders/alias.wgsl");

/// `choose(word) -> u32`: the number that a word chooses, times `rows`. `column` is the body of the function that reads column
/// `c` of the table.
pub(super) fn choice(alias: &Alias, rows: usize, column: &str) -> String {
    let bits = alias.bits;
    format!(
        "const BITS = {bits}u;\nconst ROWS = {rows}u;\n\nfn column(c: u32) -> vec2<u32> {{\n    {column}\n}}\n\n{ALIAS}"
    )
}
