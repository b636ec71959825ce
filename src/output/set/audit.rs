//! Verification that a set is still as it was written, and its repair.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use super::super::OutputError;
use super::super::pending::{place, sync_folder};
use super::super::schema::SharedArray;
use super::super::sum::Sum;
use super::layout::Part;
use super::manifest::{Manifest, SEALED, Seal, SetPlan};
use super::occupy::{GLANCE, undisturbed};

/// A set that is being checked, complete or not.
pub struct SetAudit {
    root: PathBuf,
    manifest: Manifest,
    is_complete: bool,
    /// The set that was opened, where it is complete.
    seal: Option<Seal>,
}

/// Piece of a set that can be made again.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Piece {
    /// A chunk, by its index.
    Chunk(u64),
    /// A file that is no chunk, by its name.
    File(String),
    /// A file that is none of the set, by its name.
    Foreign(String),
    /// The manifest.
    Manifest,
}

/// Difference of a set from what was written.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// The piece that differs.
    pub piece: Piece,
    /// Description of the difference, which names the file.
    pub description: String,
}

impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.description)
    }
}

impl SetAudit {
    /// Reads the manifest of the set in a folder.
    pub fn open(path: impl AsRef<Path>) -> Result<SetAudit, OutputError> {
        undisturbed(path.as_ref(), GLANCE, || SetAudit::read(path.as_ref()))
    }

    fn read(path: &Path) -> Result<SetAudit, OutputError> {
        let not_a_set = || OutputError::NotASet { path: path.to_owned() };
        if !path.is_dir() {
            return Err(not_a_set());
        }
        let is_complete = path.extension().is_none_or(|extension| extension != "partial");
        let seal = Manifest::seal(path);
        let manifest = match is_complete {
            true => Manifest::sealed(path)?,
            false => Manifest::joined(path)?.ok_or_else(not_a_set)?,
        };
        Ok(SetAudit { root: path.to_owned(), manifest, is_complete, seal })
    }

    /// Whether the set has its name, and so has to be complete.
    pub fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// Path at which the set lies now, where that is not what was opened: another process completed or replaced it
    /// meanwhile.
    pub fn moved(&self) -> Option<PathBuf> {
        if self.is_complete {
            return (Manifest::seal(&self.root) != self.seal).then(|| self.root.clone());
        }
        let sealed = self.root.with_extension("");
        (!self.root.exists() && sealed.join(SEALED).exists()).then_some(sealed)
    }

    /// Plan of the set.
    pub fn plan(&self) -> &SetPlan {
        &self.manifest.plan
    }

    /// Engines that drew it.
    pub fn engines(&self) -> impl Iterator<Item = &str> {
        self.manifest.engines.iter().map(String::as_str)
    }

    /// Indices of the chunks that are done.
    pub fn chunks(&self) -> Vec<u64> {
        self.manifest.chunks.keys().copied().collect()
    }

    /// Number of files that are no chunks.
    pub fn files(&self) -> usize {
        self.manifest.files.len()
    }

    /// Faults of the set as a whole: chunks that the manifest of a complete set lacks, files that are no chunks, and
    /// files that readers would take for chunks.
    pub fn faults(&self) -> Vec<Fault> {
        let fault = |piece, description| Fault { piece, description };
        let mut faults = Vec::new();
        if self.is_complete && !self.manifest.is_complete() {
            let (done, all) = (self.manifest.chunks.len(), self.plan().chunks());
            faults.push(fault(Piece::Manifest, format!("{SEALED} has {done} of {all} chunks")));
        }
        for sum in &self.manifest.files {
            faults.extend(sum.fault(&self.root).map(|text| fault(Piece::File(sum.name.clone()), text)));
        }
        let entries = fs::read_dir(&self.root).into_iter().flatten().flatten();
        let names = entries.filter_map(|entry| entry.file_name().into_string().ok());
        let known: std::collections::BTreeSet<&str> =
            self.manifest.sums().map(|sum| sum.name.as_str()).collect();
        let layout = self.plan().layout;
        let is_foreign = |name: &String| layout.is_part(name) && !known.contains(name.as_str());
        if self.is_complete {
            let mut foreign: Vec<_> = names.filter(is_foreign).collect();
            foreign.sort();
            faults.extend(foreign.into_iter().map(|name| {
                let text = format!("{name} is not of the set, and readers take it for a part of it");
                fault(Piece::Foreign(name), text)
            }));
        }
        faults
    }

