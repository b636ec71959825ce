//! MATLAB v7.3: HDF5 with a header and the classes of the variables.
//!
//! By the names that two toolboxes look for. Psychtoolbox: spectra in the columns of `X`, and `S_X` = [start step
//! count] beside it. ISET: `wavelength`, `data` (which is `X` under a second name, and takes no room) and `comment`.
//! Other quantities have their own names, and their draws in columns as well: MATLAB counts down the columns first, so
//! that is the order in which draws come.

use std::fs::File;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use rust_hdf5::{H5Dataset, H5File, Hdf5Error};

use super::Encoder;
use super::h5::{self, io_error};
use super::schema::Schema;
use crate::quantity::Dtype;

/// Bytes before the HDF5 part: 116 characters of text, and a version.
const USERBLOCK: u64 = 512;

pub(super) struct Mat {
    file: H5File,
    tables: h5::Tables,
    path: PathBuf,
}

impl Mat {
    pub(super) fn begin(path: &Path, schema: &Schema) -> io::Result<Self> {
        let mut schema = schema.clone();
        for field in &mut schema.fields {
            if field.name == "spectra" {
                field.name = "X".to_owned();
            }
            // Every array of MATLAB's has two dimensions.
            if !field.is_list() {
                field.axis = Some("value".to_owned());
            }
        }
        let file = h5::create(path, USERBLOCK).map_err(io_error)?;
        let tables = h5::Tables::new(&file, &schema).map_err(io_error)?;
        let begin = || {
            for (field, table) in schema.fields.iter().zip(&tables.tables) {
                class(&table.set, matlab_class(field.stored))?;
                if field.name == "X" {
                    file.root_group().link("data", "X")?;
                }
            }
            for constant in &schema.shared {
                let mut constant = constant.clone();
                if constant.axes.len() == 1 {
                    constant.axes.push(("value".to_owned(), 1));
                }
                let set = h5::constant(&file, &constant)?;
                class(&set, matlab_class(constant.dtype))?;
            }
            let wavelengths = &schema.wavelengths;
            row(&file, "wavelength", wavelengths, &[1, wavelengths.len()])?;
            if let [first, ..] = wavelengths[..] {
                let step = wavelengths.get(1).map_or(1.0, |second| second - first);
                row(&file, "S_X", &[first, step, wavelengths.len() as f64], &[3, 1])?;
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
        Dtype::F16 => unreachable!("the format holds no halves: see Format::check"),
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
