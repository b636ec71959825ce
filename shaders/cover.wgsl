//! CPU twin: src/cover/mixture.rs, which says what a row holds.

// Candidates that are proposed from boxes which cover what is acceptable.

// Axis `j` of a box, drawn by a word.
fn coordinate(row: u32, j: u32, word: u32) -> vec2<f32> {
    return truncated(bitcast<vec4<f32>>(proposal_row(row + 1u + j)), word);
}
