//! The channels to the PC: logs and records up, commands down, over a debug probe (RTT).

pub mod log;

use palpate_wire::{CommandDecoder, Message, Record, Sequencer, encode};
use rtt_target::{DownChannel, UpChannel};

/// Sends records. It never waits: what finds no room is dropped, and counted.
pub struct Outbox {
    channel: UpChannel,
    sequencer: Sequencer,
    buffer: [u8; Record::MAX_FRAME],
}

impl Outbox {
    /// Numbers and sends the record of a time.
    pub fn send(&mut self, time_us: u64, record: &Record) {
        let header = self.sequencer.stamp(time_us);
        // The buffer holds any record.
        let frame = encode(&header, record, &mut self.buffer).unwrap_or_default();
        if frame.is_empty() || self.channel.write(frame) < frame.len() {
            self.sequencer.count_dropped();
        }
    }
}

/// Receives commands.
pub struct Inbox {
    channel: DownChannel,
    decoder: CommandDecoder,
}

/// A command frame, or why a frame is none.
pub type Received = Result<palpate_wire::Frame<palpate_wire::Command>, palpate_wire::FrameError>;

impl Inbox {
    /// The next whole frame, among at most so many bytes.
    pub fn receive(&mut self, bytes: usize) -> Option<Received> {
        for _ in 0..bytes {
            let mut byte = [0];
            if self.channel.read(&mut byte) == 0 {
                return None;
            }
            let [byte] = byte;
            if let Some(frame) = self.decoder.push(byte) {
                return Some(frame);
            }
        }
        None
    }

    /// Frames that arrived damaged.
    pub const fn damaged(&self) -> u32 {
        self.decoder.counts().damaged()
    }
}

/// Sets the three channels up. Once only.
pub fn set_up(boot_id: u32) -> (Outbox, Inbox) {
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
    let outbox = Outbox {
        channel: channels.up.1,
        sequencer: Sequencer::new(boot_id),
        buffer: [0; Record::MAX_FRAME],
    };
    let inbox = Inbox {
        channel: channels.down.0,
        decoder: CommandDecoder::new(),
    };
    (outbox, inbox)
}
