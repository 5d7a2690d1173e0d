//! Frames as lines of JSON: one shape for every verb, docs/protocol.md has it.

use palpate_wire::{Frame, Record};
use serde::Serialize;

use crate::failure::Failure;

/// What a line says that is no frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Note<'n> {
    /// Bytes that are no sound frame.
    Damaged {
        /// What is wrong with them.
        error: String,
    },
    /// The frames of a simulated press begin.
    Press {
        /// What is pressed.
        press: &'n str,
    },
}

/// The line of a frame.
pub fn frame(frame: &Frame<Record>) -> Result<String, Failure> {
    Ok(serde_json::to_string(frame)?)
}

/// The line of a note.
pub fn note(note: &Note<'_>) -> Result<String, Failure> {
    Ok(serde_json::to_string(note)?)
}
