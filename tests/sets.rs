//! Sets of chunks: whatever happens while they are written, what comes to their name is what an undisturbed run makes.

mod program;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::time::{Duration, Instant};

use program::{PROGRAM, fails, files, signed, spectroll, succeeds, tree, wait_until};
use rand::RngExt;
use spectroll::Stream;
use spectroll::output::SetAudit;

const LAYOUTS: [&str; 3] = ["a.zarr", "a/ --format npy", "a/ --format parquet"];

fn start(folder: &Path, arguments: &str) -> Child {
    let mut command = Command::new(PROGRAM);
    command.args(arguments.split_whitespace()).current_dir(folder).stderr(Stdio::null());
    command.spawn().unwrap()
}

/// Whether the child ended by itself, and well, before so much time had passed; it is killed otherwise.
fn ends_within(mut child: Child, time: Duration) -> bool {
    let start = Instant::now();
    while start.elapsed() < time {
        if let Some(status) = child.try_wait().unwrap() {
            assert!(status.success());
            return true;
        }
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap(); // SIGKILL
    child.wait().unwrap();
    false
}

#[test]
fn killed_runs_go_on_to_the_same_bytes() {
    let mut random = Stream::named(1, "kills").rng();
    for layout in LAYOUTS {
        let [whole, killed] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
        let run = format!("sample munsell-vrhel -n 400000 --chunk 2000 --engine cpu --seed 5 -o {layout}");
        let start_of_run = Instant::now();
        succeeds(whole.path(), &run);
        let time = start_of_run.elapsed();
        let expected = tree(whole.path());

        let (mut kills, mut completions) = (0, 0);
        while kills < 20 {
            let share = random.random_range(0.05..0.5);
            if !ends_within(start(killed.path(), &format!("{run} --resume")), time.mul_f64(share)) {
                kills += 1;
            }
            // A run may be killed after it has done all.
            if let Some(set) = files(killed.path()).iter().find(|name| !name.ends_with(".partial")) {
                completions += 1;
                let same = tree(&killed.path().join(set)) == tree(&whole.path().join(set));
                assert!(same, "{layout} after {kills} kills");
                fs::remove_dir_all(killed.path().join(set)).unwrap();
            }
        }
        succeeds(killed.path(), &format!("{run} --resume"));
        assert!(tree(killed.path()) == expected, "{layout} in the end, after {completions} completions");
        // Once more: there is nothing to do.
        succeeds(killed.path(), &format!("{run} --resume"));
        assert!(tree(killed.path()) == expected);
    }
}

#[test]
fn an_interrupt_keeps_what_is_finished() {
    let folder = tempfile::tempdir().unwrap();
    let run = "sample munsell-vrhel -n 3e8 --force-space --engine cpu -o a.zarr";
    let mut command = Command::new(PROGRAM);
    command.args(run.split_whitespace()).current_dir(folder.path()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    wait_until(&mut child, || folder.path().join("a.zarr.partial/spectra/c.1.0").exists());
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let output = child.wait_with_output().unwrap();
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(130), "{err}");
    assert!(err.contains("chunks are finished in \"a.zarr.partial\": pass --resume to go on"), "{err}");
    fails(folder.path(), run, 1, "resume it, or replace it (--resume or --force)");
}

#[test]
fn shards_at_once_make_the_bytes_of_one_process() {
    let [whole, shared] = [tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap()];
    let run = "sample munsell-vrhel -n 200001 --chunk 3000 --engine cpu -o a.zarr";
    succeeds(whole.path(), run);
    let shards: Vec<_> = (1..=4).map(|i| start(shared.path(), &format!("{run} --shard {i}/4"))).collect();
    for mut shard in shards {
        assert!(shard.wait().unwrap().success());
    }
    assert_eq!(files(shared.path()), ["a.zarr"]);
    assert!(tree(shared.path()) == tree(whole.path()));

    // One after another, the last one's index from Kubernetes; and by hand what the last would have done itself.
    let folder = tempfile::tempdir().unwrap();
    let (_, err) = succeeds(folder.path(), &format!("{run} --shard 1/2"));
    assert!(
        err.contains("34 of 67 chunks are finished") || err.contains("33 of 67 chunks are finished"),
        "{err}"
    );
    fails(folder.path(), "merge a.zarr", 1, "of 67 chunks are done");
    let mut command = Command::new(PROGRAM);
    command.args(format!("{run} --shard auto/2").split_whitespace()).env("JOB_COMPLETION_INDEX", "1");
    assert!(command.current_dir(folder.path()).output().unwrap().status.success());
    assert!(tree(folder.path()) == tree(whole.path()));
    fails(folder.path(), &format!("{run} --shard 1/2"), 1, "exists already");
}

/// A plan is made where nothing says yet which part will be asked for, and names the part where something does.
#[test]
fn dry_runs_and_summaries_name_the_part() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run = "sample munsell-vrhel -n 10000 --chunk 1000 --engine cpu -o a.zarr";
    let (plan, _) = succeeds(folder, &format!("{run} --shard auto --dry-run"));
    assert!(plan.contains("1.24 MB in 10 chunks of 1,000 draws") && !plan.contains("part"), "{plan}");
    let (plan, _) = succeeds(folder, &format!("{run} --shard 2/3 --dry-run"));
    assert!(plan.contains("part 2 of 3, chunks 3 to 5: 372 kB"), "{plan}");
    let mut command = Command::new(PROGRAM);
    command.args(format!("{run} --shard auto/10 --dry-run").split_whitespace());
    let output = command.env("JOB_COMPLETION_INDEX", "9").current_dir(folder).output().unwrap();
    let plan = String::from_utf8(output.stdout).unwrap();
    assert!(plan.contains("part 10 of 10, chunk 9: 124 kB"), "{plan}");
    let (plan, _) =
        succeeds(folder, "scene --example condition2 --chunk 100 -o s.zarr --shard 2/4 --dry-run");
    assert!(plan.contains("part 2 of 4, chunks 2 to 4"), "{plan}");
    assert!(files(folder).is_empty());

    let (_, first) = succeeds(folder, &format!("{run} --shard 1/2"));
    assert!(first.contains("5 of 10 chunks are finished: the set gets its name with the last"), "{first}");
    let (_, last) = succeeds(folder, &format!("{run} --shard 2/2"));
    assert!(last.contains("the set is complete"), "{last}");
    let (_, alone) = succeeds(folder, &run.replace("a.zarr", "b.zarr"));
    assert!(!alone.contains("complete"), "{alone}");
}

