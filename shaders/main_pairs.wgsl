// One thread for each two draws of the range, which are stored in 64-bit words: two rows of floats are always a whole
// number of them. For software adapters: llvmpipe writes a buffer lane by lane, at a price for each store and
// whatever its width, and that is half of its time. The buffers have room for an even number of draws.

@group(0) @binding(1) var<storage, read_write> spectra: array<u64>;
@group(0) @binding(2) var<storage, read_write> tallies: array<u64>;

fn word(low: u32, high: u32) -> u64 {
    return u64(low) | (u64(high) << 32u);
}

fn float_word(low: f32, high: f32) -> u64 {
    return word(bitcast<u32>(low), bitcast<u32>(high));
}

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = 2u * id.x;
    if i < parameters.count {
        let a = draw_at(i);
        let b = draw_at(i + 1u);
        let above_one = store(a, b, id.x * ROW);
        tallies[id.x] = word(tally(a, above_one.x), tally(b, above_one.y));
    }
}
