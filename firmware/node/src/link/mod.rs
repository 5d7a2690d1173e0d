//! Links to PCs: records out, commands in, each link separately.
//!
//! Every link numbers its frames and counts the dropped ones, so that each receiver knows exactly how
//! many are missing. No part waits for a PC: frames without space are dropped.

mod frame_queue;
mod usb_frames;

use palpate_wire::{Command, CommandDecoder, Message, Record, Sequencer, encode};

pub use frame_queue::{FrameQueue, FrameReceiver, FrameSender};
pub use usb_frames::UsbFrames;

use crate::instrument::Received;

/// Bytes of commands that the instrument reads from a link per turn: two of the longest frames.
pub const BYTES_A_TURN: usize = 2 * Command::MAX_FRAME;

/// Sink of frames towards a PC.
pub trait FrameSink {
    /// Accepts a frame whole or not at all; returns whether it did. Never waits.
    fn write(&mut self, frame: &[u8]) -> bool;

    /// Returns whether a PC may be connected. Without one, frames are not encoded.
    fn is_open(&self) -> bool;

    /// Returns the number of frames that were accepted and discarded since the last call.
    fn take_discarded(&mut self) -> u32;
}

/// Source of bytes from a PC.
pub trait ByteSource {
    /// Returns the next byte, if one was received.
    fn read(&mut self) -> Option<u8>;
}

/// Sender of records over a link.
#[derive(Debug)]
pub struct Outbox<S> {
    sink: S,
    sequencer: Sequencer,
}

impl<S: FrameSink> Outbox<S> {
    /// Creates the sender of the run with this boot id.
    pub const fn new(sink: S, boot_id: u32) -> Self {
        Self {
            sink,
            sequencer: Sequencer::new(boot_id),
        }
    }

    /// Returns the sink of the frames.
    pub const fn sink(&self) -> &S {
        &self.sink
    }

    /// Numbers and sends a record with its time. `buffer` is working memory.
    pub fn send(&mut self, buffer: &mut [u8; Record::MAX_FRAME], time_us: u64, record: &Record) {
        for _ in 0..self.sink.take_discarded() {
            self.sequencer.count_dropped();
        }
        let header = self.sequencer.stamp(time_us);
        // Encoding cannot fail, since the buffer can hold any record.
        let is_sent = self.sink.is_open()
            && encode(&header, record, buffer)
                .is_ok_and(|frame| !frame.is_empty() && self.sink.write(frame));
        if !is_sent {
            self.sequencer.count_dropped();
        }
    }
}

/// Receiver of commands over a link.
#[derive(Debug)]
pub struct Inbox<S> {
    source: S,
    decoder: CommandDecoder,
}

impl<S: ByteSource> Inbox<S> {
    /// Creates the receiver of a new link.
    pub const fn new(source: S) -> Self {
        Self {
            source,
            decoder: CommandDecoder::new(),
        }
    }

    /// Returns the next whole frame, reading at most `bytes` bytes.
    pub fn receive(&mut self, bytes: usize) -> Option<Received> {
        for _ in 0..bytes {
            if let Some(frame) = self.decoder.push(self.source.read()?) {
                return Some(frame);
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use palpate_wire::code::{Mode, State};
    use palpate_wire::loss::Account;
    use palpate_wire::record::StateChange;
    use palpate_wire::{Header, RecordDecoder};

    use super::*;

    /// Sink that accepts two frames of three.
    #[derive(Default)]
    struct Narrow {
        bytes: Vec<u8>,
        offered: u32,
    }

    impl FrameSink for Narrow {
        fn write(&mut self, frame: &[u8]) -> bool {
            self.offered += 1;
            let has_room = !self.offered.is_multiple_of(3);
            if has_room {
                self.bytes.extend_from_slice(frame);
            }
            has_room
        }

        fn is_open(&self) -> bool {
            true
        }

        fn take_discarded(&mut self) -> u32 {
            0
        }
    }

    #[test]
    fn numbers_drops_and_microseconds_go_on_across_the_ends_of_32_bits() {
        let last = Header {
            boot_id: 7,
            sequence: u32::MAX - 20,
            time_us: 0,
            dropped: u32::MAX - 5,
        };
        let mut outbox = Outbox {
            sink: Narrow::default(),
            sequencer: Sequencer::after(&last),
        };
        let record = Record::State(StateChange {
            state: State::Ramps,
            previous: State::Ramps,
            mode: Mode::Stiffness,
            armed: true,
            measurement: 1,
        });
        let begin_us = u64::from(u32::MAX) - 20_000;
        for number in 0..60 {
            outbox.send(
                &mut [0; Record::MAX_FRAME],
                begin_us + 1_000 * number,
                &record,
            );
        }
        let mut account = Account::new();
        account.take(&last);
        let mut decoder = RecordDecoder::new();
        let mut times_us = Vec::new();
        for frame in decoder.frames(&outbox.sink.bytes) {
            let header = frame.unwrap().header;
            account.take(&header);
            times_us.push(header.time_us);
        }
        let tally = account.current().unwrap();
        assert_eq!((times_us.len(), tally.received()), (40, 41));
        assert_eq!(times_us.first(), Some(&begin_us));
        assert_eq!(times_us.last(), Some(&(begin_us + 58_000)));
        assert!(times_us.is_sorted());
        // Counts from `last` to the last received frame, the 59th of the 60.
        assert_eq!((tally.produced(), tally.missing()), (60, 19));
        assert_eq!(tally.dropped_by_device(), 19);
    }
}
