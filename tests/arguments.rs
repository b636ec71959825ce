//! Values that options do not take: each message says what to type instead, and none is that of a parser.

mod program;

use std::fs;

use program::{fails, spectroll, succeeds};

/// A number below 0 is a value to be explained, and not an option that nobody knows.
#[test]
fn numbers_out_of_range_say_what_is_expected() {
    let folder = tempfile::tempdir().unwrap();
    let seed = "expected a whole number from 0 to 2^64 - 1";
    for (arguments, message) in [
        ("sample granada -n 5 -o x.npy --seed -1", seed),
        ("scene --example condition1 -o x.npz --seed -1", seed),
        ("inspect granada --seed -1", seed),
        ("inspect granada --seed one", seed),
        ("report granada -o x --seed -1", seed),
        ("sample granada -n -5 -o x.npy", "expected a whole number, like 1000000, 1e6 or 1M"),
        ("sample granada -n 5 --start -1 -o x.npy", "expected a whole number, like 1000000, 1e6 or 1M"),
        ("sample granada -n 5 --chunk -1 -o x.zarr", "expected a whole number, like 1000000, 1e6 or 1M"),
        ("sample granada -n 5 --max-attempts -1 -o x.npy", "expected a whole number from 1 to 2^31 - 1"),
        ("sample granada -n 5 --cov-scale wide -o x.npy", "expected a number, as in 1.5"),
        ("sample granada -n 5 --intensity -3..-1 -o x.npy", "must be above 0"),
        ("sample granada -n 5 --zstd -1 -o x.zarr", "expected a whole number from 1 to 22"),
        ("sample granada -n 5 --shard -1/4 -o x.zarr", "expected I/N"),
        ("sample munsell-vrhel -n 5 --lrv -0.5..0.5 -o x.npy", "reflectance of -0.5"),
        ("scene --example condition1 -o x.npz --scenes -1..3", "expected A..B, as in 0..100"),
        ("scene --example condition1 -o x.npz --scenes 3..1", "expected A..B, as in 0..100"),
        ("fit munsell -k -3 -o x.json", "expected a number of components"),
        ("fit munsell --scale -1 -o x.json", "expected a number above 0"),
        ("bench granada --runs -1", "expected a whole number from 5 to"),
        ("verify x.zarr --redraw -1", "expected a share from 0 to 1"),
    ] {
        fails(folder.path(), arguments, 2, message);
        let text = String::from_utf8(spectroll(folder.path(), arguments).stderr).unwrap();
        for parsers_own in ["invalid digit", "invalid float", "unexpected argument"] {
            assert!(!text.contains(parsers_own), "{arguments}: {text}");
        }
    }
}

/// The end is left out, so that a range with one number twice has nothing in it.
#[test]
fn a_range_of_no_scenes_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let scenes = "scene --example condition1 --engine cpu -o x.npz --scenes";
    fails(folder.path(), &format!("{scenes} 3..3"), 2, "did you mean 3..4?");
    succeeds(folder.path(), &format!("{scenes} 3..4 --dry-run"));
}

/// The name `iocxo` has the hash 0, which is the stream of draws that have no name.
#[test]
fn a_name_for_the_stream_without_a_name_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let sample = "sample granada -n 5 --engine cpu --stream";
    fails(
        folder.path(),
        &format!("{sample} iocxo -o x.npy"),
        2,
        "--stream \"iocxo\" has by its hash the draws",
    );
    succeeds(folder.path(), &format!("{sample} iocxp -o x.npy"));
}

/// Draws are above 0, so that they cannot have such a mean.
#[test]
fn a_model_whose_mean_is_negative_is_drawn_with_a_warning() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let rows = (0..5).map(|i| format!("{},{},{},{}\n", 400 + 10 * i, 1 + i % 3, 2, 5 - i % 4));
    fs::write(folder.join("lamps.csv"), format!("nm,a,b,c\n{}", rows.collect::<String>())).unwrap();
    succeeds(folder, "fit lamps.csv --kind illuminant -k 2 --wavelengths 400:10:440 -o fine.json");
    let text = fs::read_to_string(folder.join("fine.json")).unwrap();
    let mut model: serde_json::Value = serde_json::from_str(&text).unwrap();
    let weights = model["weight_mean"].as_array().unwrap();
    assert!(weights.iter().all(|weight| weight.as_f64().unwrap().abs() < 1e-9), "{weights:?}");
    model["mean"][0] = (-0.25).into();
    fs::write(folder.join("dark.json"), model.to_string()).unwrap();
    let sample = |model: &str| {
        succeeds(folder, &format!("sample {model} -n 20 --cov-scale 9 --engine cpu --force -o a.npy")).1
    };
    assert!(!sample("fine.json").contains("mean"));
    assert!(sample("dark.json").contains("the model's mean is -0.2500 at 400 nm, and spectra are above 0"));
    let scene =
        "scenes = 2\n[[illuminant]]\nname = \"lights\"\nmodel = \"dark.json\"\ncount = 1\ncov_scale = 9\n";
    fs::write(folder.join("dark.toml"), scene).unwrap();
    let (_, summary) = succeeds(folder, "scene dark.toml --engine cpu -o a.npz");
    assert!(summary.contains("lights: the model's mean is -0.2500 at 400 nm"), "{summary}");
}
