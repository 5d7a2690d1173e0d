//! Decoding: bytes to messages.

use core::fmt;
use core::marker::PhantomData;

use cobs::{DecodeResult, DecoderState};
use heapless::Vec;
use serde::Deserialize;

use crate::VERSION;
use crate::checksum::crc32;
use crate::frame::{CHECKSUM, Frame, Header};
use crate::message::Message;
use crate::message::sealed::Reader;

/// Decodes a stream of bytes, in pieces of any size.
///
/// A zero byte ends every frame and occurs nowhere else, so the decoder resynchronises at the first zero
/// after any disturbance. It buffers `N` bytes and never more than one frame. Use it as
/// [`RecordDecoder`](crate::RecordDecoder) or [`CommandDecoder`](crate::CommandDecoder).
///
/// ```
/// use palpate_wire::{Command, CommandDecoder, Header, Message, encode};
/// let header = Header { boot_id: 7, sequence: 1, time_us: 0, dropped: 0 };
/// let mut buffer = [0; Command::MAX_FRAME];
/// let bytes = encode(&header, &Command::Arm, &mut buffer)?;
///
/// let mut decoder = CommandDecoder::new();
/// let garbage = [0x17, 0x00];
/// let mut results = garbage.iter().chain(bytes).filter_map(|&byte| decoder.push(byte));
/// assert!(results.next().is_some_and(|garbage| garbage.is_err()));
/// assert_eq!(results.next().unwrap().unwrap().message, Command::Arm);
/// assert!(results.next().is_none());
/// assert_eq!((decoder.counts().frames, decoder.counts().damaged()), (1, 1));
/// # Ok::<(), palpate_wire::BufferTooSmall>(())
/// ```
#[derive(Debug)]
pub struct Decoder<M, const N: usize> {
    stuffing: DecoderState,
    body: Vec<u8, N>,
    /// The frame has more than `N` bytes.
    overflown: bool,
    counts: Counts,
    message: PhantomData<fn() -> M>,
}

/// Numbers of frames by result, each frame counted once. A counter wraps to 0 after 4294967295.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize)]
pub struct Counts {
    /// Decoded frames.
    pub frames: u32,
    /// Frames that end in the middle of a COBS block.
    pub stuffing: u32,
    /// Frames longer than the maximum.
    pub too_long: u32,
    /// Frames shorter than the minimum.
    pub too_short: u32,
    /// Frames with a wrong CRC-32.
    pub checksum: u32,
    /// Frames of another major version.
    pub version: u32,
    /// Frames with a correct CRC-32 and an unreadable header.
    pub header: u32,
    /// Frames of a kind that this version or direction does not have.
    pub unknown_kind: u32,
    /// Frames with a correct CRC-32 and an unreadable payload.
    pub payload: u32,
}

impl Counts {
    /// Returns the number of frames that were changed or cut in transit, or were not frames.
    pub const fn damaged(&self) -> u32 {
        self.stuffing
            .wrapping_add(self.too_long)
            .wrapping_add(self.too_short)
            .wrapping_add(self.checksum)
    }

    /// Returns the number of frames that arrived unchanged but could not be decoded.
    pub const fn not_understood(&self) -> u32 {
        self.version
            .wrapping_add(self.header)
            .wrapping_add(self.unknown_kind)
            .wrapping_add(self.payload)
    }

    const fn count<M>(&mut self, result: &Result<Frame<M>, FrameError>) {
        let counter = match result {
            Ok(_) => &mut self.frames,
            Err(FrameError::Stuffing) => &mut self.stuffing,
            Err(FrameError::TooLong) => &mut self.too_long,
            Err(FrameError::TooShort) => &mut self.too_short,
            Err(FrameError::Checksum) => &mut self.checksum,
            Err(FrameError::Version { .. }) => &mut self.version,
            Err(FrameError::Header) => &mut self.header,
            Err(FrameError::UnknownKind { .. }) => &mut self.unknown_kind,
            Err(FrameError::Payload { .. }) => &mut self.payload,
        };
        *counter = counter.wrapping_add(1);
    }
}

/// Error of the bytes up to a zero.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameError {
    /// The zero came in the middle of a COBS block: bytes were lost, or reception began within a frame.
    Stuffing,
    /// More bytes than the longest frame: the zero between two frames was lost.
    TooLong,
    /// Fewer bytes than the shortest frame.
    TooShort,
    /// The CRC-32 is wrong.
    Checksum,
    /// The frame is of another major version of the protocol.
    Version {
        /// Major version of the frame.
        found: u8,
    },
    /// The header is unreadable: the sender is defective.
    Header,
    /// The kind is unknown: the sender has a later minor version, or the frame is of the other
    /// direction.
    UnknownKind {
        /// Header of the frame.
        header: Header,
        /// Kind of the message.
        kind: u8,
    },
    /// The payload is unreadable: the sender was built from other sources, or is defective.
    Payload {
        /// Header of the frame.
        header: Header,
        /// Kind of the message.
        kind: u8,
        /// Error of the payload.
        cause: PayloadError,
    },
}

