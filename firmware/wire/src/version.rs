//! Versions of the protocol.

use crate::checksum::digest;
use crate::message::Message;
use crate::schema::{Described, absorb_byte, absorb_kinds};
use crate::{Command, Header, Record};

/// Major version of the protocol: the first byte of every frame.
///
/// It rises with every change that an older decoder would misread: a field added, removed, moved,
/// renamed, or given another type or unit; a number given another meaning; a change of the frame. A
/// decoder refuses a frame of another major version. The parts needed to detect this never change: COBS,
/// the zero byte at the end, the CRC-32 over all before it, and the first byte.
pub const VERSION: u8 = 2;

/// Minor version of the protocol, sent in [`Hello`](crate::record::Hello).
///
/// It rises when a kind of record or command, or a number of an enumeration, is added, and restarts from
/// 0 with a new major version. An older decoder counts an unknown kind with its header, and reads an
/// unknown number as `Unknown`.
pub const MINOR_VERSION: u8 = 8;

/// Hash of the layout of all frames, sent in [`Hello`](crate::record::Hello).
///
/// It is the CRC-32 over all names, types, units and numbers of the [`schema`](crate::schema). It
/// detects two builds of the same version with different layouts.
pub const SCHEMA_HASH: u32 = schema_hash();

const fn schema_hash() -> u32 {
    let mut digest = absorb_byte(absorb_byte(digest(), VERSION), MINOR_VERSION);
    digest = Header::TYPE.absorbed_by(digest);
    digest = absorb_kinds(digest, Record::KINDS);
    absorb_kinds(digest, Command::KINDS).finalize()
}
