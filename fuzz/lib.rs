//! What each target does with its bytes. The corpora in `corpus/` are replayed by `tests/corpus.rs` of the crate itself,
//! which includes this file.

use std::fs;
use std::path::{Path, PathBuf};

use spectroll::output::{SetAudit, Sidecar};
use spectroll::scene::Scene;
use spectroll::{Dataset, Extrapolation, Grid, Model, RecipeSettings, Table};

/// A folder in memory of this process, for readers that want a file.
fn folder() -> PathBuf {
    let memory = Path::new("/dev/shm");
    let parent = if memory.is_dir() { memory.to_owned() } else { std::env::temp_dir() };
    let folder = parent.join(format!("spectroll-fuzz-{}", std::process::id()));
    fs::create_dir_all(&folder).expect("there is room");
    folder
}

/// Measured spectra in a file of this ending; `text` is of any delimited text.
pub fn table(ending: &str, bytes: &[u8]) {
    let path = folder().join(format!("x.{}", if ending == "text" { "txt" } else { ending }));
    fs::write(&path, bytes).expect("there is room");
    let read = Table::open(&path, None).or_else(|_| Table::open_on(&path, None, Some(Grid::DEFAULT)));
    // What is read is put on a grid, as a fit would; a fit itself is of any numbers, and slow.
    if let Ok(table) = read
        && table.wavelengths().len() < 1000
    {
        let _ = Dataset::new(&[table], Grid::DEFAULT, Extrapolation::Hold);
    }
}

/// The text of a model file.
pub fn model(text: &str) {
    if let Ok(model) = Model::from_json("x.json", text) {
        let again = Model::from_json("x.json", &model.to_json());
        // That its basis had to be corrected is no part of it.
        assert!(
            again.is_ok_and(|again| again.parts() == model.parts()),
            "a model file is read as it was written"
        );
    }
}

/// The text of a scene file, which may name no other file.
pub fn scene(text: &str) {
    // Models are fitted and covers are made for real scenes: seconds, of which a target has too few.
    let is_small = !["model", "lrv", "hue", "uniform"].iter().any(|slow| text.contains(slow));
    if is_small {
        let _ = Scene::parse("x.toml", text, &folder());
    }
}

/// A set whose manifest has this text, with the sum that it must end with.
pub fn manifest(text: &str) {
    let Some(text) = signed(text) else { return };
    let set = folder().join("x.zarr");
    fs::create_dir_all(set.join("spectra")).expect("there is room");
    fs::write(set.join("_manifest.json"), text).expect("there is room");
    if let Ok(audit) = SetAudit::open(&set) {
        let _ = (audit.is_complete(), audit.chunks().len(), audit.files(), audit.faults().len());
    }
}

/// A file whose sidecar has this text, with the sum that it must end with.
pub fn sidecar(text: &str) {
    let Some(text) = signed(text) else { return };
    let file = folder().join("x.npy");
    fs::write(&file, "short").expect("there is room");
    fs::write(Sidecar::path(&file), text).expect("there is room");
    if let Ok(sidecar) = Sidecar::load(&file) {
        let _ = sidecar.fault(&file);
    }
}

/// Settings of a recipe, as data sets record them, for a model that is built in.
pub fn recipe(text: &str) {
    let Ok(settings) = serde_json::from_str::<RecipeSettings>(text) else { return };
    // A cover takes seconds.
    if settings.lrv.is_none() && settings.xyz.is_none() {
        let model = Model::builtin("munsell-vrhel").expect("it is built in");
        let _ = settings.builder(&model).build();
    }
}

/// The text of a JSON object that ends with the BLAKE3 sum of itself without it, as manifests do.
fn signed(text: &str) -> Option<String> {
    let mut value: serde_json::Value = serde_json::from_str(text).ok()?;
    let entries = value.as_object_mut()?;
    entries.remove("blake3");
    let body = serde_json::to_string_pretty(&value).ok()?;
    let body = body.strip_suffix("\n}")?;
    let unsigned = format!("{body},\n  \"blake3\": \"\"\n}}\n");
    let sum = blake3::hash(unsigned.as_bytes()).to_hex();
    Some(format!("{body},\n  \"blake3\": \"{sum}\"\n}}\n"))
}
