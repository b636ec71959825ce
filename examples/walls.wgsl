// A quad for each scene, and each of its pixels in the colour of its tile under the scene's lamp.

const COLUMNS = 4u;
const ROWS = 2u;
const TILES = 15u;
const BANDS = 31u;
// The target covers so many tiles either way.
const TARGET = 5u;

// The colour matching functions x, y and z.
@group(0) @binding(0) var<uniform> observer: array<vec4<f32>, BANDS>;
@group(0) @binding(1) var<storage, read> lamps: array<f32>;
@group(0) @binding(2) var<storage, read> tiles: array<f32>;
@group(0) @binding(3) var<storage, read> targets: array<f32>;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) scene: u32,
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) scene: u32) -> Varying {
    let at = vec2(f32(corner & 1u), f32(corner >> 1u));
    let cell = vec2(f32(scene % COLUMNS), f32(scene / COLUMNS));
    var out: Varying;
    out.position = vec4(((cell + at) / vec2(f32(COLUMNS), f32(ROWS)) * 2f - 1f) * vec2(1f, -1f), 0f, 1f);
    out.at = at * f32(TILES + 1u) - 0.5f;
    out.scene = scene;
    return out;
}

// Linear Rec. 709 of XYZ (IEC 61966-2-1).
fn srgb(xyz: vec3<f32>) -> vec3<f32> {
    return vec3(
        dot(xyz, vec3(3.2406255f, -1.537208f, -0.4986286f)),
        dot(xyz, vec3(-0.9689307f, 1.8757561f, 0.0415175f)),
        dot(xyz, vec3(0.0557101f, -0.2040211f, 1.0569959f)),
    );
}

fn encoded(linear: vec3<f32>) -> vec3<f32> {
    let v = clamp(linear, vec3(0f), vec3(1f));
    return select(1.055f * pow(v, vec3(1f / 2.4f)) - 0.055f, 12.92f * v, v <= vec3(0.0031308f));
}

@fragment
fn fragment(in: Varying) -> @location(0) vec4<f32> {
    if any(in.at < vec2(0f)) || any(in.at >= vec2(f32(TILES))) {
        return vec4(vec3(0.13f), 1f);
    }
    let tile = vec2<u32>(in.at);
    let first = (TILES - TARGET) / 2u;
    let is_target = all(tile >= vec2(first)) && all(tile < vec2(first + TARGET));
    let number = (in.scene * TILES + tile.y) * TILES + tile.x;
    var xyz = vec3(0f);
    var white = 0f;
    for (var b = 0u; b < BANDS; b++) {
        let light = lamps[in.scene * BANDS + b] * observer[b].xyz;
        var reflectance = tiles[number * BANDS + b];
        if is_target {
            reflectance = targets[in.scene * BANDS + b];
        }
        xyz += light * reflectance;
        white += light.y;
    }
    return vec4(encoded(srgb(xyz / white)), 1f);
}
