//! Ctrl-C and the like, as users and schedulers send them.

#![cfg(unix)]

mod program;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::time::{Duration, Instant};

use program::{PROGRAM, files, wait_until};

/// In the middle of a large file: exit code 130, soon, and nothing left behind.
#[test]
fn an_interrupt_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    for arguments in [
        "sample munsell-vrhel -n 1e9 -o big.npy --force-space --engine gpu",
        "sample munsell-vrhel -n 1e9 -o big.npy --force-space --engine cpu",
    ] {
        let arguments = arguments.split_whitespace();
        let mut child = Command::new(PROGRAM).args(arguments).current_dir(folder.path()).spawn().unwrap();
        wait_until(&mut child, || !files(folder.path()).is_empty());
        std::thread::sleep(Duration::from_millis(300));
        assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(130));
        assert!(files(folder.path()).is_empty());
    }
}

/// As `nohup` starts it.
#[cfg(target_os = "linux")]
#[test]
fn a_hangup_that_is_ignored_stays_ignored() {
    let folder = tempfile::tempdir().unwrap();
    let run = |trap: &str| {
        let script = format!(
            "{trap}; {PROGRAM} sample granada -n 3e7 --engine cpu -t 1 -q -o a.npy & \
             while [ -z \"$(ls -A)\" ]; do sleep 0.02; done; kill -HUP $!; wait $!"
        );
        // Whoever started the tests may have it ignored, which a shell cannot take back.
        let shell = ["--default-signal=HUP", "sh", "-c", &script];
        Command::new("env").args(shell).current_dir(folder.path()).output().unwrap()
    };
    assert_eq!(run("true").status.code(), Some(130));
    assert!(files(folder.path()).is_empty());
    assert_eq!(run("trap '' HUP").status.code(), Some(0));
    assert_eq!(files(folder.path()), ["a.npy"]);
}

fn start(folder: &Path, arguments: &str, stdout: Stdio, stderr: Stdio) -> Child {
    let mut command = Command::new(PROGRAM);
    command.args(arguments.split_whitespace()).current_dir(folder).stdout(stdout).stderr(stderr);
    command.spawn().unwrap()
}

/// Sends Ctrl-C, and returns the end that it must bring within a second; two more for a slow machine.
fn interrupted(mut child: Child) -> ExitStatus {
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let start = Instant::now();
    loop {
        if let Some(status) = child.try_wait().unwrap() {
            return status;
        }
        if start.elapsed() > Duration::from_secs(3) {
            child.kill().unwrap();
            panic!("it goes on");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

/// Nobody reads the pipe, so that each write to it waits.
#[test]
fn an_interrupt_is_heard_on_a_full_pipe() {
    let folder = tempfile::tempdir().unwrap();
    for engine in ["cpu", "gpu"] {
        let run = format!("sample munsell-vrhel -n 1e8 --engine {engine} -o -");
        let child = start(folder.path(), &run, Stdio::piped(), Stdio::null());
        std::thread::sleep(Duration::from_millis(800));
        assert_eq!(interrupted(child).code(), Some(130));
    }
    assert!(files(folder.path()).is_empty());
}

/// What takes long before anything is drawn says so, and can be ended.
#[test]
fn long_preparations_say_so_and_are_ended() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let mut scene = String::from("scenes = 2\n");
    for group in 0..400 {
        scene += &format!(
            "[[target]]\nname = \"wall{group}\"\nmodel = \"munsell-vrhel\"\nlrv = 0.{:03}\n",
            960 + group % 30
        );
    }
    fs::write(folder.join("s.toml"), scene).unwrap();
    let mut child = start(folder, "scene s.toml --engine cpu -o x.npz", Stdio::null(), Stdio::piped());
    let mut said = String::new();
    let mut lines = std::io::BufReader::new(child.stderr.take().unwrap());
    std::io::BufRead::read_line(&mut lines, &mut said).unwrap();
    assert!(said.starts_with("preparing the scenes (2 s so far)"), "{said}");
    // Before anything is begun, the signal does what it does; shells have it ignored for what they start with `&`.
    assert!(Command::new("kill").args(["-TERM", &child.id().to_string()]).status().unwrap().success());
    assert!(!child.wait().unwrap().success());
    assert_eq!(files(folder), ["s.toml"]);
}
