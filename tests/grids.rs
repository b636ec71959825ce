//! Grids that are uneven, and grids that are coarser than the data: through fits, draws, files, scenes and shaders.

mod program;

use std::fs;
use std::path::Path;

use program::{fails, npy, python, spectroll, succeeds};
use spectroll::{
    BuiltinTable, Dataset, Extrapolation, Fit, Grid, Model, ResampleMethod, Resampling, SpectrumKind, Table,
    colorimetry,
};

/// Numbers in 0..1, the same in every run.
struct Numbers(u64);

impl Numbers {
    fn between(&mut self, low: f64, high: f64) -> f64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        low + (high - low) * (self.0 >> 11) as f64 / (1u64 << 53) as f64
    }
}

/// A lamp at these wavelengths: by its number of a filament, a phosphor behind a blue LED, several LEDs, or a discharge
/// with lines on phosphors, of which some are 1 nm wide.
fn lamp(number: usize, wavelengths: &[f64], random: &mut Numbers) -> Vec<f64> {
    let peak = |at: f64, centre: f64, width: f64| (-0.5 * ((at - centre) / width).powi(2)).exp();
    // Height, centre and width of each peak.
    let mut peaks = Vec::new();
    let temperature = random.between(2300.0, 6500.0);
    let mut filament = 0.0;
    match number % 4 {
        0 => filament = 1.0,
        1 => {
            peaks.push((random.between(0.3, 2.0), random.between(440.0, 465.0), random.between(6.0, 12.0)));
            peaks.push((1.0, random.between(530.0, 600.0), random.between(35.0, 65.0)));
            peaks.push((random.between(0.0, 1.0), random.between(600.0, 640.0), random.between(15.0, 40.0)));
            // The red lines of a fluoride phosphor.
            let red = random.between(0.0, 2.0);
            peaks.extend([(0.4, 613.5), (1.0, 630.7), (0.3, 647.7)].map(|(h, c)| (h * red, c, 1.5)));
        }
        2 => {
            for centre in [450.0, 475.0, 525.0, 595.0, 635.0] {
                let height = random.between(0.1, 1.0);
                peaks.push((height, centre + random.between(-8.0, 8.0), random.between(8.0, 16.0)));
            }
        }
        _ => {
            filament = 0.05;
            peaks.push((random.between(0.1, 0.4), random.between(450.0, 500.0), 25.0));
            peaks.push((random.between(0.1, 0.5), random.between(560.0, 620.0), 40.0));
            let lines = [
                (0.8, 404.7, 0.5),
                (2.0, 435.8, 0.6),
                (3.0, 546.1, 0.6),
                (1.0, 577.0, 0.6),
                (1.0, 579.1, 0.6),
                (6.0, 542.5, 2.0),
                (1.5, 487.0, 3.0),
                (8.0, 611.5, 1.5),
                (1.0, 587.5, 3.0),
                (0.8, 631.0, 2.0),
            ];
            peaks.extend(
                lines.map(|(height, centre, width)| (height * random.between(0.2, 1.0), centre, width)),
            );
        }
    }
    let planck = |nm: f64| (560.0 / nm).powi(5) / (1.4388e7 / (nm * temperature)).exp_m1();
    let value = |&at: &f64| {
        let peaks: f64 = peaks.iter().map(|&(height, centre, width)| height * peak(at, centre, width)).sum();
        filament * planck(at) / planck(560.0) + peaks
    };
    wavelengths.iter().map(value).collect()
}

/// 318 lamps at 1 nm.
fn lamps() -> Table {
    let wavelengths: Vec<f64> = (360..=830).map(f64::from).collect();
    let mut random = Numbers(318);
    let lamps: Vec<_> = (0..318).map(|number| lamp(number, &wavelengths, &mut random)).collect();
    Table::new("lamps", wavelengths, &lamps).expect("it is a table")
}

/// Chromaticity x and y of lights, a column each.
fn chromaticities<'a>(grid: &Grid, lights: impl Iterator<Item = &'a [f64]>) -> Vec<[f64; 2]> {
    let weights = colorimetry::emitted_xyz_weights(grid);
    lights
        .map(|light| {
            let [x, y, z] = weights.each_ref().map(|w| w.iter().zip(light).map(|(w, v)| w * v).sum::<f64>());
            [x / (x + y + z), y / (x + y + z)]
        })
        .collect()
}

fn furthest(a: &[[f64; 2]], b: &[[f64; 2]]) -> f64 {
    a.iter().zip(b).map(|(a, b)| (a[0] - b[0]).hypot(a[1] - b[1])).fold(0.0, f64::max)
}

