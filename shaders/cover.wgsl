//! CPU twin: src/cover/mixture.rs, which says what a row holds; src/wgsl/cover.rs writes what comes before: the constants
//! BITS of the alias table and ROWS of a column.

// Candidates that are proposed from boxes which cover what is acceptable.

// The first row of the box that a word chooses.
fn choose(word: u32) -> u32 {
    let column = word >> (32u - BITS);
    let odds = box_row(column * ROWS);
    return select(odds.y, column, (word << BITS) < odds.x) * ROWS;
}

// Axis `j` of a box, drawn by a word.
fn coordinate(row: u32, j: u32, word: u32) -> vec2<f32> {
    return truncated(bitcast<vec4<f32>>(box_row(row + 1u + j)), word);
}
