//! UF2 files for the tests, written from the specification; they share no code with the reader.

/// The boot ROM's checksum of the first 252 bytes below, as the SDK computes it (pico-sdk,
/// `pad_checksum`): reverse the bits of each byte, take Python's `zlib.crc32`, invert it, and
/// reverse its 32 bits.
const CHECKSUM: u32 = 0x16A7_D4C0;

/// Firmware of a size, whose first 256 bytes end with their checksum.
pub(super) fn firmware(size: usize) -> Vec<u8> {
    let mut bytes: Vec<u8> = (0..size).map(|index| (index % 251) as u8).collect();
    bytes[252..256].copy_from_slice(&CHECKSUM.to_le_bytes());
    bytes
}

/// A UF2 file for the RP2040 with these bytes at an address.
pub(super) fn uf2(address: u32, bytes: &[u8]) -> Vec<u8> {
    let pages: Vec<&[u8]> = bytes.chunks(256).collect();
    let mut file = Vec::new();
    for (number, page) in (0u32..).zip(&pages) {
        file.extend(b"UF2\n");
        for word in [
            0x9E5D_5157,
            0x0000_2000,
            address + number * 256,
            256,
            number,
            pages.len() as u32,
            0xE48B_FF56,
        ] {
            file.extend(u32::to_le_bytes(word));
        }
        let mut data = page.to_vec();
        data.resize(476, 0);
        file.extend(data);
        file.extend([0x30, 0x6F, 0xB1, 0x0A]);
    }
    file
}
