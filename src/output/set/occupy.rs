//! Beginning of a set: its folder, and the locks that say who writes there.
//!
//! Whoever writes chunks shares the lock of the folder, and holds that of its shard alone. Whoever begins a set,
//! replaces it or gives it its name holds that of the folder alone, so that none of this happens under a writer's
//! hands. Where the file system has no locks a second process may make the same chunks again, with the same bytes; but
//! nothing that may be somebody else's is deleted.

use std::fs;
use std::hash::{BuildHasher, Hasher};
use std::io;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use super::super::lock::{Attempt, LockFile, is_here, this_process};
use super::super::pending::{ignore_missing, sweep};
use super::super::{OutputError, partial};
use super::manifest::{Manifest, SEALED, manifests, part_name};
use super::{SetMode, SetPlan, Shard};

/// Name of the lock of a set's folder. Its text begins with the mark of the set that is being written.
pub(super) const LOCK: &str = "_lock";

/// Time that those who begin or complete a set take: the others wait for them.
pub(super) const PATIENCE: Duration = Duration::from_secs(30);

/// Time in which others only look whether somebody holds a lock.
pub(super) const GLANCE: Duration = Duration::from_secs(1);

/// Time after which a file server forgets the locks of a machine that is gone, and more.
const LEASE: Duration = Duration::from_secs(120);

/// Time between attempts to lock.
pub(super) const PAUSE: Duration = Duration::from_millis(20);

/// A set's folder that this process writes to.
pub(super) struct Begun {
    pub(super) root: PathBuf,
    /// Mark of the set.
    pub(super) generation: String,
    /// Locks of the folder and of the shard.
    pub(super) locks: [LockFile; 2],
}

/// Begins a set, or goes on with it; `None` where it is complete. Its plan is compared with what is there of a complete
/// set alone.
pub(super) fn occupy(
    path: &Path,
    plan: &SetPlan,
    shard: Shard,
    start: SetMode,
) -> Result<Option<Begun>, OutputError> {
    let begun = Instant::now();
    loop {
        if undisturbed(path, PATIENCE, || is_done(path, plan, start))? {
            return Ok(None);
        }
        if let Some(begun) = begin(path, shard, start)? {
            return Ok(Some(begun));
        }
        if begun.elapsed() > PATIENCE {
            return Err(busy(&partial(path)));
        }
        std::thread::sleep(PAUSE);
    }
}

/// Reads a set that another process may replace meanwhile: once more, for some time, where that failed and one did.
pub(super) fn undisturbed<T>(
    path: &Path,
    time: Duration,
    read: impl Fn() -> Result<T, OutputError>,
) -> Result<T, OutputError> {
    let begun = Instant::now();
    loop {
        let seal = Manifest::seal(path);
        let found = read();
        let is_between = || !path.exists() && replaced(path).exists();
        let is_disturbed = || Manifest::seal(path) != seal || is_between();
        if found.is_ok() || begun.elapsed() > time || !is_disturbed() {
            return found;
        }
        std::thread::sleep(PAUSE);
    }
}

/// Whether a complete set is there, and is what a run that resumes it would make.
fn is_done(path: &Path, plan: &SetPlan, start: SetMode) -> Result<bool, OutputError> {
    if path.symlink_metadata().is_err() {
        return Ok(false);
    }
    if !path.is_dir() {
        return Err(OutputError::NotAFolder { path: path.to_owned() });
    }
    match start {
        SetMode::Create => Err(OutputError::Exists { path: path.to_owned() }),
        SetMode::Replace => {
            // Nothing but a set is replaced, be it a damaged one.
            match Manifest::sealed(path) {
                Ok(_) | Err(OutputError::Manifest { .. } | OutputError::ManifestVersion { .. }) => {}
                Err(error) => return Err(error),
            }
            // What it will be called for a moment is longer.
            replaced(path)
                .symlink_metadata()
                .map(drop)
                .or_else(ignore_missing)
                .map_err(|e| failed(path, e))?;
            Ok(false)
        }
        SetMode::Resume => {
            let sealed = Manifest::sealed(path)?;
            sealed.check(plan, path)?;
            let fault = match sealed.is_complete() {
                true => sealed.sums().find_map(|sum| sum.fault(path)),
                false => Some("its manifest lacks chunks".to_owned()),
            };
            match fault {
                Some(fault) => Err(OutputError::Damaged { path: path.to_owned(), fault }),
                None => {
                    let _ = remove_replaced(path);
                    let _ = fs::remove_file(path.join(LOCK)); // of one that was killed after it named the set
                    Ok(true)
                }
            }
        }
    }
}

