//! Files and folders as they are on disk, read within limits.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use super::{DatasetError, MAX_BYTES};
use crate::plain_file;

/// Largest number of entries of a folder.
const MAX_ENTRIES: usize = 200_000;

/// Bytes of a regular file, if they are at most `cap`.
pub(super) fn read_capped(path: &Path, cap: u64) -> Result<Vec<u8>, DatasetError> {
    plain_file::read(path, cap).map_err(|source| match source.kind() {
        ErrorKind::FileTooLarge => DatasetError::TooLarge { path: path.to_owned() },
        _ => DatasetError::Read { path: path.to_owned(), source },
    })
}

/// Bytes of a file of data: some, and not too many.
pub(super) fn read(path: &Path) -> Result<Vec<u8>, DatasetError> {
    let bytes = read_capped(path, MAX_BYTES)?;
    if bytes.is_empty() {
        return Err(DatasetError::Empty { path: path.to_owned() });
    }
    Ok(bytes)
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
