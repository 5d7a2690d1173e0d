//! Fuzz targets, also run by the tests over their corpus: functions that take any bytes and return
//! the violated promise.

mod frames;
mod reader;
mod storage;

use crate::hostile;

/// A fuzz target.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Name of the target and of its corpus.
    pub name: &'static str,
    /// Checks the promises on any bytes; the error is the violated promise.
    pub run: fn(&[u8]) -> Result<(), String>,
}

/// Bytes over the links of a board: see [`hostile`].
pub const COMMANDS: Target = Target {
    name: "commands",
    run: |bytes| hostile::play(bytes).map(drop),
};

/// Bytes as records and as commands.
pub const FRAMES: Target = Target {
    name: "frames",
    run: frames::run,
};

/// Bytes as operations on a storage's flash.
pub const STORAGE: Target = Target {
    name: "storage",
    run: storage::run,
};

/// Every target.
pub const TARGETS: [Target; 3] = [COMMANDS, FRAMES, STORAGE];
