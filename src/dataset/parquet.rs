//! Parquet: columns of lists, which are spectra with their wavelengths in the file's notes, or columns of numbers, which
//! are named by wavelengths or stand beside a column of them.

use std::io::{self, Read};
use std::path::Path;

use bytes::Bytes;
use half::f16;
use parquet::basic::{Compression, ConvertedType, LogicalType};
use parquet::column::reader::{ColumnReader, ColumnReaderImpl};
use parquet::data_type::{ByteArray, DataType, FixedLenByteArray};
use parquet::errors::ParquetError;
use parquet::file::reader::{ChunkReader, FileReader, Length, SerializedFileReader};
use parquet::schema::types::ColumnDescriptor;

use super::arrays::{self, Array, Arrays, Order};
use super::files::Source;
use super::reading::{Decimal, ReadOptions, Reading};
use super::sheet::{Cell, Sheet};
use super::thrift::{self, Field};
use super::{DatasetError, MAX_BYTES, MAX_VALUES, text};
use crate::caught::caught;

/// Records that are read at a time: spectra, where a column is one of lists.
const BATCH: usize = 1 << 10;

/// Number of bytes at the end of a file: the length of its description, and `PAR1`.
const FOOT: u64 = 8;

/// Fields of a page's header: its type, its unpacked size, and the numbers of values of each type of page.
const PAGE_TYPE: Field = (None, 1);
const UNPACKED_SIZE: Field = (None, 2);
const DATA_VALUES: [Field; 2] = [(Some(5), 1), (Some(8), 1)];
const DICTIONARY_VALUES: Field = (Some(7), 1);

/// Type of a page: a dictionary.
const DICTIONARY: i64 = 2;

/// Largest number of words of a column: names of spectra are fewer.
const MAX_TEXTS: usize = 2_000_000;

/// Meaning of the numbers of a column, which their type alone does not tell.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Meaning {
    Itself,
    /// Bytes of a number of half precision.
    Half,
    Unsigned,
    /// Integers with as many digits behind the point.
    Decimal(i32),
}

impl Meaning {
    fn of(column: &ColumnDescriptor) -> Meaning {
        match (column.logical_type_ref(), column.converted_type()) {
            (Some(LogicalType::Float16), _) => Meaning::Half,
            (Some(LogicalType::Decimal { .. }), _) | (_, ConvertedType::DECIMAL) => {
                Meaning::Decimal(column.type_scale())
            }
            (_, ConvertedType::UINT_8 | ConvertedType::UINT_16) => Meaning::Unsigned,
            (_, ConvertedType::UINT_32 | ConvertedType::UINT_64) => Meaning::Unsigned,
            _ => Meaning::Itself,
        }
    }

    /// Divisor of the numbers of a column.
    fn divisor(self) -> f64 {
        match self {
            Meaning::Decimal(digits) => 10f64.powi(digits),
            _ => 1.0,
        }
    }
}

/// A column, read.
struct Column {
    name: String,
    /// NaN where a value is null.
    values: Vec<f64>,
    /// Number of values of a row, where the column is one of lists.
    width: Option<usize>,
    /// Text instead of numbers.
    texts: Vec<String>,
}

/// A source, and a reader of it, whose end is an error: the parser skips what it does not know without a look at whether
/// any of it is there, and a damaged file may claim two thousand million of it. What it parses is walked before.
struct Ending<S>(S);

impl<S: ChunkReader> Ending<S> {
    /// A source, whose description of the file is walked.
    fn new(source: S) -> Result<Self, ParquetError> {
        let mut foot = [0; FOOT as usize];
        let length = source.len();
        let ending = Ending(source);
        let start = length.checked_sub(FOOT).ok_or_else(cut_short)?;
        ending.0.get_read(start)?.read_exact(&mut foot)?;
        let (size, _) = foot.split_first_chunk().expect("it has 8 bytes");
        let size = u64::from(u32::from_le_bytes(*size));
        let start = start.checked_sub(size).ok_or_else(cut_short)?;
        thrift::walk(Ending(ending.0.get_read(start)?).take(size))?;
        Ok(ending)
    }
}

impl<S: Length> Length for Ending<S> {
    fn len(&self) -> u64 {
        self.0.len()
    }
}

impl<S: ChunkReader> ChunkReader for Ending<S> {
    type T = Ending<S::T>;

