//! Fits and model files: the numbers against NumPy's, the messages against what went wrong.
//!
//! The reference is `fit_reference.py`, run by the program in `SPECTROLL_PYTHON` (`python3` unless set), which needs
//! NumPy and SciPy. The daylights of Granada are not part of the project: `SPECTROLL_GRANADA` says where they are, and
//! without them their part is left out, and says so.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use nalgebra::DMatrix;
use serde::Deserialize;
use serde_json::{Value, json};
use spectroll::{
    BuiltinTable, Dataset, Extrapolation, Fit, FitError, Grid, Model, Normalization, SpectrumKind, Table,
};

const GRIDS: [(&str, &str); 2] = [("", "400:10:700"), ("-5nm", "400:5:700")];

/// The measured daylights, where they are.
fn granada() -> Option<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = std::env::var_os("SPECTROLL_GRANADA").map(PathBuf::from);
    let path = path.unwrap_or_else(|| root.join("../shared/data/daylightGranadaLong.mat"));
    if !path.exists() {
        println!("skipped: the daylights of Granada are not at {}; set SPECTROLL_GRANADA", path.display());
        return None;
    }
    Some(path)
}

fn fit(kind: SpectrumKind, tables: &[Table], grid: &str) -> Model {
    let grid = grid.parse::<Grid>().expect("a grid");
    let data = Dataset::new(tables, grid, Extrapolation::Error).expect("the tables cover the grid");
    Fit::new(kind).fit(&data).expect("the data have six components")
}

fn fit_granada(path: &Path, grid: &str) -> Model {
    fit(SpectrumKind::Illuminant, &[Table::open(path, None).expect("a table")], grid)
}

#[derive(Deserialize)]
struct Reference {
    mean: Vec<f64>,
    covariance: Vec<Vec<f64>>,
    explained: f64,
}

/// The Python that the tests use, and a command that runs one of their scripts with it.
fn python(script: &str) -> (String, Command) {
    let python = std::env::var("SPECTROLL_PYTHON").unwrap_or("python3".to_owned());
    let mut command = Command::new(&python);
    command.arg(Path::new(env!("CARGO_MANIFEST_DIR")).join("tests").join(script));
    (python, command)
}

fn run(command: &mut Command, python: &str) -> Output {
    command.output().unwrap_or_else(|e| {
        panic!("cannot run {python}: {e}; set SPECTROLL_PYTHON to a Python with NumPy and SciPy")
    })
}

fn references(granada: Option<&Path>) -> HashMap<String, Reference> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let (python, mut command) = python("fit_reference.py");
    let output = run(command.arg(root.join("data")).args(granada), &python);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(
        !errors.contains("ModuleNotFoundError"),
        "{python} lacks NumPy or SciPy: install them, or set SPECTROLL_PYTHON to a Python that has them\n{errors}"
    );
    assert!(output.status.success(), "{python} tests/fit_reference.py failed:\n{errors}");
    serde_json::from_slice(&output.stdout).expect("the script prints JSON")
}

/// The covariance over wavelengths, which no choice of signs or of a basis changes.
fn spectral_covariance(model: &Model) -> DMatrix<f64> {
    let parts = model.parts();
    parts.basis.transpose() * &parts.weight_covariance * &parts.basis
}

#[test]
fn fits_agree_with_numpy() {
    let granada = granada();
    let references = references(granada.as_deref());
    for (suffix, grid) in GRIDS {
        let tables = [BuiltinTable::Munsell.table(), BuiltinTable::Vrhel.table()];
        assert_agrees(
            &references,
            &format!("munsell-vrhel{suffix}"),
            &fit(SpectrumKind::Reflectance, &tables, grid),
        );
        if let Some(path) = &granada {
            assert_agrees(&references, &format!("granada{suffix}"), &fit_granada(path, grid));
        }
    }
}

fn assert_agrees(references: &HashMap<String, Reference>, name: &str, model: &Model) {
    let reference = &references[name];
    let covariance = spectral_covariance(model);
    assert_eq!((reference.mean.len(), reference.covariance.len()), (model.bands(), model.bands()), "{name}");
    let largest = |errors: &mut dyn Iterator<Item = f64>| errors.fold(0.0, |a: f64, e| a.max(e.abs()));
    let mean = largest(&mut model.parts().mean.iter().zip(&reference.mean).map(|(a, b)| a - b));
    // Row by row or column by column: it is symmetric.
    let entries = reference.covariance.iter().flatten().copied();
    let error = largest(&mut covariance.iter().zip(entries).map(|(a, b)| a - b)) / covariance.amax();
    let explained: f64 = model.parts().explained_variance.iter().sum();
    println!("{name}: mean off by {mean:.1e}, covariance by {error:.1e} of its largest entry");
    assert!(mean < 1e-9 && error < 1e-9, "{name}: {mean:e} {error:e}");
    assert!((explained - reference.explained).abs() < 1e-12, "{name}: {explained}");
}