/// Takes the locks and prepares the folder; `None` where that is to be tried again, because another process begins or
/// completes the set.
fn begin(path: &Path, shard: Shard, start: SetMode) -> Result<Option<Begun>, OutputError> {
    let root = partial(path);
    let is_new = match fs::create_dir(&root) {
        Ok(()) => true,
        Err(e) if e.kind() == io::ErrorKind::AlreadyExists && root.is_dir() => false,
        Err(e) => return Err(failed(path, e)),
    };
    if !is_new && !root.join(LOCK).exists() && !is_ours(&root).map_err(|e| failed(path, e))? {
        // Another process may have begun or completed the set since.
        return match root.exists() && !root.join(LOCK).exists() {
            true => {
                Err(OutputError::NotOurs { path: root, expected: "an unfinished data set of this program" })
            }
            false => Ok(None),
        };
    }
    let set = match LockFile::open(&root.join(LOCK)) {
        Ok(lock) => lock,
        Err(e) if e.kind() == io::ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(failed(path, e)),
    };
    // Others who begin or complete the set do so at once; those who write it take their time.
    let glance = if start == SetMode::Replace { GLANCE } else { Duration::ZERO };
    match patiently(glance, || set.try_exclusive()) {
        Attempt::Held if set.is_current() => {
            if is_new && start != SetMode::Replace && path.exists() {
                let _ = fs::remove_dir_all(&root); // it was completed since it was looked for
                return Ok(None);
            }
            prepare(&root, &set, start)?;
            let _ = remove_replaced(path);
            set.share();
        }
        Attempt::Busy if start == SetMode::Replace => return Err(busy(&root)),
        Attempt::Busy if set.try_shared() == Attempt::Held && set.is_current() => {}
        Attempt::Held | Attempt::Busy => return Ok(None),
        Attempt::Unsupported if is_new => set.set_text(&mark()).map_err(|e| failed(path, e))?,
        Attempt::Unsupported if start == SetMode::Replace => return Err(OutputError::NoLocks { root }),
        Attempt::Unsupported => {}
    }
    let Some(generation) = generation(&set) else { return Ok(None) };
    let own = take_shard(path, &root, shard, start)?;
    let found = manifests(&root).map_err(|e| failed(path, e))?;
    let is_taken = shard.count == 1 && !found.is_empty() || root.join(part_name(shard)).exists();
    if start == SetMode::Create && is_taken {
        return Err(OutputError::Unfinished { path: path.to_owned(), root });
    }
    Ok(Some(Begun { root, generation, locks: [set, own] }))
}

/// Takes the lock of a shard, which only one process can.
fn take_shard(path: &Path, root: &Path, shard: Shard, start: SetMode) -> Result<LockFile, OutputError> {
    let name = root.join(lock_name(shard));
    let is_new = !name.exists();
    let lock = LockFile::open(&name).map_err(|e| failed(path, e))?;
    let mut outcome = patiently(GLANCE, || lock.try_exclusive());
    if outcome == Attempt::Busy && start == SetMode::Resume && !is_here(&lock.text()) {
        outcome = patiently(LEASE, || lock.try_exclusive()); // its machine may be gone
    }
    match outcome {
        Attempt::Busy => {
            let holder = lock.text();
            let holder = if holder.is_empty() { "another process".to_owned() } else { holder };
            return Err(OutputError::Busy { root: root.to_owned(), holder });
        }
        Attempt::Unsupported if start == SetMode::Create && !is_new => {
            return Err(OutputError::Unfinished { path: path.to_owned(), root: root.to_owned() });
        }
        Attempt::Held | Attempt::Unsupported => {}
    }
    lock.set_text(&this_process()).map_err(|e| failed(path, e))?;
    Ok(lock)
}

/// Prepares the folder of a set that no other process writes: what is of no use there is deleted, and a set that is
/// begun gets its mark.
fn prepare(root: &Path, set: &LockFile, start: SetMode) -> Result<(), OutputError> {
    let found = if start == SetMode::Replace { None } else { Manifest::joined(root)? };
    match found {
        Some(found) => go_on(root, set, found.generation),
        None => clear(root, set),
    }
    .map_err(|e| failed(root, e))
}

/// Deletes what killed processes left unfinished in a folder. `found` is the mark of its manifests.
fn go_on(root: &Path, set: &LockFile, found: Option<String>) -> io::Result<()> {
    if generation(set).is_none() {
        set.set_text(&found.map_or_else(mark, |mark| mark + "\n"))?;
    }
    folders(root)?.iter().try_for_each(|folder| sweep(folder))
}

