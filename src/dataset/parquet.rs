//! Parquet: columns of lists, which are spectra with their wavelengths in the file's notes, or columns of numbers, which
//! are named by wavelengths or stand beside a column of them.

use std::path::Path;

use bytes::Bytes;
use half::f16;
use parquet::basic::LogicalType;
use parquet::column::reader::ColumnReader;
use parquet::errors::ParquetError;
use parquet::file::reader::{FileReader, SerializedFileReader};

use super::arrays::{self, Array, Arrays, Order};
use super::reading::{Decimal, ReadOptions, Reading};
use super::sheet::{Cell, Sheet};
use super::{DatasetError, MAX_BYTES, MAX_VALUES, text};
use crate::caught::caught;

/// Records that are read at a time.
const BATCH: usize = 1 << 16;

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
    pub(super) fn add(&mut self, path: &Path, bytes: Vec<u8>) -> Result<(), DatasetError> {
        let failed =
            |reason: String| DatasetError::Format { path: path.to_owned(), format: "Parquet", reason };
        let taken = std::mem::take(self);
        let read = caught(|| taken.with(bytes));
        *self = read.ok_or_else(|| failed("it is damaged; copy it again".to_owned()))?.map_err(failed)?;
        Ok(())
    }

    fn with(mut self, bytes: Vec<u8>) -> Result<Columns, String> {
        let wrong = |error: ParquetError| error.to_string();
        let reader = SerializedFileReader::new(Bytes::from(bytes)).map_err(wrong)?;
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
            let is_half = matches!(description.logical_type_ref(), Some(LogicalType::Float16));
            let mut column = Column { name, values: Vec::new(), width: None, texts: Vec::new() };
            for group in 0..metadata.num_row_groups() {
                if metadata.row_group(group).column(index).uncompressed_size() as u64 > MAX_BYTES {
                    return Err("it holds more than 512 MiB (unpacked): split it".to_owned());
                }
                let group = reader.get_row_group(group).map_err(wrong)?;
                let levels = (description.max_def_level(), description.max_rep_level());
                let column_reader = group.get_column_reader(index).map_err(wrong)?;
                read_column(column_reader, levels, is_half, &mut column)?;
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
pub(super) fn read(path: &Path, bytes: Vec<u8>, options: &ReadOptions) -> Result<Reading, DatasetError> {
    let mut columns = Columns::default();
    columns.add(path, bytes)?;
    columns.table(path, options)
}

/// Adds the values of a part of a column.
fn read_column(
    reader: ColumnReader,
    (max_def, max_rep): (i16, i16),
    is_half: bool,
    column: &mut Column,
) -> Result<(), String> {
    let (mut defs, mut reps) = (Vec::new(), Vec::new());
    let mut values: Vec<f64> = Vec::new();
    macro_rules! all {
        ($reader:expr, $value:expr) => {{
            let mut reader = $reader;
            loop {
                let mut batch = Vec::new();
                let (records, _, levels) = reader
                    .read_records(
                        BATCH,
                        (max_def > 0).then_some(&mut defs),
                        (max_rep > 0).then_some(&mut reps),
                        &mut batch,
                    )
                    .map_err(|e| e.to_string())?;
                for value in &batch {
                    $value(value);
                }
                if records == 0 && levels == 0 {
                    break;
                }
                if values.len().max(defs.len()) > MAX_VALUES {
                    return Err(super::too_many(values.len()));
                }
            }
        }};
    }
    let mut texts: Vec<String> = Vec::new();
    match reader {
        ColumnReader::FloatColumnReader(reader) => all!(reader, |v: &f32| values.push(f64::from(*v))),
        ColumnReader::DoubleColumnReader(reader) => all!(reader, |v: &f64| values.push(*v)),
        ColumnReader::Int32ColumnReader(reader) => all!(reader, |v: &i32| values.push(f64::from(*v))),
        ColumnReader::Int64ColumnReader(reader) => all!(reader, |v: &i64| values.push(*v as f64)),
        ColumnReader::FixedLenByteArrayColumnReader(reader) if is_half => {
            all!(reader, |v: &parquet::data_type::FixedLenByteArray| {
                let half = v.data().first_chunk().map_or(f16::NAN, |bytes| f16::from_le_bytes(*bytes));
                values.push(half.to_f64());
            });
        }
        ColumnReader::ByteArrayColumnReader(reader) => {
            all!(reader, |v: &parquet::data_type::ByteArray| texts
                .push(String::from_utf8_lossy(v.data()).into_owned()));
            column.texts.append(&mut texts);
            return Ok(());
        }
        // Dates, truth values and the like are no spectra.
        _ => {
            column.texts.push(String::new());
            return Ok(());
        }
    }
    // Nulls have a level and no value.
    let all: Vec<f64> = match max_def {
        0 => values,
        _ => {
            let mut next = values.into_iter();
            defs.iter()
                .map(|def| if *def == max_def { next.next().unwrap_or(f64::NAN) } else { f64::NAN })
                .collect()
        }
    };
    if max_rep > 0 && !all.is_empty() {
        let starts: Vec<usize> = (0..reps.len()).filter(|i| reps[*i] == 0).collect();
        let width = starts.get(1).copied().unwrap_or(all.len());
        let is_even = starts.iter().enumerate().all(|(row, start)| *start == row * width);
        if !is_even || !all.len().is_multiple_of(width) || column.width.is_some_and(|before| before != width)
        {
            return Err(format!("the lists of {:?} are not of one length", column.name));
        }
        column.width = Some(width);
    }
    column.values.extend(all);
    Ok(())
}
