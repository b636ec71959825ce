//! The program as a person meets it: what it prints, what it leaves on disk, and how it exits.

mod program;

use std::fs;
use std::process::Command;
use std::time::{Duration, Instant};

use program::{PROGRAM, fails, files, npy, spectroll, succeeds};

#[test]
fn a_sample_is_the_same_from_every_engine_and_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    let common = "sample munsell-vrhel -n 1000 --seed 3 --lrv 0.4";
    succeeds(folder.path(), &format!("{common} --engine gpu -o gpu.npy"));
    succeeds(folder.path(), &format!("{common} --engine cpu -o cpu.npy"));
    succeeds(folder.path(), &format!("{common} --engine cpu -o cpu.csv"));
    let (stdout, _) = succeeds(folder.path(), &format!("{common} --engine cpu -o -"));

    let (shape, values) = npy(&path("cpu.npy"));
    assert_eq!(shape, [1000, 31]);
    let (adapters, _) = succeeds(folder.path(), "adapters");
    if adapters.starts_with("0: ") && adapters.contains("[software") {
        // Hardware may round its own way; tests/twins.rs says how far.
        assert_eq!(fs::read(path("gpu.npy")).unwrap(), fs::read(path("cpu.npy")).unwrap());
    }
    assert_eq!(fs::read_to_string(path("cpu.csv")).unwrap(), stdout);
    let mut lines = stdout.lines();
    assert!(lines.next().unwrap().starts_with("400,410,420,"));
    let text: Vec<f32> = lines.flat_map(|line| line.split(',').map(|v| v.parse().unwrap())).collect();
    assert_eq!(text, values);

    succeeds(
        folder.path(),
        "sample munsell-vrhel -n 400 --start 600 --seed 3 --lrv 0.4 --engine cpu -o part.npy",
    );
    assert_eq!(npy(&path("part.npy")).1, values[600 * 31..]);
    assert_eq!(files(folder.path()), ["cpu.csv", "cpu.npy", "gpu.npy", "part.npy"]);
}

#[test]
fn the_summary_says_what_was_made() {
    let folder = tempfile::tempdir().unwrap();
    let (_, summary) = succeeds(folder.path(), "sample munsell-vrhel -n 1e5 --lrv 0.6 -o a.npy");
    for part in [
        "100,000 spectra of 31 bands",
        "candidates (75.",
        "reach 1 or more after scaling",
        "million a second",
    ] {
        assert!(summary.contains(part), "{summary}");
    }
    let (json, err) = succeeds(folder.path(), "sample granada -n 1_000 --json --engine cpu -o b.npy");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((json["draws"].as_u64(), json["bands"].as_u64(), err.as_str()), (Some(1000), Some(31), ""));
    let (out, err) = succeeds(folder.path(), "sample granada -n 10 -q -o c.npy");
    assert_eq!((out, err), (String::new(), String::new()));
}

/// What exceeds 1 stands in the first line, since it matters most, with what to do about it.
#[test]
fn summaries_tell_what_matters_first() {
    let folder = tempfile::tempdir().unwrap();
    let first = |arguments: &str| {
        let (_, err) = succeeds(folder.path(), &format!("sample {arguments} --engine cpu"));
        err.lines().next().unwrap().to_owned()
    };
    let line = first("munsell-vrhel -n 10k --lrv 0.6 -o a.npy");
    assert!(line.starts_with("a.npy: 10,000 spectra of 31 bands; "), "{line}");
    assert!(
        line.ends_with(" %) reach 1 or more after scaling: use --bounds both to keep all below 1"),
        "{line}"
    );
    assert_eq!(
        first("munsell-vrhel -n 10k --lrv 0.6 --bounds both -o b.npy"),
        "b.npy: 10,000 spectra of 31 bands"
    );
    assert_eq!(first("granada -n 1 -o c.npy"), "c.npy: 1 spectrum of 31 bands");
    assert_eq!(first("granada -n 2 --format npy -o parts"), "parts: one file, 2 spectra of 31 bands");
    let (_, err) = succeeds(folder.path(), "sample granada -n 1 -o d.npy");
    assert!(!err.contains("no graphics hardware"), "{err}");

    let text = succeeds(folder.path(), "scene --example condition3").0;
    fs::write(folder.path().join("s.toml"), text.replace("bounds = \"scaled\"", "bounds = \"base\""))
        .unwrap();
    let (_, err) = succeeds(folder.path(), "scene s.toml --scenes 0..1 --engine cpu -o s.npz");
    assert!(err.starts_with("s.npz: 1 scene of 31 bands\n"), "{err}");
    let (_, err) = succeeds(folder.path(), "scene s.toml --only target --engine cpu -o t.npz");
    assert!(
        err.contains(" %) reach 1 or more after scaling: use bounds = \"both\" to keep all below 1"),
        "{err}"
    );
}

