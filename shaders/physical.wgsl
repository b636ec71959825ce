// A test of many values by one comparison. Positive floats order like their bits, and all others have larger bits, so
// x is positive and below y exactly where excess(x) < excess(y). Integers, because WGSL may assume that no NaN exists.
fn excess(x: f32) -> u32 {
    return bitcast<u32>(x) - 1u;
}
