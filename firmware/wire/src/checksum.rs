//! The CRC-32 at the end of every frame.
//!
//! It is CRC-32/ISCSI, also called CRC-32C (Castagnoli). In data of up to 5,243 bits, and so in every
//! frame here, it detects each error of up to five bits; the CRC-32 of Ethernet and zlib does so only in
//! up to 268 bits (P. Koopman, *32-bit cyclic redundancy codes for Internet applications*, DSN 2002). A
//! test shows it for the length of the longest frame.

use crc::{CRC_32_ISCSI, Crc, Table};

/// A CRC that is being computed.
pub(crate) type Digest = crc::Digest<'static, u32, Table<1>>;

/// CRC-32/ISCSI with its table of 1 KiB, which exists only once, in this static.
static CRC: Crc<u32> = Crc::<u32>::new(&CRC_32_ISCSI);

/// Starts a CRC.
pub(crate) const fn digest() -> Digest {
    CRC.digest()
}

/// Returns the CRC-32/ISCSI of some bytes, as at the end of a frame.
///
/// ```
/// // The published check value.
/// assert_eq!(palpate_wire::crc32(b"123456789"), 0xE306_9283);
/// ```
pub const fn crc32(bytes: &[u8]) -> u32 {
    CRC.checksum(bytes)
}
