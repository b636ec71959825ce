//! Scenes in files: what the program plans, prints and pictures of them, arrays alone, folders of text, and MATLAB's.

mod program;

use std::fs;
use std::path::Path;
use std::process::Command;

use program::{fails, files, npy, python, succeeds};

/// Two scenes of lights that vary, a wall that does not, and targets at two levels.
const SCENE: &str = r#"
scenes = 40
seed = 5

[[illuminant]]
name = "lights"
model = "granada"
count = 2
intensity = { log_uniform = [0.15, 150], shared = true }

[[surface]]
name = "back-wall"
model = "munsell-vrhel"
count = 3
fixed = true

[[target]]
name = "target"
model = "munsell-vrhel"
count = 2
lrv = [0.2, 0.6]
bounds = "scaled"
"#;

/// A folder with the scene, and what `scene` says before the options.
fn scene() -> (tempfile::TempDir, &'static str) {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("mine.toml"), SCENE).unwrap();
    (folder, "scene mine.toml --engine cpu --scenes 10..12")
}

fn spectrum(path: &Path) -> Vec<f32> {
    let text = fs::read_to_string(path).unwrap();
    text.lines().map(|line| line.split_once(' ').unwrap().1.parse().unwrap()).collect()
}

#[test]
fn a_folder_of_text_has_every_group_and_what_is_fixed_once() {
    let (folder, scene) = scene();
    let folder = folder.path();
    let (plan, _) = succeeds(folder, &format!("{scene} -o rooms/ --format spd --dry-run"));
    assert!(plan.contains("rooms/: a folder of 11 files"), "{plan}");
    let (_, summary) = succeeds(folder, &format!("{scene} -o rooms/ --format spd"));
    assert!(summary.contains("rooms/: a folder of 11 files, 2 scenes of 31 bands"), "{summary}");
    assert_eq!(files(&folder.join("rooms")), ["back-wall", "lights", "target"]);
    let inner = |group: &str| files(&folder.join("rooms").join(group));
    assert_eq!(inner("back-wall"), ["reflectance_001.spd", "reflectance_002.spd", "reflectance_003.spd"]);
    assert_eq!(
        inner("lights"),
        [
            "scene-0010-illuminance_001.spd",
            "scene-0010-illuminance_002.spd",
            "scene-0011-illuminance_001.spd",
            "scene-0011-illuminance_002.spd"
        ]
    );
    assert_eq!(
        inner("target"),
        [
            "scene-0010-luminance-0.2000-reflectance-001.spd",
            "scene-0010-luminance-0.2000-reflectance-002.spd",
            "scene-0011-luminance-0.6000-reflectance-001.spd",
            "scene-0011-luminance-0.6000-reflectance-002.spd"
        ]
    );
    for (array, group, shape) in
        [("lights", "lights", [2, 2]), ("target", "target", [2, 2]), ("back-wall", "back-wall", [1, 3])]
    {
        succeeds(folder, &format!("{scene} --arrays {array} -o one.npy --force"));
        let (_, values) = program::npy(&folder.join("one.npy"));
        let names = inner(group);
        assert_eq!(names.len(), shape[0] * shape[1]);
        // A file that holds rows alone has the wall once a scene.
        for (name, expected) in names.iter().zip(values.chunks(31)) {
            assert_eq!(spectrum(&folder.join("rooms").join(group).join(name)), expected, "{name}");
        }
    }
}

#[test]
fn a_folder_of_text_replaces_only_one_of_its_kind() {
    let (folder, scene) = scene();
    let folder = folder.path();
    let rooms = format!("{scene} -o rooms/ --format spd");
    succeeds(folder, &rooms);
    fails(folder, &rooms, 1, "is a folder that exists already");
    // Of other scenes: nothing of the old is left.
    let (_, summary) =
        succeeds(folder, "scene mine.toml --engine cpu --scenes 0..1 --only target -o rooms.spd");
    assert!(summary.contains("rooms.spd: a folder of 2 files"), "{summary}");
    succeeds(
        folder,
        "scene mine.toml --engine cpu --scenes 0..1 --only target -o rooms --format spd --force",
    );
    assert_eq!(files(&folder.join("rooms")), ["target"]);
    fs::write(folder.join("rooms/notes.txt"), "mine").unwrap();
    fails(folder, &format!("{rooms} --force"), 1, "is not a folder of .spd files of this program alone");
    assert!(folder.join("rooms/notes.txt").exists());
    // Files of text are counted as they will be: the wall is not one in every scene.
    let many = SCENE.replace("count = 3", "count = 600");
    fs::write(folder.join("many.toml"), many).unwrap();
    succeeds(folder, "scene many.toml --engine cpu -o many/ --format spd");
    fs::write(folder.join("varying.toml"), SCENE.replace("count = 3\nfixed = true", "count = 600")).unwrap();
    fails(
        folder,
        "scene varying.toml --engine cpu -o varying/ --format spd",
        1,
        "would be a folder of 24160 files",
    );
    fails(
        folder,
        &format!("{scene} --arrays lights_intensity -o x/ --format spd"),
        2,
        ".spd files hold spectra",
    );
}

