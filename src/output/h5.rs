//! HDF5: a data set per quantity, chunked by draws, with the wavelengths beside them, and the model, recipe and seed
//! as attributes. Files use the oldest generation of the format that can hold them, so that every reader knows it.

use std::io;
use std::path::Path;

use rust_hdf5::{DatatypeMessage, H5Dataset, H5File, Hdf5Error, LibverBound};

use super::Encoder;
use super::schema::{Field, Schema, SharedArray};
use crate::quantity::Dtype;

/// Approximate size of a chunk in bytes: that of the cache in most readers' library.
const CHUNK_BYTES: usize = 1 << 20;

pub(super) struct Hdf5 {
    file: H5File,
    tables: Tables,
}

impl Hdf5 {
    pub(super) fn begin(path: &Path, schema: &Schema) -> io::Result<Self> {
        let file = create(path, 0).map_err(io_error)?;
        let tables = Tables::new(&file, schema).map_err(io_error)?;
        let begin = || {
            for (field, table) in schema.fields.iter().zip(&tables.tables) {
                if let [_, axes @ ..] = field.axes("").as_slice()
                    && !axes.is_empty()
                {
                    text_attribute(&table.set, "axis", &axes.join(", "))?;
                }
            }
            for constant in &schema.shared {
                let set = self::constant(&file, constant)?;
                let axes: Vec<_> = constant.axes.iter().map(|(name, _)| name.as_str()).collect();
                text_attribute(&set, "axis", &axes.join(", "))?;
            }
            let wavelengths =
                file.new_dataset::<f64>().shape([schema.wavelengths.len()]).create("wavelength")?;
            wavelengths.write_raw(&schema.wavelengths)?;
            text_attribute(&wavelengths, "units", "nm")?;
            schema.attributes.iter().try_for_each(|(name, value)| {
                let text = value.as_str().map_or_else(|| value.to_string(), str::to_owned);
                file.set_attr_string(name, &text)
            })
        };
        begin().map_err(io_error)?;
        Ok(Hdf5 { file, tables })
    }
}

impl Encoder for Hdf5 {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        self.tables.write(columns).map_err(io_error)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.tables.finish().map_err(io_error)?;
        self.file.close_no_sync().map_err(io_error) // the name comes after a sync of its own
    }
}

/// Opens the temporary file as HDF5, with room for a header of its own before it.
pub(super) fn create(path: &Path, userblock: u64) -> Result<H5File, Hdf5Error> {
    let options = H5File::options().libver(LibverBound::Earliest).track_times(false).no_locking();
    options.userblock(userblock).create(path)
}

/// Writes an array that all draws share.
pub(super) fn constant(file: &H5File, constant: &SharedArray) -> Result<H5Dataset, Hdf5Error> {
    let shape: Vec<usize> = constant.shape().iter().map(|&n| n as usize).collect();
    let set = match constant.dtype {
        Dtype::F32 => file.new_dataset::<f32>().shape(shape).create(&constant.name)?,
        Dtype::F64 => file.new_dataset::<f64>().shape(shape).create(&constant.name)?,
        Dtype::U32 => file.new_dataset::<u32>().shape(shape).create(&constant.name)?,
        Dtype::F16 => {
            let f16 = DatatypeMessage::f16_type();
            file.new_dataset::<u16>().datatype(f16).shape(shape).create(&constant.name)?
        }
    };
    match constant.dtype {
        Dtype::F32 => set.write_raw(&bytemuck::pod_collect_to_vec::<u8, f32>(&constant.bytes))?,
        Dtype::F64 => set.write_raw(&bytemuck::pod_collect_to_vec::<u8, f64>(&constant.bytes))?,
        Dtype::F16 => set.write_raw(&bytemuck::pod_collect_to_vec::<u8, u16>(&constant.bytes))?,
        Dtype::U32 => set.write_raw(&bytemuck::pod_collect_to_vec::<u8, u32>(&constant.bytes))?,
    }
    Ok(set)
}

/// Data sets of a file, filled chunk by chunk.
pub(super) struct Tables {
    pub(super) tables: Vec<Table>,
}

pub(super) struct Table {
    pub(super) set: H5Dataset,
    field: Field,
    /// Size of a chunk in bytes.
    chunk: usize,
    /// Bytes that do not fill a chunk yet.
    rest: Vec<u8>,
    /// Number of chunks written.
    written: usize,
}

impl Tables {
    /// Creates a data set for each field of the schema.
    pub(super) fn new(file: &H5File, schema: &Schema) -> Result<Tables, Hdf5Error> {
        let table = |field: &Field| {
            let shape: Vec<usize> = field.shape(schema.count).iter().map(|&n| n as usize).collect();
            let rows = (CHUNK_BYTES / field.stored_bytes()).clamp(1, shape[0].max(1));
            let mut chunk = shape.clone();
            chunk[0] = rows;
            let set = match field.stored {
                Dtype::F16 => {
                    let f16 = DatatypeMessage::f16_type();
                    file.new_dataset::<u16>().datatype(f16).shape(shape).chunk(&chunk).create(&field.name)
                }
                Dtype::F32 => file.new_dataset::<f32>().shape(shape).chunk(&chunk).create(&field.name),
                Dtype::F64 => file.new_dataset::<f64>().shape(shape).chunk(&chunk).create(&field.name),
                Dtype::U32 => file.new_dataset::<u32>().shape(shape).chunk(&chunk).create(&field.name),
            }?;
            let chunk = rows * field.stored_bytes();
            Ok(Table { set, field: field.clone(), chunk, rest: Vec::new(), written: 0 })
        };
        Ok(Tables { tables: schema.fields.iter().map(table).collect::<Result<_, Hdf5Error>>()? })
    }

    pub(super) fn write(&mut self, columns: &[&[u8]]) -> Result<(), Hdf5Error> {
        self.tables.iter_mut().zip(columns).try_for_each(|(table, column)| table.write(column))
    }

    /// Writes the bytes that do not fill a chunk.
    pub(super) fn finish(&mut self) -> Result<(), Hdf5Error> {
        self.tables.iter_mut().try_for_each(|table| {
            let mut rest = std::mem::take(&mut table.rest);
            if rest.is_empty() {
                return Ok(());
            }
            rest.resize(table.chunk, 0);
            table.set.write_chunk(table.written, &rest)
        })
    }
}

impl Table {
    fn write(&mut self, column: &[u8]) -> Result<(), Hdf5Error> {
        let stored = self.field.store(column)?;
        let mut bytes = &*stored;
        while !bytes.is_empty() {
            let (part, after) = bytes.split_at(bytes.len().min(self.chunk - self.rest.len()));
            bytes = after;
            if part.len() == self.chunk {
                self.set.write_chunk(self.written, part)?;
                self.written += 1;
                continue;
            }
            self.rest.extend_from_slice(part);
            if self.rest.len() == self.chunk {
                self.set.write_chunk(self.written, &self.rest)?;
                self.written += 1;
                self.rest.clear();
            }
        }
        Ok(())
    }
}

/// Writes a text attribute of fixed length, in ASCII where that suffices.
pub(super) fn text_attribute(set: &H5Dataset, name: &str, text: &str) -> Result<(), Hdf5Error> {
    let charset = u8::from(!text.is_ascii());
    let datatype = DatatypeMessage::FixedString { size: text.len() as u32, padding: 1, charset };
    set.set_attr_typed(name, datatype, text.as_bytes().to_vec())
}

/// The I/O error within an error, or one around it.
pub(super) fn io_error(error: Hdf5Error) -> io::Error {
    match error {
        Hdf5Error::Io(error) => error,
        other => io::Error::other(other),
    }
}
