//! Checks of what a manifest says, before anything relies on it: anybody can write one.

use std::collections::BTreeSet;
use std::path::{Component, Path};

use super::super::sum::Sum;
use super::super::{Field, Schema, SharedArray};
use super::SetPlan;
use super::manifest::Manifest;
use crate::quantity::Dtype;

/// Largest number of values per draw in an array, and of values in an array that all draws share.
const VALUES: u64 = 1 << 24;

/// Largest number of bytes in a set, and of draws.
const BYTES: u64 = 1 << 60;

/// Longest name of an array, in bytes.
const NAME: usize = 255;

/// Describes what in a manifest no set can have, if there is something.
pub(super) fn check(manifest: &Manifest) -> Result<(), String> {
    let plan = &manifest.plan;
    check_plan(plan)?;
    for (&index, sums) in &manifest.chunks {
        if index >= plan.chunks() {
            return Err(format!("it has a chunk {index}, and the set has {}", plan.chunks()));
        }
        let names = plan.layout.names(plan, index);
        if !sums.iter().map(|sum| &sum.name).eq(&names) {
            return Err(format!("chunk {index} is not the files {}", names.join(", ")));
        }
    }
    match manifest.sums().find(|sum| !is_plain_path(&sum.name) || !is_sum(sum)) {
        Some(sum) => Err(format!("{:?} is not the name of a file in the set with its sum", sum.name)),
        None => Ok(()),
    }
}

fn check_plan(plan: &SetPlan) -> Result<(), String> {
    let schema = &plan.schema;
    check_schema(schema)?;
    if plan.chunk == 0 || plan.chunk > schema.count.max(1) {
        return Err(format!("chunks of {} draws are none of a set of {}", plan.chunk, schema.count));
    }
    plan.check_chunks(Path::new("the set")).map_err(|e| e.to_string())
}

/// Describes what in a schema no data set can have, if there is something.
pub(in crate::output) fn check_schema(schema: &Schema) -> Result<(), String> {
    let mut names = BTreeSet::new();
    let arrays = schema.fields.iter().map(|field| &field.name);
    for name in arrays.chain(schema.shared.iter().map(|shared| &shared.name)) {
        if !is_plain_name(name) || !names.insert(name) {
            return Err(format!("{name:?} is not the name of one array"));
        }
    }
    if schema.fields.is_empty() {
        return Err("it has no array".to_owned());
    }
    if let Some(field) = schema.fields.iter().find(|field| !is_sound(field)) {
        return Err(format!("the array {:?} has no such shape and type", field.name));
    }
    if let Some(shared) = schema.shared.iter().find(|shared| !is_sound_shared(shared)) {
        return Err(format!("the array {:?} has no such shape", shared.name));
    }
    let bytes = schema.count.checked_mul(schema.row_bytes().max(1));
    if bytes.is_none_or(|bytes| bytes > BYTES) {
        return Err(format!("no disk holds {} draws of {} bytes", schema.count, schema.row_bytes()));
    }
    Ok(())
}

fn is_sound(field: &Field) -> bool {
    let extents = field.outer.iter().chain(&field.middle).map(|(_, count)| *count);
    let outer = extents.fold(1usize, usize::saturating_mul);
    let is_whole = field.stored == Dtype::U32;
    (1..=VALUES).contains(&(field.width as u64))
        && outer > 0
        && field.width.is_multiple_of(outer)
        && (!is_whole || field.dtype == Dtype::U32)
}

fn is_sound_shared(shared: &SharedArray) -> bool {
    let values = shared.axes.iter().try_fold(1u64, |all, (_, extent)| all.checked_mul(*extent));
    !shared.axes.is_empty() && values.is_some_and(|values| values <= VALUES)
}

fn is_sum(sum: &Sum) -> bool {
    sum.blake3.len() == 64 && sum.bytes <= BYTES
}

/// Whether a name is that of a file or folder, and not of one elsewhere.
fn is_plain_name(name: &str) -> bool {
    let mut components = Path::new(name).components();
    let is_one = matches!((components.next(), components.next()), (Some(Component::Normal(_)), None));
    is_one && name.len() <= NAME && !name.contains(['/', '\\', ':', '\0']) && !name.starts_with(['_', '.'])
}

/// Whether a path is that of a file in the set, or in a folder of it.
fn is_plain_path(path: &str) -> bool {
    let name = path.strip_prefix('_').unwrap_or(path);
    let parts: Vec<_> = name.split('/').collect();
    parts.len() <= 2 && parts.iter().all(|part| is_plain_name(part))
}
