//! Checks and repair of single files that have a sidecar.

use std::fs;
use std::path::Path;

use anyhow::Context;
use spectroll::export::{Destination, Output, Writing};
use spectroll::output::Sidecar;

use super::VerifyArguments;
use super::sources::Request;
use crate::cli::exit::Unverified;
use crate::cli::{folder, interrupt, run as runs};

/// Checks the file, draws it again where that was asked for, and puts what is drawn in the place of a damaged one.
pub(super) fn run(arguments: &VerifyArguments) -> anyhow::Result<()> {
    let path = &arguments.path;
    let (sidecar, fault) = Sidecar::check(path)?;
    if let (Some(fault), false) = (&fault, arguments.repair) {
        let text = format!("{path:?} is damaged: {fault}; pass --repair to make it again");
        return Err(Unverified(text).into());
    }
    let mut left = Some("pass --redraw 1 for that".to_owned());
    if fault.is_some() || arguments.redraw >= 1.0 {
        left = again(arguments, &sidecar, fault.is_some())?;
    }
    if let (Some(_), Some(reason)) = (&fault, &left) {
        return Err(Unverified(format!("{path:?} cannot be repaired: {reason}")).into());
    }
    if !arguments.quiet {
        tell!("{}: as it was written", path.display());
        match (fault, left) {
            (Some(fault), _) => tell!("  made again: {fault}"),
            (None, Some(reason)) => tell!("  not drawn again: {reason}"),
            (None, None) => tell!("  drawn again, with the same bytes"),
        }
    }
    Ok(())
}

/// Draws the file again, beside it, and compares it with what was written. It takes the place of the file where `keeps`.
/// A text says why it cannot be drawn.
fn again(arguments: &VerifyArguments, sidecar: &Sidecar, keeps: bool) -> anyhow::Result<Option<String>> {
    let path = &arguments.path;
    let destination = Destination::File(sidecar.format());
    let request = Request {
        path,
        schema: sidecar.schema(),
        destination,
        sidecar: Some(sidecar),
        files: arguments.files.as_deref(),
        engine: &arguments.engine,
    };
    let sources = match request.sources()? {
        Ok(sources) => sources,
        Err(reason) => return Ok(Some(reason)),
    };
    let engine = sources.engine(request)?;
    let beside =
        tempfile::Builder::new().prefix("spectroll-verify.").suffix(".partial").tempdir_in(folder(path))?;
    let made = beside.path().join(Path::new(path.file_name().context("the path has no name")?));
    let output = Output::at(&made, destination);
    output.check_space(sidecar.schema(), &sources.companions())?;
    let mut rows = sources.rows(&engine, sidecar.schema())?;
    let writing =
        Writing::open(&output, sidecar.schema().clone(), &sources.companions(), &engine, &mut *rows);
    let writing = writing.map_err(runs::failed)?;
    writing.run(&mut *rows, &mut |_| interrupt::flow()).map_err(runs::failed)?;
    if let Some(fault) = sidecar.fault(&made) {
        let text = format!("{path:?} is drawn otherwise now than it was written: {fault}");
        return Err(Unverified(text).into());
    }
    if keeps {
        fs::rename(&made, path).with_context(|| format!("cannot write {path:?}"))?;
    }
    Ok(None)
}
