//! Writing of a set: chunks go to the [pool](super::pool) as they are drawn, and what is done to the manifest.

use std::collections::VecDeque;
use std::fs;
use std::io;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

use super::layout::Part;
use super::manifest::{Manifest, part_name};
use super::occupy::{Begun, generation, occupy};
use super::pool::{Chunk, Pool};
use super::resume::{Found, resume};
use super::seal::{self, Depth};
use super::{Progress, SetMode, SetPlan, SetStatus, Shard};
use crate::output::OutputError;
use crate::output::lock::LockFile;
use crate::output::pending::{existing_folder, place};

/// Shortest time between saves of the manifest: a killed run repeats no more than this. Saves take at most a
/// twentieth of the time.
const CHECKPOINT: Duration = Duration::from_millis(100);

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
    missing: VecDeque<u64>,
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
        let state = if held.is_some() { Found::Unfinished } else { Found::Complete };
        resume(&mut manifest, &root, &own, state)?;
        let missing: VecDeque<u64> = own.filter(|index| !manifest.chunks.contains_key(index)).collect();
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
