//! Verification that a set is still as it was written.

use std::path::{Path, PathBuf};

use super::super::OutputError;
use super::super::schema::SharedArray;
use super::Part;
use super::manifest::{Manifest, SetPlan, Sum};

/// A set that is being checked, complete or not.
pub struct SetAudit {
    root: PathBuf,
    manifest: Manifest,
}

impl SetAudit {
    /// Reads the manifest of the set in a folder.
    pub fn open(path: impl AsRef<Path>) -> Result<SetAudit, OutputError> {
        let path = path.as_ref();
        let found = if path.is_dir() { Manifest::joined(path)? } else { None };
        let manifest = found.ok_or_else(|| OutputError::NotASet { path: path.to_owned() })?;
        Ok(SetAudit { root: path.to_owned(), manifest })
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

    /// Describes how the files of a chunk differ from what was written, if they do.
    pub fn fault(&self, chunk: u64) -> Option<String> {
        self.manifest.chunks[&chunk].iter().find_map(|sum| sum.fault(&self.root))
    }

    /// Describes how the arrays that all draws share, drawn again as `constants`, differ from what was written, if
    /// they do: no manifest has their sums.
    pub fn shared_difference(&self, constants: Vec<SharedArray>) -> Result<Option<String>, OutputError> {
        let mut plan = self.manifest.plan.clone();
        plan.schema.shared = constants;
        let failed = |source| OutputError::Write { path: self.root.clone(), source };
        let parts = plan.layout.constants(&plan).map_err(failed)?;
        let differs =
            |part: &&Part| std::fs::read(self.root.join(&part.name)).ok() != Some(part.bytes.to_vec());
        Ok(parts.iter().find(differs).map(|part| format!("{} is not what is drawn now", part.name)))
    }

    /// Describes how a chunk that was drawn again differs from what was written, if it does. `columns` are its draws.
    pub fn difference(&self, chunk: u64, columns: &[Vec<u8>]) -> Result<Option<String>, OutputError> {
        let plan = &self.manifest.plan;
        let failed = |source| OutputError::Write { path: self.root.clone(), source };
        let parts = plan.layout.encode(plan, chunk, columns).map_err(failed)?;
        let sums: Vec<Sum> = parts.iter().map(Sum::of).collect();
        let written = &self.manifest.chunks[&chunk];
        Ok(written
            .iter()
            .zip(&sums)
            .find(|(a, b)| a != b)
            .map(|(sum, _)| format!("{} is not what is drawn now", sum.name)))
    }
}
