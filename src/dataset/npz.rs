//! NumPy's `.npz`: a ZIP archive of `.npy` files.

use std::io::{self, Read};
use std::path::Path;

use zip::ZipArchive;

use super::arrays::{self, Arrays, Order};
use super::files::Source;
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
pub(super) fn kind(source: &mut Source) -> Archive {
    let Ok(archive) = ZipArchive::new(source) else { return Archive::Other };
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
pub(super) fn arrays(path: &Path, source: Source) -> Result<Arrays, DatasetError> {
    let failed = |reason: String| DatasetError::Format {
        path: path.to_owned(),
        format: "an archive of NumPy arrays",
        reason,
    };
    let mut archive = ZipArchive::new(source).map_err(|e| failed(e.to_string()))?;
    let mut found =
        Arrays { format: "NumPy archive (.npz)".to_owned(), order: Order::LastFirst, ..Arrays::default() };
    let mut left = MAX_BYTES;
    for index in 0..archive.len().min(MAX_FILES) {
        let mut file = archive.by_index(index).map_err(|e| failed(e.to_string()))?;
        let full = file.name().map_err(|e| failed(e.to_string()))?.into_owned();
        let Some(name) = full.strip_suffix(".npy") else { continue };
        let size = file.size();
        left = left.checked_sub(size).ok_or_else(|| DatasetError::TooLarge { path: path.to_owned() })?;
        if name == "attributes" {
            let mut text = Vec::new();
            file.take(size + 1).read_to_end(&mut text).map_err(|e| failed(format!("{name:?}: {e}")))?;
            found.kind = npy::text(&text).and_then(|text| arrays::kind(&text));
            continue;
        }
        match npy::array(name, &mut file, size) {
            Ok(array) => {
                // The sum of a file is looked at where it ends, and nowhere before.
                let mut rest = file.take(size + 1);
                io::copy(&mut rest, &mut io::sink()).map_err(|e| failed(format!("{name:?}: {e}")))?;
                found.all.push(array);
            }
            // Text and records are somebody else's.
            Err(reason) if reason.starts_with("expected") || reason.contains("not NumPy's") => {}
            Err(reason) => return Err(failed(format!("{name:?}: {reason}"))),
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests {
    use std::io::{Cursor, Write};

    use zip::CompressionMethod;
    use zip::write::{SimpleFileOptions, ZipWriter};

    use super::*;

    /// A byte that changed on the way is no other number: the archive knows the sum of each file.
    #[test]
    fn changed_bytes_are_noticed() {
        let values: Vec<u8> = (0..5000).flat_map(|i| f64::from(i).to_le_bytes()).collect();
        let header = b"{'descr': '<f8', 'fortran_order': False, 'shape': (50, 100), }\n";
        let start = [b"\x93NUMPY\x01\0".as_slice(), &(header.len() as u16).to_le_bytes(), header].concat();
        for method in [CompressionMethod::Stored, CompressionMethod::Deflated] {
            let mut archive = ZipWriter::new(Cursor::new(Vec::new()));
            let options = SimpleFileOptions::default().compression_method(method);
            archive.start_file("spectra.npy", options).unwrap();
            archive.write_all(&[start.as_slice(), &values].concat()).unwrap();
            let whole = archive.finish().unwrap().into_inner();
            let read = |bytes: Vec<u8>| arrays(Path::new("a.npz"), Source::of(bytes));
            assert_eq!(read(whole.clone()).unwrap().all[0].values.len(), 5000);
            for at in (300..whole.len() - 200).step_by(397) {
                let mut changed = whole.clone();
                changed[at] ^= 1;
                assert!(read(changed).is_err(), "{method}, byte {at}");
            }
        }
    }
}
