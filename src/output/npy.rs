//! NumPy's `.npy`: float32, (draws, bands), C order. The `npyz` crate writes the header; what follows is the bytes of
//! the spectra as they are.

use std::io::{self, Write};

use npyz::WriterBuilder;

use crate::engine::Batch;
use crate::grid::Grid;

pub(super) fn begin(to: &mut dyn Write, grid: Grid, count: u64) -> io::Result<()> {
    let dtype = npyz::DType::Plain("<f4".parse().expect("it is one of NumPy's types"));
    let options = npyz::WriteOptions::new_header_only();
    options.dtype(dtype).shape(&[count, grid.len() as u64]).writer(to).write_header_only()?;
    Ok(())
}

pub(super) fn write(to: &mut dyn Write, batch: &Batch) -> io::Result<()> {
    if cfg!(target_endian = "little") {
        return to.write_all(bytemuck::cast_slice(batch.spectra()));
    }
    batch.spectra().iter().try_for_each(|value| to.write_all(&value.to_le_bytes()))
}
