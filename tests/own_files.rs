//! Every file that the program writes, fitted by the program: the same model as of the draws themselves.

mod program;

use std::path::Path;

use program::{fails, python, succeeds};
use serde_json::Value;
use spectroll::{Dataset, Extrapolation, Fit, Model, Recipe, SpectrumKind, Stream, Table};

const DRAWS: u64 = 300;

/// The model of draws that never were in a file.
fn model_of_draws() -> Model {
    let source = Model::builtin("munsell-vrhel").expect("it is built in");
    let recipe = Recipe::builder(&source).build().expect("a recipe");
    let spectra: Vec<Vec<f64>> = (0..DRAWS)
        .map(|i| recipe.draw::<f32>(Stream::new(5), i).spectrum().iter().map(|&v| f64::from(v)).collect())
        .collect();
    let table = Table::new("draws", source.grid().wavelengths().collect(), &spectra).expect("a table");
    let data =
        Dataset::new(&[table], source.grid().clone(), Extrapolation::Error).expect("they are on the grid");
    Fit::new(SpectrumKind::Reflectance).components(3).fit(&data).expect("they vary")
}

fn numbers(value: &Value) -> Vec<f64> {
    match value {
        Value::Array(all) => all.iter().flat_map(numbers).collect(),
        other => vec![other.as_f64().expect("a number")],
    }
}

/// Fits a file; returns the mean, the weights' covariance and the sources of the model.
fn fit(folder: &Path, file: &str, options: &str) -> (Vec<f64>, Vec<f64>, String) {
    succeeds(folder, &format!("fit {file} {options} -k 3 -o m.json --force"));
    let text = std::fs::read_to_string(folder.join("m.json")).expect("the model is there");
    let model: Value = serde_json::from_str(&text).expect("it is JSON");
    (numbers(&model["mean"]), numbers(&model["weight_covariance"]), model["sources"].to_string())
}

#[test]
fn every_format_gives_the_model_of_the_draws() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let kind = "--kind reflectance";
    let formats = [
        ("a.csv", "", kind),
        ("a.npy", "", "--kind reflectance --wavelengths 400:10:700"),
        ("b.npz", "", ""),
        ("c.h5", "", ""),
        ("d.mat", "", ""),
        ("e.parquet", "", ""),
        ("f.zarr", "--chunk 70", ""),
        ("g.zarr", "--chunk 70 --zstd", ""),
        ("h/", "--format npy --chunk 70", ""),
        ("i/", "--format parquet --chunk 70", ""),
        ("j/", "--format spd", ""),
    ];
    let reference = model_of_draws();
    let parts = reference.parts();
    for (output, how, options) in formats {
        succeeds(folder, &format!("sample munsell-vrhel -n {DRAWS} --seed 5 --engine cpu -o {output} {how}"));
        let (mean, covariance, sources) = fit(folder, output, options);
        let near = |a: f64, b: f64| (a - b).abs() < 1e-7;
        assert!(mean.iter().zip(&parts.mean).all(|(a, b)| near(*a, *b)), "{output}: {mean:?}");
        assert!(covariance.iter().zip(parts.weight_covariance.iter()).all(|(a, b)| near(*a, *b)), "{output}");
        assert!(sources.contains("(300 spectra)"), "{output}: {sources}");
    }
    // All files hold the same numbers, so that the models are the same to the last digit.
    let first = fit(folder, "a.npy@400:10:700", kind);
    for (output, _, options) in formats.iter().filter(|(output, ..)| !output.starts_with('a')) {
        let found = fit(folder, output, options);
        // Nine digits tell every float32 from every other, and are not its every digit.
        if *output == "j/" {
            assert!(found.0.iter().zip(&first.0).all(|(a, b)| (a - b).abs() < 1e-8), "{output}");
            continue;
        }
        assert_eq!((&found.0, &found.1), (&first.0, &first.1), "{output}");
    }
}

/// Spectra of any width of float are read back as they were written.
#[test]
fn every_width_is_read_in_every_format() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for dtype in ["f16", "f64"] {
        let sample = format!("sample munsell-vrhel -n {DRAWS} --seed 5 --engine cpu --dtype {dtype} --force");
        succeeds(folder, &format!("{sample} -o a.npy"));
        let (mean, covariance, _) = fit(folder, "a.npy@400:10:700", "--kind reflectance");
        let mut formats = vec!["b.npz", "c.h5", "f.zarr --chunk 70", "g/ --format npy --chunk 70"];
        if dtype == "f64" {
            formats.extend(["d.mat", "e.parquet"]); // which are not written in half precision
        }
        for output in formats {
            succeeds(folder, &format!("{sample} -o {output}"));
            let (file, _) = output.split_once(' ').unwrap_or((output, ""));
            let found = fit(folder, file, "");
            assert_eq!((&found.0, &found.1), (&mean, &covariance), "{output}, {dtype}");
        }
    }
}

/// Draws of a set with labels beside them: the spectra are found among all arrays.
#[test]
fn labels_beside_draws_are_no_spectra() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for output in ["a.npz", "a.h5", "a.parquet", "a.zarr", "a.mat"] {
        // As many draws as bands: a label of one value a draw is as long as the wavelengths.
        let quantities = if output == "a.mat" { "spectra,lrv" } else { "spectra,lrv,weights,xyz" };
        succeeds(
            folder,
            &format!("sample munsell-vrhel -n 31 --quantities {quantities} --engine cpu -o {output}"),
        );
        let (mean, ..) = fit(folder, output, "");
        succeeds(folder, "sample munsell-vrhel -n 31 --engine cpu -o b.npz --force");
        assert_eq!(mean, fit(folder, "b.npz", "").0, "{output}");
    }
}

