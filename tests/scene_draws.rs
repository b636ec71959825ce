//! Scenes, draw by draw, as a second version of them in NumPy has them: `scene_draws.py` says how it compares them.
//!
//! SPECTROLL_PYTHON names a Python that has NumPy and SciPy; `make test` makes one.

mod program;

/// Compares the scenes that an engine draws of so many random scene files, with up to so many groups each.
fn agree(engine: &str, files: u32, groups: u32) {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let [tests, data] = ["tests", "data"].map(|name| format!("{}/{name}", env!("CARGO_MANIFEST_DIR")));
    let code = format!(
        "import sys\n\
         sys.dont_write_bytecode = True\n\
         sys.path.insert(0, {tests:?})\n\
         import scene_draws\n\
         scene_draws.main({:?}, {engine:?}, {data:?}, {files}, {groups})",
        program::PROGRAM
    );
    println!("{}", program::python(folder.path(), &code));
}

#[test]
fn the_cpu_draws_what_numpy_does() {
    agree("cpu", 200, 3);
}

/// An adapter is needed. Each file costs a start and the shaders of its groups, so there are a few large ones.
#[test]
fn the_gpu_draws_what_numpy_does() {
    agree("gpu", 8, 16);
}
