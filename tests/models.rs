//! Models as people name them: the built-in ones at any grid, and what is said where a name is none.

mod program;

use std::fs;

use program::{fails, npy, succeeds};
use spectroll::{BuiltinModel, Grid, Model, SpectrumKind, Stream};

#[test]
fn a_builtin_model_is_fitted_at_the_grid_that_is_asked_for() {
    let grid: Grid = "380:20:780".parse().unwrap();
    let model = Model::builtin_at("granada", grid).unwrap();
    assert_eq!((model.grid(), model.components(), model.kind()), (grid, 6, SpectrumKind::Illuminant));
    assert_eq!(model.parts().powers.len(), 2600);
    // Normalised over its own grid.
    assert!((model.parts().mean.mean() - 1.0).abs() < 1e-9);
    assert!(model.parts().explained_variance.iter().sum::<f64>() > 0.997);
    let committed = Model::builtin("granada").unwrap();
    assert_eq!(Model::builtin_at("granada", Grid::DEFAULT).unwrap(), committed);
    let fine = "400:5:700".parse().unwrap();
    assert_eq!(Model::builtin_at("granada", fine).unwrap(), Model::builtin("granada-5nm").unwrap());
}

#[test]
fn a_builtin_model_is_refused_beyond_its_data() {
    for (name, grid, range) in [
        ("munsell-vrhel", "380:10:780", "from 400 to 700 nm"),
        ("granada", "290:10:1100", "from 300 to 1100 nm"),
    ] {
        let error = Model::builtin_at(name, grid.parse().unwrap()).unwrap_err().to_string();
        assert!(error.contains(range) && error.contains(grid) && error.contains("choose a grid"), "{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let arguments = "sample munsell-vrhel --wavelengths 380:10:780 -n 5 -o x.npy";
    fails(folder.path(), arguments, 2, "from 400 to 700 nm");
}

#[test]
fn a_sample_of_another_grid_is_that_of_the_library() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(
        folder.path(),
        "sample granada --wavelengths 380:20:780 -n 20 --seed 4 --engine cpu -q -o x.npy",
    );
    let (shape, values) = npy(&folder.path().join("x.npy"));
    assert_eq!(shape, [20, 21]);
    let model = Model::builtin_at("granada", "380:20:780".parse().unwrap()).unwrap();
    let recipe = spectroll::Recipe::builder(&model).build().unwrap();
    let drawn: Vec<f32> =
        (0..20).flat_map(|i| recipe.draw::<f32>(Stream::new(4), i).spectrum().to_vec()).collect();
    assert_eq!(values, drawn);
}

#[test]
fn builtin_models_are_listed() {
    let folder = tempfile::tempdir().unwrap();
    let (table, _) = succeeds(folder.path(), "models");
    assert!(Model::BUILTIN.iter().all(|name| table.contains(name)), "{table}");
    assert!(table.contains("300-1100 nm") && table.contains("400-700 nm"), "{table}");
    let (json, _) = succeeds(folder.path(), "list --json");
    let rows: Vec<serde_json::Value> = serde_json::from_str(&json).unwrap();
    let granada = rows.iter().find(|row| row["name"] == "granada").unwrap();
    assert_eq!(granada["spectra"], 2600);
    assert_eq!((granada["first_nm"].as_f64(), granada["step_nm"].as_f64()), (Some(300.0), Some(5.0)));
    assert!((granada["explained_variance_percent"].as_f64().unwrap() - 99.92).abs() < 0.01);
    let surfaces = BuiltinModel::named("munsell-vrhel").unwrap();
    assert_eq!((surfaces.spectra, surfaces.first_nm, surfaces.last_nm), (632, 400.0, 700.0));
    assert_eq!(BuiltinModel::named("nonesuch"), None);
}

#[test]
fn names_that_are_none_say_what_was_meant() {
    let folder = tempfile::tempdir().unwrap();
    let data = concat!(env!("CARGO_MANIFEST_DIR"), "/data/sur_vrhel.mat");
    fs::copy(data, folder.path().join("vrhel.mat")).unwrap();
    let percent = "400,40,50,60\n410,41,55,52\n420,42,51,70\n";
    fs::write(folder.path().join("percent.csv"), percent).unwrap();
    fs::write(folder.path().join("rows.csv"), "0.1,0.2\n0,0.4\n").unwrap();
    for (arguments, code, message) in [
        ("inspect grenada", 2, "did you mean granada?"),
        ("inspect munsel", 2, "did you mean munsell-vrhel?"),
        ("inspect vrhel", 2, "did you mean munsell-vrhel?"),
        ("inspect vrhel.mat", 4, "vrhel.mat is a MATLAB file of data: fit a model to it first"),
        ("fit granada -o x.json", 2, "granada is a model, fitted already"),
        ("fit munsel -o x.json", 2, "did you mean munsell?"),
        ("fit munsell -o x.csv", 2, "a model is a JSON file, not .csv: pass -o x.json"),
        ("fit munsell -k 0% -o x.json", 4, "a share of the variance of 0"),
        ("fit munsell -k many -o x.json", 2, "expected a number of components, or a share"),
        (
            "fit percent.csv --kind reflectance -k 1 --wavelengths 400:10:420 -o x.json",
            4,
            "(--scale 0.01, or --kind illuminant)",
        ),
        ("fit rows.csv --kind reflectance -k 1 -o x.json", 4, "are the spectra in rows?"),
        ("sample munsell-vrhel -n 5 --lrv 40 -o x.npy", 2, "did you mean 0.4?"),
        (
            "sample munsell-vrhel -n 5 --illuminant a -o x.npy",
            2,
            "--illuminant needs --quantities xyz or linear_srgb",
        ),
        (
            "sample granada -n 5 --quantities intensity -o x.npy",
            2,
            "--quantities intensity needs --intensity",
        ),
        (
            "sample munsell-vrhel -n 5 --max-attempts 1 -o x.npy",
            2,
            "would find no acceptable spectrum in 1 attempt",
        ),
    ] {
        fails(folder.path(), arguments, code, message);
    }
}

#[test]
fn a_fit_takes_a_share_of_the_variance_and_a_scale() {
    let folder = tempfile::tempdir().unwrap();
    let (_, said) = succeeds(folder.path(), "fit munsell vrhel -k 99% -o share.json");
    let model = |file: &str| Model::load(&folder.path().join(file)).unwrap();
    let k = model("share.json").components();
    assert!(said.contains(&format!("{k} components explain")), "{said}");
    let explained = |k: usize| {
        succeeds(folder.path(), &format!("fit munsell vrhel -k {k} -o k{k}.json"));
        model(&format!("k{k}.json")).parts().explained_variance.iter().sum::<f64>()
    };
    assert!(explained(k) >= 0.99 && explained(k - 1) < 0.99);

    let percent = "400,40,50,60\n410,41,55,52\n420,42,51,70\n";
    fs::write(folder.path().join("percent.csv"), percent).unwrap();
    succeeds(
        folder.path(),
        "fit percent.csv --kind reflectance -k 1 --scale 0.01 --wavelengths 400:10:420 -o percent.json",
    );
    assert!((model("percent.json").parts().mean[0] - 0.5).abs() < 1e-12);
}

#[test]
fn a_model_is_told_to_programs() {
    let folder = tempfile::tempdir().unwrap();
    let (json, _) = succeeds(folder.path(), "inspect munsell-vrhel --wavelengths 420:20:680 --json");
    let facts: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((facts["kind"].as_str(), facts["wavelengths_nm"][1].as_f64()), (Some("reflectance"), Some(440.0)));
    let accepted = facts["accepted_percent"].as_f64().unwrap();
    assert!((70.0..90.0).contains(&accepted), "{accepted}");
    let components = facts["components"].as_array().unwrap();
    assert_eq!((components.len(), components[0]["basis"].as_array().unwrap().len()), (6, 14));
    let (table, _) = succeeds(folder.path(), "inspect granada");
    assert!(table.contains("of the model's candidates") && table.contains("power above 0"), "{table}");
}

#[test]
fn the_grid_of_a_model_file_stands() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), "fit munsell vrhel -o m.json");
    let arguments = "sample m.json --wavelengths 400:5:700 -n 5 -o x.npy";
    fails(folder.path(), arguments, 2, "make another with `spectroll fit --wavelengths 400:5:700`");
}

#[test]
fn the_version_has_the_commit_where_it_is_known() {
    let folder = tempfile::tempdir().unwrap();
    let (version, _) = succeeds(folder.path(), "--version");
    assert!(version.starts_with(concat!("spectroll ", env!("CARGO_PKG_VERSION"))), "{version}");
    assert_eq!(version.trim(), concat!("spectroll ", env!("SPECTROLL_VERSION")));
}
