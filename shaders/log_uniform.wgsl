// The intensity of an illuminant that is uniform in its logarithm. CPU twin: src/level.rs (`uniform`, `exp2`), the same
// operations in the same order. Neither exp2 nor ldexp of WGSL: the one may be off by several units in the last place.

UNIFORM

fn power_of_two(t: f32) -> f32 {
    let whole = i32(t + 0.5f);
    let r = t - f32(whole);
    var p = 0.00015812136f;
    p = p * r + 0.0013411191f;
    p = p * r + 0.009617189f;
    p = p * r + 0.055503115f;
    p = p * r + 0.2402265f;
    p = p * r + 0.6931472f;
    return (1f + r * p) * bitcast<f32>(u32(whole + 127) << 23u);
}