#[test]
fn samples_say_that_a_folder_is_made() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (plan, _) = succeeds(folder, "sample granada -n 1 -o foo.spd --engine cpu --dry-run");
    assert!(plan.contains("a folder of 1 file, about"), "{plan}");
    let (_, summary) = succeeds(folder, "sample granada -n 12 -o foo.spd --engine cpu");
    assert!(summary.contains("foo.spd: a folder of 12 files, 12 spectra of 31 bands"), "{summary}");
    succeeds(folder, "sample granada -n 2 -o foo.spd --engine cpu --force");
    assert_eq!(files(&folder.join("foo.spd")), ["illuminance_001.spd", "illuminance_002.spd"]);
}

#[cfg(unix)]
#[test]
fn folders_of_text_heed_the_umask() {
    let (folder, scene) = scene();
    let script = format!("umask 027; {} {scene} -q -o rooms/ --format spd", program::PROGRAM);
    let status =
        std::process::Command::new("sh").args(["-c", &script]).current_dir(folder.path()).status().unwrap();
    assert!(status.success());
    let mode = |name: &str| {
        use std::os::unix::fs::PermissionsExt;
        fs::metadata(folder.path().join(name)).unwrap().permissions().mode() & 0o777
    };
    assert_eq!([mode("rooms"), mode("rooms/lights")], [0o750; 2]);
    assert_eq!(mode("rooms/lights/scene-0010-illuminance_001.spd"), 0o640);
}

/// As SciPy reads it, which is as MATLAB would.
#[test]
fn matlab_has_names_of_groups() {
    let (folder, scene) = scene();
    let folder = folder.path();
    succeeds(folder, &format!("{scene} -o a.mat"));
    succeeds(folder, &format!("{scene} -o a.npz"));
    let code = "import json, numpy as np, scipy.io\n\
                assert open('a.mat', 'rb').read(19) == b'MATLAB 5.0 MAT-file'\n\
                m, a = scipy.io.loadmat('a.mat'), np.load('a.npz')\n\
                same = lambda name, array: m[name].dtype == array.dtype and np.array_equal(m[name], array)\n\
                assert m['spd_lights'].shape == (31, 2, 2) and same('spd_lights', a['lights'].T)\n\
                assert m['sur_target'].shape == (31, 2, 2) and same('sur_target', a['target'].T)\n\
                assert m['sur_back_wall'].shape == (31, 3) and same('sur_back_wall', a['back-wall'].T)\n\
                assert same('target_lrv', a['target_lrv'].T) and same('target_attempts', a['target_attempts'].T)\n\
                assert same('lights_intensity', a['lights_intensity'][None])\n\
                for name in ['S_lights', 'S_target', 'S_back_wall']: assert m[name].tolist() == [[400, 10, 31]]\n\
                assert m['wavelength'].tolist() == [[w] for w in range(400, 701, 10)]\n\
                assert json.loads(m['comment'][0])['seed'] == 5\n\
                assert 'S_X' not in m and 'X' not in m\n\
                print(sorted(name for name in m if name[0] != '_'))";
    assert!(python(folder, code).starts_with("['S_back_wall'"));
    for (variable, kind) in [("sur_target", "4 reflectances"), ("spd_lights", "4 illuminants")] {
        let (_, summary) = succeeds(folder, &format!("fit a.mat:{variable} -k 2 -o m.json --force"));
        assert!(summary.contains(kind), "{summary}");
    }
    fails(folder, "fit a.mat -o x.json", 4, "several matrices of spectra");
}

