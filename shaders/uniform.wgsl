//! CPU twin: src/random/log_uniform.rs.

// The uniform number (word + 1/2) 2^-32. A word from 2^31 up is converted as twice its half, whose last bit stands for
// both of those that it has lost: some devices convert unsigned words with two roundings.
fn uniform_of(word: u32) -> f32 {
    let halved = bitcast<i32>((word >> 1u) | (word & 1u));
    let x = select(float_of(bitcast<i32>(word)), 2f * float_of(halved), word >= 0x80000000u);
    return rounded(rounded(x + 0.5f) * 2.3283064e-10f);
}
