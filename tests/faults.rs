//! System calls that fail: the program ends with an exit code that is not 0, or with the whole file.
//!
//! A library is preloaded that lets one call fail, or all from one on. Calls that no C library makes are not seen:
//! temporary files are moved to their names by system calls of their own.

#![cfg(target_os = "linux")]

mod program;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::sync::OnceLock;

use program::{PROGRAM, tree};
use rayon::prelude::*;

/// The kinds of call, with an error that each may have.
const FAULTS: [&str; 20] = [
    "write:EIO",
    "write:ENOSPC",
    "write:EDQUOT",
    "write:EPIPE",
    "write:EINTR",
    "write:SHORT",
    "write:ZERO",
    "fsync:EIO",
    "rename:ENOSPC",
    "rename:ENOSYS",
    "link:EPERM",
    "mkdir:ENOSPC",
    "unlink:EIO",
    "truncate:ENOSPC",
    "seek:EIO",
    "lock:ENOSYS",
    "create:EMFILE",
    "create:EACCES",
    "thread:EAGAIN",
    "map:ENOMEM",
];

/// Runs that write each format, without what this build leaves out.
const RUNS: &[&str] = &[
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q -o x.csv",
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q -o x.npy",
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q --quantities spectra,xyz,attempts -o x.npz",
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q -o x.mat",
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q --chunk 1000 -o x.zarr",
    "sample munsell-vrhel -n 40 --engine cpu -t 2 -q -o x.spd",
    "sample munsell-vrhel -n 300 --engine cpu -t 2 -q --sidecar -o x.npy",
    "scene --example condition3 --scenes 0..5 --engine cpu -q -o x.npz",
    "fit munsell vrhel -o x.json",
    #[cfg(feature = "hdf5")]
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q -o x.h5",
    #[cfg(feature = "parquet")]
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q -o x.parquet",
    #[cfg(feature = "zstd")]
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q --chunk 1000 --zstd -o x.zarr",
    #[cfg(feature = "parquet")]
    "sample munsell-vrhel -n 3000 --engine cpu -t 2 -q --chunk 1000 --format parquet -o x/",
];

/// The library to preload.
fn shim() -> &'static Path {
    static SHIM: OnceLock<PathBuf> = OnceLock::new();
    SHIM.get_or_init(|| {
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/faults/shim.c");
        let library = Path::new(env!("CARGO_TARGET_TMPDIR")).join("faults.so");
        let mut compiler = Command::new("cc");
        compiler
            .args(["-shared", "-fPIC", "-O1", "-o"])
            .args([&library, &source])
            .args(["-ldl", "-lpthread"]);
        assert!(compiler.status().expect("a C compiler is there").success());
        library
    })
}

/// A run in which one call fails, or all from one on; ended after a minute.
fn run(folder: &Path, arguments: &str, fault: &str, at: u64, always: bool) -> Output {
    let mut command = Command::new("timeout");
    // By `env`, so that `timeout` itself does without.
    command.args(["60", "env"]).arg(format!("LD_PRELOAD={}", shim().display())).arg(PROGRAM);
    command.args(arguments.split_whitespace()).current_dir(folder);
    command.env("FAULT", fault).env("FAULT_AT", at.to_string());
    command.env("FAULT_COUNT", folder.with_extension("count"));
    if always {
        command.env("FAULT_ALWAYS", "1");
    }
    command.stdin(Stdio::null()).output().unwrap()
}

/// What is wrong with the end of a run, if anything. `whole` is what it leaves where nothing fails.
fn verdict(folder: &Path, output: &Output, whole: &[(String, Vec<u8>)]) -> Option<String> {
    let said = String::from_utf8_lossy(&output.stderr);
    let left = tree(folder);
    // A set may be left unfinished, and a file marked as partial; not half a file with the name that was asked for.
    let half = || {
        let is_half = |(name, bytes): &&(String, Vec<u8>)| {
            !name.contains(".partial") && !whole.iter().any(|(n, b)| n == name && b == bytes)
        };
        left.iter().find(is_half).map(|(name, _)| format!("half of {name} is left: {said}"))
    };
    // The standard library itself ends a program one of whose threads has no stack for signals.
    let is_of_rust = said.contains("failed to allocate an alternative stack");
    match output.status.code() {
        None | Some(101 | 134) if is_of_rust => half(),
        _ if said.contains("panicked") && !is_of_rust => Some(format!("it panics: {said}")),
        None => Some(format!("it is ended by a signal: {}", output.status)),
        Some(124 | 125..) => Some(format!("it hangs: {}", output.status)),
        // What cannot be deleted is left beside it.
        Some(0) if whole.iter().any(|file| !left.contains(file)) => {
            Some("exit code 0, and not the whole file".to_owned())
        }
        Some(0) => None,
        Some(_) if said.trim().is_empty() => Some("it fails without a word".to_owned()),
        Some(_) => half(),
    }
}

