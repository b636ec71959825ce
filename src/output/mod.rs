//! Files of spectra, one format a module. A file appears under its name only when it is complete.

mod csv;
mod npy;

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::NamedTempFile;

use crate::engine::Batch;
use crate::grid::Grid;

/// A format of files of spectra.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Format {
    /// NumPy: float32, (draws, bands), C order.
    Npy,
    /// Text: a header of wavelengths in nm, then a line a spectrum.
    Csv,
}

/// Why a file cannot be written.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum OutputError {
    #[error("{path:?}: unknown format; name it .npy or .csv, or pass --format")]
    UnknownFormat { path: PathBuf },
    #[error("{path:?} exists already: choose another name, or pass --force to replace it")]
    Exists { path: PathBuf },
    #[error("{path:?} is a folder: name a file")]
    Folder { path: PathBuf },
    #[error("{path:?} is not a plain file, and would be replaced by one: name another")]
    Special { path: PathBuf },
    #[error("{folder:?} does not exist: create it first")]
    NoFolder { folder: PathBuf },
    #[error("cannot write {path:?}: {source}")]
    Write { path: PathBuf, source: io::Error },
}

impl Format {
    /// The format that the extension of `path` names.
    pub fn of(path: &Path) -> Result<Format, OutputError> {
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("npy") => Ok(Format::Npy),
            Some("csv") => Ok(Format::Csv),
            _ => Err(OutputError::UnknownFormat { path: path.to_owned() }),
        }
    }

    /// Writes what comes before `count` spectra on `grid`.
    pub fn begin(self, to: &mut dyn Write, grid: Grid, count: u64) -> io::Result<()> {
        match self {
            Format::Npy => npy::begin(to, grid, count),
            Format::Csv => csv::begin(to, grid),
        }
    }

    /// Writes a batch of spectra.
    pub fn write(self, to: &mut dyn Write, batch: &Batch) -> io::Result<()> {
        match self {
            Format::Npy => npy::write(to, batch),
            Format::Csv => csv::write(to, batch),
        }
    }
}

/// Bytes on their way to a name: in a temporary file beside it until [`Pending::finish`], and gone if that never
/// comes.
#[derive(Debug)]
pub struct Pending {
    file: BufWriter<NamedTempFile>,
    path: PathBuf,
    existing: Existing,
}

/// What to do where a file of the name exists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Existing {
    /// Refuse.
    Keep,
    /// Replace it, once the new one is complete.
    Replace,
}

impl Pending {
    /// Begins a file that will appear as `path`.
    pub fn create(path: &Path, existing: Existing) -> Result<Pending, OutputError> {
        let path = path.to_owned();
        if path.is_dir() {
            return Err(OutputError::Folder { path });
        }
        if path.exists() && !path.is_file() {
            return Err(OutputError::Special { path }); // a device, say: --force -o /dev/null must not replace it
        }
        if existing == Existing::Keep && path.symlink_metadata().is_ok() {
            return Err(OutputError::Exists { path });
        }
        let folder = folder(&path);
        if !folder.is_dir() {
            return Err(OutputError::NoFolder { folder: folder.to_owned() });
        }
        let mut builder = tempfile::Builder::new();
        builder.prefix(".spectroll-").suffix(".partial");
        #[cfg(unix)] // as any new file; by default only its owner could read it
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
        match builder.tempfile_in(folder) {
            Ok(file) => Ok(Pending { file: BufWriter::new(file), path, existing }),
            Err(source) => Err(OutputError::Write { path, source }),
        }
    }

    /// Makes the file appear under its name, complete and on disk.
    pub fn finish(self) -> Result<(), OutputError> {
        let Pending { file, path, existing } = self;
        let failed = |source| OutputError::Write { path: path.clone(), source };
        let file = file.into_inner().map_err(|e| failed(e.into_error()))?;
        file.as_file().sync_all().map_err(failed)?;
        match existing {
            Existing::Keep => file.persist_noclobber(&path), // nobody's file that appeared meanwhile
            Existing::Replace => file.persist(&path),
        }
        .map_err(|e| failed(e.error))?;
        // The name is on disk once the folder is. Not every file system can say so, and the data are safe either way.
        let _ = File::open(folder(&path)).and_then(|folder| folder.sync_all());
        Ok(())
    }

    /// An error of writing, with the name that was being written.
    pub fn failed(&self, source: io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}

impl Write for Pending {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

/// Writes a whole file, which appears only when it is complete.
pub fn write_file(path: &Path, existing: Existing, bytes: &[u8]) -> Result<(), OutputError> {
    let mut pending = Pending::create(path, existing)?;
    pending.write_all(bytes).map_err(|e| pending.failed(e))?;
    pending.finish()
}

/// The folder that a path names a file in.
fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn a_file_appears_only_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.csv");
        let files = || fs::read_dir(folder.path()).unwrap().count();
        {
            let mut pending = Pending::create(&path, Existing::Keep).unwrap();
            pending.write_all(b"half").unwrap();
            assert!(!path.exists());
        }
        assert_eq!(files(), 0);
        write_file(&path, Existing::Keep, b"whole").unwrap();
        assert_eq!((fs::read(&path).unwrap(), files()), (b"whole".to_vec(), 1));
        assert!(matches!(write_file(&path, Existing::Keep, b"new"), Err(OutputError::Exists { .. })));
        write_file(&path, Existing::Replace, b"new").unwrap();
        assert_eq!((fs::read(&path).unwrap(), files()), (b"new".to_vec(), 1));
    }

    #[test]
    fn what_is_in_the_way_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = |path: &Path| Pending::create(path, Existing::Keep).unwrap_err().to_string();
        assert!(error(folder.path()).contains("is a folder"));
        assert!(error(&folder.path().join("a/b.npy")).contains("does not exist: create it first"));
        assert!(Format::of(Path::new("x.xlsx")).unwrap_err().to_string().contains(".npy or .csv"));
    }
}
