//! Parquet: a column per quantity, of fixed-size lists where a draw has several values, with the wavelengths, the
//! model, the recipe and the seed as metadata.
//!
//! Parquet itself knows lists, but not that all are equally long: readers learn that from an Arrow schema in the
//! metadata. The `parquet` crate would write it, but only with Arrow's arrays, which take four times as long to build
//! as the rest of it. So the schema is put together here, from the `flatbuffers` crate and the numbers of Arrow's
//! `Schema.fbs` and `Message.fbs`.

use std::io::{self, Write};
use std::sync::Arc;

use base64::Engine;
use flatbuffers::{FlatBufferBuilder, TableUnfinishedWIPOffset, UnionWIPOffset, WIPOffset};
use parquet::basic::{LogicalType, Repetition, Type as Physical};
use parquet::data_type::{DataType, DoubleType, FloatType, Int32Type};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::{EnabledStatistics, WriterProperties};
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::{Type, TypePtr};

use super::Encoder;
use super::schema::{Field, Schema};
use crate::quantity::Dtype;

/// Approximate size of a row group in bytes. Groups do not depend on the windows.
const GROUP_BYTES: u64 = 16 << 20;

pub(super) struct Parquet<W: Write + Send> {
    to: SerializedFileWriter<W>,
    schema: Schema,
    /// Columns, as they are stored, of the row group that is being filled.
    group: Vec<Vec<u8>>,
    group_rows: usize,
    /// Number of rows in the row group.
    rows: usize,
}

impl<W: Write + Send> Parquet<W> {
    pub(super) fn begin(to: W, schema: &Schema) -> io::Result<Self> {
        let wavelengths = serde_json::to_string(&schema.wavelengths).expect("numbers are JSON");
        let notes = [("wavelength", wavelengths), ("spectroll", schema.attributes_text())];
        let arrow = arrow_schema(&schema.fields, &notes);
        // Readers that know Arrow look for notes in its schema, others beside it.
        let metadata = notes.into_iter().chain([("ARROW:schema", arrow)]);
        let metadata = metadata.map(|(key, value)| KeyValue::new(key.to_owned(), value)).collect();
        let properties = WriterProperties::builder()
            .set_dictionary_enabled(false)
            .set_statistics_enabled(EnabledStatistics::None)
            .set_key_value_metadata(Some(metadata))
            .build();
        let group_rows = (GROUP_BYTES / schema.row_bytes().max(1)).max(1).ilog2();
        Ok(Parquet {
            to: SerializedFileWriter::new(to, root(&schema.fields), Arc::new(properties))
                .map_err(io_error)?,
            schema: schema.clone(),
            group: vec![Vec::new(); schema.fields.len()],
            group_rows: 1 << group_rows,
            rows: 0,
        })
    }

    fn write_group(&mut self) -> Result<(), ParquetError> {
        let mut group = self.to.next_row_group()?;
        for (field, column) in self.schema.fields.iter().zip(&mut self.group) {
            let mut writer = group.next_column()?.expect("there is a column for each field");
            write_column(&mut writer, field, column)?;
            writer.close()?;
            column.clear();
        }
        group.close()?;
        self.rows = 0;
        Ok(())
    }
}

impl<W: Write + Send> Encoder for Parquet<W> {
    fn write(&mut self, columns: &[&[u8]]) -> io::Result<()> {
        let rows = self.schema.rows(columns);
        let mut done = 0;
        while done < rows {
            let part = (rows - done).min(self.group_rows - self.rows);
            for ((field, column), group) in self.schema.fields.iter().zip(columns).zip(&mut self.group) {
                let size = field.delivered_bytes();
                group.extend_from_slice(&field.store(&column[done * size..(done + part) * size])?);
            }
            (done, self.rows) = (done + part, self.rows + part);
            if self.rows == self.group_rows {
                self.write_group().map_err(io_error)?;
            }
        }
        Ok(())
    }

    fn finish(mut self: Box<Self>) -> io::Result<()> {
        if self.rows > 0 {
            self.write_group().map_err(io_error)?;
        }
        self.to.close().map_err(io_error)?;
        Ok(())
    }
}

/// Number of draws given to the crate at once: their levels take as much memory as they do.
const BATCH_ROWS: usize = 4096;

fn write_column(
    writer: &mut SerializedColumnWriter,
    field: &Field,
    bytes: &[u8],
) -> Result<(), ParquetError> {
    match field.stored {
        Dtype::F32 => write_values::<FloatType, 4>(writer, field, bytes, f32::from_le_bytes),
        Dtype::F64 => write_values::<DoubleType, 8>(writer, field, bytes, f64::from_le_bytes),
        Dtype::U32 => write_values::<Int32Type, 4>(writer, field, bytes, i32::from_le_bytes),
        Dtype::F16 => unreachable!("the format holds no halves: see Format::check"),
    }
}

fn write_values<T: DataType, const SIZE: usize>(
    writer: &mut SerializedColumnWriter,
    field: &Field,
    bytes: &[u8],
    value: fn([u8; SIZE]) -> T::T,
) -> Result<(), ParquetError> {
    // Of each value: that it is there, and whether it goes on with the list of the one before.
    let defined = vec![1; BATCH_ROWS * field.width];
    let continues: Vec<_> = (0..defined.len()).map(|i| i16::from(i % field.width != 0)).collect();
    for batch in bytes.chunks(BATCH_ROWS * field.stored_bytes()) {
        let (values, _) = batch.as_chunks();
        let values: Vec<T::T> = values.iter().copied().map(value).collect();
        let (defined, continues) = match field.is_list() {
            true => (Some(&defined[..values.len()]), Some(&continues[..values.len()])),
            false => (None, None),
        };
        writer.typed::<T>().write_batch(&values, defined, continues)?;
    }
    Ok(())
}