#[test]
fn another_data_set_is_not_mixed_in() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let run =
        |flags: &str| format!("sample munsell-vrhel -n 6000 --chunk 1000 --engine cpu -o a.zarr {flags}");
    succeeds(folder, &run("--shard 1/2 --seed 1"));
    for (flags, difference) in [
        ("--seed 2", "seed is 1 there and 2 here"),
        ("--seed 1 --lrv 0.5", "recipe.lrv is null there and 0.5 here"),
        ("--seed 1 --dtype f16", "fields"),
        ("--seed 1 --start 9", "start is 0 there and 9 here"),
        ("--seed 1 --zstd", "zstd is null there and 3 here"),
    ] {
        for shard in ["--resume", "--shard 2/2"] {
            fails(folder, &run(&format!("{flags} {shard}")), 1, difference);
        }
    }
    let other = run("--seed 1 --resume").replace("munsell-vrhel", "granada");
    fails(folder, &other, 1, "kind is \"reflectance\" there and \"illuminant\" here");
    succeeds(folder, &run("--seed 1 --resume"));
    fails(folder, &run("--seed 1"), 1, "exists already");
    succeeds(folder, &run("--seed 2 --force"));
    assert_eq!(files(folder), ["a.zarr"]);
    fails(folder, &run("--seed 1 --resume"), 1, "seed is 2 there and 1 here");
}