/// A seed that nobody chose can be used again.
#[test]
fn random_seeds_are_told() {
    let folder = tempfile::tempdir().unwrap();
    let random = "sample granada -n 5 --engine cpu --seed random -o";
    let (json, _) = succeeds(folder.path(), &format!("{random} a.npz --json"));
    let seed = serde_json::from_str::<serde_json::Value>(&json).unwrap()["seed"].as_u64().unwrap();
    succeeds(folder.path(), &format!("sample granada -n 5 --engine cpu --seed {seed} -o b.npz"));
    let [a, b] = ["a.npz", "b.npz"].map(|name| fs::read(folder.path().join(name)).unwrap());
    assert!(a == b, "draws and attributes are those of seed {seed}");
    let (_, summary) = succeeds(folder.path(), &format!("{random} c.npy"));
    let told: u64 = summary.split("seed ").nth(1).unwrap().lines().next().unwrap().parse().unwrap();
    assert_ne!(told, seed);
    fails(folder.path(), "sample granada -n 5 --seed -1 -o x.npy", 2, "from 0 to 2^64 - 1, or random");
}

#[test]
fn npy_is_streamed() {
    let folder = tempfile::tempdir().unwrap();
    let sample = "sample munsell-vrhel -n 100k --engine cpu --seed 2";
    let streamed = spectroll(folder.path(), &format!("{sample} --format npy -o -"));
    assert!(streamed.status.success());
    succeeds(folder.path(), &format!("{sample} -o a.npy"));
    assert!(streamed.stdout == fs::read(folder.path().join("a.npy")).unwrap());
    let scene = "scene --example condition2 --scenes 0..5 --engine cpu --arrays lights";
    let streamed = spectroll(folder.path(), &format!("{scene} --format npy -o -"));
    succeeds(folder.path(), &format!("{scene} -o b.npy"));
    assert!(streamed.stdout == fs::read(folder.path().join("b.npy")).unwrap());
    let several = "sample granada -n 5 --quantities spectra,xyz --format npy -o -";
    fails(folder.path(), several, 2, "choose one quantity");
}

/// A reader that has what it wants ends a run well, and a full device does not.
#[cfg(target_os = "linux")]
#[test]
fn only_readers_may_go_away() {
    let folder = tempfile::tempdir().unwrap();
    for format in ["csv", "npy"] {
        let shell = |to: &str| {
            let script = format!(
                "set -o pipefail; {PROGRAM} sample granada -n 1e6 --engine cpu -q --format {format} -o - {to}"
            );
            Command::new("bash").args(["-c", &script]).current_dir(folder.path()).output().unwrap()
        };
        let output = shell("| head -c 100 > /dev/null");
        assert!(output.status.success() && output.stderr.is_empty(), "{format}: {output:?}");
        let output = shell("> /dev/full");
        let err = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.code() == Some(1) && err.contains("cannot write to standard output"), "{err}");
    }
}

/// Whatever the disk: nobody has so much.
#[test]
fn what_does_not_fit_is_refused_before_it_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let text = succeeds(folder.path(), "scene --example condition3").0;
    fs::write(folder.path().join("s.toml"), text.replace("scenes = 3000", "scenes = 90000000")).unwrap();
    for run in [
        "sample munsell-vrhel -n 1000T -o a.npy",
        "sample munsell-vrhel -n 1000T -o a.csv",
        "sample munsell-vrhel -n 8T -o a.zarr",
        "sample munsell-vrhel -n 8T --zstd -o a.zarr",
        "sample munsell-vrhel -n 8T --shard 3/8 -o a.zarr",
        "scene s.toml -o a.zarr",
        "scene s.toml --format parquet -o a/",
    ] {
        let run = format!("{run} --engine cpu");
        fails(folder.path(), &run, 1, "B are free here (--force-space overrides)");
        let output = spectroll(folder.path(), &format!("{run} --dry-run"));
        let table = String::from_utf8(output.stdout).unwrap();
        assert_eq!(output.status.code(), Some(1), "{run}: {table}");
        assert!(table.contains("which is not enough"), "{run}: {table}");
        let forced = spectroll(folder.path(), &format!("{run} --dry-run --force-space"));
        assert!(forced.status.success(), "{run}");
    }
    fails(folder.path(), "sample munsell-vrhel -n 1000T -o a.npy --engine cpu", 1, "a.npy needs 124 PB and ");
    let packed = "sample munsell-vrhel -n 8T --zstd -o a.zarr --engine cpu";
    fails(folder.path(), packed, 1, "a.zarr needs at least 248 TB and ");
}