/// Deletes all that is in a folder, for a set that is begun.
fn clear(root: &Path, set: &LockFile) -> io::Result<()> {
    // The manifests first: chunks that none names are none.
    manifests(root)?.into_iter().try_for_each(|path| fs::remove_file(path).or_else(ignore_missing))?;
    for entry in fs::read_dir(root)? {
        let entry = entry?;
        if entry.file_name() == LOCK {
            continue;
        }
        match entry.file_type()?.is_dir() {
            true => fs::remove_dir_all(entry.path()),
            false => fs::remove_file(entry.path()),
        }
        .or_else(ignore_missing)?;
    }
    set.set_text(&mark())
}

/// The folder and those in it.
pub(super) fn folders(root: &Path) -> io::Result<Vec<PathBuf>> {
    let mut all = vec![root.to_owned()];
    for entry in fs::read_dir(root)? {
        let entry = entry?;
        if entry.file_type()?.is_dir() {
            all.push(entry.path());
        }
    }
    Ok(all)
}

/// Whether a folder without a lock is that of an unfinished set: empty, or with a manifest.
fn is_ours(root: &Path) -> io::Result<bool> {
    match fs::read_dir(root) {
        Ok(mut entries) => Ok(entries.next().is_none() || !manifests(root)?.is_empty()),
        Err(e) => ignore_missing(e).map(|()| false),
    }
}

/// Mark of a set that is begun, unlike that of any other.
fn mark() -> String {
    let random = std::hash::RandomState::new().build_hasher().finish();
    format!("{random:016x}\n")
}

/// Mark of the set whose folder has this lock; `None` where the process that began it has not written it yet.
pub(super) fn generation(set: &LockFile) -> Option<String> {
    set.text().lines().next().filter(|mark| mark.len() == 16).map(str::to_owned)
}

/// Name of the lock of a shard.
fn lock_name(shard: Shard) -> String {
    format!("_shard.{}-of-{}.lock", shard.index, shard.count)
}

/// Whether a name is that of a shard's lock.
pub(super) fn is_lock_name(name: &str) -> bool {
    name.starts_with("_shard.") && name.ends_with(".lock")
}

/// Whether a living process makes a shard, as far as that can be told.
pub(super) fn is_being_made(root: &Path, shard: Shard) -> bool {
    LockFile::existing(&root.join(lock_name(shard))).is_ok_and(|lock| lock.try_shared() == Attempt::Busy)
}

/// Error of a folder that another process holds; names those that make its shards.
pub(super) fn busy(root: &Path) -> OutputError {
    let names = fs::read_dir(root).into_iter().flatten().flatten().map(|entry| entry.file_name());
    let locks = names.filter(|name| name.to_str().is_some_and(is_lock_name));
    let open = locks.filter_map(|name| LockFile::existing(&root.join(name)).ok());
    let mut holders: Vec<_> =
        open.filter(|lock| lock.try_shared() == Attempt::Busy).map(|lock| lock.text()).collect();
    holders.retain(|holder| !holder.is_empty());
    holders.sort();
    holders.dedup();
    let more = holders.len().saturating_sub(3);
    holders.truncate(3);
    if more > 0 {
        holders.push(format!("{more} more"));
    }
    let holder = if holders.is_empty() { "another process".to_owned() } else { holders.join(", ") };
    OutputError::Busy { root: root.to_owned(), holder }
}

/// Name of a set while the one that replaces it gets its name.
pub(super) fn replaced(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".replaced");
    partial(Path::new(&name))
}

/// Deletes what a killed process left of a set that it replaced, if the set that replaced it is there.
pub(super) fn remove_replaced(path: &Path) -> io::Result<()> {
    let old = replaced(path);
    if path.join(SEALED).exists() && old.is_dir() {
        fs::remove_dir_all(old).or_else(ignore_missing)?;
    }
    Ok(())
}

/// Tries to lock for some time.
pub(super) fn patiently(time: Duration, attempt: impl Fn() -> Attempt) -> Attempt {
    let begun = Instant::now();
    loop {
        match attempt() {
            Attempt::Busy if begun.elapsed() < time => std::thread::sleep(PAUSE),
            other => return other,
        }
    }
}

fn failed(path: &Path, source: io::Error) -> OutputError {
    OutputError::Write { path: path.to_owned(), source }
}
