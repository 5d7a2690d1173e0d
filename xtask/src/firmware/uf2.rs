//! UF2: the file format that a Raspberry Pi Pico accepts (github.com/microsoft/uf2, "UF2 format").

use std::collections::BTreeMap;

use anyhow::{Context, Result, bail};
use object::Endianness;
use object::read::elf::{ElfFile32, ProgramHeader};

const START: [u32; 2] = [0x0A32_4655, 0x9E5D_5157];
const END: u32 = 0x0AB1_6F30;
const FAMILY_PRESENT: u32 = 0x2000;
/// Family ID of the RP2040.
const FAMILY: u32 = 0xE48B_FF56;
/// Bytes of a block, and of its payload: one page of the flash.
const BLOCK: usize = 512;
const PAGE: u32 = 256;
const FLASH: core::ops::Range<u32> = 0x1000_0000..0x1020_0000;

/// Converts an ELF file to UF2: its segments at their physical addresses, page by page.
pub(super) fn convert(elf: &[u8]) -> Result<Vec<u8>> {
    let pages = pages(elf)?;
    let count = u32::try_from(pages.len())?;
    let mut file = Vec::with_capacity(pages.len() * BLOCK);
    for (number, (address, page)) in (0..).zip(&pages) {
        let [first, second] = START;
        let header = [
            first,
            second,
            FAMILY_PRESENT,
            *address,
            PAGE,
            number,
            count,
            FAMILY,
        ];
        let begin = file.len();
        file.extend(header.iter().flat_map(|word| word.to_le_bytes()));
        file.extend(page);
        file.resize(begin + BLOCK - 4, 0);
        file.extend(END.to_le_bytes());
    }
    Ok(file)
}

type Page = [u8; PAGE as usize];

fn pages(bytes: &[u8]) -> Result<BTreeMap<u32, Page>> {
    let elf = ElfFile32::<Endianness>::parse(bytes).context("the image is no ELF file")?;
    let endian = elf.endian();
    let mut pages = BTreeMap::new();
    for header in elf.elf_program_headers() {
        let data = match header.data(endian, bytes) {
            Ok(data) if header.p_type(endian) == object::elf::PT_LOAD => data,
            Ok(_) => continue,
            Err(()) => bail!("a segment lies beyond the end of the file"),
        };
        for (address, byte) in (header.p_paddr(endian)..).zip(data) {
            if !FLASH.contains(&address) {
                bail!("a segment lies at {address:#010x}, not in flash");
            }
            let page = pages
                .entry(address & !(PAGE - 1))
                .or_insert([0xFF; PAGE as usize]);
            if let Some(place) = page.get_mut((address % PAGE) as usize) {
                *place = *byte;
            }
        }
    }
    fill_gaps(&mut pages);
    Ok(pages)
}

/// Adds the empty pages between the first and the last one: the boot ROM may skip a sector that is
/// only partly written, unless it is the last (erratum RP2040-E14).
fn fill_gaps(pages: &mut BTreeMap<u32, Page>) {
    let ends = pages.first_key_value().zip(pages.last_key_value());
    let Some(((&first, _), (&last, _))) = ends else {
        return;
    };
    for address in (first..last).step_by(PAGE as usize) {
        pages.entry(address).or_insert([0xFF; PAGE as usize]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_sector_but_the_last_is_written_in_part() {
        let page = |address: u32| (address, [0_u8; PAGE as usize]);
        let mut pages = BTreeMap::from([0x1000_0000, 0x1000_1300].map(page));
        fill_gaps(&mut pages);
        let found: Vec<_> = pages.keys().copied().collect();
        let expected: Vec<_> = (0x1000_0000..=0x1000_1300).step_by(0x100).collect();
        assert_eq!(found, expected);
    }

    #[test]
    fn what_is_no_elf_file_is_refused() {
        assert!(convert(b"no image").is_err());
    }
}
