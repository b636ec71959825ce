//! Files and folders that appear under their names only when they are complete.

use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, TempDir};

use super::OutputError;
use super::lock;

/// End of the names of temporary files, which are `NAME.XXXXXX.partial`: for people to see and to understand.
const SUFFIX: &str = ".partial";

/// Number of random characters in them.
const RANDOM: usize = 6;

/// Longest part of a name that the temporary one repeats, so that there is one for every name that there can be.
const REPEATED: usize = 200;

/// Treatment of a file or folder that exists already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum IfExists {
    /// Refuse to write.
    Refuse,
    /// Replace it, once the new one is complete.
    Replace,
}

/// A file on its way to its name: a temporary one beside it until [`PendingFile::finish`], and deleted if that is
/// never called. Those that killed runs left are deleted when the next file of their name is begun.
#[derive(Debug)]
pub struct PendingFile {
    file: NamedTempFile,
    path: PathBuf,
    existing: IfExists,
}

impl PendingFile {
    /// Begins a file that will appear as `path`.
    pub fn create(path: impl AsRef<Path>, existing: IfExists) -> Result<PendingFile, OutputError> {
        let path = target(path.as_ref(), existing);
        if path.is_dir() {
            return Err(OutputError::Folder { path });
        }
        // The temporary name is short enough where this one is not.
        if let Err(source) = path.symlink_metadata()
            && source.kind() == io::ErrorKind::InvalidFilename
        {
            return Err(OutputError::Write { path, source });
        }
        if path.exists() && !path.is_file() {
            return Err(OutputError::Special { path }); // a device, say: --force -o /dev/null must not replace it
        }
        if existing == IfExists::Refuse && path.symlink_metadata().is_ok() {
            return Err(OutputError::Exists { path });
        }
        existing_folder(&path)?;
        let _ = sweep_of(&path); // what cannot be deleted is in nobody's way
        match held(&path) {
            Ok(file) => Ok(PendingFile { file, path, existing }),
            Err(source) => Err(OutputError::Write { path, source }),
        }
    }

    /// Path at which the file will appear.
    pub(super) fn path(&self) -> &Path {
        &self.path
    }

    /// Opens the file for writing.
    pub fn file(&self) -> Result<File, OutputError> {
        self.file.as_file().try_clone().map_err(|source| self.failed(source))
    }

    /// The temporary name, for libraries that open files themselves.
    pub(super) fn temporary_path(&self) -> &Path {
        self.file.path()
    }

    /// Makes the file appear under its name, complete and on disk.
    pub fn finish(self) -> Result<(), OutputError> {
        let PendingFile { file, path, existing } = self;
        let failed = |source| OutputError::Write { path: path.clone(), source };
        file.as_file().sync_all().map_err(failed)?;
        match existing {
            IfExists::Refuse => file.persist_noclobber(&path), // nobody's file that appeared meanwhile
            IfExists::Replace => file.persist(&path),
        }
        .map_err(|e| match e.error.kind() {
            io::ErrorKind::AlreadyExists if existing == IfExists::Refuse => {
                OutputError::Exists { path: path.clone() }
            }
            _ => failed(e.error),
        })?;
        sync_folder(folder(&path));
        Ok(())
    }

    /// Brings what was written onto the disk, so that [`finish`](Self::finish) takes no time; refuses a file that appeared
    /// under its name meanwhile.
    pub(super) fn ready(&self) -> Result<(), OutputError> {
        self.file.as_file().sync_all().map_err(|source| self.failed(source))?;
        match self.existing {
            IfExists::Refuse if self.path.symlink_metadata().is_ok() => {
                Err(OutputError::Exists { path: self.path.clone() })
            }
            _ => Ok(()),
        }
    }