/// Only the name that a file gets in the end may be too long.
#[cfg(unix)]
#[test]
fn names_that_are_too_long_are_refused_before_anything_is_drawn() {
    let folder = tempfile::tempdir().unwrap();
    let name = "n".repeat(252);
    for output in [format!("{name}.npy"), format!("{name}.zarr")] {
        let start = Instant::now();
        fails(folder.path(), &format!("sample granada -n 1e8 --engine cpu -o {output}"), 1, "too long");
        assert!(start.elapsed() < Duration::from_secs(20), "it was drawn first");
    }
}

#[test]
fn nothing_is_a_valid_file() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), "sample granada -n 0 -o zero.npy");
    succeeds(folder.path(), "sample granada-5nm -n 0 -o zero.csv");
    assert_eq!(npy(&folder.path().join("zero.npy")), (vec![0, 31], vec![]));
    assert_eq!(fs::read_to_string(folder.path().join("zero.csv")).unwrap().lines().count(), 1);
}

#[test]
fn impossible_and_hopeless_requests_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    for (arguments, code, message) in [
        ("munsell-vrhel -n 5 --lrv 1.5", 2, "reflectance of 1.5: it is a fraction above 0 and below 1"),
        ("munsell-vrhel -n 5 --lrv -1", 2, "reflectance of -1"),
        ("munsell-vrhel -n 5 --lrv NaN", 2, "reflectance of NaN"),
        ("munsell-vrhel -n 5 --lrv 0.9999", 2, "the largest is 0.995928"),
        ("munsell-vrhel -n 5 --lrv 0.2..0.9999", 2, "the largest is 0.995928"),
        ("munsell-vrhel -n 5 --lrv 40", 2, "--lrv is a fraction between 0 and 1; did you mean 0.4?"),
        ("munsell-vrhel -n 5 --lrv 7..55.5", 2, "did you mean 0.07..0.555?"),
        ("munsell-vrhel -n 5 --lrv 0.6..0.2", 2, "the lower end comes first; did you mean 0.2..0.6?"),
        ("munsell-vrhel -n 5 --lrv 0.4..0.4", 2, "the ends are the same; did you mean 0.4?"),
        ("munsell-vrhel -n 5 --lrv bright", 2, "expected a number or LOW..HIGH, as in 0.4 or 0.2..0.6"),
        (
            "munsell-vrhel -n 5 --lrv 0.2..0.995 --bounds scaled",
            2,
            "upper end of target luminous reflectances",
        ),
        ("munsell-vrhel -n 5 --lrv 0.99 --bounds scaled --max-attempts 20", 2, "attempts or more"),
        ("munsell-vrhel -n 5 --cov-scale -2", 2, "scale of -2: it must be finite and not negative"),
        ("munsell-vrhel -n 5 --cov-scale inf", 2, "scale of inf"),
        ("munsell-vrhel -n 5 --cov-scale 100 --max-attempts 50", 2, "attempts or more"),
        ("munsell-vrhel -n 5 --max-attempts 0", 2, "at least 1 attempt"),
        ("munsell-vrhel -n 5 --bounds scaled", 2, "--lrv"),
        ("granada -n 5 --lrv 0.5", 2, "this model is of illuminants"),
        ("granada -n 5 --start 18446744073709551615", 2, "pass the last"),
        ("granada -n 18446744073709551615", 2, "more than any disk holds"),
        ("granada -n -5", 2, "expected a whole number"),
        ("granada -n 1.5", 2, "expected a whole number"),
        ("munsel -n 5", 2, "neither a file nor a built-in model (munsell-vrhel, granada"),
        ("granada -n 5 --adapter nonesuch", 3, "no adapter \"nonesuch\""),
        ("granada -n 5 --adapter 99", 3, "no adapter 99; there "),
    ] {
        fails(folder.path(), &format!("sample {arguments} -o x.npy"), code, message);
    }
}

