//! Link through a debug probe: logs and records to the PC, commands from it.

use palpate_node::link::{ByteSource, FrameSink};
use rtt_target::{DownChannel, UpChannel};

use super::log;
use super::up_channel::write_whole;

/// Channel of records. The firmware cannot know whether a probe reads them.
pub struct RttRecords(UpChannel);

impl FrameSink for RttRecords {
    fn write(&mut self, frame: &[u8]) -> bool {
        write_whole(&mut self.0, frame)
    }

    fn is_open(&self) -> bool {
        true
    }

    fn take_discarded(&mut self) -> u32 {
        0
    }
}

/// Channel of commands.
pub struct RttCommands(DownChannel);

impl ByteSource for RttCommands {
    fn read(&mut self) -> Option<u8> {
        let mut byte = [0];
        let [byte] = match self.0.read(&mut byte) {
            0 => return None,
            _ => byte,
        };
        Some(byte)
    }
}

/// Sets the three channels up. Call it once.
pub fn set_up() -> (RttRecords, RttCommands) {
    let channels = rtt_target::rtt_init! {
        up: {
            0: { size: 1024, name: "defmt" }
            1: { size: 8192, name: "data" }
        }
        down: {
            0: { size: 1024, name: "commands" }
        }
    };
    log::set_channel(channels.up.0);
    (RttRecords(channels.up.1), RttCommands(channels.down.0))
}
