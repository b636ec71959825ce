//! Sets of chunks that others write at the same time, or that were damaged: nothing wrong ends with exit code 0.

mod program;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};

use program::{PROGRAM, fails, files, signed, spectroll, succeeds, tree, wait_until};

/// A run that takes far longer than the test, once it has made the chunk of this number.
fn endless(folder: &Path, flags: &str, chunk: u32) -> Child {
    let run =
        format!("sample munsell-vrhel -n 3e9 --force-space --chunk 100000 --engine cpu -o a.zarr {flags}");
    let mut command = Command::new(PROGRAM);
    command.args(run.split_whitespace()).current_dir(folder).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let chunk = folder.join(format!("a.zarr.partial/spectra/c.{chunk}.0"));
    wait_until(&mut child, || chunk.exists());
    child
}

fn end(mut child: Child, signal: &str) -> Option<i32> {
    let status = Command::new("kill").args([&format!("-{signal}"), &child.id().to_string()]).status();
    assert!(status.unwrap().success());
    child.wait().unwrap().code()
}

#[cfg(unix)]
#[test]
fn a_set_is_not_replaced_while_it_is_written() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let other = "sample munsell-vrhel -n 3000 --chunk 1000 --engine cpu --seed 2 -o a.zarr";
    let child = endless(folder, "", 0);
    let holder = format!("is being written by process {}", child.id());
    fails(folder, &format!("{other} --force"), 1, &holder);
    fails(folder, &format!("{other} --resume"), 1, &holder);
    fails(folder, other, 1, &holder);
    assert_eq!(end(child, "KILL"), None);
    fails(folder, other, 1, "holds an unfinished data set");
    succeeds(folder, &format!("{other} --force"));
    assert_eq!(files(folder), ["a.zarr"]);
    succeeds(folder, "verify a.zarr --redraw 1 --engine cpu");
    // One that is complete may be replaced by one process at a time.
    let child = endless(folder, "--force", 0);
    fails(folder, &format!("{other} --force"), 1, "is being written by process");
    assert_eq!(end(child, "TERM"), Some(130));
    succeeds(folder, "verify a.zarr --redraw 1 --engine cpu");
}

/// One process has a shard, and others have the other shards.
#[cfg(unix)]
#[test]
fn a_shard_has_one_process() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let child = endless(folder, "--shard 1/100", 0);
    let run = "sample munsell-vrhel -n 3e9 --force-space --chunk 100000 --engine cpu -o a.zarr";
    fails(folder, &format!("{run} --shard 1/100 --resume"), 1, "is being written by process");
    fails(folder, &format!("{run} --force"), 1, "is being written by process");
    let other = endless(folder, "--shard 2/100", 300);
    assert_eq!((end(other, "USR1"), end(child, "QUIT")), (Some(130), Some(130)));
}

#[test]
fn of_two_replacements_at_once_each_is_whole_or_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run =
        |seed: u32| format!("sample granada -n 400000 --chunk 10000 --seed {seed} --engine cpu -o x.zarr");
    succeeds(folder, &run(0));
    for round in 0..6 {
        let outputs: Vec<_> = std::thread::scope(|scope| {
            let runs =
                [1, 2].map(|seed| scope.spawn(move || spectroll(folder, &format!("{} --force", run(seed)))));
            runs.into_iter().map(|run| run.join().unwrap()).collect()
        });
        assert!(outputs.iter().any(|output| output.status.success()), "round {round}: {outputs:?}");
        for output in outputs.iter().filter(|output| !output.status.success()) {
            let err = String::from_utf8_lossy(&output.stderr);
            let refusals = ["is being written by", "begun again"];
            assert!(refusals.iter().any(|refusal| err.contains(refusal)), "{err}");
        }
        assert_eq!(files(folder), ["x.zarr"], "round {round}: {outputs:?}");
        succeeds(folder, "verify x.zarr --redraw 1 --engine cpu");
    }
}

