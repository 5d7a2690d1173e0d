//! The boot ROM's loader, which presents the board as a drive (RP2040 datasheet 2.8.4).

use std::collections::VecDeque;
use std::fmt;

use crate::board::flash::{FlashOperationKind, SECTOR, SIZE};
use crate::board::plant::Plant;
use crate::image::FLASH;
use crate::image::uf2::{self, Download, Uf2Block};
use crate::rp2040::rom::RomFunction;
use crate::rp2040::rom_calls::Step;
use crate::stop::Stop;

use super::EmulatedBoard;

/// Bit of the disabled interfaces that disables the drive (2.8.3.1.5).
const NO_DRIVE: u32 = 1;
/// Delay from the last block of a complete UF2 to the reset (the boot ROM's source,
/// `virtual_disk.c`), ms.
const REBOOT_MS: u32 = 1_000;

/// State of the board in the boot loader.
#[derive(Clone, Debug)]
pub(super) struct BootLoader {
    pub(super) disabled_interfaces: u32,
    download: Download,
}

impl BootLoader {
    pub(super) fn new(disabled_interfaces: u32) -> Self {
        Self {
            disabled_interfaces,
            download: Download::default(),
        }
    }
}

/// Reason why a UF2 was not written completely.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Uf2Error {
    /// The board runs its firmware; it must enter the boot loader first.
    NotInBootLoader,
    /// The drive was disabled when the boot loader was started.
    NoDrive,
    /// A block's target is outside of the 2 MiB of flash.
    Misplaced {
        /// Target address.
        address: u32,
    },
    /// The power failed; the board has restarted with the present content of its flash.
    PowerFailed,
    /// The emulation stopped.
    Stopped(Stop),
}

impl fmt::Display for Uf2Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotInBootLoader => {
                f.write_str("the board is not in its boot loader: let it enter that first")
            }
            Self::NoDrive => {
                f.write_str("the boot loader was started without its drive: start it with it")
            }
            Self::Misplaced { address } => write!(
                f,
                "a block of the UF2 belongs to {address:#010x}, which is not in the flash: build \
                 it for the RP2040"
            ),
            Self::PowerFailed => {
                f.write_str("the power failed while the UF2 was written: write it again")
            }
            Self::Stopped(stop) => stop.fmt(f),
        }
    }
}

impl std::error::Error for Uf2Error {}

impl<P: Plant> EmulatedBoard<P> {
    /// Whether the board is in the boot ROM's loader, which runs none of the firmware and leaves
    /// all pins as after a reset.
    #[must_use]
    pub const fn is_in_boot_loader(&self) -> bool {
        self.boot_loader.is_some()
    }

    /// Writes a UF2 as the boot loader's drive does, block by block, in the time that the flash
    /// needs; the transfer time on the bus is left out. Blocks for other chips are skipped. As in
    /// the boot ROM, the first block that arrives out of each sixteen consecutive block numbers
    /// erases its sector; this is correct for files of whole sectors, such as those of
    /// [`crate::Image::to_uf2`]. After the last block of a file the board restarts from the flash;
    /// until then it stays in the boot loader.
    ///
    /// # Errors
    /// [`Uf2Error`].
    pub fn write_uf2(&mut self, bytes: &[u8]) -> Result<(), Uf2Error> {
        let loader = self.boot_loader.as_ref().ok_or(Uf2Error::NotInBootLoader)?;
        if loader.disabled_interfaces & NO_DRIVE != 0 {
            return Err(Uf2Error::NoDrive);
        }
        for block in bytes.chunks(uf2::BLOCK).filter_map(Uf2Block::parse) {
            self.write_block(block)?;
        }
        let is_whole = |loader: &BootLoader| loader.download.is_whole();
        if self.boot_loader.as_ref().is_some_and(is_whole) {
            self.bus.reboot_by_watchdog(REBOOT_MS);
            self.run_while(Self::is_in_boot_loader)?;
        }
        Ok(())
    }

    fn write_block(&mut self, block: Uf2Block) -> Result<(), Uf2Error> {
        let address = block.address;
        let offset = address
            .checked_sub(FLASH)
            .filter(|offset| (*offset as usize) < SIZE)
            .ok_or(Uf2Error::Misplaced { address })?;
        let download = self.boot_loader.as_mut().map(|loader| &mut loader.download);
        let Some(write) = download.and_then(|download| download.take(&block)) else {
            return Ok(());
        };
        let mut steps = VecDeque::new();
        if write.erases {
            let sector = offset & !(SECTOR as u32 - 1);
            steps.push_back(Step::erase(FlashOperationKind::EraseSector, sector));
        }
        steps.push_back(Step::program(offset, block.payload));
        self.bus.ssi_for_boot_loader();
        self.bus.run(RomFunction::FlashRangeProgram, steps);
        self.finish_writing()
    }

    /// Advances time until the flash has finished its operation.
    fn finish_writing(&mut self) -> Result<(), Uf2Error> {
        let restarts = self.resets;
        self.bus.service();
        self.run_while(|board| board.bus.rom_calls.running.is_some())?;
        if self.resets == restarts {
            Ok(())
        } else {
            Err(Uf2Error::PowerFailed)
        }
    }

    fn run_while(&mut self, goes_on: impl Fn(&Self) -> bool) -> Result<(), Uf2Error> {
        while goes_on(self) {
            self.step(u64::MAX);
            self.goes_on().map_err(Uf2Error::Stopped)?;
        }
        Ok(())
    }
}