#[test]
fn what_is_in_the_way_of_a_file_stays() {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("old.npy"), "mine").unwrap();
    fs::create_dir(folder.path().join("folder.npy")).unwrap();
    fails(folder.path(), "sample granada -n 5 -o old.npy", 1, "exists already");
    fails(folder.path(), "sample granada -n 5 -o folder.npy", 1, "is a folder");
    fails(folder.path(), "sample granada -n 5 -o no/such/x.npy", 1, "create it first");
    fails(folder.path(), "sample granada -n 5 -o x.xlsx", 2, "name it .npy, .npz, .csv");
    let several = "sample granada -n 5 --quantities spectra,xyz -o x.npy";
    fails(
        folder.path(),
        several,
        2,
        "choose one quantity, or name it .npz, .zarr, .h5 or .parquet (--quantities)",
    );
    for format in ["parquet", "zarr", "spd", "h5"] {
        let run = format!("sample granada -n 5 --format {format} -o -");
        fails(folder.path(), &run, 2, "standard output takes CSV and .npy alone");
    }
    fails(folder.path(), "sample granada -n 5 -o - --json", 2, "both write to standard output");
    fails(folder.path(), "sample granada -n 5 --force --format npy -o /dev/null", 1, "not a plain file");
    assert_eq!(fs::read_to_string(folder.path().join("old.npy")).unwrap(), "mine");
    succeeds(folder.path(), "sample granada -n 5 -o old.npy --force");
    assert_eq!(npy(&folder.path().join("old.npy")).0, [5, 31]);
}

#[test]
fn a_model_is_fitted_and_drawn_from() {
    let folder = tempfile::tempdir().unwrap();
    let (_, err) = succeeds(folder.path(), "fit munsell vrhel -k 4 --wavelengths 410:20:690 -o m.json");
    assert!(err.contains("4 components explain 9") && err.contains("632 reflectances"), "{err}");
    succeeds(folder.path(), "sample m.json -n 20 -o m.npy");
    assert_eq!(npy(&folder.path().join("m.npy")).0, [20, 15]);
    let rows = (0..40).map(|i| format!("{},{},{},{}\n", 400 + i, 1 + i % 3, 2, 5 - i % 4));
    let csv = format!("nm,a,b,c\n{}", rows.collect::<String>());
    fs::write(folder.path().join("lamps.csv"), csv).unwrap();
    succeeds(folder.path(), "fit lamps.csv --kind illuminant -k 2 --wavelengths 400:1:439 -o lamps.json");

    for (arguments, code, message) in [
        ("fit lamps.csv -o x.json", 2, "pass --kind reflectance or --kind illuminant"),
        ("fit lamps.csv --kind illuminant -k 3 -o x.json", 4, "which does not cover the grid 400:10:700"),
        ("fit lamps.csv --kind illuminant -k 3 --wavelengths 400:1:439 -o x.json", 4, "at least 4 spectra"),
        ("fit lamps.csv --kind illuminant -k 0 --wavelengths 400:1:439 -o x.json", 4, "at least 1 component"),
        ("fit munsell --wavelengths 380:10:700 -o x.json", 4, "from 400 to 700 nm"),
        ("fit munsell --wavelengths 400:7:700 -o x.json", 2, "whole number of steps"),
        ("fit absent.mat -o x.json", 4, "cannot read \"absent.mat\""),
        ("fit m.json -o x.json", 4, "is a model"),
        ("fit munsell -o m.json", 1, "exists already"),
        ("sample lamps.csv -n 5 -o x.npy", 4, "lamps.csv is a file of data: fit a model to it first"),
    ] {
        fails(folder.path(), arguments, code, message);
    }
}

#[test]
fn help_ends_with_examples_that_work() {
    let folder = tempfile::tempdir().unwrap();
    let (help, _) = succeeds(folder.path(), "--help");
    let examples: Vec<_> = help.lines().filter_map(|line| line.strip_prefix("  spectroll ")).collect();
    assert!(examples.len() >= 5);
    let mine = "nm,a,b\n400,0.1,0.4\n410,0.2,0.3\n420,0.3,0.5\n";
    fs::write(folder.path().join("mine.csv"), mine).unwrap();
    for example in examples {
        // The numbers are made smaller, and a redirection is the shell's.
        let example = example.replace("1000000", "1000").split('>').next().unwrap().to_owned();
        succeeds(folder.path(), &example);
    }
}

/// The size is that of what the run then makes, of text within a tenth.
#[test]
fn a_dry_run_says_what_would_be() {
    let folder = tempfile::tempdir().unwrap();
    for (output, exact) in [("a.npy", true), ("a.zarr", true), ("a.csv", false)] {
        let draw = format!("sample munsell-vrhel -n 1000 --engine cpu -o {output}");
        let (json, _) = succeeds(folder.path(), &format!("{draw} --dry-run --json"));
        assert!(files(folder.path()).is_empty(), "{output}");
        let would: serde_json::Value = serde_json::from_str(&json).unwrap();
        let bytes = would["bytes"].as_u64().unwrap();
        assert!(would["free"].as_u64().unwrap() > bytes && would["draws_per_second"].as_f64().unwrap() > 0.0);
        assert_eq!(would["arrays"][0]["shape"], serde_json::json!([1000, 31]));
        succeeds(folder.path(), &draw);
        let path = folder.path().join(output);
        let made = if path.is_dir() { path.join("spectra/c.0.0") } else { path.clone() };
        let made = fs::metadata(made).unwrap().len();
        assert!(if exact { (bytes..bytes + 200).contains(&made) } else { made.abs_diff(bytes) < bytes / 10 });
        if path.is_dir() { fs::remove_dir_all(path).unwrap() } else { fs::remove_file(path).unwrap() }
    }
}

