//! Tables as Parquet.

use std::fs::File;
use std::path::Path;

use palpate_wire::schema;
use serde_json::Value;

use super::columns::Column;
use super::table::{Created, Table};
use crate::recording::Recorded;
use crate::recording::parquet_file::{Head, Kind, ParquetFile};

/// Columns before the fields of a record.
pub const FIRST: [Head<'_>; 6] = [
    first("host_time", Kind::Time, ""),
    first("device_time", Kind::Time, ""),
    first("boot_id", Kind::Integer(32), ""),
    first("sequence", Kind::Integer(32), ""),
    first("time_us", Kind::Integer(64), "us"),
    first("dropped", Kind::Integer(32), "1"),
];

const fn first(name: &'static str, kind: Kind, unit: &'static str) -> Head<'static> {
    Head {
        name,
        kind,
        unit,
        optional: false,
    }
}

struct ParquetTable {
    file: ParquetFile<File>,
    columns: Vec<Column>,
}

/// Creates a file.
pub(super) fn create(path: &Path, columns: Vec<Column>) -> Created {
    let fields = columns.iter().map(|column| Head {
        name: &column.name,
        kind: kind_of(&column.of),
        unit: column.unit,
        optional: true,
    });
    let heads: Vec<Head<'_>> = FIRST.into_iter().chain(fields).collect();
    let file = File::create(path).map_err(|error| error.to_string())?;
    let file = ParquetFile::begin(file, "record", &heads).map_err(|error| error.to_string())?;
    Ok(Box::new(ParquetTable { file, columns }))
}

/// Type of the cells of a column.
pub const fn kind_of(of: &schema::Type) -> Kind {
    match of {
        schema::Type::Bool => Kind::Bool,
        schema::Type::U8 => Kind::Integer(8),
        schema::Type::U16 => Kind::Integer(16),
        schema::Type::U32 => Kind::Integer(32),
        schema::Type::U64 => Kind::Integer(64),
        schema::Type::F32 => Kind::Float,
        schema::Type::F64 => Kind::Double,
        // Structures and lists have their own columns.
        schema::Type::Text { .. }
        | schema::Type::Code(_)
        | schema::Type::Optional(_)
        | schema::Type::List { .. }
        | schema::Type::Structure(_) => Kind::Text,
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
        self.file.add(cells).map_err(|error| error.to_string())
    }

    fn finish(self: Box<Self>) -> Result<(), String> {
        let written = self.file.finish();
        written.map(drop).map_err(|error| error.to_string())
    }
}
