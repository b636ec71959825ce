//! Files that are downloaded, made by the library's own writers.

use std::cell::RefCell;
use std::io::{self, Write};
use std::rc::Rc;

use spectroll::output::{FileFormat, Schema, StreamWriter};
use wasm_bindgen::prelude::wasm_bindgen;

use crate::refusal::Refusal;

/// A file that is being written, of which the page takes the bytes as they come.
#[wasm_bindgen]
pub struct Export {
    writer: StreamWriter,
    bytes: Bytes,
}

/// Bytes that a writer has written and the page has not taken.
#[derive(Clone, Default)]
struct Bytes(Rc<RefCell<Vec<u8>>>);

impl Write for Bytes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.0.borrow_mut().extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl Export {
    pub(crate) fn new(format: FileFormat, schema: &Schema) -> Result<Export, Refusal> {
        let bytes = Bytes::default();
        let writer = StreamWriter::new(bytes.clone(), format, schema).map_err(Refusal::new)?;
        Ok(Export { writer: writer.map_err(Refusal::new)?, bytes })
    }
}

#[wasm_bindgen]
impl Export {
    /// Writes the column of the next draws, and returns the bytes that the file grew by.
    pub fn write(&mut self, column: &[u8]) -> Result<Vec<u8>, Refusal> {
        self.writer.write(&[column]).map_err(Refusal::new)?;
        Ok(self.bytes.0.take())
    }

    /// Ends the file, and returns its last bytes.
    pub fn finish(self) -> Result<Vec<u8>, Refusal> {
        self.writer.finish().map_err(Refusal::new)?;
        Ok(self.bytes.0.take())
    }
}
