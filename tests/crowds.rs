//! Crowds: writers, replacers, resumers, verifiers and killers of one name at once. However they meet, what has the name
//! in the end is whole, or says of itself that it is unfinished.

#![cfg(unix)]

mod program;

use std::collections::BTreeMap;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::thread::sleep;
use std::time::Duration;

use program::{PROGRAM, files, spectroll, succeeds, tree};
use rand::RngExt;
use rand::seq::IndexedRandom;
use spectroll::{Stream, StreamRng};

/// Names, with the options that make sets or single files of them.
const OUTPUTS: [&str; 6] = [
    "x.zarr --chunk 4000",
    "x/ --format npy --chunk 4000",
    "x/ --format parquet --chunk 4000",
    "x.npy --sidecar",
    "x.csv",
    "x/ --format spd",
];

/// What a process of a crowd is there for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Part {
    Write,
    Replace,
    Resume,
    Verify,
}

const PARTS: [Part; 6] =
    [Part::Write, Part::Replace, Part::Replace, Part::Resume, Part::Resume, Part::Verify];

/// A process, with what it was asked for and what it said.
struct Member {
    part: Part,
    words: String,
    signal: Option<&'static str>,
    child: Child,
}

#[test]
fn crowds_leave_whole_sets_or_say_that_they_are_not() {
    rounds(0..18);
}

#[test]
#[ignore = "it takes minutes"]
fn two_hundred_crowds() {
    rounds(18..218);
}

/// Readers of what others replace all the time find one set or the other, whole: never parts of both, and never nothing.
#[test]
fn who_reads_while_others_replace_finds_no_damage() {
    const REPLACEMENTS: u32 = 60;
    let folder = tempfile::tempdir().unwrap();
    let set = |seed: u32, end: &str| {
        format!(
            "sample munsell-vrhel -n 20000 --engine cpu -t 1 -q --seed {seed} -o x.zarr --chunk 500 {end}"
        )
    };
    let file = |seed: u32, end: &str| {
        format!("sample munsell-vrhel -n 20000 --engine cpu -t 1 -q --seed {seed} -o y.npy --sidecar {end}")
    };
    for words in [set(1, ""), file(1, "")] {
        succeeds(folder.path(), &words);
    }
    let running = Arc::new(());
    let readable = Arc::downgrade(&running);
    let replace = |words: &dyn Fn(u32, &str) -> String, _running: Arc<()>| {
        (0..REPLACEMENTS).for_each(|i| _ = succeeds(folder.path(), &words(1 + i % 2, "--force")));
    };
    let read = |words: &str, may_be: &[i32]| {
        let mut reads = 0;
        while readable.strong_count() > 0 {
            let output = spectroll(folder.path(), words);
            assert!(output.status.code().is_some_and(|code| may_be.contains(&code)), "{words}: {output:?}");
            reads += 1;
        }
        println!("{words}: {reads} times");
        assert!(reads > 0);
    };
    std::thread::scope(|scope| {
        let again = Arc::clone(&running);
        scope.spawn(|| replace(&set, again));
        scope.spawn(|| replace(&file, running));
        scope.spawn(|| read("verify x.zarr -q", &[0]));
        scope.spawn(|| read("verify y.npy -q", &[0]));
        // Who resumes one of the two may find the other, which is an error of its own.
        scope.spawn(|| read(&set(1, "--resume"), &[0, 1]));
    });
}

fn rounds(rounds: std::ops::Range<u32>) {
    let mut ends = BTreeMap::new();
    for round in rounds {
        let mut random = Stream::named(7, &format!("crowd {round}")).rng();
        let output = OUTPUTS[round as usize % OUTPUTS.len()];
        *ends.entry((output, crowd(output, round, &mut random))).or_insert(0) += 1;
    }
    eprintln!("{ends:#?}");
    // A test in which nobody ever succeeds would show nothing.
    assert!(ends.keys().any(|(_, end)| *end == End::Whole), "{ends:?}");
}

/// What the name has after a crowd.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum End {
    Whole,
    /// A file without its sidecar.
    Alone,
    Unfinished,
    Nothing,
}

fn run_of(output: &str, seed: u32) -> String {
    let count = if output.ends_with("spd") { 400 } else { 60_000 };
    format!("sample munsell-vrhel -n {count} --engine cpu -t 1 -q --seed {seed} -o {output}")
}

fn name_of(output: &str) -> &str {
    output.split(' ').next().unwrap().trim_end_matches('/')
}

