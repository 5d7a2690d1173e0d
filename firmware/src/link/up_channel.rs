//! Writing to a channel of the debug probe.

use rtt_target::{ChannelMode, UpChannel};

/// Writes all bytes or, without space, none; returns whether it wrote them. A PC may have set the
/// channel to block (`probe-rs run` does so for logs) and then stop reading, so the mode is set each
/// time.
pub fn write_whole(channel: &mut UpChannel, bytes: &[u8]) -> bool {
    channel.set_mode(ChannelMode::NoBlockSkip);
    channel.write(bytes) == bytes.len()
}