#[test]
fn a_flipped_bit_is_found() {
    for layout in LAYOUTS {
        let folder = tempfile::tempdir().unwrap();
        let folder = folder.path();
        succeeds(folder, &format!("sample granada -n 5000 --chunk 700 --engine cpu -o {layout}"));
        let set = files(folder).pop().unwrap();
        let (_, err) = succeeds(folder, &format!("verify {set} --redraw 1"));
        assert!(
            err.contains("8 of 8 chunks are as they were written") && err.contains("8 of them drawn again"),
            "{err}"
        );
        let all = tree(&folder.join(&set));
        let (name, bytes) =
            all.iter().find(|(name, _)| name.contains("c.3") || name.contains("-000003")).unwrap();
        let path = folder.join(&set).join(name);
        let mut flipped = bytes.clone();
        flipped[bytes.len() / 2] ^= 16;
        fs::write(&path, flipped).unwrap();
        fails(folder, &format!("verify {set}"), 5, &format!("{name} does not match its BLAKE3 sum"));
        fs::write(&path, &bytes[1..]).unwrap();
        fails(folder, &format!("verify {set}"), 5, "bytes instead of");
        fs::remove_file(&path).unwrap();
        fails(folder, &format!("verify {set}"), 5, "is missing");
        fails(
            folder,
            &format!("sample granada -n 5000 --chunk 700 --engine cpu -o {layout} --resume"),
            5,
            "damaged",
        );
    }
    // Sums that were made to match are found by drawing again.
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "sample granada -n 500 --chunk 500 --engine cpu -o a.zarr");
    forge(&folder.join("a.zarr"), "spectra/c.0.0");
    succeeds(folder, "verify a.zarr --redraw 0");
    fails(folder, "verify a.zarr", 5, "is not what is drawn now");
    fails(folder, "verify .", 1, "has no manifest");
}

/// Gives a file of a set other bytes, and the manifest their sum.
fn forge(set: &Path, name: &str) {
    let path = set.join(name);
    let mut bytes = fs::read(&path).unwrap();
    let before = blake3::hash(&bytes).to_hex().to_string();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&path, &bytes).unwrap();
    let manifest = set.join("_manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    let text = text.replace(&before, blake3::hash(&bytes).to_hex().as_str());
    fs::write(&manifest, signed(&text)).unwrap();
}

#[test]
fn sets_of_scenes_are_verified() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = "scene --example condition3 --scenes 2..12 --chunk 4 --engine cpu";
    for (flags, set) in [
        ("", "a.zarr"),
        ("--dtype f64 --zstd", "b.zarr"),
        ("--format npy", "c/"),
        ("--format parquet", "d/"),
        ("--only target", "e.zarr"),
        ("--arrays lights,target_lrv", "f.zarr"),
    ] {
        succeeds(folder, &format!("{scene} {flags} -o {set}"));
        let (_, err) = succeeds(folder, &format!("verify {set} --redraw 1"));
        assert!(err.contains("3 of 3 chunks") && err.contains("3 of them drawn again"), "{set}: {err}");
    }
    forge(&folder.join("a.zarr"), "lights/c.1.0.0");
    succeeds(folder, "verify a.zarr --redraw 0");
    fails(folder, "verify a.zarr --redraw 1", 5, "lights/c.1.0.0 is not what is drawn now");
    let flipped = folder.join("f.zarr/lights/c.2.0.0");
    let mut bytes = fs::read(&flipped).unwrap();
    bytes[7] ^= 8;
    fs::write(&flipped, bytes).unwrap();
    fails(folder, "verify f.zarr --redraw 0", 5, "does not match its BLAKE3 sum");

    succeeds(folder, "scene --example condition2 --scenes 0..3 --engine cpu -o g.zarr");
    succeeds(folder, "verify g.zarr");
    forge(&folder.join("g.zarr"), "background/c.0.0");
    succeeds(folder, "verify g.zarr --redraw 0");
    fails(folder, "verify g.zarr", 5, "background/c.0.0 is not what is drawn now");
}

