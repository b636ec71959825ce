// A wall of chips, each of which rolls its own reflectance by the functions that start with `chip_`: all have the same
// luminous reflectance. The right half shows nothing but the luminance of the left half's mirror image.

const COLUMNS = 32u;
const CELL = 30u;

@vertex
fn vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4<f32> {
    return vec4(f32(corner & 1u) * 4f - 1f, f32(corner >> 1u) * 4f - 1f, 0f, 1f);
}

fn encoded(linear: vec3<f32>) -> vec3<f32> {
    let v = clamp(linear, vec3(0f), vec3(1f));
    return select(1.055f * pow(v, vec3(1f / 2.4f)) - 0.055f, 12.92f * v, v <= vec3(0.0031308f));
}

@fragment
fn fragment(@builtin(position) position: vec4<f32>) -> @location(0) vec4<f32> {
    let pixel = vec2<u32>(position.xy);
    let cell = pixel / CELL;
    let inside = pixel % CELL;
    if any(inside < vec2(2u)) || any(inside >= vec2(CELL - 2u)) {
        return vec4(vec3(0.13f), 1f);
    }
    let mirrored = cell.x >= COLUMNS / 2u;
    let column = select(cell.x, COLUMNS - 1u - cell.x, mirrored);
    let chip = chip_draw(vec2(2u, 0u), vec2(cell.y * COLUMNS + column, 0u));
    let colour = select(chip_linear_srgb(chip), vec3(chip_xyz(chip).y), mirrored);
    return vec4(encoded(colour), 1f);
}
