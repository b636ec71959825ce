//! Data sets as files, one format per module. A file or folder under its final name is complete.
//!
//! A data set is columns of numbers, a row a draw ([`Schema`]). It comes in windows of any length, in order, and ends
//! in a single file ([`FileWriter`]), a folder of text files ([`SpdFolder`]), or a set of chunks that can be resumed
//! and shared ([`SetWriter`]).

mod byte_count;
mod csv;
#[cfg(feature = "hdf5")]
mod h5;
mod lock;
mod mat;
mod npy;
mod npz;
#[cfg(feature = "parquet")]
mod parquet;
mod pending;
mod schema;
mod set;
mod sidecar;
mod spd;
mod sum;

use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::quantity::Dtype;
use crate::threads::ThreadError;

pub use byte_count::ByteCount;
pub(crate) use pending::available_space;
pub use pending::{FolderMark, IfExists, PendingFile, PendingFolder, write_file};
pub use schema::{Field, LrvLabel, Schema, SharedArray, SpectraArray};
pub use set::{
    ChunkFormat, Fault, Piece, Progress, SetAudit, SetMode, SetPlan, SetStatus, SetWriter, Shard, merge,
};
pub use sidecar::Sidecar;
pub use spd::{MOST_FILES, SpdFolder, files as spd_files};

/// File format of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "cli", derive(clap::ValueEnum))]
#[serde(rename_all = "lowercase")]
#[non_exhaustive]
pub enum FileFormat {
    /// NumPy: one array, C order.
    Npy,
    /// NumPy: one array per quantity.
    Npz,
    /// Text: one line per draw.
    Csv,
    /// HDF5, chunked by draws.
    #[cfg_attr(feature = "cli", value(name = "h5"))]
    Hdf5,
    /// MATLAB: v5 where every variable is below 2 GB, and v7.3 above.
    Mat,
    /// Parquet: one column per quantity.
    Parquet,
    /// A Zarr store, version 3.
    Zarr,
    /// A folder of text files, one a spectrum, in a folder for each group of a scene.
    Spd,
}

/// Error returned where a data set cannot be written, or cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
#[allow(missing_docs)] // the messages say what the fields are
pub enum OutputError {
    #[error("{path:?}: unknown format; name it {}, or say which format it is", FileFormat::EXTENSIONS)]
    UnknownFormat { path: PathBuf },
    #[error("{path:?} exists already: choose another name, or replace it")]
    Exists { path: PathBuf },
    #[error("{path:?} is a folder: name a file")]
    Folder { path: PathBuf },
    #[error("{path:?} is a folder that exists already: name another, or replace it")]
    FolderExists { path: PathBuf },
    #[error("{path:?} is not {expected}, so it is left alone: name another")]
    NotOurs { path: PathBuf, expected: &'static str },
    #[error("{path:?} is not a folder, and a folder is what would be written: name another")]
    NotAFolder { path: PathBuf },
    #[error("{path:?} is not a plain file, and would be replaced by one: choose another name")]
    Special { path: PathBuf },
    #[error("{folder:?} does not exist: create it first")]
    NoFolder { folder: PathBuf },
    #[error("cannot write {path:?}: {source}")]
    Write { path: PathBuf, source: io::Error },
    #[error(transparent)]
    Threads(#[from] ThreadError),
    #[error("cannot read {path:?}: {source}")]
    Read { path: PathBuf, source: io::Error },
    #[error("{path:?}: {format} hold {holds}; {remedy}")]
    Cannot { path: PathBuf, format: &'static str, holds: &'static str, remedy: &'static str },
    #[error("{path:?}: this build leaves out {what}: build it with the feature {feature}")]
    NotBuilt { path: PathBuf, what: &'static str, feature: &'static str },
    #[error(
        "{path:?} would be a folder of {count} files, and folders of more than {MOST_FILES} are slow to open and to \
         delete: choose another format, or write it anyway"
    )]
    ManyFiles { path: PathBuf, count: u64 },
    #[error(
        "{path:?} would be a set of {chunks} chunks, and a set has at most a million: make them larger, or several sets"
    )]
    ManyChunks { path: PathBuf, chunks: u64 },
    #[error(
        "{path:?} would have chunks of {rows} draws, {bytes} each, of which four are in memory at once: let a chunk have \
         at most {most}"
    )]
    LargeChunks { path: PathBuf, rows: u64, bytes: ByteCount, most: u64 },
    #[error("standard output takes CSV and .npy alone: choose one of them, or name a file")]
    NotStreamed,
    #[error("{} needs {bound}{needs} and {free} are free here", path.display())]
    NoSpace { path: PathBuf, bound: &'static str, needs: ByteCount, free: ByteCount },
    #[error("{root:?} holds an unfinished data set: resume it, or replace it")]
    Unfinished { path: PathBuf, root: PathBuf },
    #[error("{path:?} holds another data set: {difference}")]
    Different { path: PathBuf, difference: String },
    #[error("{path:?} is damaged: {fault}; repair it, or make it again, replacing it")]
    Damaged { path: PathBuf, fault: String },
    #[error("{path:?} is not what was written: {faults}; make what is damaged again, resuming the set")]
    DamagedParts { path: PathBuf, faults: String },
    #[error("{root:?} is being written by {holder}: wait until that ends, or end it")]
    Busy { root: PathBuf, holder: String },
    #[error(
        "{root:?} holds a data set, and its file system has no locks that would tell whether another process still \
         writes it: delete it if none does"
    )]
    NoLocks { root: PathBuf },
    #[error("{root:?} was begun again by another process: what this one made is gone")]
    Replaced { root: PathBuf },
    #[error(
        "part {} of {} was finished before, and {root:?} is not complete, with {done} of {chunks} chunks: {missing}, \
         which nobody makes now",
        .shard.index,
        .shard.count
    )]
    NothingMade { root: PathBuf, shard: Shard, done: u64, chunks: u64, missing: String },
    #[error("{}", not_a_set(path))]
    NotASet { path: PathBuf },
    #[error("cannot use the manifest {path:?}: {reason}")]
    Manifest { path: PathBuf, reason: String },
    #[error("{path:?} is the manifest of another version of this program: {remedy}")]
    ManifestVersion { path: PathBuf, remedy: &'static str },
    #[error("{path:?} has no sidecar that says what was written: write one with the file")]
    NoSidecar { path: PathBuf },
    #[error("cannot repair {path:?}: {reason}")]
    Unrepaired { path: PathBuf, reason: String },
    #[error("{path:?} is not complete: {done} of {chunks} chunks are done")]
    Incomplete { path: PathBuf, done: u64, chunks: u64 },
}

