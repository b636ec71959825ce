//! Metamers of images and tables, by the program.

use super::*;

fn write_png(path: &std::path::Path, width: u32, height: u32) {
    let file = std::fs::File::create(path).expect("it can be made");
    let mut encoder = png::Encoder::new(file, width, height);
    encoder.set_color(png::ColorType::Rgb);
    let pixel = |i: u32| {
        let (x, y) = (i % width, i / width);
        [(60 + 3 * x) as u8, (70 + 2 * y) as u8, (150 - 2 * x) as u8]
    };
    let bytes: Vec<u8> = (0..width * height).flat_map(pixel).collect();
    encoder.write_header().and_then(|mut writer| writer.write_image_data(&bytes)).expect("it can be written");
}

#[test]
fn parts_of_an_image_have_the_spectra_of_the_whole() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    write_png(&folder.join("a.png"), 37, 23);
    for (name, options) in [
        ("a.zarr", "--chunk 5"),
        ("b.zarr", "--chunk 7 --zstd"),
        ("a.npz", ""),
        ("part.npz", "--crop 10,4,20,9"),
        ("two.npz", "--per-pixel 2"),
        ("mode.npz", "--per-pixel 0"),
        ("half.h5", "--dtype f16"),
    ] {
        let (_, said) =
            succeeds(folder, &format!("metamers a.png --seed 4 --engine cpu {options} -o {name}"));
        assert!(said.contains("pixels") && !said.contains("zeros"), "{said}");
    }
    for shard in ["1/3", "2/3", "3/3"] {
        succeeds(
            folder,
            &format!("metamers a.png --seed 4 --engine cpu --chunk 5 -o c.zarr --shard {shard} --resume"),
        );
    }
    let code =
        "import warnings; warnings.simplefilter('ignore')\n\
         import numpy as np, zarr, h5py, scipy.io\n\
         a = np.load('a.npz'); s = a['spectra']\n\
         assert s.shape == (23, 37, 31) and a['status'].shape == (23, 37) and a['colours'].shape == (23, 37, 3)\n\
         for name in 'abc':\n    assert (zarr.open(name + '.zarr')['spectra'][:] == s).all(), name\n\
         assert list(zarr.open('a.zarr')['spectra'].metadata.dimension_names) == ['row', 'column', 'wavelength']\n\
         assert (np.load('part.npz')['spectra'] == s[4:13, 10:30]).all()\n\
         t = np.load('two.npz')['spectra']; assert t.shape == (23, 37, 2, 31) and (t[:, :, 0] != t[:, :, 1]).any()\n\
         h = h5py.File('half.h5')['spectra'][:]; assert h.dtype == np.float16 and np.abs(h - s).max() < 5e-4\n\
         m = np.load('mode.npz'); assert (m['status'] == 2).all()\n\
         # The colours of the pixels, from their bytes and the standard.\n\
         x, y = np.arange(37), np.arange(23)[:, None]\n\
         rgb = np.stack(np.broadcast_arrays(60 + 3 * x, 70 + 2 * y, 150 - 2 * x), -1) / 255\n\
         linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)\n\
         M = np.linalg.inv([[3.2406255, -1.537208, -0.4986286], [-0.9689307, 1.8757561, 0.0415175], [0.0557101, -0.2040211, 1.0569959]])\n\
         xyz = linear @ M.T\n\
         data = DATA\n\
         cmf = scipy.io.loadmat(data + '/T_xyz1931.mat')['T_xyz1931'][:, 40:341:10]\n\
         d65 = scipy.io.loadmat(data + '/spd_D65.mat')['spd_D65'].ravel()[4:65:2]\n\
         w = d65 * cmf / (d65 * cmf[1]).sum()\n\
         for spectra in (s, t[:, :, 1], m['spectra']):\n    error = np.abs(spectra.astype(float) @ w.T - xyz).max(); assert error < 1e-5, error\n\
         assert np.abs(a['colours'] * w.sum(1) - xyz).max() < 1e-6\n\
         print('same')"
            .replace("DATA", &format!("{:?}", concat!(env!("CARGO_MANIFEST_DIR"), "/data")));
    assert_eq!(python(folder, &code), "same");
    let (_, said) = succeeds(folder, "verify a.zarr --redraw 1");
    assert!(said.contains("as they were written"), "{said}");
}

