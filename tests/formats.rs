//! Each format, opened by the reader that its users use, holds what the `.npy` holds.

mod program;

use std::fs;
use std::path::Path;

use program::{fails, files, npy, python, succeeds};

/// 1,000 reflectances in `a.npy`, and the same in a file or folder of another format.
fn beside(folder: &Path, output: &str) {
    succeeds(folder, "sample munsell-vrhel -n 1000 --seed 3 --engine cpu -o a.npy --force");
    succeeds(folder, &format!("sample munsell-vrhel -n 1000 --seed 3 --engine cpu -o {output}"));
}

/// That Python finds `expression` equal to the `.npy`, in bytes and type, and the wavelengths those of the model.
fn equals(folder: &Path, before: &str, expression: &str, wavelengths: &str) {
    let code = format!(
        "import numpy as np\n\
         a = np.load('a.npy')\n\
         {before}\n\
         b, w = np.asarray({expression}), np.asarray({wavelengths})\n\
         print(b.dtype, a.dtype == b.dtype, a.shape == b.shape and a.tobytes() == b.tobytes(), w.tolist() == list(range(400, 701, 10)))"
    );
    assert_eq!(python(folder, &code), "float32 True True True", "{before}");
}

#[test]
fn npz() {
    let folder = tempfile::tempdir().unwrap();
    beside(folder.path(), "b.npz");
    let load = "f = np.load('b.npz')\n\
                import json, zipfile\n\
                assert zipfile.ZipFile('b.npz').testzip() is None\n\
                assert json.loads(str(f['attributes']))['seed'] == 3";
    equals(folder.path(), load, "f['spectra']", "f['wavelength']");
}

/// Rounded to 1 a reflectance would not be one any more; 1.7 % of these spectra have such a value.
#[test]
fn sixteen_bits_keep_spectra_physical() {
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), "sample munsell-vrhel -n 20000 --lrv 0.95 --bounds scaled --dtype f16 -o a.npy");
    let code = "import numpy as np; a = np.load('a.npy'); print(a.dtype, (a > 0).all(), (a < 1).all(), a.max() == 1 - 2**-11)";
    assert_eq!(python(folder.path(), code), "float16 True True True");
    // Text is read back as what the other formats hold.
    succeeds(folder.path(), "sample munsell-vrhel -n 20000 --lrv 0.95 --bounds scaled --dtype f16 -o a.csv");
    let code = "import numpy as np; a = np.load('a.npy')\n\
                b = np.loadtxt('a.csv', delimiter=',', skiprows=1).astype(np.float16)\n\
                print(a.tobytes() == b.tobytes())";
    assert_eq!(python(folder.path(), code), "True");
}

/// Below the normal range of float16 spectra lose digits, and below its last number all of them.
#[test]
fn spectra_that_sixteen_bits_cannot_hold_are_refused() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let too_bright = "do not fit float16, which ends at 65504: use float32 (--dtype f32)";
    let too_dim = "do not fit float16, which loses digits below 6.1e-5: use float32 (--dtype f32)";
    for output in ["c.npy", "c.npz", "c.csv", "c.h5", "c.zarr"] {
        for (intensity, message) in
            [("1e4..1e6", too_bright), ("1e-12..1e-9", too_dim), ("1e-6..1e-4", too_dim)]
        {
            let run = format!(
                "sample granada -n 1000 --intensity {intensity} --dtype f16 --engine cpu -o {output}"
            );
            let result = program::spectroll(folder, &run);
            let text = String::from_utf8(result.stderr).unwrap();
            assert_eq!(result.status.code(), Some(1), "{run}: {text}");
            assert!(
                text.contains(message) || output == "c.zarr" && text.contains("do not fit float16"),
                "{text}"
            );
            if output == "c.zarr" {
                fs::remove_dir_all(folder.join("c.zarr.partial")).unwrap();
            }
        }
    }
    let piped = "sample granada -n 10 --intensity 1e-9 --dtype f16 --engine cpu -o -";
    fails(folder, piped, 1, too_dim);
    succeeds(folder, "sample granada -n 1000 --intensity 1e-3..1e3 --dtype f16 --engine cpu -o d.npy");
    let text = "sample granada -n 5 --dtype f64 --engine cpu -o x.spd";
    fails(folder, text, 2, ".spd files hold f32 alone, as text; leave out the type (--dtype)");
}