fn not_a_set(path: &Path) -> String {
    let partial = partial(path);
    match (path.exists(), partial.is_dir()) {
        (true, _) => format!("{path:?} is not a data set of this program: it has no manifest"),
        (false, true) => format!("{path:?} is not complete: its chunks are in {partial:?}"),
        (false, false) => format!("{path:?} does not exist"),
    }
}

/// Folder of a set's chunks until it is complete.
fn partial(path: &Path) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".partial");
    PathBuf::from(name)
}

impl FileFormat {
    /// Extensions that name formats.
    const EXTENSIONS: &str = ".npy, .npz, .csv, .h5, .mat, .parquet or .zarr";

    /// Returns the format that the extension of `path` names.
    pub fn of(path: impl AsRef<Path>) -> Result<FileFormat, OutputError> {
        let path = path.as_ref();
        match path.extension().and_then(|e| e.to_str()).map(str::to_ascii_lowercase).as_deref() {
            Some("npy") => Ok(FileFormat::Npy),
            Some("npz") => Ok(FileFormat::Npz),
            Some("csv") => Ok(FileFormat::Csv),
            Some("h5" | "hdf5") => Ok(FileFormat::Hdf5),
            Some("mat") => Ok(FileFormat::Mat),
            Some("parquet") => Ok(FileFormat::Parquet),
            Some("zarr") => Ok(FileFormat::Zarr),
            Some("spd") => Ok(FileFormat::Spd),
            _ => Err(OutputError::UnknownFormat { path: path.to_owned() }),
        }
    }

    /// Whether the bytes of the format come in order, so that they can go to a pipe.
    pub fn is_streamed(self) -> bool {
        matches!(self, FileFormat::Csv | FileFormat::Npy)
    }

