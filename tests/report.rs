//! The report as its user waits for it.

mod program;

use std::fs;
use std::io::{BufRead, BufReader};
use std::process::{Command, Stdio};

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