/// Copies are not draws: 5 rounds through 10 levels have 5 draws, and one shape for the data set has 1.
#[test]
fn copies_are_counted_as_the_draws_that_they_are_of() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let target =
        "[[target]]\nmodel = \"munsell-vrhel\"\nlrv = { from = 0.5, to = 0.95, levels = 10 }\ncount = 4\n";
    let same = format!("{target}name = \"same\"\ncopies = \"same_shape\"\n");
    let rounds = format!("{target}name = \"rounds\"\ncopies = \"scaled\"\n");
    fs::write(folder.join("copies.toml"), format!("scenes = 400\n{same}{rounds}{target}name = \"own\"\n"))
        .unwrap();
    let json = |scenes: &str| -> serde_json::Value {
        let run = format!("scene copies.toml --engine cpu --scenes {scenes} -o a.npz --force --json");
        serde_json::from_str(&succeeds(folder, &run).0).unwrap()
    };
    let all = json("0..400");
    let counts = |json: &serde_json::Value, key: &str| -> Vec<u64> {
        let drawn = json["drawn"].as_array().unwrap();
        drawn.iter().map(|group| group[key].as_u64().unwrap()).collect()
    };
    assert_eq!(counts(&all, "draws"), [4, 160, 1600]);
    assert_eq!(all["draws"], 4 + 160 + 1600);
    let code = "import numpy as np; a = np.load('a.npz')\n\
                print([int(a['same_attempts'][0].sum()), int(a['rounds_attempts'][::10].sum())])";
    assert_eq!(format!("{:?}", &counts(&all, "attempts")[..2]), python(folder, code));
    // Spectra that reach 1 are no more than there are draws.
    assert!(
        counts(&all, "above_one").iter().zip(counts(&all, "draws")).all(|(above, draws)| *above <= draws)
    );
    assert!(counts(&all, "above_one")[1] > 0);
    // A run that begins within a round draws for the rest of it.
    assert_eq!(counts(&json("5..15"), "draws"), [4, 8, 40]);
    let (plan, _) = succeeds(folder, "scene copies.toml --engine cpu --dry-run");
    assert!(plan.contains("same: 4 drawn once") && plan.contains("rounds: 4 for each 10 scenes"), "{plan}");
}

/// One number for all lights is an array as well, which all scenes share.
#[test]
fn a_fixed_intensity_is_written_once() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    fs::write(
        folder.join("mine.toml"),
        SCENE
            .replace("{ log_uniform = [0.15, 150], shared = true }", "3")
            .replace("count = 2\nintensity", "count = 2\nfixed = true\nintensity"),
    )
    .unwrap();
    for output in ["a.npz", "a.zarr", "a.h5", "a.mat", "a.csv", "a.parquet", "a.spd"] {
        succeeds(folder, &format!("scene mine.toml --engine cpu --scenes 0..2 -o {output}"));
    }
    let code = "import numpy as np; print(np.load('a.npz')['lights_intensity'].tolist())";
    assert_eq!(python(folder, code), "[3.0, 3.0]");
    let csv = fs::read_to_string(folder.join("a.csv")).unwrap();
    assert!(csv.lines().next().unwrap().contains("lights_intensity_0,lights_intensity_1"), "{csv}");
    succeeds(folder, "verify a.zarr --redraw 1 --engine cpu");
}

/// As a program needs to know as well as a person.
#[test]
fn a_dry_run_tells_the_room_in_both_forms() {
    let (folder, scene) = scene();
    let (plan, _) = succeeds(folder.path(), &format!("{scene} -o a.npz --dtype f64 --dry-run"));
    assert!(plan.contains("are free in"), "{plan}");
    let (json, _) = succeeds(folder.path(), &format!("{scene} -o a.npz --dtype f64 --dry-run --json"));
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert!(json["free"].as_u64().is_some_and(|free| free > 1 << 20), "{json}");
    // Lights, walls and targets, and beside them 2 + 4 labels and 3 times some attempts.
    let bytes = 8 * 31 * (4 + 3 + 4) + 8 * (2 + 4) + 4 * (4 + 3 + 4);
    assert_eq!((json["bytes"].as_u64(), json["least"].as_u64()), (Some(bytes), Some(bytes)));
    let (json, _) = succeeds(folder.path(), &format!("{scene} --dry-run --json"));
    assert!(serde_json::from_str::<serde_json::Value>(&json).unwrap().get("free").is_none());
}

