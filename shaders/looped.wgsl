// The arithmetic of a program too large for straight lines: the same operations in the same order, in loops over
// components and bands that read the model from a buffer. Before it come the constants BANDS, COMPONENTS, BLOCKS and
// LIMIT; the buffer holds what `model_buffer` of src/wgsl.rs says.

alias Normals = array<f32, 4u * BLOCKS>;

@group(0) @binding(3) var<storage, read> model: array<f32>;

fn normals(key: vec2<u32>, index: vec2<u32>, stream: u32, attempt: u32) -> Normals {
    var z: Normals;
    for (var block = 0u; block < BLOCKS; block++) {
        let words = philox(vec4(index, attempt, stream | block), key);
        let a = normal_pair(words.x, words.y);
        let b = normal_pair(words.z, words.w);
        z[4u * block] = a.x;
        z[4u * block + 1u] = a.y;
        z[4u * block + 2u] = b.x;
        z[4u * block + 3u] = b.y;
    }
    return z;
}

fn band(z: ptr<function, Normals>, b: u32) -> f32 {
    let row = b * (COMPONENTS + 1u);
    var s = model[row];
    for (var j = 0u; j < COMPONENTS; j++) {
        s += model[row + 1u + j] * (*z)[j];
    }
    return s;
}

fn luminance(z: ptr<function, Normals>) -> f32 {
    let weights = BANDS * (COMPONENTS + 1u);
    var lrv = model[weights] * band(z, 0u);
    for (var b = 1u; b < BANDS; b++) {
        lrv += model[weights + b] * band(z, b);
    }
    return lrv;
}

// Whether every band, times `f`, is physical.
fn all_physical(z: ptr<function, Normals>, f: f32) -> bool {
    for (var b = 0u; b < BANDS; b++) {
        if excess(band(z, b) * f) >= LIMIT {
            return false;
        }
    }
    return true;
}

fn is_accepted(normals: Normals) -> bool {
    var z = normals;
    ACCEPTED
}

fn store(d: Draw, row: u32) -> bool {
    var z = d.z;
    let ok = d.attempts != 0u;
    let f = FACTOR;
    var above_one = false;
    for (var b = 0u; b < BANDS; b++) {
        let value = select(0f, band(&z, b) * f, ok);
        spectra[row + b] = value;
        above_one |= value >= 1f;
    }
    return above_one;
}
