//! The links to PCs: records out, commands in, each link for itself.
//!
//! Every link numbers its frames and counts what it dropped, so that each receiver's account is
//! exact. Nothing waits for a PC: what finds no room is dropped.

mod frame_queue;

use palpate_wire::{CommandDecoder, Message, Record, Sequencer, encode};

pub use frame_queue::{FrameQueue, FrameReceiver, FrameSender};

use crate::instrument::Received;

/// Takes frames towards a PC.
pub trait FrameSink {
    /// Takes a frame, whole or not at all; whether it did. Never waits.
    fn write(&mut self, frame: &[u8]) -> bool;

    /// Whether a PC may be there. Where none is, frames are not even made.
    fn is_open(&self) -> bool;

    /// Frames that were taken and thrown away after all, since the last call.
    fn take_discarded(&mut self) -> u32;
}

/// Gives the bytes that came from a PC.
pub trait ByteSource {
    /// The next byte, if one has come.
    fn read(&mut self) -> Option<u8>;
}

/// The way of records over a link.
#[derive(Debug)]
pub struct Outbox<S> {
    sink: S,
    sequencer: Sequencer,
}

impl<S: FrameSink> Outbox<S> {
    /// A link of the run with this number.
    pub const fn new(sink: S, boot_id: u32) -> Self {
        Self {
            sink,
            sequencer: Sequencer::new(boot_id),
        }
    }

    /// Where the frames go.
    pub const fn sink(&self) -> &S {
        &self.sink
    }

    /// Numbers and sends the record of a time. The buffer is to work in.
    pub fn send(&mut self, buffer: &mut [u8; Record::MAX_FRAME], time_us: u64, record: &Record) {
        for _ in 0..self.sink.take_discarded() {
            self.sequencer.count_dropped();
        }
        let header = self.sequencer.stamp(time_us);
        // The buffer holds any record; an empty frame is none.
        let is_sent = self.sink.is_open()
            && encode(&header, record, buffer)
                .is_ok_and(|frame| !frame.is_empty() && self.sink.write(frame));
        if !is_sent {
            self.sequencer.count_dropped();
        }
    }
}

/// The way of commands over a link.
#[derive(Debug)]
pub struct Inbox<S> {
    source: S,
    decoder: CommandDecoder,
}

impl<S: ByteSource> Inbox<S> {
    /// A link over which nothing has come yet.
    pub const fn new(source: S) -> Self {
        Self {
            source,
            decoder: CommandDecoder::new(),
        }
    }

    /// The next whole frame, among at most so many bytes.
    pub fn receive(&mut self, bytes: usize) -> Option<Received> {
        for _ in 0..bytes {
            if let Some(frame) = self.decoder.push(self.source.read()?) {
                return Some(frame);
            }
        }
        None
    }
}
