//! What is wrong with a scene file: every message names the file, the line and the key, and says what to do.

use std::path::Path;

use spectroll::Model;
use spectroll::scene::{PRESETS, Scene};

/// A file of one group of each kind, with lines replaced: `key` of the group `table` (or of the scene, where that is
/// empty) becomes `line`, or goes where that is empty, or comes where it was not.
fn file(table: &str, key: &str, line: &str) -> String {
    let parts: [(&str, &[&str]); 4] = [
        ("", &["scenes = 100", "seed = 1", "wavelengths = \"400:10:700\""]),
        ("illuminant", &["name = \"lights\"", "model = \"granada\"", "count = 3"]),
        ("surface", &["name = \"background\"", "model = \"munsell-vrhel\"", "count = 99"]),
        ("target", &["name = \"target\"", "model = \"munsell-vrhel\"", "lrv = 0.4"]),
    ];
    let mut text = String::new();
    for (name, lines) in parts {
        if !name.is_empty() {
            text += &format!("[[{name}]]\n");
        }
        let is_key = |other: &&str| other.split(' ').next() == Some(key);
        let replaces = name == table;
        for other in lines {
            match replaces && is_key(other) {
                true if line.is_empty() => {}
                true => text += &format!("{line}\n"),
                false => text += &format!("{other}\n"),
            }
        }
        if replaces && !line.is_empty() && !lines.iter().any(is_key) {
            text += &format!("{line}\n");
        }
    }
    text
}

fn error(text: &str, folder: &Path) -> String {
    match Scene::parse("bad.toml", text, folder) {
        Ok(_) => panic!("it is accepted:\n{text}"),
        Err(error) => error.to_string(),
    }
}

