//! `palpate info`: contents of a recording.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::Args;
use palpate_cli::failure::Failure;
use palpate_cli::notice::{self, printable};
use serde::Serialize;
use serde_json::Value;

use crate::recording::{ABOUT, BOOT, BootLosses, Contents, Note, Reader, date};

/// Say what is in a recording
///
/// What board, when, how long, which records, what is missing of them, and which settings and calibration
/// were in force.
#[derive(Args)]
#[command(after_help = "\
A recording that was cut off is read as far as it goes.

Example:
  palpate info press.mcap")]
pub(crate) struct Arguments {
    /// The recording
    #[arg(value_name = "FILE.mcap")]
    file: PathBuf,
    /// Print JSON
    #[arg(long)]
    json: bool,
}

/// Contents of a recording.
#[derive(Serialize)]
struct Info {
    file: String,
    /// Damage of the file; absent for a whole file.
    damage: Option<String>,
    /// Arrival of the first record; absent without one.
    began_at: Option<String>,
    duration_s: f64,
    records: std::collections::BTreeMap<&'static str, u64>,
    /// Messages of another version of the protocol.
    unreadable: u64,
    boots: Vec<BootLosses>,
    recording: Value,
    /// Identity of the board and configuration in force at each boot.
    in_force: Vec<Value>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<(), Failure> {
    let mut reader = Reader::open(&arguments.file)?;
    let mut contents = Contents::default();
    for entry in &mut reader {
        contents.enter(&entry);
    }
    reader.refuse_foreign(&arguments.file)?;
    let info = Info {
        file: arguments.file.display().to_string(),
        damage: reader.damage(),
        began_at: contents.began_ns().map(date::text),
        duration_s: contents.duration_s(),
        records: contents.kinds().clone(),
        unreadable: reader.unreadable(),
        boots: contents.boots(),
        recording: contents.notes(ABOUT).next().map_or(Value::Null, object),
        in_force: contents.notes(BOOT).map(object).collect(),
    };
    if let Some(damage) = &info.damage {
        notice::say(format_args!("{}: {damage}.", arguments.file.display()));
    }
    print(&info, arguments.json)
}

/// Converts a note to JSON, including its records.
fn object(note: &Note) -> Value {
    let fields = note.fields.iter().map(|(name, text)| {
        let value = serde_json::from_str(text).unwrap_or_else(|_| text.as_str().into());
        (name.clone(), value)
    });
    Value::Object(fields.collect())
}

fn print(info: &Info, json: bool) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    if json {
        return Ok(writeln!(out, "{}", serde_json::to_string(info)?)?);
    }
    writeln!(out, "{}", info.file)?;
    for (name, value) in fields(&info.recording) {
        writeln!(out, "  {}: {}", printable(name), plain(value))?;
    }
    let began = info.began_at.as_deref().unwrap_or("no record");
    writeln!(out, "  first record: {began}")?;
    writeln!(out, "  duration: {:.3} s", info.duration_s)?;
    for (kind, count) in &info.records {
        writeln!(out, "  {kind}: {count}")?;
    }
    for boot in &info.boots {
        writeln!(out, "{}", boot.sentence())?;
    }
    for boot in &info.in_force {
        print_boot(&mut out, boot)?;
    }
    Ok(())
}

fn print_boot(out: &mut impl Write, boot: &Value) -> io::Result<()> {
    let boot_id = boot.get("boot_id").and_then(Value::as_u64).unwrap_or(0);
    writeln!(out, "configuration of boot {boot_id:08x}:")?;
    let whole = ["hello", "settings", "storage"];
    let whole = whole
        .iter()
        .filter_map(|&name| boot.get(name)?.get(name).map(|of| (name, of)));
    for (name, record) in whole {
        print_record(out, name, record)?;
    }
    let parts = boot.get("calibration").and_then(Value::as_array);
    for part in parts.into_iter().flatten() {
        for (name, record) in fields(part) {
            print_record(out, name, record)?;
        }
    }
    Ok(())
}

fn print_record(out: &mut impl Write, name: &str, record: &Value) -> io::Result<()> {
    let fields = fields(record).map(|(field, value)| format!("{field} {}", plain(value)));
    writeln!(out, "  {name}: {}", fields.collect::<Vec<_>>().join(", "))
}

fn fields(of: &Value) -> impl Iterator<Item = (&String, &Value)> {
    of.as_object().into_iter().flatten()
}

fn plain(value: &Value) -> String {
    match value {
        Value::String(text) => printable(text),
        Value::Null => "-".to_owned(),
        other => other.to_string(),
    }
}
