//! Content of the report on a recording.

use std::collections::HashMap;
use std::path::Path;

use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_cli::report::Story;
use palpate_wire::Record;

use crate::recording::date::NS_PER_S;
use crate::recording::{ABOUT, BOOT, Contents, Entry, Note, Reader, Recorded};

/// The shown parts of a recording.
pub(super) struct RecordingSummary {
    pub(super) file: String,
    /// Name of the board.
    pub(super) board: String,
    pub(super) contents: Contents,
    pub(super) story: Story,
}

/// State while reading a file.
#[derive(Default)]
struct Reading {
    /// Time of the first record, ns since 1970.
    first_ns: Option<u64>,
    /// Settings and calibration in force, by boot.
    in_force: HashMap<u32, Vec<Record>>,
    boot_id: Option<u32>,
}

impl RecordingSummary {
    /// Reads a file.
    pub(super) fn read(file: &Path) -> Result<Self, Failure> {
        let mut summary = Self {
            file: file.display().to_string(),
            board: String::new(),
            contents: Contents::default(),
            story: Story::default(),
        };
        let mut reader = Reader::open(file)?;
        let mut reading = Reading::default();
        // The first note of each boot applies from its start, wherever it is in the file.
        for note in Reader::boot_notes(file)?.iter().rev() {
            summary.note(note, &mut reading);
        }
        for entry in &mut reader {
            summary.contents.enter(&entry);
            match entry {
                Entry::Note(note) => summary.note(&note, &mut reading),
                Entry::Frame(recorded) => summary.frame(recorded, &mut reading),
                Entry::Log(_) => {}
            }
        }
        reader.refuse_empty(file)?;
        if let Some(damage) = reader.damage() {
            notice::say(format_args!("{}: {damage}.", file.display()));
        }
        Ok(summary)
    }

    fn note(&mut self, note: &Note, reading: &mut Reading) {
        let field = |name| note.fields.get(name);
        match note.name.as_str() {
            ABOUT => self.board = field("board").cloned().unwrap_or_default(),
            BOOT => {
                let boot_id = field("boot_id").and_then(|text| text.parse().ok());
                if let (Some(boot_id), Some(parts)) = (boot_id, in_force(note)) {
                    reading.in_force.insert(boot_id, parts);
                }
            }
            _ => {}
        }
    }

    fn frame(&mut self, recorded: Recorded, reading: &mut Reading) {
        let first_ns = *reading.first_ns.get_or_insert(recorded.device_ns);
        let at_s = recorded.device_ns.saturating_sub(first_ns) as f64 / NS_PER_S as f64;
        let boot_id = recorded.frame.header.boot_id;
        if reading.boot_id.replace(boot_id) != Some(boot_id) {
            let parts = reading.in_force.get(&boot_id);
            self.story.boot(parts.map_or(&[], Vec::as_slice));
        }
        self.story.take(at_s, recorded.frame.message);
    }
}

/// Returns settings and calibration in force from a note.
fn in_force(note: &Note) -> Option<Vec<Record>> {
    let settings: Record = serde_json::from_str(note.fields.get("settings")?).ok()?;
    let mut parts: Vec<Record> = serde_json::from_str(note.fields.get("calibration")?).ok()?;
    parts.push(settings);
    Some(parts)
}
