//! NOR flash in memory: a write clears bits, an erase sets those of a sector, and the power can fail in
//! the middle of either.

use embedded_storage_async::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use embedded_storage_async::nor_flash::{NorFlashError, NorFlashErrorKind};

/// Size of a sector in bytes, as in the W25Q16JV (datasheet, Sector Erase, 20h).
pub(crate) const SECTOR: usize = 4096;

/// Number of sectors of the area.
pub(crate) const SECTORS: usize = 16;

/// Size of the area in bytes.
pub(crate) const AREA: usize = SECTORS * SECTOR;

/// Error of a flash operation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Failure {
    /// The power is off.
    PowerCut,
    /// Not aligned to the flash's units, or beyond its end.
    Misaligned,
    /// More operations than any call may take.
    Endless,
}

impl NorFlashError for Failure {
    fn kind(&self) -> NorFlashErrorKind {
        NorFlashErrorKind::Other
    }
}

/// Remainder of an operation after a power cut.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Remnant {
    /// Nothing was changed.
    Nothing,
    /// All was changed.
    All,
    /// The first bytes were changed.
    Beginning,
    /// Each bit was changed or not.
    Bits,
    /// For an erase: all bits are 0, since a chip programs them before it erases. For a write: each bit
    /// was changed or not, nearly all of them.
    Programmed,
}

impl Remnant {
    pub(crate) const EVERY: [Self; 5] = [
        Self::Nothing,
        Self::All,
        Self::Beginning,
        Self::Bits,
        Self::Programmed,
    ];
}

/// Numbers of flash operations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Counts {
    pub(crate) reads: u64,
    pub(crate) bytes_read: u64,
    pub(crate) writes: u64,
    pub(crate) erases: u64,
}

/// Flash, written in words of `WORD` bytes.
#[derive(Clone)]
pub(crate) struct Flash<const WORD: usize = 4> {
    pub(crate) bytes: Vec<u8>,
    pub(crate) counts: Counts,
    /// Number of erases of each sector.
    pub(crate) wear: [u32; SECTORS],
    /// Number of writes and erases until the power fails, and what the interrupted operation leaves.
    cut: Option<(u64, Remnant)>,
    is_off: bool,
    /// Addresses of worn bytes, of which one bit is lost.
    pub(crate) worn: std::ops::Range<usize>,
    /// Number of operations after which the flash fails with [`Failure::Endless`].
    pub(crate) patience: u64,
    random: u64,
}

impl<const WORD: usize> Flash<WORD> {
    pub(crate) fn new() -> Self {
        Self::holding(vec![u8::MAX; AREA])
    }

    pub(crate) fn holding(bytes: Vec<u8>) -> Self {
        Self {
            bytes,
            counts: Counts::default(),
            wear: [0; SECTORS],
            cut: None,
            is_off: false,
            worn: 0..0,
            patience: u64::MAX,
            random: 1,
        }
    }

    /// Makes the power fail in the next write or erase after `after` others.
    pub(crate) fn cut_after(&mut self, after: u64, remnant: Remnant) {
        self.cut = Some((after, remnant));
        self.random = after + 1;
    }

    /// Switches the power on again. Returns `false` if it never failed.
    pub(crate) fn power_on(&mut self) -> bool {
        self.cut = None;
        std::mem::take(&mut self.is_off)
    }

    /// Returns the numbers of operations since the last call.
    pub(crate) fn take_counts(&mut self) -> Counts {
        std::mem::take(&mut self.counts)
    }

    /// Splitmix64 (Steele, Lea, Flood, OOPSLA 2014).
    pub(crate) fn random(&mut self) -> u64 {
        self.random = self.random.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.random;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    fn step(&mut self) -> Result<(), Failure> {
        if self.is_off {
            return Err(Failure::PowerCut);
        }
        self.patience = self.patience.checked_sub(1).ok_or(Failure::Endless)?;
        Ok(())
    }

    /// Changes bytes until the power fails.
    fn change(&mut self, from: usize, to: &[u8]) -> Result<(), Failure> {
        let remnant = match &mut self.cut {
            None => Remnant::All,
            Some((0, remnant)) => {
                self.is_off = true;
                *remnant
            }
            Some((after, _)) => {
                *after -= 1;
                Remnant::All
            }
        };
        let beginning = match remnant {
            Remnant::Beginning => self.random() as usize % to.len(),
            _ => 0,
        };
        let is_erase = to.len() == SECTOR;
        for (index, new) in to.iter().enumerate() {
            let changed = match remnant {
                Remnant::Nothing => 0,
                Remnant::All => u8::MAX,
                Remnant::Beginning if index < beginning => u8::MAX,
                Remnant::Beginning => 0,
                Remnant::Bits => self.random() as u8,
                Remnant::Programmed if is_erase => {
                    self.bytes[from + index] = 0;
                    0
                }
                Remnant::Programmed => (self.random() | self.random() | self.random()) as u8,
            };
            let byte = &mut self.bytes[from + index];
            *byte = (*byte & !changed) | (new & changed);
            if self.worn.contains(&(from + index)) {
                *byte &= 0x7F;
            }
        }
        if self.is_off {
            return Err(Failure::PowerCut);
        }
        Ok(())
    }
}

impl<const WORD: usize> ErrorType for Flash<WORD> {
    type Error = Failure;
}

impl<const WORD: usize> ReadNorFlash for Flash<WORD> {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), Failure> {
        self.step()?;
        let from = offset as usize;
        let source = self.bytes.get(from..from + bytes.len());
        bytes.copy_from_slice(source.ok_or(Failure::Misaligned)?);
        self.counts.reads += 1;
        self.counts.bytes_read += bytes.len() as u64;
        Ok(())
    }

    fn capacity(&self) -> usize {
        self.bytes.len()
    }
}

impl<const WORD: usize> NorFlash for Flash<WORD> {
    const WRITE_SIZE: usize = WORD;
    const ERASE_SIZE: usize = SECTOR;

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Failure> {
        self.step()?;
        let from = offset as usize;
        let is_aligned = from.is_multiple_of(WORD) && bytes.len().is_multiple_of(WORD);
        if !is_aligned || from + bytes.len() > self.bytes.len() {
            return Err(Failure::Misaligned);
        }
        self.counts.writes += 1;
        // A write only clears bits.
        let old = &self.bytes[from..from + bytes.len()];
        let to: Vec<u8> = old.iter().zip(bytes).map(|(old, new)| old & new).collect();
        self.change(from, &to)
    }

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), Failure> {
        for sector in (from as usize..to as usize).step_by(SECTOR) {
            self.step()?;
            if !sector.is_multiple_of(SECTOR) || sector + SECTOR > self.bytes.len() {
                return Err(Failure::Misaligned);
            }
            self.counts.erases += 1;
            self.wear[sector / SECTOR] += 1;
            self.change(sector, &[u8::MAX; SECTOR])?;
        }
        Ok(())
    }
}
