//! What sensors and observers see of draws, against NumPy and colour-science, through every output and on both engines.

mod engines;
mod program;

use engines::{cpu, gpu, gpu_is_software, lights, surfaces};
use program::{fails, python, script, succeeds};
use spectroll::{
    Engine, EngineError, Illuminant, Model, Observer, Quantity, Recipe, RecipeBuilder, ResponseScale,
    ResponseTarget, Sensors, Stream,
};

/// SPECTROLL_PYTHON names a Python that has NumPy, SciPy and colour-science; `make test` makes one.
#[test]
fn responses_are_those_of_numpy_and_colour_science() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    println!("{}", script(folder.path(), "sensors", ""));
}

fn cones() -> Sensors {
    Sensors::builtin("ss2").expect("it is built in")
}

fn drawn(engine: &Engine, recipe: &Recipe, count: u64) -> Vec<(Quantity, Vec<u8>)> {
    let mut all: Vec<(Quantity, Vec<u8>)> = Vec::new();
    let made = engine.draw(recipe, Stream::new(8).draws(0..count), |batch| {
        all.resize_with(batch.formats().len(), || (Quantity::Spectra, Vec::new()));
        for (format, (quantity, bytes)) in batch.formats().iter().zip(&mut all) {
            *quantity = format.quantity;
            bytes.extend_from_slice(batch.bytes(format.quantity));
        }
        Ok::<_, EngineError>(())
    });
    made.unwrap_or_else(|e| panic!("{engine}: {e}"));
    all
}

/// One response, three, and as many as a set may have, in straight lines and in loops.
#[test]
fn both_engines_give_the_same_responses() {
    let narrow: Vec<Vec<f64>> =
        (0..64).map(|i| (0..31).map(|band| f64::from(u8::from(band == i % 31)) + 0.01).collect()).collect();
    let grid: Vec<f64> = (0..31).map(|band| 400.0 + 10.0 * f64::from(band)).collect();
    let many = Sensors::new("many", (0..64).map(|i| i.to_string()), &grid, &narrow).expect("it is a set");
    let one = Sensors::builtin("rods").expect("it is built in");
    let seen = |builder: RecipeBuilder, sensors: Sensors| {
        let builder = builder.sensors(sensors).quantities([Quantity::Spectra, Quantity::Responses]);
        builder.build().expect("it can be drawn")
    };
    let recipes = [
        seen(surfaces(), one),
        seen(surfaces().lrv(0.4).observer(Observer::Cie1964), cones()),
        seen(
            surfaces().target(ResponseTarget::new(cones(), "S", 0.1..0.3)).illuminant(Illuminant::F11),
            cones(),
        ),
        seen(surfaces(), many.clone()),
        seen(lights(), many),
    ];
    for recipe in recipes {
        let (ours, theirs) = (drawn(cpu(), &recipe, 2003), drawn(gpu(), &recipe, 2003));
        assert!(!gpu_is_software() || ours == theirs);
    }
}

/// A set without the quantity changes no draw, and one with it neither.
#[test]
fn sensors_change_no_draw() {
    let plain = surfaces().build().expect("it can be drawn");
    let seen = surfaces().sensors(cones()).quantities([Quantity::Spectra, Quantity::Responses]);
    let seen = seen.response_scale(ResponseScale::Absolute).build().expect("it can be drawn");
    assert_eq!(drawn(cpu(), &plain, 500)[0], drawn(cpu(), &seen, 500)[0]);
}

#[test]
fn every_format_holds_responses_with_their_names() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    let asked = "sample munsell-vrhel -n 40 --seed 3 --engine cpu --sensors ss2 --quantities";
    for name in ["a.npz", "a.h5", "a.mat", "a.parquet", "a.zarr"] {
        succeeds(folder, &format!("{asked} spectra,responses -o {name}"));
    }
    succeeds(folder, &format!("{asked} responses -o a.npy"));
    succeeds(folder, &format!("{asked} responses -o a.csv"));
    let found = python(
        folder,
        "import warnings; warnings.simplefilter('ignore')\n\
         import numpy as np, h5py, scipy.io, pandas, zarr\n\
         a = np.load('a.npy'); assert a.shape == (40, 3) and a.dtype == np.float32\n\
         assert (np.load('a.npz')['responses'] == a).all()\n\
         assert (h5py.File('a.h5')['responses'][:] == a).all()\n\
         assert (scipy.io.loadmat('a.mat')['responses'].T == a).all()\n\
         assert (np.stack(pandas.read_parquet('a.parquet')['responses']) == a).all()\n\
         assert (zarr.open('a.zarr')['responses'][:] == a).all()\n\
         c = pandas.read_csv('a.csv'); assert list(c.columns) == ['L', 'M', 'S'], c.columns\n\
         assert (c.to_numpy(np.float32) == a).all()\n\
         print('same')",
    );
    assert_eq!(found, "same");
    let (_, said) = succeeds(folder, "verify a.zarr --redraw 1");
    assert!(said.contains("drawn again"), "{said}");
}

#[test]
fn what_cannot_be_seen_says_why() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    std::fs::write(folder.join("narrow.csv"), "nm,a\n450,0.5\n500,1\n550,0.5\n").expect("it can be written");
    std::fs::write(folder.join("two.csv"), "nm,a,b\n400,1,1\n700,1,1\n").expect("it can be written");
    let sample = "sample munsell-vrhel -n 10 -o a.npy --quantities responses";
    for (options, code, message) in [
        ("", 2, "--quantities responses needs --sensors"),
        ("--sensors ss3", 2, "\"ss3\" is no built-in set of sensors, did you mean \"ss2\"?"),
        ("--sensors none.csv", 4, "none.csv"),
        ("--sensors narrow.csv", 2, "50 % of its peak at 450 nm, where its table ends"),
        ("--sensors ss2 --illuminant 3000K", 2, "from 4000 to 25000 K"),
        ("--sensors ss2 --illuminant two.csv", 2, "it holds 2 spectra, and an illuminant is one"),
        ("--sensors ss2 --target ss2.K=0.3", 2, "ss2 has no channel \"K\"; there are L, M, S"),
        ("--sensors ss2 --target ss2.L=0.9999", 2, "the largest is"),
        ("--sensors ss2 --target ss2.L=0.3 --lrv 0.3", 2, "cannot be used with"),
    ] {
        fails(folder, &format!("{sample} {options}"), code, message);
    }
    let plain = "sample munsell-vrhel -n 10 -o a.npy";
    fails(folder, &format!("{plain} --sensors ss2"), 2, "--sensors needs --quantities responses");
    fails(folder, &format!("{plain} --observer cie1964"), 2, "--observer needs --lrv, or --quantities xyz");
    let lamps = "sample granada -n 10 -o a.npy --quantities responses --sensors ss2";
    fails(folder, &format!("{lamps} --response-scale white"), 2, "--response-scale absolute");
    fails(folder, &format!("{lamps} --target ss2.L=0.3"), 2, "and this model is of illuminants");
}

#[test]
fn the_module_has_the_responses_that_are_asked_for() {
    let recipe =
        surfaces().sensors(cones()).quantities([Quantity::Responses]).build().expect("it can be drawn");
    let text = recipe.wgsl("cones").expect("it is small");
    assert!(text.contains("fn cones_responses(d: cones_Draw) -> array<f32, 3>"), "{text}");
    let plain = Recipe::builder(&Model::builtin("munsell-vrhel").expect("it is built in")).build();
    assert!(!plain.expect("it can be drawn").wgsl("cones").expect("it is small").contains("responses"));
}
