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
/// renamed, or given another type or unit; a number given another meaning; a change of the frame. A
/// decoder refuses a frame of another major version. The parts needed to detect this never change: COBS,
/// the zero byte at the end, the CRC-32 over all before it, and the first byte.
pub const VERSION: u8 = 2;

/// Minor version of the protocol, sent in [`Hello`](record::Hello).
///
/// It rises when a kind of record or command, or a number of an enumeration, is added, and restarts from
/// 0 with a new major version. An older decoder counts an unknown kind with its header, and reads an
/// unknown number as `Unknown`.
pub const MINOR_VERSION: u8 = 5;

/// Hash of the layout of all frames, sent in [`Hello`](record::Hello).
///
/// CRC-32 over all names, types, units and numbers of the [`schema`]. It detects two builds of the same
/// version with different layouts.
pub const SCHEMA_HASH: u32 = schema::hash();
