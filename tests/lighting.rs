//! Surfaces under the lights of their scenes: responses and color signals, against sums in f64 over the stored spectra.

mod engines;
mod program;

use std::path::Path;
use std::time::Instant;

use engines::{cpu, gpu, gpu_is_software};
use program::{fails, python, succeeds};
use spectroll::scene::{Illuminants, IntensityScope, LrvLevels, Scene, Surfaces, TargetConstraint, Targets};
use spectroll::{
    Engine, EngineError, Illuminant, Intensity, Model, Observer, Quantity, ResponseScale, Sensors,
};

/// The largest difference, relative to the response to a perfect white under the same light.
const BOUND: f64 = 5e-7;

fn model(name: &str) -> Model {
    Model::builtin(name).expect("it is built in")
}

fn cones() -> Sensors {
    Sensors::builtin("ss2").expect("it is built in")
}

const SEEN: [Quantity; 3] = [Quantity::Spectra, Quantity::Responses, Quantity::ColorSignal];

/// Surfaces and targets of every kind, under lights of these.
fn scene(lights: Illuminants, scale: Option<ResponseScale>) -> Scene {
    let surfaces = model("munsell-vrhel");
    macro_rules! seen {
        ($group:expr) => {{
            let group = $group.quantities(SEEN).sensors(cones()).under("lights");
            match scale {
                Some(scale) => group.response_scale(scale),
                None => group,
            }
        }};
    }
    Scene::builder(40)
        .seed(5)
        // Before its lights, so that order is no matter.
        .group(seen!(Surfaces::new("wall", &surfaces, 7)))
        .group(lights.quantities([Quantity::Spectra, Quantity::Responses]).sensors(cones()))
        .group(seen!(Surfaces::new("fixed", &surfaces, 3).fixed()))
        .group(seen!(Targets::new("target", &surfaces, TargetConstraint::Lrv(LrvLevels::even(0.2, 0.6, 5)))))
        .group(seen!(Targets::flat("flat", LrvLevels::from(0.5))))
        .build()
        .expect("it can be drawn")
}

/// Every array of all scenes, with those that all share.
fn arrays(engine: &Engine, scene: &Scene) -> Vec<(String, Vec<usize>, Vec<f32>, bool)> {
    let mut session = scene.session(engine).expect("the engine works");
    let values = |bytes: &[u8]| bytemuck::pod_collect_to_vec::<u8, f32>(bytes);
    let mut all: Vec<(String, Vec<usize>, Vec<f32>, bool)> = Vec::new();
    for (array, bytes) in session.constants() {
        all.push((array.name.clone(), array.shape.clone(), values(&bytes), false));
    }
    let shared = all.len();
    session
        .draw(0..scene.scenes(), |window| {
            for (number, (array, bytes)) in window.arrays().enumerate() {
                if all.len() <= shared + number {
                    all.push((array.name.clone(), array.shape.clone(), Vec::new(), true));
                }
                all[shared + number].2.extend(values(bytes));
            }
            Ok::<_, EngineError>(())
        })
        .unwrap_or_else(|e| panic!("{e}"));
    all
}

