//! Bytes that must not change: draws, scenes and a model, against BLAKE3 sums of what the program made before its rooms
//! and names were moved, on 2026-11-26. A change of these sums is a decision that a changelog has to tell. Those of the
//! lights of condition 1 changed since, when it became what the authors' code has.
//!
//! `tests/frozen.b3` is in the form of `b3sum`; of the sets it has the files of chunks, since their metadata may grow.

mod program;

use std::collections::BTreeMap;
use std::path::Path;

use program::{succeeds, tree};

const SUMS: &str = include_str!("frozen.b3");

/// The outputs, each with what makes it.
const RUNS: [(&str, &str); 9] = [
    ("a.npy", "sample munsell-vrhel -n 5000 --seed 3"),
    ("b.npy", "sample munsell-vrhel -n 3000 --seed 4 --lrv 0.4 --bounds scaled"),
    ("c.npy", "sample granada -n 3000 --seed 5 --intensity 0.15..150"),
    ("d.npy", "sample munsell-vrhel -n 2000 --seed 6 --lrv 0.98 --bounds scaled"),
    ("e.npy", "sample munsell-vrhel-5nm -n 2000 --dtype f16"),
    (
        "f.zarr",
        "sample munsell-vrhel -n 4000 --seed 7 --chunk 1024 --quantities spectra,weights,attempts,lrv",
    ),
    ("s1.zarr", "scene --example condition1 --scenes 0..3"),
    ("s2.zarr", "scene --example condition2 --scenes 0..3"),
    ("s3.zarr", "scene --example condition3 --scenes 0..3"),
];

/// The sums of an output, by the names of its files.
fn expected(output: &str) -> BTreeMap<&'static str, &'static str> {
    let lines = SUMS.lines().map(|line| line.split_once("  ").expect("a sum and a name"));
    lines.filter(|(_, name)| name.split('/').next() == Some(output)).map(|(sum, name)| (name, sum)).collect()
}

/// The sums of an output that was made in a folder.
fn made(folder: &Path, output: &str) -> BTreeMap<String, String> {
    let files = tree(folder).into_iter();
    let is_data = |name: &str| !name.contains('/') || name.rsplit('/').next().unwrap().starts_with("c.");
    files
        .filter(|(name, _)| name.split('/').next() == Some(output) && is_data(name))
        .map(|(name, bytes)| (name, blake3::hash(&bytes).to_hex().to_string()))
        .collect()
}

fn assert_frozen(folder: &Path, output: &str, command: &str) {
    succeeds(folder, command);
    let made = made(folder, output);
    let made: BTreeMap<_, _> = made.iter().map(|(name, sum)| (name.as_str(), sum.as_str())).collect();
    let expected = expected(output);
    assert!(!expected.is_empty(), "{output} has no sums");
    assert_eq!(made, expected, "{command}");
}

#[test]
fn the_cpu_draws_what_it_drew() {
    for (output, command) in RUNS {
        let folder = tempfile::tempdir().unwrap();
        assert_frozen(folder.path(), output, &format!("{command} --engine cpu -o {output}"));
    }
}

/// Hardware may round its own way; `tests/twins.rs` says how far. What emulates it rounds as the CPU does.
#[test]
fn a_software_adapter_draws_what_the_cpu_drew() {
    let folder = tempfile::tempdir().unwrap();
    let (adapters, _) = succeeds(folder.path(), "adapters");
    if !(adapters.starts_with("0: ") && adapters.contains("[software")) {
        println!("skipped: the first adapter is no software");
        return;
    }
    for (output, command) in RUNS {
        let folder = tempfile::tempdir().unwrap();
        assert_frozen(folder.path(), output, &format!("{command} --engine gpu -o {output}"));
    }
}

#[test]
fn a_model_is_fitted_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    assert_frozen(folder.path(), "m.json", "fit munsell vrhel -k 8 --wavelengths 400:5:700 -o m.json");
}

/// A sum that no run is for would look as if it were checked.
#[test]
fn every_sum_is_of_a_run() {
    let checked: usize = RUNS.iter().map(|(output, _)| expected(output).len()).sum();
    assert_eq!(checked + expected("m.json").len(), SUMS.lines().count());
}
