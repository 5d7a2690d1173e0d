//! The firmware image: the ELF file that is flashed.

pub mod firmware;
pub(crate) mod profile;
pub(crate) mod rtt;
pub(crate) mod sources;
pub(crate) mod uf2;

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;
use std::io::Read as _;
use std::path::Path;
use std::sync::Arc;

use crate::board::flash::{SECTOR, SIZE as FLASH_SIZE};
use object::read::elf::{ElfFile32, ProgramHeader};
use object::{Endianness, Object, ObjectSection, ObjectSymbol};

/// Start address of the flash.
pub(crate) const FLASH: u32 = 0x1000_0000;
/// Address of the vector table, after the second-stage loader.
pub(crate) const VECTORS: u32 = FLASH + 0x100;

/// A firmware image, loaded into flash.
#[derive(Clone, Debug)]
pub struct Image {
    pub(crate) flash: Arc<[u8]>,
    symbols: Arc<BTreeMap<String, u32>>,
    sections: Arc<BTreeMap<String, u32>>,
    /// Sectors of the flash that contain part of the image.
    sectors: Arc<BTreeSet<u32>>,
    end: u32,
}

/// Reason why a file is not an image for this board.
#[derive(Debug)]
pub enum ImageError {
    /// The file cannot be read.
    File(std::io::Error),
    /// The file is not a valid ELF file.
    Format(object::Error),
    /// A segment is outside of the flash.
    Misplaced {
        /// Physical address of the segment.
        address: u32,
    },
    /// There is no vector table after the second-stage loader.
    NoVectors,
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File(error) => write!(f, "the image cannot be read: {error}"),
            Self::Format(error) => write!(f, "the image is no ELF file of this kind: {error}"),
            Self::Misplaced { address } => {
                write!(
                    f,
                    "a segment of the image lies at {address:#010x}, not in flash"
                )
            }
            Self::NoVectors => write!(f, "the image has no vector table at {VECTORS:#010x}"),
        }
    }
}

impl std::error::Error for ImageError {}

impl Image {
    /// Flash without a program, for tests of the board's blocks.
    #[cfg(test)]
    pub(crate) fn empty() -> Self {
        Self {
            flash: Arc::from(vec![0xFF; FLASH_SIZE]),
            symbols: Arc::default(),
            sections: Arc::default(),
            sectors: Arc::default(),
            end: FLASH,
        }
    }

    /// A program of these half-words, after a second stage that does nothing, and followed by
    /// `fill`, for tests of the board's blocks.
    #[cfg(test)]
    pub(crate) fn of_code(code: &[u16], fill: u8) -> Self {
        let mut flash = vec![0xFF; FLASH_SIZE];
        flash[..252].fill(0);
        let checksum = crate::rp2040::bus::flash::checksum(&flash[..252]);
        flash[252..256].copy_from_slice(&checksum.to_le_bytes());
        flash[0x100..0x104].copy_from_slice(&0x2004_0000_u32.to_le_bytes());
        flash[0x104..0x108].copy_from_slice(&(FLASH + 0x201).to_le_bytes());
        flash[0x200..SECTOR].fill(fill);
        for (place, word) in flash[0x200..].chunks_mut(2).zip(code) {
            place.copy_from_slice(&word.to_le_bytes());
        }
        Self {
            flash: flash.into(),
            sectors: Arc::new(BTreeSet::from([0])),
            end: FLASH + SECTOR as u32,
            ..Self::empty()
        }
    }

    /// Reads an ELF file of at most a gigabyte: a device file may never end.
    ///
    /// # Errors
    /// [`ImageError`].
    pub fn load(path: &Path) -> Result<Self, ImageError> {
        let mut bytes = Vec::new();
        let file = std::fs::File::open(path);
        file.and_then(|file| file.take(1_000_000_000).read_to_end(&mut bytes))
            .map_err(ImageError::File)?;
        Self::parse(&bytes)
    }

    /// Loads the bytes of an ELF file: its segments go to their physical addresses, as a flash
    /// tool would write them.
    ///
    /// # Errors
    /// [`ImageError`].
    pub fn parse(bytes: &[u8]) -> Result<Self, ImageError> {
        let elf = ElfFile32::<Endianness>::parse(bytes).map_err(ImageError::Format)?;
        let mut flash = vec![0xFF; FLASH_SIZE];
        let mut end = FLASH;
        let mut sectors = BTreeSet::new();
        for header in elf.elf_program_headers() {
            let data = header
                .data(elf.endian(), bytes)
                .map_err(|()| ImageError::NoVectors)?;
            if header.p_type(elf.endian()) != object::elf::PT_LOAD || data.is_empty() {
                continue;
            }
            let address = header.p_paddr(elf.endian());
            let misplaced = ImageError::Misplaced { address };
            let offset = address.checked_sub(FLASH).ok_or(misplaced)? as usize;
            flash
                .get_mut(offset..offset + data.len())
                .ok_or(ImageError::Misplaced { address })?
                .copy_from_slice(data);
            end = end.max(address + data.len() as u32);
            sectors.extend(offset / SECTOR..(offset + data.len()).div_ceil(SECTOR));
        }
        let symbols = elf
            .symbols()
            .filter_map(|symbol| Some((symbol.name().ok()?.to_owned(), symbol.address() as u32)))
            .collect();
        let sections = elf
            .sections()
            .filter_map(|section| Some((section.name().ok()?.to_owned(), section.size() as u32)))
            .collect();
        let image = Self {
            flash: flash.into(),
            symbols: Arc::new(symbols),
            sections: Arc::new(sections),
            sectors: Arc::new(sectors.iter().map(|&sector| sector as u32).collect()),
            end,
        };
        if image.word(VECTORS + 4) & 0xF000_0001 != 0x1000_0001 {
            return Err(ImageError::NoVectors);
        }
        Ok(image)
    }

    /// The image as a UF2 for the boot loader's drive: every sector that contains part of the
    /// image, as a whole, and no other sector.
    #[must_use]
    pub fn to_uf2(&self) -> Vec<u8> {
        let sector_of = |&sector: &u32| {
            let offset = sector as usize * SECTOR;
            let bytes = self.flash.get(offset..offset + SECTOR)?;
            Some((FLASH + offset as u32, bytes))
        };
        uf2::write(self.sectors.iter().filter_map(sector_of))
    }

    /// Bytes of flash from its start to the end of the image.
    #[must_use]
    pub fn flash_bytes(&self) -> u32 {
        self.end - FLASH
    }

    /// Bytes of memory for variables and buffers, without stack and code.
    #[must_use]
    pub fn static_bytes(&self) -> u32 {
        [".data", ".bss", ".uninit"]
            .map(|name| self.section(name))
            .iter()
            .sum()
    }

    /// Bytes of code that are copied to memory at the start.
    #[must_use]
    pub fn code_in_memory_bytes(&self) -> u32 {
        self.section(".hot")
    }

    fn section(&self, name: &str) -> u32 {
        self.sections.get(name).copied().unwrap_or_default()
    }

    /// Address of a symbol.
    #[must_use]
    pub fn symbol(&self, name: &str) -> Option<u32> {
        self.symbols.get(name).copied()
    }

    pub(crate) fn word(&self, address: u32) -> u32 {
        let offset = (address - FLASH) as usize;
        self.flash
            .get(offset..offset + 4)
            .and_then(|bytes| bytes.try_into().ok())
            .map_or(0, u32::from_le_bytes)
    }
}
