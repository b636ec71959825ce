//! Files of a set in each format of its chunks.

use std::borrow::Cow;
use std::io;

use serde::{Deserialize, Serialize};

use super::super::sum::Sum;
use super::{SetPlan, parts, zarr};

/// Approximate default size of a chunk in bytes: large enough for a disk, small enough to hold several.
const CHUNK_BYTES: u64 = 16 << 20;

/// The most bytes of a chunk of more than one draw: four are in memory at once.
pub(super) const MOST_CHUNK_BYTES: u64 = 1 << 30;

/// The most chunks of a set: its manifest has an entry for each, and its folder a file.
pub(super) const MOST_CHUNKS: u64 = 1_000_000;

/// Format of a set's chunks.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum ChunkFormat {
    /// A Zarr store, version 3, compressed by Zstandard where a level is given.
    Zarr {
        /// Zstandard level.
        zstd: Option<i32>,
    },
    /// A folder of `.npy` files.
    Npy,
    /// A folder of `.parquet` files.
    Parquet,
}

/// A file of a set.
pub(super) struct Part<'a> {
    /// Path in the set's folder.
    pub(super) name: String,
    pub(super) bytes: Cow<'a, [u8]>,
}

impl Part<'_> {
    pub(super) fn sum(&self) -> Sum {
        Sum::new(&self.name, &self.bytes)
    }
}

impl ChunkFormat {
    /// Default number of draws per chunk, for rows of `row_bytes` and `count` draws in all: a power of two of about 16
    /// MiB, or what makes no more than a million chunks if those have no more than 1 GiB, or all.
    pub fn default_chunk(row_bytes: u64, count: u64) -> u64 {
        let usual = 1 << (CHUNK_BYTES / row_bytes.max(1)).max(1).ilog2();
        let least = count.div_ceil(MOST_CHUNKS).checked_next_power_of_two().unwrap_or(count);
        let most = 1 << (MOST_CHUNK_BYTES / row_bytes.max(1)).max(1).ilog2();
        least.max(usual).min(most).min(count.max(1))
    }

    /// Encodes the files of a chunk.
    pub(super) fn encode<'a>(
        self,
        plan: &SetPlan,
        index: u64,
        columns: &'a [Vec<u8>],
    ) -> io::Result<Vec<Part<'a>>> {
        match self {
            ChunkFormat::Zarr { zstd } => zarr::chunk(&plan.schema, zstd, plan.chunk, index, columns),
            ChunkFormat::Npy => parts::npy(&plan.schema, index, columns),
            ChunkFormat::Parquet => parts::parquet(&plan.schema, index, columns),
        }
    }

    /// Names of the files of a chunk, in the order in which they are encoded.
    pub(super) fn names(self, plan: &SetPlan, index: u64) -> Vec<String> {
        let fields = plan.schema.fields.iter();
        match self {
            ChunkFormat::Zarr { .. } => fields.map(|field| zarr::chunk_name(field, index)).collect(),
            ChunkFormat::Npy => fields.map(|field| parts::npy_name(field, index)).collect(),
            ChunkFormat::Parquet => vec![parts::parquet_name(index)],
        }
    }

    /// Whether readers that take every file of the folder would take this one for draws.
    pub(super) fn is_part(self, name: &str) -> bool {
        match self {
            ChunkFormat::Zarr { .. } => false, // they ask for files by their names
            ChunkFormat::Npy => name.ends_with(".npy"),
            ChunkFormat::Parquet => name.ends_with(".parquet"),
        }
    }

    /// Encodes the files that describe the chunks to readers.
    pub(super) fn metadata(self, plan: &SetPlan) -> io::Result<Vec<Part<'static>>> {
        match self {
            ChunkFormat::Zarr { zstd } => Ok(zarr::metadata(&plan.schema, zstd, plan.chunk)),
            ChunkFormat::Npy => parts::npy_metadata(&plan.schema),
            ChunkFormat::Parquet => Ok(Vec::new()),
        }
    }

    /// Encodes the files of the arrays that all draws share.
    pub(super) fn constants(self, plan: &SetPlan) -> io::Result<Vec<Part<'_>>> {
        match self {
            ChunkFormat::Zarr { .. } => Ok(zarr::constants(&plan.schema)),
            ChunkFormat::Npy => parts::npy_constants(&plan.schema),
            ChunkFormat::Parquet => Ok(Vec::new()), // see Layout::check
        }
    }

    /// Folders within a set.
    pub(super) fn folders(self, plan: &SetPlan) -> Vec<String> {
        match self {
            ChunkFormat::Zarr { .. } => {
                let names = plan.schema.fields.iter().map(|field| field.name.clone());
                let constants = plan.schema.shared.iter().map(|constant| constant.name.clone());
                names.chain(constants).chain(["wavelength".to_owned()]).collect()
            }
            ChunkFormat::Npy | ChunkFormat::Parquet => Vec::new(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chunk_is_a_power_of_two_of_draws_or_all() {
        assert_eq!(ChunkFormat::default_chunk(124, 1 << 36), 1 << 17);
        assert_eq!(ChunkFormat::default_chunk(1 << 40, 10), 1);
        assert_eq!(ChunkFormat::default_chunk(124, 10), 10);
        assert_eq!(ChunkFormat::default_chunk(124, 0), 1);
        // 2 x 10^12 draws of 124 bytes, of which 16 MiB would be 15 million chunks.
        assert_eq!(ChunkFormat::default_chunk(124, 2_000_000_000_000), 1 << 21);
        assert_eq!(ChunkFormat::default_chunk(124, u64::MAX), 1 << 23);
    }
}