#[test]
fn what_another_shard_lost_is_not_sealed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = "sample munsell-vrhel -n 8000 --chunk 1000 --engine cpu -o a.zarr";
    succeeds(folder, &format!("{run} --shard 1/2"));
    let chunk = folder.join("a.zarr.partial/spectra/c.1.0");
    let bytes = fs::read(&chunk).unwrap();
    fs::remove_file(&chunk).unwrap();
    fails(folder, &format!("{run} --shard 2/2"), 5, "spectra/c.1.0 is missing");
    fs::write(&chunk, &bytes[1..]).unwrap();
    fails(folder, "merge a.zarr", 5, "bytes instead of");
    let mut flipped = bytes.clone();
    flipped[77] ^= 1;
    fs::write(&chunk, flipped).unwrap();
    fails(folder, "merge a.zarr", 5, "spectra/c.1.0 does not match its BLAKE3 sum");
    fails(folder, "verify a.zarr.partial", 5, "does not match its BLAKE3 sum; run the command");
    fs::remove_file(folder.join("a.zarr.partial/_model.json")).unwrap();
    fails(folder, "merge a.zarr", 5, "_model.json is missing, spectra/c.1.0 does not match");
    succeeds(folder, &format!("{run} --resume --shard 1/2"));
    assert_eq!(files(folder), ["a.zarr"]);
    succeeds(folder, "verify a.zarr --redraw 1 --engine cpu");
}

/// Every file of a set, and not only its chunks.
#[test]
fn all_damage_is_found_and_repaired() {
    let sample =
        "sample munsell-vrhel -n 3000 --chunk 1000 --engine cpu --quantities spectra,lrv --lrv 0.4..0.5";
    for run in [
        &format!("{sample} -o a.zarr"),
        &format!("{sample} --zstd -o b.zarr"),
        &format!("{sample} -o c/ --format npy"),
        &format!("{sample} -o d/ --format parquet"),
        "scene --example condition2 --scenes 0..4 --chunk 2 --engine cpu -o e.zarr",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        succeeds(folder, run);
        let set = files(folder).pop().unwrap();
        let whole = tree(&folder.join(&set));
        let flip = |name: &str, bytes: &[u8]| {
            let mut flipped = bytes.to_vec();
            flipped[bytes.len() / 2] ^= 1;
            fs::write(folder.join(&set).join(name), flipped).unwrap();
        };
        for (name, bytes) in &whole {
            flip(name, bytes);
            fails(folder, &format!("verify {set} --redraw 0"), 5, name);
            if name == "_manifest.json" {
                fails(folder, &format!("verify {set} --repair"), 5, "--force replaces the set");
                fs::write(folder.join(&set).join(name), bytes).unwrap();
                continue;
            }
            succeeds(folder, &format!("verify {set} --redraw 0 --repair --engine cpu"));
            assert!(tree(&folder.join(&set)) == whole, "{run}: {name}");
        }
        // All of it at once, some of it deleted.
        for (i, (name, bytes)) in whole.iter().filter(|(name, _)| name != "_manifest.json").enumerate() {
            flip(name, bytes);
            if i % 2 == 0 {
                fs::remove_file(folder.join(&set).join(name)).unwrap();
            }
        }
        let output = spectroll(folder, &format!("verify {set}"));
        let err = String::from_utf8(output.stderr).unwrap();
        assert_eq!(output.status.code(), Some(5), "{err}");
        assert!(whole.iter().all(|(name, _)| name == "_manifest.json" || err.contains(name)), "{err}");
        let (_, err) = succeeds(folder, &format!("verify {set} --repair --engine cpu"));
        assert!(err.contains("of them were made again"), "{err}");
        assert!(tree(&folder.join(&set)) == whole, "{run}");
    }
}