/// The largest differences of responses and color signals, relative to white.
fn worst(scene: &Scene, all: &[(String, Vec<usize>, Vec<f32>, bool)], scale: ResponseScale) -> f64 {
    let bands = scene.grid().len();
    let functions = cones().on_grid(scene.grid()).expect("they are on the grid");
    let find = |name: &str| all.iter().find(|(found, ..)| found == name).unwrap_or_else(|| panic!("{name}"));
    let scenes = scene.scenes() as usize;
    let spectra = |name: &str, number: usize| -> Vec<Vec<f64>> {
        let (_, shape, values, varies) = find(name);
        let each = shape.iter().product::<usize>();
        let start = if *varies { number * each } else { 0 };
        values[start..start + each].chunks(bands).map(|row| row.iter().map(|&v| v.into()).collect()).collect()
    };
    let mut worst = 0.0f64;
    for name in ["wall", "fixed", "target", "flat"] {
        let (_, shape, responses, _) = find(&format!("{name}_responses"));
        let (_, signal_shape, signals, _) = find(&format!("{name}_color_signal"));
        for number in 0..scenes {
            let (lights, elements) = (spectra("lights", number), spectra(name, number));
            assert_eq!(shape, &[lights.len(), elements.len(), 3], "{name}");
            assert_eq!(signal_shape, &[lights.len(), elements.len(), bands], "{name}");
            for (l, light) in lights.iter().enumerate() {
                for (e, element) in elements.iter().enumerate() {
                    let at = (number * lights.len() + l) * elements.len() + e;
                    for (c, function) in functions.iter().enumerate() {
                        let sum = |of: &dyn Fn(usize) -> f64| -> f64 {
                            (0..bands).map(|b| of(b) * light[b] * function[b] * 10.0).sum()
                        };
                        let (white, expected) = (sum(&|_| 1.0), sum(&|b| element[b]));
                        let found = f64::from(responses[3 * at + c]);
                        let relative = if scale == ResponseScale::White { found } else { found / white };
                        worst = worst.max((relative - expected / white).abs());
                    }
                    let peak = light.iter().fold(0.0, |a: f64, v| a.max(*v));
                    for b in 0..bands {
                        let found = f64::from(signals[bands * at + b]);
                        worst = worst.max((found - light[b] * element[b]).abs() / peak);
                    }
                }
            }
        }
    }
    worst
}

fn kinds_of_lights() -> Vec<(&'static str, Illuminants)> {
    let lights = || Illuminants::new("lights", &model("granada"), 3);
    let range = Intensity::LogUniform(0.15, 150.0);
    vec![
        ("plain", lights()),
        ("each brighter", lights().intensity(range, IntensityScope::Light)),
        ("all brighter", lights().intensity(range, IntensityScope::Scene)),
        ("twice as bright", lights().intensity(Intensity::Fixed(2.0), IntensityScope::Scene)),
        ("of one shape", lights().same_shape().intensity(range, IntensityScope::Light)),
        ("fixed", lights().fixed()),
        ("fixed but brighter", lights().fixed().intensity(range, IntensityScope::Light)),
        ("of another mean", lights().mean(&spectroll::colorimetry::d65(&spectroll::Grid::DEFAULT))),
    ]
}

#[test]
fn responses_are_sums_over_the_stored_spectra() {
    for (name, lights) in kinds_of_lights() {
        for scale in [None, Some(ResponseScale::White)] {
            let scene = scene(lights.clone(), scale);
            let all = arrays(cpu(), &scene);
            let error = worst(&scene, &all, scale.unwrap_or(ResponseScale::Absolute));
            println!("lights {name}, {scale:?}: {error:.1e} of white");
            assert!(error < BOUND, "{name}: {error}");
            assert!(!gpu_is_software() || all == arrays(gpu(), &scene), "{name}");
        }
    }
}

/// A neighbour's light, and exchanged sensors, are far outside the bound.
#[test]
fn faults_are_noticed() {
    let (_, lights) = kinds_of_lights().swap_remove(1);
    let scene = scene(lights, None);
    let good = arrays(cpu(), &scene);
    let planted = |change: &dyn Fn(&mut Vec<f32>)| {
        let mut all = good.clone();
        let found = all.iter_mut().find(|(name, ..)| name == "wall_responses").expect("it is there");
        change(&mut found.2);
        worst(&scene, &all, ResponseScale::Absolute)
    };
    assert!(planted(&|values| values.rotate_left(3)) > 1e3 * BOUND); // the next surface's
    assert!(planted(&|values| values.rotate_left(21)) > 1e3 * BOUND); // the next light's
    assert!(planted(&|values| values.chunks_mut(3).for_each(|cones| cones.reverse())) > 1e3 * BOUND);
    assert!(planted(&|values| values[0] *= 1.00001) > BOUND);
}

/// One group alone, whose lights are drawn but not given, has what it has among all.
#[test]
fn a_group_alone_keeps_its_lights() {
    let (_, lights) = kinds_of_lights().swap_remove(1);
    let all = arrays(cpu(), &scene(lights.clone(), None));
    let alone = scene(lights, None).only("wall").expect("it is there");
    assert_eq!(alone.groups().collect::<Vec<_>>(), ["wall"]);
    let found = arrays(cpu(), &alone);
    assert!(found.iter().all(|array| array.0.starts_with("wall")));
    assert!(found.iter().all(|array| all.contains(array)));
}

