//! `palpate export`: a recording as tables.

mod columns;

use std::collections::BTreeMap;
use std::fs::{self, File};
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use palpate_wire::Message;
use serde_json::Value;

use crate::failure::Failure;
use crate::notice;
use crate::recording::date::NS_PER_S;
use crate::recording::{Entry, Reader, Recorded};
use columns::{Column, Used};

/// Turn a recording into tables
///
/// Writes a CSV file for each kind of record, such as sample.csv and estimate.csv.
#[derive(Args)]
#[command(after_help = "\
Every table begins with host_time_s, when the record arrived, and device_time_s, when it was taken, both
in seconds since 1970 by the computer's clock; then the record's header and its fields, with their units
in their names. The items of a list have their number in the name, the conversions of a sample their
channel: channels_0_frequency_hz. What is absent is empty. docs/protocol.md names every field.

A recording that was cut off is read as far as it goes.

Example:
  palpate export press.mcap --csv press")]
pub(crate) struct Arguments {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The folder; it is made, and tables in it are replaced
    #[arg(long, value_name = "FOLDER")]
    csv: PathBuf,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let used = used(&arguments.file)?;
    if used.is_empty() {
        return Err(Failure::Refused(format!(
            "{}: there is no record in it",
            arguments.file.display()
        )));
    }
    let mut tables = Tables::create(&arguments.csv, &used)?;
    for entry in &mut Reader::open(&arguments.file)? {
        if let Entry::Frame(recorded) = entry {
            tables.add(&recorded)?;
        }
    }
    tables.finish()
}

/// Which items of lists occur, by kinds of records.
fn used(file: &Path) -> Result<BTreeMap<&'static str, Used>, Failure> {
    let mut reader = Reader::open(file)?;
    let mut used: BTreeMap<&'static str, Used> = BTreeMap::new();
    for entry in &mut reader {
        if let Entry::Frame(recorded) = entry {
            let message = &recorded.frame.message;
            let payload = payload(&recorded)?;
            used.entry(message.name()).or_default().enter(&payload);
        }
    }
    reader.refuse_foreign(file)?;
    if let Some(damage) = reader.damage() {
        notice::say(format_args!("{}: {damage}.", file.display()));
    }
    if reader.unreadable() > 0 {
        notice::say(format_args!(
            "{}: {} messages are of another version of the protocol and left out.",
            file.display(),
            reader.unreadable()
        ));
    }
    Ok(used)
}

/// A record's fields, with the digits of the text form: an f32 has fewer than the f64 next to it.
fn payload(recorded: &Recorded) -> Result<Value, Failure> {
    let message = &recorded.frame.message;
    let text = serde_json::to_string(message)?;
    let mut value: Value = serde_json::from_str(&text)?;
    let payload = value.get_mut(message.name()).map(Value::take);
    Ok(payload.unwrap_or_default())
}

/// A table for each kind of record.
struct Tables {
    folder: PathBuf,
    tables: BTreeMap<&'static str, Table>,
}

struct Table {
    columns: Vec<Column>,
    rows: csv::Writer<File>,
}

/// The columns before the fields of a record.
const FIRST: [&str; 6] = [
    "host_time_s",
    "device_time_s",
    "boot_id",
    "sequence",
    "time_us",
    "dropped",
];

impl Tables {
    fn create(folder: &Path, used: &BTreeMap<&'static str, Used>) -> Result<Self, Failure> {
        let unwritable = |file: &Path, reason| Failure::Unwritable {
            file: file.to_path_buf(),
            argument: "--csv",
            reason,
        };
        fs::create_dir_all(folder).map_err(|reason| unwritable(folder, reason))?;
        let mut tables = BTreeMap::new();
        for (&kind, used) in used {
            let path = folder.join(format!("{kind}.csv"));
            let file = File::create(&path).map_err(|reason| unwritable(&path, reason))?;
            let columns = columns::of(kind, used);
            let mut rows = csv::Writer::from_writer(file);
            let names = columns.iter().map(|column| column.name.as_str());
            rows.write_record(FIRST.into_iter().chain(names))
                .map_err(|error| unfinished(folder, error))?;
            tables.insert(kind, Table { columns, rows });
        }
        Ok(Self {
            folder: folder.to_path_buf(),
            tables,
        })
    }

    fn add(&mut self, recorded: &Recorded) -> Result<(), Failure> {
        let Some(table) = self.tables.get_mut(recorded.frame.message.name()) else {
            return Ok(());
        };
        let payload = payload(recorded)?;
        let cells = table.columns.iter().map(|column| column.cell(&payload));
        let row = first(recorded).into_iter().chain(cells);
        let written = table.rows.write_record(row);
        written.map_err(|error| unfinished(&self.folder, error))
    }

    fn finish(mut self) -> Result<(), Failure> {
        for table in self.tables.values_mut() {
            let flushed = table.rows.flush();
            flushed.map_err(|error| unfinished(&self.folder, error.into()))?;
        }
        let mut out = io::stdout().lock();
        for kind in self.tables.keys() {
            writeln!(out, "{}", self.folder.join(format!("{kind}.csv")).display())?;
        }
        Ok(())
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

/// All nine digits: a float of this size would keep six.
fn seconds(ns: u64) -> String {
    format!("{}.{:09}", ns / NS_PER_S, ns % NS_PER_S)
}

fn unfinished(folder: &Path, error: csv::Error) -> Failure {
    Failure::Refused(format!(
        "--csv {}: {error}. The tables are not complete: make room there, or name another folder.",
        folder.display()
    ))
}
