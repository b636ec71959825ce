//! Sidecar of a single file: its sum, and all that it takes to draw it again.
//!
//! Some formats have attributes and others have none, and no format can hold the sum of its own file. So this is
//! a file of its own, for those who ask for it.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use super::lock::lock_folder;
use super::pending::{PendingFile, folder, ignore_missing, place, sync_folder};
use super::set::check::check_schema;
use super::sum::{LARGEST, Sum, is_signed, signed};
use super::{FileFormat, OutputError, Schema};
use crate::plain_file::read_text;

/// Version of the sidecar that this program writes. It reads earlier ones, all of which have a sum of rounding.
const VERSION: u32 = 2;

/// End of its name, after that of the file.
const SUFFIX: &str = ".spectroll.json";

/// Sum of a single file, and what it was drawn from.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sidecar {
    sidecar: u32,
    file: Option<Sum>,
    format: FileFormat,
    /// Sum that engines share which round alike, where that which drew the file had not the CPU's bytes; always there
    /// in version 1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    rounding: Option<String>,
    schema: Schema,
    /// Text of the model; `None` of scenes.
    model: Option<String>,
    /// Sum of the text of the sidecar in which this is empty.
    blake3: String,
}

impl Sidecar {
    /// Makes a sidecar of a file that is still to be written.
    pub fn new(
        format: FileFormat,
        schema: &Schema,
        rounding: Option<String>,
        model: Option<&str>,
    ) -> Sidecar {
        Sidecar {
            sidecar: VERSION,
            file: None,
            format,
            rounding,
            schema: schema.clone(),
            model: model.map(str::to_owned),
            blake3: String::new(),
        }
    }

    /// Path of the sidecar of a file.
    pub fn path(file: &Path) -> PathBuf {
        let mut name = file.as_os_str().to_owned();
        name.push(SUFFIX);
        PathBuf::from(name)
    }

    /// Reads the sidecar of a file.
    pub fn load(file: &Path) -> Result<Sidecar, OutputError> {
        let path = Sidecar::path(file);
        let failed = |reason: String| OutputError::Manifest { path: path.clone(), reason };
        let text = match read_text(&path, LARGEST) {
            Err(e) if e.kind() == io::ErrorKind::NotFound => {
                return Err(OutputError::NoSidecar { path: file.to_owned() });
            }
            text => text.map_err(|e| failed(e.to_string()))?,
        };
        let sidecar: Sidecar = serde_json::from_str(&text).map_err(|e| failed(e.to_string()))?;
        if !(1..=VERSION).contains(&sidecar.sidecar) {
            return Err(OutputError::ManifestVersion { path, remedy: "update spectroll" });
        }
        if !is_signed(&text, &sidecar.blake3) {
            return Err(failed("it does not match its BLAKE3 sum".to_owned()));
        }
        check_schema(&sidecar.schema).map_err(failed)?;
        Ok(sidecar)
    }

    /// Reads the sidecar of a file, and describes how the file differs from what was written, if it does: both as they are
    /// at one moment, whoever writes that name meanwhile.
    pub fn check(file: &Path) -> Result<(Sidecar, Option<String>), OutputError> {
        let alone = lock_folder(folder(file));
        let sidecar = Sidecar::load(file)?;
        let opened = sidecar.sum_of(file).and_then(|sum| Ok((sum.open(folder(file))?, sum)));
        drop(alone); // what is open stays as it is
        let fault = opened.map_or_else(Some, |(file, sum)| sum.fault_of(file));
        Ok((sidecar, fault))
    }

    /// Makes a file appear under its name, and its sidecar beside it, if it has one; that of a file before it goes. There is
    /// no moment at which the sidecar is that of another file, whoever else writes the same name: the folder is locked
    /// meanwhile, where folders can be.
    pub(super) fn finish(sidecar: Option<Sidecar>, pending: PendingFile) -> Result<(), OutputError> {
        let path = pending.path().to_owned();
        let name = path.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let sidecar = sidecar
            .map(|sidecar| Sum::of_file(&name, pending.temporary_path()).map(|sum| sidecar.of(sum)))
            .transpose()
            .map_err(|e| pending.failed(e))?;
        pending.ready()?;
        let _alone = lock_folder(folder(&path));
        // Again, for whoever held the lock before: the sidecar of a file that stays must stay too.
        pending.ready()?;
        Sidecar::remove(&path)?;
        pending.finish()?;
        let Some(sidecar) = sidecar else { return Ok(()) };
        let beside = Sidecar::path(&path);
        place(&beside, signed(&sidecar).as_bytes())
            .map_err(|source| OutputError::Write { path: beside, source })?;
        sync_folder(folder(&path));
        Ok(())
    }

    fn of(self, file: Sum) -> Sidecar {
        Sidecar { file: Some(file), ..self }
    }

    /// Removes the sidecar of a file that is replaced, or was deleted.
    fn remove(file: &Path) -> Result<(), OutputError> {
        let path = Sidecar::path(file);
        match fs::remove_file(&path) {
            // A file whose name leaves no room for that of a sidecar has none.
            Err(e) if e.kind() == io::ErrorKind::InvalidFilename => Ok(()),
            removed => removed.or_else(ignore_missing).map_err(|source| OutputError::Write { path, source }),
        }
    }

    /// Describes how a file differs from what was written, if it does. It may have another name.
    pub fn fault(&self, file: &Path) -> Option<String> {
        self.sum_of(file).map_or_else(Some, |sum| sum.fault(folder(file)))
    }

    /// The sum of the file, under the name that it has; else what is wrong.
    fn sum_of(&self, file: &Path) -> Result<Sum, String> {
        let sum = self.file.as_ref().ok_or("the sidecar has no sum")?;
        let name = file.file_name().and_then(|name| name.to_str()).unwrap_or(&sum.name).to_owned();
        Ok(Sum { name, ..sum.clone() })
    }

    /// Format of the file.
    pub fn format(&self) -> FileFormat {
        self.format
    }

    /// Schema of the file.
    pub fn schema(&self) -> &Schema {
        &self.schema
    }

    /// Sum that engines share which round as the one that drew the file; `None` where that had the CPU's bytes.
    pub fn rounding(&self) -> Option<&str> {
        self.rounding.as_deref()
    }

    /// Text of the model; `None` of scenes.
    pub fn model(&self) -> Option<&str> {
        self.model.as_deref()
    }
}