/// Error of a payload.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PayloadError {
    /// A field has bytes that its type does not allow, or the payload ends early.
    Malformed,
    /// The payload has excess bytes.
    Excess {
        /// Number of excess bytes.
        bytes: usize,
    },
}

impl FrameError {
    /// Returns the header of a frame that arrived but was not decoded; such a frame counts as received.
    pub const fn header(&self) -> Option<&Header> {
        match self {
            Self::UnknownKind { header, .. } | Self::Payload { header, .. } => Some(header),
            _ => None,
        }
    }
}

impl fmt::Display for FrameError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stuffing => f.write_str("frame ends within a COBS block"),
            Self::TooLong => f.write_str("frame is too long"),
            Self::TooShort => f.write_str("frame is too short"),
            Self::Checksum => f.write_str("CRC-32 of the frame is wrong"),
            Self::Version { found } => write!(
                f,
                "frame is of protocol version {found}, this program speaks version {VERSION}"
            ),
            Self::Header => f.write_str("header cannot be read"),
            Self::UnknownKind { kind, header } => {
                write!(
                    f,
                    "frame {} is of unknown kind 0x{kind:02x}",
                    header.sequence
                )
            }
            Self::Payload {
                header,
                kind,
                cause,
            } => {
                let sequence = header.sequence;
                write!(f, "payload of frame {sequence}, kind 0x{kind:02x}, ")?;
                match cause {
                    PayloadError::Malformed => f.write_str("cannot be read"),
                    PayloadError::Excess { bytes } => write!(f, "has {bytes} bytes too many"),
                }
            }
        }
    }
}

impl core::error::Error for FrameError {}

impl<M: Message, const N: usize> Decoder<M, N> {
    /// Creates a decoder that has received nothing.
    pub const fn new() -> Self {
        Self {
            stuffing: DecoderState::Idle,
            body: Vec::new(),
            overflown: false,
            counts: Counts {
                frames: 0,
                stuffing: 0,
                too_long: 0,
                too_short: 0,
                checksum: 0,
                version: 0,
                header: 0,
                unknown_kind: 0,
                payload: 0,
            },
            message: PhantomData,
        }
    }

    /// Takes a byte; returns a frame at the zero that ends it.
    pub fn push(&mut self, byte: u8) -> Option<Result<Frame<M>, FrameError>> {
        let ended = match self.stuffing.feed(byte) {
            Ok(DecodeResult::NoData) => return None,
            Ok(DecodeResult::DataContinue(byte)) => {
                self.overflown |= self.body.push(byte).is_err();
                return None;
            }
            Ok(DecodeResult::DataComplete) => Ok(()),
            Err(_) => Err(FrameError::Stuffing),
        };
        let result = if self.overflown {
            Err(FrameError::TooLong)
        } else {
            ended.and_then(|()| parse(&self.body))
        };
        self.body.clear();
        self.overflown = false;
        self.counts.count(&result);
        Some(result)
    }

    /// Takes bytes and returns the frames that end within them, one by one. The decoder takes bytes only
    /// while the iterator is consumed: consume it to its end.
    pub fn frames<'a>(
        &'a mut self,
        bytes: &'a [u8],
    ) -> impl Iterator<Item = Result<Frame<M>, FrameError>> + 'a {
        bytes.iter().filter_map(|&byte| self.push(byte))
    }

    /// Returns the counts so far.
    pub const fn counts(&self) -> &Counts {
        &self.counts
    }
}

impl<M: Message, const N: usize> Default for Decoder<M, N> {
    fn default() -> Self {
        Self::new()
    }
}

/// Decodes a frame after COBS.
fn parse<M: Message>(body: &[u8]) -> Result<Frame<M>, FrameError> {
    let Some((content, checksum)) = body.split_last_chunk::<CHECKSUM>() else {
        return Err(FrameError::TooShort);
    };
    if crc32(content) != u32::from_le_bytes(*checksum) {
        return Err(FrameError::Checksum);
    }
    let [version, rest @ ..] = content else {
        return Err(FrameError::TooShort);
    };
    if *version != VERSION {
        return Err(FrameError::Version { found: *version });
    }
    let [kind, rest @ ..] = rest else {
        return Err(FrameError::TooShort);
    };
    let kind = *kind;
    let mut from = Reader::from_bytes(rest);
    let header = Header::deserialize(&mut from).map_err(|_| FrameError::Header)?;
    let payload_error = |cause| FrameError::Payload {
        header,
        kind,
        cause,
    };
    let message = M::read(kind, &mut from).ok_or(FrameError::UnknownKind { header, kind })?;
    let message = message.map_err(|_| payload_error(PayloadError::Malformed))?;
    let excess = from.finalize().map_or(0, <[u8]>::len);
    if excess > 0 {
        return Err(payload_error(PayloadError::Excess { bytes: excess }));
    }
    Ok(Frame { header, message })
}
