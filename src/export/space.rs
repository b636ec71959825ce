//! Room on disk: how much a data set takes, and whether that is there, before anything is drawn.

use serde::Serialize;

use super::{Companions, Destination, Output};
use crate::output::{ByteCount, ChunkFormat, Field, FileFormat, OutputError, Schema, available_space};
use crate::quantity::Dtype;

/// Zstandard packs draws by a tenth and counts to a twentieth. Nothing that people draw is packed further than this, so
/// that what has no room even then is refused, and nothing else.
const PACKED: u64 = 4;

/// Numbers as text may be shorter than is estimated, though hardly half as long.
const TEXT: u64 = 2;

/// Bytes that a small file takes on most file systems.
const BLOCK: u64 = 4096;

/// Bytes of the wavelength on each line of a text file, with what sets it apart.
const WAVELENGTH: u64 = 5;

/// Treatment of an export that may not fit on the disk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SpaceCheck {
    /// Refuse what cannot fit.
    #[default]
    Require,
    /// The export begins, and fails when the disk is full.
    Skip,
}

/// Space that an export takes, and space that there is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Space {
    /// Bytes that this run would write. Numbers are counted exactly, without headers; text and packed chunks are
    /// estimated, the latter as if they were not packed.
    pub bytes: u64,
    /// Bytes without which the run cannot end: a quarter of [`bytes`](Self::bytes) where chunks are packed, half where
    /// numbers are text, and all elsewhere.
    pub least: u64,
    /// Bytes that are free in the output's folder; `None` where that cannot be told, or is of no account.
    pub free: Option<u64>,
}

impl Space {
    /// Whether the run can end, as far as that can be told.
    pub fn fits(&self) -> bool {
        self.free.is_none_or(|free| free >= self.least)
    }
}

impl Output {
    /// The space that this run would take, and that there is. Of a set, the chunks of its shard count that no earlier
    /// run has made.
    pub fn space(&self, schema: &Schema, companions: &Companions) -> Space {
        let shared = schema.shared.iter().map(|array| {
            let values: u64 = array.axes.iter().map(|(_, extent)| extent).product();
            values * array.dtype.size() as u64
        });
        let rows = schema.count.saturating_mul(schema.row_bytes()).saturating_add(shared.clone().sum());
        let text: u64 = schema.fields.iter().map(text_bytes).sum();
        let (bytes, factor) = match self.destination {
            Destination::Stdout(FileFormat::Csv) | Destination::File(FileFormat::Csv) => {
                (schema.count.saturating_mul(text), TEXT)
            }
            Destination::Stdout(_) | Destination::File(_) => (rows, 1),
            Destination::SpdFolder => {
                let files = self.text_files(schema, companions).unwrap_or_default();
                let line = WAVELENGTH + digits(self.dtype);
                let file = (schema.wavelengths.len() as u64 * line).next_multiple_of(BLOCK);
                (files.saturating_mul(file), TEXT)
            }
            Destination::Set(format) => {
                let plan = self.plan(schema).expect("the destination is a set");
                let chunks = plan.missing(&self.path, self.shard, self.mode);
                // The last chunk of a Zarr store is as long as the others.
                let rows = match format {
                    ChunkFormat::Zarr { .. } => chunks.saturating_mul(plan.chunk),
                    ChunkFormat::Npy | ChunkFormat::Parquet => {
                        chunks.saturating_mul(plan.chunk).min(schema.count)
                    }
                };
                let bytes = rows.saturating_mul(schema.row_bytes()).saturating_add(shared.sum());
                (bytes, if matches!(format, ChunkFormat::Zarr { zstd: Some(_) }) { PACKED } else { 1 })
            }
        };
        let free = match self.destination {
            Destination::Stdout(_) => None,
            _ => available_space(&self.path),
        };
        Space { bytes, least: bytes / factor, free }
    }

    /// Refuses what does not fit, unless [`SpaceCheck::Skip`] says otherwise.
    pub fn check_space(&self, schema: &Schema, companions: &Companions) -> Result<(), OutputError> {
        let space = self.space(schema, companions);
        match space.free {
            Some(free) if self.space_check == SpaceCheck::Require && !space.fits() => {
                Err(OutputError::NoSpace {
                    path: self.path.clone(),
                    bound: if space.least < space.bytes { "at least " } else { "" },
                    needs: ByteCount(space.least),
                    free: ByteCount(free),
                })
            }
            _ => Ok(()),
        }
    }
}

/// Bytes of a field of one row as text.
fn text_bytes(field: &Field) -> u64 {
    field.width as u64 * digits(field.stored)
}

/// About the bytes of a number as text, with what sets it apart.
fn digits(dtype: Dtype) -> u64 {
    match dtype {
        Dtype::F16 | Dtype::F32 => 11,
        Dtype::F64 => 20,
        Dtype::U32 => 2,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::output::{SetMode, Shard};

    fn schema(count: u64) -> Schema {
        Schema {
            fields: vec![Field::vector("spectra", "wavelength", 31, Dtype::F32)],
            row: "draw".to_owned(),
            shared: Vec::new(),
            count,
            wavelengths: vec![400.0; 31],
            attributes: serde_json::Map::new(),
        }
    }

    fn companions() -> Companions {
        Companions { spectra: Vec::new(), first: 0, files: Vec::new() }
    }

    #[test]
    fn sizes_are_those_of_what_this_run_would_write() {
        let folder = tempfile::tempdir().unwrap();
        let bytes = |name: &str, change: fn(Output) -> Output| {
            let output = change(Output::to(folder.path().join(name)).unwrap());
            output.space(&schema(1000), &companions()).bytes
        };
        assert_eq!(bytes("a.npy", |output| output), 124_000);
        assert_eq!(bytes("a.zarr", |output| output.chunk(300)), 4 * 300 * 124);
        let shard = |output: Output| output.chunk(300).shard(Shard { index: 1, count: 4 });
        assert_eq!(bytes("a.zarr", shard), 300 * 124);
        assert_eq!(bytes("a.zarr", |output| output.chunk(u64::MAX)), 124_000);
    }

    #[test]
    fn what_cannot_fit_is_refused_unless_the_host_insists() {
        let folder = tempfile::tempdir().unwrap();
        let huge = schema(1 << 50);
        let path = folder.path().join("training.zarr");
        let error = |output: &Output| output.check_space(&huge, &companions()).unwrap_err().to_string();
        let output = Output::to(&path).unwrap().mode(SetMode::Resume);
        let text = error(&output);
        assert!(text.contains("training.zarr needs 140 PB and ") && text.ends_with(" free here"), "{text}");
        let zstd = Output::at(&path, Destination::Set(ChunkFormat::Zarr { zstd: Some(3) }));
        assert!(error(&zstd).contains("training.zarr needs at least 34.9 PB and "), "{}", error(&zstd));
        output.space_check(SpaceCheck::Skip).check_space(&huge, &companions()).unwrap();
        // There is no telling of a folder that does not exist, nor of standard output.
        for output in [
            Output::to(folder.path().join("no/such.npy")).unwrap(),
            Output::at("-", Destination::Stdout(FileFormat::Csv)),
        ] {
            output.check_space(&huge, &companions()).unwrap();
        }
    }
}
