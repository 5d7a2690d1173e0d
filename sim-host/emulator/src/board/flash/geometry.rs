//! Sizes of the flash and of its parts.

/// Bytes of the chip (datasheet, general description).
pub(crate) const SIZE: usize = 2 * 1024 * 1024;

/// Bytes of the smallest erasable unit (datasheet, command 20h).
pub(crate) const SECTOR: usize = 4 * 1024;

/// Most bytes that one command programs (datasheet, command 02h).
pub(crate) const PAGE: usize = 256;
