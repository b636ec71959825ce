//! Sentences of summaries and dry runs that all commands which make data sets share.

use spectroll::export::{Destination, Output, Space};
use spectroll::output::{ByteCount, Schema, SetStatus, Shard};
use spectroll::wording::{counted, grouped};
use spectroll::{Engine, Model, Recipe};

use super::folder_of;
use crate::cli::folder;

/// Names what was made, before the number of rows, where the name does not say it.
pub(in crate::cli) fn kind(output: &Output, files: Option<u64>) -> String {
    match (files, output.destination()) {
        (Some(files), _) => format!("{}, ", folder_of(files)),
        (None, Destination::File(_)) if output.path().extension().is_none() => "one file, ".to_owned(),
        _ => String::new(),
    }
}

/// Says how many of the spectra reach 1, and how to have none; nothing where none does.
pub(in crate::cli) fn above_one(above_one: u64, draws: u64, setting: &str) -> Option<String> {
    let share = 100.0 * above_one as f64 / draws as f64;
    let verb = if above_one == 1 { "reaches" } else { "reach" };
    let count = grouped(above_one);
    (above_one > 0).then(|| {
        format!("{count} ({share:.2} %) {verb} 1 or more after scaling: use {setting} to keep all below 1")
    })
}

/// Names the engine that drew, and the arithmetic of an adapter.
pub(in crate::cli) fn drawn_by(engine: &Engine) -> String {
    match engine.verdict() {
        Some(verdict) => format!("{engine}, {verdict}"),
        None => engine.to_string(),
    }
}

/// Says how many draws were made again on the CPU; nothing where none was.
pub(in crate::cli) fn rechecked(draws: u64) -> Option<String> {
    (draws > 0)
        .then(|| format!("{} made again on the CPU, with the same bytes", counted(draws, "draw", "draws")))
}

/// Sentences of a summary on a model that is not quite what was given, or not quite what its draws are.
pub(in crate::cli) fn doubts(model: &Model) -> impl Iterator<Item = String> {
    corrected_basis(model).into_iter().chain(impossible_mean(model))
}

/// Says how many of a model's normal distributions are not drawn from, where some are not.
pub(in crate::cli) fn left_out(recipe: &Recipe) -> Option<String> {
    let left_out = recipe.left_out();
    (left_out > 0).then(|| {
        let all = grouped(recipe.model().distribution().len() as u64);
        let (verb, them) = if left_out == 1 { ("has", "it") } else { ("have", "them") };
        format!(
            "of the model's {all} normal distributions {} {verb} no share: fewer than 1 draw in 64 about {them} would be \
             accepted",
            grouped(left_out as u64)
        )
    })
}

/// Says that draws cannot have the mean of their model, where that is so.
fn impossible_mean(model: &Model) -> Option<String> {
    let (wavelength, value) = model.impossible_mean()?;
    let bound = if value < 0.0 { "above 0" } else { "below 1" };
    Some(format!(
        "the model's mean is {value:.4} at {wavelength} nm, and spectra are {bound}: their mean is another, so check the \
         data of the model"
    ))
}

/// Says that the basis of a model was made orthonormal, where that is so.
fn corrected_basis(model: &Model) -> Option<String> {
    let error = model.basis_correction()?;
    Some(format!(
        "the model's basis is orthonormal to {error:.0e} only, as single precision leaves it, and was made orthonormal"
    ))
}

/// The part of a set that this process makes, where there are several.
pub(in crate::cli) fn part(output: &Output, schema: &Schema) -> Option<String> {
    let shard = output.part();
    let own = shard.of(output.plan(schema).filter(|_| shard != Shard::WHOLE)?.chunks());
    let chunks = match own.end - own.start {
        0 => "no chunks".to_owned(),
        1 => format!("chunk {}", own.start),
        _ => format!("chunks {} to {}", own.start, own.end - 1),
    };
    Some(format!("part {} of {}, {chunks}", shard.index, shard.count))
}

/// Says what a run of one of several processes leaves, where there are several.
pub(in crate::cli) fn status(output: &Output, status: SetStatus) -> Option<String> {
    match status {
        SetStatus::Sealed => (output.part() != Shard::WHOLE).then(|| "the set is complete".to_owned()),
        SetStatus::Waiting { done, chunks } => Some(format!(
            "{} of {} finished: the set gets its name with the last",
            grouped(done),
            counted(chunks, "chunk is", "chunks are")
        )),
    }
}

/// Says whether the disk has room; nothing of standard output.
pub(in crate::cli) fn room(output: &Output, space: Space) -> Option<String> {
    if matches!(output.destination(), Destination::Stdout(_)) {
        return None;
    }
    let folder = folder(output.path());
    Some(match space.free {
        Some(free) => {
            let enough = match free {
                free if free >= space.bytes => "enough",
                _ if space.fits() => "perhaps enough",
                _ => "not enough",
            };
            format!("{} are free in {folder:?}, which is {enough}", ByteCount(free))
        }
        None if folder.is_dir() => format!("how much is free in {folder:?} cannot be told"),
        None => format!("{folder:?} does not exist: create it first"),
    })
}
