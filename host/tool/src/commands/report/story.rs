//! Content of the report on a recording.

use std::collections::HashMap;
use std::path::Path;

use palpate_cli::describe::limited_by;
use palpate_cli::failure::Failure;
use palpate_cli::notice;
use palpate_wire::Record;
use palpate_wire::record::{Estimate, LoadPoint, Refusal, Sample};

use crate::recording::date::NS_PER_S;
use crate::recording::{ABOUT, BOOT, Contents, Entry, Note, Reader, Recorded};
use crate::train_line::{Train, TrainLine};

/// Time before a measurement's result that its charts show, s: for a short press it begins before
/// the touch.
const BEFORE_S: f64 = 3.0;
/// Time after a measurement's result that its charts show, s.
const AFTER_S: f64 = 0.5;

/// The shown parts of a recording.
pub(super) struct RecordingSummary {
    pub(super) file: String,
    /// Name of the board.
    pub(super) board: String,
    pub(super) contents: Contents,
    /// Samples of the first converter: time since the first record, s.
    pub(super) samples: Vec<(f64, Sample)>,
    pub(super) measurements: Vec<Measurement>,
}

/// A measurement with its result.
pub(super) struct Measurement {
    /// Time of the result since the first record, s.
    pub(super) at_s: f64,
    pub(super) result: Result<Estimate, Refusal>,
    /// Largest cause of the interval, if the board reported it.
    pub(super) limited_by: Option<String>,
    pub(super) line: Option<TrainLine>,
    pub(super) points: Vec<LoadPoint>,
}

impl Measurement {
    /// Whether a time, s, is within the measurement's shown range.
    pub(super) fn shows(&self, time_s: f64) -> bool {
        (self.at_s - BEFORE_S..=self.at_s + AFTER_S).contains(&time_s)
    }
}

/// State while reading a file.
#[derive(Default)]
struct Reading {
    /// Time of the first record, ns since 1970.
    first_ns: Option<u64>,
    /// Settings and calibration in force, by boot.
    in_force: HashMap<u32, Vec<Record>>,
    boot_id: Option<u32>,
    train: Train,
    /// Largest cause of the next result's interval.
    limited_by: Option<String>,
}

impl RecordingSummary {
    /// Reads a file.
    pub(super) fn read(file: &Path) -> Result<Self, Failure> {
        let mut story = Self {
            file: file.display().to_string(),
            board: String::new(),
            contents: Contents::default(),
            samples: Vec::new(),
            measurements: Vec::new(),
        };
        let mut reader = Reader::open(file)?;
        let mut reading = Reading::default();
        // The first note of each boot applies from its start, wherever it is in the file.
        for note in Reader::boot_notes(file)?.iter().rev() {
            story.note(note, &mut reading);
        }
        for entry in &mut reader {
            story.contents.enter(&entry);
            match entry {
                Entry::Note(note) => story.note(&note, &mut reading),
                Entry::Frame(recorded) => story.frame(recorded, &mut reading),
                Entry::Log(_) => {}
            }
        }
        reader.refuse_empty(file)?;
        if let Some(damage) = reader.damage() {
            notice::say(format_args!("{}: {damage}.", file.display()));
        }
        Ok(story)
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
            reading.train = Train::with(parts.map_or(&[], Vec::as_slice));
        }
        let line = reading.train.take(at_s, &recorded.frame.message);
        match recorded.frame.message {
            Record::Sample(sample) if sample.sensor == 0 => self.samples.push((at_s, sample)),
            Record::UncertaintyBudget(budget) => reading.limited_by = Some(limited_by(&budget)),
            Record::Estimate(estimate) => {
                self.ended(at_s, Ok(estimate), line, reading.limited_by.take())
            }
            Record::Refusal(refusal) => {
                self.ended(at_s, Err(refusal), None, reading.limited_by.take())
            }
            Record::LoadPoint(point) => {
                if let Some(last) = self.measurements.last_mut() {
                    last.points.push(point);
                }
            }
            _ => {}
        }
    }

    fn ended(
        &mut self,
        at_s: f64,
        result: Result<Estimate, Refusal>,
        line: Option<TrainLine>,
        limited_by: Option<String>,
    ) {
        self.measurements.push(Measurement {
            at_s,
            result,
            limited_by,
            line,
            points: Vec::new(),
        });
    }
}

/// Returns settings and calibration in force from a note.
fn in_force(note: &Note) -> Option<Vec<Record>> {
    let settings: Record = serde_json::from_str(note.fields.get("settings")?).ok()?;
    let mut parts: Vec<Record> = serde_json::from_str(note.fields.get("calibration")?).ok()?;
    parts.push(settings);
    Some(parts)
}