    /// Faults of the files of a chunk.
    pub fn chunk_faults(&self, chunk: u64) -> Vec<Fault> {
        let sums = self.manifest.chunks.get(&chunk).into_iter().flatten();
        let faults = sums.filter_map(|sum| sum.fault(&self.root));
        faults.map(|description| Fault { piece: Piece::Chunk(chunk), description }).collect()
    }

    /// Differences of a chunk that was drawn again from what was written. `columns` are its draws.
    pub fn differences(&self, chunk: u64, columns: &[Vec<u8>]) -> Result<Vec<Fault>, OutputError> {
        let plan = self.plan();
        plan.layout.check(&self.root, &plan.schema)?;
        let parts = plan.layout.encode(plan, chunk, columns).map_err(|e| self.failed(e))?;
        let sums: Vec<Sum> = parts.iter().map(Part::sum).collect();
        let written = self.manifest.chunks[&chunk].iter();
        let differing = written.zip(&sums).filter(|(a, b)| a != b);
        let text = |name: &str| format!("{name} is not what is drawn now");
        Ok(differing
            .map(|(sum, _)| Fault { piece: Piece::Chunk(chunk), description: text(&sum.name) })
            .collect())
    }

    /// Differences of the arrays that all draws share, drawn again as `constants`, from what was written.
    pub fn shared_differences(&self, constants: Vec<SharedArray>) -> Result<Vec<Fault>, OutputError> {
        let made = self.shared_files(constants)?;
        let differing = made.into_iter().filter(|(name, bytes)| {
            let sum = Sum::new(name, bytes);
            !self.manifest.files.contains(&sum)
        });
        Ok(differing
            .map(|(name, _)| {
                let description = format!("{name} is not what is drawn now");
                Fault { piece: Piece::File(name), description }
            })
            .collect())
    }

    /// Files of the arrays that all draws share, drawn again as `constants`: their names and bytes.
    pub fn shared_files(&self, constants: Vec<SharedArray>) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
        let mut plan = self.plan().clone();
        plan.schema.shared = constants;
        let parts = plan.layout.constants(&plan).map_err(|e| self.failed(e))?;
        Ok(parts.into_iter().map(|part| (part.name, part.bytes.into_owned())).collect())
    }

    /// Files that describe the set to readers: their names and bytes.
    pub fn described(&self) -> Result<Vec<(String, Vec<u8>)>, OutputError> {
        let parts = self.plan().layout.metadata(self.plan()).map_err(|e| self.failed(e))?;
        Ok(parts.into_iter().map(|part| (part.name, part.bytes.into_owned())).collect())
    }

    /// Puts a file that is no chunk in its place again, if these are the bytes that were written.
    pub fn repair_file(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let sum = Sum::new(name, bytes);
        if !self.manifest.files.contains(&sum) {
            return Err(self.unrepaired(format!("{name} is made otherwise now than it was written")));
        }
        self.put(name, bytes)
    }

    /// Puts the files of a chunk that are damaged in their places again, if `columns` are the draws that were written.
    pub fn repair_chunk(&self, chunk: u64, columns: &[Vec<u8>]) -> Result<(), OutputError> {
        let plan = self.plan();
        plan.layout.check(&self.root, &plan.schema)?;
        let parts = plan.layout.encode(plan, chunk, columns).map_err(|e| self.failed(e))?;
        for (part, sum) in parts.iter().zip(&self.manifest.chunks[&chunk]) {
            if part.sum() != *sum {
                return Err(
                    self.unrepaired(format!("{} is drawn otherwise now than it was written", part.name))
                );
            }
            if sum.fault(&self.root).is_some() {
                self.put(&part.name, &part.bytes)?;
            }
        }
        Ok(())
    }

    fn put(&self, name: &str, bytes: &[u8]) -> Result<(), OutputError> {
        let path = self.root.join(name);
        if let Some(folder) = path.parent() {
            fs::create_dir_all(folder).map_err(|e| self.failed(e))?;
        }
        place(&path, bytes).map_err(|e| self.failed(e))?;
        path.parent().into_iter().for_each(sync_folder);
        Ok(())
    }

    fn unrepaired(&self, reason: String) -> OutputError {
        OutputError::Unrepaired { path: self.root.clone(), reason }
    }

    fn failed(&self, source: std::io::Error) -> OutputError {
        OutputError::Write { path: self.root.clone(), source }
    }
}