#[test]
fn the_committed_daylights_are_what_the_measurements_give() {
    let Some(path) = granada() else { return };
    for (suffix, grid) in GRIDS {
        let committed = Model::builtin(&format!("granada{suffix}")).expect("it is built in");
        let refitted = fit_granada(&path, grid);
        let (a, b) = (committed.parts(), refitted.parts());
        assert_eq!((a.kind, &a.grid, a.normalization), (b.kind, &b.grid, b.normalization));
        let mut errors = vec![(&a.mean - &b.mean).amax(), (&a.weight_mean - &b.weight_mean).amax()];
        errors.extend([(&a.basis - &b.basis).amax(), (&a.weight_covariance - &b.weight_covariance).amax()]);
        errors.extend(a.explained_variance.iter().zip(&b.explained_variance).map(|(a, b)| (a - b).abs()));
        let largest = errors.into_iter().fold(0.0, f64::max);
        println!("granada{suffix}: committed and refitted differ by {largest:.1e}");
        assert!(largest < 1e-12, "granada{suffix}: {largest:e}");
    }
}

#[test]
fn six_components_explain_nearly_all_variance() {
    for (name, percent) in [("granada", 99.92), ("munsell-vrhel", 99.76)] {
        let model = Model::builtin(name).expect("it is built in");
        let explained = 100.0 * model.parts().explained_variance.iter().sum::<f64>();
        assert!((explained - percent).abs() < 0.005, "{name}: {explained} %");
    }
}

/// Spectra of a few bands, from 400 nm by 10 nm.
fn dataset(spectra: &[Vec<f64>]) -> Dataset {
    let grid = Grid::new(400.0, 10.0, spectra[0].len()).expect("a grid");
    let table = Table::new("swatches", grid.wavelengths().collect(), spectra).expect("a table");
    Dataset::new(&[table], grid, Extrapolation::Error).expect("the table is on the grid")
}

#[test]
fn what_cannot_be_fitted_says_why() {
    let infinite =
        Table::new("swatches", vec![400.0, 410.0], &[vec![0.1, 0.2], vec![0.3, f64::INFINITY]]).unwrap_err();
    assert_eq!(
        infinite.to_string(),
        "spectrum 2 of swatches: the value at 410 nm is inf; every value must be finite, or missing"
    );
    let nan = Table::new("swatches", vec![400.0, 410.0], &[vec![0.1, 0.2], vec![0.3, f64::NAN]]).unwrap();
    let nan = Dataset::new(&[nan], "400:10:410".parse().unwrap(), Extrapolation::Error).unwrap_err();
    assert_eq!(
        nan.to_string(),
        "spectrum 2 of swatches has no value at 410 nm, which the grid needs; its last is at 400 nm: choose a grid \
         without it, leave such spectra out"
    );

    let line = |a: f64| vec![0.5, 0.5 + a, 0.5 - a, 0.5];
    let plane =
        dataset(&[line(0.1), line(-0.2), line(0.3), vec![0.4, 0.5, 0.5, 0.4], vec![0.7, 0.5, 0.5, 0.7]]);
    let reflectances = |k: usize| Fit::new(SpectrumKind::Reflectance).components(k);
    assert_eq!(reflectances(2).fit(&plane).map(|m| m.components()), Ok(2));
    assert_eq!(reflectances(3).fit(&plane).unwrap_err(), FitError::Rank { components: 3, rank: 2 });
    assert!(reflectances(3).fit(&plane).unwrap_err().to_string().contains("rank 2"));
    assert_eq!(reflectances(0).fit(&plane).unwrap_err(), FitError::Components(0));
    assert_eq!(
        reflectances(5).fit(&plane).unwrap_err(),
        FitError::TooFewSpectra { components: 5, spectra: 5 }
    );
    let alike = dataset(&vec![vec![0.1, 0.2, 0.7]; 4]);
    assert_eq!(reflectances(1).fit(&alike).unwrap_err(), FitError::NoVariation { spectra: 4 });

    let dark = dataset(&[vec![1.0, 2.0], vec![1.0, -3.0], vec![2.0, 1.0]]);
    let error = Fit::new(SpectrumKind::Illuminant).components(1).fit(&dark).unwrap_err();
    assert!(matches!(error, FitError::Power { power: -1.0, .. }), "{error:?}");
    assert!(
        error.to_string().starts_with("spectrum 2 of swatches (3 spectra): its mean power is -1"),
        "{error}"
    );
    let unnormalized = Fit::new(SpectrumKind::Illuminant).components(1).normalization(Normalization::None);
    let error = unnormalized.fit(&dark).unwrap_err();
    assert!(matches!(error, FitError::Unphysical(_)), "{error:?}");
    assert!(
        error.to_string().contains("spectrum 2 of swatches") && error.to_string().contains("-3"),
        "{error}"
    );
}

#[test]
fn model_files_keep_every_bit() {
    for &name in Model::BUILTIN {
        let model = Model::builtin(name).expect("it is built in");
        let read = Model::from_json(name, &model.to_json()).expect("it was just written");
        assert_eq!(read, model);
        assert_eq!(read.to_json(), model.to_json());
    }
}

