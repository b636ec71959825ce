// The luminous reflectance of a program that runs in loops. LRV_WEIGHTS is where the buffer has the bands' weights.
fn luminance(normals: Normals) -> f32 {
    var z = normals;
    var lrv = tables[LRV_WEIGHTS] * form(&z, 0u);
    for (var b = 1u; b < BANDS; b++) {
        lrv += tables[LRV_WEIGHTS + b] * form(&z, b);
    }
    return lrv;
}
