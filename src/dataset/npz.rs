//! NumPy's `.npz`: a ZIP archive of `.npy` files.

use std::io::{Cursor, Read};
use std::path::Path;

use zip::ZipArchive;

use super::arrays::{self, Arrays, Order};
use super::{DatasetError, MAX_BYTES, npy};

/// Largest number of files of an archive that are looked at.
const MAX_FILES: usize = 10_000;

/// Kind of an archive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Archive {
    /// Arrays of NumPy.
    Npz,
    /// A spreadsheet.
    Spreadsheet,
    /// Anything else.
    Other,
}

/// Tells what an archive holds from the names in it.
pub(super) fn kind(bytes: &[u8]) -> Archive {
    let Ok(archive) = ZipArchive::new(Cursor::new(bytes)) else { return Archive::Other };
    let has = |end: &str| archive.file_names().take(MAX_FILES).flatten().any(|name| name.ends_with(end));
    if has(".npy") {
        Archive::Npz
    } else if has("[Content_Types].xml") || has("content.xml") {
        Archive::Spreadsheet
    } else {
        Archive::Other
    }
}

/// Every numeric array of an archive.
pub(super) fn arrays(path: &Path, bytes: &[u8]) -> Result<Arrays, DatasetError> {
    let failed = |reason: String| DatasetError::Format {
        path: path.to_owned(),
        format: "an archive of NumPy arrays",
        reason,
    };
    let mut archive = ZipArchive::new(Cursor::new(bytes)).map_err(|e| failed(e.to_string()))?;
    let mut found =
        Arrays { format: "NumPy archive (.npz)".to_owned(), order: Order::LastFirst, ..Arrays::default() };
    let mut left = MAX_BYTES;
    for index in 0..archive.len().min(MAX_FILES) {
        let file = archive.by_index(index).map_err(|e| failed(e.to_string()))?;
        let full = file.name().map_err(|e| failed(e.to_string()))?.into_owned();
        let Some(name) = full.strip_suffix(".npy") else { continue };
        let mut unpacked = Vec::new();
        file.take(left + 1).read_to_end(&mut unpacked).map_err(|e| failed(format!("{name:?}: {e}")))?;
        left = left
            .checked_sub(unpacked.len() as u64)
            .ok_or_else(|| DatasetError::TooLarge { path: path.to_owned() })?;
        if name == "attributes" {
            found.kind = npy::text(&unpacked).and_then(|text| arrays::kind(&text));
            continue;
        }
        match npy::array(name, &unpacked) {
            Ok(array) => found.all.push(array),
            // Text and records are somebody else's.
            Err(reason) if reason.starts_with("expected") || reason.contains("not NumPy's") => {}
            Err(reason) => return Err(failed(format!("{name:?}: {reason}"))),
        }
    }
    Ok(found)
}
