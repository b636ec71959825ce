//! BLAKE3 sums of files, and texts in JSON that end with their own.

use std::fs::{self, File};
use std::io::{self, Read};
use std::path::Path;

use serde::{Deserialize, Serialize};

/// Largest manifest that is read, in bytes.
pub(super) const LARGEST: u64 = 1 << 30;

/// Bytes of a file that are summed at once.
const BUFFER: usize = 1 << 20;

/// End of a text after its sum.
const END: &str = "\"\n}\n";

/// Sum of a file, as it was written.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(super) struct Sum {
    pub(super) name: String,
    pub(super) bytes: u64,
    pub(super) blake3: String,
}

impl Sum {
    pub(super) fn new(name: &str, bytes: &[u8]) -> Sum {
        let blake3 = blake3::hash(bytes).to_hex().to_string();
        Sum { name: name.to_owned(), bytes: bytes.len() as u64, blake3 }
    }

    /// Describes how the file in a set differs from what was written, if it does.
    pub(super) fn fault(&self, root: &Path) -> Option<String> {
        self.open(root).map_or_else(Some, |file| self.fault_of(file))
    }

    /// Opens the file in a set, if it has its size; else describes what is wrong.
    pub(super) fn open(&self, root: &Path) -> Result<File, String> {
        match self.size_fault(root) {
            Some(fault) => Err(fault),
            None => File::open(root.join(&self.name)).map_err(|e| self.unreadable(&e)),
        }
    }

    /// Describes how an open file of the right size differs from what was written, if it does.
    pub(super) fn fault_of(&self, file: File) -> Option<String> {
        match hash(file, self.bytes) {
            Ok(sum) if sum == self.blake3 => None,
            Ok(_) => Some(format!("{} does not match its BLAKE3 sum", self.name)),
            Err(e) => Some(self.unreadable(&e)),
        }
    }

    fn unreadable(&self, error: &io::Error) -> String {
        format!("{} cannot be read: {error}", self.name)
    }

    /// Describes how the file's size differs from what was written, or whether it is missing. Reads no file, and so
    /// waits for none.
    pub(super) fn size_fault(&self, root: &Path) -> Option<String> {
        match fs::metadata(root.join(&self.name)) {
            Ok(found) if !found.is_file() => Some(format!("{} is not a plain file", self.name)),
            Ok(found) if found.len() != self.bytes => {
                Some(format!("{} has {} bytes instead of {}", self.name, found.len(), self.bytes))
            }
            Ok(_) => None,
            Err(e) if e.kind() == io::ErrorKind::NotFound => Some(format!("{} is missing", self.name)),
            Err(e) => Some(self.unreadable(&e)),
        }
    }

    /// Sum of a file as it is, under another name.
    pub(super) fn of_file(name: &str, path: &Path) -> io::Result<Sum> {
        let bytes = fs::metadata(path)?.len();
        Ok(Sum { name: name.to_owned(), bytes, blake3: hash(File::open(path)?, bytes)? })
    }
}

/// BLAKE3 sum of a file, of no more than a number of bytes.
fn hash(file: File, bytes: u64) -> io::Result<String> {
    let mut file = file.take(bytes);
    let (mut hasher, mut buffer) = (blake3::Hasher::new(), vec![0; BUFFER.min(bytes as usize + 1)]);
    loop {
        match file.read(&mut buffer) {
            Ok(0) => return Ok(hasher.finalize().to_hex().to_string()),
            Ok(read) => _ = hasher.update(&buffer[..read]),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
}

/// Text of a value whose last entry is an empty text, with the sum of that text in this entry.
pub(super) fn signed(value: &impl Serialize) -> String {
    let text = serde_json::to_string_pretty(value).expect("the value is JSON") + "\n";
    let sum = blake3::hash(text.as_bytes()).to_hex();
    let start = text.strip_suffix(END).expect("the sum is the last entry");
    format!("{start}{sum}{END}")
}

/// Whether a text is as [`signed`] made it, with this sum.
pub(super) fn is_signed(text: &str, sum: &str) -> bool {
    let unsigned = text.strip_suffix(&format!("{sum}{END}")).map(|start| format!("{start}{END}"));
    unsigned.is_some_and(|unsigned| blake3::hash(unsigned.as_bytes()).to_hex().as_str() == sum)
}
