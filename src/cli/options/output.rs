//! Options of where a data set goes: `--output` and the options beside it.

use std::path::{Path, PathBuf};

use clap::builder::{OsStringValueParser, TypedValueParser};
use spectroll::Dtype;
use spectroll::export::{Destination, Output, SpaceCheck};
use spectroll::output::{ChunkFormat, FileFormat, IfExists, SetMode, Shard};

use super::shard::ShardName;
use crate::cli::exit::Usage;
use crate::cli::if_exists;
use crate::cli::parse::{between, count};

/// The options of what is written.
#[derive(clap::Args)]
pub(in crate::cli) struct OutputArguments {
    /// Write to this file: .npy, .npz, .csv, .h5, .mat, .parquet or .zarr; FOLDER/ with --format npy, parquet or spd;
    /// or -, which is standard output, as CSV or with --format npy
    // The parser of paths would not take the empty one that stands for none in `scene`.
    #[arg(short, long, value_name = "OUT", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    pub(in crate::cli) output: PathBuf,
    /// The format [default: what the name says]
    #[arg(long, value_enum)]
    format: Option<FileFormat>,
    /// The type of the numbers; beside f16 spectra, labels such as lrv, intensity and xyz stay f32, and spectra that are
    /// too bright or too dim for f16 are an error
    #[arg(long, value_enum, default_value = "f32")]
    dtype: Dtype,
    /// Number of draws per chunk of a .zarr or of FOLDER/ [default: about 16 MiB]
    #[arg(long, value_name = "DRAWS", value_parser = count, allow_negative_numbers = true)]
    chunk: Option<u64>,
    /// Pack the chunks of a .zarr with Zstandard [level: 3]
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, default_missing_value = "3", value_parser = between::<1, 22>,
          allow_negative_numbers = true)]
    zstd: Option<u32>,
    /// Make only the I-th of N parts of a .zarr or FOLDER/; auto takes them from Slurm's or Kubernetes' variables, which
    /// a --dry-run does without, and auto/1-8 of jobs first submitted with --array=1-8
    #[arg(long, value_name = "I/N|auto|auto/N|auto/FIRST-LAST", allow_hyphen_values = true)]
    shard: Option<ShardName>,
    /// Go on with a .zarr or FOLDER/ that an earlier run began, if one did
    #[arg(long)]
    resume: bool,
    /// Replace what exists
    #[arg(long, conflicts_with_all = ["resume", "shard"])]
    pub(in crate::cli) force: bool,
    /// Write NAME.spectroll.json beside a single file, with which `spectroll verify NAME` checks and repairs it
    #[arg(long)]
    sidecar: bool,
    /// Begin although the disk has no room for all of it
    #[arg(long)]
    force_space: bool,
}

/// Purpose of the options.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::cli) enum Purpose {
    /// To make the data set, for which a shard has to be known.
    Run,
    /// To say what would be made: without a scheduler, the whole of it.
    DryRun,
}

impl Purpose {
    /// The purpose of a command with or without `--dry-run`.
    pub(in crate::cli) fn of(dry_run: bool) -> Purpose {
        if dry_run { Purpose::DryRun } else { Purpose::Run }
    }
}

impl OutputArguments {
    pub(in crate::cli) fn to_stdout(&self) -> bool {
        self.output == Path::new("-")
    }

    /// Whether a run would write anywhere at all.
    pub(in crate::cli) fn is_given(&self) -> bool {
        !self.output.as_os_str().is_empty()
    }

    /// Treatment of a file that exists.
    pub(in crate::cli) fn if_exists(&self) -> IfExists {
        if_exists(self.force)
    }

    /// Combines the name and the options.
    pub(in crate::cli) fn resolve(&self, purpose: Purpose) -> anyhow::Result<Output> {
        let destination = self.destination()?;
        let mut output = Output::at(&self.output, destination).dtype(self.dtype).mode(match self.resume {
            true => SetMode::Resume,
            false if self.force => SetMode::Replace,
            false => SetMode::Create,
        });
        if let Some(rows) = self.chunk {
            output = output.chunk(rows);
        }
        if self.sidecar {
            output = output.with_sidecar();
        }
        if self.force_space {
            output = output.space_check(SpaceCheck::Skip);
        }
        if let Some(shard) = self.shard {
            output = output.shard(match (shard.resolve(), purpose) {
                (Err(_), Purpose::DryRun) if shard.is_auto() => Shard::WHOLE,
                (shard, _) => shard?,
            });
        }
        Ok(output)
    }

    fn destination(&self) -> anyhow::Result<Destination> {
        let usage = |text: &str| anyhow::Error::from(Usage(text.to_owned()));
        let is_folder =
            self.output.as_os_str().as_encoded_bytes().last().is_some_and(|&b| b == b'/' || b == b'\\');
        let destination = match self.format {
            format if self.to_stdout() => Destination::Stdout(format.unwrap_or(FileFormat::Csv)),
            _ => match self.format.map_or_else(|| FileFormat::of(&self.output), Ok)? {
                FileFormat::Zarr => {
                    let zstd = self.zstd.map(|level| level as i32); // at most 22
                    Destination::Set(ChunkFormat::Zarr { zstd })
                }
                FileFormat::Spd => Destination::SpdFolder,
                FileFormat::Npy if is_folder => Destination::Set(ChunkFormat::Npy),
                FileFormat::Parquet if is_folder => Destination::Set(ChunkFormat::Parquet),
                _ if is_folder => {
                    return Err(usage("a folder holds parts in --format npy or parquet, or spd files"));
                }
                file => Destination::File(file),
            },
        };
        if self.zstd.is_some() && !matches!(destination, Destination::Set(ChunkFormat::Zarr { .. })) {
            return Err(usage("--zstd is for .zarr"));
        }
        let of_sets =
            [("--chunk", self.chunk.is_some()), ("--shard", self.shard.is_some()), ("--resume", self.resume)];
        if let (false, Some((flag, _))) =
            (matches!(destination, Destination::Set(_)), of_sets.iter().find(|(_, given)| *given))
        {
            return Err(usage(&format!(
                "{flag} needs an output of many files: name it .zarr, or FOLDER/ with --format npy or parquet"
            )));
        }
        if self.sidecar && !matches!(destination, Destination::File(_)) {
            return Err(usage("--sidecar is for single files: sets of chunks have a manifest"));
        }
        if self.chunk == Some(0) {
            return Err(usage("a chunk has at least one draw"));
        }
        Ok(destination)
    }
}
