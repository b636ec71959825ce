//! Before it come the constants BANDS and BLOCKS, after it the sum over components, `form`, with as much written out as
//! drivers take well, since some end what loops too often.

// The arithmetic of a model too large for straight lines: the same operations in the same order, in loops over bands that
// read the model from a table.

alias Normals = array<f32, 4u * BLOCKS>;

fn worst(given: Normals) -> u32 {
    var z = given;
    var e = 0u;
    for (var b = 0u; b < BANDS; b++) {
        e = max(e, excess(form(&z, b)));
    }
    return e;
}