#[test]
fn another_seed_is_recorded() {
    let (folder, scene) = scene();
    let folder = folder.path();
    let code = "import json, numpy as np\n\
                print(json.loads(str(np.load('b.npz')['attributes']))['seed'])";
    succeeds(folder, &format!("{scene} -o a.npz"));
    let (_, summary) = succeeds(folder, &format!("{scene} --seed 6 -o b.npz"));
    assert!(summary.contains("  seed 6\n"), "{summary}");
    assert_eq!(python(folder, code), "6");
    // It is that of a file which says so.
    fs::write(folder.join("mine.toml"), SCENE.replace("seed = 5", "seed = 6")).unwrap();
    succeeds(folder, &format!("{scene} -o c.npz"));
    let same = "import numpy as np; b, c = np.load('b.npz'), np.load('c.npz')\n\
                a = np.load('a.npz'); print(all((b[n] == c[n]).all() for n in b.files if n != 'attributes'),\n\
                (a['target'] == b['target']).any())";
    assert_eq!(python(folder, same), "True False");
    let (_, summary) = succeeds(folder, &format!("{scene} --seed random -o b.npz --force"));
    let drawn = summary.split_once("  seed ").unwrap().1.lines().next().unwrap();
    assert_eq!(python(folder, code), drawn);
    assert!(drawn.parse::<u64>().unwrap() > 1 << 32, "one in 2^32 is not");
    fails(
        folder,
        &format!("{scene} --seed chance -o d.npz"),
        2,
        "a whole number from 0 to 2^64 - 1, or random",
    );
    // A set is drawn again with the seed that it was drawn with.
    succeeds(folder, &format!("{scene} --seed 8 -o e.zarr"));
    succeeds(folder, "verify e.zarr --redraw 1 --engine cpu");
}

