//! Which settings and calibration are in force.

use core::borrow::Borrow;

use postcard::Serializer;
use postcard::ser_flavors::Flavor;

use crate::Command;
use crate::checksum::{Digest, digest};
use crate::message::Message;
use crate::message::sealed::Payload;

/// CRC-32 over the commands that would set a configuration: what `hello` tells.
///
/// It runs over the kind and the payload of each, ordered by kind, then sensor, channel and first
/// knot, with every chunk of a curve but the last one full, and with nothing for what was never
/// set. Device and PC give the same commands in the same order and get the same number.
pub fn configuration_crc(commands: impl IntoIterator<Item: Borrow<Command>>) -> u32 {
    let mut to = Serializer {
        output: Checksum(digest()),
    };
    for command in commands {
        let command = command.borrow();
        // Neither can fail: the digest takes any byte.
        to.output.take(&[command.kind()]);
        let _ = command.write(&mut to);
    }
    to.output.0.finalize()
}

struct Checksum(Digest);

impl Checksum {
    /// A function of its own: at every field of every command it took two kilobytes of a firmware.
    #[inline(never)]
    fn take(&mut self, bytes: &[u8]) {
        self.0.update(bytes);
    }
}

impl Flavor for Checksum {
    type Output = u32;

    #[inline]
    fn try_push(&mut self, byte: u8) -> postcard::Result<()> {
        self.take(&[byte]);
        Ok(())
    }

    #[inline]
    fn try_extend(&mut self, bytes: &[u8]) -> postcard::Result<()> {
        self.take(bytes);
        Ok(())
    }

    fn finalize(self) -> postcard::Result<u32> {
        Ok(self.0.finalize())
    }
}
