// The luminous reflectance. LRV_WEIGHTS is where the table has the bands' weights.
fn luminance(given: Normals) -> f32 {
    var z = given;
    var lrv = rounded(number(LRV_WEIGHTS) * form(&z, 0u));
    for (var b = 1u; b < BANDS; b++) {
        lrv = rounded(lrv + rounded(number(LRV_WEIGHTS + b) * form(&z, b)));
    }
    return lrv;
}