#[test]
fn averages_keep_the_chromaticity_and_the_power_of_lamps() {
    let table = lamps();
    let fine: Grid = "380:1:780".parse().unwrap();
    let measured = Dataset::new(std::slice::from_ref(&table), fine.clone(), Extrapolation::Error).unwrap();
    let truth = chromaticities(&fine, measured.spectra().as_slice().chunks_exact(fine.len()));
    for grid in ["380:10:780", "380:5:780", "383:10:773"] {
        let grid: Grid = grid.parse().unwrap();
        let by = |method| {
            let settings = Resampling::default().method(method);
            Dataset::new(std::slice::from_ref(&table), grid.clone(), settings).unwrap()
        };
        let moved = |data: &Dataset| {
            furthest(&chromaticities(&grid, data.spectra().as_slice().chunks_exact(grid.len())), &truth)
        };
        let (averaged, plain) = (by(ResampleMethod::Auto), by(ResampleMethod::Interpolate));
        let (few, many) = (moved(&averaged), moved(&plain));
        println!("{grid}: xy moves by up to {few:.5} by averages, {many:.5} by plain values");
        assert!(averaged.spectra() == by(ResampleMethod::Average).spectra() && averaged.notes().len() == 1);
        assert!(few < 0.002, "{grid}: {few}");
        assert!(many > 0.01, "{grid}: plain values lose too little for this test to mean anything: {many}");
        // Power: of the bands, and of what was measured below their triangles.
        let step = grid.step().unwrap();
        for lamp in 0..table.len() {
            let kept = step * averaged.spectra().column(lamp).sum();
            let below = table.wavelengths().iter().zip(table.spectrum(lamp)).map(|(&w, value)| {
                let beyond = (grid.first() - w).max(w - grid.last()).max(0.0);
                value * (1.0 - beyond / step).max(0.0)
            });
            let below: f64 = below.sum();
            assert!((kept / below - 1.0).abs() < 1e-9, "{grid}, lamp {lamp}: {kept} {below}");
        }
    }
}

/// A table of reflectances at the wavelengths of a spectrometer, without those that water absorbs.
fn uneven(folder: &Path) -> Vec<f64> {
    let spectrometer = (0..70).map(|i| 398.0 + 5.3 * f64::from(i) - 0.004 * f64::from(i * i));
    let wavelengths: Vec<f64> =
        spectrometer.filter(|w| !(500.0..540.0).contains(w)).map(|w| (w * 1e3).round() / 1e3).collect();
    let mut text = "nm".to_owned();
    let spectra = 25;
    (0..spectra).for_each(|i| text += &format!(",s{i}"));
    for w in &wavelengths {
        text += &format!("\n{w}");
        for i in 0..spectra {
            let i = f64::from(i);
            let value = 0.45
                + 0.2 * (0.7 * i).sin()
                + 0.1 * (1.3 * i).cos() * (w - 550.0) / 150.0
                + 0.05 * (2.1 * i).sin() * (w / 40.0).cos();
            text += &format!(",{value:.6}");
        }
    }
    fs::write(folder.join("uneven.csv"), text).unwrap();
    wavelengths
}