    /// A reader from there on: of a page, or of the last bytes.
    fn get_read(&self, start: u64) -> Result<Self::T, ParquetError> {
        if start + FOOT != self.len() {
            check_page(&thrift::walk(Ending(self.0.get_read(start)?))?)?;
        }
        self.0.get_read(start).map(Ending)
    }

    fn get_bytes(&self, start: u64, length: usize) -> Result<Bytes, ParquetError> {
        self.0.get_bytes(start, length)
    }
}

impl<S: Read> Read for Ending<S> {
    fn read(&mut self, to: &mut [u8]) -> io::Result<usize> {
        match self.0.read(to)? {
            0 if !to.is_empty() => Err(io::ErrorKind::UnexpectedEof.into()),
            count => Ok(count),
        }
    }
}

/// Contents of a file, or of several of one set.
#[derive(Default)]
pub(super) struct Columns {
    columns: Vec<Column>,
    wavelengths: Option<Vec<f64>>,
    attributes: Option<String>,
    values: usize,
}

impl Columns {
    /// Adds the rows of a file to those before.
    pub(super) fn add(&mut self, path: &Path, source: Source) -> Result<(), DatasetError> {
        let failed =
            |reason: String| DatasetError::Format { path: path.to_owned(), format: "Parquet", reason };
        let taken = std::mem::take(self);
        let read = caught(|| match source {
            Source::File(file) => taken.with(file),
            Source::Memory(bytes) => taken.with(Bytes::from(bytes.into_inner())),
        });
        *self = read.ok_or_else(|| failed("it is damaged; copy it again".to_owned()))?.map_err(failed)?;
        Ok(())
    }

    fn with(mut self, source: impl ChunkReader + 'static) -> Result<Columns, String> {
        let reader = SerializedFileReader::new(Ending::new(source).map_err(damaged)?).map_err(damaged)?;
        let metadata = reader.metadata();
        for note in metadata.file_metadata().key_value_metadata().into_iter().flatten() {
            match (note.key.as_str(), &note.value) {
                ("wavelength", Some(text)) => self.wavelengths = serde_json::from_str(text).ok(),
                ("spectroll", Some(text)) => self.attributes = Some(text.clone()),
                _ => {}
            }
        }
        let schema = metadata.file_metadata().schema_descr_ptr();
        let is_first = self.columns.is_empty();
        for (index, description) in schema.columns().iter().enumerate() {
            let name = description.path().parts().first().cloned().unwrap_or_default();
            let meaning = Meaning::of(description);
            let mut column = Column { name, values: Vec::new(), width: None, texts: Vec::new() };
            for group in 0..metadata.num_row_groups() {
                let part = metadata.row_group(group).column(index);
                check_packing(part.compression())?;
                if part.uncompressed_size() as u64 > MAX_BYTES {
                    return Err("it holds more than 512 MiB (unpacked): split it".to_owned());
                }
                let group = reader.get_row_group(group).map_err(damaged)?;
                let levels = (description.max_def_level(), description.max_rep_level());
                let column_reader = group.get_column_reader(index).map_err(damaged)?;
                read_column(column_reader, levels, meaning, &mut column)?;
                if self.values + column.values.len() > MAX_VALUES {
                    return Err(super::too_many(self.values + column.values.len()));
                }
            }
            self.values += column.values.len();
            if is_first {
                self.columns.push(column);
                continue;
            }
            let before = self
                .columns
                .get_mut(index)
                .filter(|before| before.name == column.name && before.width == column.width);
            let before = before.ok_or("its columns differ from those of the file before it")?;
            before.values.append(&mut column.values);
            before.texts.append(&mut column.texts);
        }
        Ok(self)
    }

