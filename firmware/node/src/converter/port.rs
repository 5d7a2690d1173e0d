//! What a board gives for a converter.

use embedded_hal::digital::InputPin;
use ldc161x::FrameRequest;

use super::error::TransferError;
use super::state::{CONVERTERS, ConverterState};
use crate::acquisition::{Fetch, MOST_PARTS, Sampled};
use crate::board::Clkin;

/// Bytes of the longest frame: STATUS, and MSB and LSB of four channels, each read twice.
pub const MOST_FRAME_BYTES: usize = 34;

/// A frame that was read on an edge of INTB.
#[derive(Clone, Debug)]
pub struct EdgeFrame {
    /// Its bytes: those of the request.
    pub bytes: heapless::Vec<u8, MOST_FRAME_BYTES>,
    /// When it was read; nothing where the edge is not known, because a fall of INTB was missed. Such
    /// a frame only releases INTB.
    pub fetch: Option<Fetch>,
}

/// Deadlines of reading on edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeDeadlines {
    /// How long no edge of a known time may come, us.
    pub silence_us: u32,
    /// How many transactions a frame is read in: the registers of STATUS and the first channel in the first
    /// one and the two of each other channel in each other one, or all of them in one. The other
    /// converter has its turn between two of them.
    pub parts: u8,
    /// How long after its edge each part may begin, us. A frame of which a part would begin later is not
    /// read any further: it is passed on with zeros, and a fetch that ended too late for any frame.
    pub latest_begin_us: [u32; MOST_PARTS],
}

/// Reads a frame on every falling edge of INTB, ahead of being asked for it.
#[allow(async_fn_in_trait, reason = "no board moves it between threads")]
pub trait EdgeReader {
    /// Begins: from now on every edge has its frame read.
    fn start(&mut self, request: &FrameRequest, deadlines: EdgeDeadlines);

    /// The next frame with its edge, in the order of the edges.
    ///
    /// # Errors
    /// Of the transfer, or [`TransferError::Silent`] after the time that the deadlines allow. Reading
    /// goes on.
    async fn next(&mut self) -> Result<EdgeFrame, TransferError>;

    /// Ends it, and forgets frames that wait.
    fn stop(&mut self);
}

impl<E: EdgeReader> EdgeReader for &mut E {
    fn start(&mut self, request: &FrameRequest, deadlines: EdgeDeadlines) {
        E::start(self, request, deadlines);
    }

    async fn next(&mut self) -> Result<EdgeFrame, TransferError> {
        E::next(self).await
    }

    fn stop(&mut self) {
        E::stop(self);
    }
}

/// Everything else that a converter's task needs of its board.
#[allow(async_fn_in_trait, reason = "no board moves it between threads")]
pub trait Port {
    /// INTB as a level.
    type Intb: InputPin;

    /// INTB, for the question what releases it.
    fn intb(&self) -> Self::Intb;

    /// Holds the converter in shutdown by SD, or lets it wake.
    fn shut_down(&mut self, off: bool);

    /// Sets the clock at CLKIN, which is that of both converters. The task does so only while neither
    /// runs by another one.
    fn set_clkin(&mut self, clkin: Clkin);

    /// Waits. The supervisor sees meanwhile that the task is alive.
    async fn wait_us(&mut self, time_us: u32);

    /// Lets `work` see what the tasks of both converters share with the instrument and with one another.
    fn with_states<T>(&mut self, work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T) -> T;

    /// Hands a sample to the instrument; whether there was room for it.
    fn hand_over(&mut self, sampled: Sampled) -> bool;
}
