//! Which settings and calibration are in force.

use core::borrow::Borrow;

use crate::Command;
use crate::checksum::digest;
use crate::encoder::payload;
use crate::message::Message;

/// CRC-32 over the commands that would set a configuration: the number that `hello` reports.
///
/// It runs over the kind and the payload of each, ordered by kind, then sensor, channel and first
/// knot, with every chunk of a curve but the last one full, and with nothing for what was never
/// set. Device and PC give the same commands in the same order and get the same number.
pub fn configuration_crc(commands: impl IntoIterator<Item: Borrow<Command>>) -> u32 {
    let mut digest = digest();
    for command in commands {
        let command = command.borrow();
        let mut buffer = [0; Command::MAX_PAYLOAD];
        digest.update(&[command.kind()]);
        // Every payload fits.
        digest.update(payload(command, &mut buffer).unwrap_or_default());
    }
    digest.finalize()
}
