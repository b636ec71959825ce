//! CPU twin: src/random/log_uniform.rs (`uniform`, `exp2`), the same operations in the same order. Neither exp2 nor ldexp
//! of WGSL: the one may be off by several units in the last place.

UNIFORM

// 2^t for t in [0, 126]: an intensity is uniform in its logarithm.
fn power_of_two(t: f32) -> f32 {
    let whole = i32(rounded(t + 0.5f));
    let r = rounded(t - f32(whole));
    var p = 0.00015812136f;
    p = rounded(rounded(p * r) + 0.0013411191f);
    p = rounded(rounded(p * r) + 0.009617189f);
    p = rounded(rounded(p * r) + 0.055503115f);
    p = rounded(rounded(p * r) + 0.2402265f);
    p = rounded(rounded(p * r) + 0.6931472f);
    return rounded(rounded(1f + rounded(r * p)) * bitcast<f32>(u32(whole + 127) << 23u));
}
