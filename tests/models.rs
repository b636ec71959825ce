//! The built-in models on the grids of their names and on others.
//!
//! The program is part of the default features; what it does here is what `Model::builtin_at` does.

mod program;

use program::{fails, npy, succeeds};
use spectroll::scene::Scene;
use spectroll::{BuiltinTable, Dataset, Extrapolation, Fit, Grid, Model, ModelError, SpectrumKind};

fn grid(text: &str) -> Grid {
    text.parse().expect("it is a grid")
}

#[test]
fn the_grid_of_a_name_gives_the_model_of_that_name() {
    for &name in Model::BUILTIN {
        let model = Model::builtin(name).expect("it is built in");
        assert_eq!(
            Model::builtin_at(name, model.grid().clone()).expect("its own grid is possible"),
            model,
            "{name}"
        );
    }
    let fine = Model::builtin("granada-5nm").expect("it is built in");
    assert_eq!(Model::builtin_at("granada", fine.grid().clone()).expect("a grid of its family"), fine);
}

#[test]
fn other_grids_give_fits_of_the_tables() {
    for (name, at, tables, kind) in [
        (
            "munsell-vrhel",
            "420:4:680",
            &[BuiltinTable::Munsell, BuiltinTable::Vrhel][..],
            SpectrumKind::Reflectance,
        ),
        ("granada", "380:5:780", &[BuiltinTable::Granada], SpectrumKind::Illuminant),
    ] {
        let model = Model::builtin_at(name, grid(at)).expect("the grid lies within the data");
        let tables: Vec<_> = tables.iter().map(|table| table.table()).collect();
        let data = Dataset::new(&tables, grid(at), Extrapolation::Error).expect("the tables cover it");
        assert_eq!(model, Fit::new(kind).fit(&data).expect("there are six components"), "{name}");
        assert_eq!((model.grid(), model.kind()), (&grid(at), kind));
    }
}

/// The compact table gives, on the grids of the models that were fitted to the measurements, nearly these models:
/// `data/README.md` says how nearly.
#[test]
fn the_compact_daylights_are_near_the_measured_ones() {
    for name in ["granada", "granada-5nm"] {
        let measured = Model::builtin(name).expect("it is built in");
        let data =
            Dataset::new(&[BuiltinTable::Granada.table()], measured.grid().clone(), Extrapolation::Error);
        let data = data.expect("the table covers 400 to 700 nm");
        let compact = Fit::new(SpectrumKind::Illuminant).fit(&data).expect("there are six components");
        let (a, b) = (measured.parts(), compact.parts());
        let mean = (&a.mean - &b.mean).amax();
        let products = (&a.basis * b.basis.transpose()).diagonal();
        let angle = products.min().clamp(-1.0, 1.0).acos().to_degrees();
        let variances = a.weight_covariance.diagonal().component_div(&b.weight_covariance.diagonal());
        let deviation = variances.iter().map(|ratio| (ratio.sqrt() - 1.0).abs()).fold(0.0, f64::max);
        let explained = a.explained_variance.iter().sum::<f64>() - b.explained_variance.iter().sum::<f64>();
        let powers = a.powers.iter().zip(&b.powers).map(|(a, b)| (a / b - 1.0).abs()).fold(0.0, f64::max);
        println!(
            "{name}: mean off by {mean:.1e}, basis by {angle:.3} degrees, sd by {deviation:.1e}, explained variance \
             by {explained:.1e}, powers by {powers:.1e}"
        );
        assert!(mean < 2e-5 && angle < 0.3 && deviation < 2e-3, "{name}");
        assert!(explained.abs() < 1e-4 && powers < 5e-3, "{name}");
    }
}

