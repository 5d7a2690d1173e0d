//! UF2 files as the boot ROM of an RP2040 accepts them (the UF2 specification,
//! github.com/microsoft/uf2; RP2040 datasheet 2.8.4.2), with the additional rules for this board.

use std::ops::Range;

/// Size of a block, bytes.
const BLOCK: usize = 512;
/// Payload of a block, bytes: a page of the flash.
const PAYLOAD: u32 = 256;
const FIRST_MAGIC: u32 = 0x0A32_4655;
const SECOND_MAGIC: u32 = 0x9E5D_5157;
const LAST_MAGIC: u32 = 0x0AB1_6F30;
/// Offsets of a block's last word and of its data.
const LAST_WORD: usize = 508;
const DATA: usize = 32;
/// The only allowed flag, which every block must have: the block names a family.
const HAS_FAMILY: u32 = 0x2000;
const RP2040: u32 = 0xE48B_FF56;
/// Families of boards that are mistaken for a Pico (the UF2 specification's list, `uf2families.json`).
const OTHERS: &[(u32, &str)] = &[
    (0xE48B_FF57, "any RP2350"),
    (0xE48B_FF58, "any RP2350"),
    (0xE48B_FF59, "the RP2350"),
    (0xE48B_FF5A, "the RP2350 (RISC-V)"),
    (0xE48B_FF5B, "the RP2350"),
];
/// Addresses of firmware: the flash of 2 MiB without the storage.
const FIRMWARE: Range<u32> = 0x1000_0000..0x101F_0000;
/// Addresses of settings and calibration (docs/decisions/0071-what-runs-from-flash.md).
const STORAGE: Range<u32> = 0x101F_0000..0x1020_0000;
/// Size of the second stage of the boot loader, bytes; its last four bytes are its checksum
/// (datasheet 2.8.1.3.1).
const SECOND_STAGE: usize = 256;
const CHECKSUM: usize = 252;

/// A file that is suitable for the board.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Uf2 {
    bytes: Vec<u8>,
    /// Number of flash bytes.
    pub(super) size: u32,
}

impl Uf2 {
    /// Checks a file. Returns the reason if it is not suitable for the board.
    ///
    /// The boot ROM checks much less: it writes blocks of its family to any address, skips others,
    /// and erases a sector with every sixteenth block.
    pub(super) fn check(bytes: Vec<u8>) -> Result<Self, String> {
        let blocks = bytes.chunks_exact(BLOCK);
        if bytes.is_empty() || !blocks.remainder().is_empty() {
            return Err(format!(
                "it has {} bytes, and a UF2 file has a multiple of {BLOCK}",
                bytes.len()
            ));
        }
        let count = u32::try_from(blocks.len()).map_err(|_| "it is too long".to_owned())?;
        for (number, block) in (0..count).zip(blocks) {
            check_block(block, number, count).map_err(|why| format!("block {number}: {why}"))?;
        }
        let second_stage = bytes.get(DATA..DATA + SECOND_STAGE).unwrap_or_default();
        if word(second_stage, CHECKSUM) != Some(checksum(second_stage)) {
            return Err(
                "its first 256 bytes have a wrong checksum, so that the board would not start"
                    .to_owned(),
            );
        }
        Ok(Self {
            bytes,
            size: count * PAYLOAD,
        })
    }

    /// Contents of the flash from its start.
    pub(super) fn firmware(&self) -> Vec<u8> {
        let blocks = self.bytes.chunks_exact(BLOCK);
        let pages = blocks.filter_map(|block| block.get(DATA..DATA + PAYLOAD as usize));
        pages.flatten().copied().collect()
    }

    /// Bytes of the file.
    pub(super) fn bytes(&self) -> &[u8] {
        &self.bytes
    }
}

fn check_block(block: &[u8], number: u32, count: u32) -> Result<(), String> {
    let word = |offset| word(block, offset).unwrap_or_default();
    let magic = [word(0), word(4), word(LAST_WORD)];
    if magic != [FIRST_MAGIC, SECOND_MAGIC, LAST_MAGIC] {
        return Err("its magic numbers are not those of a UF2 file".to_owned());
    }
    if word(8) != HAS_FAMILY {
        return Err(format!(
            "its flags are {:#x}, and not {HAS_FAMILY:#x}",
            word(8)
        ));
    }
    if word(28) != RP2040 {
        return Err(format!(
            "it is for {}, and not for the RP2040",
            family(word(28))
        ));
    }
    if (word(20), word(24)) != (number, count) {
        let [number, of] = [word(20), word(24)];
        return Err(format!(
            "it says that it is number {number} of {of}, and the file has {count} blocks: it is not whole, \
             or several files in one"
        ));
    }
    if word(16) != PAYLOAD {
        return Err(format!("it carries {} bytes, and not {PAYLOAD}", word(16)));
    }
    check_address(word(12), number)
}

