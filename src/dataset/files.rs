//! Files and folders as they are on disk, read within limits.

use std::fs::{self, File};
use std::io::{self, Cursor, ErrorKind, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use super::{DatasetError, MAX_BYTES};
use crate::plain_file;

/// Largest number of entries of a folder.
const MAX_ENTRIES: usize = 200_000;

/// Number of bytes that tell the type of a file.
const HEAD: u64 = 8192;

/// The contents of a file of data: some, and not too many. What is read in one pass is never in memory as a whole.
pub(super) enum Source {
    /// A file.
    File(File),
    /// Bytes in memory: the contents of a pipe, or those that a host has read.
    Memory(Cursor<Vec<u8>>),
}

impl Source {
    pub(super) fn open(path: &Path) -> Result<Source, DatasetError> {
        let failed = |error| failed(path, error);
        match plain_file::open(path, MAX_BYTES).map_err(failed)? {
            (file, Some(1..)) => Ok(Source::File(file)),
            // Files of the system that are made as they are read claim to be empty.
            (file, length) => match plain_file::read_all(file, length, MAX_BYTES).map_err(failed)? {
                bytes if bytes.is_empty() => Err(DatasetError::Empty { path: path.to_owned() }),
                bytes => Ok(Source::of(bytes)),
            },
        }
    }

    pub(super) fn of(bytes: Vec<u8>) -> Source {
        Source::Memory(Cursor::new(bytes))
    }

    /// Its first bytes, from which its type is told.
    pub(super) fn head(&mut self) -> io::Result<Vec<u8>> {
        let mut head = Vec::new();
        self.by_ref().take(HEAD).read_to_end(&mut head)?;
        self.rewind()?;
        Ok(head)
    }

    /// Number of its bytes.
    pub(super) fn length(&self) -> io::Result<u64> {
        match self {
            Source::File(file) => Ok(file.metadata()?.len()),
            Source::Memory(bytes) => Ok(bytes.get_ref().len() as u64),
        }
    }

    /// All of it, from the start.
    pub(super) fn into_bytes(mut self) -> io::Result<Vec<u8>> {
        self.rewind()?;
        let length = self.length()?;
        match self {
            Source::Memory(bytes) => Ok(bytes.into_inner()),
            Source::File(file) => plain_file::read_all(file, Some(length.min(MAX_BYTES)), MAX_BYTES),
        }
    }
}

impl Read for Source {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        match self {
            Source::File(file) => file.read(to),
            Source::Memory(bytes) => bytes.read(to),
        }
    }
}

impl Seek for Source {
    fn seek(&mut self, to: SeekFrom) -> io::Result<u64> {
        match self {
            Source::File(file) => file.seek(to),
            Source::Memory(bytes) => bytes.seek(to),
        }
    }
}

/// Bytes of a regular file, if they are at most `cap`.
pub(super) fn read_capped(path: &Path, cap: u64) -> Result<Vec<u8>, DatasetError> {
    plain_file::read(path, cap).map_err(|error| failed(path, error))
}

/// The error of a file that cannot be read.
pub(super) fn failed(path: &Path, source: io::Error) -> DatasetError {
    match source.kind() {
        ErrorKind::FileTooLarge => DatasetError::TooLarge { path: path.to_owned() },
        _ => DatasetError::Read { path: path.to_owned(), source },
    }
}

/// Bytes of a file of data: some, and not too many.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, DatasetError> {
    Source::open(path)?.into_bytes().map_err(|error| failed(path, error))
}

/// Folders in a folder.
pub(super) fn folders(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let all = entries(folder)?;
    Ok(all.into_iter().filter(|path| path.is_dir()).collect())
}

/// Files of an ending in a folder, by name.
pub(super) fn files(folder: &Path, extension: &str) -> Result<Vec<PathBuf>, DatasetError> {
    let is_one = |path: &PathBuf| {
        path.is_file() && path.extension().is_some_and(|found| found.eq_ignore_ascii_case(extension))
    };
    let mut found: Vec<PathBuf> = entries(folder)?.into_iter().filter(is_one).collect();
    found.sort();
    Ok(found)
}

fn entries(folder: &Path) -> Result<Vec<PathBuf>, DatasetError> {
    let failed = |source| DatasetError::Read { path: folder.to_owned(), source };
    let mut found = Vec::new();
    for entry in fs::read_dir(folder).map_err(failed)? {
        found.push(entry.map_err(failed)?.path());
        if found.len() > MAX_ENTRIES {
            return Err(DatasetError::TooLarge { path: folder.to_owned() });
        }
    }
    Ok(found)
}
