// Draw `index` of a stream: candidates until one is accepted, attempt by attempt. CPU twin: src/cpu/mod.rs. Lines
// that end in `// if` and a word are kept only for programs with that property; src/wgsl/mod.rs filters them.

struct Draw {
    z: Normals,
    // The candidates it took; 0 where none of `max_attempts` was accepted.
    attempts: u32,
    // The number of the candidate that comes next. // if in_slices
    tried: u32, // if in_slices
    // What multiplies its spectrum. // if scaled
    scale: f32, // if scaled
    // The target luminous reflectance that is its own. // if own_targets
    target_lrv: f32, // if own_targets
}

// The loop ends by its condition and not by `break`: llvmpipe runs that form a quarter faster.
fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, max_attempts: u32) -> Draw { // if whole
fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, first: u32, end: u32) -> Draw { // if sliced
fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, max_attempts: u32, given: Given) -> Draw { // if whole_given
fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, first: u32, end: u32, given: Given) -> Draw { // if sliced_given
    var result: Draw;
    result.target_lrv = target_lrv_of(key, index, stream); // if own_targets
    for (var attempt = 0u; attempt < max_attempts && result.attempts == 0u; attempt++) { // if in_one
    var attempt = first; // if in_slices
    for (; attempt < end && result.attempts == 0u; attempt++) { // if in_slices
        let z = normals(key, index, stream, attempt); // if plain
        let z = normals(key, index, stream, attempt, given); // if given
        let accepted = is_accepted(JUDGED); // if not_covered
        let c = candidate(key, index, stream, attempt); // if covered
        let z = c.z; // if covered
        let accepted = c.kept && is_accepted(JUDGED); // if covered
        result.z = z;
        result.attempts = select(0u, attempt + 1u, accepted);
    }
    result.tried = attempt; // if in_slices
    result.scale = scale(SCALED); // if scaled
    return result;
}
