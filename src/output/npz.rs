//! NumPy's `.npz`: an array per quantity, the wavelengths, and the model, recipe and seed as text.
//!
//! Arrays stand in the file one after another, but arrive side by side. Their sizes are known, so the places of all
//! of them are, and each window goes to several of them; only the checksums wait for the end. (The crates that write
//! zip files want an entry to end before the next begins.) Nothing is compressed, and every size is of 64 bits.

use std::io::{self, Seek, SeekFrom, Write};

use crc32fast::Hasher;

use super::Encoder;
use super::npy;
use super::schema::Schema;

/// An array in the file.
struct Entry {
    name: String,
    /// Offset of its local header.
    offset: u64,
    /// Offset of its next bytes.
    next: u64,
    /// Size of the array with its `.npy` header.
    size: u64,
    checksum: Hasher,
}

pub(super) struct Npz<W> {
    to: W,
    schema: Schema,
    /// Entries of the schema's fields, followed by the other entries.
    entries: Vec<Entry>,
    end: u64,
}

impl<W: Write + Seek> Npz<W> {
    pub(super) fn begin(to: W, schema: &Schema) -> io::Result<Self> {
        let mut npz = Npz { to, schema: schema.clone(), entries: Vec::new(), end: 0 };
        for field in &schema.fields {
            let header = npy::header(npy::type_string(field.stored), &field.shape(schema.count));
            npz.add(&field.name, &header, schema.count * field.stored_bytes() as u64)?;
        }
        let wavelengths: Vec<u8> = schema.wavelengths.iter().flat_map(|w| w.to_le_bytes()).collect();
        let array = npy::file("<f8", &[schema.wavelengths.len() as u64], &wavelengths);
        npz.add("wavelength", &array, 0)?;
        for constant in &schema.shared {
            let dtype = npy::type_string(constant.dtype);
            npz.add(&constant.name, &npy::file(dtype, &constant.shape(), &constant.bytes), 0)?;
        }
        let text: Vec<char> = schema.attributes_text().chars().collect();
        let utf32: Vec<u8> = text.iter().flat_map(|&c| u32::from(c).to_le_bytes()).collect();
        npz.add("attributes", &npy::file(&format!("<U{}", text.len()), &[], &utf32), 0)?;
        Ok(npz)
    }

    /// Adds an array that begins with `start` and has `rest` more bytes to come.
    fn add(&mut self, name: &str, start: &[u8], rest: u64) -> io::Result<()> {
        let mut entry = Entry {
            name: format!("{name}.npy"),
            offset: self.end,
            next: 0,
            size: start.len() as u64 + rest,
            checksum: Hasher::new(),
        };
        entry.next = self.end + entry.local_header(0).len() as u64;
        self.end = entry.next + entry.size;
        self.entries.push(entry);
        self.append(self.entries.len() - 1, start)
    }

    fn append(&mut self, entry: usize, bytes: &[u8]) -> io::Result<()> {
        let entry = &mut self.entries[entry];
        self.to.seek(SeekFrom::Start(entry.next))?;
        self.to.write_all(bytes)?;
        entry.next += bytes.len() as u64;
        entry.checksum.update(bytes);
        Ok(())
    }
}

impl<W: Write + Seek> Encoder for Npz<W> {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        for (i, column) in columns.iter().enumerate() {
            let field = self.schema.fields[i].clone();
            self.append(i, &field.store(column)?)?;
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        let mut directory = Vec::new();
        for entry in &self.entries {
            let checksum = entry.checksum.clone().finalize();
            self.to.seek(SeekFrom::Start(entry.offset))?;
            self.to.write_all(&entry.local_header(checksum))?;
            directory.extend(entry.central_header(checksum));
        }
        self.to.seek(SeekFrom::Start(self.end))?;
        self.to.write_all(&directory)?;
        self.to.write_all(&trailer(self.entries.len() as u64, directory.len() as u64, self.end))?;
        self.to.flush()
    }
}

/// First version of the zip format that has 64-bit sizes.
const VERSION: u16 = 45;

/// Marks a size that stands in the extra field.
const ELSEWHERE: u32 = u32::MAX;

impl Entry {
    /// Header bytes from the version to the length of the name, which both headers share.
    fn common(&self, checksum: u32) -> Vec<u8> {
        const FLAGS_AND_METHOD: u32 = 0; // stored
        const TIME_AND_DATE: u32 = 0x0021_0000; // the first of 1980: the same draws make the same file
        let mut bytes = VERSION.to_le_bytes().to_vec();
        for word in [FLAGS_AND_METHOD, TIME_AND_DATE, checksum, ELSEWHERE, ELSEWHERE] {
            bytes.extend(word.to_le_bytes());
        }
        bytes.extend((self.name.len() as u16).to_le_bytes());
        bytes
    }

    /// Encodes the extra field of 64-bit numbers.
    fn extra(numbers: &[u64]) -> Vec<u8> {
        let mut bytes = [1u16.to_le_bytes(), (8 * numbers.len() as u16).to_le_bytes()].concat();
        numbers.iter().for_each(|number| bytes.extend(number.to_le_bytes()));
        bytes
    }

    fn local_header(&self, checksum: u32) -> Vec<u8> {
        let extra = Self::extra(&[self.size, self.size]);
        [
            b"PK\x03\x04".to_vec(),
            self.common(checksum),
            (extra.len() as u16).to_le_bytes().to_vec(),
            self.name.clone().into_bytes(),
            extra,
        ]
        .concat()
    }

    fn central_header(&self, checksum: u32) -> Vec<u8> {
        const COMMENT_DISK_AND_ATTRIBUTES: [u8; 10] = [0; 10];
        let extra = Self::extra(&[self.size, self.size, self.offset]);
        [
            b"PK\x01\x02".to_vec(),
            VERSION.to_le_bytes().to_vec(),
            self.common(checksum),
            (extra.len() as u16).to_le_bytes().to_vec(),
            COMMENT_DISK_AND_ATTRIBUTES.to_vec(),
            ELSEWHERE.to_le_bytes().to_vec(),
            self.name.clone().into_bytes(),
            extra,
        ]
        .concat()
    }
}

/// End of the file: the place of the directory in 64 bits, the place of that record, and the mark of every zip file.
fn trailer(entries: u64, directory_bytes: u64, directory_offset: u64) -> Vec<u8> {
    let mut bytes = b"PK\x06\x06".to_vec();
    bytes.extend(44u64.to_le_bytes());
    bytes.extend([VERSION.to_le_bytes(), VERSION.to_le_bytes()].concat());
    bytes.extend([0; 8]); // both on disk 0
    for number in [entries, entries, directory_bytes, directory_offset] {
        bytes.extend(number.to_le_bytes());
    }
    bytes.extend(b"PK\x06\x07\0\0\0\0");
    bytes.extend((directory_offset + directory_bytes).to_le_bytes());
    bytes.extend(1u32.to_le_bytes());
    bytes.extend(b"PK\x05\x06\0\0\0\0");
    bytes.extend([0xFF; 12]);
    bytes.extend([0; 2]);
    bytes
}