#[test]
fn grids_beyond_the_data_are_refused_with_their_range() {
    for (name, at, range) in [
        ("munsell-vrhel", "380:5:700", "from 400 to 700 nm"),
        ("munsell-vrhel-5nm", "400:10:710", "from 400 to 700 nm"),
        ("granada", "295:5:700", "from 300 to 1100 nm"),
    ] {
        let message = Model::builtin_at(name, grid(at)).expect_err("it was not measured there").to_string();
        for part in [name, range, at, "choose one within it"] {
            assert!(message.contains(part), "{message}");
        }
    }
    let error = Model::builtin_at("munsell-vrhel", grid("500:10:520")).expect_err("three bands are too few");
    assert!(matches!(error, ModelError::BuiltinFit { .. }), "{error}");
    assert!(error.to_string().contains("more bands"), "{error}");
    let error = Model::builtin_at("granda", Grid::DEFAULT).expect_err("there is no such model").to_string();
    assert!(error.contains("granada"), "{error}");
}

#[test]
fn built_in_models_take_the_wavelengths_of_a_scene() {
    let scene = |wavelengths: &str, model: &str| {
        let group = format!("[[surface]]\nname = \"wall\"\nmodel = \"{model}\"\ncount = 2");
        Scene::parse("walls.toml", &format!("scenes = 1\n{wavelengths}\n{group}"), std::path::Path::new(""))
            .expect("the scene is possible")
    };
    assert_eq!(scene("wavelengths = \"410:6:650\"", "munsell-vrhel").grid(), &grid("410:6:650"));
    assert_eq!(scene("wavelengths = \"400:5:700\"", "munsell-vrhel-5nm").grid(), &grid("400:5:700"));
    assert_eq!(scene("", "munsell-vrhel-5nm").grid(), &grid("400:5:700"));
    assert_eq!(scene("", "munsell-vrhel").grid(), &Grid::DEFAULT);
}

#[test]
fn the_program_lists_the_models() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let (text, _) = succeeds(folder.path(), "models");
    assert_eq!(succeeds(folder.path(), "list").0, text);
    let lines: Vec<_> = text.lines().collect();
    assert_eq!(lines.len(), 1 + Model::BUILTIN.len(), "{text}");
    assert!(lines.iter().all(|line| line.chars().count() <= 80), "{text}");
    let (json, _) = succeeds(folder.path(), "models --json");
    let rows: Vec<serde_json::Value> = serde_json::from_str(&json).expect("it is JSON");
    for ((row, line), &name) in rows.iter().zip(&lines[1..]).zip(Model::BUILTIN) {
        let data = Model::builtin_data(name).expect("it is built in");
        let measured = format!("{}:{}:{}", data.first, data.step, data.last);
        assert_eq!((row["name"].as_str(), row["spectra"].as_u64()), (Some(name), Some(data.spectra as u64)));
        assert_eq!(row["measured"].as_str(), Some(measured.as_str()));
        assert!(line.starts_with(name) && line.contains(&measured), "{line}");
    }
}

#[test]
fn the_program_fits_built_in_models_at_the_wavelengths_asked_for() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    succeeds(folder, "sample granada -n 5 --wavelengths 380:5:780 --engine cpu -o a.npy");
    assert_eq!(npy(&folder.join("a.npy")).0, [5, 81]);
    succeeds(folder, "sample granada-5nm -n 5 --engine cpu -o b.npy");
    succeeds(folder, "sample granada -n 5 --wavelengths 400:5:700 --engine cpu -o c.npy");
    assert_eq!(npy(&folder.join("b.npy")), npy(&folder.join("c.npy")));
    let (table, _) = succeeds(folder, "inspect munsell-vrhel --wavelengths 420:4:680");
    assert!(table.contains("420:4:680 nm"), "{table}");
    let (shader, _) = succeeds(folder, "shader munsell-vrhel --wavelengths 450:5:650");
    assert_ne!(shader, succeeds(folder, "shader munsell-vrhel").0);

    let model = Model::builtin("granada").expect("it is built in");
    std::fs::write(folder.join("own.json"), model.to_json()).expect("it is written");
    for command in ["sample own.json -n 1 -o d.npy", "inspect own.json", "shader own.json"] {
        fails(folder, &format!("{command} --wavelengths 380:5:780"), 2, "spectroll fit --wavelengths");
    }
    let beyond = "sample munsell-vrhel -n 1 --wavelengths 380:5:780 -o d.npy";
    fails(folder, beyond, 2, "from 400 to 700 nm");
}