#[test]
fn colours_have_arrays_of_their_own() {
    let (folder, scene) = scene();
    let folder = folder.path();
    let asks =
        |text: &str, list: &str| text.replace("fixed = true", &format!("fixed = true\nquantities = {list}"));
    fs::write(folder.join("mine.toml"), asks(SCENE, r#"["xyz", "chromaticity", "linear_srgb"]"#)).unwrap();
    succeeds(folder, &format!("{scene} -o a.npz"));
    let code = "import numpy as np; a = np.load('a.npz')\n\
                assert 'back-wall' not in a.files\n\
                xyz, xy = a['back-wall_xyz'], a['back-wall_chromaticity']\n\
                assert xyz.shape == (3, 3) and xy.shape == (3, 2) and a['back-wall_linear_srgb'].shape == (3, 3)\n\
                print(np.abs(xy - xyz[:, :2] / xyz.sum(axis=1, keepdims=True)).max() < 1e-6)";
    assert_eq!(python(folder, code), "True");
    succeeds(folder, &format!("{scene} --arrays back-wall_chromaticity,target_lrv -o a.csv"));
    let csv = fs::read_to_string(folder.join("a.csv")).unwrap();
    assert!(csv.starts_with("target_lrv_0,target_lrv_1,back-wall_chromaticity_0_x,"), "{csv}");
    // Its spectra are not in any format.
    succeeds(folder, &format!("{scene} -o rooms.spd"));
    assert_eq!(files(&folder.join("rooms.spd")), ["lights", "target"]);
    fails(folder, &format!("{scene} --preview a.png"), 2, "add \"spectra\" to its quantities");
    let (plan, _) = succeeds(folder, &format!("{scene} --dry-run"));
    assert!(
        plan.contains("back-wall: its spectra are not stored, for quantities does not name them"),
        "{plan}"
    );
}

#[test]
fn scenes_are_drawn_planned_and_pictured() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let (text, _) = succeeds(folder.path(), "scene --example condition2");
    fs::write(path("mine.toml"), text).unwrap();
    let (plan, _) = succeeds(folder.path(), "scene mine.toml --dry-run --engine gpu");
    for part in ["lights: 3 a scene, by shader 1", "background: [999, 31]", "1 shader compiled", "left out"] {
        assert!(plan.contains(part), "{plan}");
    }
    for name in ["a.npz", "a.zarr", "a.h5", "a.mat", "a.parquet", "parts/ --format npy"] {
        succeeds(folder.path(), &format!("scene mine.toml --scenes 10..14 -o {name} --engine cpu"));
    }
    succeeds(folder.path(), "scene mine.toml --scenes 0..3 --only target -o a.csv --engine cpu");
    let csv = fs::read_to_string(path("a.csv")).unwrap();
    assert!(csv.starts_with("target_0_400,target_0_410,") && csv.lines().count() == 4, "{csv}");
    let (json, _) = succeeds(folder.path(), "scene mine.toml --scenes 0..5 -o b.npz --json --engine cpu");
    let json: serde_json::Value = serde_json::from_str(&json).unwrap();
    assert_eq!((json["draws"].as_u64(), json["shaders"].as_u64()), (Some(5 * 4 + 999), Some(0)));
    let (_, told) = succeeds(folder.path(), "scene mine.toml --preview a.png --engine cpu");
    assert!(told.contains("wrote a.png"), "{told}");
    succeeds(folder.path(), "scene mine.toml --preview a.png --force --engine cpu");
    for (arguments, code, message) in [
        ("mine.toml", 2, "say where to with -o"),
        ("mine.toml --only walls -o x.npz", 2, "there are lights, background, target"),
        ("mine.toml --scenes 5..2000 -o x.npz", 2, "the file has 1000 scenes"),
        ("mine.toml --scenes 5..1 -o x.npz", 2, "expected A..B"),
        ("absent.toml -o x.npz", 2, "cannot read the scene file"),
        ("--example condition9 -o x.npz", 2, "condition1, condition2, condition3"),
        ("mine.toml --preview a.png", 1, "exists already"),
        ("mine.toml -o x.npy", 2, "choose one array, or name it .npz, .zarr, .h5 or .parquet (--arrays)"),
        (
            "mine.toml --dry-run -o x.npy",
            2,
            "choose one array, or name it .npz, .zarr, .h5 or .parquet (--arrays)",
        ),
        ("mine.toml --arrays target_lrv --format spd -o x/", 2, "choose the spectra of one group or more"),
        (
            "mine.toml --arrays light -o x.npy",
            2,
            "no array \"light\", did you mean \"lights\"?; there are lights,",
        ),
        // What cannot be written is found out before a picture is made.
        ("mine.toml --preview new.png -o x.xlsx", 2, "name it .npy"),
        ("mine.toml --preview new.png -o a.npz", 1, "exists already"),
        ("mine.toml --preview new.png -o no/such.npz", 1, "create it first"),
        ("mine.toml --preview new.jpg -o x.npz", 2, "a .png or a .pdf"),
        ("mine.toml --preview a.png -o x.npz", 1, "exists already"),
    ] {
        fails(folder.path(), &format!("scene {arguments}"), code, message);
    }
    // The group alone is what it is among the others, and dimensions have the names that xarray will show.
    let python = std::env::var("SPECTROLL_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    succeeds(folder.path(), "scene mine.toml --scenes 12..14 --only target -o t.npz --engine cpu");
    let code = "import json, numpy as np; a, t = np.load('a.npz'), np.load('t.npz'); \
                assert (a['target'][2:] == t['target']).all(); \
                m = json.load(open('a.zarr/zarr.json'))['consolidated_metadata']['metadata']; \
                assert m['lights']['dimension_names'] == ['scene', 'lights_number', 'wavelength'], m['lights']; \
                b = np.fromfile('a.zarr/background/c.0.0', '<f4').reshape(999, 31); \
                assert (b == a['background']).all() and (b == np.load('parts/background.npy')).all()";
    let output = Command::new(python).args(["-c", code]).current_dir(folder.path()).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
}

/// One array makes a file of formats that hold one, and is what it is among the others.
#[test]
fn arrays_of_scenes_are_written_alone() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name: &str| folder.path().join(name);
    let scene = "scene --example condition2 --scenes 3..5 --engine cpu";
    succeeds(folder.path(), &format!("{scene} --arrays lights -o lights.npy"));
    succeeds(folder.path(), &format!("{scene} --arrays target_lrv,target -o some.npz"));
    succeeds(folder.path(), &format!("{scene} --arrays lights --format spd -o lights/"));
    succeeds(folder.path(), &format!("{scene} --arrays background -o background.npy"));
    succeeds(folder.path(), &format!("{scene} -o all.npz"));
    let (plan, _) = succeeds(folder.path(), &format!("{scene} --arrays lights --dry-run"));
    assert!(plan.contains("lights: [2, 3, 31]") && !plan.contains("background:"), "{plan}");
    let (shape, lights) = npy(&path("lights.npy"));
    assert_eq!(shape, [2, 3, 31]);
    assert_eq!(npy(&path("background.npy")).0, [2, 999, 31]);

    // Numbered from 1 in each scene.
    let numbers = [3, 4].into_iter().flat_map(|scene| (1..=3).map(move |number| (scene, number)));
    let names: Vec<_> =
        numbers.map(|(scene, number)| format!("scene-{scene:04}-illuminance_{number:03}.spd")).collect();
    assert_eq!(files(&path("lights/lights")), names);
    for (name, light) in names.iter().zip(lights.chunks(31)) {
        let text = fs::read_to_string(path("lights/lights").join(name)).unwrap();
        let values: Vec<f32> =
            text.lines().map(|line| line.split(' ').nth(1).unwrap().parse().unwrap()).collect();
        assert_eq!(values, light);
    }
    let code = "import numpy as np; a, s = np.load('all.npz'), np.load('some.npz'); \
                assert 'background' not in s and 'lights' not in s; \
                assert (s['target'] == a['target']).all() and (np.load('lights.npy') == a['lights']).all()";
    program::python(folder.path(), code);
}
