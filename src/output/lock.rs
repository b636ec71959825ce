//! Advisory locks on files, which tell what a living process holds from what a killed one left.
//!
//! The operating system releases a lock when its process ends, however it ends. Some network file systems have no
//! locks; callers get [`Attempt::Unsupported`] there, and must not destroy anything on the strength of it.

use std::fs::{self, File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
#[cfg(unix)]
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Outcome of an attempt to lock.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Attempt {
    /// The lock is held.
    Held,
    /// Another process holds it.
    Busy,
    /// The file system has no locks.
    Unsupported,
}

/// A file to be locked. Dropping it releases the lock.
#[derive(Debug)]
pub(super) struct LockFile {
    file: File,
    path: PathBuf,
}

/// Longest text that is read of a lock's file.
const TEXT_BYTES: u64 = 4096;

impl LockFile {
    /// Opens the file, and creates it where it does not exist.
    pub(super) fn open(path: &Path) -> io::Result<LockFile> {
        let file = OpenOptions::new().read(true).write(true).create(true).truncate(false).open(path)?;
        Ok(LockFile { file, path: path.to_owned() })
    }

    /// Opens the file if it exists.
    pub(super) fn existing(path: &Path) -> io::Result<LockFile> {
        let file = OpenOptions::new().read(true).write(true).open(path)?;
        Ok(LockFile { file, path: path.to_owned() })
    }

    pub(super) fn try_exclusive(&self) -> Attempt {
        attempt(|| self.file.try_lock())
    }

    pub(super) fn try_shared(&self) -> Attempt {
        attempt(|| self.file.try_lock_shared())
    }

    /// Turns an exclusive lock into one that others may share. Another process may have held it in between.
    pub(super) fn share(&self) -> Attempt {
        let _ = self.file.unlock();
        attempt(|| self.file.lock_shared().map_err(TryLockError::Error))
    }

    /// Whether the name is still that of this file. One that waited for a lock may have got that of a deleted file.
    pub(super) fn is_current(&self) -> bool {
        is_named(&self.file, &self.path)
    }

    /// Reads what the holder wrote; empty where it cannot be read.
    pub(super) fn text(&self) -> String {
        let mut text = String::new();
        let mut file = &self.file;
        let read =
            file.seek(SeekFrom::Start(0)).and_then(|_| file.take(TEXT_BYTES).read_to_string(&mut text));
        read.map_or_else(|_| String::new(), |_| text)
    }

    /// Writes who holds the lock.
    pub(super) fn set_text(&self, text: &str) -> io::Result<()> {
        let mut file = &self.file;
        file.set_len(0)?;
        file.seek(SeekFrom::Start(0))?;
        file.write_all(text.as_bytes())
    }
}

/// Waits for the lock of a folder, which processes hold while they change two names in it that belong together. `None` where
/// folders cannot be locked.
pub(super) fn lock_folder(folder: &Path) -> Option<File> {
    let file = cfg!(unix).then(|| File::open(folder).ok())??;
    file.lock().is_ok().then_some(file)
}

/// Locks a temporary file of this process, so that no other sweeps it. `false` where one did already.
pub(super) fn hold(file: &File, path: &Path) -> bool {
    // Where locks keep others from reading, libraries that open the file by its name could not.
    if cfg!(unix) {
        attempt(|| file.try_lock());
    }
    is_named(file, path)
}

/// Whether no living process holds a temporary file, as far as that can be told.
pub(super) fn is_left(path: &Path) -> bool {
    let is_file = fs::symlink_metadata(path).is_ok_and(|found| found.is_file());
    cfg!(unix) && is_file && LockFile::existing(path).is_ok_and(|lock| lock.try_exclusive() == Attempt::Held)
}

/// Describes this process to people.
pub(super) fn this_process() -> String {
    let id = std::process::id();
    match host() {
        Some(host) => format!("process {id} on {host}"),
        None => format!("process {id}"),
    }
}

/// Whether a description of a process is of one on this machine.
pub(super) fn is_here(process: &str) -> bool {
    process.split_once(" on ").map(|(_, host)| host.to_owned()) == host()
}

/// Name of this machine.
fn host() -> Option<String> {
    let name = fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let name = name.or_else(|| std::env::var("HOSTNAME").ok()).or_else(|| std::env::var("COMPUTERNAME").ok());
    name.map(|name| name.trim().to_owned()).filter(|name| !name.is_empty())
}

fn attempt(lock: impl Fn() -> Result<(), TryLockError>) -> Attempt {
    loop {
        return match lock() {
            Ok(()) => Attempt::Held,
            Err(TryLockError::WouldBlock) => Attempt::Busy,
            Err(TryLockError::Error(e)) if e.kind() == io::ErrorKind::Interrupted => continue,
            Err(TryLockError::Error(_)) => Attempt::Unsupported,
        };
    }
}

fn is_named(file: &File, path: &Path) -> bool {
    let Ok(named) = fs::symlink_metadata(path) else { return false };
    file.metadata().is_ok_and(|found| identity(&found) == identity(&named))
}

/// Numbers that no other file has which is there at the same time; the same for all where the system has none.
pub(super) fn identity(found: &fs::Metadata) -> (u64, u64) {
    #[cfg(unix)]
    let numbers = (found.dev(), found.ino());
    #[cfg(not(unix))]
    let numbers = (0, 0);
    numbers
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lock_is_held_by_one_or_shared_by_several() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("lock");
        let [a, b, c] = [(); 3].map(|()| LockFile::open(&path).unwrap());
        assert_eq!((a.try_exclusive(), b.try_shared()), (Attempt::Held, Attempt::Busy));
        a.set_text("process 1 on here").unwrap();
        assert_eq!(b.text(), "process 1 on here");
        assert_eq!(
            (a.share(), b.try_shared(), c.try_exclusive()),
            (Attempt::Held, Attempt::Held, Attempt::Busy)
        );
        drop((a, b));
        assert_eq!(c.try_exclusive(), Attempt::Held);
        fs::remove_file(&path).unwrap();
        assert!(!c.is_current());
    }
}
