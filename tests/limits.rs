//! Requests and files that no machine can meet are refused with the number that is too large, before anything is made.

mod program;

use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use program::{PROGRAM, fails, files, succeeds};

#[test]
fn a_set_has_no_more_chunks_than_its_manifest_can_list() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for format in ["x.zarr", "x/ --format npy"] {
        let sample =
            |rest: &str| format!("sample munsell-vrhel --engine cpu --force-space -o {format} {rest}");
        fails(folder, &sample("-n 4e15"), 2, "chunks, and a set has at most a million");
        fails(folder, &sample("-n 1e9 --chunk 1"), 2, "1000000000 chunks, and a set has at most a million");
        fails(folder, &sample("-n 1e9 --chunk 1e9"), 2, "let a chunk have at most 8659208 (--chunk)");
        fails(folder, &sample("-n 1e9 --chunk 18446744073709551615"), 2, "four are in memory at once");
    }
    // More than there are is all of them.
    succeeds(folder, "sample munsell-vrhel -n 10 --chunk 18446744073709551615 --engine cpu -o x.zarr");
    succeeds(folder, "verify x.zarr --redraw 1 --engine cpu");
}

#[test]
fn what_scenes_share_is_no_set_alone() {
    let folder = tempfile::tempdir().unwrap();
    let run = "scene --example condition2 --only background --scenes 0..2 --engine cpu -o";
    fails(folder.path(), &format!("{run} x.zarr"), 2, "sets of chunks hold what differs from scene to scene");
    succeeds(folder.path(), &format!("{run} x.npz"));
}

#[test]
fn a_sidecar_has_a_name_before_anything_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let name = format!("{}.npy", "n".repeat(240));
    let run = format!("sample granada -n 5 --engine cpu -o {name}");
    fails(folder.path(), &format!("{run} --sidecar"), 1, "File name too long");
    succeeds(folder.path(), &run);
}

/// Ends soon, with this code and these words.
#[track_caller]
fn refuses(folder: &Path, arguments: &[&str], code: i32, message: &str) {
    let start = Instant::now();
    let mut command = Command::new(PROGRAM);
    command.args(arguments).current_dir(folder).stderr(Stdio::piped()).stdout(Stdio::null());
    let mut child = command.spawn().unwrap();
    while child.try_wait().unwrap().is_none() {
        if start.elapsed() > Duration::from_secs(20) {
            child.kill().unwrap();
            panic!("{arguments:?} takes more than 20 s");
        }
        std::thread::sleep(Duration::from_millis(5));
    }
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{arguments:?}: {err}");
    assert!(err.contains(message) && !err.contains("panicked"), "{arguments:?}: {err}");
}

/// A pipe that nobody writes to, a device without end, and a terabyte of which the disk holds nothing: as the model, the
/// scene, the configuration, the data and the set.
#[cfg(unix)]
#[test]
fn files_without_end_are_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    assert!(Command::new("mkfifo").arg(folder.join("pipe")).status().unwrap().success());
    let large = fs::File::create(folder.join("large")).unwrap();
    large.set_len(1 << 40).unwrap();
    for (file, message) in [
        ("pipe", "a plain file is needed"),
        ("/dev/zero", "a plain file is needed"),
        ("large", "1099511627776 bytes"),
    ] {
        refuses(folder, &["sample", file, "-n", "1", "-o", "x.npy"], 4, message);
        refuses(folder, &["scene", file, "-o", "x.npz"], 2, message);
        refuses(folder, &["sample", "granada", "-n", "1", "-o", "x.npy", "--config", file], 2, message);
        assert_eq!(files(folder), ["large", "pipe"]);
    }
    // What a shell has opened has a writer.
    let script = format!("{PROGRAM} scene <(cat scene.toml) --engine cpu -o x.npz");
    let scene = "scenes = 2\n[[surface]]\nname = \"wall\"\nmodel = \"munsell-vrhel\"\ncount = 3\n";
    fs::write(folder.join("scene.toml"), scene).unwrap();
    let status = Command::new("bash").args(["-c", &script]).current_dir(folder).status().unwrap();
    assert!(status.success());
}

#[test]
fn a_model_explains_no_more_than_all() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "fit munsell vrhel -k 2 -o m.json");
    let text = fs::read_to_string(folder.join("m.json")).unwrap();
    let mut model: serde_json::Value = serde_json::from_str(&text).unwrap();
    for (shares, wrong) in [([-5.0, 0.5], "-5"), ([0.9, 0.2], "0.2"), ([1.5, 0.0], "1.5")] {
        model["explained_variance"] = shares.as_slice().into();
        fs::write(folder.join("m.json"), model.to_string()).unwrap();
        fails(
            folder,
            "sample m.json -n 1 --engine cpu -o -",
            4,
            &format!("explained_variance holds {wrong}"),
        );
    }
}
