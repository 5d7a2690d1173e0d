//! Tables in Arrow's layout, made of the tool's own columns, and handed to Python by Arrow's C stream.

use std::collections::{BTreeMap, HashMap};
use std::sync::Arc;

use arrow_array::builder::{
    BooleanBuilder, Float32Builder, Float64Builder, StringBuilder, TimestampNanosecondBuilder,
    UInt8Builder, UInt16Builder, UInt32Builder, UInt64Builder,
};
use arrow_array::ffi::FFI_ArrowSchema;
use arrow_array::ffi_stream::FFI_ArrowArrayStream;
use arrow_array::{ArrayRef, RecordBatch, RecordBatchIterator};
use arrow_schema::{ArrowError, DataType, Field, Schema, SchemaRef, TimeUnit};
use palpate::recording::Recorded;
use palpate::recording::tables::{self, Column, FIRST, Head, Kind, Used, kind_of};
use pyo3::prelude::*;
use pyo3::types::{PyCapsule, PyDict};
use serde_json::Value;

use crate::errors::PalpateError;

/// Time zone of time stamps.
const UTC: &str = "UTC";
/// Metadata key of a column's unit.
const UNIT: &str = "unit";

/// Rows with typed columns; the metadata of a column has its unit.
#[pyclass(frozen, module = "palpate")]
pub(crate) struct Table {
    batch: RecordBatch,
}

impl Table {
    pub(crate) fn new(columns: Vec<(Field, ArrayRef)>) -> Result<Self, ArrowError> {
        let (fields, arrays): (Vec<_>, Vec<_>) = columns.into_iter().unzip();
        let batch = RecordBatch::try_new(Arc::new(Schema::new(fields)), arrays)?;
        Ok(Self { batch })
    }

    fn schema(&self) -> SchemaRef {
        self.batch.schema()
    }
}

#[pymethods]
impl Table {
    /// Number of rows.
    fn __len__(&self) -> usize {
        self.batch.num_rows()
    }

    /// Names of the columns.
    #[getter]
    fn columns(&self) -> Vec<String> {
        let schema = self.schema();
        let fields = schema.fields().iter();
        fields.map(|field| field.name().clone()).collect()
    }

    /// Units by column, of those that have one.
    #[getter]
    fn units(&self) -> BTreeMap<String, String> {
        let schema = self.schema();
        let fields = schema.fields().iter();
        let units = fields.filter_map(|field| {
            let unit = field.metadata().get(UNIT)?;
            Some((field.name().clone(), unit.clone()))
        });
        units.collect()
    }

    /// The table as a pandas `DataFrame`.
    fn to_pandas<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let arrow = slf.py().import("pyarrow")?;
        let frame = arrow
            .call_method1("table", (slf,))?
            .call_method0("to_pandas")?;
        let attributes = frame.getattr("attrs")?;
        attributes.set_item("units", slf.get().units())?;
        Ok(frame)
    }

    fn __arrow_c_schema__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyCapsule>> {
        let schema = FFI_ArrowSchema::try_from(self.schema().as_ref()).map_err(refused)?;
        PyCapsule::new_with_value(py, schema, c"arrow_schema")
    }

    /// Arrow's C stream. The requested schema is a wish that the protocol allows to ignore.
    #[pyo3(signature = (requested_schema = None))]
    fn __arrow_c_stream__<'py>(
        &self,
        py: Python<'py>,
        requested_schema: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        let _ = requested_schema;
        let batches = std::iter::once(Ok(self.batch.clone()));
        let reader = RecordBatchIterator::new(batches, self.schema());
        let stream = FFI_ArrowArrayStream::new(Box::new(reader));
        PyCapsule::new_with_value(py, stream, c"arrow_array_stream")
    }

    fn __repr__(&self) -> String {
        format!(
            "<palpate.Table of {} rows, {} columns>",
            self.batch.num_rows(),
            self.batch.num_columns()
        )
    }
}

pub(crate) fn refused(error: ArrowError) -> PyErr {
    PalpateError::new_err(error.to_string())
}

/// Description of a column.
pub(crate) fn field(name: &str, of: DataType, unit: &str, optional: bool) -> Field {
    let field = Field::new(name, of, optional);
    if unit.is_empty() {
        return field;
    }
    field.with_metadata(HashMap::from([(UNIT.to_owned(), unit.to_owned())]))
}

/// A table while records are added. Columns of list items appear with the first record that has them.
#[derive(Default)]
pub(crate) struct GrowingTable {
    used: Used,
    columns: Vec<(Column, Cells)>,
    first: Vec<Cells>,
    rows: usize,
}

impl GrowingTable {
    /// Creates the table of a kind of record.
    pub(crate) fn of_kind(kind: &str) -> Self {
        Self::with(tables::of(kind, &Used::default()))
    }

    /// Creates a table of these columns.
    pub(crate) fn with(columns: Vec<Column>) -> Self {
        let columns = columns.into_iter();
        Self {
            columns: columns.map(|of| (of.clone(), cells_of(&of))).collect(),
            first: FIRST.iter().map(|head| Cells::new(head.kind)).collect(),
            ..Self::default()
        }
    }