/// A sound model file of two components.
fn file() -> Value {
    json!({
        "schema": 1, "kind": "reflectance", "wavelengths": [400.0, 410.0, 420.0],
        "mean": [0.5, 0.5, 0.5], "basis": [[0.6, 0.8, 0.0], [-0.8, 0.6, 0.0]],
        "weight_mean": [0.0, 0.0], "weight_covariance": [[0.02, 0.01], [0.01, 0.02]],
        "explained_variance": [0.9, 0.1], "normalization": "none", "sources": [],
    })
}

#[test]
fn what_is_not_a_model_says_why() {
    Model::from_json("sound.json", &file().to_string()).expect("the file is sound before it is spoilt");
    let cases = [
        ("schema", json!(2), "a model of schema 2, and this program reads up to 1: update spectroll"),
        ("kind", json!("sound"), "unknown variant `sound`"),
        ("wavelengths", json!([420.0, 410.0, 400.0]), "number 2 is 410 nm after 420 nm"),
        ("wavelengths", json!([400.0, 410.0, 410.0]), "number 3 is 410 nm after 410 nm"),
        ("wavelengths", json!([400.0, 410.0]), "basis has 3 values where the rest of the model needs 2"),
        ("mean", json!([0.5, 0.5]), "mean has 2 values where the rest of the model needs 3"),
        ("basis", json!([[0.6, 0.8], [-0.8, 0.6]]), "basis has 2 values where the rest of the model needs 3"),
        ("basis", json!([[0.6, 0.8, 0.0], [0.6, 0.8, 0.0]]), "basis vectors 2 and 1 have the product 1"),
        ("basis", json!([[1.2, 1.6, 0.0], [-0.8, 0.6, 0.0]]), "basis vectors 1 and 1 have the product 4"),
        ("basis", json!([[0.6, 0.8, 0.0], [-0.8, 0.6001, 0.0]]), "basis vectors 2 and 1 have the product"),
        ("basis", json!([]), "this one has 0 for 3 bands"),
        ("weight_mean", json!([0.0]), "weight_mean has 1 value where the rest of the model needs 2"),
        (
            "weight_covariance",
            json!([[0.02, 0.01]]),
            "weight_covariance has 2 values where the rest of the model needs 4",
        ),
        ("weight_covariance", json!([[0.02, 0.03], [0.03, 0.02]]), "not positive semi-definite"),
        ("weight_covariance", json!([[0.02, 0.01], [0.0, 0.02]]), "not symmetric"),
        (
            "explained_variance",
            json!([0.9]),
            "explained_variance has 1 value where the rest of the model needs 2",
        ),
        ("normalization", json!("maximum"), "unknown variant `maximum`"),
        ("colour", json!("red"), "unknown field `colour`"),
        ("mean", Value::Null, "invalid type: null"),
    ];
    for (field, value, message) in cases {
        let mut spoilt = file();
        spoilt[field] = value;
        let error = Model::from_json("spoilt.json", &spoilt.to_string()).unwrap_err().to_string();
        assert!(error.starts_with("spoilt.json") && error.contains(message), "{field}: {error}");
    }
    let error = Model::load(Path::new("no such model.json")).unwrap_err().to_string();
    assert!(error.contains("no such model.json"), "{error}");
}

/// Principal components in single precision are made orthonormal, and the spectra stay what they were to that precision.
#[test]
fn a_basis_in_single_precision_is_made_orthonormal() {
    let exact = Model::builtin("munsell-vrhel").expect("it is built in");
    assert_eq!(exact.basis_correction(), None);
    let mut single: Value = serde_json::from_str(&exact.to_json()).expect("a model is JSON");
    let mut random = 1u32;
    for value in
        single["basis"].as_array_mut().expect("rows").iter_mut().flat_map(|row| row.as_array_mut().unwrap())
    {
        random = random.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let error = 1.0 + 2e-6 * (f64::from(random) / f64::from(u32::MAX) - 0.5);
        *value = json!(f64::from((value.as_f64().expect("a number") * error) as f32));
    }
    let model = Model::from_json("single.json", &single.to_string()).expect("it is nearly orthonormal");
    let error = model.basis_correction().expect("it was corrected");
    assert!(error > 1e-9 && error < 1e-5, "{error}");
    let basis = &model.parts().basis;
    let products = basis * basis.transpose() - DMatrix::identity(6, 6);
    assert!(products.amax() < 1e-14, "{}", products.amax());
    assert!((basis - &exact.parts().basis).amax() < 2e-6);
    // What it writes is orthonormal.
    let again = Model::from_json("again.json", &model.to_json()).expect("it was just written");
    assert_eq!((again.parts(), again.basis_correction()), (model.parts(), None));
}

/// Fits this many small data sets with the program; see `fit_small.py`.
fn assert_small_fits(count: u32) {
    let (python, mut command) = python("fit_small.py");
    let output = run(command.args([env!("CARGO_BIN_EXE_spectroll"), &count.to_string()]), &python);
    println!("{}", String::from_utf8_lossy(&output.stdout));
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

#[test]
fn small_data_sets_agree_with_numpy() {
    assert_small_fits(60);
}

#[test]
#[ignore = "half a minute; `make exhaustive` runs it"]
fn a_thousand_small_data_sets_agree_with_numpy() {
    assert_small_fits(1000);
}
