//! Version 7.3: HDF5 with a header and the classes of the variables.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rust_hdf5::{H5Dataset, H5File, Hdf5Error};

use super::Contents;
use crate::output::Encoder;
use crate::output::h5::{self, io_error};
use crate::quantity::Dtype;

/// Bytes before the HDF5 part: 116 characters of text, and a version.
const USERBLOCK: u64 = 512;

pub(super) struct Mat {
    file: H5File,
    tables: h5::Tables,
    path: PathBuf,
}

impl Mat {
    pub(super) fn begin(path: &Path, contents: &Contents) -> io::Result<Self> {
        let schema = &contents.schema;
        let file = h5::create(path, USERBLOCK).map_err(io_error)?;
        let tables = h5::Tables::new(&file, schema).map_err(io_error)?;
        let begin = || {
            for (field, table) in schema.fields.iter().zip(&tables.tables) {
                class(&table.set, matlab_class(field.stored))?;
                if field.name == "X" {
                    file.root_group().link("data", "X")?;
                }
            }
            for shared in &schema.shared {
                let set = h5::constant(&file, shared)?;
                class(&set, matlab_class(shared.dtype))?;
            }
            let wavelengths = &schema.wavelengths;
            row(&file, "wavelength", wavelengths, &[1, wavelengths.len()])?;
            if let Some((sampling, [rows, columns])) = contents.sampling() {
                // HDF5 names the dimensions in the other order.
                let shape = [columns as usize, rows as usize];
                contents.samplings.iter().try_for_each(|name| row(&file, name, &sampling, &shape))?;
            }
            comment(&file, &schema.attributes_text())
        };
        begin().map_err(io_error)?;
        Ok(Mat { file, tables, path: path.to_owned() })
    }
}

impl Encoder for Mat {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        self.tables.write(columns).map_err(io_error)
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.tables.finish().map_err(io_error)?;
        self.file.close_no_sync().map_err(io_error)?;
        // The time of MATLAB's own headers is left out: the same draws make the same file.
        let text = "MATLAB 7.3 MAT-file, Platform: spectroll, HDF5 schema 1.00 .";
        let version = [0x00, 0x02, b'I', b'M'];
        let header = [format!("{text:<116}").as_bytes(), &[0; 8], &version].concat();
        File::options().write(true).open(&self.path)?.write_all(&header)
    }
}

fn matlab_class(dtype: Dtype) -> &'static str {
    match dtype {
        Dtype::F32 => "single",
        Dtype::F64 => "double",
        Dtype::U32 => "uint32",
        Dtype::F16 => unreachable!("the format holds no halves: see FileFormat::check"),
    }
}

fn class(set: &H5Dataset, name: &str) -> Result<(), Hdf5Error> {
    h5::text_attribute(set, "MATLAB_class", name)
}

/// Writes a small matrix of doubles. HDF5's first dimension is MATLAB's last.
fn row(file: &H5File, name: &str, values: &[f64], shape: &[usize]) -> Result<(), Hdf5Error> {
    let set = file.new_dataset::<f64>().shape(shape).create(name)?;
    set.write_raw(values)?;
    class(&set, "double")
}

fn comment(file: &H5File, text: &str) -> Result<(), Hdf5Error> {
    let units: Vec<u16> = text.encode_utf16().collect();
    let set = file.new_dataset::<u16>().shape([units.len(), 1]).create("comment")?;
    set.write_raw(&units)?;
    class(&set, "char")?;
    const DECODED_AS_TEXT: i32 = 2;
    set.new_attr::<i32>().shape(()).create("MATLAB_int_decode")?.write_numeric(&DECODED_AS_TEXT)
}
