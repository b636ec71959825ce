//! What each target does with its bytes. The corpora in `corpus/` are replayed by `tests/corpus.rs` of the crate itself,
//! which includes this file.

use std::alloc::System;
use std::ffi::OsString;
use std::fs;
use std::io::{Cursor, Write};
use std::path::{Path, PathBuf};

use spectroll::output::{SetAudit, Sidecar};
use spectroll::scene::Scene;
use spectroll::{Dataset, Extrapolation, Grid, Model, RecipeSettings, Table};

/// Memory that no input may take more of, also where it is never touched: the allocation ends the run. libFuzzer's own
/// limit sees nothing without a sanitizer.
#[global_allocator]
static MEMORY: cap::Cap<System> = cap::Cap::new(System, 1 << 30);

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
    read(&path);
}

/// Measured spectra in an archive of this ending, whose files are [`parts`]. They are stored and not packed: a sum that
/// does not fit would end every other attempt before the reader sees it.
pub fn archive(ending: &str, bytes: &[u8]) {
    let Some(parts) = parts(bytes) else { return table(ending, bytes) };
    let mut zip = zip::ZipWriter::new(Cursor::new(Vec::new()));
    let options = zip::write::SimpleFileOptions::default().compression_method(zip::CompressionMethod::Stored);
    for (name, content) in parts {
        // A name that is there twice is refused by the writer.
        if zip.start_file(name, options).is_ok() {
            zip.write_all(content).expect("memory takes it");
        }
    }
    table(ending, &zip.finish().expect("memory takes it").into_inner());
}

/// Measured spectra in a folder, or in a file beside another, whose files are [`parts`]; `name` is what is read.
pub fn files(name: &str, bytes: &[u8]) {
    let Some(parts) = parts(bytes) else { return };
    let folder = folder().join("files");
    let _ = fs::remove_dir_all(&folder);
    for (part, content) in parts {
        let is_plain = part.split('/').all(|step| !step.starts_with('.') && !step.is_empty());
        let path = folder.join(part);
        if is_plain && fs::create_dir_all(path.parent().expect("it is in a folder")).is_ok() {
            // A name may be that of a folder.
            let _ = fs::write(&path, content);
        }
    }
    read(&folder.join(name));
}

/// Files with their names: each begins with a line of its name and its number of bytes.
fn parts(bytes: &[u8]) -> Option<Vec<(&str, &[u8])>> {
    let mut parts = Vec::new();
    let mut rest = bytes;
    while !rest.is_empty() && parts.len() < 50 {
        let end = rest.iter().take(100).position(|byte| *byte == b'\n')?;
        let (name, length) = std::str::from_utf8(&rest[..end]).ok()?.rsplit_once(' ')?;
        let content = &rest[end + 1..];
        let (content, after) = content.split_at(length.parse::<usize>().ok()?.min(content.len()));
        parts.push((name, content));
        rest = after;
    }
    Some(parts)
}

/// Reads measured spectra as a fit would.
fn read(path: &Path) {
    // The fuzzer's own hook ends the process at any panic, those that are an error of the file included.
    static ONCE: std::sync::Once = std::sync::Once::new();
    ONCE.call_once(spectroll::caught::silence);
    let read = Table::open(path, None).or_else(|_| Table::open_on(path, None, Some(Grid::DEFAULT)));
    // What is read is put on a grid; a fit itself is of any numbers, and slow.
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

/// A configuration, which says the same as the words of a command line.
pub fn config(text: &str) {
    let path = folder().join("x.toml");
    fs::write(&path, text).expect("there is room");
    for command in ["sample", "scene", "fit", "report"] {
        let words =
            ["spectroll", command, "--config"].map(OsString::from).into_iter().chain([path.clone().into()]);
        let _ = spectroll::cli::understands(words.collect());
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
