//! A table in any file format.

use serde_json::Value;

use crate::recording::Recorded;

/// A table during writing.
pub(super) trait Table {
    /// Adds a record with its fields.
    fn add(&mut self, recorded: &Recorded, payload: &Value) -> Result<(), String>;

    /// Writes the remaining rows.
    fn finish(self: Box<Self>) -> Result<(), String>;
}

/// A new table, or the reason why it could not be created.
pub(super) type Created = Result<Box<dyn Table>, String>;
