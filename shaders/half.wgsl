// A float rounded to 16 bits, to nearest and ties to even, in the low half of a word. By integers: how
// `pack2x16float` rounds is up to the device.
fn half(x: f32) -> u32 {
    let bits = bitcast<u32>(x);
    let size = bits & 0x7FFFFFFFu;
    let normal = min((size - 0x38000000u + 0xFFFu + ((size >> 13u) & 1u)) >> 13u, 0x7C00u);
    // Below 2^-14 the unit is 2^-24, which is that of floats at 1/2.
    let subnormal = bitcast<u32>(bitcast<f32>(size) + 0.5f) - 0x3F000000u;
    return select(subnormal, normal, size >= 0x38800000u) | ((bits >> 16u) & 0x8000u);
}
