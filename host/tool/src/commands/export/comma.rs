//! Tables as CSV.

use std::fs::File;
use std::path::Path;

use serde_json::Value;

use super::columns::Column;
use super::table::{Created, Table};
use crate::recording::Recorded;
use crate::recording::date::NS_PER_S;

/// Columns before the fields of a record.
const FIRST: [&str; 6] = [
    "host_time_s",
    "device_time_s",
    "boot_id",
    "sequence",
    "time_us",
    "dropped",
];

struct CsvTable {
    columns: Vec<Column>,
    rows: csv::Writer<File>,
}

/// Creates a file.
pub(super) fn create(path: &Path, columns: Vec<Column>) -> Created {
    let file = File::create(path).map_err(|error| error.to_string())?;
    let mut rows = csv::Writer::from_writer(file);
    let names = columns.iter().map(|column| column.name.as_str());
    let written = rows.write_record(FIRST.into_iter().chain(names));
    written.map_err(|error| error.to_string())?;
    Ok(Box::new(CsvTable { columns, rows }))
}

impl Table for CsvTable {
    fn add(&mut self, recorded: &Recorded, payload: &Value) -> Result<(), String> {
        let cells = self.columns.iter().map(|column| column.cell(payload));
        let row = first(recorded).into_iter().chain(cells);
        self.rows
            .write_record(row)
            .map_err(|error| error.to_string())
    }

    fn finish(mut self: Box<Self>) -> Result<(), String> {
        self.rows.flush().map_err(|error| error.to_string())
    }
}

fn first(recorded: &Recorded) -> [String; FIRST.len()] {
    let header = &recorded.frame.header;
    [
        seconds(recorded.host_ns),
        seconds(recorded.device_ns),
        header.boot_id.to_string(),
        header.sequence.to_string(),
        header.time_us.to_string(),
        header.dropped.to_string(),
    ]
}

/// Formats seconds with all nine decimals; a float of this size would keep six.
fn seconds(ns: u64) -> String {
    format!("{}.{:09}", ns / NS_PER_S, ns % NS_PER_S)
}