#[test]
fn every_mistake_is_named_with_its_line_and_a_remedy() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let write =
        |name: &str, text: &str| std::fs::write(folder.path().join(name), text).expect("it is written");
    write("broken.json", "{ \"schema\": 1 ");
    let fine = Model::builtin("munsell-vrhel-5nm").expect("it is built in");
    write("fine.json", &fine.to_json());
    write("two.csv", "nm,a,b\n380,1,2\n540,1,2\n780,1,2\n");
    write("short.csv", "500,1\n540,2\n600,3\n");
    write("narrow.csv", "380;1\n390;2\n");
    let dips = (40..=70)
        .map(|ten| format!("{ten}0,{}\n", if ten == 50 { "-0.2" } else { "2.0" }))
        .collect::<String>();
    write("negative.csv", &dips);
    let coarse = Scene::parse("ok.toml", &file("", "seed", ""), folder.path());
    assert!(coarse.is_ok(), "the file that is changed below is a good one");

    // Where it is (table and key), what stands there, and what the message must have: line, key and remedy.
    let table: &[(&str, &str, &str, &[&str])] = &[
        ("", "scenes", "", &["line 1, scenes", "missing", "scenes = 1000"]),
        ("", "scenes", "scenes = 0", &["line 1, scenes", "0 scenes", "1 to 4294967296"]),
        ("", "scenes", "scenes = -5", &["line 1, scenes", "this is -5", "a whole number"]),
        ("", "scenes", "scenes = 1.5", &["line 1, scenes", "this is 1.5", "a whole number"]),
        ("", "scenes", "scenes = \"many\"", &["line 1, scenes", "the text \"many\"", "a whole number"]),
        ("", "scenes", "scenes = 5000000000", &["line 1, scenes", "1 to 4294967296"]),
        ("", "scenes", "scenes = 4000000000", &["line 1, scenes", "4.12e11 draws", "draw fewer scenes"]),
        ("", "seed", "seed = \"one\"", &["line 2, seed", "a whole number"]),
        ("", "seed", "sead = 1", &["line 2, sead", "did you mean \"seed\"?"]),
        ("", "wavelengths", "wavelengths = \"400-700\"", &["line 3, wavelengths", "400:10:700"]),
        ("", "wavelengths", "wavelengths = \"400:7:700\"", &["line 3, wavelengths", "whole number of steps"]),
        ("", "wavelengths", "wavelengths = 400", &["line 3, wavelengths", "text in quotes"]),
        (
            "",
            "wavelengths",
            "wavelengths = \"380:5:780\"",
            &["line 10, model of \"background\"", "400 to 700 nm", "380:5:780", "choose one within it"],
        ),
        (
            "surface",
            "model",
            "model = \"fine.json\"",
            &["line 10, model of \"background\"", "400:5:700", "set wavelengths = "],
        ),
        ("illuminant", "name", "", &["line 4, name", "missing", "name = "]),
        ("illuminant", "name", "name = \"\"", &["line 5, name", "letters, digits"]),
        ("illuminant", "name", "name = \"my lights\"", &["line 5, name of \"my lights\"", "letters, digits"]),
        ("illuminant", "name", "name = 3", &["line 5, name", "text in quotes"]),
        ("surface", "name", "name = \"lights\"", &["line 9, name of \"lights\"", "two groups", "rename one"]),
        (
            "surface",
            "name",
            "name = \"target_lrv\"",
            &["line 13, name of \"target\"", "one name", "rename one of them"],
        ),
        ("illuminant", "count", "", &["line 4, count of \"lights\"", "missing", "count = 3"]),
        ("illuminant", "count", "count = 0", &["line 7, count of \"lights\"", "1 to 10000000"]),
        ("illuminant", "count", "count = -3", &["line 7, count of \"lights\"", "this is -3", "whole number"]),
        ("surface", "count", "count = 100000000", &["line 11, count of \"background\"", "several groups"]),
        ("surface", "count", "cuont = 9", &["line 11, cuont of \"background\"", "did you mean \"count\"?"]),
        ("surface", "model", "", &["line 8, model of \"background\"", "missing", "munsell-vrhel"]),
        (
            "surface",
            "model",
            "model = \"munsel-vrhel\"",
            &["line 10, model of \"background\"", "did you mean \"munsell-vrhel\"?"],
        ),
        (
            "surface",
            "model",
            "model = \"no/such.json\"",
            &["line 10, model", "neither a file nor", "granada"],
        ),
        ("surface", "model", "model = \"broken.json\"", &["line 10, model", "is not a model file"]),
        ("surface", "model", "model = \"granada\"", &["line 10, model", "of illuminants", "choose another"]),
        (
            "illuminant",
            "model",
            "model = \"munsell-vrhel\"",
            &["line 6, model", "of reflectances", "choose another"],
        ),
        ("target", "model", "model = \"granada\"", &["line 14, model of \"target\"", "choose another model"]),
        ("surface", "cov_scale", "cov_scale = -1", &["line 12, cov_scale", "finite and not negative"]),
        ("surface", "cov_scale", "cov_scale = \"big\"", &["line 12, cov_scale", "it takes a number"]),
        ("surface", "cov_scale", "cov_scale = nan", &["line 12, cov_scale", "finite and not negative"]),
        ("surface", "fixed", "fixed = 1", &["line 12, fixed", "this is 1", "true or false"]),
        (
            "surface",
            "intensity",
            "intensity = 2",
            &["line 12, intensity of \"background\"", "there are name, model"],
        ),
        (
            "surface",
            "quantities",
            "quantities = [\"spectra\", \"chromacity\"]",
            &["line 12, quantities of \"background\"", "did you mean \"chromaticity\"?", "spectra, xyz,"],
        ),
        (
            "illuminant",
            "quantities",
            "quantities = [\"lrv\"]",
            &["line 8, quantities of \"lights\"", "no \"lrv\""],
        ),
        (
            "target",
            "quantities",
            "quantities = []",
            &["line 16, quantities of \"target\"", "name one at least"],
        ),
        ("target", "quantities", "quantities = \"xyz\"", &["line 16, quantities", "a list, as in"]),
        ("surface", "max_attempts", "max_attempts = 0", &["line 12, max_attempts", "at least 1 attempt"]),
        (
            "illuminant",
            "intensity",
            "intensity = { log_uniform = [150, 0.15] }",
            &["line 8, intensity of \"lights\"", "the second must be above the first"],
        ),
        (
            "illuminant",
            "intensity",
            "intensity = { log_uniform = [1] }",
            &["line 8, intensity.log_uniform of \"lights\"", "two numbers", "a list of 1 value"],
        ),
        (
            "illuminant",
            "intensity",
            "intensity = { loguniform = [1, 2] }",
            &["line 8, intensity.loguniform", "did you mean \"log_uniform\"?"],
        ),
        (
            "illuminant",
            "intensity",
            "intensity = { shared = true }",
            &["line 8, intensity", "log_uniform = [0.15"],
        ),
        (
            "illuminant",
            "intensity",
            "intensity = { log_uniform = [1, 2], from_data = true }",
            &["line 8, intensity.from_data", "keep one of the two"],
        ),
        ("illuminant", "intensity", "intensity = 0", &["line 8, intensity", "above 0"]),
        (
            "illuminant",
            "intensity",
            "intensity = \"bright\"",
            &["line 8, intensity", "a number, { log_uniform"],
        ),
        ("illuminant", "mean", "mean = \"d56\"", &["line 8, mean", "d65, flat"]),
        ("illuminant", "mean", "mean = \"two.csv\"", &["line 8, mean", "2 spectra", "leave the others out"]),
        ("illuminant", "mean", "mean = \"short.csv\"", &["line 8, mean", "500 to 600 nm"]),
        ("illuminant", "same_shape", "same_shape = \"yes\"", &["line 8, same_shape", "true or false"]),
        ("target", "lrv", "", &["line 12, lrv of \"target\"", "missing", "[[surface]]"]),
        ("target", "lrv", "lrv = 0", &["line 15, lrv of \"target\"", "above 0 and below 1"]),
        ("target", "lrv", "lrv = 1.2", &["line 15, lrv of \"target\"", "1.2", "above 0 and below 1"]),
        ("target", "lrv", "lrv = [0.2, -0.4]", &["line 15, lrv", "-0.4", "above 0 and below 1"]),
        ("target", "lrv", "lrv = []", &["line 15, lrv", "0 levels", "1 to 10000"]),
        ("target", "lrv", "lrv = [0.2, \"x\"]", &["line 15, lrv", "numbers alone"]),
        ("target", "lrv", "lrv = \"light\"", &["line 15, lrv", "a number, a list"]),
        (
            "target",
            "lrv",
            "lrv = { from = 0.2, to = 0.6 }",
            &["line 15, lrv.levels", "missing", "levels = 10"],
        ),
        (
            "target",
            "lrv",
            "lrv = { from = 0.6, to = 0.2, levels = 3 }",
            &["line 15, lrv", "below the second"],
        ),
        (
            "target",
            "lrv",
            "lrv = { from = 0.2, to = 0.6, levels = 0 }",
            &["line 15, lrv.levels", "1 to 10000"],
        ),
        (
            "target",
            "lrv",
            "lrv = { uniform = [0.2, 0.6], levels = 3 }",
            &["line 15, lrv.levels", "keep one of the two"],
        ),
        ("target", "lrv", "lrv = { uniform = [0.6, 0.2] }", &["line 15, lrv", "below the second"]),
        ("target", "lrv", "lrv = 0.9999", &["line 15, lrv", "the largest is 0.99"]),
        ("target", "bounds", "bounds = \"scald\"", &["line 16, bounds", "did you mean \"scaled\"?"]),
        ("target", "copies", "copies = \"same\"", &["line 16, copies", "independent, scaled, same_shape"]),
        ("target", "xyz", "xyz = [0.3, 0.3, 0.3]", &["line 16, xyz of \"target\"", "\"lrv\"", "keep one"]),
        ("target", "lrv", "xyz = [0.3, 0.3]", &["line 15, xyz", "three numbers"]),
        (
            "target",
            "lrv",
            "xyz = [0.1, 0.4, 0.05]",
            &["line 15, xyz", "the nearest that can be drawn are X = "],
        ),
        ("target", "lrv", "xyz = [0.3, 1.5, 0.3]", &["line 15, xyz", "Y above 0 and below 1"]),
        ("target", "lrv", "hue = 3", &["line 15, hue", "hue = { levels = 10"]),
        (
            "target",
            "lrv",
            "hue = { levels = 4, saturation = [0.2, 1.6], lightness = [0.2, 0.6] }",
            &["line 15, hue", "saturation is between 0 and 1"],
        ),
        (
            "target",
            "lrv",
            "hue = { levels = 4, saturation = [0.9, 0.99], lightness = [0.8, 0.9] }",
            &["line 15, hue", "narrow the ranges"],
        ),
        ("target", "flat", "flat = \"no\"", &["line 16, flat", "true or false"]),
        ("target", "flat", "flat = true", &["line 14, model of \"target\"", "a flat target", "leave it out"]),
        ("target", "model", "flat = true\ncov_scale = 1", &["line 15, cov_scale", "leave it out"]),
        ("target", "model", "flat = true\nmax_attempts = 9", &["line 15, max_attempts", "leave it out"]),
        (
            "target",
            "lrv",
            "lrv = { from = 0.2, to = 0.6, levels = 1 }",
            &["line 15, lrv.levels", "write lrv = 0.2", "2 levels or more"],
        ),
        (
            "target",
            "lrv",
            "lrv = { uniform = [0.98, 0.9955] }\nbounds = \"scaled\"",
            &["line 15, lrv of \"target\"", "a list of levels", "from = 0.98, to = 0.9955, levels = 10"],
        ),
        (
            "target",
            "lrv",
            "lrv = 0.99\nbounds = \"scaled\"\nmax_attempts = 20",
            &["line 15, lrv of \"target\"", "attempts or more"],
        ),
        (
            "illuminant",
            "mean",
            "mean = \"negative.csv\"",
            &["line 8, mean of \"lights\"", "at 500 nm is -", "raise it to 0"],
        ),
        (
            "target",
            "model",
            "flat = true\nbounds = \"scaled\"",
            &[
                "line 15, bounds of \"target\"",
                "for a flat target, which is the same in every band",
                "leave it out",
            ],
        ),
        (
            "target",
            "lrv",
            "xyz = [0.3, 0.3, 0.3]\nbounds = \"scaled\"",
            &["line 16, bounds of \"target\"", "without an lrv", "tristimulus values is not scaled"],
        ),
        (
            "surface",
            "observer",
            "observer = \"cie1964\"",
            &["line 12, observer of \"background\"", "needs the quantity xyz"],
        ),
        (
            "surface",
            "illuminant",
            "illuminant = \"a\"",
            &["line 12, illuminant of \"background\"", "needs the quantity xyz"],
        ),
        (
            "surface",
            "sensors",
            "sensors = \"ss2\"",
            &["line 12, sensors of \"background\"", "without \"responses\"", "leave it out"],
        ),
        (
            "surface",
            "response_scale",
            "response_scale = \"white\"",
            &["line 12, response_scale of \"background\"", "without \"responses\"", "leave it out"],
        ),
        (
            "surface",
            "sensors",
            "sensors = \"narrow.csv\"\nquantities = [\"responses\"]",
            &["line 12, sensors of \"background\"", "where its table ends", "choose a grid within the table"],
        ),
        ("surface", "name", "name = \"iocxo\"", &["line 9, name of \"iocxo\"", "stream 0", "another name"]),
        ("", "surface", "surface = 3", &["surface", "double brackets"]),
        ("", "seed", "seed = = 1", &["line 2", "this is not TOML"]),
    ];
    assert!(table.len() >= 30);
    for (group, key, line, parts) in table {
        let text = match *line {
            "surface = 3" => "scenes = 1\nsurface = 3".to_owned(),
            line => file(group, key, line),
        };
        let message = error(&text, folder.path());
        assert!(message.starts_with("bad.toml, line "), "{message}");
        for part in *parts {
            assert!(message.contains(part), "{line:?} in [[{group}]]: no {part:?} in\n  {message}");
        }
    }
    println!("{} bad files", table.len());
}