    /// An error where the format cannot hold what a schema says, of which `spectra` are spectra, or was left out of this
    /// build.
    pub fn check(self, path: &Path, schema: &Schema, spectra: &[SpectraArray]) -> Result<(), OutputError> {
        let path = path.to_owned();
        let built = match self {
            FileFormat::Hdf5 => (cfg!(feature = "hdf5"), "HDF5", "hdf5"),
            FileFormat::Mat if !mat::fits_v5(schema, mat::V5_BYTES) => {
                (cfg!(feature = "hdf5"), "MATLAB v7.3, for variables of 2 GB or more", "hdf5")
            }
            FileFormat::Parquet => (cfg!(feature = "parquet"), "Parquet", "parquet"),
            _ => (true, "", ""),
        };
        if let (false, what, feature) = built {
            return Err(OutputError::NotBuilt { path, what, feature });
        }
        let one = schema.fields.len() == 1;
        let shares = !schema.shared.is_empty();
        let fields = schema.fields.iter().map(|field| field.stored);
        let mut dtypes = fields.chain(schema.shared.iter().map(|shared| shared.dtype));
        let halves = dtypes.clone().any(|dtype| dtype == Dtype::F16);
        let singles = dtypes.all(|dtype| matches!(dtype, Dtype::F32 | Dtype::U32));
        let cannot = |format, holds, remedy| Err(OutputError::Cannot { path, format, holds, remedy });
        let of_scenes = schema.row == "scene";
        match self {
            FileFormat::Npy | FileFormat::Csv | FileFormat::Parquet if shares => cannot(
                "these files",
                "what each draw has",
                "repeat what all share, or name it .npz, .zarr or .h5",
            ),
            FileFormat::Npy if !one && of_scenes => {
                let remedy = "choose one array, or name it .npz, .zarr, .h5 or .parquet";
                cannot(".npy files", "one array", remedy)
            }
            FileFormat::Npy if !one => {
                let remedy = "choose one quantity, or name it .npz, .zarr, .h5 or .parquet";
                cannot(".npy files", "one array", remedy)
            }
            FileFormat::Spd if !spd::holds(schema, spectra) => {
                let scene = "choose the spectra of one group or more";
                cannot(".spd files", "spectra", if of_scenes { scene } else { "choose spectra alone" })
            }
            FileFormat::Spd if !singles => cannot(".spd files", "f32 alone, as text", "leave out the type"),
            FileFormat::Mat if !mat::has_names(schema, spectra) => {
                cannot(".mat files", "names of up to 63 letters, digits and _, each once", "rename the group")
            }
            FileFormat::Mat if halves => cannot(".mat files", "f32 and f64", "choose one of them"),
            FileFormat::Parquet if halves => cannot(".parquet files", "f32 and f64", "choose one of them"),
            _ => Ok(()),
        }
    }
}

impl ChunkFormat {
    /// Returns an error where the format cannot hold a schema, or was left out of this build.
    pub fn check(self, path: &Path, schema: &Schema) -> Result<(), OutputError> {
        let cannot = |holds, remedy| {
            Err(OutputError::Cannot { path: path.to_owned(), format: "sets of chunks", holds, remedy })
        };
        match self {
            _ if schema.fields.is_empty() => cannot(
                "what differs from scene to scene",
                "choose another array, or name it .npz, .h5 or .mat",
            ),
            ChunkFormat::Zarr { zstd: Some(_) } if !cfg!(feature = "zstd") => {
                Err(OutputError::NotBuilt { path: path.to_owned(), what: "Zstandard", feature: "zstd" })
            }
            ChunkFormat::Zarr { .. } | ChunkFormat::Npy => Ok(()),
            ChunkFormat::Parquet => FileFormat::Parquet.check(path, schema, &[]),
        }
    }
}

/// Encoder of windows of columns into the bytes of one file.
trait Encoder {
    /// Writes the next window.
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()>;

    /// Ends the file.
    fn finish(self: Box<Self>) -> io::Result<()>;
}

/// Writer of a file that appears under its name only when it is complete.
pub struct FileWriter {
    encoder: Box<dyn Encoder>,
    pending: PendingFile,
}

impl FileWriter {
    /// Begins a file that will appear as `path`. The format is one of those of a single file; `spectra` are the arrays of
    /// spectra in the schema.
    pub fn create(
        path: &Path,
        format: FileFormat,
        schema: &Schema,
        spectra: &[SpectraArray],
        existing: IfExists,
    ) -> Result<FileWriter, OutputError> {
        format.check(path, schema, spectra)?;
        let pending = PendingFile::create(path, existing)?;
        let encoder = encoder(format, (schema, spectra), &pending).map_err(|e| pending.failed(e))?;
        Ok(FileWriter { encoder, pending })
    }

    /// Writes the next draws: a column for each field of the schema.
    pub fn write(&mut self, columns: &[&[u8]]) -> Result<(), OutputError> {
        self.encoder.write(columns).map_err(|e| self.pending.failed(e))
    }

    /// Makes the file appear under its name, complete and on disk.
    pub fn finish(self) -> Result<(), OutputError> {
        self.encoder.finish().map_err(|e| self.pending.failed(e))?;
        Sidecar::finish(None, self.pending)
    }

    /// Makes the file appear under its name, and its sidecar beside it.
    pub fn finish_with(self, sidecar: Sidecar) -> Result<(), OutputError> {
        self.encoder.finish().map_err(|e| self.pending.failed(e))?;
        Sidecar::finish(Some(sidecar), self.pending)
    }
}