/// What is done is done, and a job that nobody listens to has not failed.
#[cfg(target_os = "linux")]
#[test]
fn nobody_need_listen() {
    let folder = tempfile::tempdir().unwrap();
    let full = fs::OpenOptions::new().write(true).open("/dev/full").unwrap();
    let words = "sample granada -n 10 --engine cpu -o a.npy".split_whitespace();
    let status = Command::new(PROGRAM).args(words).current_dir(folder.path()).stderr(full).status().unwrap();
    assert!(status.success() && folder.path().join("a.npy").is_file());
}

#[test]
fn adapters_and_bench_speak_both_languages() {
    let folder = tempfile::tempdir().unwrap();
    let (text, _) = succeeds(folder.path(), "adapters");
    assert!(text.contains("0: ") && text.contains("CPU"), "{text}");
    let (json, _) = succeeds(folder.path(), "adapters --json");
    assert!(serde_json::from_str::<serde_json::Value>(&json).unwrap()[0]["name"].is_string());
    let (json, _) = succeeds(folder.path(), "bench granada --engine cpu --runs 5 --json");
    let measured: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(measured["rates"][0]["draws_per_second"]["median"].as_f64().unwrap() > 0.0);
    assert_eq!(measured["shares"].as_array().unwrap().len(), 0); // not without --costs
}

#[test]
fn a_file_may_hold_the_flags() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    let config = "model = \"munsell-vrhel\"\ncount = 100\nseed = 4\nlrv = 0.4\nengine = \"cpu\"\nquiet = true\nforce = false";
    fs::write(path("c.toml"), config).unwrap();
    let plain = "sample munsell-vrhel -n 100 --lrv 0.4 --engine cpu";
    for (arguments, same) in [
        ("sample --config c.toml -o a.npy", format!("{plain} --seed 4 -o b.npy")),
        ("sample --config c.toml --seed 9 -o a.npy", format!("{plain} --seed 9 -o b.npy")),
        (
            "sample --config c.toml granada-5nm -n 7 --lrv 0.2 -o a.npy",
            "sample granada -n 1 -o b.npy".to_owned(),
        ),
    ] {
        if arguments.contains("granada") {
            // The flags win: here they ask for what cannot be.
            fails(folder.path(), arguments, 2, "this model is of illuminants");
            continue;
        }
        let (_, err) = succeeds(folder.path(), arguments);
        assert_eq!(err, "");
        succeeds(folder.path(), &same);
        assert_eq!(fs::read(path("a.npy")).unwrap(), fs::read(path("b.npy")).unwrap(), "{arguments}");
        fs::remove_file(path("a.npy")).unwrap();
        fs::remove_file(path("b.npy")).unwrap();
    }
    // One way to name what draws wins over the other.
    fails(folder.path(), "sample --config c.toml --adapter nonesuch -o a.npy", 3, "no adapter");
    for (config, message) in [
        ("sed = 4", "`spectroll sample` has no flag \"sed\""),
        ("seed = [", "cannot use the configuration"),
        ("quiet = 3", "quiet: expected true or false"),
        ("seed = 2020-01-01", "cannot be a flag"),
    ] {
        fs::write(path("c.toml"), config).unwrap();
        fails(folder.path(), "sample granada -n 1 --config c.toml -o a.npy", 2, message);
    }
    fails(folder.path(), "sample granada -n 1 --config d.toml -o a.npy", 2, "cannot use the configuration");
}

#[test]
fn packagers_get_completions_and_pages() {
    let folder = tempfile::tempdir().unwrap();
    for shell in ["bash", "zsh", "fish", "powershell", "elvish"] {
        assert!(succeeds(folder.path(), &format!("completions {shell}")).0.contains("spectroll"), "{shell}");
    }
    assert!(succeeds(folder.path(), "man").0.contains(".TH spectroll 1"));
    succeeds(folder.path(), "man pages");
    assert!(files(&folder.path().join("pages")).contains(&"spectroll-sample.1".to_owned()));
}
