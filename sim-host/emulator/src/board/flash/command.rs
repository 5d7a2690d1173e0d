//! The flash's commands, byte by byte while it is selected (datasheet, instructions).

use super::transfer::{ADDRESSED, Transfer};
use super::{Flash, FlashOperationKind};

const PAGE_PROGRAM: u8 = 0x02;
const READ_DATA: u8 = 0x03;
const WRITE_DISABLE: u8 = 0x04;
const READ_STATUS_1: u8 = 0x05;
const WRITE_ENABLE: u8 = 0x06;
const FAST_READ: u8 = 0x0B;
const SECTOR_ERASE: u8 = 0x20;
const READ_STATUS_2: u8 = 0x35;
const READ_UNIQUE_ID: u8 = 0x4B;
const BLOCK_ERASE_32: u8 = 0x52;
const READ_JEDEC_ID: u8 = 0x9F;
const BLOCK_ERASE_64: u8 = 0xD8;
/// A byte of all ones. It ends continuous read; otherwise it is not a command.
const NOTHING: u8 = 0xFF;

/// Answer to command 9Fh: manufacturer, memory type and capacity (datasheet).
const JEDEC_ID: [u8; 3] = [0xEF, 0x40, 0x15];
/// Bits of status register 1: an operation runs; writing is enabled (datasheet, status registers).
const BUSY: u8 = 1 << 0;
const WRITE_ENABLED: u8 = 1 << 1;
/// Value of status register 2: quad enabled, the factory setting of a Pico's part (datasheet,
/// status registers).
const STATUS_2: u8 = 1 << 1;

impl FlashOperationKind {
    /// Operation that a command starts; `None` for other commands.
    pub(crate) const fn of(command: u8) -> Option<Self> {
        match command {
            PAGE_PROGRAM => Some(Self::ProgramPage),
            SECTOR_ERASE => Some(Self::EraseSector),
            BLOCK_ERASE_32 => Some(Self::EraseBlock32),
            BLOCK_ERASE_64 => Some(Self::EraseBlock64),
            _ => None,
        }
    }
}

impl Flash {
    /// Chip select falls.
    pub(crate) fn select(&mut self) {
        self.transfer.get_or_insert_default();
    }

    /// Receives a byte and returns the byte sent at the same time; `None` for a command that is not
    /// modelled, 0xFF if the flash is not selected.
    pub(crate) fn exchange(&mut self, byte: u8) -> Option<u8> {
        let Some(transfer) = &mut self.transfer else {
            return Some(NOTHING);
        };
        let index = transfer.bytes.len();
        let answer = match transfer.bytes.first() {
            None => is_known(byte).then_some(NOTHING),
            Some(_) => Some(self.answer(index)),
        };
        if let Some(transfer) = &mut self.transfer {
            transfer.bytes.push(byte);
        }
        answer
    }

    /// Byte that is sent while byte `index` is received, which is at least 1.
    fn answer(&self, index: usize) -> u8 {
        let transfer = self.transfer.as_ref();
        let Some(command) = transfer.and_then(Transfer::command) else {
            return NOTHING;
        };
        match command {
            READ_STATUS_1 => self.status(),
            READ_STATUS_2 => STATUS_2,
            // The flash ignores everything else while an operation runs (datasheet, BUSY).
            _ if self.is_busy() => NOTHING,
            READ_JEDEC_ID => byte_from(&JEDEC_ID, index, 1),
            // Four dummy bytes before the identifier (datasheet, command 4Bh).
            READ_UNIQUE_ID => byte_from(&self.unique_id, index, 5),
            READ_DATA => self.read_data(index, ADDRESSED),
            // One dummy byte before the data (datasheet, command 0Bh).
            FAST_READ => self.read_data(index, ADDRESSED + 1),
            _ => NOTHING,
        }
    }

    const fn status(&self) -> u8 {
        let busy = if self.is_busy() { BUSY } else { 0 };
        let enabled = if self.write_enabled { WRITE_ENABLED } else { 0 };
        busy | enabled
    }

