// One thread for each draw of the range, or for each two.

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>) {
    let i = PER_THREAD * id.x;
    if i < parameters.count { // if whole
    if i < parameters.count && !(ALL_DONE) { // if sliced
        store(id.x, DRAWS);
    }
}
