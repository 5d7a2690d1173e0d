//! Encoding: messages to bytes.

use core::fmt;

use heapless::Vec;
use postcard::ser_flavors::{Flavor, Slice};
use serde::Serialize;

use crate::checksum::crc32;
use crate::frame::{CHECKSUM, Header};
use crate::message::Message;
use crate::message::sealed::Writer;
use crate::{Record, VERSION};

/// Error: the buffer is too small for the frame. [`Message::MAX_FRAME`] bytes are always enough.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BufferTooSmall;

impl fmt::Display for BufferTooSmall {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "the buffer is too small for the frame; {} bytes hold any record",
            Record::MAX_FRAME
        )
    }
}

impl core::error::Error for BufferTooSmall {}

/// Encodes a frame and returns the filled part of the buffer. Takes one pass over the message, and no
/// memory besides the buffer.
///
/// ```
/// use palpate_wire::{Command, Header, Message, encode};
/// let header = Header { boot_id: 0, sequence: 1, time_us: 0, dropped: 0 };
/// let mut buffer = [0; Command::MAX_FRAME];
/// let frame = encode(&header, &Command::Identify, &mut buffer)?;
/// assert_eq!(frame.last(), Some(&0));
/// # Ok::<(), palpate_wire::BufferTooSmall>(())
/// ```
pub fn encode<'buffer, M: Message>(
    header: &Header,
    message: &M,
    buffer: &'buffer mut [u8],
) -> Result<&'buffer [u8], BufferTooSmall> {
    let length = fill(header, message, buffer).ok_or(BufferTooSmall)?;
    buffer.get(..length).ok_or(BufferTooSmall)
}

/// Encodes a frame into a new vector.
pub fn encode_vec<M: Message, const N: usize>(
    header: &Header,
    message: &M,
) -> Result<Vec<u8, N>, BufferTooSmall> {
    let mut frame = Vec::new();
    frame.resize_default(N).map_err(|_| BufferTooSmall)?;
    let length = fill(header, message, &mut frame).ok_or(BufferTooSmall)?;
    frame.truncate(length);
    Ok(frame)
}

/// Returns the length of the frame; `None` if the buffer is too small.
fn fill<M: Message>(header: &Header, message: &M, buffer: &mut [u8]) -> Option<usize> {
    // `stuff` relies on a frame without distances above [`LONGEST_RUN`].
    const { assert!(M::MAX_FRAME <= LONGEST_RUN) };
    // Writes after the first byte, which becomes the first distance of COBS.
    let mut to = writer(buffer.get_mut(1..)?);
    (VERSION, message.kind(), header).serialize(&mut to).ok()?;
    message.write(&mut to).ok()?;
    let content = to.output.finalize().ok()?;
    let (end, checksum) = (1 + content.len(), crc32(content));
    let checked = end + CHECKSUM;
    buffer
        .get_mut(end..checked)?
        .copy_from_slice(&checksum.to_le_bytes());
    *buffer.get_mut(checked)? = 0;
    stuff(buffer.get_mut(..checked)?);
    Some(checked + 1)
}

/// Encodes the payload of a message, without frame and header; `None` if the buffer is too small.
pub(crate) fn payload<'buffer, M: Message>(
    message: &M,
    buffer: &'buffer mut [u8],
) -> Option<&'buffer [u8]> {
    let mut to = writer(buffer);
    message.write(&mut to).ok()?;
    Some(to.output.finalize().ok()?)
}

fn writer(buffer: &mut [u8]) -> Writer<'_> {
    Writer {
        output: Slice::new(buffer),
    }
}

/// Largest distance in bytes that COBS stores in one byte. A frame of at most this length needs no
/// further distances.
const LONGEST_RUN: usize = 254;

/// Applies COBS in place: the first byte and every zero become the distance to the next zero; the last
/// zero follows the frame. Postcard's `Cobs` stuffs byte by byte, which takes longer, and has a panic
/// path.
fn stuff(frame: &mut [u8]) {
    let mut distance = 0;
    if let Some(first) = frame.first_mut() {
        *first = 0;
    }
    for byte in frame.iter_mut().rev() {
        distance += 1;
        if *byte == 0 {
            *byte = distance;
            distance = 0;
        }
    }
}

/// Numbers the frames of one sender.
///
/// Stamp every frame that is produced, and count every stamped frame that is not sent as dropped, so
/// that the receiver's account is exact. If there is no space, drop the newest frame and not a waiting
/// one: the frames after a waiting one already carry the count of dropped frames.
///
/// ```
/// use palpate_wire::Sequencer;
/// let mut sequencer = Sequencer::new(0x1234_5678);
/// assert_eq!(sequencer.stamp(10).sequence, 0);
/// assert_eq!(sequencer.stamp(20).sequence, 1);
/// sequencer.count_dropped();
/// let header = sequencer.stamp(30);
/// assert_eq!((header.sequence, header.dropped), (2, 1));
/// ```
#[derive(Clone, Debug)]
pub struct Sequencer {
    boot_id: u32,
    next: u32,
    dropped: u32,
}

impl Sequencer {
    /// Starts from frame 0. A device passes its boot id, a PC that of its device.
    pub const fn new(boot_id: u32) -> Self {
        Self {
            boot_id,
            next: 0,
            dropped: 0,
        }
    }

    /// Continues after a sent frame with this header.
    ///
    /// ```
    /// use palpate_wire::{Header, Sequencer};
    /// let last = Header { boot_id: 7, sequence: u32::MAX, time_us: 0, dropped: 3 };
    /// let next = Sequencer::after(&last).stamp(10);
    /// assert_eq!((next.sequence, next.dropped), (0, 3));
    /// ```
    pub const fn after(header: &Header) -> Self {
        Self {
            boot_id: header.boot_id,
            next: header.sequence.wrapping_add(1),
            dropped: header.dropped,
        }
    }

    /// Returns the header of a new frame.
    pub const fn stamp(&mut self, time_us: u64) -> Header {
        let header = Header {
            boot_id: self.boot_id,
            sequence: self.next,
            time_us,
            dropped: self.dropped,
        };
        self.next = self.next.wrapping_add(1);
        header
    }

    /// Counts the last stamped frame as dropped.
    pub const fn count_dropped(&mut self) {
        self.dropped = self.dropped.wrapping_add(1);
    }

    /// Addresses the following commands to another boot id; the numbers of the frames continue.
    pub const fn address(&mut self, boot_id: u32) {
        self.boot_id = boot_id;
    }
}
