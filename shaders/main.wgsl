// One thread for each draw of the range: a row of spectra and a tally.

@group(0) @binding(1) var<storage, read_write> spectra: array<f32>;
@group(0) @binding(2) var<storage, read_write> tallies: array<u32>;

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = id.x;
    if i < parameters.count {
        let drawn = draw_at(i);
        tallies[i] = tally(drawn, store(drawn, i * ROW));
    }
}
