//! What a fuzzer runs, and the tests over its corpus: functions that take any bytes and say which
//! promise was not kept.

mod frames;
mod storage;

use crate::hostile;

/// A function that takes any bytes.
#[derive(Clone, Copy, Debug)]
pub struct Target {
    /// Its name, and that of its corpus.
    pub name: &'static str,
    /// Holds its promises against some bytes; the error is the promise that was not kept.
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

/// Bytes as what is done to a storage's flash.
pub const STORAGE: Target = Target {
    name: "storage",
    run: storage::run,
};

/// Every target.
pub const TARGETS: [Target; 3] = [COMMANDS, FRAMES, STORAGE];

/// Reads the bytes of a script; what is missing at its end is 0 or nothing.
struct Reader<'a>(&'a [u8]);

impl<'a> Reader<'a> {
    fn byte(&mut self) -> u8 {
        let (first, rest) = self.0.split_first().unwrap_or((&0, &[]));
        self.0 = rest;
        *first
    }

    fn number(&mut self) -> u16 {
        u16::from_le_bytes([self.byte(), self.byte()])
    }

    /// Bytes with their number before them.
    fn bytes(&mut self) -> &'a [u8] {
        let length = usize::from(self.byte()).min(self.0.len());
        let (bytes, rest) = self.0.split_at(length);
        self.0 = rest;
        bytes
    }
}