fn encoder(
    format: FileFormat,
    (schema, spectra): (&Schema, &[SpectraArray]),
    pending: &PendingFile,
) -> io::Result<Box<dyn Encoder>> {
    let file = pending.file().map_err(|e| match e {
        OutputError::Write { source, .. } => source,
        other => io::Error::other(other),
    })?;
    Ok(match format {
        FileFormat::Npy => Box::new(npy::Npy::begin(file, schema)?),
        FileFormat::Npz => Box::new(npz::Npz::begin(file, schema)?),
        FileFormat::Csv => Box::new(csv::Csv::begin(BufWriter::new(file), schema)?),
        #[cfg(feature = "hdf5")]
        FileFormat::Hdf5 => Box::new(h5::Hdf5::begin(pending.temporary_path(), schema)?),
        FileFormat::Mat => {
            mat::begin(file, pending.temporary_path(), &mat::named(schema, spectra), mat::V5_BYTES)?
        }
        #[cfg(feature = "parquet")]
        FileFormat::Parquet => Box::new(parquet::Parquet::begin(file, schema)?),
        _ => unreachable!("the others are no single files, or were refused by Format::check"),
    })
}

/// Writer of a data set to a stream, such as standard output.
pub struct StreamWriter(Box<dyn Encoder>);

impl StreamWriter {
    /// Begins with the header, which may be an error of the stream. The format is one that can be streamed.
    pub fn new(
        to: impl io::Write + 'static,
        format: FileFormat,
        schema: &Schema,
    ) -> Result<io::Result<StreamWriter>, OutputError> {
        fn boxed<E: Encoder + 'static>(encoder: io::Result<E>) -> io::Result<StreamWriter> {
            Ok(StreamWriter(Box::new(encoder?)))
        }
        match format {
            FileFormat::Csv => Ok(boxed(csv::Csv::begin(to, schema))),
            FileFormat::Npy => Ok(boxed(npy::Npy::begin(to, schema))),
            _ => Err(OutputError::NotStreamed),
        }
    }

    /// Writes the next draws: a column for each field of the schema.
    pub fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        self.0.write(columns)
    }

    /// Hands on what is left.
    pub fn finish(self) -> io::Result<()> {
        self.0.finish()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formats_are_known_by_their_names() {
        assert_eq!(FileFormat::of(Path::new("a/b.NPY")).unwrap(), FileFormat::Npy);
        assert_eq!(FileFormat::of(Path::new("b.zarr/")).unwrap(), FileFormat::Zarr);
        assert!(FileFormat::of(Path::new("x.xlsx")).unwrap_err().to_string().contains(".npy, .npz, .csv"));
    }

    #[test]
    fn what_a_format_cannot_hold_is_refused() {
        let spectra = Field::vector("spectra", "wavelength", 31, Dtype::F32);
        let lrv = Field::scalar("lrv", Dtype::F32);
        let schema = |fields: &[&Field]| Schema {
            fields: fields.iter().copied().cloned().collect(),
            row: "draw".to_owned(),
            shared: Vec::new(),
            count: 1,
            wavelengths: vec![400.0; 31],
            attributes: serde_json::Map::new(),
        };
        let error = |format: FileFormat, schema: &Schema| {
            let spectra = SpectraArray {
                name: "spectra".to_owned(),
                group: None,
                kind: crate::dataset::SpectrumKind::Reflectance,
                lrv: LrvLabel::None,
            };
            format.check(Path::new("x"), schema, &[spectra]).err().map(|e| e.to_string()).unwrap_or_default()
        };
        assert!(error(FileFormat::Npy, &schema(&[&spectra, &lrv])).contains("hold one array"));
        assert!(error(FileFormat::Spd, &schema(&[&lrv])).contains("hold spectra"));
        let halves = schema(&[&spectra.clone().stored_as(Dtype::F16)]);
        assert_eq!(error(FileFormat::Npy, &halves), "");
        assert!(error(FileFormat::Mat, &halves).contains("f32 and f64"));
        let shared = SharedArray {
            name: "spectra".to_owned(),
            axes: vec![("number".to_owned(), 1), ("wavelength".to_owned(), 31)],
            dtype: Dtype::F16,
            bytes: Vec::new(),
        };
        let shares = Schema { shared: vec![shared], ..schema(&[&lrv]) };
        assert!(error(FileFormat::Mat, &shares).contains("f32 and f64"));
        let doubles = schema(&[&spectra.clone().stored_as(Dtype::F64)]);
        assert!(error(FileFormat::Spd, &doubles).contains("hold f32 alone"));
    }
}
