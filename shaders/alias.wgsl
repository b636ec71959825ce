//! CPU twin: src/random/alias.rs. src/wgsl/proposal.rs writes what comes before: the constants BITS of the table and ROWS of
//! what it chooses, and `column(c)`, the threshold and the alias of a column.

// The first row of what a word chooses.
fn choose(word: u32) -> u32 {
    let c = word >> (32u - BITS);
    let odds = column(c);
    return select(odds.y, c, (word << BITS) < odds.x) * ROWS;
}