/// What all scenes share is of the type that was asked for, as what differs between them is.
#[test]
fn shared_arrays_have_the_type_that_was_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let scene = "scene --example condition2 --scenes 0..2 --engine cpu";
    succeeds(folder, &format!("{scene} -o a.npz"));
    for (dtype, name) in [("f16", "float16"), ("f64", "float64")] {
        for output in ["b.npz", "b.h5", "b.zarr", "b/ --format npy"] {
            succeeds(folder, &format!("{scene} --dtype {dtype} -o {output} --force"));
        }
        let code = format!(
            "import numpy as np, h5py, zarr\n\
             a = np.load('a.npz')['background'].astype('{name}')\n\
             bs = [np.load('b.npz')['background'], h5py.File('b.h5')['background'][:], \
             zarr.open('b.zarr', mode='r')['background'][:], np.load('b/background.npy')]\n\
             print([bool(b.dtype == a.dtype and (b == a).mean() > 0.999) for b in bs], \
             np.load('b.npz')['background_attempts'].dtype)"
        );
        assert_eq!(python(folder, &code), "[True, True, True, True] uint32", "{dtype}");
        succeeds(folder, "verify b.zarr --redraw 1 --engine cpu");
        let (plan, _) = succeeds(folder, &format!("{scene} --dtype {dtype} -o c.npz --dry-run"));
        for array in ["background: [999, 31]", "lights: [2, 3, 31]"] {
            assert!(plan.contains(&format!("{array} {name}")), "{plan}");
        }
    }
    succeeds(folder, &format!("{scene} --dtype f64 -o b.mat"));
    let code = "import numpy as np, scipy.io; m = scipy.io.loadmat('b.mat')\n\
                a = np.load('a.npz')['background'].astype(float)\n\
                print(m['sur_background'].dtype, (m['sur_background'].T == a).all())";
    assert_eq!(python(folder, code), "float64 True");
    // Where nothing but what is shared would be in 16 bits, too.
    let walls = "scene --example condition2 --only background --engine cpu --dtype f16";
    fails(folder, &format!("{walls} -o c.mat"), 2, "choose one of them (--dtype)");
}

/// An LRV of 0.4 in half precision is 0.39990; labels are few, and are exact.
#[test]
fn labels_beside_half_spectra_are_float32() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sample =
        "sample munsell-vrhel -n 50 --lrv 0.4 --quantities spectra,weights,xyz,lrv,attempts --engine cpu";
    let scene = "scene --example condition3 --scenes 0..4 --engine cpu";
    for (dtype, expected) in [
        (
            "f16",
            "{'spectra': 'float16', 'weights': 'float32', 'xyz': 'float32', 'lrv': 'float32', 'attempts': 'uint32'}",
        ),
        (
            "f64",
            "{'spectra': 'float64', 'weights': 'float64', 'xyz': 'float64', 'lrv': 'float64', 'attempts': 'uint32'}",
        ),
    ] {
        succeeds(folder, &format!("{sample} --dtype {dtype} -o a.npz --force"));
        let code = "import numpy as np; f = np.load('a.npz')\n\
                    names = ['spectra', 'weights', 'xyz', 'lrv', 'attempts']\n\
                    assert (f['lrv'] == np.float32(0.4)).all()\n\
                    print({name: str(f[name].dtype) for name in names})";
        assert_eq!(python(folder, code), expected, "{dtype}");
    }
    succeeds(folder, &format!("{scene} --dtype f16 -o s.npz"));
    let code = "import numpy as np; f = np.load('s.npz')\n\
                print([str(f[name].dtype) for name in ['lights', 'lights_intensity', 'target', 'target_lrv']])";
    assert_eq!(python(folder, code), "['float16', 'float32', 'float16', 'float32']");
}

