//! Where draws go: what `--output` and the flags beside it name.

use std::io::{self, BufWriter};
use std::ops::Range;
use std::path::{Path, PathBuf};

use clap::ValueEnum;
use clap::builder::{OsStringValueParser, TypedValueParser};
use spectroll::Dtype;
use spectroll::output::{
    ChunkFormat, CsvWriter, FileFormat, FileWriter, OutputError, Schema, SetMode, SetPlan, SetStatus,
    SetWriter, Shard, SpdFolder, SpdName,
};

use super::shard::ShardName;
use super::{Interrupted, Usage, count, existing};

/// The flags of what is written.
#[derive(clap::Args)]
pub(super) struct OutputArguments {
    /// Where to: .npy, .npz, .csv, .h5, .mat (MATLAB v7.3), .parquet or .zarr; FOLDER/ with --format npy, parquet or
    /// spd; - is CSV on standard output
    // The parser of paths would not take the empty one that stands for none in `scene`.
    #[arg(short, long, value_name = "OUT", value_parser = OsStringValueParser::new().map(PathBuf::from))]
    pub(super) output: PathBuf,
    /// The format [default: what the name says]
    #[arg(long, value_enum)]
    format: Option<FormatName>,
    /// The type of the numbers
    #[arg(long, value_enum, default_value = "f32")]
    dtype: TypeName,
    /// How many draws each chunk of a .zarr or of FOLDER/ has [default: what makes about 16 MiB]
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
    pub(super) force: bool,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum FormatName {
    /// NumPy, one array
    Npy,
    /// NumPy, an array for each quantity
    Npz,
    /// Text
    Csv,
    /// HDF5
    H5,
    /// MATLAB v7.3
    Mat,
    /// Parquet
    Parquet,
    /// Zarr, version 3
    Zarr,
    /// A folder of text files, one for each spectrum, for renderers
    Spd,
}

#[derive(Clone, Copy, ValueEnum)]
enum TypeName {
    F16,
    F32,
    F64,
}

/// What kind of thing is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Destination {
    Stdout,
    File(FileFormat),
    Spd,
    Set(ChunkFormat),
}

impl OutputArguments {
    pub(super) fn to_stdout(&self) -> bool {
        self.output == Path::new("-")
    }

    pub(super) fn element(&self) -> Dtype {
        match self.dtype {
            TypeName::F16 => Dtype::F16,
            TypeName::F32 => Dtype::F32,
            TypeName::F64 => Dtype::F64,
        }
    }

    /// What the name and the flags mean together.
    pub(super) fn target(&self) -> anyhow::Result<Destination> {
        let usage = |text: &str| anyhow::Error::from(Usage(text.to_owned()));
        let format = self.format.map(|format| match format {
            FormatName::Npy => FileFormat::Npy,
            FormatName::Npz => FileFormat::Npz,
            FormatName::Csv => FileFormat::Csv,
            FormatName::H5 => FileFormat::Hdf5,
            FormatName::Mat => FileFormat::Mat,
            FormatName::Parquet => FileFormat::Parquet,
            FormatName::Zarr => FileFormat::Zarr,
            FormatName::Spd => FileFormat::Spd,
        });
        let is_folder =
            self.output.as_os_str().as_encoded_bytes().last().is_some_and(|&b| b == b'/' || b == b'\\');
        let target = match format {
            Some(FileFormat::Csv) | None if self.to_stdout() => Destination::Stdout,
            Some(_) if self.to_stdout() => {
                return Err(usage("standard output takes CSV only: name a file, or drop --format"));
            }
            _ => match format.map_or_else(|| FileFormat::of(&self.output), Ok)? {
                FileFormat::Zarr => Destination::Set(ChunkFormat::Zarr { zstd: self.zstd }),
                FileFormat::Spd => Destination::Spd,
                FileFormat::Npy if is_folder => Destination::Set(ChunkFormat::Npy),
                FileFormat::Parquet if is_folder => Destination::Set(ChunkFormat::Parquet),
                _ if is_folder => {
                    return Err(usage("a folder holds parts in --format npy or parquet, or spd files"));
                }
                file => Destination::File(file),
            },
        };
        if self.zstd.is_some() && !matches!(target, Destination::Set(ChunkFormat::Zarr { .. })) {
            return Err(usage("--zstd is for .zarr"));
        }
        let of_sets =
            [("--chunk", self.chunk.is_some()), ("--shard", self.shard.is_some()), ("--resume", self.resume)];
        if let (false, Some((flag, _))) =
            (matches!(target, Destination::Set(_)), of_sets.iter().find(|(_, given)| *given))
        {
            return Err(usage(&format!(
                "{flag} needs an output of many files: name it .zarr, or FOLDER/ with --format npy or parquet"
            )));
        }
        if self.chunk == Some(0) {
            return Err(usage("a chunk has at least one draw"));
        }
        Ok(target)
    }

