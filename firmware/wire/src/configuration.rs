//! CRC of the active settings and calibration.

use core::borrow::Borrow;

use crate::Command;
use crate::checksum::{Digest, digest};
use crate::encoder::payload;
use crate::message::Message;

/// Returns the CRC-32 over the commands that would set a configuration, the number that `hello` reports.
///
/// It covers the kind and the payload of each command, ordered by kind with the identity last, then by
/// sensor, channel and first knot. Every chunk of a curve except the last is full, and parts that were
/// never set are omitted. Device and PC use the same commands in the same order and get the same number.
pub fn configuration_crc(commands: impl IntoIterator<Item: Borrow<Command>>) -> u32 {
    let mut crc = ConfigurationCrc::new();
    for command in commands {
        crc.add(command.borrow());
    }
    crc.value()
}

/// Incremental form of [`configuration_crc`], one command at a time.
///
/// ```
/// use palpate_wire::{Command, ConfigurationCrc, configuration_crc};
/// let mut crc = ConfigurationCrc::new();
/// crc.add(&Command::Identify);
/// crc.add(&Command::Arm);
/// assert_eq!(crc.value(), configuration_crc([Command::Identify, Command::Arm]));
/// ```
#[derive(Clone)]
pub struct ConfigurationCrc(Digest);

impl ConfigurationCrc {
    /// Starts without a command.
    pub const fn new() -> Self {
        Self(digest())
    }

    /// Adds a command.
    pub fn add(&mut self, command: &Command) {
        let mut buffer = [0; Command::MAX_PAYLOAD];
        self.0.update(&[command.kind()]);
        // The buffer holds every payload.
        self.0
            .update(payload(command, &mut buffer).unwrap_or_default());
    }

    /// Returns the CRC over the commands so far.
    pub fn value(&self) -> u32 {
        self.0.clone().finalize()
    }
}

impl Default for ConfigurationCrc {
    fn default() -> Self {
        Self::new()
    }
}
