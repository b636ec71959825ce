//! For software adapters: llvmpipe writes a buffer lane by lane, at a price for each store and whatever its width, and
//! that is half of its time.

// Two values in one 64-bit word.

fn word(low: u32, high: u32) -> u64 {
    return u64(low) | (u64(high) << 32u);
}

fn float_word(low: f32, high: f32) -> u64 {
    return word(bitcast<u32>(low), bitcast<u32>(high));
}