    /// Makes an error of writing, with the name that was being written.
    pub fn failed(&self, source: io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}

/// A folder on its way to a name: a temporary one beside it until [`PendingFolder::finish`], and gone if that never
/// comes.
#[derive(Debug)]
pub struct PendingFolder {
    making: TempDir,
    path: PathBuf,
    existing: IfExists,
    ours: FolderMark,
}

/// Mark of folders that a program made, which tells them from others, and so from those it must not replace.
#[derive(Clone, Copy, Debug)]
pub struct FolderMark {
    /// Description of such a folder, as in "a report".
    pub name: &'static str,
    /// Whether a folder is one.
    pub is_ours: fn(&Path) -> bool,
}

impl PendingFolder {
    /// Begins a folder that will appear as `path`. One that exists is replaced only if it has the mark.
    pub fn create(path: &Path, existing: IfExists, ours: FolderMark) -> Result<PendingFolder, OutputError> {
        let path = target(path, existing);
        check_folder(&path, existing, ours)?;
        let prefix = prefix(&path);
        let mut builder = tempfile::Builder::new();
        builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
        #[cfg(unix)] // as any new folder; by default only its owner could read it
        builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
        match builder.tempdir_in(existing_folder(&path)?) {
            Ok(making) => Ok(PendingFolder { making, path, existing, ours }),
            Err(source) => Err(OutputError::Write { path, source }),
        }
    }

    /// Path of the folder until it is complete.
    pub fn temporary_path(&self) -> &Path {
        self.making.path()
    }

    /// Makes a folder in it.
    pub fn add_folder(&self, name: &str) -> Result<(), OutputError> {
        fs::create_dir(self.making.path().join(name)).map_err(|source| self.failed(source))
    }

    /// Writes a whole file in it, or in a folder in it.
    pub fn write(&self, name: impl AsRef<Path>, bytes: &[u8]) -> Result<(), OutputError> {
        fs::write(self.making.path().join(name), bytes).map_err(|source| self.failed(source))
    }

    /// Makes the folder appear under its name. What it replaces is out of the way only while it does.
    pub fn finish(self) -> Result<(), OutputError> {
        check_folder(&self.path, self.existing, self.ours)?; // it may have appeared meanwhile
        sync_folder(self.making.path());
        let parent = folder(&self.path);
        let old = if self.path.exists() {
            let old = tempfile::Builder::new().prefix(&prefix(&self.path)).suffix(SUFFIX).tempdir_in(parent);
            let old = old.map_err(|e| self.failed(e))?;
            fs::rename(&self.path, old.path().join("old")).map_err(|e| self.failed(e))?;
            Some(old)
        } else {
            None
        };
        if let Err(error) = fs::rename(self.making.path(), &self.path) {
            if let Some(old) = old {
                let _ = fs::rename(old.path().join("old"), &self.path);
            }
            return Err(self.failed(error));
        }
        sync_folder(parent);
        let _ = self.making.keep(); // it is not there any more
        Ok(())
    }

