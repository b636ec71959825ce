//! Arithmetic of adapters, as the program shows it: which form draws, whether its bytes are the CPU's, and what data sets
//! record of it.

mod engines;
mod program;

use std::fs;
use std::path::Path;

use engines::{cpu, gpu_is_software, surfaces};
use program::{fails, signed, succeeds};
use serde_json::{Value, json};
use spectroll::Stream;

fn manifest(folder: &Path, set: &str) -> Value {
    serde_json::from_str(&fs::read_to_string(folder.join(set).join("_manifest.json")).unwrap()).unwrap()
}

#[test]
fn adapters_are_tried() {
    let folder = tempfile::tempdir().unwrap();
    let (text, _) = succeeds(folder.path(), "adapters");
    let (json, _) = succeeds(folder.path(), "adapters --json");
    let listed: Value = serde_json::from_str(&json).unwrap();
    let first = &listed[0];
    assert!(first["name"].is_string() && first["traits"].is_array(), "{json}");
    if gpu_is_software() {
        assert!(text.contains("\n   plain arithmetic, the CPU's bytes"), "{text}");
        assert_eq!((&first["arithmetic"], &first["is_exact"]), (&json!("plain"), &json!(true)));
    }
}

#[test]
fn both_forms_write_the_file_of_the_cpu_and_say_which_they_are() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sample = "sample granada -n 5000 --seed 5 --intensity 0.15..150";
    let (_, said) = succeeds(folder, &format!("{sample} --engine cpu -o cpu.npy"));
    assert!(!said.contains("arithmetic"), "{said}");
    for form in ["auto", "plain", "exact"] {
        let command = format!("{sample} --engine gpu --arithmetic {form} -o {form}.npy");
        let (_, said) = succeeds(folder, &command);
        if gpu_is_software() {
            let form = if form == "exact" { "exact" } else { "plain" };
            assert!(said.contains(&format!("{form} arithmetic, the CPU's bytes")), "{said}");
        }
        if said.contains("arithmetic, the CPU's bytes") {
            let [ours, theirs] =
                ["cpu", form].map(|name| fs::read(folder.join(format!("{name}.npy"))).unwrap());
            assert!(ours == theirs, "{form}");
        }
    }
}

#[test]
fn draws_are_made_again_on_the_cpu() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sample = "sample munsell-vrhel -n 3000 --engine gpu --arithmetic exact";
    let (_, said) = succeeds(folder, &format!("{sample} --verify-draws 1 -o all.npy"));
    assert!(said.contains("3,000 draws made again on the CPU, with the same bytes"), "{said}");
    let (json, _) = succeeds(folder, &format!("{sample} --verify-draws 1e-6 -o one.npy --json"));
    let report: Value = serde_json::from_str(&json).unwrap();
    assert!(report["rechecked"].as_u64().unwrap() > 0, "the first window always is: {json}");
    assert_eq!(report["arithmetic"]["arithmetic"], json!("exact"));
    fails(folder, &format!("{sample} --verify-draws 2 -o x.npy"), 2, "expected a share from 0 to 1");
    fails(folder, "report -o r --arithmetic exact", 2, "leave out --arithmetic");
    // Scenes have several recipes a window.
    let scene = "scene --example condition3 --scenes 0..2 --engine gpu --verify-draws 1 -o scene.zarr";
    let (_, said) = succeeds(folder, scene);
    assert!(said.contains("made again on the CPU, with the same bytes"), "{said}");
}

/// A CPU and an adapter may share a set, which has no mark of either but in the list of engines.
#[test]
fn engines_with_the_same_bytes_share_a_set() {
    if !gpu_is_software() {
        println!("skipped: the adapter may have other bytes");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let sample = "sample munsell-vrhel -n 4096 --seed 7 --chunk 1024 -o set.zarr";
    succeeds(folder, &format!("{sample} --engine cpu --shard 1/2"));
    succeeds(folder, &format!("{sample} --engine gpu --arithmetic exact --shard 2/2"));
    let manifest = manifest(folder, "set.zarr");
    assert!(manifest["plan"]["attributes"].get("rounding").is_none(), "{manifest}");
    let engines = manifest["engines"].to_string();
    assert!(
        engines.contains("\"CPU\"") && engines.contains("exact arithmetic, the CPU's bytes"),
        "{engines}"
    );
    for arithmetic in ["plain", "exact"] {
        succeeds(folder, &format!("verify set.zarr --redraw 1 --engine gpu --arithmetic {arithmetic}"));
    }
}

/// Sets of earlier builds name the class of their rounding, of which the CPU's is one.
#[test]
fn sets_with_a_class_of_rounding_are_read() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    succeeds(folder, "sample munsell-vrhel -n 2048 --seed 7 --chunk 1024 -o set.zarr --engine cpu");
    let recipe = surfaces().build().unwrap();
    let draws = cpu().collect(&recipe, Stream::named(0, "rounding").draws(0..4096)).unwrap();
    let ours = blake3::hash(bytemuck::cast_slice(&draws)).to_hex().to_string();
    let path = folder.join("set.zarr/_manifest.json");
    let text = fs::read_to_string(&path).unwrap();
    let with = |rounding: &str| {
        let marked =
            text.replacen("\"seed\": 7,", &format!("\"rounding\": \"{rounding}\",\n      \"seed\": 7,"), 1);
        assert_ne!(marked, text);
        fs::write(&path, signed(&marked)).unwrap();
    };
    with(&ours);
    succeeds(folder, "verify set.zarr --redraw 1");
    with("00");
    fails(folder, "verify set.zarr --redraw 1", 1, "rounds otherwise");
    succeeds(folder, "verify set.zarr --redraw 0");
}

#[test]
fn shaders_come_in_both_forms_with_their_tables() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let (plain, _) = succeeds(folder, "shader munsell-vrhel --prefix wall");
    assert!(plain.contains("fn wall_draw(seed: vec2<u32>, index: vec2<u32>) -> wall_Draw"), "{plain}");
    assert!(
        plain.contains("const wall_BANDS = 31u;\nconst wall_FIRST_NM = 400.0f;\nconst wall_STEP_NM = 10.0f;")
    );
    assert!(plain.contains("fn wall_reflectance(d: wall_Draw, nm: f32) -> f32") && !plain.contains("src/"));
    let (exact, _) = succeeds(folder, "shader munsell-vrhel --prefix wall --arithmetic exact");
    assert!(
        exact.contains("fn wall_draw(seed: vec2<u32>, index: vec2<u32>, zero: u32) -> wall_Draw"),
        "{exact}"
    );
    let data = "shader granada --intensity data --prefix sun";
    let (text, _) = succeeds(folder, &format!("{data} --binding 2,5 --table-bytes t.bin -o sun.wgsl"));
    assert_eq!(text, "");
    let text = fs::read_to_string(folder.join("sun.wgsl")).unwrap();
    assert!(text.contains("@group(2) @binding(5) var<storage, read> sun_tables: array<u32>;"), "{text}");
    assert_eq!(fs::read(folder.join("t.bin")).unwrap().len(), 4 * 2600);
    fails(folder, &format!("{data} --tables const"), 2, "(--tables buffer)");
    fails(folder, "shader granada --table-bytes t2.bin", 2, "leave out --table-bytes");
    fails(folder, &format!("{data} --binding 1"), 2, "as in 1,0");
    fails(folder, &format!("{data} --table-bytes t.bin"), 1, "exists");
    let covers = "shader munsell-vrhel --lrv 0.99 --bounds scaled --tables buffer";
    assert!(succeeds(folder, covers).0.contains("var<storage, read> spectroll_tables"));
}
