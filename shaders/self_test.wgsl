//! src/wgsl/self_test.rs says what the counters count, and puts the functions of `rounding.wgsl` before this.

// What a device does with f32, counted: operations as they stand beside operations that nothing can be done to.

@group(0) @binding(0) var<uniform> zero: vec4<u32>;
@group(0) @binding(1) var<storage, read_write> counters: array<atomic<u32>, COUNTERS>;

fn count(counter: u32, is_off: bool) {
    if is_off {
        atomicAdd(&counters[counter], 1u);
    }
}

fn differ(a: f32, b: f32) -> bool {
    return bitcast<u32>(a) != bitcast<u32>(b);
}

fn hash(word: u32) -> u32 {
    var h = word * 0x9E3779B1u;
    h = (h ^ (h >> 15u)) * 0x85EBCA77u;
    h = (h ^ (h >> 13u)) * 0xC2B2AE3Du;
    return h ^ (h >> 16u);
}

// A float in [1, 2) of a word.
fn unit(word: u32) -> f32 {
    return bitcast<f32>((word >> 9u) | 0x3F800000u);
}

// One thread for each case.
@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let w = hash(id.x ^ 0x55555555u);
    let v = hash(w);
    let u = hash(v);
    let a = unit(w);
    let b = unit(v);
    let c = unit(u);
    // Roots, quotients and conversions, beside those that integers correct.
    let x = bitcast<f32>(0x3F000000u + (w >> 8u));
    count(0u, differ(sqrt(x), root(x)));
    count(1u, differ(a / b, ratio(a, b)));
    let i = bitcast<i32>(w);
    count(2u, differ(f32(i), float_of(i)));
    let halved = bitcast<i32>((w >> 1u) | (w & 1u));
    count(3u, differ(f32(w), select(float_of(i), 2f * float_of(halved), w >= 0x80000000u)));
    // A product and a sum in one rounding.
    let p = rounded(a * b);
    count(4u, differ(a * b - c, rounded(p - c)) || differ(c - a * b, rounded(c - p)) || differ(c + a * b, rounded(c + p)));
    // Sums of sums, products of products, and products with sums, in another order.
    let s = rounded(a * 4096f + b);
    count(5u, differ((a * 4096f + b) + 0.7f, rounded(s + 0.7f)) || differ((a * 4096f + b) + c, rounded(s + c)));
    count(6u, differ((a * b) * 1.3f, rounded(p * 1.3f)));
    let q = rounded(a * c);
    count(7u, differ((b - 0.7f) * 1.3f, rounded(rounded(b - 0.7f) * 1.3f)) || differ(a * b + a * c, rounded(p + q)));
    // Values below the normal range.
    let tiny = w & 0x7FFFFFu;
    count(8u, bitcast<u32>(rounded(bitcast<f32>(tiny) * bitcast<f32>(0x3F800000u ^ zero.x))) != tiny);
    // Sums to nearest and to even, by integers, which nothing rounds: 25 bits.
    let m = (w >> 8u) | 0x800000u;
    let n = (v >> 8u) | 0x800000u;
    let total = m + n;
    let even = total >> 1u;
    let nearest = select(even, even + (even & 1u), (total & 1u) == 1u);
    count(9u, rounded(f32(m) + f32(n)) != 2f * f32(nearest));
    // Products likewise: an odd number of halves of the last place is a tie.
    let h = (m & 0xFFFu) | 0x800u;
    let t = ((n & 0xFFFu) | 0x801u) * 2u + 1u;
    let exact = h * t;
    let is_wide = exact >= 0x1000000u;
    let whole = select(exact, (exact >> 1u) + ((exact >> 1u) & (exact & 1u)), is_wide);
    count(10u, rounded(f32(h) * f32(t)) != select(1f, 2f, is_wide) * f32(whole));
}