/// A set has its scene file, but not the models that lie beside that.
#[test]
fn scenes_of_models_that_are_not_at_hand_have_their_sums_checked() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::create_dir(folder.join("files")).unwrap();
    succeeds(folder, "fit munsell -k 3 -o files/m.json");
    let scene = "scenes = 9\n[[surface]]\nname = \"wall\"\nmodel = \"m.json\"\ncount = 5\n";
    fs::write(folder.join("files/s.toml"), scene).unwrap();
    succeeds(folder, "scene files/s.toml --engine cpu -o a.zarr");
    let (_, err) = succeeds(folder, "verify a.zarr --files files");
    assert!(err.contains("1 of them drawn again"), "{err}");
    let (_, err) = succeeds(folder, "verify a.zarr");
    for part in ["1 of 1 chunks are as", "none of them drawn again", "\"m.json\" is neither", "--files"] {
        assert!(err.contains(part), "{err}");
    }
    succeeds(folder, "fit munsell -k 4 -o files/m.json --force");
    let (_, err) = succeeds(folder, "verify a.zarr --files files");
    assert!(err.contains("the model or the mean of \"wall\" in \"files\" is not that of the set"), "{err}");
}

/// The bytes that a run would write.
#[cfg(target_os = "linux")]
fn size_of_rest(folder: &Path, run: &str) -> u64 {
    let (json, _) = succeeds(folder, &format!("{run} --dry-run --json"));
    serde_json::from_str::<serde_json::Value>(&json).unwrap()["bytes"].as_u64().unwrap()
}

/// A disk of 3 MB. Where no file system may be mounted, there is nothing to see.
#[cfg(target_os = "linux")]
#[test]
fn a_full_disk_keeps_what_was_finished() {
    let folder = tempfile::tempdir().unwrap();
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).unwrap();
    let mount = |size: &str, options: &str| {
        let mut command = Command::new("mount");
        command.args(["-t", "tmpfs", "-o", &format!("{options}size={size}"), "tmpfs"]).arg(&disk);
        command.output().is_ok_and(|output| output.status.success())
    };
    if !mount("3m", "") {
        println!("skipped: no file system may be mounted here");
        return;
    }
    let sample = "sample munsell-vrhel -n 100000 --engine cpu";
    fails(&disk, &format!("{sample} -o a.npy"), 1, "a.npy needs 12.4 MB and 3");
    fails(&disk, &format!("{sample} -o a.npy"), 1, "MB are free here (--force-space overrides)");
    let sample = &format!("{sample} --force-space");
    for format in ["npy", "npz", "csv", "h5", "mat", "parquet"] {
        fails(&disk, &format!("{sample} -o a.{format}"), 1, "No space left on device");
    }
    let set = format!("{sample} --chunk 1000 -o a.zarr");
    let output = spectroll(&disk, &set);
    let err = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.code() == Some(1) && err.contains("No space left on device"), "{err}");
    assert!(err.contains("pass --resume"), "{err}");
    assert_eq!(files(&disk), ["a.zarr.partial"]);
    // What is finished is not asked room for again.
    let (done, whole) = (size_of_rest(&disk, &format!("{set} --resume")), 12_400_000);
    assert!((1..whole).contains(&done), "{done} of {whole}");
    assert!(mount("30m", "remount,"));
    succeeds(&disk, &format!("{set} --resume"));
    assert_eq!(size_of_rest(&disk, &format!("{set} --resume")), 0);
    succeeds(&disk, "verify a.zarr --redraw 0.05");
    assert!(Command::new("umount").arg(&disk).status().unwrap().success());
}

