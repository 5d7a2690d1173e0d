//! Flash memory of the native board: a NOR flash in memory.

use core::cell::RefCell;
use core::fmt;
use std::rc::Rc;

use embedded_storage_async::nor_flash::{
    ErrorType, NorFlash, NorFlashError, NorFlashErrorKind, ReadNorFlash,
};

/// Bytes of a sector, the smallest erasable unit (W25Q16JV datasheet, 8.2.15, Sector Erase).
const SECTOR: usize = 4096;
/// Number of sectors in the area for settings and calibration, as on the device.
const SECTORS: usize = 16;

/// The area for settings and calibration: a write clears bits, an erase sets all bits of a sector.
///
/// A clone shares the memory. Operations take no virtual time.
#[derive(Clone)]
pub struct Flash(Rc<RefCell<Vec<u8>>>);

/// An address or a length that is not aligned, or is beyond the end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FlashError(NorFlashErrorKind);

impl Default for Flash {
    fn default() -> Self {
        Self::new()
    }
}

impl fmt::Debug for Flash {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Flash").finish_non_exhaustive()
    }
}

impl Flash {
    /// An erased flash.
    #[must_use]
    pub fn new() -> Self {
        Self(Rc::new(RefCell::new(vec![u8::MAX; SECTORS * SECTOR])))
    }

    /// Calls `look` with the bytes, to read them or to change them in ways that a flash does not
    /// allow.
    pub fn with_bytes<T>(&self, look: impl FnOnce(&mut [u8]) -> T) -> T {
        look(&mut self.0.borrow_mut())
    }

    /// Runs an operation on a range that is aligned to `unit` bytes.
    fn within<T>(
        &self,
        from: u32,
        length: usize,
        unit: usize,
        work: impl FnOnce(&mut [u8]) -> T,
    ) -> Result<T, FlashError> {
        let from = from as usize;
        if !from.is_multiple_of(unit) || !length.is_multiple_of(unit) {
            return Err(FlashError(NorFlashErrorKind::NotAligned));
        }
        self.with_bytes(|bytes| {
            let range = bytes.get_mut(from..from.saturating_add(length));
            let beyond = FlashError(NorFlashErrorKind::OutOfBounds);
            range.map(work).ok_or(beyond)
        })
    }
}

impl fmt::Display for FlashError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "the flash has no such place: {:?}", self.0)
    }
}

impl core::error::Error for FlashError {}

impl NorFlashError for FlashError {
    fn kind(&self) -> NorFlashErrorKind {
        self.0
    }
}

impl ErrorType for Flash {
    type Error = FlashError;
}

impl ReadNorFlash for Flash {
    const READ_SIZE: usize = 1;

    async fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), FlashError> {
        let length = bytes.len();
        self.within(offset, length, Self::READ_SIZE, |source| {
            bytes.copy_from_slice(source);
        })
    }

    fn capacity(&self) -> usize {
        SECTORS * SECTOR
    }
}

impl NorFlash for Flash {
    /// Equal to the write size of the device's flash driver.
    const WRITE_SIZE: usize = 4;
    const ERASE_SIZE: usize = SECTOR;

    async fn erase(&mut self, from: u32, to: u32) -> Result<(), FlashError> {
        let length = to.saturating_sub(from) as usize;
        self.within(from, length, SECTOR, |bytes| bytes.fill(u8::MAX))
    }

    async fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), FlashError> {
        self.within(offset, bytes.len(), Self::WRITE_SIZE, |to| {
            for (to, byte) in to.iter_mut().zip(bytes) {
                *to &= byte;
            }
        })
    }
}