#[test]
fn refusals_name_value_place_and_remedy() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let code = "import numpy as np\n\
                w = np.arange(400, 701, 10)\n\
                R = np.array([[.45+.2*np.sin(i*.7)+.1*np.cos(i*1.3)*(x-550)/150+.05*np.sin(i*2.1)*np.cos(x/40) for i in range(1,41)] for x in w])\n\
                def save(name, R, head='nm,'+','.join(f's{i}' for i in range(1,41)), w=w):\n\
                \x20   np.savetxt(name, np.c_[w, R], delimiter=',', header=head, comments='', fmt='%.6g')\n\
                save('ok.csv', R)\n\
                a = R.copy(); a[14, 0] = -999; save('marker.csv', a)\n\
                a = R.copy(); a[14, 7] = -1.23e34; save('usgs.csv', a)\n\
                a = R.copy(); a[:, 2] *= 100; save('percent.csv', a)\n\
                a = R.copy(); a[3, 5] = np.nan; save('nan.csv', a)\n\
                save('um.csv', R, w=w/1000)\n\
                save('index.csv', R, w=np.arange(1, 32))\n\
                save('zero.csv', np.where((w < 430)[:, None], 0, R))\n\
                np.savetxt('both.csv', np.r_[[np.r_[0, 405:706:10]], np.c_[w, np.tile(R[:, :1], 31)]], delimiter=',', fmt='%.6g')\n\
                open('commas.csv', 'w').write('400,1,2,3\\n410,1,3,2\\n420,2,1,4\\n')\n\
                print('written')";
    assert_eq!(python(folder, code), "written");
    let refusals = [
        (
            "marker.csv",
            "spectrum 1 of \"marker.csv\": the value at 540 nm is -999",
            "--missing-value=-999 --missing drop",
        ),
        ("usgs.csv", "spectrum 8 of \"usgs.csv\": the value at 540 nm is -1", "--missing drop"),
        (
            "percent.csv",
            "spectrum 3 of percent.csv (40 spectra): most of its values are above 1",
            "--scale 0.01",
        ),
        ("nan.csv", "spectrum 6 of \"nan.csv\" has no value at 430 nm", "--missing drop"),
        ("um.csv", "runs from 0.4 to 0.7", "--unit um"),
        ("index.csv", "counts from 1 to 31", "--layout"),
        ("zero.csv", "every spectrum is 0 at 3 wavelengths from 400 to 420 nm", "--wavelengths"),
        ("commas.csv", "400,1; 2,3", "--decimal"),
    ];
    for (file, place, remedy) in refusals {
        let run = format!("fit {file} --kind reflectance -k 2 -o m.json");
        fails(folder, &run, 4, place);
        fails(folder, &run, 4, remedy);
        fails(folder, &run, 4, "`spectroll look FILE`");
    }
    fails(folder, "fit both.csv --kind reflectance -k 2 -o m.json", 4, "--layout columns or rows");
    // The remedies do what they say.
    let count = |file: &str, options: &str| {
        succeeds(folder, &format!("fit {file} --kind reflectance -k 2 -o m.json --force {options}"));
        std::fs::read_to_string(folder.join("m.json")).unwrap()
    };
    assert!(count("marker.csv", "--missing-value=-999 --missing drop").contains("(39 spectra)"));
    assert!(count("nan.csv", "--missing drop").contains("(39 spectra)"));
    assert!(count("um.csv", "--unit um").contains("(40 spectra)"));
    assert!(count("zero.csv", "--wavelengths 430:10:700").contains("(40 spectra)"));
    assert!(
        count("commas.csv", "--decimal point --scale 0.1 --wavelengths 400:10:420").contains("(3 spectra)")
    );
    let ok = count("ok.csv", "");
    assert_eq!(ok.replace("ok.csv", "x"), count("ok.csv", "--layout columns").replace("ok.csv", "x"));
}

#[test]
fn look_says_how_a_file_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let code = "import numpy as np, scipy.io\n\
                w = np.arange(400, 701, 10.)\n\
                R = np.array([[.45+.2*np.sin(i*.7)+.05*np.cos(x/40+i) for x in w] for i in range(20)])\n\
                t = 'Messung\\n;' + ';'.join(f'{x:.0f} nm' for x in w) + '\\n'\n\
                t += '\\n'.join(f'Probe {i};' + ';'.join(f'{v:.4f}'.replace('.', ',') for v in r) for i, r in enumerate(R))\n\
                open('a.txt', 'wb').write(t.encode('utf-16'))\n\
                scipy.io.savemat('b.mat', {'data': R.T[::-1], 'wavelength': w[::-1], 'other': np.zeros((3, 4))})\n\
                print('written')";
    assert_eq!(python(folder, code), "written");
    let (text, _) = succeeds(folder, "look a.txt b.mat");
    for part in [
        "UTF-16LE, separated by semicolons, decimal commas",
        "spectra in rows",
        "400 to 700 nm by 10: 31 wavelengths",
        "turned round",
        "other (3 x 4)",
        "nothing is wrong with them",
    ] {
        assert!(
            text.split_whitespace().collect::<Vec<_>>().join(" ").contains(part),
            "no {part:?} in {text}"
        );
    }
    let (json, _) = succeeds(folder, "look b.mat --json -o b.svg");
    let facts: Value = serde_json::from_str(&json).expect("it is JSON");
    assert_eq!((facts[0]["spectra"].as_u64(), facts[0]["step_nm"].as_f64()), (Some(20), Some(10.0)));
    let svg = std::fs::read_to_string(folder.join("b.svg")).unwrap();
    assert!(svg.contains("As measured") && svg.contains("At 400:10:700 nm"));
}
