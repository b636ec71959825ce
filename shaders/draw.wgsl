//! CPU twin: src/cpu/mod.rs. Lines that end in `// if` and a word are kept only for programs with that property;
//! src/wgsl/shader.rs filters them. The loop ends by its condition and not by `break`: llvmpipe runs that form a quarter
//! faster.

// Draw `index` of a stream: candidates until one is accepted, attempt by attempt.

struct Draw {
    z: Normals,
    // The candidates it took; 0 where it failed.
    attempts: u32,
    // The number of the candidate that comes next. // if sliced
    tried: u32, // if sliced
    // What multiplies its spectrum. // if scaled
    scale: f32, // if scaled
    // The target luminous reflectance that is its own. // if own_targets
    target_lrv: f32, // if own_targets
    // A zero that is known at run time alone. // if carries_zero
    zero: u32, // if carries_zero
}

fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, max_attempts: u32 GIVEN_PARAMETER) -> Draw { // if whole
fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, first: u32, end: u32 GIVEN_PARAMETER) -> Draw { // if sliced
    var result: Draw;
    result.target_lrv = target_lrv_of(key, index, stream); // if own_targets
    for (var attempt = 0u; attempt < max_attempts && result.attempts == 0u; attempt++) { // if whole
    var attempt = first; // if sliced
    for (; attempt < end && result.attempts == 0u; attempt++) { // if sliced
        let z = normals(key, index, stream, attempt GIVEN_ARGUMENT); // if plain
        let accepted = is_accepted(JUDGED); // if plain
        let c = candidate(key, index, stream, attempt); // if covered
        let z = c.z; // if covered
        let accepted = c.kept && is_accepted(JUDGED); // if covered
        result.z = z;
        result.attempts = select(0u, attempt + 1u, accepted);
    }
    result.tried = attempt; // if sliced
    result.scale = scale(SCALED); // if scaled
    result.zero = zero; // if carries_zero
    return result;
}