    fn failed(&self, source: io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}

/// Refuses a name that is taken, unless by an earlier folder of the kind that may be replaced.
fn check_folder(path: &Path, existing: IfExists, ours: FolderMark) -> Result<(), OutputError> {
    let path = path.to_owned();
    match path.symlink_metadata() {
        Err(_) => Ok(()),
        Ok(found) if !found.is_dir() => Err(OutputError::NotAFolder { path }),
        Ok(_) if existing == IfExists::Refuse => Err(OutputError::FolderExists { path }),
        Ok(_) if !(ours.is_ours)(&path) => Err(OutputError::NotOurs { path, expected: ours.name }),
        Ok(_) => Ok(()),
    }
}

/// Writes a whole file, which appears only when it is complete.
pub fn write_file(path: impl AsRef<Path>, existing: IfExists, bytes: &[u8]) -> Result<(), OutputError> {
    let path = path.as_ref();
    let pending = PendingFile::create(path, existing)?;
    pending.file()?.write_all(bytes).map_err(|e| pending.failed(e))?;
    pending.finish()
}

/// Puts a whole file in place, by way of a temporary one beside it: complete whenever it is there, and on disk once
/// [`sync_folder`] was called as well.
pub(super) fn place(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = temporary(path)?;
    file.write_all(bytes)?;
    file.as_file().sync_data()?;
    file.persist(path).map_err(|e| e.error)?;
    Ok(())
}

/// Path that is written where `path` is a symbolic link that may be replaced: that of its target.
fn target(path: &Path, existing: IfExists) -> PathBuf {
    match existing {
        IfExists::Replace if path.is_symlink() => fs::canonicalize(path).unwrap_or_else(|_| path.to_owned()),
        _ => path.to_owned(),
    }
}

/// Start of the temporary names of what will be `path`.
fn prefix(path: &Path) -> std::ffi::OsString {
    let name = path.file_name().unwrap_or_default();
    if name.len() <= REPEATED {
        let mut prefix = name.to_owned();
        prefix.push(".");
        return prefix;
    }
    let name = name.to_string_lossy();
    let end = (0..=REPEATED).rev().find(|&end| name.is_char_boundary(end)).unwrap_or(0);
    format!("{}.", &name[..end]).into()
}

/// Creates a temporary file of what will be `path`.
fn temporary(path: &Path) -> io::Result<NamedTempFile> {
    let prefix = prefix(path);
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(SUFFIX).rand_bytes(RANDOM);
    #[cfg(unix)] // as any new file; by default only its owner could read it
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    builder.tempfile_in(folder(path))
}

/// Creates a temporary file that is locked, so that nobody sweeps it.
fn held(path: &Path) -> io::Result<NamedTempFile> {
    loop {
        let file = temporary(path)?;
        if lock::hold(file.as_file(), file.path()) {
            return Ok(file);
        }
    }
}

/// Removes the temporary files of a name that no living process holds.
fn sweep_of(path: &Path) -> io::Result<()> {
    let prefix = prefix(path);
    for entry in fs::read_dir(folder(path))? {
        let entry = entry?;
        let name = entry.file_name();
        let is_ours = name
            .as_encoded_bytes()
            .strip_prefix(prefix.as_encoded_bytes())
            .and_then(|rest| rest.strip_suffix(SUFFIX.as_bytes()))
            .is_some_and(is_random);
        if is_ours && lock::is_left(&entry.path()) {
            fs::remove_file(entry.path()).or_else(ignore_missing)?;
        }
    }
    Ok(())
}

/// Whether this may be the random part of a temporary name.
fn is_random(part: &[u8]) -> bool {
    part.len() == RANDOM && part.iter().all(u8::is_ascii_alphanumeric)
}

/// Removes the temporary files in a folder that no other process writes to.
pub(super) fn sweep(folder: &Path) -> io::Result<()> {
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let stem = name.as_encoded_bytes().strip_suffix(SUFFIX.as_bytes());
        let random = stem.and_then(|stem| stem.rsplit(|&byte| byte == b'.').next());
        if random.is_some_and(is_random) {
            // Another process may have been faster.
            fs::remove_file(entry.path()).or_else(ignore_missing)?;
        }
    }
    Ok(())
}

/// Ignores the error that a file does not exist.
pub(super) fn ignore_missing(error: io::Error) -> io::Result<()> {
    if error.kind() == io::ErrorKind::NotFound { Ok(()) } else { Err(error) }
}

/// Syncs the names in a folder to disk. Not every file system can, and the data are safe either way.
pub(super) fn sync_folder(folder: &Path) {
    let _ = File::open(folder).and_then(|folder| folder.sync_all());
}

/// Free bytes where a path names something, for whoever runs this; `None` where that cannot be told.
pub(crate) fn available_space(path: &Path) -> Option<u64> {
    #[cfg(any(unix, windows))]
    {
        // A file system of no size at all, such as /proc, has other reasons to refuse a file.
        let folder = folder(path);
        let has_size = fs4::total_space(folder).is_ok_and(|size| size > 0);
        fs4::available_space(folder).ok().filter(|_| has_size)
    }
    #[cfg(not(any(unix, windows)))]
    {
        let _ = path;
        None
    }
}

/// Folder of the file that a path names.
pub(super) fn folder(path: &Path) -> &Path {
    path.parent().filter(|p| !p.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Folder of the file that a path names, which must exist.
pub(super) fn existing_folder(path: &Path) -> Result<&Path, OutputError> {
    let folder = folder(path);
    if folder.is_dir() { Ok(folder) } else { Err(OutputError::NoFolder { folder: folder.to_owned() }) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_appears_only_when_it_is_complete() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.csv");
        let files = || fs::read_dir(folder.path()).unwrap().count();
        {
            let pending = PendingFile::create(&path, IfExists::Refuse).unwrap();
            pending.file().unwrap().write_all(b"half").unwrap();
            assert!(!path.exists());
        }
        assert_eq!(files(), 0);
        write_file(&path, IfExists::Refuse, b"whole").unwrap();
        assert_eq!((fs::read(&path).unwrap(), files()), (b"whole".to_vec(), 1));
        assert!(matches!(write_file(&path, IfExists::Refuse, b"new"), Err(OutputError::Exists { .. })));
        write_file(&path, IfExists::Replace, b"new").unwrap();
        assert_eq!((fs::read(&path).unwrap(), files()), (b"new".to_vec(), 1));
    }

    #[test]
    fn a_folder_replaces_only_one_of_its_kind() {
        let beside = tempfile::tempdir().unwrap();
        let path = beside.path().join("mine");
        let ours = FolderMark { name: "a test", is_ours: |path| path.join("mark").is_file() };
        let begin = |existing| PendingFolder::create(&path, existing, ours);
        let make = |existing, text: &[u8]| {
            let pending = begin(existing)?;
            pending.add_folder("inner")?;
            pending.write("inner/file", text)?;
            pending.write("mark", b"")?;
            pending.finish()
        };
        drop(begin(IfExists::Refuse).unwrap());
        assert_eq!(fs::read_dir(beside.path()).unwrap().count(), 0);
        make(IfExists::Refuse, b"one").unwrap();
        assert!(matches!(make(IfExists::Refuse, b"two"), Err(OutputError::FolderExists { .. })));
        make(IfExists::Replace, b"two").unwrap();
        assert_eq!(fs::read(path.join("inner/file")).unwrap(), b"two");
        fs::remove_file(path.join("mark")).unwrap();
        let error = make(IfExists::Replace, b"three").unwrap_err().to_string();
        assert!(error.contains("is not a test, so it is left alone"), "{error}");
        assert_eq!(fs::read_dir(beside.path()).unwrap().count(), 1);
        fs::remove_dir_all(&path).unwrap();
        fs::write(&path, "a file").unwrap();
        assert!(matches!(make(IfExists::Replace, b"four"), Err(OutputError::NotAFolder { .. })));
    }

    /// As any new folder is, and not for its owner alone.
    #[cfg(unix)]
    #[test]
    fn a_folder_heeds_the_umask() {
        use std::os::unix::fs::PermissionsExt;
        let beside = tempfile::tempdir().unwrap();
        let ours = FolderMark { name: "a test", is_ours: |_| true };
        let pending = PendingFolder::create(&beside.path().join("mine"), IfExists::Refuse, ours).unwrap();
        pending.finish().unwrap();
        fs::create_dir(beside.path().join("theirs")).unwrap();
        let mode = |name| fs::metadata(beside.path().join(name)).unwrap().permissions().mode();
        assert_eq!(mode("mine"), mode("theirs"));
    }

    #[test]
    fn what_is_in_the_way_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = |path: &Path| PendingFile::create(path, IfExists::Refuse).unwrap_err().to_string();
        assert!(error(folder.path()).contains("is a folder"));
        assert!(error(&folder.path().join("a/b.npy")).contains("does not exist: create it first"));
    }

    #[test]
    fn what_killed_runs_leave_is_swept() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x.npy");
        let left = temporary(&path).unwrap().keep().unwrap().1;
        assert!(left.file_name().unwrap().to_str().unwrap().starts_with("x.npy."));
        for mine in ["x.npy.partial", "x.npy.mine.partial", "y.npy.Ab12Cd.partial"] {
            fs::write(folder.path().join(mine), "mine").unwrap();
        }
        let living = PendingFile::create(&path, IfExists::Refuse).unwrap();
        drop(PendingFile::create(&path, IfExists::Refuse).unwrap());
        assert!(!cfg!(unix) || !left.exists());
        assert!(living.temporary_path().exists());
        drop(living);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3);
        let left = temporary(&path).unwrap().keep().unwrap().1;
        sweep(folder.path()).unwrap();
        assert!(!left.exists() && folder.path().join("x.npy.partial").exists());
    }

    #[test]
    fn the_longest_names_have_temporary_ones() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(format!("{}.npy", "ö".repeat(125)));
        write_file(&path, IfExists::Refuse, b"whole").unwrap();
        assert_eq!(fs::read(path).unwrap(), b"whole");
    }

    #[cfg(unix)]
    #[test]
    fn the_target_of_a_link_is_replaced_and_not_the_link() {
        let folder = tempfile::tempdir().unwrap();
        let [file, link] = ["file.csv", "link.csv"].map(|name| folder.path().join(name));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink("file.csv", &link).unwrap();
        assert!(matches!(write_file(&link, IfExists::Refuse, b"new"), Err(OutputError::Exists { .. })));
        write_file(&link, IfExists::Replace, b"new").unwrap();
        assert!(link.is_symlink() && fs::read(&file).unwrap() == b"new");
    }
}
