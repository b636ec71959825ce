//! CPU twin: src/mixture/mod.rs, which says what a row holds. Lines that end in `// if` and a word are kept only for
//! mixtures with that property; src/wgsl/mixture.rs filters them and writes the constant COMPONENTS.

// Number `i` of a centre: its coordinates, and then its factor where it has one of its own.
fn of_centre(row: u32, i: u32) -> f32 {
    return bitcast<f32>(proposal_row(row + i / 4u)[i % 4u]);
}

// Turns normals into a candidate about a centre.
fn place(z: ptr<function, Normals>, row: u32) {
    for (var j = 0u; j < COMPONENTS; j++) { // if alike
        (*z)[j] = rounded(of_centre(row, j) + (*z)[j]); // if alike
    } // if alike
    for (var n = COMPONENTS; n > 0u; n--) { // if own
        let j = n - 1u; // if own
        var sum = of_centre(row, j); // if own
        for (var i = 0u; i < n; i++) { // if own
            sum = rounded(sum + rounded(of_centre(row, COMPONENTS + j * n / 2u + i) * (*z)[i])); // if own
        } // if own
        (*z)[j] = sum; // if own
    } // if own
}
