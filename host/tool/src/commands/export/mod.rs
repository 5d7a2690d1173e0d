//! `palpate export`: a recording as tables.

pub(crate) mod columns;
mod comma;
pub mod modulus;
pub(crate) mod parquet;
mod table;

use std::collections::BTreeMap;
use std::fs;
use std::io::{self, Write};
use std::path::{Path, PathBuf};

use clap::Args;
use columns::{Column, Used};
use palpate_cli::failure::Failure;
use palpate_cli::modulus::DeclaredTip;
use palpate_cli::notice;
use palpate_cli::output::OutputFile;
use palpate_wire::Message;
use serde_json::Value;
use table::{Created, Table};

use crate::recording::{Entry, Reader, Recorded};

/// Turn a recording into tables
///
/// Writes a table for each kind of record, such as sample.csv and estimate.csv.
#[derive(Args)]
#[command(after_help = "\
Every table begins with when the record arrived and when it was taken, both by the computer's clock; then \
come the record's header and its fields, with their units in their names. The items of a list have their \
number in the name, the conversions of a sample their channel: channels_0_frequency_hz. What is absent is \
empty. docs/protocol.md names every field.

CSV has the times as seconds since 1970, host_time_s and device_time_s. Parquet has them as time stamps, \
host_time and device_time, and the units of the columns in its metadata, which pandas shows as attrs.

With a declared tip there is a table modulus too, computed anew: modulus and Shore hardness of each \
estimate, or the reason why there is none.

A recording that was cut off is read as far as it goes.

Examples:
  palpate export press.mcap --csv press
  palpate export press.mcap --parquet press")]
pub(crate) struct Arguments {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// The folder of CSV files; it is made, and tables in it are replaced
    #[arg(long, value_name = "FOLDER", required_unless_present = "parquet")]
    csv: Option<PathBuf>,
    /// The same of Parquet files
    #[arg(long, value_name = "FOLDER")]
    parquet: Option<PathBuf>,
}

/// A file format.
struct Format {
    argument: &'static str,
    ending: &'static str,
    create: fn(&Path, Vec<Column>) -> Created,
}

const CSV: Format = Format {
    argument: "--csv",
    ending: "csv",
    create: comma::create,
};
const PARQUET: Format = Format {
    argument: "--parquet",
    ending: "parquet",
    create: parquet::create,
};

impl Arguments {
    /// Requested formats and their folders.
    fn outputs(&self) -> Vec<(Format, &Path)> {
        let csv = self.csv.as_deref().map(|folder| (CSV, folder));
        let parquet = self.parquet.as_deref().map(|folder| (PARQUET, folder));
        csv.into_iter().chain(parquet).collect()
    }
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let used = used(&arguments.file)?;
    let outputs = arguments.outputs().into_iter();
    let outputs =
        outputs.map(|(format, folder)| Tables::create(format, folder, &used, &arguments.file));
    let mut outputs: Vec<Tables> = outputs.collect::<Result<_, _>>()?;
    let mut declared = DeclaredTip::default();
    for entry in &mut Reader::open(&arguments.file)? {
        if let Entry::Frame(recorded) = entry {
            let message = &recorded.frame.message;
            let payload = payload(&recorded)?;
            let modulus = modulus::row(&mut declared, message);
            for tables in &mut outputs {
                tables.add(message.name(), &recorded, &payload)?;
                if let Some(row) = &modulus {
                    tables.add(modulus::TABLE, &recorded, row)?;
                }
            }
        }
    }
    outputs.into_iter().try_for_each(Tables::finish)
}

/// Numbers of the list items that occur, by kind of record.
fn used(file: &Path) -> Result<BTreeMap<&'static str, Used>, Failure> {
    let mut reader = Reader::open(file)?;
    let mut used: BTreeMap<&'static str, Used> = BTreeMap::new();
    let mut declared = DeclaredTip::default();
    for entry in &mut reader {
        if let Entry::Frame(recorded) = entry {
            let message = &recorded.frame.message;
            let payload = payload(&recorded)?;
            used.entry(message.name()).or_default().enter(&payload);
            if modulus::row(&mut declared, message).is_some() {
                used.entry(modulus::TABLE).or_default();
            }
        }
    }
    reader.refuse_empty(file)?;
    reader.remarks(file).iter().for_each(notice::say);
    Ok(used)
}

/// Fields of a record as in its text form, where an f32 has fewer digits than the nearest f64.
fn payload(recorded: &Recorded) -> Result<Value, Failure> {
    let message = &recorded.frame.message;
    let text = serde_json::to_string(message)?;
    let mut value: Value = serde_json::from_str(&text)?;
    let payload = value.get_mut(message.name()).map(Value::take);
    Ok(payload.unwrap_or_default())
}

/// One table for each kind of record, and one of moduli.
struct Tables {
    format: Format,
    folder: PathBuf,
    tables: BTreeMap<&'static str, Box<dyn Table>>,
}

impl Tables {
    fn create(
        format: Format,
        folder: &Path,
        used: &BTreeMap<&'static str, Used>,
        recording: &Path,
    ) -> Result<Self, Failure> {
        fs::create_dir_all(folder).map_err(|reason| Failure::Unwritable {
            file: folder.to_path_buf(),
            argument: format.argument,
            reason,
        })?;
        let mut tables = Self {
            format,
            folder: folder.to_path_buf(),
            tables: BTreeMap::new(),
        };
        // Checks all outputs before it creates the first, since that empties an older file.
        for kind in used.keys() {
            let file = tables.file(kind);
            OutputFile::new(tables.format.argument, &file)?.apart_from(recording)?;
        }
        for (&kind, used) in used {
            let columns = match kind {
                modulus::TABLE => modulus::columns(),
                _ => columns::of(kind, used),
            };
            let table = (tables.format.create)(&tables.file(kind), columns);
            let table = table.map_err(|reason| tables.unfinished(&reason))?;
            tables.tables.insert(kind, table);
        }
        Ok(tables)
    }

    fn file(&self, kind: &str) -> PathBuf {
        self.folder.join(format!("{kind}.{}", self.format.ending))
    }

    fn add(&mut self, kind: &str, recorded: &Recorded, payload: &Value) -> Result<(), Failure> {
        let Some(table) = self.tables.get_mut(kind) else {
            return Ok(());
        };
        let added = table.add(recorded, payload);
        added.map_err(|reason| self.unfinished(&reason))
    }

    fn finish(mut self) -> Result<(), Failure> {
        let mut out = io::stdout().lock();
        for (kind, table) in std::mem::take(&mut self.tables) {
            table.finish().map_err(|reason| self.unfinished(&reason))?;
            writeln!(out, "{}", self.file(kind).display())?;
        }
        Ok(())
    }

    fn unfinished(&self, reason: &str) -> Failure {
        Failure::Refused(format!(
            "{} {}: {reason}. The tables are not complete: make room there, or name another folder.",
            self.format.argument,
            self.folder.display()
        ))
    }
}
