//! CPU twin: src/random/alias.rs; src/wgsl/proposal.rs writes what comes before: the constants BITS of the table and ROWS
//! of a column, and `proposal_row(i)`, of which a column's first has the threshold and the alias.

// The first row of what a word chooses.
fn choose(word: u32) -> u32 {
    let column = word >> (32u - BITS);
    let odds = proposal_row(column * ROWS);
    return select(odds.y, column, (word << BITS) < odds.x) * ROWS;
}
