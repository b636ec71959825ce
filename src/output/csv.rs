//! Text: a header of wavelengths in nm, then a line a spectrum, each value the shortest decimal that reads back as the
//! same f32.

use std::io::{self, Write};

use crate::engine::Batch;
use crate::grid::Grid;

pub(super) fn begin(to: &mut dyn Write, grid: Grid) -> io::Result<()> {
    let mut writer = ::csv::Writer::from_writer(to);
    writer.write_record(grid.wavelengths().map(|w| w.to_string()))?;
    writer.flush()
}

pub(super) fn write(to: &mut dyn Write, batch: &Batch) -> io::Result<()> {
    let mut writer = ::csv::Writer::from_writer(to);
    for spectrum in batch.spectra.chunks_exact(batch.bands()) {
        writer.write_record(spectrum.iter().map(|value| value.to_string()))?;
    }
    writer.flush()
}
