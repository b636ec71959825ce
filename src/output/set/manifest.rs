//! Manifest of a set: its plan, on which all its bytes depend, and the sums of the files that are done.
//!
//! While a set is being written each process keeps a manifest of its own, so that any number of them can work on one
//! set without a coordinator. Sealing joins them into one. A manifest ends with its own sum.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::super::lock::identity;
use super::super::pending::ignore_missing;
use super::super::sum::{LARGEST, Sum, is_signed, signed};
use super::super::{ByteCount, OutputError, Schema, partial};
use super::check::check;
use super::layout::{MOST_CHUNK_BYTES, MOST_CHUNKS};
use super::{ChunkFormat, SetMode, Shard};
use crate::plain_file::read_text;

/// Name of the manifest of a whole set.
pub(super) const SEALED: &str = "_manifest.json";

/// Version of the manifest that this program writes and reads.
const VERSION: u32 = 2;

/// Identity of a complete set. One that replaces it has another, be its bytes the same.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Seal {
    file: (u64, u64),
    modified: Option<SystemTime>,
}

/// Plan of a set: everything that its bytes depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct SetPlan {
    /// Format of its chunks.
    pub layout: ChunkFormat,
    /// Number of draws per chunk; the last may have fewer.
    pub chunk: u64,
    /// Schema of its rows.
    #[serde(flatten)]
    pub schema: Schema,
}

impl SetPlan {
    /// Number of chunks.
    pub fn chunks(&self) -> u64 {
        self.schema.count.div_ceil(self.chunk)
    }

    /// Refuses what a set at `path` cannot be: too many chunks, or too large ones, or arrays that its format cannot hold.
    pub fn check(&self, path: &Path) -> Result<(), OutputError> {
        self.layout.check(path, &self.schema)?;
        self.check_chunks(path)
    }

    /// Refuses too many chunks, or too large ones.
    pub(super) fn check_chunks(&self, path: &Path) -> Result<(), OutputError> {
        let (path, row) = (path.to_owned(), self.schema.row_bytes().max(1));
        if self.chunk > 1 && self.chunk.saturating_mul(row) > MOST_CHUNK_BYTES {
            let most = (MOST_CHUNK_BYTES / row).max(1);
            let bytes = ByteCount(self.chunk.saturating_mul(row));
            return Err(OutputError::LargeChunks { path, rows: self.chunk, bytes, most });
        }
        match self.chunks() > MOST_CHUNKS {
            true => Err(OutputError::ManyChunks { path, chunks: self.chunks() }),
            false => Ok(()),
        }
    }

    /// Range of draws in a chunk, counted from the set's first.
    pub fn draws(&self, chunk: u64) -> Range<u64> {
        let bound = |chunk: u64| chunk.saturating_mul(self.chunk).min(self.schema.count);
        bound(chunk)..bound(chunk.saturating_add(1))
    }

    /// Number of chunks of a shard that no earlier run has made, as far as the manifests of a set at `path` tell.
    pub(crate) fn missing(&self, path: &Path, shard: Shard, mode: SetMode) -> u64 {
        let own = shard.of(self.chunks());
        let all = own.end - own.start;
        let path = PathBuf::from_iter(path.components());
        let found = match mode {
            SetMode::Replace => None,
            SetMode::Create | SetMode::Resume => {
                Manifest::sealed(&path).ok().or_else(|| Manifest::joined(&partial(&path)).ok().flatten())
            }
        };
        let done = found.map_or(0, |found| found.chunks.range(own).count() as u64);
        all.saturating_sub(done) // of another set, which opening this one will refuse, there may be more
    }

    /// Describes the first setting in which another plan differs, with the value here and the value there.
    fn difference(&self, other: &SetPlan) -> Option<String> {
        let json = |plan| serde_json::to_value(plan).expect("plans are JSON");
        difference("", &json(self), &json(other))
    }
}

/// Describes the first difference of two values, innermost.
fn difference(place: &str, here: &Value, there: &Value) -> Option<String> {
    let inner = |name: &str| if place.is_empty() { name.to_owned() } else { format!("{place}.{name}") };
    match (here, there) {
        _ if here == there => None,
        (Value::Object(a), Value::Object(b)) => {
            let names: BTreeSet<&String> = a.keys().chain(b.keys()).collect();
            let value =
                |map: &serde_json::Map<String, Value>, name: &str| map.get(name).cloned().unwrap_or_default();
            names.into_iter().find_map(|name| difference(&inner(name), &value(a, name), &value(b, name)))
        }
        _ => Some(format!("{} is {there} there and {here} here", place.trim_start_matches("attributes."))),
    }
}

/// Manifest of a set, or of the part of it that one process has done.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Manifest {
    /// Version of the manifest.
    manifest: u32,
    /// Mark of the set that is being written, new whenever it is begun again. A whole set has none: it would tell
    /// sets of equal bytes apart.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(super) generation: Option<String>,
    pub(super) plan: SetPlan,
    /// Engines that drew the chunks.
    pub(super) engines: BTreeSet<String>,
    /// Files that are no chunks: arrays that all draws share, the model or the scene, and once the set is complete
    /// what describes it to readers.
    pub(super) files: Vec<Sum>,
    /// Files of each chunk that is done.
    pub(super) chunks: BTreeMap<u64, Vec<Sum>>,
    /// Sum of the text of the manifest in which this is empty.
    blake3: String,
}

