//! Manifest of a set: its plan, on which all its bytes depend, and the sums of the chunks that are done.
//!
//! While a set is being written each process keeps a manifest of its own, so that any number of them can work on one
//! set without a coordinator. Sealing joins them into one.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::super::pending::ignore_missing;
use super::super::{OutputError, Schema, partial};
use super::{ChunkFormat, Part, SetMode, Shard};

/// Name of the manifest of a whole set.
pub(super) const SEALED: &str = "_manifest.json";

/// Version of the manifest that this program writes and reads.
const VERSION: u32 = 1;

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

    /// Range of draws in a chunk, counted from the set's first.
    pub fn draws(&self, chunk: u64) -> Range<u64> {
        let first = chunk * self.chunk;
        first..self.schema.count.min(first + self.chunk)
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

/// Sum of a file of a chunk, as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Sum {
    pub(super) name: String,
    pub(super) bytes: u64,
    pub(super) blake3: String,
}

impl Sum {
    pub(super) fn of(part: &Part) -> Sum {
        let blake3 = blake3::hash(&part.bytes).to_hex().to_string();
        Sum { name: part.name.clone(), bytes: part.bytes.len() as u64, blake3 }
    }

    /// Describes how the file in a set differs from what was written, if it does.
    pub(super) fn fault(&self, root: &Path) -> Option<String> {
        let bytes = match fs::read(root.join(&self.name)) {
            Ok(bytes) => bytes,
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return Some(format!("{} is missing", self.name));
            }
            Err(e) => return Some(format!("{} cannot be read: {e}", self.name)),
        };
        if bytes.len() as u64 != self.bytes {
            return Some(format!("{} has {} bytes instead of {}", self.name, bytes.len(), self.bytes));
        }
        (blake3::hash(&bytes).to_hex().as_str() != self.blake3)
            .then(|| format!("{} does not match its BLAKE3 sum", self.name))
    }
}

/// Manifest of a set, or of the part of it that one process has done.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Manifest {
    /// Version of the manifest.
    manifest: u32,
    pub(super) plan: SetPlan,
    /// Engines that drew the chunks.
    pub(super) engines: BTreeSet<String>,
    /// Files of each chunk that is done.
    pub(super) chunks: BTreeMap<u64, Vec<Sum>>,
}

impl Manifest {
    pub(super) fn new(plan: SetPlan) -> Manifest {
        Manifest { manifest: VERSION, plan, engines: BTreeSet::new(), chunks: BTreeMap::new() }
    }

    pub(super) fn is_complete(&self) -> bool {
        self.chunks.len() as u64 == self.plan.chunks()
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
        serde_json::to_string_pretty(self).expect("manifests are JSON") + "\n"
    }

    /// Reads the manifest of a whole set.
    pub(super) fn sealed(root: &Path) -> Result<Manifest, OutputError> {
        read(&root.join(SEALED))?.ok_or_else(|| OutputError::NotASet { path: root.to_owned() })
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
                    joined.engines.extend(part.engines);
                    joined.chunks.extend(part.chunks);
                }
            }
        }
        Ok(joined)
    }
}

/// Name of the manifest of one of several processes, both counted from 1.
pub(super) fn part_name(index: u64, count: u64) -> String {
    format!("_manifest.{index}-of-{count}.json")
}

/// Lists the manifests in a folder, of processes and of the whole.
pub(super) fn manifests(root: &Path) -> io::Result<Vec<std::path::PathBuf>> {
    let mut found = Vec::new();
    for entry in fs::read_dir(root)? {
        let entry = entry?;
        let name = entry.file_name().to_string_lossy().into_owned();
        if name == SEALED || (name.starts_with("_manifest.") && name.contains("-of-")) {
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

/// Reads a manifest, if it exists.
fn read(path: &Path) -> Result<Option<Manifest>, OutputError> {
    let failed = |reason: String| OutputError::Manifest { path: path.to_owned(), reason };
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(failed(e.to_string())),
    };
    let manifest: Manifest = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
    if manifest.manifest > VERSION {
        return Err(failed(format!("it is of version {}: update spectroll", manifest.manifest)));
    }
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
