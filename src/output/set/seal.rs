//! Completion of a set: its check, and its renaming.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use rayon::prelude::*;

use super::super::lock::{Attempt, LockFile};
use super::super::pending::{folder, ignore_missing, place, sweep, sync_folder};
use super::super::sum::Sum;
use super::super::{OutputError, partial};
use super::Shard;
use super::manifest::{Manifest, SEALED, remove_parts};
use super::occupy::{
    LOCK, PATIENCE, PAUSE, busy, folders, generation, is_being_made, is_lock_name, remove_replaced, replaced,
};
use crate::threads;

/// Largest number of faults that a message names.
const NAMED: usize = 20;

/// Status of a set after a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetStatus {
    /// The set is complete, under its name.
    Sealed,
    /// Other processes have chunks to finish.
    Waiting {
        /// Number of chunks done.
        done: u64,
        /// Number of all chunks.
        chunks: u64,
    },
}

/// Check of the files of a set before it gets its name.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Depth {
    /// That each is there, with its size: whoever wrote them ended just now.
    Sizes,
    /// That each has its sum.
    Sums,
}

/// Seals a set whose chunks other processes have written, once each file has its sum.
pub fn merge(path: impl AsRef<Path>) -> Result<(), OutputError> {
    let path = PathBuf::from_iter(path.as_ref().components());
    let path = match path.extension() {
        Some(extension) if extension == "partial" => path.with_extension(""),
        _ => path,
    };
    if path.exists() && partial(&path).is_dir() {
        return Err(OutputError::Exists { path });
    }
    match seal(&path, false, Depth::Sums, None)? {
        SetStatus::Sealed => Ok(()),
        SetStatus::Waiting { done, chunks } if done == chunks => Err(busy(&partial(&path))),
        SetStatus::Waiting { done, chunks } => Err(OutputError::Incomplete { path, done, chunks }),
    }
}

/// Joins the manifests of a set's processes and gives the set its name, if all of it is there and nobody writes to it.
/// `own` is the mark of the set that this process wrote. Where the file system has no locks, several processes may do
/// this at once: each step is the same whoever takes it, and can be taken twice.
pub(super) fn seal(
    path: &Path,
    replace: bool,
    depth: Depth,
    own: Option<&str>,
) -> Result<SetStatus, OutputError> {
    let root = partial(path);
    let begun = Instant::now();
    loop {
        let is_sealed = || !root.exists() && Manifest::sealed(path).is_ok();
        let step = match step(path, &root, depth, own) {
            // Another process was faster: what was to be renamed has its name.
            Err(_) if is_sealed() => return Ok(SetStatus::Sealed),
            step => step?,
        };
        let status = match step {
            Step::Status(status) => status,
            Step::Rename(manifest, lock) => match rename(path, &root, &manifest, lock, replace) {
                Err(_) if is_sealed() => SetStatus::Sealed,
                renamed => renamed.map(|()| SetStatus::Sealed)?,
            },
            Step::Again(status) if begun.elapsed() > PATIENCE => status, // the one that still writes will seal it
            Step::Again(_) => {
                std::thread::sleep(PAUSE);
                continue;
            }
        };
        return Ok(status);
    }
}

/// Next step of sealing.
enum Step {
    /// None.
    Status(SetStatus),
    /// Another look, unless much time has passed.
    Again(SetStatus),
    /// The name, under a lock where the file system has locks.
    Rename(Box<Manifest>, LockFile),
}

fn step(path: &Path, root: &Path, depth: Depth, own: Option<&str>) -> Result<Step, OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let manifest = match whole(path, root) {
        // It had one as this process wrote it.
        Err(OutputError::NotASet { .. }) if own.is_some() => {
            return Err(OutputError::Replaced { root: root.to_owned() });
        }
        manifest => manifest?,
    };
    let waiting = SetStatus::Waiting { done: manifest.chunks.len() as u64, chunks: manifest.plan.chunks() };
    if own.is_some() && manifest.generation.is_some() && manifest.generation.as_deref() != own {
        return Err(OutputError::Replaced { root: root.to_owned() });
    }
    if !manifest.is_complete() {
        return Ok(Step::Status(waiting));
    }
    let lock = LockFile::open(&root.join(LOCK)).map_err(failed)?;
    match lock.try_exclusive() {
        Attempt::Busy => return Ok(Step::Again(waiting)),
        Attempt::Held if !lock.is_current() => return Ok(Step::Again(waiting)),
        Attempt::Held | Attempt::Unsupported => {}
    }
    // Once more, now that nobody changes it.
    let manifest = whole(path, root)?;
    if own.is_some() && generation(&lock).as_deref() != own {
        return Err(OutputError::Replaced { root: root.to_owned() });
    }
    if !manifest.is_complete() {
        return Ok(Step::Again(waiting));
    }
    check(root, &manifest, depth)?;
    Ok(Step::Rename(Box::new(manifest), lock))
}