impl Manifest {
    pub(super) fn new(plan: SetPlan, generation: &str) -> Manifest {
        Manifest {
            manifest: VERSION,
            generation: Some(generation.to_owned()),
            plan,
            engines: BTreeSet::new(),
            files: Vec::new(),
            chunks: BTreeMap::new(),
            blake3: String::new(),
        }
    }

    pub(super) fn is_complete(&self) -> bool {
        self.chunks.len() as u64 == self.plan.chunks()
    }

    /// Sums of all files.
    pub(super) fn sums(&self) -> impl Iterator<Item = &Sum> {
        self.files.iter().chain(self.chunks.values().flatten())
    }

    /// Notes a file that is no chunk.
    pub(super) fn note(&mut self, sum: Sum) {
        match self.files.iter_mut().find(|file| file.name == sum.name) {
            Some(file) => *file = sum,
            None => self.files.push(sum),
        }
    }

    /// Returns an error where a plan is not that of this manifest, which lies in the folder `root`.
    pub(super) fn check(&self, plan: &SetPlan, root: &Path) -> Result<(), OutputError> {
        match plan.difference(&self.plan) {
            Some(difference) => Err(OutputError::Different { path: root.to_owned(), difference }),
            None => Ok(()),
        }
    }

    /// Text of the manifest's file.
    pub(super) fn text(&self) -> String {
        signed(&Manifest { blake3: String::new(), ..self.clone() })
    }

    /// Reads the manifest of a whole set.
    pub(super) fn sealed(root: &Path) -> Result<Manifest, OutputError> {
        read(&root.join(SEALED))?.ok_or_else(|| OutputError::NotASet { path: root.to_owned() })
    }

    /// Identity of the complete set in a folder; `None` where none is.
    pub(super) fn seal(root: &Path) -> Option<Seal> {
        let found = fs::metadata(root.join(SEALED)).ok()?;
        Some(Seal { file: identity(&found), modified: found.modified().ok() })
    }

    /// Joins the manifests of a set that is not sealed; `None` where there are none.
    pub(super) fn joined(root: &Path) -> Result<Option<Manifest>, OutputError> {
        let failed = |source| OutputError::Read { path: root.to_owned(), source };
        let mut joined: Option<Manifest> = None;
        for path in manifests(root).map_err(failed)? {
            let Some(part) = read(&path)? else { continue };
            match &mut joined {
                None => joined = Some(part),
                Some(joined) => {
                    joined.check(&part.plan, root)?;
                    match (&joined.generation, &part.generation) {
                        (Some(here), Some(there)) if here != there => {
                            return Err(OutputError::Replaced { root: root.to_owned() });
                        }
                        (None, _) => joined.generation = part.generation,
                        _ => {}
                    }
                    joined.engines.extend(part.engines);
                    joined.chunks.extend(part.chunks);
                    part.files.into_iter().for_each(|sum| joined.note(sum));
                }
            }
        }
        Ok(joined)
    }
}

/// Name of the manifest of one of several processes.
pub(super) fn part_name(shard: Shard) -> String {
    format!("_manifest.{}-of-{}.json", shard.index, shard.count)
}

/// Lists the manifests in a folder, of processes and of the whole.
pub(super) fn manifests(root: &Path) -> io::Result<Vec<std::path::PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == SEALED
            || (name.starts_with("_manifest.") && name.contains("-of-") && name.ends_with(".json"))
        {
            found.push(entry.path());
        }
    }
    found.sort(); // the order in which a folder lists its files is its own
    Ok(found)
}

/// Removes the manifests of processes.
pub(super) fn remove_parts(root: &Path) -> io::Result<()> {
    let parts = manifests(root)?.into_iter().filter(|path| !path.ends_with(SEALED));
    parts.into_iter().try_for_each(|path| fs::remove_file(path).or_else(ignore_missing))
}

/// Entry of a manifest of any version.
#[derive(Deserialize)]
struct Head {
    manifest: u32,
}

/// Reads a manifest, if it exists.
fn read(path: &Path) -> Result<Option<Manifest>, OutputError> {
    let failed = |reason: String| OutputError::Manifest { path: path.to_owned(), reason };
    let text = match read_text(path, LARGEST) {
        Ok(text) => text,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(failed(e.to_string())),
    };
    let head: Head = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
    let remedy = if head.manifest > VERSION { "update spectroll" } else { "make the set again" };
    if head.manifest != VERSION {
        return Err(OutputError::ManifestVersion { path: path.to_owned(), remedy });
    }
    let manifest: Manifest = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
    if !is_signed(&text, &manifest.blake3) {
        return Err(failed("it does not match its BLAKE3 sum".to_owned()));
    }
    check(&manifest).map_err(failed)?;
    Ok(Some(manifest))
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_innermost_difference_is_named() {
        let here = json!({ "seed": 2, "recipe": { "lrv": 0.4, "bounds": "base" } });
        let mut there = here.clone();
        assert_eq!(difference("attributes", &here, &there), None);
        there["recipe"]["lrv"] = json!(null);
        let text = difference("attributes", &here, &there).unwrap();
        assert_eq!(text, "recipe.lrv is null there and 0.4 here");
    }
}