#[test]
fn a_complete_set_has_all_its_chunks_and_no_others() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "sample granada -n 4000 --chunk 1000 --engine cpu -o a/ --format parquet");
    let manifest = folder.join("a/_manifest.json");
    let whole = fs::read_to_string(&manifest).unwrap();
    let mut json: serde_json::Value = serde_json::from_str(&whole).unwrap();
    json["chunks"].as_object_mut().unwrap().remove("2");
    let text = serde_json::to_string_pretty(&json).unwrap() + "\n";
    fs::write(&manifest, &text).unwrap();
    fails(folder, "verify a", 5, "cannot use the manifest");
    // In the order of this program's own, and signed.
    let start = whole.find("    \"2\": [").unwrap();
    let end = start + whole[start..].find("    ],\n").unwrap() + "    ],\n".len();
    fs::write(&manifest, signed(&(whole[..start].to_owned() + &whole[end..]))).unwrap();
    fails(folder, "verify a", 5, "_manifest.json has 3 of 4 chunks");
    fails(
        folder,
        "sample granada -n 4000 --chunk 1000 --engine cpu -o a/ --format parquet --resume",
        5,
        "lacks chunks",
    );
    fs::write(&manifest, &whole).unwrap();
    succeeds(folder, "verify a");
    fs::copy(folder.join("a/part-000001.parquet"), folder.join("a/part-000004.parquet")).unwrap();
    fails(folder, "verify a", 5, "part-000004.parquet is not of the set");
}

/// Manifests that no run wrote, by the text that is changed in one that a run did.
#[test]
fn manifests_that_no_set_can_have_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "sample granada -n 50 --chunk 10 --engine cpu -o a.zarr");
    let manifest = folder.join("a.zarr/_manifest.json");
    let whole = fs::read_to_string(&manifest).unwrap();
    for (from, to) in [
        ("\"chunk\": 10", "\"chunk\": 0"),
        ("\"chunk\": 10", "\"chunk\": 18446744073709551615"),
        ("\"count\": 50", "\"count\": 18446744073709551615"),
        ("\"width\": 31", "\"width\": 1000000000"),
        ("\"width\": 31", "\"width\": 0"),
        ("\"name\": \"spectra/c.0.0\"", "\"name\": \"/dev/zero\""),
        ("\"name\": \"spectra/c.0.0\"", "\"name\": \"../victim\""),
        ("\"name\": \"_model.json\"", "\"name\": \"/dev/zero\""),
        ("\"name\": \"_model.json\"", "\"name\": \"../victim\""),
        ("\"name\": \"spectra\"", "\"name\": \"../victim\""),
        ("\"stored\": \"float32\"", "\"stored\": \"uint32\""),
        ("\"zarr\": {", "\"rar\": {"),
        ("\"1\": [", "\"99\": ["),
        ("\"manifest\": 2", "\"manifest\": 2,\n  \"more\": 2"),
    ] {
        assert!(whole.contains(from), "{from}: {whole}");
        fs::write(&manifest, signed(&whole.replace(from, to))).unwrap();
        for command in ["verify a.zarr --redraw 1", "verify a.zarr --repair"] {
            fails(folder, command, 5, "cannot use the manifest");
        }
    }
    fs::write(&manifest, whole.replace("\"manifest\": 2", "\"manifest\": 3")).unwrap();
    fails(folder, "verify a.zarr", 1, "update spectroll");
    // Arrays that the recipe does not make.
    let narrow = whole.replace("\"width\": 31", "\"width\": 30");
    fs::write(&manifest, signed(&narrow)).unwrap();
    fails(folder, "verify a.zarr --redraw 1", 5, "");
    assert_eq!(files(folder), ["a.zarr"]);
    fs::write(&manifest, &whole).unwrap();
    succeeds(folder, "verify a.zarr");
}

