//! Resuming of a set: which of its chunks are there, and whole.

use std::ops::Range;
use std::path::Path;

use rayon::prelude::*;

use super::manifest::Manifest;
use crate::output::OutputError;
use crate::output::sum::Sum;
use crate::threads;

/// State of a set that is resumed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Found {
    /// It is unfinished: its chunks may be of a run that was killed, or of a disk that is at fault.
    Unfinished,
    /// It is complete, and was checked when it was opened.
    Complete,
}

/// Puts into the manifest of a process the chunks of its part `own` that earlier processes left in `root`, if they are of
/// the same set and have the bytes that were written.
pub(super) fn resume(
    manifest: &mut Manifest,
    root: &Path,
    own: &Range<u64>,
    state: Found,
) -> Result<(), OutputError> {
    let Some(found) = Manifest::joined(root)? else { return Ok(()) };
    found.check(&manifest.plan, root)?;
    manifest.engines = found.engines;
    let found: Vec<_> = found.chunks.into_iter().filter(|(index, _)| own.contains(index)).collect();
    let is_sound = |(_, sums): &(u64, Vec<Sum>)| {
        state == Found::Complete || sums.iter().all(|sum| sum.fault(root).is_none())
    };
    manifest.chunks = threads::pool(None)?.install(|| found.into_par_iter().filter(is_sound).collect());
    Ok(())
}