/// Not the words that engines hold them in, which also say whether a value reached 1.
#[test]
fn attempts_are_counts() {
    let folder = tempfile::tempdir().unwrap();
    let drawn = "sample munsell-vrhel -n 2000 --lrv 0.6 --quantities attempts -o a.csv";
    let (_, summary) = succeeds(folder.path(), drawn);
    assert!(summary.contains("reach 1 or more"), "{summary}");
    let text = fs::read_to_string(folder.path().join("a.csv")).unwrap();
    let counts: Vec<u32> = text.lines().skip(1).map(|line| line.parse().unwrap()).collect();
    assert!(counts.len() == 2000 && counts.iter().all(|count| (1..100).contains(count)), "{counts:?}");
}

#[test]
fn hdf5() {
    let folder = tempfile::tempdir().unwrap();
    beside(folder.path(), "b.h5");
    let load = "import h5py; f = h5py.File('b.h5')\n\
                assert f['spectra'].chunks is not None and f.attrs['model'] == 'munsell-vrhel', f.attrs['model']";
    equals(folder.path(), load, "f['spectra']", "f['wavelength']");
}

#[test]
fn matlab() {
    let folder = tempfile::tempdir().unwrap();
    beside(folder.path(), "b.mat");
    let load = "import json, scipy.io; f = scipy.io.loadmat('b.mat')\n\
                head = open('b.mat', 'rb').read(128)\n\
                assert head.startswith(b'MATLAB 5.0 MAT-file') and head[124:] == b'\\x00\\x01IM'\n\
                assert f['S_X'].tolist() == [[400, 10, 31]] and f['X'].shape == (31, 1000)\n\
                assert json.loads(f['comment'][0])['seed'] == 3";
    equals(folder.path(), load, "np.ascontiguousarray(f['X'].T)", "f['wavelength'][:, 0]");
    // Labels are rows, a value a draw.
    let labelled = "sample munsell-vrhel -n 3 --quantities spectra,lrv,weights,attempts --engine cpu";
    succeeds(folder.path(), &format!("{labelled} -o c.mat --dtype f64"));
    succeeds(folder.path(), &format!("{labelled} -o c.npz --dtype f64"));
    let code = "import numpy as np, scipy.io; m, a = scipy.io.loadmat('c.mat'), np.load('c.npz')\n\
                print([m[n].dtype == a[n].dtype and np.array_equal(m[n].T.squeeze(), a[n])\
                for n in ['lrv', 'weights', 'attempts']], m['X'].dtype, m['lrv'].shape)";
    assert_eq!(python(folder.path(), code), "[True, True, True] float64 (1, 3)");
}

#[test]
fn parquet() {
    let folder = tempfile::tempdir().unwrap();
    beside(folder.path(), "b.parquet");
    let load = "import json, pyarrow.parquet as pq; t = pq.read_table('b.parquet')\n\
                assert str(t.schema.field('spectra').type) == 'fixed_size_list<element: float not null>[31]', t.schema\n\
                meta = t.schema.metadata\n\
                assert json.loads(meta[b'spectroll'])['seed'] == 3\n\
                column = t['spectra'].combine_chunks()";
    let flat = "column.flatten().to_numpy(zero_copy_only=False).reshape(-1, 31)";
    equals(folder.path(), load, flat, "json.loads(meta[b'wavelength'])");
}

