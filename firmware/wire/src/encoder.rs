//! From messages to bytes.

use core::fmt;

use crate::checksum::crc32;
use crate::frame::{CHECKSUM, Header};
use crate::message::Message;
use crate::validation::Invalid;
use crate::value::{Place, Value, Visitor};
use crate::{Record, VERSION};
use heapless::Vec;

/// The buffer cannot hold the frame. [`Message::MAX_FRAME`] bytes hold any.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
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

/// Encodes a frame and returns the part of the buffer that it fills. It takes one pass over the
/// message and no memory besides.
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

/// Encodes a frame into a vector of its own.
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

/// Returns the length of the frame; nothing if the buffer is too small.
fn fill<M: Message>(header: &Header, message: &M, buffer: &mut [u8]) -> Option<usize> {
    // What `stuff` relies on.
    const { assert!(M::MAX_FRAME <= LONGEST_RUN) };
    let mut to = Plain { buffer, end: 1 };
    to.put(VERSION);
    to.put(message.kind());
    header.show(&Place::WHOLE, &mut to);
    message.show(&mut to);
    let Plain { buffer, end } = to;
    let checksum = crc32(buffer.get(1..end)?);
    let checked = end + CHECKSUM;
    buffer
        .get_mut(end..checked)?
        .copy_from_slice(&checksum.to_le_bytes());
    *buffer.get_mut(checked)? = 0;
    stuff(buffer.get_mut(..checked)?);
    Some(checked + 1)
}

/// The longest run of bytes without a zero that COBS counts in one byte, and a byte: as long as a
/// frame is no longer, no byte has to be put between others.
const LONGEST_RUN: usize = 254;

/// COBS in place: the first byte and every zero become the distance to the next zero, the last of
/// which follows the frame. Byte by byte, with room made for runs that no frame has, it took four
/// times as long.
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

/// Writes the bytes as they are, behind the place of the first distance.
///
/// What has no room is left out and found at the end.
struct Plain<'buffer> {
    buffer: &'buffer mut [u8],
    /// Where they would end, had they room.
    end: usize,
}

impl Plain<'_> {
    #[inline(never)]
    fn put(&mut self, byte: u8) {
        if let Some(place) = self.buffer.get_mut(self.end) {
            *place = byte;
        }
        self.end += 1;
    }

    /// A few bytes, for which copying memory in general would take longer than they themselves.
    fn put_all<const N: usize>(&mut self, bytes: [u8; N]) {
        let rest = self.buffer.get_mut(self.end..).unwrap_or_default();
        if let Some(places) = rest.first_chunk_mut() {
            *places = bytes;
        }
        self.end += N;
    }
}

impl Visitor for Plain<'_> {
    fn byte(&mut self, value: u8, _: &'static Place) {
        self.put(value);
    }

    fn integer(&mut self, value: u64, _: &'static Place) {
        let mut rest = value;
        while rest > 0x7F {
            self.put(rest as u8 | 0x80);
            rest >>= 7;
        }
        self.put(rest as u8);
    }

    fn float(&mut self, value: f32, _: &'static Place) {
        self.put_all(value.to_le_bytes());
    }

    fn double(&mut self, value: f64, _: &'static Place) {
        self.put_all(value.to_le_bytes());
    }

    fn code(&mut self, number: u8, _: bool, _: &'static Place) {
        self.put(number);
    }

    fn flag(&mut self, value: bool) {
        self.put(value.into());
    }

    fn length(&mut self, length: usize) {
        // The compiler has seen to it that every list's length fits one byte.
        self.put(length as u8);
    }

    fn text(&mut self, bytes: &[u8]) {
        for &byte in bytes {
            self.put(byte);
        }
    }

    fn item(&mut self, _: Option<usize>) {}

    fn rule(&mut self, _: &dyn Fn() -> Result<(), Invalid>) {}
}

/// Writes what a message holds, without frame and header, and returns how long it is; what has no
/// room in the buffer is left out.
pub(crate) fn write_payload<M: Message>(message: &M, buffer: &mut [u8]) -> usize {
    let mut to = Plain { buffer, end: 0 };
    message.show(&mut to);
    to.end
}

/// Numbers the frames of one sender.
///
/// Every frame that is produced is stamped, and every stamped frame that is not sent is counted
/// as dropped, so that the receiver's account is exact. When there is no room, drop the newest
/// frame and not one that waits, whose successors already carry their count.
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
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Sequencer {
    boot_id: u32,
    next: u32,
    dropped: u32,
}

impl Sequencer {
    /// Starts from frame 0. A device gives its boot id, a PC that of the device it speaks to.
    pub const fn new(boot_id: u32) -> Self {
        Self {
            boot_id,
            next: 0,
            dropped: 0,
        }
    }

    /// Header of a new frame.
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

    /// Counts the frame stamped last as dropped.
    pub const fn count_dropped(&mut self) {
        self.dropped = self.dropped.wrapping_add(1);
    }

    /// Addresses the following commands to another boot; the numbers go on.
    pub const fn address(&mut self, boot_id: u32) {
        self.boot_id = boot_id;
    }
}