#[test]
fn what_is_in_the_way_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(folder.join("file.zarr"), "mine").unwrap();
    fs::create_dir(folder.join("mine.zarr")).unwrap();
    let sample = "sample granada -n 5 --engine cpu";
    fails(folder, &format!("{sample} -o file.zarr"), 1, "is not a folder");
    fails(folder, &format!("{sample} -o mine.zarr"), 1, "exists already");
    fails(folder, &format!("{sample} -o mine.zarr --force"), 1, "is not a data set of this program");
    fails(folder, &format!("{sample} -o mine.zarr --resume"), 1, "is not a data set of this program");
    fails(folder, &format!("{sample} -o no/such.zarr"), 1, "create it first");
    fails(folder, &format!("{sample} -o /proc/a.zarr"), 1, "cannot write \"/proc/a.zarr\"");
    fails(folder, &format!("{sample} -o /proc/a.npy"), 1, "cannot write \"/proc/a.npy\"");
    fails(folder, &format!("{sample} -o a.npy --resume"), 2, "--resume needs an output of many files");
    fails(folder, &format!("{sample} -o a.npy --zstd"), 2, "--zstd is for .zarr");
    fails(folder, &format!("{sample} -o a.zarr --chunk 0"), 2, "at least one draw");
    fails(folder, &format!("{sample} -o a.zarr --shard 3/2"), 2, "no part 3 of 2");
    fails(folder, &format!("{sample} -o a.zarr --shard auto"), 2, "neither is set");
    fails(folder, &format!("{sample} -o a/ --format csv"), 2, "a folder holds parts");
    let (out, _) = succeeds(folder, &format!("{sample} -o a.zarr --chunk 2 --dry-run"));
    assert!(out.contains("spectra: [5, 31] float32") && out.contains("in 3 chunks of 2 draws"), "{out}");
    assert_eq!(files(folder), ["file.zarr", "mine.zarr"]);
    succeeds(folder, &format!("{sample} -o empty.zarr").replace("-n 5", "-n 0"));
    succeeds(folder, "verify empty.zarr");
    // No chunk is longer than the set.
    let (out, _) = succeeds(folder, &format!("{sample} -o a.zarr --chunk 1e18 --dry-run"));
    assert!(out.contains("in 1 chunk of 5 draws"), "{out}");
}

#[test]
fn what_is_not_there_is_not_taken_for_a_broken_set() {
    let folder = tempfile::tempdir().unwrap();
    fails(folder.path(), "verify nothing.zarr", 1, "\"nothing.zarr\" does not exist");
    fails(folder.path(), "merge nothing.zarr", 1, "\"nothing.zarr\" does not exist");
    succeeds(folder.path(), "sample granada -n 100 --engine cpu -o a.zarr --chunk 50 --shard 1/2");
    fails(folder.path(), "verify a.zarr", 1, "is not complete: its chunks are in \"a.zarr.partial\"");
    fs::create_dir(folder.path().join("b.zarr")).unwrap();
    fails(folder.path(), "verify b.zarr", 1, "it has no manifest");
}

/// Neither sees a manifest of the other when it begins.
#[test]
fn of_two_runs_that_start_at_once_one_is_refused() {
    for round in 0..6 {
        let folder = tempfile::tempdir().unwrap();
        let run = |seed: u32| {
            spectroll(
                folder.path(),
                &format!("sample granada -n 300000 --seed {seed} --engine cpu -o x.zarr"),
            )
        };
        let (first, second) = std::thread::scope(|scope| {
            let other = scope.spawn(|| run(2));
            (run(1), other.join().unwrap())
        });
        let succeeded = [&first, &second].into_iter().filter(|output| output.status.success()).count();
        assert_eq!(succeeded, 1, "round {round}: {first:?} {second:?}");
        succeeds(folder.path(), "verify x.zarr --engine cpu");
    }
}

/// A set that is replaced by the same bytes while it is read is another: what was missed on the way is no damage.
#[test]
fn a_set_that_replaces_another_is_told_from_it() {
    let folder = tempfile::tempdir().unwrap();
    let run = "sample munsell-vrhel -n 1000 --engine cpu -q -o x.zarr --chunk 100";
    succeeds(folder.path(), run);
    let path = folder.path().join("x.zarr");
    let audit = SetAudit::open(&path).unwrap();
    assert_eq!(audit.moved(), None);
    succeeds(folder.path(), &format!("{run} --force"));
    assert_eq!(audit.moved(), Some(path.clone()));
    let again = SetAudit::open(&path).unwrap();
    assert_eq!((again.moved(), again.faults().len()), (None, 0));
    // Between two names, where whoever opens it waits.
    let replaced = folder.path().join("x.zarr.replaced.partial");
    fs::rename(&path, &replaced).unwrap();
    assert_eq!(again.moved(), Some(path.clone()));
    std::thread::scope(|scope| {
        let opened = scope.spawn(|| SetAudit::open(&path).is_ok());
        std::thread::sleep(Duration::from_millis(100));
        fs::rename(&replaced, &path).unwrap();
        assert!(opened.join().unwrap());
    });
    assert!(again.moved().is_none());
}
