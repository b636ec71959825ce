//! `fn store` is generated: src/wgsl/store.rs.

// One thread for each draw of the range, or for each two. A thread's values lie in a row, so that neighbouring threads
// would write far apart. Hardware is several times as fast where a workgroup gathers its rows in its own memory, and its
// threads then write neighbouring words.

const THREADS = WORKGROUPu;

// The rows of a workgroup's threads, or the parts of them that are written at a time.
var<workgroup> gathered: array<u32, THREADS * PITCHu>;

@compute @workgroup_size(WORKGROUP)
fn main(@builtin(global_invocation_id) id: vec3<u32>, @builtin(local_invocation_index) local: u32) {
    let i = PER_THREAD * id.x;
    let is_there = i < parameters.count;
    DECLARED
    if is_there {
        DRAWN
    }
    store(id.x, local, is_there, NAMES);
}
