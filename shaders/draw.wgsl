// Draw `index` of a stream: candidates until one is accepted, attempt by attempt. CPU twin: src/cpu.rs.

struct Draw {
    z: Normals,
    // The candidates it took; 0 where none of `max_attempts` was accepted.
    attempts: u32,
    // What multiplies its spectrum.
    scale: f32,
}

// The loop ends by its condition and not by `break`: llvmpipe runs that form a quarter faster.
fn draw_of(key: vec2<u32>, index: vec2<u32>, stream: u32, max_attempts: u32) -> Draw {
    var result: Draw;
    for (var attempt = 0u; attempt < max_attempts && result.attempts == 0u; attempt++) {
        let z = normals(key, index, stream, attempt);
        result.z = z;
        result.attempts = select(0u, attempt + 1u, is_accepted(z));
    }
    result.scale = scale(result.z, key, index, stream);
    return result;
}