/// Schema in Parquet's terms.
fn root(fields: &[Field]) -> TypePtr {
    let fields = fields.iter().map(|field| {
        let name = if field.is_list() { "element" } else { &field.name };
        let (physical, logical) = match field.stored {
            Dtype::F32 => (Physical::FLOAT, None),
            Dtype::F64 => (Physical::DOUBLE, None),
            _ => (Physical::INT32, Some(LogicalType::integer(32, false))),
        };
        let value = Type::primitive_type_builder(name, physical)
            .with_logical_type(logical)
            .with_repetition(Repetition::REQUIRED)
            .build();
        let value = Arc::new(value.expect("the type is Parquet's"));
        match field.is_list() {
            true => {
                let list = nested("list", Repetition::REPEATED, None, value);
                nested(&field.name, Repetition::REQUIRED, Some(LogicalType::List), list)
            }
            false => value,
        }
    });
    let root = Type::group_type_builder("schema").with_fields(fields.collect()).build();
    Arc::new(root.expect("the schema is Parquet's"))
}

fn nested(name: &str, repetition: Repetition, logical: Option<LogicalType>, of: TypePtr) -> TypePtr {
    let group = Type::group_type_builder(name)
        .with_repetition(repetition)
        .with_logical_type(logical)
        .with_fields(vec![of])
        .build();
    Arc::new(group.expect("the group is Parquet's"))
}

/// Offset in a flatbuffer's table of the entry that a schema file declares as number `slot`.
const fn entry(slot: u16) -> u16 {
    4 + 2 * slot
}

/// Fields in Arrow's terms: an encapsulated message, in Base64.
fn arrow_schema(fields: &[Field], notes: &[(&str, String)]) -> String {
    const VERSION_5: i16 = 4;
    const SCHEMA: u8 = 1;
    let mut to = FlatBufferBuilder::new();
    let fields: Vec<_> = fields.iter().map(|field| arrow_field(&mut to, field)).collect();
    let fields = to.create_vector(&fields);
    let notes: Vec<Table> = notes
        .iter()
        .map(|(key, value)| {
            let (key, value) = (to.create_string(key), to.create_string(value));
            let note = to.start_table();
            to.push_slot_always(entry(0), key);
            to.push_slot_always(entry(1), value);
            to.end_table(note)
        })
        .collect();
    let notes = to.create_vector(&notes);
    let schema = to.start_table();
    to.push_slot_always(entry(1), fields);
    to.push_slot_always(entry(2), notes);
    let schema = to.end_table(schema);
    let message = to.start_table();
    to.push_slot_always(entry(0), VERSION_5);
    to.push_slot_always(entry(1), SCHEMA);
    to.push_slot_always(entry(2), schema);
    let message = to.end_table(message);
    to.finish_minimal(message);
    let mut table = to.finished_data().to_vec();
    table.resize(table.len().next_multiple_of(8), 0);
    let message = [[0xFF; 4].as_slice(), &(table.len() as u32).to_le_bytes(), &table].concat();
    base64::engine::general_purpose::STANDARD.encode(message)
}

type Table = WIPOffset<flatbuffers::TableFinishedWIPOffset>;

fn arrow_field(to: &mut FlatBufferBuilder, field: &Field) -> Table {
    const FIXED_SIZE_LIST: u8 = 16;
    if !field.is_list() {
        return arrow_value(to, &field.name, field.stored);
    }
    let value = arrow_value(to, "element", field.stored);
    let list = to.start_table();
    to.push_slot_always(entry(0), field.width as i32);
    let list = to.end_table(list);
    arrow_node(to, &field.name, FIXED_SIZE_LIST, list, &[value])
}

fn arrow_value(to: &mut FlatBufferBuilder, name: &str, dtype: Dtype) -> Table {
    const INTEGER: u8 = 2;
    const FLOATING_POINT: u8 = 3;
    let table: WIPOffset<TableUnfinishedWIPOffset> = to.start_table();
    let kind = match dtype {
        Dtype::U32 => {
            to.push_slot_always(entry(0), 32i32); // bits; not signed is the default
            INTEGER
        }
        float => {
            let precision = match float {
                Dtype::F16 => 0i16,
                Dtype::F32 => 1,
                _ => 2,
            };
            to.push_slot_always(entry(0), precision);
            FLOATING_POINT
        }
    };
    let table = to.end_table(table);
    arrow_node(to, name, kind, table, &[])
}

fn arrow_node(to: &mut FlatBufferBuilder, name: &str, kind: u8, of: Table, children: &[Table]) -> Table {
    let name = to.create_string(name);
    let children = to.create_vector(children);
    let of: WIPOffset<UnionWIPOffset> = of.as_union_value();
    let node = to.start_table();
    to.push_slot_always(entry(0), name);
    to.push_slot_always(entry(2), kind);
    to.push_slot_always(entry(3), of);
    to.push_slot_always(entry(5), children);
    to.end_table(node)
}

/// The I/O error within an error, or one around it.
fn io_error(error: ParquetError) -> io::Error {
    match error {
        ParquetError::External(source) => match source.downcast::<io::Error>() {
            Ok(error) => *error,
            Err(other) => io::Error::other(other),
        },
        other => io::Error::other(other),
    }
}
