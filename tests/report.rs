//! The report as its user waits for it.

mod program;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

use program::{fails, files, succeeds};
use serde_json::Value;

/// The folder of a report that gets SIGINT once its second section begins.
#[cfg(unix)]
#[test]
fn an_interrupted_report_keeps_what_is_done() {
    let folder = tempfile::tempdir().unwrap();
    let mut child = Command::new(program::PROGRAM)
        .args(["report", "granada", "--quick", "--engine", "cpu", "-o", "r"])
        .current_dir(folder.path())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut lines = BufReader::new(child.stderr.take().unwrap()).lines().map(Result::unwrap);
    let first = lines.next().unwrap();
    assert!(
        first.contains("granada: 1. Statistical error against run time") && first.contains(" left"),
        "{first}"
    );
    let second = lines.next().unwrap();
    assert!(second.contains("granada: 2. Numerical error against cost"), "{second}");
    let killed = Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap();
    assert!(killed.success());
    let rest: Vec<String> = lines.collect();
    assert_eq!(child.wait().unwrap().code(), Some(130), "{rest:?}");
    let last = rest.last().unwrap();
    assert!(last.starts_with("error: interrupted; r/report.html is unfinished: it has "), "{last}");

    assert_eq!(program::files(folder.path()), ["r"]);
    let read = |name: &str| fs::read_to_string(folder.path().join("r").join(name)).unwrap();
    let page = read("report.html");
    assert!(page.contains("<title>UNFINISHED: Spectroll on granada</title>"));
    assert!(page.contains("<b>UNFINISHED.</b>") && page.contains("<h2>1. Statistical error"));
    assert!(!page.contains("<h2>6. Stiff") && !page.contains("cases have their right answer"));
    let json: Value = serde_json::from_str(&read("report.json")).unwrap();
    assert_eq!((&json["finished"], &json["stress"]), (&Value::Bool(false), &Value::Null));
    let missing: Vec<&str> =
        json["missing"].as_array().unwrap().iter().map(|m| m.as_str().unwrap()).collect();
    assert_eq!(missing.last(), Some(&"6. Stiff and extreme cases"));
    assert!(
        json["models"][0]["convergence"]["curves"][0]["points"][0]["seconds"]["median"].as_f64().unwrap()
            > 0.0
    );
}

/// The page needs nothing else, and the numbers are all there.
#[test]
fn a_report_is_a_folder_that_appears_whole() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("mine")).unwrap();
    fails(folder.path(), "report -o mine --quick", 1, "exists already");
    fails(folder.path(), "report -o mine --quick --force", 1, "not a report");
    fails(folder.path(), "report -o x --quick --full", 2, "cannot be used with");
    fails(folder.path(), "report -o no/such --quick", 1, "create it first");
    fails(folder.path(), "report nonesuch -o x --quick", 2, "neither a file nor a built-in model");

    let (out, _) = succeeds(folder.path(), "report granada -o x --quick --engine cpu --seed 5");
    assert!(out.contains("36 of 36 stiff and extreme cases"), "{out}");
    assert_eq!(files(folder.path()), ["mine", "x"]);
    let x = folder.path().join("x");
    let page = fs::read_to_string(x.join("report.html")).unwrap();
    let svgs = files(&x).iter().filter(|name| name.ends_with(".svg")).count();
    assert_eq!(page.matches("<svg").count(), svgs);
    let loads = ["src=", "href=\"http", "@import", "url(http"];
    assert!(loads.iter().all(|load| !page.contains(load)), "the page loads something");
    for figure in page.split("<figcaption>").skip(1) {
        assert!(figure.contains("Seed 5.") && figure.contains(" UTC."), "{figure}");
    }
    let text = fs::read_to_string(x.join("report.json")).unwrap();
    let json: serde_json::Value = serde_json::from_str(&text).unwrap();
    assert_eq!((&json["seed"], &json["effort"]), (&5.into(), &"quick".into()));
    let curves = json["models"][0]["convergence"]["curves"].as_array().unwrap();
    assert!(curves.len() >= 2 && curves.iter().all(|curve| curve["points"].as_array().unwrap().len() >= 2));
}
