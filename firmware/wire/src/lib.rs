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
mod field;
mod frame;
mod message;
mod validation;
mod version;

pub use checksum::crc32;
pub use command::{Command, CommandDecoder};
pub use configuration::{ConfigurationCrc, configuration_crc};
pub use decoder::{Counts, Decoder, FrameError, PayloadError};
pub use encoder::{BufferTooSmall, Sequencer, encode, encode_vec};
pub use frame::{Frame, Header, MAX_HEADER, frame_size};
pub use message::Message;
pub use record::{Record, RecordDecoder};
pub use validation::{Invalid, InvalidField, Problem};
pub use version::{MINOR_VERSION, SCHEMA_HASH, VERSION};
