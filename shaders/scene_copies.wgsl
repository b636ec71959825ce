// Spectra as a scene has them: copies of the shapes that were drawn, each times its intensity.

struct Sizes {
    /// How many values come out.
    values: u32,
    bands: u32,
    /// Consecutive copies that share a shape.
    copies: u32,
    /// Consecutive copies that share an intensity.
    lights: u32,
}

@group(0) @binding(0) var<uniform> sizes: Sizes;
@group(0) @binding(1) var<storage, read> shapes: array<f32>;
@group(0) @binding(2) var<storage, read> intensities: array<f32>;
@group(0) @binding(3) var<storage, read_write> spectra: array<f32>;

/// One thread for each value.
@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(num_workgroups) groups: vec3<u32>) {
    let i = id.y * groups.x * WORKGROUPu + id.x;
    if i >= sizes.values {
        return;
    }
    let copy = i / sizes.bands;
    let shape = copy / sizes.copies;
    spectra[i] = shapes[shape * sizes.bands + i % sizes.bands] * intensities[copy / sizes.lights];
}
