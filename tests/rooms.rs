//! The rooms of `src/` in the order in which the data pass through them: a room imports only from those before it.
//! Tests inside the rooms may look at everything.

mod sources;

use std::fs;
use std::path::Path;

use sources::sources;

/// Every room, in order. `lib.rs` and `main.rs`, which see them all, are none.
const ROOMS: [&str; 28] = [
    "caught",
    "plain_file",
    "suggestion",
    "threads",
    "wording",
    "grid",
    "dataset",
    "colorimetry",
    "sensors",
    "affine",
    "draw_status",
    "quantity",
    "random",
    "cover",
    "mixture",
    "model",
    "program",
    "cpu",
    "wgsl",
    "recipe",
    "sampler",
    "engine",
    "metamers",
    "scene",
    "output",
    "export",
    "evaluation",
    "cli",
];

/// The code of a file without its tests and its comments.
fn code(text: &str) -> String {
    let before_tests = text.find("#[cfg(test)]\nmod tests {").map_or(text, |end| &text[..end]);
    let mut lines = Vec::new();
    let mut is_for_tests = false;
    for line in before_tests.lines() {
        let line = line.split("//").next().unwrap_or("");
        if !is_for_tests {
            lines.push(line);
        }
        // An import for tests alone stands on the line after its attribute.
        is_for_tests = line.trim() == "#[cfg(test)]";
    }
    lines.join("\n")
}

/// The rooms that a file of `src/` names, as `crate::ROOM` or, in the program, as `spectroll::ROOM`.
fn imports(text: &str) -> Vec<&'static str> {
    let code = code(text);
    let mut found = Vec::new();
    for (at, _) in code.match_indices("crate::") {
        let rest = &code[at + "crate::".len()..];
        let names: Vec<&str> = match rest.strip_prefix('{') {
            Some(list) => list.split('}').next().unwrap_or("").split(',').collect(),
            None => vec![rest],
        };
        for name in names {
            let name = name.trim().split(|c: char| !c.is_alphanumeric() && c != '_').next().unwrap_or("");
            found.extend(ROOMS.iter().find(|room| **room == name));
        }
    }
    found
}

fn room(path: &Path) -> Option<usize> {
    let inside = path.strip_prefix("src").expect("it is in src");
    let first = inside.components().next().expect("it has a name").as_os_str().to_string_lossy().into_owned();
    let name = first.trim_end_matches(".rs");
    ROOMS.iter().position(|room| *room == name)
}

fn faults(path: &Path, text: &str) -> Vec<String> {
    let Some(own) = room(path) else { return Vec::new() };
    let above = |name: &&str| ROOMS.iter().position(|room| room == name).is_some_and(|other| other > own);
    let found = imports(text).into_iter().filter(above);
    found.map(|name| format!("{} imports from {name}, which comes after it", path.display())).collect()
}

#[test]
fn imports_run_one_way() {
    let files = sources();
    assert!(files.len() > 100, "{} files", files.len());
    let mut wrong = Vec::new();
    for (path, text) in &files {
        let name = path.file_name().expect("it has a name").to_string_lossy();
        // Files of tests alone.
        if name == "tests.rs" || name == "probe.rs" {
            continue;
        }
        if room(path).is_none() {
            assert!(["lib.rs", "main.rs"].contains(&&*name), "{} is in no room", path.display());
        }
        wrong.extend(faults(path, text));
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn an_import_from_above_is_noticed() {
    let path = Path::new("src/random/normal.rs");
    assert!(faults(path, "use crate::{grid, recipe::Recipe};\n").len() == 1);
    assert!(faults(path, "fn f() { crate::engine::open() }\n").len() == 1);
    assert!(faults(path, "#[cfg(test)]\nuse crate::engine::Engine;\n").is_empty());
    assert!(faults(path, "use crate::grid::Grid; // not crate::engine\n").is_empty());
}

#[test]
fn few_files_lie_loose() {
    let loose =
        fs::read_dir(Path::new(env!("CARGO_MANIFEST_DIR")).join("src")).expect("the sources are there");
    let loose = loose.filter(|entry| entry.as_ref().expect("it can be read").path().is_file()).count();
    assert!(loose <= 12, "{loose} files lie loose in src");
}