    fn read_data(&self, index: usize, first: usize) -> u8 {
        let address = self.transfer.as_ref().and_then(Transfer::address);
        match (address, index.checked_sub(first)) {
            (Some(address), Some(offset)) => self.byte(address.wrapping_add(offset as u32)),
            _ => NOTHING,
        }
    }

    /// Chip select rises: starts the command if it changes the flash or its state.
    pub(crate) fn deselect(&mut self, now_ps: u64) {
        let Some(transfer) = self.transfer.take() else {
            return;
        };
        match transfer.command() {
            Some(WRITE_ENABLE) => self.enable_write(),
            Some(WRITE_DISABLE) => self.write_enabled = false,
            Some(command) => self.begin_command(command, &transfer, now_ps),
            None => {}
        }
    }

    fn begin_command(&mut self, command: u8, transfer: &Transfer, now_ps: u64) {
        let (Some(kind), Some(address)) = (FlashOperationKind::of(command), transfer.address())
        else {
            return;
        };
        let has_data = transfer.bytes.len() > ADDRESSED;
        // An erase ends with its address, and a program needs at least one data byte.
        if has_data == (kind == FlashOperationKind::ProgramPage) {
            self.begin(kind, address, transfer.page(address), now_ps);
        }
    }
}

const fn is_known(command: u8) -> bool {
    matches!(
        command,
        PAGE_PROGRAM
            | READ_DATA
            | WRITE_DISABLE
            | READ_STATUS_1
            | WRITE_ENABLE
            | FAST_READ
            | SECTOR_ERASE
            | READ_STATUS_2
            | READ_UNIQUE_ID
            | BLOCK_ERASE_32
            | READ_JEDEC_ID
            | BLOCK_ERASE_64
            | NOTHING
    )
}

/// Byte `index` of an answer that starts at byte `first`.
fn byte_from(answer: &[u8], index: usize, first: usize) -> u8 {
    let place = index.checked_sub(first);
    place
        .and_then(|place| answer.get(place))
        .copied()
        .unwrap_or(NOTHING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::board::flash::FlashTimes;

    fn flash() -> Flash {
        let contents: Vec<u8> = (0..=255).collect();
        Flash::new(&contents, FlashTimes::Typical, 1)
    }

    /// Sends bytes while the flash is selected, and returns the received bytes.
    fn exchange(flash: &mut Flash, bytes: &[u8]) -> Vec<u8> {
        flash.select();
        let answer = bytes.iter().map(|&byte| flash.exchange(byte).unwrap());
        let answer = answer.collect();
        flash.deselect(0);
        answer
    }

    #[test]
    fn the_status_shows_enabling_and_work_and_other_commands_wait() {
        let mut flash = flash();
        let status = |flash: &mut Flash| exchange(flash, &[0x05, 0])[1];
        assert_eq!(status(&mut flash), 0);
        exchange(&mut flash, &[0x06]);
        assert_eq!(status(&mut flash), 0b10);
        exchange(&mut flash, &[0x04]);
        assert_eq!(status(&mut flash), 0);
        exchange(&mut flash, &[0x06]);
        exchange(&mut flash, &[0x20, 0, 0, 0]);
        assert_eq!(status(&mut flash), 0b11);
        assert_eq!(exchange(&mut flash, &[0x03, 0, 0, 0x10, 0])[4], NOTHING);
        flash.service(45_000_000_000);
        assert_eq!(status(&mut flash), 0);
    }

    #[test]
    fn an_erase_with_data_and_a_program_without_are_not_begun() {
        let mut flash = flash();
        for bytes in [&[0x20, 0, 0, 0, 0][..], &[0x02, 0, 0, 0], &[0xD8, 0, 0]] {
            exchange(&mut flash, &[0x06]);
            exchange(&mut flash, bytes);
            assert!(!flash.is_busy(), "{bytes:02X?}");
        }
    }

    #[test]
    fn an_unknown_command_is_not_guessed_at() {
        let mut flash = flash();
        flash.select();
        assert_eq!(flash.exchange(0xC7), None);
    }
}