#[test]
fn what_no_line_is_to_blame_for() {
    let message = error("scenes = 5", Path::new(""));
    assert!(message.contains("add an [[illuminant]]"), "{message}");
    let missing = Scene::open(Path::new("no/such/file.toml")).err().expect("there is none").to_string();
    assert!(missing.starts_with("no/such/file.toml") && missing.contains("cannot read it"), "{missing}");
    let copies = file("target", "lrv", "lrv = { uniform = [0.2, 0.5] }\ncopies = \"scaled\"");
    let message = error(&copies, Path::new(""));
    assert!(
        message.contains("line 16, copies of \"target\"") && message.contains("from, to, levels"),
        "{message}"
    );
    let twins = file("surface", "name", "name = \"board-501\"").replace("\"lights\"", "\"lights-725\"");
    let message = error(&twins, Path::new(""));
    assert!(
        message.contains(
            "line 9, name of \"board-501\": by its hash \"lights-725\" has the same random numbers"
        ),
        "{message}"
    );
    let bounds = file("target", "lrv", "xyz = [0.3, 0.3, 0.3]\nbounds = \"scaled\"");
    let message = error(&bounds, Path::new(""));
    assert!(
        message.contains("line 16, bounds of \"target\"") && message.contains("leave it out"),
        "{message}"
    );
}

#[test]
fn presets_are_possible_and_say_what_they_are() {
    for (name, text) in PRESETS {
        let scene = Scene::preset(name).expect("it is built in");
        assert_eq!(scene.groups().collect::<Vec<_>>(), ["lights", "background", "target"]);
        assert_eq!(scene.scenes(), if name == "condition3" { 3000 } else { 1000 });
        assert!(text.starts_with("# Condition "));
    }
    assert!(Scene::preset("condition4").is_none());
}