    /// Adds a record of a kind with its fields.
    pub(crate) fn add(&mut self, kind: &str, recorded: &Recorded, payload: &Value) {
        if self.used.enter(payload) {
            self.widen(kind);
        }
        let header = &recorded.frame.header;
        let first: [u64; FIRST.len()] = [
            recorded.host_ns,
            recorded.device_ns,
            header.boot_id.into(),
            header.sequence.into(),
            header.time_us,
            header.dropped.into(),
        ];
        for (cells, value) in self.first.iter_mut().zip(first) {
            cells.add(Some(&value.into()));
        }
        for (column, cells) in &mut self.columns {
            cells.add(column.value(payload));
        }
        self.rows += 1;
    }

    /// Adds the columns of new items; the rows before have none of them.
    fn widen(&mut self, kind: &str) {
        let mut before: HashMap<String, Cells> = std::mem::take(&mut self.columns)
            .into_iter()
            .map(|(column, cells)| (column.name, cells))
            .collect();
        for column in tables::of(kind, &self.used) {
            let cells = before.remove(&column.name);
            let cells = cells.unwrap_or_else(|| {
                let mut cells = cells_of(&column);
                (0..self.rows).for_each(|_| cells.add(None));
                cells
            });
            self.columns.push((column, cells));
        }
    }

    pub(crate) fn finish(self) -> Result<Table, ArrowError> {
        let first = FIRST.iter().zip(self.first).map(|(head, mut cells)| {
            let Head { name, unit, .. } = *head;
            (field(name, cells.data_type(), unit, false), cells.finish())
        });
        let columns = self.columns.into_iter().map(|(column, mut cells)| {
            let field = field(&column.name, cells.data_type(), column.unit, true);
            (field, cells.finish())
        });
        Table::new(first.chain(columns).collect())
    }
}

fn cells_of(column: &Column) -> Cells {
    Cells::new(kind_of(&column.of))
}

/// Cells of a column.
enum Cells {
    Bool(BooleanBuilder),
    U8(UInt8Builder),
    U16(UInt16Builder),
    U32(UInt32Builder),
    U64(UInt64Builder),
    Float(Float32Builder),
    Double(Float64Builder),
    Text(StringBuilder),
    Time(TimestampNanosecondBuilder),
}

impl Cells {
    fn new(kind: Kind) -> Self {
        match kind {
            Kind::Bool => Self::Bool(BooleanBuilder::new()),
            Kind::Integer(8) => Self::U8(UInt8Builder::new()),
            Kind::Integer(16) => Self::U16(UInt16Builder::new()),
            Kind::Integer(32) => Self::U32(UInt32Builder::new()),
            Kind::Integer(_) => Self::U64(UInt64Builder::new()),
            Kind::Float => Self::Float(Float32Builder::new()),
            Kind::Double => Self::Double(Float64Builder::new()),
            Kind::Text => Self::Text(StringBuilder::new()),
            Kind::Time => Self::Time(TimestampNanosecondBuilder::new().with_timezone(UTC)),
        }
    }

    fn data_type(&self) -> DataType {
        match self {
            Self::Bool(_) => DataType::Boolean,
            Self::U8(_) => DataType::UInt8,
            Self::U16(_) => DataType::UInt16,
            Self::U32(_) => DataType::UInt32,
            Self::U64(_) => DataType::UInt64,
            Self::Float(_) => DataType::Float32,
            Self::Double(_) => DataType::Float64,
            Self::Text(_) => DataType::Utf8,
            Self::Time(_) => DataType::Timestamp(TimeUnit::Nanosecond, Some(UTC.into())),
        }
    }

    /// Adds the value of a row; `None` if it is absent.
    fn add(&mut self, value: Option<&Value>) {
        let number = value.and_then(Value::as_u64);
        match self {
            Self::Bool(cells) => cells.append_option(value.and_then(Value::as_bool)),
            // The protocol's types bound every number.
            Self::U8(cells) => cells.append_option(number.map(|of| of as u8)),
            Self::U16(cells) => cells.append_option(number.map(|of| of as u16)),
            Self::U32(cells) => cells.append_option(number.map(|of| of as u32)),
            Self::U64(cells) => cells.append_option(number),
            // Every f32 is an f64 too.
            Self::Float(cells) => {
                cells.append_option(value.and_then(Value::as_f64).map(|of| of as f32));
            }
            Self::Double(cells) => cells.append_option(value.and_then(Value::as_f64)),
            Self::Text(cells) => match value {
                None => cells.append_null(),
                Some(Value::String(text)) => cells.append_value(text),
                // A code without a name is its number.
                Some(other) => cells.append_value(other.to_string()),
            },
            Self::Time(cells) => cells.append_option(number.map(u64::cast_signed)),
        }
    }

    fn finish(&mut self) -> ArrayRef {
        match self {
            Self::Bool(cells) => Arc::new(cells.finish()),
            Self::U8(cells) => Arc::new(cells.finish()),
            Self::U16(cells) => Arc::new(cells.finish()),
            Self::U32(cells) => Arc::new(cells.finish()),
            Self::U64(cells) => Arc::new(cells.finish()),
            Self::Float(cells) => Arc::new(cells.finish()),
            Self::Double(cells) => Arc::new(cells.finish()),
            Self::Text(cells) => Arc::new(cells.finish()),
            Self::Time(cells) => Arc::new(cells.finish()),
        }
    }
}

/// Tables by name, as Python objects.
pub(crate) fn as_dict<'py>(
    py: Python<'py>,
    tables: BTreeMap<&'static str, Table>,
) -> PyResult<Bound<'py, PyDict>> {
    let by_name = PyDict::new(py);
    for (name, table) in tables {
        by_name.set_item(name, Bound::new(py, table)?)?;
    }
    Ok(by_name)
}
