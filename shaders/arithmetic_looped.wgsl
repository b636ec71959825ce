// The arithmetic of a program too large for straight lines: the same operations in the same order, in loops over
// components and bands that read the model from a buffer. Before it come the constants BANDS, COMPONENTS and BLOCKS;
// the buffer holds what src/wgsl/tables.rs says.

alias Normals = array<f32, 4u * BLOCKS>;

// A row of the model: a band, or a value of another quantity.
fn form(z: ptr<function, Normals>, row: u32) -> f32 {
    let start = row * (COMPONENTS + 1u);
    var s = tables[start];
    for (var j = 0u; j < COMPONENTS; j++) {
        s += tables[start + 1u + j] * (*z)[j];
    }
    return s;
}

fn worst(normals: Normals) -> u32 {
    var z = normals;
    var e = 0u;
    for (var b = 0u; b < BANDS; b++) {
        e = max(e, excess(form(&z, b)));
    }
    return e;
}