/// The fit, against NumPy; the luminous reflectance, against its trapezoid rule.
#[test]
fn uneven_wavelengths_are_fitted_as_measured() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let wavelengths = uneven(folder);
    let fit = "fit uneven.csv --kind reflectance -k 3 --wavelengths as-measured -o m.json";
    let (_, said) = succeeds(folder, fit);
    assert!(said.contains(&format!("{} wavelengths from 398 to", wavelengths.len())), "{said}");
    let code = "import json, numpy as np\n\
                m = json.load(open('m.json')); d = np.loadtxt('uneven.csv', delimiter=',', skiprows=1)\n\
                assert m['wavelengths'] == d[:, 0].tolist()\n\
                s = d[:, 1:].T; c = s - s.mean(0); v = np.linalg.svd(c)\n\
                b = np.array(m['basis']); assert abs(np.array(m['mean']) - s.mean(0)).max() < 1e-12\n\
                assert abs(np.diag(m['weight_covariance']) - v[1][:3]**2 / len(s)).max() < 1e-12\n\
                assert abs(abs((b * v[2][:3]).sum(1)) - 1).max() < 1e-9; print('same')";
    assert_eq!(python(folder, code), "same");

    let model = Model::load(folder.join("m.json")).unwrap();
    assert_eq!(model.grid().step(), None);
    let weights = colorimetry::lrv_weights(model.grid()).unwrap();
    assert!((weights.iter().sum::<f64>() - 1.0).abs() < 1e-14);
    let [_, y, _] = colorimetry::cmf(model.grid());
    let light: Vec<f64> = colorimetry::d65(model.grid()).iter().zip(y).map(|(e, y)| e * y).collect();
    let ramp: Vec<f64> = wavelengths.iter().map(|w| w / 1000.0).collect();
    let trapezoid = |value: &dyn Fn(usize) -> f64| -> f64 {
        let areas = wavelengths.windows(2).enumerate();
        areas.map(|(i, pair)| (pair[1] - pair[0]) * (value(i) + value(i + 1)) / 2.0).sum()
    };
    let expected = trapezoid(&|i| ramp[i] * light[i]) / trapezoid(&|i| light[i]);
    let found: f64 = weights.iter().zip(&ramp).map(|(w, r)| w * r).sum();
    assert!((found - expected).abs() < 1e-14, "{found} {expected}");

    // Draws of an LRV have it, and both engines draw the same bytes.
    for engine in ["cpu", "gpu"] {
        succeeds(folder, &format!("sample m.json -n 500 --lrv 0.4 --engine {engine} -o {engine}.npy"));
    }
    let (shape, draws) = npy(&folder.join("cpu.npy"));
    assert_eq!(shape, [500, wavelengths.len() as u64]);
    for draw in draws.chunks_exact(wavelengths.len()) {
        let lrv: f64 = weights.iter().zip(draw).map(|(w, &v)| w * f64::from(v)).sum();
        assert!((lrv - 0.4).abs() < 1e-6, "{lrv}");
    }
    let (adapters, _) = succeeds(folder, "adapters");
    if adapters.starts_with("0: ") && adapters.contains("[software") {
        assert!(fs::read(folder.join("cpu.npy")).unwrap() == fs::read(folder.join("gpu.npy")).unwrap());
    }
}

/// The wavelengths are in every file, and what the program reads of what it wrote makes the same model.
#[test]
fn every_format_has_uneven_wavelengths() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    uneven(folder);
    succeeds(folder, "fit uneven.csv --kind reflectance -k 3 --wavelengths as-measured -o m.json");
    for name in ["o.csv", "o.npz", "o.h5", "o.mat", "o.parquet", "o.zarr", "o.spd"] {
        succeeds(folder, &format!("sample m.json -n 40 --engine cpu -o {name} -q"));
    }
    let code = "import glob, json, numpy as np, h5py, scipy.io as sio, zarr, pyarrow.parquet as pq\n\
                w = np.array(json.load(open('m.json'))['wavelengths'])\n\
                mat = sio.loadmat('o.mat')\n\
                found = [np.array(open('o.csv').readline().split(','), float), np.load('o.npz')['wavelength'],\n\
                         h5py.File('o.h5')['wavelength'][:], mat['wavelength'].ravel(), mat['S_X'],\n\
                         np.array(json.loads(pq.read_schema('o.parquet').metadata[b'wavelength'])),\n\
                         zarr.open('o.zarr')['wavelength'][:], np.loadtxt(sorted(glob.glob('o.spd/*.spd'))[0])[:, 0]]\n\
                assert mat['S_X'].shape == (len(w), 1), mat['S_X'].shape\n\
                print([f.ravel().tolist() == w.tolist() for f in found])";
    assert_eq!(python(folder, code), format!("[{}]", ["True"; 8].join(", ")));
    for name in ["o.h5", "o.mat"] {
        succeeds(folder, &format!("fit {name} -k 3 --wavelengths as-measured -o {name}.json"));
        let model = Model::load(folder.join(format!("{name}.json"))).unwrap();
        assert_eq!(model.grid(), Model::load(folder.join("m.json")).unwrap().grid(), "{name}");
    }
    succeeds(folder, "sample m.json -n 300 --chunk 100 --engine cpu -o set.zarr -q");
    succeeds(folder, "verify set.zarr --redraw 1");
}