#[test]
fn zarr() {
    let folder = tempfile::tempdir().unwrap();
    for flags in ["", "--zstd", "--zstd 7 --chunk 300"] {
        beside(folder.path(), &format!("b.zarr {flags}"));
        let load = "import zarr; f = zarr.open_group('b.zarr', mode='r', use_consolidated=True)";
        equals(folder.path(), load, "f['spectra']", "f['wavelength']");
        let load = "import xarray; d = xarray.open_zarr('b.zarr')\n\
                    assert d.spectra.dims == ('draw', 'wavelength') and 'wavelength' in d.coords\n\
                    assert d.attrs['seed'] == 3 and d.wavelength.attrs['units'] == 'nm'";
        equals(folder.path(), load, "d.spectra", "d.wavelength");
        fs::remove_dir_all(folder.path().join("b.zarr")).unwrap();
    }
}

#[test]
fn folders_of_parts() {
    let folder = tempfile::tempdir().unwrap();
    beside(folder.path(), "b/ --format npy --chunk 300");
    let load = "import glob; parts = [np.load(p) for p in sorted(glob.glob('b/spectra-*.npy'))]\n\
                assert [len(p) for p in parts] == [300, 300, 300, 100]";
    equals(folder.path(), load, "np.concatenate(parts)", "np.load('b/wavelength.npy')");
    beside(folder.path(), "c/ --format parquet --chunk 300");
    let load = "import json, glob, pyarrow.parquet as pq\n\
                t = pq.read_table(sorted(glob.glob('c/*.parquet')))\n\
                column = t['spectra'].combine_chunks()";
    let flat = "column.flatten().to_numpy(zero_copy_only=False).reshape(-1, 31)";
    equals(folder.path(), load, flat, "json.loads(t.schema.metadata[b'wavelength'])");
}

#[test]
fn types() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "sample granada -n 500 -o a.npy");
    for dtype in ["f16", "f64"] {
        for output in ["b.npy", "b.npz", "b.h5", "b.zarr", "b.csv"] {
            succeeds(folder, &format!("sample granada -n 500 --dtype {dtype} -o {output} --force"));
        }
        let code = format!(
            "import numpy as np, h5py, zarr\n\
             a = np.load('a.npy').astype('{}')\n\
             text = np.loadtxt('b.csv', delimiter=',', skiprows=1).astype(a.dtype)\n\
             bs = [np.load('b.npy'), np.load('b.npz')['spectra'], h5py.File('b.h5')['spectra'][:], \
             zarr.open('b.zarr', mode='r')['spectra'][:], text]\n\
             print([b.dtype == a.dtype and b.tobytes() == a.tobytes() for b in bs])",
            dtype.replace('f', "float")
        );
        assert_eq!(python(folder, &code), "[True, True, True, True, True]", "{dtype}");
    }
    for output in ["x.mat", "x.parquet"] {
        fails(
            folder,
            &format!("sample granada -n 5 --dtype f16 -o {output}"),
            2,
            "choose one of them (--dtype)",
        );
        succeeds(folder, &format!("sample granada -n 5 --dtype f64 -o {output}"));
    }
}

#[test]
fn spd_folders_are_named_as_the_authors_named_theirs() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "sample munsell-vrhel -n 3 --seed 3 --engine cpu -o a.npy");
    succeeds(folder, "sample munsell-vrhel -n 3 --seed 3 --engine cpu --format spd -o b/");
    assert_eq!(
        files(&folder.join("b")),
        ["reflectance_001.spd", "reflectance_002.spd", "reflectance_003.spd"]
    );
    let (_, values) = npy(&folder.join("a.npy"));
    let text = fs::read_to_string(folder.join("b/reflectance_002.spd")).unwrap();
    assert!(text.starts_with("400 0.") && text.ends_with('\n'));
    let parsed: Vec<f32> =
        text.lines().map(|line| line.split_once(' ').unwrap().1.parse().unwrap()).collect();
    assert_eq!(parsed, values[31..62]);
    succeeds(folder, "sample granada -n 2 --start 998 --format spd -o light/");
    assert_eq!(files(&folder.join("light")), ["illuminance_1000.spd", "illuminance_999.spd"]);
    succeeds(folder, "sample munsell-vrhel -n 1 --lrv 0.4 --format spd -o target/");
    assert_eq!(files(&folder.join("target")), ["luminance-0.4000-reflectance-001.spd"]);
    succeeds(folder, "sample munsell-vrhel -n 2 --lrv 0.2..0.6 --format spd -o each/");
    assert_eq!(files(&folder.join("each")), ["reflectance_001.spd", "reflectance_002.spd"]);
    fails(folder, "sample granada -n 10001 --format spd -o many/", 1, "(--force does)");
    fails(folder, "sample granada -n 1 --format spd -o light/", 1, "exists already");
}