const FILE: &str = "
scenes = 30
seed = 2
[[illuminant]]
name = 'lights'
model = 'granada'
count = 3
intensity = { log_uniform = [0.15, 150] }
[[surface]]
name = 'wall'
model = 'munsell-vrhel'
count = 9
quantities = ['spectra', 'responses', 'color_signal', 'xyz']
sensors = 'camera.csv'
under = 'lights'
observer = 'cie1964'
illuminant = 'f11'
[[target]]
name = 'target'
model = 'munsell-vrhel'
lrv = 0.4
quantities = ['responses']
sensors = 'ss10'
response_scale = 'white'
";

fn write_files(folder: &Path) {
    std::fs::write(folder.join("scene.toml"), FILE).expect("it can be written");
    let rows =
        (0..31).map(|b| format!("{},{},{}\n", 400 + 10 * b, 0.01 * f64::from(b), 1.0 - 0.03 * f64::from(b)));
    let text = format!("nm,R,G\n{}", rows.collect::<String>());
    std::fs::write(folder.join("camera.csv"), text).expect("it can be written");
}

#[test]
fn scene_files_and_every_format_have_them() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    write_files(folder);
    for name in ["a.npz", "a.h5", "a.mat", "a.zarr"] {
        succeeds(folder, &format!("scene scene.toml --engine cpu -o {name}"));
    }
    succeeds(folder, "scene scene.toml --engine cpu -o parts/ --format parquet");
    succeeds(folder, "scene scene.toml --engine cpu --arrays wall_responses -o a.csv");
    let found = python(
        folder,
        "import warnings; warnings.simplefilter('ignore')\n\
         import numpy as np, h5py, scipy.io, pandas, zarr, glob\n\
         a = np.load('a.npz'); r = a['wall_responses']; s = a['wall_color_signal']\n\
         assert r.shape == (30, 3, 9, 2) and s.shape == (30, 3, 9, 31) and a['target_responses'].shape == (30, 1, 3)\n\
         light = a['lights'].astype(float); wall = a['wall'].astype(float)\n\
         camera = np.loadtxt('camera.csv', delimiter=',', skiprows=1)[:, 1:].T\n\
         white = 10 * np.einsum('slb,cb->slc', light, camera)\n\
         e = 10 * np.einsum('slb,sub,cb->sluc', light, wall, camera)\n\
         assert np.abs((r - e) / white[:, :, None]).max() < 5e-7\n\
         assert np.abs(s / (light[:, :, None] * wall[:, None]) - 1).max() < 2e-7\n\
         h = h5py.File('a.h5'); assert (h['wall_responses'][:] == r).all()\n\
         z = zarr.open('a.zarr'); assert (z['wall_responses'][:] == r).all()\n\
         assert list(z['wall_responses'].metadata.dimension_names) == ['scene', 'lights_number', 'wall_number', 'sensor']\n\
         m = scipy.io.loadmat('a.mat'); assert (m['wall_responses'].T == r).all(), m['wall_responses'].shape\n\
         p = pandas.concat(pandas.read_parquet(f) for f in sorted(glob.glob('parts/*.parquet')))\n\
         assert (np.stack(p['wall_responses']).reshape(r.shape) == r).all()\n\
         c = pandas.read_csv('a.csv'); assert c.columns[1] == 'wall_responses_0_0_G', c.columns[:4]\n\
         assert (c.to_numpy(np.float32).reshape(r.shape) == r).all()\n\
         print('same')",
    );
    assert_eq!(found, "same");
    let (_, said) = succeeds(folder, "verify a.zarr --redraw 1");
    assert!(said.contains("drawn again"), "{said}");
}