#[test]
fn pictures_shaders_and_scenes_take_uneven_wavelengths() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let wavelengths = uneven(folder);
    succeeds(folder, "fit uneven.csv --kind reflectance -k 3 --wavelengths as-measured -o m.json");
    succeeds(folder, "inspect m.json --data uneven.csv -o m.svg");
    let (text, _) = succeeds(folder, "inspect m.json");
    assert!(text.contains("wavelengths from 398 to"), "{text}");
    let (shader, _) = succeeds(folder, "shader m.json --quantities spectra,lrv --lrv 0.2..0.5");
    assert!(shader.contains("fn spectroll_draw"), "{shader}");
    let scene = "scenes = 3\n[[surface]]\nname = \"wall\"\nmodel = \"m.json\"\ncount = 2\n\
                 [[target]]\nname = \"target\"\nmodel = \"m.json\"\nlrv = [0.2, 0.4]\n";
    fs::write(folder.join("scene.toml"), scene).unwrap();
    succeeds(folder, "scene scene.toml --engine cpu -o scene.npz --preview scene.svg");
    let code = "import numpy as np; f = np.load('scene.npz'); print(f['wall'].shape, len(f['wavelength']))";
    let bands = wavelengths.len();
    assert_eq!(python(folder, code), format!("(3, 2, {bands}) {bands}"));

    // Built-in models are fitted at the bands of a sensor, in samples and in scenes.
    fs::write(folder.join("bands.txt"), "443\n490\n560\n665\n705\n740\n783\n842\n865\n").unwrap();
    succeeds(folder, "sample granada -n 10 --wavelengths bands.txt --engine cpu -o g.csv");
    let head = fs::read_to_string(folder.join("g.csv")).unwrap();
    assert!(head.starts_with("443,490,560,665,705,740,783,842,865\n"), "{head}");
    let scene = "scenes = 2\nwavelengths = [410, 443, 470, 490, 530, 560, 620, 665, 700]\n\
                 [[illuminant]]\nname = \"sun\"\nmodel = \"granada\"\ncount = 1\n\
                 [[surface]]\nname = \"wall\"\nmodel = \"munsell-vrhel\"\ncount = 2\n";
    fs::write(folder.join("bands.toml"), scene).unwrap();
    let (_, said) = succeeds(folder, "scene bands.toml --engine cpu -o bands.npz");
    assert!(said.contains("9 bands"), "{said}");
    fails(folder, "sample granada -n 1 --wavelengths bands.tx -o x.npy", 2, "there is no file of this name");
}

/// XYZ of lights on an uneven grid are integrals by the trapezoid rule.
#[test]
fn lights_on_uneven_grids_are_integrated() {
    let grid: Grid = "400,420,450,455,500,520,555,560,600,640,645,700".parse().unwrap();
    let model = Model::builtin_at("granada", grid.clone()).unwrap();
    let [_, y, _] = colorimetry::cmf(&grid);
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("m.json"), model.to_json()).unwrap();
    succeeds(folder.path(), "sample m.json -n 20 --quantities spectra,xyz --engine cpu -o d.npz");
    let list = |values: &[f64]| values.iter().map(f64::to_string).collect::<Vec<_>>().join(",");
    let code = format!(
        "import numpy as np; f = np.load('d.npz'); y = np.array([{}]); w = f['wavelength']\n\
         print(abs(np.trapezoid(f['spectra'] * y, w, axis=1) / f['xyz'][:, 1] - 1).max() < 1e-5)",
        list(&y)
    );
    assert_eq!(python(folder.path(), &code), "True");
}

/// What `fit` says where it averages, drops or fills.
#[test]
fn a_fit_says_what_it_did() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let table = lamps();
    let mut text = String::new();
    for (band, w) in table.wavelengths().iter().enumerate().step_by(2) {
        text += &w.to_string();
        (0..20).for_each(|i| text += &format!(",{:.6}", table.spectrum(i)[band]));
        text.push('\n');
    }
    fs::write(folder.join("lamps.csv"), text).unwrap();
    let (_, said) = succeeds(folder, "fit lamps.csv --kind illuminant -o m.json");
    assert!(
        said.contains("structure finer than the grid") && said.contains("averaged over bands of 10 nm"),
        "{said}"
    );
    let (_, said) =
        succeeds(folder, "fit lamps.csv --kind illuminant --resample interpolate -o m.json --force");
    assert!(!said.contains("finer"), "{said}");
    let (_, said) = succeeds(folder, "fit munsell vrhel -o s.json");
    assert!(!said.contains("finer"), "{said}");
    let asked = spectroll(folder, "fit munsell vrhel --wavelengths as-measured -o x.json");
    let said = String::from_utf8(asked.stderr).unwrap();
    assert!(said.contains("munsell and vrhel were measured at different wavelengths"), "{said}");
}

/// The models that are built in are not averaged, whatever `fit` would do with their data.
#[test]
fn built_in_models_keep_plain_values() {
    let grid: Grid = "400:50:700".parse().unwrap();
    let settings = Resampling::default().method(ResampleMethod::Interpolate);
    let data = Dataset::new(&[BuiltinTable::Granada.table()], grid.clone(), settings).unwrap();
    let plain = Fit::new(SpectrumKind::Illuminant).components(6).fit(&data).unwrap();
    assert_eq!(Model::builtin_at("granada", grid).unwrap(), plain);
}
