//! src/wgsl/compute_shader.rs writes it.

// What a dispatch draws.
struct Parameters {
    key: vec2<u32>,
    first: vec2<u32>,
    count: u32,
    // The stream's number, shifted to where the counter has it.
    stream: u32,
    max_attempts: u32,
    // How many values there are from one plane to the next.
    plane: u32,
    // How many draws a row has; 0 where there are no rows.
    row: u32,
    // The most candidates of a draw in one dispatch. // if sliced
    slice: u32, // if sliced
    // Always 0, which no compiler knows. // if exact
    @align(8) zero: u32, // if exact
}

@group(0) @binding(0) var<uniform> parameters: Parameters;
// The draws, each by the words of its index, where they are those of a list. // if listed
@group(0) @binding(INDICES_AT) var<storage, read> indices: array<vec2<u32>>; // if listed
// The responses that each draw is given, draw by draw. // if given
@group(0) @binding(GIVEN_AT) var<storage, read> givens: array<f32>; // if given

// Draw i of the range.
fn draw_at(i: u32) -> Draw {
    let index = indices[i]; // if listed
    let low = parameters.first.x + i; // if ranged
    let carry = select(0u, 1u, low < i); // if ranged
    var index = vec2(low, parameters.first.y + carry); // if ranged
    if parameters.row != 0u { // if ranged
        index = vec2(low % parameters.row, parameters.first.y + low / parameters.row); // if ranged
    } // if ranged
    return draw_of(parameters.key, index, parameters.stream, parameters.max_attempts GIVEN_ARGUMENT); // if whole
    let before = progress[i]; // if sliced
    let attempts = attempts_of(before); // if sliced
    let first = select(before & ~UNDONE, attempts - 1u, attempts != 0u); // if sliced
    let end = select(min(first + parameters.slice, parameters.max_attempts), attempts, attempts != 0u); // if sliced
    let drawn = draw_of(parameters.key, index, parameters.stream, first, end GIVEN_ARGUMENT); // if sliced
    progress[i] = select(drawn.tried | UNDONE, drawn.attempts, drawn.attempts != 0u); // if sliced
    return drawn; // if sliced
}
