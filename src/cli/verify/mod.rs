//! `spectroll verify` and `spectroll merge`: checks, repair and completion of sets that were written before.

mod file;
mod sources;

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use rand::Rng;
use spectroll::Stream;
use spectroll::export::Destination;
use spectroll::output::{Fault, Piece, SetAudit, Sidecar, merge};
use spectroll::wording::{counted, grouped};

use super::exit::{Unverified, Usage};
use super::interrupt;
use super::options::EngineArguments;
use super::parse::share;
use sources::{Request, chunk};

/// Check a .zarr, a folder of parts or a file with a sidecar against its sums, and draw some of it again
#[derive(clap::Args)]
pub(crate) struct VerifyArguments {
    /// The set, of which an unfinished one is NAME.partial; or a file that was written with --sidecar
    #[arg(value_name = "PATH")]
    path: PathBuf,
    /// The share of the chunks that is drawn again and compared, 0 to 1; a file is drawn again with 1
    #[arg(long, default_value_t = 0.01, value_name = "SHARE", value_parser = share,
          allow_negative_numbers = true)]
    redraw: f64,
    /// Make what is damaged again, with the bytes that were written
    #[arg(long)]
    repair: bool,
    /// Folder of the files that a scene names, or of a model whose copy in the set is damaged [default: the folder that
    /// holds the set]
    #[arg(long, value_name = "FOLDER")]
    files: Option<PathBuf>,
    #[command(flatten)]
    engine: EngineArguments,
    /// Print nothing unless something is wrong
    #[arg(short, long)]
    quiet: bool,
}

/// Complete a set whose parts were made by several processes
///
/// The last of them does this itself; this is for when it could not. Every file is checked first.
#[derive(clap::Args)]
pub(crate) struct MergeArguments {
    /// The set, with or without .partial
    #[arg(value_name = "PATH")]
    path: PathBuf,
}

pub(crate) fn join(arguments: &MergeArguments) -> anyhow::Result<()> {
    Ok(merge(&arguments.path)?)
}

/// Number of times that a set is looked at again because another process completed or replaced it.
const LOOKS: usize = 10;

pub(crate) fn run(arguments: &VerifyArguments) -> anyhow::Result<()> {
    interrupt::watch();
    if arguments.path.is_file() || Sidecar::path(&arguments.path).is_file() {
        return file::run(arguments);
    }
    let mut path = arguments.path.clone();
    for _ in 1..LOOKS {
        let audit = match SetAudit::open(&path) {
            Ok(audit) => audit,
            Err(error) => {
                path = named(&path).ok_or(error)?;
                continue;
            }
        };
        let faults = faults(&audit)?;
        match audit.moved() {
            Some(moved) if !faults.is_empty() => path = moved,
            _ => return report(arguments, &path, &audit, faults),
        }
    }
    anyhow::bail!(
        "another process writes {:?} again and again: verify it once that has ended",
        arguments.path
    )
}

/// The name of a set that was unfinished until now.
fn named(path: &Path) -> Option<PathBuf> {
    let is_unfinished = path.extension().is_some_and(|extension| extension == "partial");
    let named = path.with_extension("");
    (is_unfinished && !path.exists() && named.exists()).then_some(named)
}

/// Lists all that differs from what was written.
fn faults(audit: &SetAudit) -> anyhow::Result<Vec<Fault>> {
    let mut faults = audit.faults();
    for chunk in audit.chunks() {
        interrupt::check()?;
        faults.extend(audit.chunk_faults(chunk));
    }
    Ok(faults)
}

fn report(
    arguments: &VerifyArguments,
    path: &Path,
    audit: &SetAudit,
    mut faults: Vec<Fault>,
) -> anyhow::Result<()> {
    let request = Request {
        path,
        schema: &audit.plan().schema,
        destination: Destination::Set(audit.plan().layout),
        sidecar: None,
        files: arguments.files.as_deref(),
        engine: &arguments.engine,
    };
    let mut repaired = 0;
    if arguments.repair && !faults.is_empty() {
        repaired = repair(request, audit, &faults)?;
        faults = self::faults(audit)?;
    }
    let chunks = audit.chunks();
    let again = chosen(&chunks, arguments.redraw);
    let mut left = None;
    if !again.is_empty() && faults.is_empty() {
        match request.sources()? {
            Ok(_) => faults = differences(request, audit, &again)?,
            Err(reason) => left = Some(reason),
        }
    }
    if !faults.is_empty() {
        return Err(Unverified(damage(path, audit, &faults)).into());
    }
    if !arguments.quiet {
        let (done, all) = (grouped(chunks.len() as u64), grouped(audit.plan().chunks()));
        let files = counted(audit.files() as u64, "other file", "other files");
        tell!("{}: {done} of {all} chunks are as they were written, and so are {files}", path.display());
        if repaired > 0 {
            tell!("  {} made again", counted(repaired, "of them was", "of them were"));
        }
        match left {
            Some(reason) => tell!("  none of them drawn again: {reason}"),
            None => tell!("  {} of them drawn again, with the same bytes", grouped(again.len() as u64)),
        }
    }
    Ok(())
}

