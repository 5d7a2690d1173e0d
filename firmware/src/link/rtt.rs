//! The link through a debug probe: logs and records up, commands down.

use palpate_node::link::{ByteSource, FrameSink};
use rtt_target::{ChannelMode, DownChannel, UpChannel};

use super::log;

/// Writes all of it or, where there is no room, nothing; whether it did. A PC may have set the channel to
/// wait for room (`probe-rs run` does so with logs), and then take no more: the mode is set each time.
pub fn write_whole(channel: &mut UpChannel, bytes: &[u8]) -> bool {
    channel.set_mode(ChannelMode::NoBlockSkip);
    channel.write(bytes) == bytes.len()
}

/// Records. Whether a probe reads them cannot be known.
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

/// Commands.
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

/// Sets the three channels up. Once only.
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
