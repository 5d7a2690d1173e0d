//! Hardware that a board provides for a converter.

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
    /// Bytes that the request read.
    pub bytes: heapless::Vec<u8, MOST_FRAME_BYTES>,
    /// Times of the read; `None` if the edge is not known because a falling edge of INTB was missed.
    /// Such a frame only releases INTB.
    pub fetch: Option<Fetch>,
}

/// Deadlines of reading on edges.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct EdgeDeadlines {
    /// Longest time without a known edge, us.
    pub silence_us: u32,
    /// Number of transactions per frame: either one transaction for all registers, or one for STATUS and
    /// the first channel and one for each further channel. The other converter gets its turn between two
    /// transactions.
    pub parts: u8,
    /// Latest start of each part after its edge, us. If a part would start later, the rest of the frame
    /// is not read: the frame is passed on with zeros and end times that are too late for any frame.
    pub latest_begin_us: [u32; MOST_PARTS],
}

/// Reader of a frame on every falling edge of INTB, without a separate request.
#[allow(async_fn_in_trait, reason = "no board moves it between threads")]
pub trait EdgeReader {
    /// Starts reading a frame on every edge.
    fn start(&mut self, request: &FrameRequest, deadlines: EdgeDeadlines);

    /// Returns the next frame with its edge, in the order of the edges.
    ///
    /// # Errors
    ///
    /// The error of the transfer, or [`TransferError::Silent`] after the deadline. Reading continues.
    async fn next(&mut self) -> Result<EdgeFrame, TransferError>;

    /// Stops reading and discards waiting frames.
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

/// Other board functions for a converter's task.
#[allow(async_fn_in_trait, reason = "no board moves it between threads")]
pub trait Port {
    /// Input pin type of INTB.
    type Intb: InputPin;

    /// Returns INTB as an input, for the test that finds out what releases it.
    fn intb(&self) -> Self::Intb;

    /// Holds the converter in shutdown by SD, or lets it wake.
    fn shut_down(&mut self, off: bool);

    /// Sets the clock at CLKIN, which both converters share. The task calls it only while neither
    /// converter runs from a different clock.
    fn set_clkin(&mut self, clkin: Clkin);

    /// Waits, and checks in with the supervisor meanwhile.
    async fn wait_us(&mut self, time_us: u32);

    /// Gives `work` access to the state that the tasks of both converters share with the instrument and
    /// with each other.
    fn with_states<T>(&mut self, work: impl FnOnce(&mut [ConverterState; CONVERTERS]) -> T) -> T;

    /// Passes a sample to the instrument; returns whether there was space for it.
    fn hand_over(&mut self, sampled: Sampled) -> bool;
}
