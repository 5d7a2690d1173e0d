//! RESETS, PSM, the core voltage and the cause of the last reset (RP2040 datasheet 2.10 to 2.14).

use crate::rp2040::base;

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
    /// Blocks that the boot ROM needs to read the flash.
    pub(crate) const FLASH: u32 = IO_QSPI | PADS_QSPI;
}

/// Value of PSM.WDSEL that selects all blocks except the oscillators, as the SDK sets it before it
/// uses the watchdog. `RING` is the bit of the ring oscillator.
const EVERYTHING: u32 = 0x1_FFFC;
const RING: u32 = 1 << 0;
const POWER_ON: u32 = 1 << 8;

/// Value of VREG after power on: enabled at 1.10 V (2.10.6).
const VOLTAGE_AT_START: u32 = 0xB1;
const CODE_AT_START: u32 = 0xB;
const REGULATOR_ENABLED: u32 = 1;
const REGULATES: u32 = 1 << 12;
/// Value of VSEL for 1.15 V, the minimum above 133 MHz. Steps are 50 mV.
const RAISED: u32 = 0xC;
/// Value of VSEL for 1.20 V: above it the core exceeds its operating conditions (5.6, 1.21 V).
const HIGHEST: u32 = 0xD;
/// VREG: volts per step of VSEL, volts at VSEL 0, and the relative amount by which the regulator's
/// output may be lower (2.10.3, 2.10.6).
const STEP_V: f64 = 0.05;
const LOWEST_V: f64 = 0.55;
const REGULATOR_ERROR: f64 = 0.03;
/// BOD, the brown-out detection: its value after power on (enabled, at 0.86 V), its enable bit,
/// volts per step of its VSEL, and volts at VSEL 0 (2.12.3, 2.12.8).
const DETECTION_AT_START: u32 = 0x91;
const DETECTION_ENABLED: u32 = 1;
const DETECTION_STEP_V: f64 = 0.043;
const DETECTION_LOWEST_V: f64 = 0.473;
/// Relative amount by which the threshold of the brown-out detection may be higher. The datasheet
/// gives 3.5 % for the threshold of the power-on reset only.
const DETECTION_ERROR: f64 = 0.035;
/// Time from a write of VSEL until the voltage has settled, ps. The datasheet gives no number, and
/// the SDK waits this long; guess.
const SETTLES_PS: u64 = 1_000_000_000;

/// Reset state of the blocks, and the cause of the last reset.
#[derive(Clone, Debug)]
pub(crate) struct Power {
    in_reset: u32,
    watchdog_resets: u32,
    watchdog_restarts: u32,
    cause: u32,
    regulator: u32,
    settled_ps: u64,
    detection: u32,
}

impl Power {
    /// State after the boot ROM: all blocks in reset except those for the flash.
    pub(crate) const fn new() -> Self {
        Self {
            in_reset: block::ALL & !block::FLASH,
            watchdog_resets: 0,
            watchdog_restarts: 0,
            cause: POWER_ON,
            regulator: VOLTAGE_AT_START,
            settled_ps: 0,
            detection: DETECTION_AT_START,
        }
    }

    /// State after a watchdog reset: CHIP_RESET keeps its flags (2.13.2). VREG and BOD are reset,
    /// since WDSEL selects them too (2.13.5).
    pub(crate) fn after_watchdog(&mut self) {
        *self = Self {
            cause: self.cause,
            ..Self::new()
        };
    }

    /// Whether the core has the voltage required above 133 MHz.
    pub(crate) fn is_raised(&self, now_ps: u64) -> bool {
        self.voltage_code() >= RAISED && now_ps >= self.settled_ps
    }

    const fn voltage_code(&self) -> u32 {
        self.regulator >> 4 & 0xF
    }

    /// Least output of the regulator at a setting, V.
    fn least_v(code: u32) -> f64 {
        // Codes 0 to 5 all give 0.80 V.
        (LOWEST_V + STEP_V * f64::from(code.max(5))) * (1.0 - REGULATOR_ERROR)
    }

    fn detection_v(&self) -> f64 {
        DETECTION_LOWEST_V + DETECTION_STEP_V * f64::from(self.detection >> 4 & 0xF)
    }

    /// Whether the core's supply at a voltage restarts the chip.
    pub(crate) fn detects(&self, core_v: f64) -> bool {
        self.detection & DETECTION_ENABLED != 0 && core_v < self.detection_v()
    }

    /// Whether the core's supply is below the minimum above 133 MHz: 1.15 V, with the regulator's
    /// error.
    pub(crate) fn is_too_low(core_v: f64) -> bool {
        core_v < Self::least_v(RAISED)
    }

    /// Whether the brown-out detection may trip at the regulator's voltage, or at the previous
    /// voltage while the present one has not settled.
    pub(crate) fn detection_is_too_high(&self, now_ps: u64) -> bool {
        let is_settled = now_ps >= self.settled_ps;
        let most = if is_settled { u32::MAX } else { CODE_AT_START };
        let least_v = Self::least_v(self.voltage_code().min(most));
        self.detection_v() * (1.0 + DETECTION_ERROR) > least_v
    }

    /// Selects everything for a watchdog reset, as the boot ROM does before it reboots.
    pub(crate) const fn let_watchdog_reset_all(&mut self) {
        self.watchdog_restarts = EVERYTHING;
    }

    /// Whether a watchdog reset includes all blocks of `EVERYTHING`.
    pub(crate) fn watchdog_resets_all(&self) -> bool {
        self.watchdog_restarts & EVERYTHING == EVERYTHING
    }

    /// Whether a watchdog reset includes the ring oscillator.
    pub(crate) fn watchdog_resets_ring(&self) -> bool {
        self.watchdog_restarts & RING != 0
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

    /// Writes RESETS; returns the blocks that enter reset.
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
            0x4 => Some(self.detection),
            0x8 => Some(self.cause),
            _ => None,
        }
    }

    /// Writes VREG and BOD. The regulator must stay on within the core's allowed voltages; the
    /// detection must stay on.
    pub(crate) fn write_regulator(&mut self, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        if offset == 0x4 {
            let is_known = value & !(DETECTION_ENABLED | 0xF << 4) == 0;
            self.detection = value;
            return (is_known && value & DETECTION_ENABLED != 0).then_some(());
        }
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
    fn a_brown_out_is_detected_below_its_threshold_which_the_watchdog_sets_back() {
        let mut power = Power::new();
        assert_eq!(power.read_regulator(4, 0), Some(0x91));
        assert!(power.detects(0.859) && !power.detects(0.861));
        power.write_regulator(0, 0xC1, 0).unwrap();
        power.write_regulator(4, 0xD1, 5).unwrap();
        assert!(power.detection_is_too_high(5), "not settled");
        assert!(!power.detection_is_too_high(SETTLES_PS));
        assert!(power.detects(1.031) && !power.detects(1.033));
        // Threshold 1.118 V: the regulator may be at 1.116 V.
        power.write_regulator(4, 0xF1, SETTLES_PS).unwrap();
        assert!(power.detection_is_too_high(SETTLES_PS));
        power.after_watchdog();
        assert_eq!(power.read_regulator(4, SETTLES_PS), Some(0x91));
        assert_eq!(power.write_regulator(4, 0x90, 0), None, "off");
    }
}
