//! Inputs that broke a reader once, or that its fuzzing began with: each ends soon, with an error or without.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

#[allow(unreachable_pub)] // it is a library there
#[path = "../fuzz/lib.rs"]
mod targets;

/// Replays the corpus of a target. Returns the number of its inputs.
fn replay(target: &str, run: impl Fn(&[u8])) -> usize {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/corpus").join(target);
    let mut count = 0;
    for entry in fs::read_dir(&folder).unwrap_or_else(|e| panic!("{folder:?}: {e}")) {
        let path = entry.unwrap().path();
        let bytes = fs::read(&path).unwrap();
        let start = Instant::now();
        run(&bytes);
        let time = start.elapsed();
        assert!(time < Duration::from_secs(20), "{path:?} takes {time:?}");
        count += 1;
    }
    count
}

/// A target of text, which other bytes do not reach.
fn text(run: impl Fn(&str)) -> impl Fn(&[u8]) {
    move |bytes| {
        if let Ok(text) = std::str::from_utf8(bytes) {
            run(text);
        }
    }
}

#[test]
fn no_reader_is_broken_again() {
    let mut count = 0;
    for ending in ["npy", "mat", "text"] {
        count += replay(ending, |bytes| targets::table(ending, bytes));
    }
    // Of a build that leaves a format out, the refusal is tried.
    for ending in ["h5", "parquet"] {
        count += replay(ending, |bytes| targets::table(ending, bytes));
    }
    for ending in ["npz", "xlsx"] {
        count += replay(ending, |bytes| targets::archive(ending, bytes));
    }
    count += replay("zarr", |bytes| targets::files("x.zarr", bytes));
    count += replay("envi", |bytes| targets::files("x.hdr", bytes));
    count += replay("model", text(targets::model));
    count += replay("scene", text(targets::scene));
    count += replay("manifest", text(targets::manifest));
    count += replay("sidecar", text(targets::sidecar));
    count += replay("recipe", text(targets::recipe));
    count += replay("config", text(targets::config));
    assert!(count > 30, "{count} inputs");
}
