//! Parquet files: typed columns, with their units in the metadata.
//!
//! Arrow and compression are not used; see docs/decisions/0073-recordings.md.

use std::io::Write;
use std::sync::Arc;

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

/// Number of rows kept in memory and written as a group: a minute at 1 kHz.
const GROUP: usize = 60_000;
/// Metadata key that pandas shows as `attrs`.
const PANDAS: &str = "PANDAS_ATTRS";

/// Type of the cells of a column, in the file and in memory.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// `true` or `false`.
    Bool,
    /// Unsigned integer with this number of bits.
    Integer(i8),
    /// `f32`.
    Float,
    /// `f64`.
    Double,
    /// Text.
    Text,
    /// Time, ns since 1970 UTC.
    Time,
}

/// A column of a file.
#[derive(Clone, Copy, Debug)]
pub struct Head<'n> {
    /// Name.
    pub name: &'n str,
    /// Type of the cells.
    pub kind: Kind,
    /// Unit; `1` for plain numbers, empty for non-quantities.
    pub unit: &'n str,
    /// Whether a cell may be empty.
    pub optional: bool,
}

/// A file during writing.
pub(crate) struct ParquetFile<W: Write + Send> {
    writer: SerializedFileWriter<W>,
    kept: Vec<Kept>,
    rows: usize,
}

/// Unwritten cells of a column.
struct Kept {
    kind: Kind,
    cells: Vec<Option<Value>>,
}

impl<W: Write + Send> ParquetFile<W> {
    /// Starts a file; `row` names the kind of its rows.
    pub(crate) fn begin(to: W, row: &str, heads: &[Head<'_>]) -> Result<Self, ParquetError> {
        let fields = heads.iter().map(|head| head.column().map(Arc::new));
        let schema = Type::group_type_builder(row)
            .with_fields(fields.collect::<Result<_, _>>()?)
            .build()?;
        let units = units(heads);
        let metadata = vec![
            KeyValue::new("units".to_owned(), units.to_string()),
            KeyValue::new(PANDAS.to_owned(), json!({ "units": units }).to_string()),
        ];
        let properties = WriterProperties::builder()
            .set_created_by(concat!("palpate ", env!("CARGO_PKG_VERSION")).to_owned())
            .set_key_value_metadata(Some(metadata));
        let kept = heads.iter().map(|head| Kept {
            kind: head.kind,
            cells: Vec::new(),
        });
        Ok(Self {
            writer: SerializedFileWriter::new(to, Arc::new(schema), Arc::new(properties.build()))?,
            kept: kept.collect(),
            rows: 0,
        })
    }

    /// Adds a row, with a cell for every column in order.
    pub(crate) fn add(
        &mut self,
        cells: impl IntoIterator<Item = Option<Value>>,
    ) -> Result<(), ParquetError> {
        for (kept, cell) in self.kept.iter_mut().zip(cells) {
            kept.cells.push(cell);
        }
        self.rows += 1;
        if self.rows < GROUP {
            return Ok(());
        }
        self.write_group()
    }

    /// Writes the remaining rows and the end of the file.
    pub(crate) fn finish(mut self) -> Result<W, ParquetError> {
        self.write_group()?;
        self.writer.into_inner()
    }

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

impl Head<'_> {
    fn column(&self) -> Result<Type, ParquetError> {
        let repetition = if self.optional {
            Repetition::OPTIONAL
        } else {
            Repetition::REQUIRED
        };
        let (physical, logical) = match self.kind {
            Kind::Bool => (Physical::BOOLEAN, None),
            Kind::Integer(64) => (Physical::INT64, Some(LogicalType::integer(64, false))),
            Kind::Integer(bits) => (Physical::INT32, Some(LogicalType::integer(bits, false))),
            Kind::Float => (Physical::FLOAT, None),
            Kind::Double => (Physical::DOUBLE, None),
            Kind::Text => (Physical::BYTE_ARRAY, Some(LogicalType::String)),
            Kind::Time => {
                let logical = LogicalType::timestamp(true, TimeUnit::NANOS);
                (Physical::INT64, Some(logical))
            }
        };
        Type::primitive_type_builder(self.name, physical)
            .with_repetition(repetition)
            .with_logical_type(logical)
            .build()
    }
}

/// Units of all columns that have one, by name.
fn units(heads: &[Head<'_>]) -> Value {
    let with_unit = heads.iter().filter(|head| !head.unit.is_empty());
    let units = with_unit.map(|head| (head.name.to_owned(), head.unit.into()));
    Value::Object(units.collect::<Map<_, _>>())
}

impl Kept {
    /// Writes the cells and removes them.
    fn write(&mut self, to: &mut SerializedColumnWriter<'_>) -> Result<(), ParquetError> {
        let cells = std::mem::take(&mut self.cells);
        let number = |value: &Value| value.as_u64().unwrap_or_default();
        let float = |value: &Value| value.as_f64().unwrap_or_default();
        match self.kind {
            Kind::Bool => write::<BoolType>(to, &cells, |of| of.as_bool().unwrap_or_default()),
            // Parquet stores an unsigned integer as the signed one with equal bits.
            Kind::Integer(64) | Kind::Time => {
                write::<Int64Type>(to, &cells, |of| number(of).cast_signed())
            }
            Kind::Integer(_) => {
                write::<Int32Type>(to, &cells, |of| (number(of) as u32).cast_signed())
            }
            // The shortest digits of an f32 parse back to that f32.
            Kind::Float => write::<FloatType>(to, &cells, |of| float(of) as f32),
            Kind::Double => write::<DoubleType>(to, &cells, float),
            Kind::Text => write::<ByteArrayType>(to, &cells, |of| {
                // A code without a name is written as its number.
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
