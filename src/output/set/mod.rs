//! Data sets of many files: chunks of draws, each written once and whole, and a manifest of their BLAKE3 sums.
//!
//! A set is written in a folder beside its name, `NAME.partial`, and renamed when every chunk is there. A run that is
//! killed leaves the chunks that it finished, and the next goes on from them. Processes that share a set divide its
//! chunks; whichever finds all of them done seals it. Since a chunk depends on the plan alone, nothing of this shows
//! in the bytes. Locks keep two processes from the same chunks, and a set from being replaced while it is written.

mod audit;
pub(super) mod check;
mod layout;
mod manifest;
mod occupy;
mod parts;
mod pool;
mod seal;
mod zarr;

use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use rayon::prelude::*;

use super::OutputError;
use super::lock::LockFile;
use super::pending::{existing_folder, place};
use super::sum::Sum;
use crate::threads;
pub use audit::{Fault, Piece, SetAudit};
pub use layout::ChunkFormat;
use layout::Part;
pub use manifest::SetPlan;
use manifest::{Manifest, part_name};
use occupy::{Begun, generation, occupy};
use pool::{Chunk, Pool};
use seal::Depth;
pub use seal::{SetStatus, merge};

/// Shortest time between saves of the manifest: a killed run repeats no more than this. Saves take at most a
/// twentieth of the time.
const CHECKPOINT: Duration = Duration::from_millis(100);

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
    /// Number of chunks that this process has to make.
    to_make: usize,
    /// Mark of the set, and the locks that this process holds; `None` of a complete set.
    held: Option<(String, [LockFile; 2])>,
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
        let mut path = PathBuf::from_iter(path.components()); // without a slash at its end
        if path.is_symlink() {
            path = fs::canonicalize(&path).unwrap_or(path); // the target is replaced, and not the link
        }
        plan.check(&path)?;
        existing_folder(&path)?;
        let begun = occupy(&path, &plan, shard, start)?;
        let (root, held) = match begun {
            Some(Begun { root, generation, locks }) => (root, Some((generation, locks))),
            None => (path.clone(), None),
        };
        let mut manifest =
            Manifest::new(plan.clone(), held.as_ref().map_or("", |(generation, _)| generation.as_str()));
        let own = shard.of(plan.chunks());
        if let Some(found) = Manifest::joined(&root)? {
            found.check(&plan, &root)?;
            manifest.engines = found.engines;
            let found: Vec<_> = found.chunks.into_iter().filter(|(index, _)| own.contains(index)).collect();
            // Those of a complete set were checked as it was opened.
            let is_sound = |(_, sums): &(u64, Vec<Sum>)| {
                held.is_none() || sums.iter().all(|sum| sum.fault(&root).is_none())
            };
            manifest.chunks =
                threads::pool(None)?.install(|| found.into_par_iter().filter(is_sound).collect());
        }
        let missing: std::collections::VecDeque<u64> =
            own.filter(|index| !manifest.chunks.contains_key(index)).collect();
        let plan = Arc::new(plan);
        let mut writer = SetWriter {
            filling: vec![Vec::new(); plan.schema.fields.len()],
            pool: Pool::new(&plan, &root)?,
            plan,
            shard,
            start,
            manifest,
            to_make: missing.len(),
            missing,
            spare: Vec::new(),
            checkpoint: Instant::now(),
            unsaved: 0,
            root,
            path,
            held,
        };
        if !writer.missing.is_empty() {
            writer.manifest.engines.insert(engine.to_owned());
        }
        if writer.held.is_some() {
            writer.begin(companions)?;
        }
        Ok(writer)
    }

    /// Writes what all processes of a set write, and the first manifest of this one.
    fn begin(&mut self, companions: &[(&str, &str)]) -> Result<(), OutputError> {
        let plan = self.plan.clone();
        for folder in plan.layout.folders(&plan) {
            match fs::create_dir(self.root.join(folder)) {
                Err(e) if e.kind() != io::ErrorKind::AlreadyExists => return Err(self.failed(e)),
                _ => {}
            }
        }
        let constants = plan.layout.constants(&plan).map_err(|e| self.failed(e))?;
        let companions = companions
            .iter()
            .map(|(name, text)| Part { name: (*name).to_owned(), bytes: text.as_bytes().into() });
        for part in constants.into_iter().chain(companions) {
            place(&self.root.join(&part.name), &part.bytes).map_err(|e| self.failed(e))?;
            self.manifest.note(part.sum());
        }
        self.save()?;
        // Of two processes that begin one set at once with two plans, the second to get here is wrong.
        if let Err(error) = Manifest::joined(&self.root) {
            let _ = fs::remove_file(self.root.join(part_name(self.shard)));
            return Err(error);
        }
        Ok(())
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
        let Some((own, [set, _])) = &self.held else { return Ok(()) };
        if generation(set).as_ref() != Some(own) {
            return Err(OutputError::Replaced { root: self.root.clone() }); // where there are no locks
        }
        let start = Instant::now();
        place(&self.root.join(part_name(self.shard)), self.manifest.text().as_bytes())
            .map_err(|source| self.failed(source))?;
        self.checkpoint = Instant::now() + CHECKPOINT.max(20 * start.elapsed());
        self.unsaved = 0;
        Ok(())
    }

    /// Waits for the last chunks, and seals the set where all of it is there. An error where this process had nothing to
    /// make, and nobody makes what is missing.
    pub fn finish(mut self) -> Result<SetStatus, OutputError> {
        assert!(self.missing.is_empty(), "all that was missing was written");
        self.pool.close();
        self.collect()?;
        self.save()?;
        let Some((own, locks)) = self.held.take() else {
            return Ok(SetStatus::Sealed); // it was before
        };
        drop(locks);
        let status = seal::seal(&self.path, self.start == SetMode::Replace, Depth::Sizes, Some(&own))?;
        let had_part = !self.shard.of(self.plan.chunks()).is_empty();
        match status {
            SetStatus::Waiting { done, chunks } if self.to_make == 0 && had_part && done < chunks => {
                match seal::abandoned(&self.path, self.shard.count) {
                    Some(missing) => Err(OutputError::NothingMade {
                        root: self.root.clone(),
                        shard: self.shard,
                        done,
                        chunks,
                        missing,
                    }),
                    None => Ok(status),
                }
            }
            status => Ok(status),
        }
    }

    /// Keeps what is finished, and leaves the rest to another run.
    pub fn stop(mut self) -> Result<Progress, OutputError> {
        self.pool.stop();
        let _ = self.collect(); // its error is the reason to stop, if there is one
        self.save()?;
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
}
