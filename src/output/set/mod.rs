//! Data sets of many files: chunks of draws, each written once and whole, and a manifest of their BLAKE3 sums.
//!
//! A set is written in a folder beside its name, `NAME.partial`, and renamed when every chunk is there. A run that is
//! killed leaves the chunks that it finished, and the next goes on from them. Processes that share a set divide its
//! chunks; whichever finds all of them done seals it. Since a chunk depends on the plan alone, nothing of this shows
//! in the bytes.

mod audit;
mod manifest;
mod parts;
mod pool;
mod seal;
mod zarr;

use std::borrow::Cow;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};

use super::OutputError;
use super::pending::{existing_folder, place};
pub use audit::SetAudit;
pub use manifest::SetPlan;
use manifest::{Manifest, part_name};
use pool::{Chunk, Pool};
pub use seal::{SetStatus, merge};

/// Approximate default size of a chunk in bytes: large enough for a disk, small enough to hold several.
const CHUNK_BYTES: u64 = 16 << 20;

/// Shortest time between saves of the manifest: a killed run repeats no more than this. Saves take at most a
/// twentieth of the time.
const CHECKPOINT: Duration = Duration::from_millis(100);

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

impl ChunkFormat {
    /// Default number of draws per chunk, for rows of `row_bytes` and `count` draws in all: a power of two, or all.
    pub fn default_chunk(row_bytes: u64, count: u64) -> u64 {
        (1 << (CHUNK_BYTES / row_bytes.max(1)).max(1).ilog2()).min(count.max(1))
    }

    /// Encodes the files of a chunk.
    fn encode<'a>(self, plan: &SetPlan, index: u64, columns: &'a [Vec<u8>]) -> io::Result<Vec<Part<'a>>> {
        match self {
            ChunkFormat::Zarr { zstd } => zarr::chunk(&plan.schema, zstd, plan.chunk, index, columns),
            ChunkFormat::Npy => parts::npy(&plan.schema, index, columns),
            ChunkFormat::Parquet => parts::parquet(&plan.schema, index, columns),
        }
    }

    /// Encodes the files that describe the chunks to readers.
    fn metadata(self, plan: &SetPlan) -> io::Result<Vec<Part<'static>>> {
        match self {
            ChunkFormat::Zarr { zstd } => Ok(zarr::metadata(&plan.schema, zstd, plan.chunk)),
            ChunkFormat::Npy => parts::npy_metadata(&plan.schema),
            ChunkFormat::Parquet => Ok(Vec::new()),
        }
    }

    /// Encodes the files of the arrays that all draws share.
    fn constants(self, plan: &SetPlan) -> io::Result<Vec<Part<'_>>> {
        match self {
            ChunkFormat::Zarr { .. } => Ok(zarr::constants(&plan.schema)),
            ChunkFormat::Npy => parts::npy_constants(&plan.schema),
            ChunkFormat::Parquet => Ok(Vec::new()), // see Layout::check
        }
    }

    /// Folders within a set.
    fn folders(self, plan: &SetPlan) -> Vec<String> {
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

/// Part of a set's chunks that one of several processes writes: the `index`-th of `count`, from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shard {
    /// Number of the part, from 1.
    pub index: u64,
    /// Number of parts.
    pub count: u64,
}

impl Shard {
    /// The whole set.
    pub const WHOLE: Shard = Shard { index: 1, count: 1 };

    /// Chunks of the part; parts differ by one chunk at most.
    pub fn of(self, chunks: u64) -> Range<u64> {
        let bound = |i: u64| (u128::from(i) * u128::from(chunks) / u128::from(self.count)) as u64;
        bound(self.index - 1)..bound(self.index)
    }
}

/// Treatment of a set that exists already.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SetMode {
    /// Refuse to touch it.
    Create,
    /// Begin again, and replace it once the new set is complete.
    Replace,
    /// Check it, and do what is missing.
    Resume,
}

/// Number of chunks that are done, and of all.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Progress {
    /// Number of chunks that are done.
    pub done: u64,
    /// Number of all chunks.
    pub chunks: u64,
}

