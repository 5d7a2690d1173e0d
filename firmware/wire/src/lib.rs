#![no_std]
#![forbid(unsafe_code)]
#![doc = include_str!("../README.md")]

#[macro_use]
mod macros;

pub mod code;
pub mod command;
pub mod loss;
pub mod record;
pub mod schema;

mod check;
mod checksum;
mod configuration;
mod decoder;
mod encoder;
mod frame;
mod message;
mod validation;

pub use checksum::crc32;
pub use command::{Command, CommandDecoder};
pub use configuration::{ConfigurationCrc, configuration_crc};
pub use decoder::{Counts, Decoder, FrameError, PayloadError};
pub use encoder::{BufferTooSmall, Sequencer, encode, encode_vec};
pub use frame::{Frame, Header, MAX_HEADER, frame_size};
pub use message::Message;
pub use record::{Record, RecordDecoder};
pub use validation::{Invalid, InvalidField, Problem};

/// Major version of the protocol: the first byte of every frame.
///
/// It rises with every change that an older decoder would misread: a field added, removed, moved,
/// renamed, or given another type or unit; a number given another meaning; a change of the frame.
/// A decoder refuses a frame of another major version. What never changes is what it takes to find
/// that out: COBS, the zero byte at the end, the CRC-32 over all before it, and the first byte.
pub const VERSION: u8 = 2;

/// Minor version of the protocol, sent in [`Hello`](record::Hello).
///
/// It rises when a kind of record or command is added, or a number to an enumeration, and starts
/// from 0 with a new major version. An older decoder counts a kind that it does not know, with its
/// header, and reads a number that it does not know as `Unknown`.
pub const MINOR_VERSION: u8 = 5;

/// Number of the layout of all frames, sent in [`Hello`](record::Hello).
///
/// CRC-32 over the names, types, units and numbers of everything in the [`schema`], so that two
/// builds that claim the same version and differ nevertheless are found out.
pub const SCHEMA_HASH: u32 = schema::hash();
