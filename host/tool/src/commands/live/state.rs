//! State that a page shows beside the plots.

use palpate_cli::touch_map::Array;
use palpate_wire::code::Location;
use palpate_wire::record;
use serde::Serialize;

use super::measurements::now_ms;
use crate::commands::calibrate::sensor::CalibrationFigures;
use crate::commands::faults;
use crate::commands::watch::known::Known;

/// The complete state at one time.
#[derive(Serialize)]
pub(super) struct State<'a> {
    /// Same data as in `palpate watch --json`.
    pub(super) known: &'a Known,
    /// Time on the clock of the measurements' times, ms since 1970.
    time_ms: u64,
    /// Firmware version and unit of the board.
    pub(super) title: String,
    /// Activity of the board, and contact.
    pub(super) doing: Option<&'static str>,
    pub(super) contact: Option<&'static str>,
    /// Coils under the touches of `known`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) array: Option<&'a Array>,
    /// Active faults with their descriptions.
    pub(super) faults: Vec<Fault>,
    pub(super) calibration: &'a Progress,
    /// Last answer to a request.
    pub(super) answer: &'a Answer,
}

impl<'a> State<'a> {
    /// Builds the state of a board, with texts from the protocol.
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
            array: None,
            faults: faults.iter().map(Fault::of).collect(),
            calibration,
            answer,
        }
    }
}

/// An active fault with its description.
#[derive(Serialize)]
pub(super) struct Fault {
    number: u8,
    name: &'static str,
    /// Meaning, and what to check.
    meaning: String,
    location: Location,
    /// Found and allowed value, as the meaning says.
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

/// Answer to a request.
#[derive(Debug, Default, Serialize)]
pub(super) struct Answer {
    /// Number of answers so far.
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

/// Progress of a calibration.
#[derive(Debug, Serialize)]
#[serde(tag = "phase", rename_all = "snake_case")]
pub(super) enum Progress {
    /// No bench.
    Unavailable { reason: &'static str },
    /// Ready to start, with the number of runs.
    Ready { runs: usize },
    Running {
        /// Number of the run, from 1.
        run: usize,
        runs: usize,
        /// Specimen and depth.
        pressed: String,
    },
    /// A result, to be kept or discarded.
    Found { figures: Box<CalibrationFigures> },
    /// Puts the result in force and stores it.
    Storing,
    /// The result is in force and stored.
    Kept { figures: Box<CalibrationFigures> },
    /// The calibration ended without a result.
    Failed { reason: String },
}