#[test]
fn a_model_is_told_to_programs() {
    let folder = tempfile::tempdir().unwrap();
    let (json, _) = succeeds(folder.path(), "inspect munsell-vrhel --wavelengths 420:20:680 --json");
    let facts: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!(
        (facts["kind"].as_str(), facts["wavelengths_nm"][1].as_f64()),
        (Some("reflectance"), Some(440.0))
    );
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
    fails(folder.path(), arguments, 2, "the grid belongs to the model");
}

#[test]
fn the_version_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let (version, _) = succeeds(folder.path(), "--version");
    assert!(version.starts_with(concat!("spectroll ", env!("CARGO_PKG_VERSION"))), "{version}");
}

#[test]
fn a_fit_takes_a_share_of_the_variance_and_a_scale() {
    let folder = tempfile::tempdir().unwrap();
    let (_, said) = succeeds(folder.path(), "fit munsell vrhel -k 99% -o share.json");
    let model = |file: &str| Model::load(folder.path().join(file)).unwrap();
    let k = model("share.json").components();
    assert!(said.contains(&format!("{k} components explain")), "{said}");
    let explained = |k: usize| {
        succeeds(folder.path(), &format!("fit munsell vrhel -k {k} -o k{k}.json"));
        model(&format!("k{k}.json")).parts().explained_variance.iter().sum::<f64>()
    };
    assert!(explained(k) >= 0.99 && explained(k - 1) < 0.99);

    let percent = "400,40,50,60\n410,41,55,52\n420,42,51,70\n";
    std::fs::write(folder.path().join("percent.csv"), percent).unwrap();
    succeeds(
        folder.path(),
        "fit percent.csv --kind reflectance -k 1 --scale 0.01 --decimal point --wavelengths 400:10:420 -o percent.json",
    );
    assert!((model("percent.json").parts().mean[0] - 0.5).abs() < 1e-12);
}

/// The figures of the method's page: how far accepted draws are from the data that the model was fitted to.
#[test]
fn draws_are_shown_beside_the_data() {
    let folder = tempfile::tempdir().unwrap();
    let command = "inspect munsell-vrhel --data munsell vrhel -o beside.svg --json";
    let (text, _) = succeeds(folder.path(), command);
    let facts: serde_json::Value = serde_json::from_str(&text).unwrap();
    let comparison = &facts["comparison"];
    assert_eq!((&comparison["spectra"], &comparison["draws"]), (&632.into(), &20_000.into()));
    let shift = comparison["weights"][0]["drawn"]["mean_shift"].as_f64().unwrap();
    assert!((shift - 0.34).abs() < 0.03, "{shift}");
    let svg = std::fs::read_to_string(folder.path().join("beside.svg")).unwrap();
    assert!(svg.contains("munsell (462 spectra), vrhel (170 spectra) and 20,000 draws of seed 0"));
    let (text, _) = succeeds(folder.path(), "inspect munsell-vrhel --data munsell vrhel");
    assert!(text.lines().all(|line| line.chars().count() <= 80 && line.trim_end() == line), "{text}");
    for (arguments, code, message) in [
        ("munsell-vrhel --data granada", 2, "the model is one of reflectances, and these are not"),
        ("munsell-vrhel --data none.csv", 4, "cannot read"),
        ("munsell-vrhel --data munsel", 2, "did you mean munsell"),
        ("munsell-vrhel --data munsell --scale 100", 2, "pass --scale 0.01"),
        ("munsell-vrhel --scale 2", 2, "--data"),
        ("munsell-vrhel --lrv 0.999 --data munsell", 2, "0.995928"),
    ] {
        fails(folder.path(), &format!("inspect {arguments}"), code, message);
    }
}