#[test]
fn settings_that_mean_nothing_say_so() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    let surface = "scenes = 1\n[[illuminant]]\nname = 'lights'\nmodel = 'granada'\ncount = 3\n\
                   [[surface]]\nname = 'wall'\nmodel = 'munsell-vrhel'\ncount = 9\n";
    for (lines, message) in [
        ("quantities = ['responses']", "sensors of \"wall\": it is missing: write sensors = \"ss2\""),
        ("quantities = ['color_signal']", "under of \"wall\": it is missing: write under = \"lights\""),
        ("sensors = 'ss2'", "it means nothing without \"responses\" among the quantities"),
        ("under = 'lights'", "it means nothing without \"responses\" or \"color_signal\""),
        (
            "quantities = ['color_signal']\nunder = 'light'",
            "there are no lights \"light\", did you mean \"lights\"?",
        ),
        ("quantities = ['responses']\nsensors = 'ss3'", "\"ss3\" is neither a built-in set of sensors"),
        ("quantities = ['xyz']\nilluminant = 'd66'", "\"d66\" is neither an illuminant"),
        ("quantities = ['xyz']\nilluminant = '3000K'", "from 4000 to 25000 K"),
        ("illuminant = 'a'", "illuminant of \"wall\""),
        ("quantities = ['xyz']\nobserver = 'cie1932'", "did you mean \"cie1931\"?"),
    ] {
        std::fs::write(folder.join("a.toml"), format!("{surface}{lines}\n")).expect("it can be written");
        fails(folder, "scene a.toml -o a.npz", 2, message);
    }
}

/// What is seen of targets without lights: under the illuminant and by the observer of the group.
#[test]
fn observers_and_illuminants_of_groups() {
    let surfaces = model("munsell-vrhel");
    let (observer, illuminant) = (Observer::Cie1964, Illuminant::F2);
    let scene = Scene::builder(20)
        .group(
            Surfaces::new("wall", &surfaces, 5)
                .quantities([Quantity::Spectra, Quantity::Xyz])
                .observer(observer)
                .illuminant(illuminant.clone()),
        )
        .group(
            Targets::new("target", &surfaces, TargetConstraint::Lrv(LrvLevels::from(0.4)))
                .quantities([Quantity::Spectra, Quantity::Xyz])
                .observer(observer)
                .illuminant(illuminant.clone()),
        )
        .build()
        .expect("it can be drawn");
    let all = arrays(cpu(), &scene);
    let weights =
        observer.xyz_weights_under(&illuminant.power(scene.grid()), scene.grid()).expect("it is visible");
    for name in ["wall", "target"] {
        let find = |name: &str| &all.iter().find(|(found, ..)| found == name).expect("it is there").2;
        let (spectra, xyz) = (find(name), find(&format!("{name}_xyz")));
        for (spectrum, xyz) in spectra.chunks(31).zip(xyz.chunks(3)) {
            for (weights, found) in weights.iter().zip(xyz) {
                let expected: f64 = weights.iter().zip(spectrum).map(|(w, s)| w * f64::from(*s)).sum();
                assert!((f64::from(*found) - expected).abs() < BOUND, "{name}: {found} {expected}");
            }
            assert!(name == "wall" || (xyz[1] - 0.4).abs() < 1e-6);
        }
    }
}

/// Prints the cost of responses beside that of spectra; `cargo test --release --test lighting -- --ignored --nocapture`.
#[test]
#[ignore = "a measurement, which asserts nothing of times"]
fn cost_of_responses_beside_spectra() {
    let (daylight, surfaces) = (model("granada"), model("munsell-vrhel"));
    let scene = |quantities: &[Quantity]| {
        let wall = Surfaces::new("wall", &surfaces, 999).quantities(quantities.iter().copied());
        let wall = match quantities.contains(&Quantity::Responses) {
            true => wall.sensors(cones()).under("lights"),
            false => wall,
        };
        Scene::builder(3000)
            .group(Illuminants::new("lights", &daylight, 3))
            .group(wall)
            .build()
            .expect("it can be drawn")
    };
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let write = |name: &str, quantities: &[Quantity]| {
        let scene = scene(quantities);
        let export = spectroll::export::SceneExport::new(&scene, 0..3000);
        let output = spectroll::export::Output::to(folder.path().join(name)).expect("it is a format");
        let start = Instant::now();
        export.write(cpu(), &output).expect("it is written");
        start.elapsed().as_secs_f64()
    };
    for run in 0..4 {
        let spectra = write(&format!("s{run}.npz"), &[Quantity::Spectra]);
        let responses = write(&format!("r{run}.npz"), &[Quantity::Responses]);
        println!(
            "3,000 scenes of 999 surfaces: spectra {spectra:.2} s, responses {responses:.2} s, {:.2}",
            responses / spectra
        );
    }
}
