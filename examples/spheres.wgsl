// A quad for each sphere. Its reflectance was drawn in the same encoder; the daylight of its row is drawn here, by the
// functions that start with `sun_`.

const COLUMNS = 32u;
const ROWS = 20u;
const BANDS = 31u;
// Rows of reflectances are padded to a multiple of four values.
const STRIDE = 32u;

@group(0) @binding(0) var<storage, read> reflectances: array<f32>;
// The colour matching functions x, y and z.
@group(0) @binding(1) var<uniform> observer: array<vec4<f32>, BANDS>;

struct Varying {
    @builtin(position) position: vec4<f32>,
    @location(0) at: vec2<f32>,
    @location(1) @interpolate(flat) colour: vec3<f32>,
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) sphere: u32) -> Varying {
    let row = sphere / COLUMNS;
    let sun = sun_draw(vec2(1u, 0u), vec2(row, 0u));
    var xyz = vec3(0f);
    var white = 0f;
    for (var b = 0u; b < BANDS; b++) {
        let light = sun_at(sun, b) * observer[b].xyz;
        xyz += light * reflectances[sphere * STRIDE + b];
        white += light.y;
    }
    let at = vec2(f32(corner & 1u), f32(corner >> 1u)) * 2f - 1f;
    let cell = vec2(f32(sphere % COLUMNS), f32(row));
    let centre = (cell + 0.5f) / vec2(f32(COLUMNS), f32(ROWS)) * 2f - 1f;
    var out: Varying;
    out.position = vec4((centre + at / vec2(f32(COLUMNS), f32(ROWS))) * vec2(1f, -1f), 0f, 1f);
    out.at = at;
    out.colour = srgb(xyz / white);
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
    let at = in.at / 0.94f;
    let depth = 1f - dot(at, at);
    if depth <= 0f {
        return vec4(vec3(0.13f), 1f);
    }
    let normal = vec3(at, sqrt(depth));
    let lambert = max(dot(normal, normalize(vec3(-0.5f, -0.6f, 0.8f))), 0f);
    return vec4(encoded(in.colour * (0.12f + 0.88f * lambert)), 1f);
}