/// Writer of a set.
pub struct SetWriter {
    path: PathBuf,
    /// Folder of its chunks until it is sealed.
    root: PathBuf,
    plan: Arc<SetPlan>,
    shard: Shard,
    start: SetMode,
    /// Manifest of the chunks that this process has done or found done.
    manifest: Manifest,
    /// Chunks to be drawn, in order.
    missing: std::collections::VecDeque<u64>,
    /// Columns of the first missing chunk, as far as they were delivered.
    filling: Vec<Vec<u8>>,
    pool: Pool,
    spare: Vec<Vec<Vec<u8>>>,
    /// Earliest time of the manifest's next save.
    checkpoint: Instant,
    /// Number of chunks that the saved manifest lacks.
    unsaved: usize,
}

impl SetWriter {
    /// Opens a set that will appear as `path`. `companions` are small files that lie beside the chunks, by name;
    /// `engine` is what will draw.
    pub fn open(
        path: &Path,
        plan: SetPlan,
        companions: &[(&str, &str)],
        (shard, start): (Shard, SetMode),
        engine: &str,
    ) -> Result<SetWriter, OutputError> {
        let path = PathBuf::from_iter(path.components()); // without a slash at its end
        existing_folder(&path)?;
        let root = seal::occupy(&path, &plan, shard, start)?;
        let failed = |source| OutputError::Write { path: path.clone(), source };
        let mut manifest = Manifest::new(plan.clone());
        if let Some(found) = Manifest::joined(&root)? {
            found.check(&plan, &root)?;
            manifest.engines = found.engines;
            let own = shard.of(plan.chunks());
            let found: Vec<_> = found.chunks.into_iter().filter(|(index, _)| own.contains(index)).collect();
            let sound =
                |(_, sums): &(u64, Vec<manifest::Sum>)| sums.iter().all(|sum| sum.fault(&root).is_none());
            manifest.chunks = found.into_par_iter().filter(sound).collect();
        }
        let missing = shard.of(plan.chunks()).filter(|index| !manifest.chunks.contains_key(index)).collect();
        let plan = Arc::new(plan);
        let mut writer = SetWriter {
            filling: vec![Vec::new(); plan.schema.fields.len()],
            pool: Pool::new(&plan, &root),
            plan,
            shard,
            start,
            manifest,
            missing,
            spare: Vec::new(),
            checkpoint: Instant::now(),
            unsaved: 0,
            root,
            path: path.clone(),
        };
        if !writer.missing.is_empty() {
            writer.manifest.engines.insert(engine.to_owned());
        }
        if writer.root != writer.path {
            seal::claim(&writer.path, &writer.root, shard, start)?;
            for folder in writer.plan.layout.folders(&writer.plan) {
                fs::create_dir_all(writer.root.join(folder)).map_err(failed)?;
            }
            let constants = writer.plan.layout.constants(&writer.plan).map_err(failed)?;
            for part in constants {
                place(&writer.root.join(part.name), &part.bytes).map_err(failed)?;
            }
            for (name, text) in companions {
                place(&writer.root.join(name), text.as_bytes()).map_err(failed)?;
            }
            writer.save()?;
        }
        Ok(writer)
    }

    /// Ranges of the draws that are to be written, in order, counted from the set's first.
    pub fn missing(&self) -> Vec<Range<u64>> {
        let mut ranges: Vec<Range<u64>> = Vec::new();
        for draws in self.missing.iter().map(|&chunk| self.plan.draws(chunk)) {
            match ranges.last_mut() {
                Some(last) if last.end == draws.start => last.end = draws.end,
                _ => ranges.push(draws),
            }
        }
        ranges
    }

    /// Progress of this process's part.
    pub fn progress(&self) -> Progress {
        let own = self.shard.of(self.plan.chunks());
        Progress { done: self.manifest.chunks.len() as u64, chunks: own.end - own.start }
    }

    /// Folder of the chunks until the set is complete.
    pub fn folder(&self) -> &Path {
        &self.root
    }

