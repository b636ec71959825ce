//! Text: a header of wavelengths in nm, then a line a spectrum, each value the shortest decimal that reads back as
//! the same f32.

use std::io::{self, Write};

use crate::engine::Batch;
use crate::grid::Grid;

pub(super) fn begin(to: &mut dyn Write, grid: Grid) -> io::Result<()> {
    lines(to, [grid.wavelengths().map(|w| w.to_string())])
}

pub(super) fn write(to: &mut dyn Write, batch: &Batch) -> io::Result<()> {
    let bands = batch.spectra().len() / batch.draws.count as usize;
    let spectra = batch.spectra().chunks_exact(bands);
    lines(to, spectra.map(|spectrum| spectrum.iter().map(|value| value.to_string())))
}

fn lines<L: IntoIterator<Item = String>>(
    to: &mut dyn Write,
    lines: impl IntoIterator<Item = L>,
) -> io::Result<()> {
    let mut writer = ::csv::Writer::from_writer(to);
    for line in lines {
        // The crate's own conversion would hide what kind of error it was.
        writer.write_record(line).map_err(|e| match e.into_kind() {
            ::csv::ErrorKind::Io(error) => error,
            other => io::Error::other(format!("{other:?}")),
        })?;
    }
    writer.flush()
}
