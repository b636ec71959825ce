// The arithmetic of a program too large for straight lines: the same operations in the same order, in loops over bands
// that read the model from a buffer. The sum over components, `form`, comes after this, with as much written out as
// drivers take well, since some end what loops too often. Before it come the constants BANDS and BLOCKS; the buffer
// holds what the tables of a program have.

alias Normals = array<f32, 4u * BLOCKS>;

fn worst(normals: Normals) -> u32 {
    var z = normals;
    var e = 0u;
    for (var b = 0u; b < BANDS; b++) {
        e = max(e, excess(form(&z, b)));
    }
    return e;
}
