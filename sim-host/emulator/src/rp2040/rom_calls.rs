//! Running functions of the boot ROM, and their required order of calls (RP2040 datasheet 2.8.3).

use std::collections::VecDeque;

use crate::board::flash::{FlashOperationKind, PAGE};
use crate::rp2040::rom::RomFunction;

/// Number of bits of a write-enable command, and of a command with its address after it.
const COMMAND_BITS: u64 = 8 + 32;
/// Cycles of `flash_exit_xip`: twice 2048 rounds of three cycles until pulls have settled, and ten
/// bytes at six cycles a bit (the boot ROM's source, `program_flash_generic.c`).
pub(crate) const EXIT_XIP_CYCLES: u64 = 2 * 2048 * 3 + 10 * 8 * 6;

/// A queued operation.
#[derive(Clone, Debug)]
pub(crate) struct Step {
    pub(crate) kind: FlashOperationKind,
    pub(crate) address: u32,
    pub(crate) page: Box<[u8; PAGE]>,
}

impl Step {
    /// An erase step.
    pub(crate) fn erase(kind: FlashOperationKind, address: u32) -> Self {
        Self {
            kind,
            address,
            page: Box::new([0; PAGE]),
        }
    }

    /// A program step.
    pub(crate) const fn program(address: u32, page: Box<[u8; PAGE]>) -> Self {
        Self {
            kind: FlashOperationKind::ProgramPage,
            address,
            page,
        }
    }

    /// Number of bits that are sent before the flash starts the operation.
    pub(crate) const fn bits(&self) -> u64 {
        match self.kind {
            FlashOperationKind::ProgramPage => COMMAND_BITS + 8 * PAGE as u64,
            _ => COMMAND_BITS,
        }
    }
}

/// The running function.
#[derive(Clone, Debug)]
pub(crate) struct Running {
    pub(crate) function: RomFunction,
    pub(crate) steps: VecDeque<Step>,
    /// End of the present transmission or wait; `None` while the flash is busy.
    pub(crate) due_ps: Option<u64>,
}

/// The private register block of the ROM's functions.
#[derive(Clone, Debug, Default)]
pub(crate) struct RomCalls {
    pub(crate) arguments: [u32; 4],
    pub(crate) running: Option<Running>,
    /// Whether `connect_internal_flash` was called, and no `flash_flush_cache` since.
    pub(crate) is_connected: bool,
    /// Interfaces that the boot loader is started without.
    pub(crate) usb_boot: Option<u32>,
}

impl RomCalls {
    /// Time at which the running function continues.
    pub(crate) fn next_event(&self) -> Option<u64> {
        self.running.as_ref().and_then(|running| running.due_ps)
    }
}

/// Operations of `flash_range_erase`: blocks where they fit, sectors elsewhere.
pub(crate) fn erase_steps(
    mut address: u32,
    count: u32,
    block: Option<FlashOperationKind>,
) -> VecDeque<Step> {
    let end = address.saturating_add(count);
    let mut steps = VecDeque::new();
    while address < end {
        let fits = |kind: &FlashOperationKind| {
            address.is_multiple_of(kind.bytes()) && end - address >= kind.bytes()
        };
        let kind = block
            .filter(fits)
            .unwrap_or(FlashOperationKind::EraseSector);
        steps.push_back(Step::erase(kind, address));
        address += kind.bytes();
    }
    steps
}
