//! Folder of a set: its creation, and its renaming once complete.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use super::super::pending::{PREFIX, SUFFIX, folder, place_by, sweep, sync_folder};
use super::super::{OutputError, partial};
use super::manifest::{Manifest, SEALED, manifests, part_name, remove_parts};
use super::{SetMode, SetPlan, Shard};

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

/// Creates the set's folder where needed, and checks that it may be written to. Returns the folder of its chunks:
/// `path` itself where a complete set is resumed.
pub(super) fn occupy(
    path: &Path,
    plan: &SetPlan,
    shard: Shard,
    start: SetMode,
) -> Result<PathBuf, OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    if path.symlink_metadata().is_ok() {
        if !path.is_dir() {
            return Err(OutputError::NotAFolder { path: path.to_owned() });
        }
        match start {
            SetMode::Create => return Err(OutputError::Exists { path: path.to_owned() }),
            SetMode::Replace => drop(Manifest::sealed(path)?), // nothing but a set is replaced
            SetMode::Resume => {
                let sealed = Manifest::sealed(path)?;
                sealed.check(plan, path)?;
                let fault = sealed.chunks.values().flatten().find_map(|sum| sum.fault(path));
                return match fault {
                    Some(fault) => Err(OutputError::Damaged { path: path.to_owned(), fault }),
                    None => Ok(path.to_owned()),
                };
            }
        }
    }
    let root = partial(path);
    match fs::create_dir(&root) {
        Ok(()) => {}
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists && root.is_dir() => {}
        Err(e) => return Err(failed(e)),
    }
    let is_set = !manifests(&root).map_err(failed)?.is_empty();
    match start {
        SetMode::Replace if is_set => {
            fs::remove_dir_all(&root).and_then(|()| fs::create_dir(&root)).map_err(failed)?;
        }
        // Another process may have made the folder this very moment.
        SetMode::Create if shard.count > 1 && !root.join(part_name(shard.index, shard.count)).exists() => {}
        SetMode::Create if is_set => return Err(OutputError::Unfinished { path: path.to_owned(), root }),
        SetMode::Create | SetMode::Replace | SetMode::Resume => {}
    }
    Ok(root)
}

/// Claims a shard of a new set, which only one process can: of two that start at once, neither sees a manifest of the
/// other. The name is one that sealing sweeps.
pub(super) fn claim(path: &Path, root: &Path, shard: Shard, start: SetMode) -> Result<(), OutputError> {
    let name = format!("{PREFIX}{}{SUFFIX}", part_name(shard.index, shard.count));
    match fs::File::create_new(root.join(name)) {
        Ok(_) => Ok(()),
        Err(e) if e.kind() != io::ErrorKind::AlreadyExists => {
            Err(OutputError::Write { path: path.to_owned(), source: e })
        }
        Err(_) if start == SetMode::Create => {
            Err(OutputError::Unfinished { path: path.to_owned(), root: root.to_owned() })
        }
        Err(_) => Ok(()), // that of a run that was killed
    }
}

/// Seals a set whose chunks other processes have written.
pub fn merge(path: impl AsRef<Path>) -> Result<(), OutputError> {
    let path = path.as_ref();
    let path = PathBuf::from_iter(path.components());
    let path = match path.to_string_lossy().strip_suffix(".partial") {
        Some(name) => PathBuf::from(name),
        None => path,
    };
    match seal(&path, false)? {
        SetStatus::Sealed => Ok(()),
        SetStatus::Waiting { done, chunks } => Err(OutputError::Incomplete { path, done, chunks }),
    }
}

/// Joins the manifests of a set's processes and gives the set its name, if all of it is there. Several processes may
/// do this at once: each step is the same whoever takes it, and can be taken twice.
pub(super) fn seal(path: &Path, replace: bool) -> Result<SetStatus, OutputError> {
    let root = partial(path);
    match try_seal(path, &root, replace) {
        // Another process was faster: what was to be renamed has its name.
        Err(_) if !root.exists() && Manifest::sealed(path).is_ok() => Ok(SetStatus::Sealed),
        result => result,
    }
}

fn try_seal(path: &Path, root: &Path, replace: bool) -> Result<SetStatus, OutputError> {
    let failed = |source| OutputError::Write { path: path.to_owned(), source };
    let found = if root.is_dir() { Manifest::joined(root)? } else { None };
    let Some(manifest) = found else {
        return Err(OutputError::NotASet { path: if root.is_dir() { root } else { path }.to_owned() });
    };
    if !manifest.is_complete() {
        let (done, chunks) = (manifest.chunks.len() as u64, manifest.plan.chunks());
        return Ok(SetStatus::Waiting { done, chunks });
    }
    // Temporary files are made outside: one that is inside while another process renames would stay there. Theirs is a
    // name that tells them from those of other files in that folder.
    let by = folder(path);
    let prefix = format!("{PREFIX}{}.seal-", path.file_name().unwrap_or_default().to_string_lossy());
    let place = |name: &str, bytes: &[u8]| place_by(by, &prefix, &root.join(name), bytes).map_err(failed);
    let layout = manifest.plan.layout;
    for part in layout.metadata(&manifest.plan).map_err(failed)? {
        place(&part.name, &part.bytes)?;
    }
    place(SEALED, manifest.text().as_bytes())?;
    remove_parts(root).map_err(failed)?;
    for folder in layout.folders(&manifest.plan) {
        sweep(&root.join(&folder), PREFIX).map_err(failed)?;
        sync_folder(&root.join(&folder));
    }
    sweep(root, PREFIX).map_err(failed)?;
    sync_folder(root);
    match replace && path.exists() {
        true => {
            let old = partial(&root.with_extension("replaced"));
            fs::rename(path, &old).map_err(failed)?;
            fs::rename(root, path).map_err(failed)?;
            fs::remove_dir_all(old).map_err(failed)?;
        }
        false => fs::rename(root, path).map_err(failed)?,
    }
    sweep(by, &prefix).map_err(failed)?;
    sync_folder(by);
    Ok(SetStatus::Sealed)
}
