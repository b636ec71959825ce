//! Runs of the program, and of Python on what they leave.

// Each test binary has this module, and none uses all of it.
#![allow(dead_code)]

use std::fs;
use std::io::Read;
use std::path::Path;
use std::process::{Child, Command, Output};
use std::time::Duration;

pub(crate) const PROGRAM: &str = env!("CARGO_BIN_EXE_spectroll");

pub(crate) fn spectroll(folder: &Path, arguments: &str) -> Output {
    Command::new(PROGRAM).args(arguments.split_whitespace()).current_dir(folder).output().unwrap()
}

/// Standard output and error of a run that succeeds.
pub(crate) fn succeeds(folder: &Path, arguments: &str) -> (String, String) {
    let output = spectroll(folder, arguments);
    let text = |bytes| String::from_utf8(bytes).unwrap();
    let (out, err) = (text(output.stdout), text(output.stderr));
    assert!(output.status.success(), "{arguments}: {err}");
    (out, err)
}

/// A run that fails with this exit code and says this, and leaves no new file.
pub(crate) fn fails(folder: &Path, arguments: &str, code: i32, message: &str) {
    let before = files(folder);
    let output = spectroll(folder, arguments);
    let err = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{arguments}: {err}");
    assert!(err.contains(message), "{arguments}: {err}");
    assert!(!err.contains("panicked"), "{arguments}: {err}");
    assert_eq!(files(folder), before, "{arguments} left something behind");
}

/// Waits until this has happened in a run that is to go on for longer, however slow the machine.
pub(crate) fn wait_until(child: &mut Child, happened: impl Fn() -> bool) {
    while !happened() {
        if let Some(status) = child.try_wait().unwrap() {
            let mut err = String::new();
            child.stderr.take().map(|mut stderr| stderr.read_to_string(&mut err));
            panic!("it ended too early, with {status}: {err}");
        }
        std::thread::sleep(Duration::from_millis(10));
    }
}

pub(crate) fn files(folder: &Path) -> Vec<String> {
    let mut names: Vec<_> =
        fs::read_dir(folder).unwrap().map(|f| f.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

/// Every file below a folder, with its bytes.
pub(crate) fn tree(folder: &Path) -> Vec<(String, Vec<u8>)> {
    let mut all = Vec::new();
    for name in files(folder) {
        let path = folder.join(&name);
        match path.is_dir() {
            true => {
                all.extend(tree(&path).into_iter().map(|(inner, bytes)| (format!("{name}/{inner}"), bytes)))
            }
            false => all.push((name, fs::read(path).unwrap())),
        }
    }
    all
}

/// The text of a manifest, with the sum that it has to end with.
pub(crate) fn signed(text: &str) -> String {
    let end = "\"\n}\n";
    let (start, _) = text.rsplit_once("\"blake3\": \"").unwrap();
    let start = format!("{start}\"blake3\": \"");
    format!("{start}{}{end}", blake3::hash(format!("{start}{end}").as_bytes()).to_hex())
}

/// Shape and values of an array of 32-bit floats in C order.
pub(crate) fn npy(path: &Path) -> (Vec<u64>, Vec<f32>) {
    let bytes = fs::read(path).unwrap();
    let end = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..end]).unwrap();
    assert!(header.contains("'<f4'") && header.contains("'fortran_order': False"), "{header}");
    let shape = header.split_once('(').unwrap().1.split_once(')').unwrap().0;
    let shape: Vec<u64> =
        shape.split(", ").filter(|extent| !extent.is_empty()).map(|e| e.parse().unwrap()).collect();
    let values: Vec<f32> = bytemuck::pod_collect_to_vec(&bytes[end..]);
    assert_eq!(values.len() as u64, shape.iter().product::<u64>());
    (shape, values)
}

/// What a script of this folder prints, whose `main` takes the program, the tables in `data`, and these arguments.
pub(crate) fn script(folder: &Path, name: &str, arguments: &str) -> String {
    let [tests, data] = ["tests", "data"].map(|name| format!("{}/{name}", env!("CARGO_MANIFEST_DIR")));
    let code = format!(
        "import sys, warnings\n\
         warnings.simplefilter('ignore')\n\
         sys.dont_write_bytecode = True\n\
         sys.path.insert(0, {tests:?})\n\
         import {name}\n\
         {name}.main({PROGRAM:?}, {data:?}{arguments})"
    );
    python(folder, &code)
}

/// What Python prints. SPECTROLL_PYTHON names one that has the readers of every format; `make test` makes one.
pub(crate) fn python(folder: &Path, code: &str) -> String {
    let python = std::env::var("SPECTROLL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let output = Command::new(python).args(["-W", "error", "-c", code]).current_dir(folder).output().unwrap();
    let err = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{code}\n{err}");
    String::from_utf8(output.stdout).unwrap().trim().to_owned()
}
