//! Files that somebody names, read with a limit: never a device that has no end, nor more than memory should hold.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

/// Places where a shell puts what it opened itself, as for `<(...)`: pipes there have a writer.
const OPENED: [&str; 3] = ["/dev/stdin", "/dev/fd/", "/proc/self/fd/"];

/// Reads a file of no more than `limit` bytes.
pub(crate) fn read(path: &Path, limit: u64) -> io::Result<Vec<u8>> {
    let (file, length) = open(path, limit)?;
    read_all(file, length, limit)
}

/// Reads an open file of no more than `limit` bytes to its end; its length is what it has, where that is known.
pub(crate) fn read_all(file: File, length: Option<u64>, limit: u64) -> io::Result<Vec<u8>> {
    let mut bytes = Vec::new();
    if let Some(length) = length {
        bytes.try_reserve_exact(length as usize + 1)?; // a byte more, so that the end is seen without growing
    }
    file.take(limit.saturating_add(1)).read_to_end(&mut bytes)?;
    match bytes.len() as u64 > limit {
        true => Err(too_large("more", limit)),
        false => Ok(bytes),
    }
}

/// Opens a file of no more than `limit` bytes; returns it with its length, which a pipe does not have.
pub(crate) fn open(path: &Path, limit: u64) -> io::Result<(File, Option<u64>)> {
    let found = fs::metadata(path)?;
    if found.is_dir() {
        return Err(io::ErrorKind::IsADirectory.into());
    }
    if !found.is_file() && !OPENED.iter().any(|opened| path.to_string_lossy().starts_with(opened)) {
        return Err(io::Error::other("it is a pipe or a device, and a plain file is needed"));
    }
    let length = found.is_file().then_some(found.len());
    match length {
        Some(length) if length > limit => Err(too_large(&length.to_string(), limit)),
        _ => Ok((File::open(path)?, length)),
    }
}

fn too_large(bytes: &str, limit: u64) -> io::Error {
    let text = format!("it has {bytes} bytes, and no more than {limit} are read");
    io::Error::new(io::ErrorKind::FileTooLarge, text)
}

/// Reads a text of no more than `limit` bytes, in UTF-8.
pub fn read_text(path: impl AsRef<Path>, limit: u64) -> io::Result<String> {
    let bytes = read(path.as_ref(), limit)?;
    String::from_utf8(bytes).map_err(|e| {
        let at = e.utf8_error().valid_up_to();
        io::Error::new(io::ErrorKind::InvalidData, format!("byte {} is not UTF-8 text", at + 1))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_are_read_to_their_limit() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("x");
        fs::write(&path, "12345678").unwrap();
        assert_eq!(read_text(&path, 8).unwrap(), "12345678");
        let error = read_text(&path, 7).unwrap_err();
        assert_eq!(error.kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(error.to_string(), "it has 8 bytes, and no more than 7 are read");
        fs::write(&path, b"ab\xff").unwrap();
        assert_eq!(read_text(&path, 8).unwrap_err().to_string(), "byte 3 is not UTF-8 text");
        // A file of a terabyte that has no bytes on the disk.
        File::create(&path).unwrap().set_len(1 << 40).unwrap();
        assert_eq!(read(&path, 1 << 20).unwrap_err().kind(), io::ErrorKind::FileTooLarge);
        assert_eq!(read(folder.path(), 8).unwrap_err().kind(), io::ErrorKind::IsADirectory);
    }

    #[cfg(unix)]
    #[test]
    fn what_has_no_end_is_not_read() {
        let folder = tempfile::tempdir().unwrap();
        let pipe = folder.path().join("pipe");
        assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
        for path in [pipe.as_path(), Path::new("/dev/zero")] {
            assert!(read(path, 8).unwrap_err().to_string().contains("a plain file is needed"));
        }
    }
}