#[cfg(unix)]
#[test]
fn nothing_waits_for_a_file_that_is_none() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let fifo = |path: &Path| assert!(Command::new("mkfifo").arg(path).status().unwrap().success());
    succeeds(folder, "sample granada -n 50 --chunk 10 --engine cpu -o a.zarr");
    for name in ["spectra/c.3.0", "_model.json", "zarr.json"] {
        let path = folder.join("a.zarr").join(name);
        fs::remove_file(&path).unwrap();
        fifo(&path);
        fails(folder, "verify a.zarr", 5, "is not a plain file");
        succeeds(folder, "verify a.zarr --repair --redraw 1 --engine cpu");
    }
    let sparse = fs::File::create(folder.join("a.zarr/spectra/c.1.0")).unwrap();
    sparse.set_len(1 << 42).unwrap();
    fails(folder, "verify a.zarr", 5, "has 4398046511104 bytes instead of 1240");
    fs::remove_file(folder.join("a.zarr/_manifest.json")).unwrap();
    fifo(&folder.join("a.zarr/_manifest.json"));
    fails(folder, "verify a.zarr", 5, "a plain file is needed");
}

#[test]
fn a_job_that_makes_nothing_names_the_shards_that_are_missing() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = "sample munsell-vrhel -n 8000 --chunk 1000 --engine cpu -o a.zarr --resume";
    for shard in [2, 3, 6] {
        succeeds(folder, &format!("{run} --shard {shard}/8"));
    }
    fails(folder, &format!("{run} --shard 3/8"), 1, "parts 1,4-5,7-8 are missing");
    fails(folder, &format!("{run} --shard 3/8"), 1, "make each with --shard I/N --resume");
    // As Slurm submits an array again in part.
    let slurm = |shard: &str, id: &str| {
        let mut command = Command::new(PROGRAM);
        command.args(format!("{run} --shard {shard}").split_whitespace()).current_dir(folder);
        command.envs([("SLURM_ARRAY_TASK_ID", id), ("SLURM_ARRAY_TASK_COUNT", "5")]);
        command.envs([
            ("SLURM_ARRAY_TASK_MIN", "1"),
            ("SLURM_ARRAY_TASK_MAX", "7"),
            ("SLURM_ARRAY_TASK_STEP", "1"),
        ]);
        command.output().unwrap()
    };
    let refused = slurm("auto/8", "4");
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    for id in ["1", "4", "5", "7", "8"] {
        let made = slurm("auto/1-8", id);
        assert!(made.status.success(), "{made:?}");
    }
    assert_eq!(files(folder), ["a.zarr"]);
    succeeds(folder, "verify a.zarr --redraw 1 --engine cpu");
}

/// What a kill leaves between the names of two sets.
#[test]
fn what_is_left_of_a_replaced_set_is_swept() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = "sample granada -n 50 --chunk 10 --engine cpu -o a.zarr";
    succeeds(folder, run);
    let left = folder.join("a.zarr.replaced.partial");
    fs::create_dir_all(left.join("spectra")).unwrap();
    fs::write(left.join("spectra/c.1.0"), "old").unwrap();
    succeeds(folder, &format!("{run} --force"));
    assert_eq!(files(folder), ["a.zarr"]);
    // Before the new set has its name, both are there.
    succeeds(folder, &format!("{run} --seed 1").replace("a.zarr", "b.zarr"));
    fs::rename(folder.join("a.zarr"), &left).unwrap();
    fs::rename(folder.join("b.zarr"), folder.join("a.zarr.partial")).unwrap();
    succeeds(folder, "merge a.zarr");
    assert_eq!(files(folder), ["a.zarr"]);
    succeeds(folder, "verify a.zarr.partial --redraw 1"); // as if it had got its name a moment ago
}