/// Manifest of an unfinished set, joined.
fn whole(path: &Path, root: &Path) -> Result<Manifest, OutputError> {
    let found = if root.is_dir() { Manifest::joined(root)? } else { None };
    found.ok_or_else(|| OutputError::NotASet { path: if root.is_dir() { root } else { path }.to_owned() })
}

/// Refuses a set whose files are not those that were written.
fn check(root: &Path, manifest: &Manifest, depth: Depth) -> Result<(), OutputError> {
    let sums: Vec<&Sum> = manifest.sums().collect();
    let fault = |sum: &Sum| match depth {
        Depth::Sizes => sum.size_fault(root),
        Depth::Sums => sum.fault(root),
    };
    let mut faults: Vec<String> =
        threads::pool(None)?.install(|| sums.into_par_iter().filter_map(fault).collect());
    if faults.is_empty() {
        return Ok(());
    }
    let more = faults.len().saturating_sub(NAMED);
    faults.truncate(NAMED);
    if more > 0 {
        faults.push(format!("{more} more"));
    }
    Err(OutputError::DamagedParts { path: root.to_owned(), faults: faults.join(", ") })
}

/// Writes what describes the set to readers, and gives it its name.
fn rename(
    path: &Path,
    root: &Path,
    manifest: &Manifest,
    lock: LockFile,
    replace: bool,
) -> Result<(), OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    if !replace && path.symlink_metadata().is_ok() {
        return Err(OutputError::Exists { path: path.to_owned() });
    }
    let mut manifest = manifest.clone();
    manifest.generation = None;
    let layout = manifest.plan.layout;
    for part in layout.metadata(&manifest.plan).map_err(failed)? {
        place(&root.join(&part.name), &part.bytes).map_err(failed)?;
        manifest.note(part.sum());
    }
    place(&root.join(SEALED), manifest.text().as_bytes()).map_err(failed)?;
    remove_parts(root).map_err(failed)?;
    remove_locks(root).map_err(failed)?;
    for folder in folders(root).map_err(failed)? {
        sweep(&folder).map_err(failed)?;
        sync_folder(&folder);
    }
    let mut lock = Some(lock);
    if cfg!(windows) {
        lock = None; // no folder is renamed there in which a file is open
    }
    if replace && path.exists() {
        let old = replaced(path);
        remove_replaced(path).map_err(failed)?;
        fs::rename(path, &old).map_err(failed)?;
        fs::rename(root, path).map_err(failed)?;
    } else {
        fs::rename(root, path).map_err(failed)?;
    }
    // Others may wait for the lock, and find the set under its name once they have it.
    fs::remove_file(path.join(LOCK)).or_else(ignore_missing).map_err(failed)?;
    drop(lock);
    remove_replaced(path).map_err(failed)?;
    sync_folder(folder(path));
    Ok(())
}

/// Removes the locks of shards, which nobody holds who does not hold that of the folder.
fn remove_locks(root: &Path) -> std::io::Result<()> {
    for entry in fs::read_dir(root)? {
        let entry = entry?;
        if entry.file_name().to_str().is_some_and(is_lock_name) {
            fs::remove_file(entry.path()).or_else(ignore_missing)?;
        }
    }
    Ok(())
}

/// Names the shards of an unfinished set that are not done and that no process makes; `None` where there are none.
pub(super) fn abandoned(path: &Path, count: u64) -> Option<String> {
    let root = partial(path);
    let manifest = Manifest::joined(&root).ok()??;
    let is_abandoned = |&index: &u64| {
        let shard = Shard { index, count };
        let own = shard.of(manifest.plan.chunks());
        (manifest.chunks.range(own.clone()).count() as u64) < own.end - own.start
            && !is_being_made(&root, shard)
    };
    let left: Vec<u64> = (1..=count).filter(is_abandoned).collect();
    let mut ranges: Vec<(u64, u64)> = Vec::new();
    for &index in &left {
        match ranges.last_mut() {
            Some((_, last)) if *last + 1 == index => *last = index,
            _ => ranges.push((index, index)),
        }
    }
    let names = ranges.iter().map(|&(a, b)| if a == b { a.to_string() } else { format!("{a}-{b}") });
    let names = names.collect::<Vec<_>>().join(",");
    match left.len() {
        0 => None,
        1 => Some(format!("part {names} is missing")),
        _ => Some(format!("parts {names} are missing")),
    }
}
