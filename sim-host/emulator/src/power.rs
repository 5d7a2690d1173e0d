//! RESETS, PSM, the core voltage and the cause of the last reset (RP2040 datasheet 2.10 to 2.14).

use crate::bus::base;

/// Blocks in RESETS, by bit (2.14.1).
pub(crate) mod block {
    pub(crate) const ADC: u32 = 1 << 0;
    pub(crate) const DMA: u32 = 1 << 2;
    pub(crate) const I2C0: u32 = 1 << 3;
    pub(crate) const IO_BANK0: u32 = 1 << 5;
    pub(crate) const IO_QSPI: u32 = 1 << 6;
    pub(crate) const PADS_BANK0: u32 = 1 << 8;
    pub(crate) const PADS_QSPI: u32 = 1 << 9;
    pub(crate) const PLL_SYS: u32 = 1 << 12;
    pub(crate) const PLL_USB: u32 = 1 << 13;
    pub(crate) const PWM: u32 = 1 << 14;
    pub(crate) const TIMER: u32 = 1 << 21;
    pub(crate) const USB: u32 = 1 << 24;
    pub(crate) const ALL: u32 = 0x01FF_FFFF;
    /// What the boot ROM needs to read the flash.
    pub(crate) const FLASH: u32 = IO_QSPI | PADS_QSPI;
}

/// PSM.WDSEL: all but the oscillators, as the SDK sets it before it trusts the watchdog.
const EVERYTHING: u32 = 0x1_FFFC;
const POWER_ON: u32 = 1 << 8;

/// VREG: enabled at 1.10 V, as after power on (2.10.6).
const VOLTAGE_AT_START: u32 = 0xB1;
const REGULATOR_ENABLED: u32 = 1;
const REGULATES: u32 = 1 << 12;
/// VSEL of 1.15 V: least for more than 133 MHz. Steps are 50 mV.
const RAISED: u32 = 0xC;
/// VSEL of 1.20 V: above it the core is beyond its operating conditions (5.6, 1.21 V).
const HIGHEST: u32 = 0xD;
/// From a write of VSEL to a voltage that has settled. The datasheet gives no number, and the SDK
/// waits so long; guess.
const SETTLES_PS: u64 = 1_000_000_000;

/// What is in reset, and why the chip started.
#[derive(Clone, Debug)]
pub(crate) struct Power {
    in_reset: u32,
    watchdog_resets: u32,
    watchdog_restarts: u32,
    cause: u32,
    regulator: u32,
    settled_ps: u64,
}

impl Power {
    /// As the boot ROM hands over: all in reset but the way to the flash.
    pub(crate) const fn new() -> Self {
        Self {
            in_reset: block::ALL & !block::FLASH,
            watchdog_resets: 0,
            watchdog_restarts: 0,
            cause: POWER_ON,
            regulator: VOLTAGE_AT_START,
            settled_ps: 0,
        }
    }

    /// After the watchdog: CHIP_RESET keeps its flags (2.13.2). VREG begins anew, as WDSEL selects it
    /// with the rest (2.13.5).
    pub(crate) fn after_watchdog(&mut self) {
        *self = Self {
            cause: self.cause,
            ..Self::new()
        };
    }

    /// Whether the core has the voltage that more than 133 MHz need.
    pub(crate) fn is_raised(&self, now_ps: u64) -> bool {
        self.voltage_code() >= RAISED && now_ps >= self.settled_ps
    }

    const fn voltage_code(&self) -> u32 {
        self.regulator >> 4 & 0xF
    }

    /// Lets the watchdog reset everything that it can, as the boot ROM does before it reboots.
    pub(crate) const fn let_watchdog_reset_all(&mut self) {
        self.watchdog_restarts = EVERYTHING;
    }

    /// Whether the watchdog resets everything that it can.
    pub(crate) fn watchdog_resets_all(&self) -> bool {
        self.watchdog_restarts & EVERYTHING == EVERYTHING
    }

    /// Whether the block of an address is in reset.
    pub(crate) fn is_in_reset(&self, address: u32) -> bool {
        let block = match base::of(address) {
            base::IO_BANK0 => block::IO_BANK0,
            base::IO_QSPI => block::IO_QSPI,
            base::PADS_QSPI => block::PADS_QSPI,
            base::PADS_BANK0 => block::PADS_BANK0,
            base::PLL_SYS => block::PLL_SYS,
            base::PLL_USB => block::PLL_USB,
            base::I2C0 => block::I2C0,
            base::ADC => block::ADC,
            base::PWM => block::PWM,
            base::TIMER => block::TIMER,
            base::DMA => block::DMA,
            base::USB | base::USB_MEMORY => block::USB,
            _ => 0,
        };
        self.in_reset & block != 0
    }

    pub(crate) fn read_resets(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x0 => self.in_reset,
            0x4 => self.watchdog_resets,
            0x8 => !self.in_reset & block::ALL,
            _ => return None,
        })
    }

    /// Returns the blocks that enter reset.
    pub(crate) fn write_resets(&mut self, offset: u32, value: u32) -> Option<u32> {
        let before = self.in_reset;
        match offset {
            0x0 => self.in_reset = value & block::ALL,
            0x4 => self.watchdog_resets = value & block::ALL,
            _ => return None,
        }
        Some(self.in_reset & !before)
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

    pub(crate) fn read_regulator(&self, offset: u32, now_ps: u64) -> Option<u32> {
        let regulates = if now_ps >= self.settled_ps {
            REGULATES
        } else {
            0
        };
        match offset {
            0x0 => Some(self.regulator | regulates),
            0x8 => Some(self.cause),
            _ => None,
        }
    }

    /// The regulator stays on, and at no voltage that the core is not made for.
    pub(crate) fn write_regulator(&mut self, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        let known = REGULATOR_ENABLED | 0xF << 4;
        let before = self.voltage_code();
        let is_known = offset == 0 && value & !REGULATES & !known == 0;
        if !is_known || value & REGULATOR_ENABLED == 0 || value >> 4 & 0xF > HIGHEST {
            return None;
        }
        self.regulator = value & known;
        if self.voltage_code() != before {
            self.settled_ps = now_ps + SETTLES_PS;
        }
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_core_voltage_is_raised_when_it_has_settled_and_falls_with_the_watchdogs_reset() {
        let mut power = Power::new();
        assert!(!power.is_raised(0));
        assert_eq!(power.read_regulator(0, 0), Some(0x10B1));
        power.write_regulator(0, 0xC1, 5).unwrap();
        assert_eq!(power.read_regulator(0, 5), Some(0xC1));
        assert!(!power.is_raised(1_000_000_004));
        assert!(power.is_raised(1_000_000_005));
        power.after_watchdog();
        assert!(!power.is_raised(9_000_000_000));
        assert_eq!(power.read_regulator(0, 9_000_000_000), Some(0x10B1));
        power.write_regulator(0, 0xC1, 9_000_000_000).unwrap();
        power.write_regulator(0, 0xB1, 12_000_000_000).unwrap();
        assert!(!power.is_raised(19_000_000_000));
    }

    #[test]
    fn a_regulator_that_is_off_or_too_high_is_refused() {
        let mut power = Power::new();
        assert_eq!(power.write_regulator(0, 0xB0, 0), None);
        assert_eq!(power.write_regulator(0, 0xE1, 0), None);
        assert_eq!(power.write_regulator(0, 0xB3, 0), None);
    }
}
