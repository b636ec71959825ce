//! What the exact form of a text has. src/wgsl/guards.rs writes the plain form, without the calls. ZERO is a zero that is
//! known at run time alone.

// A value that has its one rounding behind it, whatever the compiler may do: it went through an integer of which nothing
// is known before run time, so no product before this can be fused with a sum after it, and nothing be rearranged across
// it.
fn rounded(x: f32) -> f32 {
    return bitcast<f32>(bitcast<u32>(x) ^ ZERO);
}

// The square root of a positive normal number, rounded to nearest: from what the device says, which WGSL lets be off by
// 6.5 units in the last place, and an exact remainder. That is an integer below 2^31, so its low word is all of it.
fn root(x: f32) -> f32 {
    let bits = bitcast<u32>(x);
    let low = ((bits & 0x7FFFFFu) | 0x800000u) << (24u - ((bits >> 23u) & 1u));
    let base = (((bits >> 23u) + 127u) >> 1u) << 23u;
    var q = bitcast<u32>(sqrt(x)) - base + 0x800000u;
    // To the nearest, or next to it; then there.
    let steps = f32(bitcast<i32>(low - q * q)) / (2f * f32(q)) + 64.5f;
    q += bitcast<u32>(i32(steps)) - 64u;
    let rest = bitcast<i32>(low - q * q);
    let whole = bitcast<i32>(q);
    q += select(0u, 1u, rest > whole) - select(0u, 1u, rest <= -whole);
    return bitcast<f32>(q - 0x800000u + base);
}

// a / b rounded to nearest, likewise, for a quotient in the normal range of normal numbers, or of a = 0, and b > 0. No
// quotient is a tie.
fn ratio(a: f32, b: f32) -> f32 {
    let x = bitcast<u32>(a);
    let y = bitcast<u32>(b);
    let m = (x & 0x7FFFFFu) | 0x800000u;
    let n = (y & 0x7FFFFFu) | 0x800000u;
    let less = select(0u, 1u, m < n);
    let low = m << (23u + less);
    let base = (x & 0x7F800000u) - (y & 0x7F800000u) + ((127u - less) << 23u);
    var q = (bitcast<u32>(a / b) & 0x7FFFFFFFu) - base + 0x800000u;
    let steps = f32(bitcast<i32>(low - q * n)) / f32(n) + 64.5f;
    q += bitcast<u32>(i32(steps)) - 64u;
    let rest = 2 * bitcast<i32>(low - q * n);
    let whole = bitcast<i32>(n);
    q += select(0u, 1u, rest > whole) - select(0u, 1u, rest < -whole);
    return select(bitcast<f32>((q - 0x800000u + base) | (x & 0x80000000u)), a, (x & 0x7FFFFFFFu) == 0u);
}

// An integer rounded to nearest, by the rounding of a sum: both halves are exact, and so is the product.
fn float_of(i: i32) -> f32 {
    return rounded(f32(i >> 16u) * 65536f + f32(i & 0xFFFF));
}
