//! Options of where a data set goes: `--output` and the options beside it.

use std::path::{Path, PathBuf};

use clap::builder::{OsStringValueParser, TypedValueParser};
use spectroll::Dtype;
use spectroll::export::{Destination, Output};
use spectroll::output::{ChunkFormat, FileFormat, IfExists, SetMode};

use super::shard::ShardName;
use crate::cli::exit::Usage;
use crate::cli::if_exists;
use crate::cli::parse::count;

/// The options of what is written.
#[derive(clap::Args)]
pub(in crate::cli) struct OutputArguments {
    /// Write to this file: .npy, .npz, .csv, .h5, .mat, .parquet or .zarr; FOLDER/ with --format npy, parquet or spd;
    /// or -, which is CSV on standard output
    // The parser of paths would not take the empty one that stands for none in `scene`.
    #[arg(short, long, value_name = "OUT", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    pub(in crate::cli) output: PathBuf,
    /// The format [default: what the name says]
    #[arg(long, value_enum)]
    format: Option<FileFormat>,
    /// The type of the numbers
    #[arg(long, value_enum, default_value = "f32")]
    dtype: Dtype,
    /// Number of draws per chunk of a .zarr or of FOLDER/ [default: about 16 MiB]
    #[arg(long, value_name = "DRAWS", value_parser = count)]
    chunk: Option<u64>,
    /// Pack the chunks of a .zarr with Zstandard [level: 3]
    #[arg(long, value_name = "LEVEL", num_args = 0..=1, default_missing_value = "3",
          value_parser = clap::value_parser!(i32).range(1..=22))]
    zstd: Option<i32>,
    /// Make only the I-th of N parts of a .zarr or FOLDER/; auto takes them from Slurm's or Kubernetes' variables
    #[arg(long, value_name = "I/N|auto|auto/N")]
    shard: Option<ShardName>,
    /// Go on with a .zarr or FOLDER/ that an earlier run began, if one did
    #[arg(long)]
    resume: bool,
    /// Replace what exists
    #[arg(long, conflicts_with_all = ["resume", "shard"])]
    pub(in crate::cli) force: bool,
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
    pub(in crate::cli) fn resolve(&self) -> anyhow::Result<Output> {
        let destination = self.destination()?;
        let mut output = Output::at(&self.output, destination).dtype(self.dtype).mode(match self.resume {
            true => SetMode::Resume,
            false if self.force => SetMode::Replace,
            false => SetMode::Create,
        });
        if let Some(rows) = self.chunk {
            output = output.chunk(rows);
        }
        if let Some(shard) = self.shard {
            output = output.shard(shard.resolve()?);
        }
        Ok(output)
    }

    fn destination(&self) -> anyhow::Result<Destination> {
        let usage = |text: &str| anyhow::Error::from(Usage(text.to_owned()));
        let is_folder =
            self.output.as_os_str().as_encoded_bytes().last().is_some_and(|&b| b == b'/' || b == b'\\');
        let destination = match self.format {
            Some(FileFormat::Csv) | None if self.to_stdout() => Destination::Stdout(FileFormat::Csv),
            Some(_) if self.to_stdout() => {
                return Err(usage("standard output takes CSV only: name a file, or drop --format"));
            }
            _ => match self.format.map_or_else(|| FileFormat::of(&self.output), Ok)? {
                FileFormat::Zarr => Destination::Set(ChunkFormat::Zarr { zstd: self.zstd }),
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
        if self.chunk == Some(0) {
            return Err(usage("a chunk has at least one draw"));
        }
        Ok(destination)
    }
}
