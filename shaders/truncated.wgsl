//! CPU twin: src/random/truncated.rs, same names, same operations in the same order. Only + - * / and sqrt, as in
//! normal.wgsl.

// A coordinate of a box: a uniform word to a normal between two ends, or to the exponential that hugs it from above. An
// axis is four numbers. Of a wide one: the probability above the interval, that below it, that of the interval, and
// -centre. Of a narrow one: start - slope, -1 / slope, -(1 - exp(-|slope| width)) and slope - centre.

// (u, 1 - u), u = (x + 1/2) 2^-32. The smaller is exact to the last bit, so neither is ever 0.
fn tails(x: u32) -> vec2<f32> {
    let upper = x >= 0x80000000u;
    let w = rounded(rounded(float_of(bitcast<i32>(select(x, ~x, upper))) + 0.5f) * 2.3283064e-10f); // in (0, 1/2]
    return select(vec2(w, rounded(1f - w)), vec2(rounded(1f - w), w), upper);
}

// log p, where p + q = 1: near p = 1 it is q that is known exactly.
fn log_of(p: f32, q: f32) -> f32 {
    let near_one = q < 0.29289323f;
    let bits = bitcast<u32>(p);
    let exponent = (bits - 0x3F3504F3u) & 0xFF800000u;
    let t = select(rounded(bitcast<f32>(bits - exponent) - 1f), -q, near_one);
    let e = select(f32(bitcast<i32>(exponent) >> 23u), 0f, near_one);
    return rounded(rounded(e * 0.6931472f) + log1p_reduced(t));
}

// The normal that has the probability `lower` below it and `upper` above it; `log` is that of the smaller.
fn quantile(lower: f32, upper: f32, log: f32) -> f32 {
    let x = rounded(lower - upper);
    let central = abs(x) <= 0.85f;
    let v = select(rounded(root(-log) - 1.5f), rounded(0.7225f - rounded(x * x)), central);
    let scale = select(select(1f, -1f, x < 0f), x, central);
    var n = select(0.20628026f, 0.46179056f, central);
    n = rounded(rounded(n * v) + select(1.4338166f, 4.9778395f, central));
    n = rounded(rounded(n * v) + select(2.7394726f, 6.3042803f, central));
    n = rounded(rounded(n * v) + select(1.2513746f, 1.6935664f, central));
    var d = select(1.142422e-5f, 1.049803f, central);
    d = rounded(rounded(d * v) + select(0.14548507f, 4.9223533f, central));
    d = rounded(rounded(d * v) + select(0.80339384f, 4.47379f, central));
    d = rounded(rounded(d * v) + 1f);
    return ratio(rounded(scale * n), d);
}

// (the coordinate, what it costs).
fn truncated(axis: vec4<f32>, word: u32) -> vec2<f32> {
    let u = tails(word);
    let hat = axis.z < 0f;
    let mass = abs(axis.z);
    let upper = rounded(select(axis.x, rounded(1f - mass), hat) + rounded(u.y * mass));
    let lower = rounded(select(axis.y, 0f, hat) + rounded(u.x * mass));
    let swap = !hat && lower < upper;
    let log = log_of(select(upper, lower, swap), select(lower, upper, swap));
    let y = select(quantile(lower, upper, log), rounded(axis.x + rounded(axis.y * log)), hat);
    return vec2(rounded(y + axis.w), select(0f, rounded(y * y), hat));
}

// -2 ln u of a word: a chi-square of two degrees of freedom. A hat's thinning is a comparison with it.
fn chi_square(x: u32) -> f32 {
    let r = radius(x);
    return rounded(r * r);
}