/// One crowd in a folder of its own.
fn crowd(output: &str, round: u32, random: &mut StreamRng) -> End {
    let folder = tempfile::tempdir().unwrap();
    let name = name_of(output);
    let is_set = output.contains("--chunk");
    let mut members = Vec::new();
    for _ in 0..random.random_range(3..7) {
        sleep(Duration::from_millis(random.random_range(0..120)));
        let part = *PARTS.choose(random).unwrap();
        let words = match part {
            Part::Write => run_of(output, random.random_range(1..3)),
            Part::Replace => run_of(output, random.random_range(1..3)) + " --force",
            Part::Resume if is_set => run_of(output, random.random_range(1..3)) + " --resume",
            Part::Verify if is_set || output.contains("--sidecar") => format!("verify {name} -q"),
            Part::Resume | Part::Verify => continue,
        };
        let mut command = Command::new(PROGRAM);
        command.args(words.split_whitespace()).current_dir(folder.path());
        let child = command.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().unwrap();
        members.push(Member { part, words, signal: None, child });
    }
    for member in &mut members {
        if random.random_range(0..3) == 0 {
            sleep(Duration::from_millis(random.random_range(0..150)));
            let signal = *["KILL", "TERM", "INT", "KILL", "HUP"].choose(random).unwrap();
            if member.child.try_wait().unwrap().is_none() {
                let id = member.child.id().to_string();
                assert!(Command::new("kill").args([&format!("-{signal}"), &id]).status().unwrap().success());
                member.signal = Some(signal);
            }
        }
    }
    let mut account = format!("round {round}, {output}:\n");
    let (mut wrote, mut succeeded, mut killed) = (false, false, false);
    for member in members {
        let Member { part, words, signal, child } = member;
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        account += &format!("  {words}: {signal:?} {} {said}\n", output.status);
        assert!(!said.contains("panicked"), "{account}");
        // Nobody has damaged anything.
        assert_ne!(output.status.code(), Some(5), "{account}");
        assert!(output.status.code().is_some() || signal.is_some(), "{account}");
        wrote |= part != Part::Verify;
        succeeded |= part != Part::Verify && output.status.success();
        killed |= signal.is_some();
    }
    check(folder.path(), output, &account, succeeded, killed || !wrote)
}

/// Checks what a crowd left.
fn check(folder: &Path, output: &str, account: &str, succeeded: bool, may_be_nothing: bool) -> End {
    let name = name_of(output);
    let is_verified = output.contains("--chunk") || output.contains("--sidecar");
    let account = format!("{account}  left: {:?}", files(folder));
    let expected = [1, 2].map(|seed| {
        let folder = tempfile::tempdir().unwrap();
        succeeds(folder.path(), &run_of(output, seed));
        tree(folder.path())
    });
    let found = |folder: &Path| {
        let own = |(path, _): &(String, Vec<u8>)| !path.contains(".partial");
        tree(folder).into_iter().filter(own).collect::<Vec<_>>()
    };
    let without_sidecar = |tree: &Vec<(String, Vec<u8>)>| {
        let own = tree.iter().filter(|(path, _)| path == name);
        own.cloned().collect::<Vec<_>>()
    };
    let left = found(folder);
    // A file appears before its sidecar. Who was killed in between left the file alone, and whole.
    let is_alone = may_be_nothing
        && folder.join(name).is_file()
        && !expected.contains(&left)
        && expected.each_ref().map(without_sidecar).contains(&left);
    let end = if is_alone {
        End::Alone
    } else if folder.join(name).exists() {
        assert!(expected.contains(&left), "{account}");
        if is_verified {
            succeeds(folder, &format!("verify {name} --engine cpu --redraw 1"));
        }
        End::Whole
    } else {
        assert!(!succeeded, "a run said that it had written, and there is nothing: {account}");
        if is_verified {
            let output = spectroll(folder, &format!("verify {name}"));
            assert_eq!(output.status.code(), Some(1), "{output:?} {account}");
        }
        if folder.join(format!("{name}.partial")).exists() { End::Unfinished } else { End::Nothing }
    };
    assert!(may_be_nothing || end == End::Whole, "nobody was killed: {account}");
    // Whatever is left, the next run gets by: one that replaces, or one that goes on.
    let (option, seed) = match (output.contains("--chunk"), end) {
        (true, End::Unfinished) => {
            // A set that was killed before it had a manifest is begun anew.
            let is_of_second = |(path, bytes): &(String, Vec<u8>)| {
                path.contains("manifest") && String::from_utf8_lossy(bytes).contains("\"seed\": 2")
            };
            let is_second = tree(&folder.join(format!("{name}.partial"))).iter().any(is_of_second);
            ("--resume", if is_second { 2 } else { 1 })
        }
        _ => ("--force", 1),
    };
    succeeds(folder, &format!("{} {option}", run_of(output, seed)));
    assert!(found(folder) == expected[seed as usize - 1], "after {option}: {account}");
    end
}