    /// A set of chunks of these draws.
    pub(super) fn plan(&self, layout: ChunkFormat, schema: &Schema) -> SetPlan {
        let chunk =
            self.chunk.unwrap_or_else(|| ChunkFormat::default_chunk(schema.row_bytes(), schema.count));
        SetPlan { layout, chunk, schema: schema.clone() }
    }

    fn start(&self) -> SetMode {
        match (self.resume, self.force) {
            (true, _) => SetMode::Resume,
            (_, true) => SetMode::Replace,
            _ => SetMode::Create,
        }
    }

    /// Refuses what the target cannot hold.
    pub(super) fn check(&self, target: Destination, schema: &Schema) -> Result<(), OutputError> {
        match target {
            Destination::Stdout => Ok(()),
            Destination::File(format) => format.check(&self.output, schema),
            Destination::Spd => FileFormat::Spd.check(&self.output, schema),
            Destination::Set(layout) => layout.check(&self.output, schema),
        }
    }

    /// Opens the target. `companions` are files that lie beside the chunks of a set, by name; `engine` draws.
    pub(super) fn open(
        &self,
        target: Destination,
        schema: &Schema,
        (name, first): (SpdName, u64),
        (companions, engine): (&[(&str, &str)], &str),
    ) -> anyhow::Result<Sink> {
        let (path, existing) = (self.output.as_path(), existing(self.force));
        Ok(match target {
            Destination::Stdout => Sink::Stdout(CsvWriter::new(BufWriter::new(io::stdout()), schema)?),
            Destination::File(format) => Sink::File(FileWriter::create(path, format, schema, existing)?),
            Destination::Spd => Sink::Spd(SpdFolder::create(path, schema, name, first, existing)?),
            Destination::Set(layout) => {
                let shard = self.shard.map_or(Ok(Shard::WHOLE), ShardName::resolve)?;
                let plan = self.plan(layout, schema);
                let set = SetWriter::open(path, plan, companions, (shard, self.start()), engine)?;
                Sink::Set(Box::new(set))
            }
        })
    }
}

/// Where the draws go.
pub(super) enum Sink {
    Stdout(CsvWriter),
    File(FileWriter),
    Spd(SpdFolder),
    Set(Box<SetWriter>),
}

impl Sink {
    /// The draws that are wanted, in order, of `count`.
    pub(super) fn missing(&self, count: u64) -> Vec<Range<u64>> {
        match self {
            Sink::Set(set) => set.missing(),
            _ => std::iter::once(0..count).collect(),
        }
    }

    pub(super) fn write(&mut self, columns: &[&[u8]]) -> anyhow::Result<()> {
        match self {
            Sink::Stdout(csv) => Ok(csv.write(columns)?),
            Sink::File(file) => Ok(file.write(columns)?),
            Sink::Spd(folder) => Ok(folder.write(columns)?),
            Sink::Set(set) => Ok(set.write(columns)?),
        }
    }

    /// Completes what was written. An outcome other than `Sealed` is one of sets.
    pub(super) fn finish(self) -> anyhow::Result<SetStatus> {
        match self {
            Sink::Stdout(_) => {} // each window was flushed
            Sink::File(file) => file.finish()?,
            Sink::Spd(folder) => folder.finish()?,
            Sink::Set(set) => return Ok(set.finish()?),
        }
        Ok(SetStatus::Sealed)
    }

    /// Keeps what is finished after an error, and adds to it how to go on.
    pub(super) fn stop(self, error: anyhow::Error) -> anyhow::Error {
        let Sink::Set(set) = self else { return error };
        let folder = set.folder().to_owned();
        let kept = match set.stop() {
            Ok((done, all)) => {
                format!("{done} of {all} chunks are finished in {folder:?}: pass --resume to go on")
            }
            Err(e) => format!("what is finished is in {folder:?}: pass --resume to go on ({e})"),
        };
        if error.is::<Interrupted>() {
            return Interrupted(kept).into();
        }
        let text = format!("{error}; {kept}");
        error.context(text)
    }
}
