// A test of many values by one comparison. Positive floats order like their bits, and all others have larger bits, so
// x is positive and below y exactly where excess(x) < excess(y). Integers, because WGSL may assume that no NaN exists.
fn excess(x: f32) -> u32 {
    return bitcast<u32>(x) - 1u;
}

// The largest of several positive values, by the largest excess.
fn peak(excess_of_all: u32) -> f32 {
    return bitcast<f32>(excess_of_all + 1u);
}