/// Lets the calls of some kinds fail in some runs: those of the numbers that `at` picks of the count of such calls, each
/// alone or with all that follow it.
fn try_all(runs: &[&str], at: impl Fn(u64) -> Vec<(u64, bool)> + Sync) -> (usize, Vec<String>) {
    // Much of the time is spent on waiting for the disk.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(8).build().unwrap();
    let results: Vec<_> = pool.install(|| runs.par_iter().map(|run| try_run(run, &at)).collect());
    let tried = results.iter().map(|(tried, _)| tried).sum();
    (tried, results.into_iter().flat_map(|(_, wrong)| wrong).collect())
}

/// As [`try_all`], in one run.
fn try_run(arguments: &str, at: &impl Fn(u64) -> Vec<(u64, bool)>) -> (usize, Vec<String>) {
    let (mut tried, mut wrong) = (0, Vec::new());
    let root = tempfile::tempdir().unwrap();
    let make = |name: &str| {
        let folder = root.path().join(name);
        fs::create_dir(&folder).unwrap();
        folder
    };
    let folder = make("whole");
    let output = run(&folder, arguments, "none:EIO", 1, false);
    assert!(output.status.success(), "{arguments}: {}", String::from_utf8_lossy(&output.stderr));
    let whole = tree(&folder);
    for fault in FAULTS {
        let folder = make("count");
        run(&folder, arguments, fault, u64::MAX >> 1, false);
        let count: u64 = fs::read_to_string(folder.with_extension("count")).unwrap().parse().unwrap();
        fs::remove_dir_all(&folder).unwrap();
        let mut numbers = at(count);
        // Whoever is interrupted tries again, which would never end if that happened each time.
        let ends = |always: bool| !(always && fault == "write:EINTR");
        numbers.retain(|&(number, always)| (1..=count).contains(&number) && ends(always));
        numbers.dedup();
        for (number, always) in numbers {
            let folder = make("fault");
            let output = run(&folder, arguments, fault, number, always);
            tried += 1;
            let place = || {
                let more = if always { " and all after it" } else { "" };
                format!("{arguments}: {fault} at {number} of {count}{more}")
            };
            wrong.extend(verdict(&folder, &output, &whole).map(|what| format!("{}: {what}", place())));
            fs::remove_dir_all(&folder).unwrap();
        }
    }
    (tried, wrong)
}

/// The first call of each kind, one in the middle, the last, and all.
#[test]
fn no_call_that_fails_leaves_half_a_file() {
    let picked = |count| vec![(1, true), (1, false), (count / 2, false), (count, false)];
    let (tried, wrong) = try_all(RUNS, picked);
    assert!(tried > 300, "{tried}");
    assert!(wrong.is_empty(), "{} of {tried}:\n{}", wrong.len(), wrong.join("\n"));
}

/// Every call of each kind.
#[test]
#[ignore = "minutes: make faults"]
fn no_call_of_any_number_that_fails_leaves_half_a_file() {
    let (tried, wrong) =
        try_all(RUNS, |count| (1..=count).flat_map(|number| [(number, false), (number, true)]).collect());
    println!("{tried} runs with a call that fails");
    assert!(wrong.is_empty(), "{} of {tried}:\n{}", wrong.len(), wrong.join("\n"));
}

/// The check itself: half a file that the program calls whole, and a panic.
#[test]
fn a_wrong_end_is_noticed() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let whole = vec![("x.npy".to_owned(), b"whole".to_vec())];
    let end = |script: &str| {
        let output = Command::new("sh").args(["-c", script]).current_dir(folder).output().unwrap();
        verdict(folder, &output, &whole)
    };
    assert_eq!(end("printf whole > x.npy"), None);
    assert!(end("printf who > x.npy").unwrap().contains("not the whole file"));
    assert!(end("printf who > x.npy; echo no >&2; exit 1").unwrap().contains("half of x.npy"));
    assert_eq!(end("rm x.npy; printf who > x.npy.partial; echo no >&2; exit 1"), None);
    assert!(end("exit 1").unwrap().contains("without a word"));
    assert!(end("echo thread panicked >&2; exit 101").unwrap().contains("panics"));
    assert!(end("kill -SEGV $$").unwrap().contains("signal"));
}