    /// The table of the columns.
    pub(super) fn table(self, path: &Path, options: &ReadOptions) -> Result<Reading, DatasetError> {
        let format = "Parquet".to_owned();
        if self.columns.iter().any(|column| column.width.is_some()) {
            let kind = self.attributes.as_deref().and_then(arrays::kind);
            let mut found = Arrays { format, kind, order: Order::LastFirst, ..Arrays::default() };
            if let Some(values) = self.wavelengths {
                let name = "wavelength".to_owned();
                found.all.push(Array { name, sides: vec![values.len()], values, unit: None });
            }
            for column in self.columns.into_iter().filter(|column| column.texts.is_empty()) {
                let Column { name, values, width, .. } = column;
                let width = width.unwrap_or(1);
                let sides = if width == 0 { vec![0] } else { vec![width, values.len() / width] };
                found.all.push(Array { name, sides, values, unit: None });
            }
            return arrays::choose(path, found, options);
        }
        let mut sheet = Sheet::new("row");
        let rows =
            self.columns.iter().map(|column| column.values.len().max(column.texts.len())).max().unwrap_or(0);
        sheet.reserve((rows + 1) * self.columns.len());
        sheet.begin_row(0, false);
        self.columns.iter().for_each(|column| sheet.push(Cell::parse(&column.name, Decimal::Point)));
        sheet.end_row().map_err(|e| e.of(path))?;
        for row in 0..rows {
            sheet.begin_row(row + 1, false);
            for column in &self.columns {
                sheet.push(match (column.values.get(row), column.texts.get(row)) {
                    (Some(value), _) if !value.is_nan() => Cell::Number(*value),
                    (None, Some(text)) => match Cell::parse(text, Decimal::Point) {
                        // Numbers that are kept as text are names.
                        Cell::Missing => Cell::Missing,
                        _ => Cell::Text(text),
                    },
                    _ => Cell::Missing,
                });
            }
            sheet.end_row().map_err(|e| e.of(path))?;
        }
        text::read_sheet(path, &sheet, &format, options)
    }
}

/// Reads one file.
pub(super) fn read(path: &Path, source: Source, options: &ReadOptions) -> Result<Reading, DatasetError> {
    let mut columns = Columns::default();
    columns.add(path, source)?;
    columns.table(path, options)
}

/// Adds the values of a part of a column.
fn read_column(
    reader: ColumnReader,
    levels: (i16, i16),
    meaning: Meaning,
    column: &mut Column,
) -> Result<(), String> {
    let mut lists = Lists { width: column.width, ..Lists::default() };
    let (name, values) = (&column.name, &mut column.values);
    let check = |count: usize, reps: &[i16]| match reps.iter().all(|rep| lists.add(*rep == 0)) {
        false => Err(uneven(name)),
        true if count > MAX_VALUES => Err(super::too_many(count)),
        true => Ok(()),
    };
    macro_rules! all {
        ($reader:expr, $number:expr) => {
            read_values($reader, levels, values, |value| value.map_or(f64::NAN, $number), check)?
        };
    }
    match reader {
        ColumnReader::FloatColumnReader(reader) => all!(reader, |v: &f32| f64::from(*v)),
        ColumnReader::DoubleColumnReader(reader) => all!(reader, |v: &f64| *v),
        ColumnReader::Int32ColumnReader(reader) => match meaning {
            Meaning::Unsigned => all!(reader, |v: &i32| f64::from(v.cast_unsigned())),
            _ => all!(reader, |v: &i32| f64::from(*v) / meaning.divisor()),
        },
        ColumnReader::Int64ColumnReader(reader) => match meaning {
            Meaning::Unsigned => all!(reader, |v: &i64| v.cast_unsigned() as f64),
            _ => all!(reader, |v: &i64| *v as f64 / meaning.divisor()),
        },
        ColumnReader::FixedLenByteArrayColumnReader(reader) if meaning == Meaning::Half => {
            all!(reader, |v: &FixedLenByteArray| {
                v.data().first_chunk().map_or(f64::NAN, |bytes| f16::from_le_bytes(*bytes).to_f64())
            });
        }
        ColumnReader::ByteArrayColumnReader(reader) => {
            let check = |count: usize, _: &[i16]| match count > MAX_TEXTS {
                true => Err(format!("{name:?} has more than {MAX_TEXTS} words: leave it out")),
                false => Ok(()),
            };
            let text = |word: Option<&ByteArray>| {
                word.map_or(String::new(), |bytes| String::from_utf8_lossy(bytes.data()).into_owned())
            };
            return read_values(reader, levels, &mut column.texts, text, check);
        }
        // Dates, truth values and the like are no spectra.
        _ => {
            column.texts.push(String::new());
            return Ok(());
        }
    }
    if lists.values > 0 {
        column.width = Some(lists.one_width().ok_or_else(|| uneven(&column.name))?);
    }
    Ok(())
}

