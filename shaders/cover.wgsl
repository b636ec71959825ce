// The boxes of a cover. CPU twin: src/cover/proposal.rs, which says what the buffer holds; src/cover/text.rs writes
// what comes before: the buffer, and the constants BITS of the alias table and ROWS of a column.

// The first row of the box that a word chooses.
fn choose(word: u32) -> u32 {
    let column = word >> (32u - BITS);
    let odds = cover[column * ROWS];
    return select(odds.y, column, (word << BITS) < odds.x) * ROWS;
}

// Axis `j` of a box, drawn by a word.
fn coordinate(row: u32, j: u32, word: u32) -> vec2<f32> {
    return truncated(bitcast<vec4<f32>>(cover[row + 1u + j]), word);
}