/// Mitsuba is a large download: SPECTROLL_MITSUBA=1 asks for the test.
#[test]
fn spd_files_load_in_mitsuba() {
    if std::env::var_os("SPECTROLL_MITSUBA").is_none() {
        println!("skipped: SPECTROLL_MITSUBA is not set");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    succeeds(folder.path(), "sample munsell-vrhel -n 1 --format spd -o b/");
    let code = "import mitsuba as mi\n\
                mi.set_variant('scalar_spectral')\n\
                s = mi.load_dict({'type': 'spectrum', 'filename': 'b/reflectance_001.spd'})\n\
                line = open('b/reflectance_001.spd').read().split()\n\
                si = mi.SurfaceInteraction3f(); si.wavelengths = [400, 410, 550, 700]\n\
                got = s.eval(si)\n\
                values = dict(zip(map(float, line[::2]), map(float, line[1::2])))\n\
                print(max(abs(got[i] - values[w]) for i, w in enumerate([400, 410, 550, 700])) < 1e-6)";
    assert_eq!(python(folder.path(), code), "True");
}

#[test]
fn fits_read_what_samples_write() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    for output in ["a.npy", "a.h5", "a.mat", "b.npy --dtype f16", "b.h5 --dtype f64"] {
        succeeds(folder, &format!("sample munsell-vrhel -n 500 --engine cpu -o {output}"));
    }
    let explains = |arguments: &str| {
        let (_, summary) = succeeds(folder, &format!("fit {arguments} --kind reflectance -o m.json --force"));
        summary.split_once("explain").unwrap().1.to_owned()
    };
    let expected = explains("a.npy --wavelengths 400:10:700");
    assert!(expected.contains("of 500 reflectances"), "{expected}");
    for file in ["a.h5", "a.mat", "a.mat:X", "b.npy --wavelengths 400:10:700", "b.h5"] {
        assert_eq!(explains(file), expected, "{file}");
    }
    fails(folder, "fit a.npy --kind reflectance -o x.json", 4, "(FILE@380:5:780)");
    fails(
        folder,
        "fit a.npy --kind reflectance --wavelengths 400:5:700 -o x.json",
        4,
        "its 31 bands are, and they are not the 61 of the model",
    );
    // These say what their draws are.
    for file in ["a.mat", "a.h5"] {
        let (_, summary) = succeeds(folder, &format!("fit {file} -o kind.json --force"));
        assert!(summary.contains("of 500 reflectances"), "{summary}");
    }
    // What MATLAB itself writes is compressed, and of doubles.
    python(
        folder,
        "import h5py, numpy as np\n\
         f = h5py.File('theirs.mat', 'w', userblock_size=512, libver='earliest')\n\
         f.create_dataset('sur_mine', data=np.load('a.npy').astype('f8'), compression='gzip', shuffle=True)\n\
         f['S_mine'] = np.array([[400.0], [10.0], [31.0]])\n\
         f.close()",
    );
    let (_, summary) = succeeds(folder, "fit theirs.mat -o theirs.json");
    assert!(summary.contains("of 500 reflectances"), "{summary}");
}