#[cfg(unix)]
#[test]
fn unusual_names_are_names() {
    use std::ffi::OsStr;
    use std::os::unix::ffi::OsStrExt;
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = |output: &OsStr, arguments: &str| {
        let mut command = Command::new(PROGRAM);
        command.args(arguments.split_whitespace()).arg(output).current_dir(folder).output().unwrap()
    };
    let name = OsStr::from_bytes(b"\xff.zarr");
    for shard in 1..=2 {
        let sample = format!("sample granada -n 50 --chunk 10 --engine cpu --shard {shard}/2 -o");
        assert!(run(name, &sample).status.success());
    }
    fs::rename(folder.join(name), folder.join(OsStr::from_bytes(b"\xff.zarr.partial"))).unwrap();
    assert!(run(OsStr::from_bytes(b"\xff.zarr.partial"), "merge").status.success());
    assert!(folder.join(name).is_dir());
    fs::remove_dir_all(folder.join(name)).unwrap();
    // What is too long is so before anything is drawn; what is not gets its name.
    let long = |length: usize| format!("{}.zarr", "n".repeat(length - 5));
    let sample = "sample granada -n 50 --chunk 10 --engine cpu -o";
    fails(folder, &format!("{sample} {}", long(250)), 1, "File name too long");
    for force in ["", "--force"] {
        succeeds(folder, &format!("{sample} {} {force}", long(238)));
    }
    let file = format!("{}.npy", "n".repeat(251));
    succeeds(folder, &format!("sample granada -n 50 --engine cpu -o {file}"));
    // A link to a set goes on to be one.
    succeeds(folder, &format!("{sample} a.zarr"));
    std::os::unix::fs::symlink("a.zarr", folder.join("link.zarr")).unwrap();
    succeeds(folder, &format!("{sample} link.zarr --force --seed 5"));
    assert!(folder.join("link.zarr").is_symlink());
    succeeds(folder, "verify a.zarr --redraw 1 --engine cpu");
    fails(folder, &format!("{sample} a.zarr --resume"), 1, "seed is 5 there and 0 here");
}

/// Formats without attributes, and damage that attributes would not show.
#[test]
fn a_file_with_a_sidecar_is_verified_and_repaired() {
    let sample = "sample munsell-vrhel -n 2000 --engine cpu --sidecar --stream mine";
    for run in [
        &format!("{sample} -o a.npy"),
        &format!("{sample} --quantities spectra,lrv --lrv 0.4 -o a.npz"),
        &format!("{sample} -o a.csv"),
        &format!("{sample} --dtype f16 -o a.h5"),
        &format!("{sample} -o a.mat"),
        &format!("{sample} -o a.parquet"),
        "scene --example condition2 --scenes 1..4 --engine cpu --sidecar -o a.npz",
    ] {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        succeeds(folder, run);
        let whole = tree(folder);
        let name = whole[0].0.clone();
        assert_eq!(files(folder), [name.clone(), format!("{name}.spectroll.json")], "{run}");
        let (_, err) = succeeds(folder, &format!("verify {name} --redraw 1 --engine cpu"));
        assert!(err.contains("drawn again, with the same bytes"), "{err}");
        let mut flipped = whole[0].1.clone();
        flipped[700] ^= 1;
        fs::write(folder.join(&name), flipped).unwrap();
        fails(folder, &format!("verify {name}"), 5, "does not match its BLAKE3 sum; pass --repair");
        succeeds(folder, &format!("verify {name} --repair --engine cpu"));
        assert!(tree(folder) == whole, "{run}");
        fs::remove_file(folder.join(&name)).unwrap();
        fails(folder, &format!("verify {name}"), 5, "is missing");
        succeeds(folder, &format!("verify {name} --repair --engine cpu"));
        assert!(tree(folder) == whole, "{run}");
        let beside = folder.join(format!("{name}.spectroll.json"));
        fs::write(&beside, String::from_utf8(whole[1].1.clone()).unwrap().replace("seed", "feed")).unwrap();
        fails(folder, &format!("verify {name}"), 5, "does not match its BLAKE3 sum");
        // Another file without a sidecar takes that of this one along.
        succeeds(folder, &format!("{} --force", run.replace("--sidecar", "")));
        assert_eq!(files(folder), std::slice::from_ref(&name), "{run}");
        fails(folder, &format!("verify {name}"), 1, "has no sidecar");
    }
    let folder = tempfile::tempdir().unwrap();
    fails(folder.path(), &format!("{sample} -o a.zarr"), 2, "--sidecar is for single files");
}
