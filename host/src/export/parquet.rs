//! Tables as Parquet: columns with their types, and with their units in the metadata.

use std::fs::File;
use std::path::Path;
use std::sync::Arc;

use palpate_wire::schema;
use parquet::basic::{LogicalType, Repetition, TimeUnit, Type as Physical};
use parquet::data_type::{
    BoolType, ByteArray, ByteArrayType, DataType, DoubleType, FloatType, Int32Type, Int64Type,
};
use parquet::errors::ParquetError;
use parquet::file::metadata::KeyValue;
use parquet::file::properties::WriterProperties;
use parquet::file::writer::{SerializedColumnWriter, SerializedFileWriter};
use parquet::schema::types::Type;
use serde_json::{Map, Value, json};

use super::columns::Column;
use super::{Created, Table};
use crate::recording::Recorded;

/// Rows that are kept in memory until they are written as a group: a minute at 1 kHz.
const GROUP: usize = 60_000;
/// Under this name pandas finds what it shows as `attrs`.
const PANDAS: &str = "PANDAS_ATTRS";

/// What the cells of a column are, in a file and in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    Bool,
    /// Of so many bits, without sign.
    Integer(i8),
    Float,
    Double,
    Text,
    /// Nanoseconds since 1970 UTC.
    Time,
}

/// The columns before the fields of a record.
const FIRST: [(&str, Kind, &str); 6] = [
    ("host_time", Kind::Time, ""),
    ("device_time", Kind::Time, ""),
    ("boot_id", Kind::Integer(32), ""),
    ("sequence", Kind::Integer(32), ""),
    ("time_us", Kind::Integer(64), "us"),
    ("dropped", Kind::Integer(32), "1"),
];

struct ParquetTable {
    writer: SerializedFileWriter<File>,
    columns: Vec<Column>,
    /// Of every column, those before the fields first.
    kept: Vec<Kept>,
    rows: usize,
}

/// The cells of a column that are not written yet.
struct Kept {
    kind: Kind,
    cells: Vec<Option<Value>>,
}

/// Begins a file.
pub(super) fn create(path: &Path, columns: Vec<Column>) -> Created {
    begin(path, columns).map_err(|error| error.to_string())
}

fn begin(path: &Path, columns: Vec<Column>) -> Result<Box<dyn Table>, ParquetError> {
    let of_fields = columns.iter().map(|column| Kind::of(&column.of));
    let kinds: Vec<Kind> = FIRST
        .iter()
        .map(|(_, kind, _)| *kind)
        .chain(of_fields)
        .collect();
    let fields = FIRST
        .iter()
        .map(|(name, kind, _)| kind.column(name, Repetition::REQUIRED));
    let names = columns.iter().zip(kinds.iter().skip(FIRST.len()));
    let fields = fields.chain(names.map(|(of, kind)| kind.column(&of.name, Repetition::OPTIONAL)));
    let fields = fields
        .map(|field| field.map(Arc::new))
        .collect::<Result<_, _>>()?;
    let schema = Type::group_type_builder("record")
        .with_fields(fields)
        .build()?;
    let units = units(&columns);
    let metadata = vec![
        KeyValue::new("units".to_owned(), units.to_string()),
        KeyValue::new(PANDAS.to_owned(), json!({ "units": units }).to_string()),
    ];
    let properties = WriterProperties::builder()
        .set_created_by(concat!("palpate ", env!("CARGO_PKG_VERSION")).to_owned())
        .set_key_value_metadata(Some(metadata));
    let file = File::create(path)?;
    let writer = SerializedFileWriter::new(file, Arc::new(schema), Arc::new(properties.build()))?;
    let kept = kinds.into_iter().map(|kind| Kept {
        kind,
        cells: Vec::new(),
    });
    Ok(Box::new(ParquetTable {
        writer,
        columns,
        kept: kept.collect(),
        rows: 0,
    }))
}

/// The units of all columns that have one, by names.
fn units(columns: &[Column]) -> Value {
    let first = FIRST.iter().map(|(name, _, unit)| (*name, *unit));
    let fields = columns
        .iter()
        .map(|column| (column.name.as_str(), column.unit));
    let with_unit = first.chain(fields).filter(|(_, unit)| !unit.is_empty());
    let units = with_unit.map(|(name, unit)| (name.to_owned(), unit.into()));
    Value::Object(units.collect::<Map<_, _>>())
}

