//! What a page shows besides the plots.

use palpate_wire::code::Location;
use palpate_wire::record;
use serde::Serialize;

use super::measurements::now_ms;
use crate::commands::calibrate::sensor::CalibrationFigures;
use crate::commands::faults;
use crate::commands::watch::known::Known;

/// Everything at a moment.
#[derive(Serialize)]
pub(super) struct State<'a> {
    /// The same as `palpate watch --json` prints.
    pub(super) known: &'a Known,
    /// The time by the clock of the measurements' times.
    time_ms: u64,
    /// Which firmware and copy of the board it is.
    pub(super) title: String,
    /// What the board is doing, and whether something touches.
    pub(super) doing: Option<&'static str>,
    pub(super) contact: Option<&'static str>,
    /// The faults that stand, in words.
    pub(super) faults: Vec<Fault>,
    pub(super) calibration: &'a Progress,
    /// The last answer to a request.
    pub(super) answer: &'a Answer,
}

impl<'a> State<'a> {
    /// What is known of a board, in words where the protocol has some.
    pub(super) fn of(
        known: &'a Known,
        faults: &[record::Fault],
        calibration: &'a Progress,
        answer: &'a Answer,
    ) -> Self {
        let title = known.hello.as_ref().map(|hello| {
            let (major, minor, patch) = (
                hello.firmware_major,
                hello.firmware_minor,
                hello.firmware_patch,
            );
            let simulated = if hello.simulated { ", simulated" } else { "" };
            format!(
                ", firmware {major}.{minor}.{patch}, unit {:016X}{simulated}",
                hello.unit
            )
        });
        Self {
            known,
            time_ms: now_ms(),
            title: title.unwrap_or_default(),
            doing: known.state.map(|state| state.meaning().trim()),
            contact: known.contact().map(|contact| contact.meaning().trim()),
            faults: faults.iter().map(Fault::of).collect(),
            calibration,
            answer,
        }
    }
}

/// A fault in words.
#[derive(Serialize)]
pub(super) struct Fault {
    number: u8,
    name: &'static str,
    /// What it is, and what to check.
    meaning: String,
    location: Location,
    /// What was found, and what is allowed, as the meaning says.
    value: Option<f32>,
    limit: Option<f32>,
}

impl Fault {
    fn of(fault: &record::Fault) -> Self {
        let code = fault.code;
        Self {
            number: code.number(),
            name: code.name(),
            meaning: faults::meaning(code),
            location: fault.location,
            value: fault.value,
            limit: fault.limit,
        }
    }
}

/// What became of a request.
#[derive(Debug, Default, Serialize)]
pub(super) struct Answer {
    /// Counts them.
    number: u32,
    text: String,
    is_refusal: bool,
}

impl Answer {
    pub(super) fn accept(&mut self, text: impl Into<String>) {
        self.set(text.into(), false);
    }

    pub(super) fn refuse(&mut self, text: impl Into<String>) {
        self.set(text.into(), true);
    }

    fn set(&mut self, text: String, is_refusal: bool) {
        *self = Self {
            number: self.number.wrapping_add(1),
            text,
            is_refusal,
        };
    }
}

/// How far a calibration is.
#[derive(Debug, Serialize)]
#[serde(tag = "phase", rename_all = "snake_case")]
pub(super) enum Progress {
    /// There is no bench.
    Unavailable { reason: &'static str },
    /// It may begin: so many presses.
    Ready { runs: usize },
    Running {
        /// From 1.
        run: usize,
        runs: usize,
        /// What is pressed, and how deep.
        pressed: String,
    },
    /// To be kept or discarded.
    Found { figures: Box<CalibrationFigures> },
    /// Being put in force and stored.
    Storing,
    /// In force and stored.
    Kept { figures: Box<CalibrationFigures> },
    /// Ended without a result.
    Failed { reason: String },
}