/// Lists all damage, a line each where there is more than one.
fn damage(path: &Path, audit: &SetAudit, faults: &[Fault]) -> String {
    let remedy = match audit.is_complete() {
        _ if faults.iter().any(|fault| fault.piece == Piece::Manifest) => "make the set again with --force",
        _ if faults.iter().all(|fault| matches!(fault.piece, Piece::Foreign(_))) => "move it elsewhere",
        true => "pass --repair to make it again",
        false => "run the command that began the set again, with --resume",
    };
    match faults {
        [fault] => format!("{path:?}: {fault}; {remedy}"),
        _ => {
            let lines: Vec<_> = faults.iter().map(|fault| format!("\n  {fault}")).collect();
            format!("{path:?} has {} faults; {remedy}{}", faults.len(), lines.concat())
        }
    }
}

/// Chooses this share of the chunks, at random, and at least one unless none is wanted.
fn chosen(chunks: &[u64], share: f64) -> BTreeSet<u64> {
    let wanted = ((chunks.len() as f64 * share).ceil() as usize).min(chunks.len());
    let now = SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |time| time.as_nanos() as u64);
    let mut random = Stream::named(now, "verify").rng();
    let mut left = chunks.to_vec();
    (0..wanted).map(|_| left.swap_remove((random.next_u64() % left.len() as u64) as usize)).collect()
}

/// Lists the chunks that differ from what is drawn now, and the arrays that all rows share if they do.
fn differences(request: Request, audit: &SetAudit, chunks: &BTreeSet<u64>) -> anyhow::Result<Vec<Fault>> {
    let Ok(sources) = request.sources()? else { return Ok(Vec::new()) };
    let schema = request.schema;
    let engine = sources.engine(request)?;
    let mut faults = audit.shared_differences(sources.shared(&engine, schema)?)?;
    let mut rows = sources.rows(&engine, schema)?;
    for &index in chunks {
        faults.extend(audit.differences(index, &chunk(&mut *rows, audit, index)?)?);
    }
    Ok(faults)
}

/// Makes what is damaged of a complete set again. Returns the number of files.
fn repair(request: Request, audit: &SetAudit, faults: &[Fault]) -> anyhow::Result<u64> {
    if !audit.is_complete() {
        let text = "--repair is for complete sets: run the command that began this one again, with --resume";
        return Err(Usage(text.to_owned()).into());
    }
    if let Some(fault) = faults.iter().find(|fault| fault.piece == Piece::Manifest) {
        return Err(Unverified(damage(request.path, audit, std::slice::from_ref(fault))).into());
    }
    let names: BTreeSet<&str> = faults
        .iter()
        .filter_map(|fault| if let Piece::File(name) = &fault.piece { Some(name.as_str()) } else { None })
        .collect();
    let chunks: BTreeSet<u64> = faults
        .iter()
        .filter_map(|fault| if let Piece::Chunk(index) = fault.piece { Some(index) } else { None })
        .collect();
    // The model and the scene first, for drawing needs them.
    let mut known = audit.described()?;
    if names.contains("_model.json") {
        known.push(("_model.json".to_owned(), request.model()?.to_json().into_bytes()));
    }
    if let Some(text) = request.scene_text() {
        known.push(("_scene.toml".to_owned(), text.as_bytes().to_vec()));
    }
    for (name, bytes) in known.iter().filter(|(name, _)| names.contains(name.as_str())) {
        audit.repair_file(name, bytes)?;
    }
    let drawn = |name: &&&str| !known.iter().any(|(known, _)| known == **name);
    if chunks.is_empty() && names.iter().filter(drawn).count() == 0 {
        return Ok(faults.len() as u64);
    }
    let sources = request.sources()?.map_err(Unverified)?;
    let engine = sources.engine(request)?;
    let schema = request.schema;
    for (name, bytes) in audit.shared_files(sources.shared(&engine, schema)?)? {
        if names.contains(name.as_str()) {
            audit.repair_file(&name, &bytes)?;
        }
    }
    let mut rows = sources.rows(&engine, schema)?;
    for &index in &chunks {
        audit.repair_chunk(index, &chunk(&mut *rows, audit, index)?)?;
    }
    let foreign = faults.iter().filter(|fault| matches!(fault.piece, Piece::Foreign(_))).count();
    Ok((faults.len() - foreign) as u64)
}
