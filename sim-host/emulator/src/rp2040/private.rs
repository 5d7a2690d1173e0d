//! The core's private peripherals: system control block, interrupt controller and event register
//! (ARMv6-M architecture, B3).

use rp2040_emu::bus::ppb::Ppb;
use rp2040_emu::core::Nvic;

use crate::rp2040::interrupts::Interrupts;

/// Private peripherals of each core.
#[derive(Clone)]
pub(crate) struct Private {
    pub(crate) ppb: Ppb,
    pub(crate) interrupts: Interrupts,
    /// Unused interrupt controller of `rp2040_emu`, which its bus trait requires; [`Interrupts`]
    /// replaces it.
    pub(crate) idle: Nvic,
    /// Event register, set by SEV and cleared by WFE.
    pub(crate) event: bool,
    /// Whether the core waits in WFE.
    pub(crate) parked: bool,
}

impl Private {
    pub(crate) fn new() -> Self {
        Self {
            ppb: Ppb::new(),
            interrupts: Interrupts::default(),
            idle: Nvic::new(),
            event: false,
            parked: false,
        }
    }

    /// Sets the levels of the interrupt lines.
    pub(crate) fn drive(&mut self, lines: u32) {
        self.interrupts.drive(lines, self.ppb.active);
    }

    /// Takes the exception to enter now, and clears its pending state.
    pub(crate) fn take(&mut self) -> Option<u32> {
        self.interrupts.take(self.ppb.active)
    }

    /// Reads a register by its offset from 0xE0000000.
    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        let priority = |handler: usize| u32::from(self.ppb.shpr[handler]);
        Some(match offset {
            0xED00 => 0x410C_C601,
            0xED04 => (63 - self.ppb.active.leading_zeros()).min(63) & 0x3F,
            0xED08 => self.ppb.vtor,
            0xED0C => 0xFA05_0000,
            0xED10 | 0xED24 => 0,
            0xED14 => 0x208,
            0xED1C => priority(7) << 24,
            0xED20 => priority(10) << 16 | priority(11) << 24,
            _ => self.interrupts.read(offset.checked_sub(0xE000)?)?,
        })
    }

    pub(crate) fn write(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0xED08 => self.ppb.vtor = value & 0xFFFF_FF00,
            0xED1C => self.ppb.shpr[7] = (value >> 24) as u8 & 0xC0,
            0xED20 => {
                self.ppb.shpr[10] = (value >> 16) as u8 & 0xC0;
                self.ppb.shpr[11] = (value >> 24) as u8 & 0xC0;
            }
            // SLEEPONEXIT, SLEEPDEEP and SEVONPEND must stay off.
            0xED10 if value == 0 => {}
            _ => self.interrupts.write(offset.checked_sub(0xE000)?, value)?,
        }
        Some(())
    }
}
