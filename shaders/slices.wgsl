// Draws that may take more candidates than one dispatch tries: a word for each says how far it came, from dispatch to
// dispatch. It is 0 at first, then UNDONE and the number of the candidate that comes next, and in the end the number of
// candidates that the draw took. What is done is made again where another draw of its thread is not.
const UNDONE = 0x80000000u;

@group(0) @binding(PROGRESS_AT) var<storage, read_write> progress: array<u32>;

// The candidates that a draw took; 0 where it is not done.
fn attempts_of(word: u32) -> u32 {
    return select(0u, word, word < UNDONE);
}

fn is_done(i: u32) -> bool {
    return attempts_of(progress[i]) != 0u;
}