#[test]
fn tables_of_colours_in_every_space() {
    let folder = tempfile::tempdir().expect("there is a place for temporary files");
    let folder = folder.path();
    let write = |name: &str, text: &str| std::fs::write(folder.join(name), text).expect("it can be written");
    write("xyz.csv", "X,Y,Z\n0.3,0.3,0.25\n0.2,0.25,0.1\n");
    write("lab.csv", "L;a;b\n60;10;-15\n40;-10;20\n");
    write("cones.txt", "0.3 0.3 0.25\n0.2 0.22 0.1\n");
    write("srgb.csv", "0.6,0.5,0.4\n0.2,0.4,0.3\n");
    write("white.csv", "1,1,1\n0.95,1,1.08\n0.3,0.3,0.25\n");
    write("large.csv", "153,128,102\n");
    let run = "metamers --engine cpu --seed 2 --per-colour 50";
    for (name, options) in [
        ("xyz", "xyz.csv"),
        ("lab", "lab.csv --space lab --illuminant a --observer cie1964"),
        ("cones", "cones.txt --space ss2 --illuminant f11"),
        ("srgb", "srgb.csv --space srgb"),
    ] {
        succeeds(folder, &format!("{run} {options} -o {name}.npz"));
    }
    let found = python(
        folder,
        "import warnings; warnings.simplefilter('ignore')\n\
         import numpy as np, colour\n\
         def load(n):\n    a = np.load(n + '.npz'); assert a['spectra'].shape == (2, 50, 31); return a['spectra'].astype(float)\n\
         g = colour.SpectralShape(400, 700, 10)\n\
         def cmfs(n):\n    return colour.MSDS_CMFS[n].copy().align(g).values\n\
         def spd(n):\n    return colour.SDS_ILLUMINANTS[n].copy().align(g).values\n\
         def xyz(s, e, f):\n    return s @ (e[:, None] * f) / (e * f[:, 1]).sum()\n\
         two, ten = cmfs('CIE 1931 2 Degree Standard Observer'), cmfs('CIE 1964 10 Degree Standard Observer')\n\
         d65, a = spd('D65'), spd('A')\n\
         err = lambda x, y: np.abs(x - np.array(y)[:, None]).max()\n\
         assert err(xyz(load('xyz'), d65, two), [[0.3, 0.3, 0.25], [0.2, 0.25, 0.1]]) < 1e-5\n\
         white = xyz(np.ones(31), a, ten)\n\
         lab = xyz(load('lab'), a, ten) / white\n\
         f = np.where(lab > (6 / 29) ** 3, np.cbrt(lab), lab * 841 / 108 + 4 / 29)\n\
         lab = np.stack([116 * f[..., 1] - 16, 500 * (f[..., 0] - f[..., 1]), 200 * (f[..., 1] - f[..., 2])], -1)\n\
         assert err(lab, [[60, 10, -15], [40, -10, 20]]) < 2e-3\n\
         rgb = colour.XYZ_to_sRGB(xyz(load('srgb'), d65, two), chromatic_adaptation_transform=None)\n\
         assert err(rgb, [[0.6, 0.5, 0.4], [0.2, 0.4, 0.3]]) < 1e-3\n\
         fl = colour.SDS_ILLUMINANTS['FL11']; w = np.arange(400, 701, 10)\n\
         e = 0.25 * fl[w - 5] + 0.5 * fl[w] + 0.25 * fl[w + 5]\n\
         c = e[:, None] * cmfs('Stockman & Sharpe 2 Degree Cone Fundamentals')\n\
         assert err(load('cones') @ c / c.sum(0), [[0.3, 0.3, 0.25], [0.2, 0.22, 0.1]]) < 1e-5\n\
         print('same')",
    );
    assert_eq!(found, "same");
    let (_, said) = succeeds(folder, "metamers white.csv --engine cpu -o w.npz");
    assert!(
        said.contains("2 zeros, of colours that no spectrum has") && said.contains("their own: 1, 2"),
        "{said}"
    );
    let (_, said) = succeeds(folder, "metamers white.csv --engine cpu --nearest -o n.npz");
    assert!(said.contains("2 of the nearest colour, up to"), "{said}");
    let (json, _) = succeeds(folder, "metamers white.csv --engine cpu --nearest --json -o j.npz");
    assert!(json.contains("\"nearest\": 2") && json.contains("\"sampled\": 1"), "{json}");
    for (arguments, code, message) in [
        (
            "metamers white.csv --hard error -o e.npz",
            2,
            "draw 0: no spectrum of this model has the responses",
        ),
        ("metamers none.csv -o e.npz", 2, "there is no file of this name"),
        ("metamers large.csv --space srgb -o e.npz", 2, "whose values are 0 to 1: divide by 255"),
        ("metamers xyz.csv --space rods -o e.npz", 2, "3 values, where a colour has 1"),
        ("metamers xyz.csv --per-pixel 2 -o e.npz", 2, "--per-pixel is for an image"),
        ("metamers xyz.csv --crop 0,0,1,1 -o e.npz", 2, "--crop is for an image"),
        ("metamers xyz.csv --space ss3 -o e.npz", 2, "did you mean \"ss2\"?"),
        ("metamers xyz.csv --space labb -o e.npz", 2, "did you mean \"lab\"? there are xyz, srgb"),
        ("metamers xyz.csv --space cones.tsv -o e.npz", 4, "cannot read"),
        ("metamers xyz.csv -k 3 -o e.npz", 2, "fit it with more components"),
        ("metamers xyz.csv --model granada-10nm -o e.npz", 2, "is neither a file nor a built-in model"),
    ] {
        fails(folder, arguments, code, message);
    }
}