    /// Writes the next draws of [`SetWriter::missing`], a column for each field.
    pub fn write(&mut self, columns: &[&[u8]]) -> Result<(), OutputError> {
        let rows = self.plan.schema.rows(columns) as u64;
        let mut done = 0;
        while done < rows {
            let index = *self.missing.front().expect("no more is written than is missing");
            let draws = self.plan.draws(index);
            let first = &self.plan.schema.fields[0];
            let filled = (self.filling[0].len() / first.delivered_bytes()) as u64;
            let part = (rows - done).min(draws.end - draws.start - filled);
            for ((field, column), filling) in
                self.plan.schema.fields.iter().zip(columns).zip(&mut self.filling)
            {
                let size = field.delivered_bytes();
                filling.extend_from_slice(&column[done as usize * size..(done + part) as usize * size]);
            }
            done += part;
            if filled + part == draws.end - draws.start {
                self.missing.pop_front();
                let mut columns = self.spare.pop().unwrap_or_else(|| vec![Vec::new(); self.filling.len()]);
                std::mem::swap(&mut columns, &mut self.filling);
                self.pool.submit(Chunk { index, columns });
                self.collect()?;
            }
        }
        Ok(())
    }

    /// Notes the chunks that were written meanwhile.
    fn collect(&mut self) -> Result<(), OutputError> {
        while let Ok(mut done) = self.pool.done.try_recv() {
            let sums = done.written.map_err(|source| self.failed(source))?;
            self.manifest.chunks.insert(done.chunk.index, sums);
            self.unsaved += 1;
            done.chunk.columns.iter_mut().for_each(Vec::clear);
            self.spare.push(done.chunk.columns);
        }
        if self.unsaved > 0 && Instant::now() > self.checkpoint { self.save() } else { Ok(()) }
    }

    /// Saves this process's manifest.
    fn save(&mut self) -> Result<(), OutputError> {
        let name = part_name(self.shard.index, self.shard.count);
        let start = Instant::now();
        place(&self.root.join(name), self.manifest.text().as_bytes())
            .map_err(|source| self.failed(source))?;
        self.checkpoint = Instant::now() + CHECKPOINT.max(20 * start.elapsed());
        self.unsaved = 0;
        Ok(())
    }

    /// Waits for the last chunks, and seals the set where all of it is there.
    pub fn finish(mut self) -> Result<SetStatus, OutputError> {
        assert!(self.missing.is_empty(), "all that was missing was written");
        if self.root == self.path {
            return Ok(SetStatus::Sealed); // it was before
        }
        self.pool.close();
        self.collect()?;
        self.save()?;
        seal::seal(&self.path, self.start == SetMode::Replace)
    }

    /// Keeps what is finished, and leaves the rest to another run.
    pub fn stop(mut self) -> Result<Progress, OutputError> {
        self.pool.stop();
        let _ = self.collect(); // its error is the reason to stop, if there is one
        if self.root != self.path {
            self.save()?;
        }
        Ok(self.progress())
    }

    fn failed(&self, source: io::Error) -> OutputError {
        OutputError::Write { path: self.path.clone(), source }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shards_divide_the_chunks() {
        for (chunks, count) in [(0, 3), (1, 3), (10, 3), (7, 7), (1000, 64), (u64::MAX, 5)] {
            let shards = (1..=count).map(|index| Shard { index, count }.of(chunks));
            let mut end = 0;
            for shard in shards {
                assert_eq!(shard.start, end);
                assert!(shard.end - shard.start <= chunks.div_ceil(count));
                end = shard.end;
            }
            assert_eq!(end, chunks);
        }
    }

    #[test]
    fn a_chunk_is_a_power_of_two_of_draws_or_all() {
        assert_eq!(ChunkFormat::default_chunk(124, 1 << 40), 1 << 17);
        assert_eq!(ChunkFormat::default_chunk(1 << 40, 10), 1);
        assert_eq!(ChunkFormat::default_chunk(124, 10), 10);
        assert_eq!(ChunkFormat::default_chunk(124, 0), 1);
    }
}
