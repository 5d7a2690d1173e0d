//! Common parts of all frames.

use crate::schema::Described;

structure! {
    /// Header before every payload, after the bytes for version and kind.
    pub struct Header {
        /// In a record: a random number that the device drew when it started, never 0. In a command: the
        /// boot id of the device to which it is addressed, or 0 for any.
        boot_id: u32,
        /// Number of the frame, counted when it is produced, sent or not: from 0 for records, from any
        /// number for commands. Wraps to 0 after 4294967295.
        sequence: u32,
        /// Time of the reported event, by the sender's clock, since the sender's start.
        time_us: u64 ["us"],
        /// Number of frames that the sender has dropped since its start, of those with a lower sequence
        /// number. Wraps to 0 after 4294967295.
        dropped: u32 ["1"],
    }
}

impl Copy for Header {}

impl Eq for Header {}

impl Header {
    /// Boot id of a command that is addressed to any boot of a device.
    pub const ANY_BOOT: u32 = 0;
}

/// A message with its header.
#[derive(Clone, Debug, PartialEq, serde::Serialize, serde::Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Frame<M> {
    /// Header of the frame.
    pub header: Header,
    /// The message.
    pub message: M,
}

/// Number of bytes that version and kind take at the start of a frame.
pub(crate) const PREFIX: usize = 2;

/// Number of bytes that the CRC-32 takes at the end of a frame.
pub(crate) const CHECKSUM: usize = 4;

/// Maximum number of bytes before the payload: version, kind and header.
pub const MAX_HEADER: usize = PREFIX + Header::TYPE.max_size();

/// Returns the largest frame size for a payload size: header, payload and CRC-32, the overhead of COBS,
/// and the zero at the end.
///
/// ```
/// use palpate_wire::{Command, Message, Record};
/// assert!(Record::MAX_FRAME <= 254 && Command::MAX_FRAME <= 254);
/// ```
pub const fn frame_size(payload: usize) -> usize {
    let body = MAX_HEADER + payload + CHECKSUM;
    // COBS adds a byte at the start and one after every 254 bytes without a zero.
    body + 1 + body / 254 + 1
}