/// Adds the values of a part of a column, of those too that are null, which have a level and nothing else; `check` sees how
/// many there are, and the levels at which lists begin.
fn read_values<T: DataType, V>(
    mut reader: ColumnReaderImpl<T>,
    (max_def, max_rep): (i16, i16),
    values: &mut Vec<V>,
    value: impl Fn(Option<&T::T>) -> V,
    mut check: impl FnMut(usize, &[i16]) -> Result<(), String>,
) -> Result<(), String> {
    let (mut defs, mut reps, mut batch) = (Vec::new(), Vec::new(), Vec::new());
    loop {
        defs.clear();
        reps.clear();
        batch.clear();
        let (records, _, levels) = reader
            .read_records(
                BATCH,
                (max_def > 0).then_some(&mut defs),
                (max_rep > 0).then_some(&mut reps),
                &mut batch,
            )
            .map_err(damaged)?;
        let mut there = batch.iter();
        match max_def {
            0 => values.extend(there.map(|each| value(Some(each)))),
            _ => {
                let mut next = |def: &i16| if *def == max_def { there.next() } else { None };
                values.extend(defs.iter().map(|def| value(next(def))));
            }
        }
        check(values.len(), &reps)?;
        if records == 0 && levels == 0 {
            return Ok(());
        }
    }
}

/// Refuses a page that claims more than it can hold: room is made for its bytes and for the values of a dictionary before
/// any is read.
fn check_page(header: &[(Field, i64)]) -> Result<(), ParquetError> {
    let of = |field| header.iter().find(|(found, _)| *found == field).map(|(_, value)| *value);
    let is_within = |count: Option<i64>, most: usize| {
        count.is_none_or(|count| usize::try_from(count).is_ok_and(|count| count <= most))
    };
    let size = of(UNPACKED_SIZE);
    let fits = size.is_some()
        && is_within(size, MAX_BYTES as usize)
        && DATA_VALUES.into_iter().all(|field| is_within(of(field), MAX_VALUES))
        && is_within(of(DICTIONARY_VALUES), MAX_TEXTS.min(size.unwrap_or(0) as usize))
        && match of(PAGE_TYPE) {
            Some(DICTIONARY) => of(DICTIONARY_VALUES).is_some(),
            _ => DATA_VALUES.into_iter().any(|field| of(field).is_some()),
        };
    match fits {
        true => Ok(()),
        false => Err(ParquetError::General("a page that is too large".to_owned())),
    }
}

/// Refuses a packing that is not read here.
fn check_packing(packing: Compression) -> Result<(), String> {
    let (name, may) = match packing {
        Compression::UNCOMPRESSED | Compression::SNAPPY => return Ok(()),
        Compression::ZSTD(_) => ("zstd", cfg!(feature = "zstd")),
        Compression::GZIP(_) => ("gzip", false),
        Compression::BROTLI(_) => ("Brotli", false),
        Compression::LZ4 | Compression::LZ4_RAW => ("LZ4", false),
        Compression::LZO => ("LZO", false),
    };
    match may {
        true => Ok(()),
        false => Err(format!("it is packed by {name}: write it with compression=\"snappy\"")),
    }
}

fn cut_short() -> ParquetError {
    ParquetError::External(Box::new(io::Error::from(io::ErrorKind::UnexpectedEof)))
}

/// The reason of a refusal of bytes that do not make a file of Parquet, or of one that the parser has no code for.
fn damaged(error: ParquetError) -> String {
    if let ParquetError::NYI(reason) = error {
        return format!("it holds what is not read here ({reason}): write it in another way");
    }
    let reason = error.to_string();
    let (_, reason) = reason.split_once(": ").unwrap_or(("", &reason));
    format!("it is damaged ({reason}); copy it again")
}

fn uneven(name: &str) -> String {
    format!("the lists of {name:?} are not of one length")
}

/// Lengths of lists, whose values come one by one.
#[derive(Default)]
struct Lists {
    starts: usize,
    values: usize,
    width: Option<usize>,
}

impl Lists {
    /// Adds a value, which may begin a list; returns whether the lists before it are of one length.
    fn add(&mut self, is_first: bool) -> bool {
        let is_even = match self.starts {
            _ if !is_first => true,
            0 => self.values == 0,
            lists => self.values == lists * *self.width.get_or_insert(self.values),
        };
        (self.starts, self.values) = (self.starts + usize::from(is_first), self.values + 1);
        is_even
    }

    /// The length of all lists, where it is one.
    fn one_width(&self) -> Option<usize> {
        let width = self.width.unwrap_or(self.values);
        (self.values == self.starts * width).then_some(width)
    }
}
