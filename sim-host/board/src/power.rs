//! RESETS, PSM and the cause of the last reset (RP2040 datasheet 2.12 to 2.14).

/// Blocks in RESETS, by bit (2.14.1).
pub(crate) mod block {
    pub(crate) const ADC: u32 = 1 << 0;
    pub(crate) const DMA: u32 = 1 << 2;
    pub(crate) const I2C0: u32 = 1 << 3;
    pub(crate) const IO_BANK0: u32 = 1 << 5;
    pub(crate) const PADS_BANK0: u32 = 1 << 8;
    pub(crate) const PLL_SYS: u32 = 1 << 12;
    pub(crate) const PLL_USB: u32 = 1 << 13;
    pub(crate) const PWM: u32 = 1 << 14;
    pub(crate) const TIMER: u32 = 1 << 21;
    pub(crate) const ALL: u32 = 0x01FF_FFFF;
    /// What the boot ROM needs to read the flash.
    pub(crate) const FLASH: u32 = 1 << 6 | 1 << 9;
}

/// PSM.WDSEL: all but the oscillators, as the SDK sets it before it trusts the watchdog.
const EVERYTHING: u32 = 0x1_FFFC;
const POWER_ON: u32 = 1 << 8;

/// What is in reset, and why the chip started.
#[derive(Clone, Debug)]
pub(crate) struct Power {
    pub(crate) in_reset: u32,
    watchdog_resets: u32,
    watchdog_restarts: u32,
    cause: u32,
}

impl Power {
    /// As the boot ROM hands over: all in reset but the way to the flash.
    pub(crate) const fn new() -> Self {
        Self {
            in_reset: block::ALL & !block::FLASH,
            watchdog_resets: 0,
            watchdog_restarts: 0,
            cause: POWER_ON,
        }
    }

    /// After the watchdog: CHIP_RESET keeps its flags.
    pub(crate) fn after_watchdog(&mut self) {
        *self = Self {
            cause: self.cause,
            ..Self::new()
        };
    }

    /// Whether the watchdog resets everything that it can.
    pub(crate) fn watchdog_resets_all(&self) -> bool {
        self.watchdog_restarts & EVERYTHING == EVERYTHING
    }

    pub(crate) fn read_resets(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x0 => self.in_reset,
            0x4 => self.watchdog_resets,
            0x8 => !self.in_reset & block::ALL,
            _ => return None,
        })
    }

    pub(crate) fn write_resets(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x0 => self.in_reset = value & block::ALL,
            0x4 => self.watchdog_resets = value & block::ALL,
            _ => return None,
        }
        Some(())
    }

    pub(crate) fn read_sequence(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x8 => self.watchdog_restarts,
            0xC => 0x1_FFFF,
            _ => return None,
        })
    }

    pub(crate) fn write_sequence(&mut self, offset: u32, value: u32) -> Option<()> {
        (offset == 0x8).then(|| self.watchdog_restarts = value & 0x1_FFFF)
    }

    pub(crate) fn read_regulator(&self, offset: u32) -> Option<u32> {
        (offset == 0x8).then_some(self.cause)
    }
}