impl Kind {
    const fn of(of: &schema::Type) -> Self {
        match of {
            schema::Type::Bool => Self::Bool,
            schema::Type::U8 => Self::Integer(8),
            schema::Type::U16 => Self::Integer(16),
            schema::Type::U32 => Self::Integer(32),
            schema::Type::U64 => Self::Integer(64),
            schema::Type::F32 => Self::Float,
            schema::Type::F64 => Self::Double,
            // Structures and lists have columns of their own.
            schema::Type::Text { .. }
            | schema::Type::Code(_)
            | schema::Type::Optional(_)
            | schema::Type::List { .. }
            | schema::Type::Structure(_) => Self::Text,
        }
    }

    fn column(self, name: &str, repetition: Repetition) -> Result<Type, ParquetError> {
        let (physical, logical) = match self {
            Self::Bool => (Physical::BOOLEAN, None),
            Self::Integer(64) => (Physical::INT64, Some(LogicalType::integer(64, false))),
            Self::Integer(bits) => (Physical::INT32, Some(LogicalType::integer(bits, false))),
            Self::Float => (Physical::FLOAT, None),
            Self::Double => (Physical::DOUBLE, None),
            Self::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Self::Time => {
                let logical = LogicalType::timestamp(true, TimeUnit::NANOS);
                (Physical::INT64, Some(logical))
            }
        };
        Type::primitive_type_builder(name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
    }
}

impl Kept {
    /// Writes the cells and forgets them.
    fn write(&mut self, to: &mut SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        let cells = std::mem::take(&mut self.cells);
        let number = |value: &Value| value.as_u64().unwrap_or_default();
        let float = |value: &Value| value.as_f64().unwrap_or_default();
        match self.kind {
            Kind::Bool => write::<BoolType>(to, &cells, |of| of.as_bool().unwrap_or_default()),
            // Without sign: the same bits.
            Kind::Integer(64) | Kind::Time => {
                write::<Int64Type>(to, &cells, |of| number(of).cast_signed())
            }
            Kind::Integer(_) => {
                write::<Int32Type>(to, &cells, |of| (number(of) as u32).cast_signed())
            }
            // The shortest digits of an f32 are read as that f32.
            Kind::Float => write::<FloatType>(to, &cells, |of| float(of) as f32),
            Kind::Double => write::<DoubleType>(to, &cells, float),
            Kind::Text => write::<ByteArrayType>(to, &cells, |of| {
                // A code without a name is its number.
                let text = of.as_str().map_or_else(|| of.to_string(), str::to_owned);
                ByteArray::from(text.into_bytes())
            }),
        }
    }
}

fn write<T: DataType>(
    to: &mut SerializedColumnWriter<'_>,
    cells: &[Option<Value>],
    of: impl Fn(&Value) -> T::T,
) -> Result<(), ParquetError> {
    let values: Vec<T::T> = cells.iter().flatten().map(of).collect();
    let is_there: Vec<i16> = cells.iter().map(|cell| cell.is_some().into()).collect();
    to.typed::<T>()
        .write_batch(&values, Some(&is_there), None)?;
    Ok(())
}

impl ParquetTable {
    fn write_group(&mut self) -> Result<(), ParquetError> {
        if self.rows == 0 {
            return Ok(());
        }
        self.rows = 0;
        let mut group = self.writer.next_row_group()?;
        for kept in &mut self.kept {
            if let Some(mut column) = group.next_column()? {
                kept.write(&mut column)?;
                column.close()?;
            }
        }
        group.close()?;
        Ok(())
    }
}

impl Table for ParquetTable {
    fn add(&mut self, recorded: &Recorded, payload: &Value) -> Result<(), String> {
        let header = &recorded.frame.header;
        let first: [Value; FIRST.len()] = [
            recorded.host_ns.into(),
            recorded.device_ns.into(),
            header.boot_id.into(),
            header.sequence.into(),
            header.time_us.into(),
            header.dropped.into(),
        ];
        let fields = self
            .columns
            .iter()
            .map(|column| column.value(payload).cloned());
        let cells = first.into_iter().map(Some).chain(fields);
        for (kept, cell) in self.kept.iter_mut().zip(cells) {
            kept.cells.push(cell);
        }
        self.rows += 1;
        if self.rows < GROUP {
            return Ok(());
        }
        self.write_group().map_err(|error| error.to_string())
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        let written = self.write_group().and_then(|()| self.writer.close());
        written.map(drop).map_err(|error| error.to_string())
    }
}