fn check_address(address: u32, number: u32) -> Result<(), String> {
    if !FIRMWARE.contains(&address) {
        let why = if STORAGE.contains(&address) {
            "where settings and calibration are kept"
        } else {
            "which is not in the flash"
        };
        return Err(format!("its address is {address:#010x}, {why}"));
    }
    let expected = FIRMWARE.start + number * PAYLOAD;
    if address != expected {
        return Err(format!(
            "its address is {address:#010x}, where {expected:#010x} is next: the boot ROM erases the \
             right sectors only for a file without gaps from the start of the flash (RP2040-E14)"
        ));
    }
    Ok(())
}

fn family(number: u32) -> String {
    let known = OTHERS.iter().find(|(of, _)| *of == number);
    known.map_or_else(
        || format!("the family {number:#010x}"),
        |(_, name)| (*name).to_owned(),
    )
}

fn word(bytes: &[u8], offset: usize) -> Option<u32> {
    let bytes = bytes.get(offset..offset + 4)?;
    bytes.try_into().ok().map(u32::from_le_bytes)
}

/// The boot ROM's checksum of the second stage: CRC-32/MPEG-2 without the checksum itself.
fn checksum(second_stage: &[u8]) -> u32 {
    const POLYNOMIAL: u32 = 0x04C1_1DB7;
    second_stage.iter().take(CHECKSUM).fold(!0, |crc, byte| {
        (0..8).fold(crc ^ u32::from(*byte) << 24, |crc, _| {
            let shifted = crc << 1;
            if crc >> 31 == 1 {
                shifted ^ POLYNOMIAL
            } else {
                shifted
            }
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    use crate::commands::flash::sample::{firmware, uf2};

    fn why(bytes: Vec<u8>) -> String {
        Uf2::check(bytes).unwrap_err()
    }

    /// A file with one word of a block replaced.
    fn with(block: usize, offset: usize, value: u32) -> Vec<u8> {
        let mut file = uf2(0x1000_0000, &firmware(10_000));
        let at = block * 512 + offset;
        file[at..at + 4].copy_from_slice(&value.to_le_bytes());
        file
    }

    #[test]
    fn a_file_from_the_start_of_the_flash_is_accepted_up_to_the_settings() {
        let flash = firmware(10_240);
        let file = Uf2::check(uf2(0x1000_0000, &flash)).unwrap();
        assert_eq!(file.size, 10_240);
        assert_eq!(file.firmware(), flash);
        let room = 2 * 1024 * 1024 - 64 * 1024;
        assert!(Uf2::check(uf2(0x1000_0000, &firmware(room))).is_ok());
        let beyond = why(uf2(0x1000_0000, &firmware(room + 1)));
        assert!(beyond.contains("settings and calibration"), "{beyond}");
    }

    #[test]
    fn a_file_for_another_chip_is_refused_by_its_name() {
        assert!(why(with(3, 28, 0xE48B_FF59)).contains("for the RP2350"));
        assert!(why(with(3, 28, 0x68ED_2B88)).contains("0x68ed2b88"));
    }

    #[test]
    fn each_word_that_is_not_as_the_boot_rom_needs_it_is_refused() {
        for offset in [0, 4, 508] {
            assert!(why(with(2, offset, 0)).contains("block 2: its magic numbers"));
        }
        assert!(why(with(2, 8, 0x2001)).contains("flags are 0x2001"));
        assert!(why(with(2, 12, 0x2000_0000)).contains("not in the flash"));
        assert!(why(with(2, 12, 0x1000_0400)).contains("0x10000200 is next"));
        assert!(why(with(2, 16, 476)).contains("476 bytes"));
    }

    #[test]
    fn a_file_that_is_cut_off_or_another_format_is_refused() {
        let file = uf2(0x1000_0000, &firmware(10_000));
        assert!(why(file[..file.len() - 512].to_vec()).contains("not whole"));
        assert!(why(file[..1000].to_vec()).contains("a multiple of 512"));
        assert!(why(Vec::new()).contains("0 bytes"));
        assert!(why(vec![0x7F; 1024]).contains("block 0"));
    }

    #[test]
    fn firmware_that_would_not_start_is_refused() {
        let mut bare = firmware(10_000);
        bare[7] ^= 1;
        assert!(why(uf2(0x1000_0000, &bare)).contains("would not start"));
        let elsewhere = why(uf2(0x1000_1000, &firmware(10_000)));
        assert!(elsewhere.contains("0x10000000 is next"), "{elsewhere}");
    }
}
