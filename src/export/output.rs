//! Destination of a data set, and how it is written there.

use std::path::{Path, PathBuf};

use super::{Companions, SpaceCheck};
use crate::output::{
    ChunkFormat, FileFormat, IfExists, OutputError, Schema, SetMode, SetPlan, Shard, spd_files,
};
use crate::quantity::{Dtype, Quantity};

/// The kind of thing that is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Destination {
    /// Standard output, as it is drawn.
    Stdout(FileFormat),
    /// A single file.
    File(FileFormat),
    /// A folder of text files, one a spectrum.
    SpdFolder,
    /// A set of chunks.
    Set(ChunkFormat),
}

impl Destination {
    /// Whether what all rows share can be kept once, rather than in every row.
    pub fn holds_shared_arrays(self) -> bool {
        match self {
            Destination::Stdout(_) | Destination::Set(ChunkFormat::Parquet) => false,
            Destination::File(format) => {
                !matches!(format, FileFormat::Csv | FileFormat::Parquet | FileFormat::Npy)
            }
            Destination::SpdFolder | Destination::Set(_) => true,
        }
    }
}

/// Destination of a data set, and how it is written there. See [`Output::to`].
#[derive(Clone, Debug)]
pub struct Output {
    pub(super) path: PathBuf,
    pub(super) destination: Destination,
    pub(super) dtype: Dtype,
    chunk: Option<u64>,
    pub(super) shard: Shard,
    pub(super) mode: SetMode,
    pub(super) space_check: SpaceCheck,
    pub(super) has_sidecar: bool,
}

impl Output {
    /// A file, or a set of chunks, in the format that the extension of `path` names: float32, all of it, and only if
    /// nothing of that name exists.
    pub fn to(path: impl AsRef<Path>) -> Result<Output, OutputError> {
        let path = path.as_ref();
        let destination = match FileFormat::of(path)? {
            FileFormat::Zarr => Destination::Set(ChunkFormat::Zarr { zstd: None }),
            FileFormat::Spd => Destination::SpdFolder,
            file => Destination::File(file),
        };
        Ok(Output::at(path, destination))
    }

    /// Writes to `path` as a `destination`; standard output needs no path.
    pub fn at(path: impl AsRef<Path>, destination: Destination) -> Output {
        Output {
            path: path.as_ref().to_owned(),
            destination,
            dtype: Dtype::F32,
            chunk: None,
            shard: Shard::WHOLE,
            mode: SetMode::Create,
            space_check: SpaceCheck::default(),
            has_sidecar: false,
        }
    }

    /// The type of the numbers ([`Dtype::F32`]). [`Dtype::F16`] is that of spectra alone: beside them, labels such as
    /// luminous reflectances and XYZ stay float32.
    pub fn dtype(self, dtype: Dtype) -> Self {
        Output { dtype, ..self }
    }

    /// The number of rows in each chunk of a set, at least 1 and at most all (what makes about 16 MiB).
    pub fn chunk(self, rows: u64) -> Self {
        Output { chunk: Some(rows.max(1)), ..self }
    }

    /// The part of a set that this process makes ([`Shard::WHOLE`]).
    pub fn shard(self, shard: Shard) -> Self {
        Output { shard, ..self }
    }

    /// Sets what happens to a data set that exists already ([`SetMode::Create`]). Only sets can be resumed.
    pub fn mode(self, mode: SetMode) -> Self {
        Output { mode, ..self }
    }

    /// Check of the room for the data set before it is begun ([`SpaceCheck::Require`]).
    pub fn space_check(self, space_check: SpaceCheck) -> Self {
        Output { space_check, ..self }
    }

    /// Writes a [`Sidecar`](crate::output::Sidecar) beside a single file. Sets have manifests instead.
    pub fn with_sidecar(self) -> Self {
        Output { has_sidecar: true, ..self }
    }

    /// The path.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// The kind of thing that is written.
    pub fn destination(&self) -> Destination {
        self.destination
    }

    /// The part of a set that this process makes.
    pub fn part(&self) -> Shard {
        self.shard
    }

    /// The type that the floats of a quantity are written as. Labels are few beside spectra, and half precision would
    /// tell an LRV of 0.4 to three digits.
    pub(super) fn stored(&self, quantity: Quantity) -> Dtype {
        match (self.dtype, quantity) {
            (Dtype::F16, Quantity::Spectra | Quantity::ColorSignal) => Dtype::F16,
            (Dtype::F16, _) => Dtype::F32,
            (dtype, _) => dtype,
        }
    }

    /// Refuses what the destination cannot hold.
    pub fn check(&self, schema: &Schema, companions: &Companions) -> Result<(), OutputError> {
        let file = |format: FileFormat| format.check(&self.path, schema, &companions.spectra);
        match self.destination {
            Destination::Stdout(format) if !format.is_streamed() => Err(OutputError::NotStreamed),
            Destination::Stdout(format) | Destination::File(format) => file(format),
            Destination::SpdFolder => file(FileFormat::Spd),
            Destination::Set(_) => self.plan(schema).expect("the destination is a set").check(&self.path),
        }
    }

    /// The number of files in a folder of text files; `None` of anything else.
    pub fn text_files(&self, schema: &Schema, companions: &Companions) -> Option<u64> {
        (self.destination == Destination::SpdFolder).then(|| spd_files(schema, &companions.spectra))
    }

    /// The plan of a set; `None` of anything else.
    pub fn plan(&self, schema: &Schema) -> Option<SetPlan> {
        let Destination::Set(layout) = self.destination else { return None };
        let default = || ChunkFormat::default_chunk(schema.row_bytes(), schema.count);
        let chunk = self.chunk.unwrap_or_else(default).min(schema.count.max(1));
        Some(SetPlan { layout, chunk, schema: schema.clone() })
    }

    pub(super) fn if_exists(&self) -> IfExists {
        match self.mode {
            SetMode::Replace => IfExists::Replace,
            SetMode::Create | SetMode::Resume => IfExists::Refuse,
        }
    }
}
