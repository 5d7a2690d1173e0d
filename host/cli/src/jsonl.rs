//! Frames as lines of JSON, in one format for every verb; see docs/protocol.md.

use palpate_wire::{Frame, Record};
use serde::Serialize;

use crate::failure::Failure;

/// A line that is not a frame.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Note<'n> {
    /// Bytes that are not a valid frame.
    Damaged {
        /// Decoding error.
        error: String,
    },
    /// Start of the frames of a simulated press.
    Press {
        /// Pressed object.
        press: &'n str,
    },
}

/// Formats a frame as a line.
pub fn frame(frame: &Frame<Record>) -> Result<String, Failure> {
    Ok(serde_json::to_string(frame)?)
}

/// Formats a note as a line.
pub fn note(note: &Note<'_>) -> Result<String, Failure> {
    Ok(serde_json::to_string(note)?)
}
