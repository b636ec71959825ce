//! CPU twin: src/random/normal.rs, same names, same operations in the same order. Only + - * and sqrt: WGSL lets the
//! built-in log, sin and cos be wrong by 2^-21 to 2^-11.

// Box-Muller: two uniform words to two standard normals.

// log(1 + t) for t in [sqrt(1/2) - 1, sqrt(2) - 1]; relative error of the polynomial 3e-8.
fn log1p_reduced(t: f32) -> f32 {
    var p = 0.087404214f;
    p = rounded(rounded(p * t) - 0.14309816f);
    p = rounded(rounded(p * t) + 0.14916772f);
    p = rounded(rounded(p * t) - 0.16570035f);
    p = rounded(rounded(p * t) + 0.19962157f);
    p = rounded(rounded(p * t) - 0.25001785f);
    p = rounded(rounded(p * t) + 0.33333948f);
    p = rounded(rounded(p * t) - 0.4999999f);
    return rounded(t + rounded(rounded(t * t) * p));
}

// sqrt(-2 ln u), u = (x + 1/2) 2^-32. In the upper half u = 1 - w, and w is what is known exactly: forming u
// would cancel, and the smallest radii would lose all their digits.
fn radius(x: u32) -> f32 {
    let upper = x >= 0x80000000u;
    // Below 2^31, so signed: some devices convert unsigned words with two roundings.
    let w = rounded(rounded(float_of(bitcast<i32>(select(x, ~x, upper))) + 0.5f) * 2.3283064e-10f); // in (0, 1/2]
    // Lower half: w = (1 + t) 2^e with 1 + t in [sqrt(1/2), sqrt(2)).
    let bits = bitcast<u32>(w);
    let exponent = (bits - 0x3F3504F3u) & 0xFF800000u;
    let lower_t = rounded(bitcast<f32>(bits - exponent) - 1f);
    let lower_e = f32(bitcast<i32>(exponent) >> 23u);
    // Upper half: 1 - w is 1 + t as it stands, or half of it.
    let near_one = w < 0.29289323f;
    let upper_t = select(rounded(1f - 2f * w), -w, near_one);
    let upper_e = select(-1f, 0f, near_one);
    let t = select(lower_t, upper_t, upper);
    let e = select(lower_e, upper_e, upper);
    return root(-2f * rounded(rounded(e * 0.6931472f) + log1p_reduced(t)));
}

// (cos a, sin a), a = 2 pi (y + 1/2) 2^-32. The quarter turn is integer arithmetic on the word, which leaves an
// angle in [-pi/4, pi/4] for the polynomials; their errors are 1e-10 and 4e-9.
fn circle(y: u32) -> vec2<f32> {
    let quarter = (y + 0x20000000u) >> 30u;
    let rest = bitcast<i32>(y - (quarter << 30u));
    let a = rounded(rounded(float_of(rest) + 0.5f) * 1.4629181e-9f);
    let b = rounded(a * a);
    let s = rounded(-0.16666655f + rounded(b * rounded(0.008332192f + rounded(b * -0.00019518791f))));
    let sine = rounded(a + rounded(rounded(a * b) * s));
    let c = rounded(0.041666646f + rounded(b * rounded(-0.0013887301f + rounded(b * 2.4430665e-5f))));
    let cosine = rounded(rounded(1f - 0.5f * b) + rounded(rounded(b * b) * c));
    let odd = (quarter & 1u) != 0u;
    let x_sign = ((quarter + 1u) & 2u) << 30u;
    let y_sign = (quarter & 2u) << 30u;
    return vec2(
        bitcast<f32>(bitcast<u32>(select(cosine, sine, odd)) ^ x_sign),
        bitcast<f32>(bitcast<u32>(select(sine, cosine, odd)) ^ y_sign),
    );
}

fn normal_pair(x: u32, y: u32) -> vec2<f32> {
    let r = radius(x);
    let c = circle(y);
    return vec2(rounded(r * c.x), rounded(r * c.y));
}
