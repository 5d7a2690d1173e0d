//! CLOCKS, XOSC, ROSC and the two PLLs (RP2040 datasheet 2.15 to 2.18).

use crate::rp2040::base;
use crate::time::periods_ps;

/// Frequency of the ring oscillator after reset, behind its divider of 16 (`RING_DIVIDER`), Hz: 1.8
/// to 12 MHz, typically 6.5 MHz (2.17.1).
const RING_HZ: f64 = 6.5e6;
const RING_DIVIDER: u32 = 16;
/// Key in a write to the divider of the ring oscillator (2.17.8).
const RING_PASS: u32 = 0xAA0;
/// Time from a write of a PLL's PWR to its LOCK, ps. The datasheet gives no number; guess.
const LOCK_PS: u64 = 100_000_000;
const ENABLE: u32 = 1 << 11;
/// Allowed clock of the USB controller of a device at full speed, Hz (USB 2.0 7.1.11: 12 Mbit/s
/// within 0.25 %).
const USB_HZ: std::ops::RangeInclusive<f64> = 47.88e6..=48.12e6;
/// Fastest system clock for which the chip is certified, and the fastest one at the initial core
/// voltage, Hz (datasheet 2.15.1). Both have a margin for the crystal's error.
const FASTEST_HZ: f64 = 200.1e6;
pub(crate) const FASTEST_AT_START_HZ: f64 = 133.1e6;

#[derive(Clone, Debug)]
pub(crate) struct Clocks {
    crystal_hz: f64,
    crystal: Crystal,
    pub(crate) pll_sys: Pll,
    pub(crate) pll_usb: Pll,
    /// CTRL and DIV of each of the ten generators: GPOUT0 to 3, REF, SYS, PERI, USB, ADC, RTC.
    generators: [(u32, u32); 10],
    random: u64,
    ring_divider: u32,
}

#[derive(Clone, Debug)]
struct Crystal {
    control: u32,
    startup: u32,
    stable_ps: Option<u64>,
}

impl Crystal {
    /// State after a reset: off, with a start-up delay of 50 000 cycles (2.16.7).
    const fn new() -> Self {
        Self {
            control: 0,
            startup: 0xC4,
            stable_ps: None,
        }
    }

    fn is_stable(&self, now_ps: u64) -> bool {
        self.stable_ps.is_some_and(|due| due <= now_ps)
    }
}

/// A phase-locked loop.
#[derive(Clone, Debug)]
pub(crate) struct Pll {
    control: u32,
    power: u32,
    feedback: u32,
    post: u32,
    locked_ps: Option<u64>,
}

const REF: usize = 4;
const SYS: usize = 5;
const PERI: usize = 6;
const USB: usize = 7;
const ADC: usize = 8;

impl Pll {
    /// State after a reset.
    pub(crate) const fn new() -> Self {
        Self {
            control: 1,
            power: 0x2D,
            feedback: 0,
            post: 0x0007_7000,
            locked_ps: None,
        }
    }

    fn vco_hz(&self, crystal_hz: f64) -> f64 {
        crystal_hz / f64::from((self.control & 0x3F).max(1)) * f64::from(self.feedback & 0xFFF)
    }

    fn output_hz(&self, crystal_hz: f64) -> f64 {
        let (first, second) = (self.post >> 16 & 7, self.post >> 12 & 7);
        let is_off = self.power & 0b10_1001 != 0 || first == 0 || second == 0;
        if is_off {
            return 0.0;
        }
        self.vco_hz(crystal_hz) / f64::from(first * second)
    }

    fn is_locked(&self, now_ps: u64) -> bool {
        self.locked_ps.is_some_and(|due| due <= now_ps)
    }

    fn read(&self, offset: u32, now_ps: u64) -> Option<u32> {
        Some(match offset {
            0x0 => self.control | u32::from(self.is_locked(now_ps)) << 31,
            0x4 => self.power,
            0x8 => self.feedback,
            0xC => self.post,
            _ => return None,
        })
    }

    fn write(&mut self, offset: u32, value: u32, now_ps: u64, crystal_hz: f64) -> Option<()> {
        match offset {
            0x0 if value & 1 << 8 == 0 => self.control = value & 0x3F,
            0x4 => {
                let runs = value & 0b10_0001 == 0;
                let ran = self.power & 0b10_0001 == 0;
                self.power = value & 0x2D;
                if runs != ran {
                    self.locked_ps = runs.then_some(now_ps + LOCK_PS);
                }
            }
            0x8 => self.feedback = value & 0xFFF,
            0xC => self.post = value & 0x0007_7000,
            _ => return None,
        }
        // 2.18.2: the PLL's own oscillator runs from 750 to 1600 MHz.
        let runs = self.locked_ps.is_some();
        (!runs || (749e6..1601e6).contains(&self.vco_hz(crystal_hz))).then_some(())
    }
}

impl Clocks {
    pub(crate) fn new(crystal_hz: f64, seed: u64) -> Self {
        Self {
            crystal_hz,
            crystal: Crystal::new(),
            pll_sys: Pll::new(),
            pll_usb: Pll::new(),
            generators: [(0, 1 << 8); 10],
            random: seed | 1,
            ring_divider: RING_DIVIDER,
        }
    }

    /// Resets the clock tree. The random state continues, and so does a ring oscillator that the
    /// reset spares.
    pub(crate) fn reset(&mut self, spares_ring: bool) {
        let ring_divider = if spares_ring {
            self.ring_divider
        } else {
            RING_DIVIDER
        };
        *self = Self {
            random: self.random,
            ring_divider,
            ..Self::new(self.crystal_hz, 1)
        };
    }

    fn crystal_hz(&self) -> f64 {
        if self.crystal.control >> 12 & 0xFFF == 0xFAB {
            self.crystal_hz
        } else {
            0.0
        }
    }

    fn pll_sys_hz(&self) -> f64 {
        self.pll_sys.output_hz(self.crystal_hz())
    }

    fn pll_usb_hz(&self) -> f64 {
        self.pll_usb.output_hz(self.crystal_hz())
    }

    pub(crate) fn ref_hz(&self) -> f64 {
        let (control, divider) = self.generators[REF];
        let source = match control & 0b11 {
            2 => self.crystal_hz(),
            _ => self.ring_hz(),
        };
        source / f64::from((divider >> 8 & 0b11).max(1))
    }

    /// Frequency of processor and buses; `None` if its source is stopped.
    pub(crate) fn sys_hz(&self) -> Option<f64> {
        let (control, divider) = self.generators[SYS];
        let source = match (control & 1, control >> 5 & 0b111) {
            (0, _) => self.ref_hz(),
            (1, 0) => self.pll_sys_hz(),
            (1, 1) => self.pll_usb_hz(),
            (1, 2) => self.ring_hz(),
            (1, 3) => self.crystal_hz(),
            _ => 0.0,
        };
        let hz = source / fraction(divider);
        (1e6..=FASTEST_HZ).contains(&hz).then_some(hz)
    }

    /// Clock of the ADC, Hz; `None` if it is stopped.
    pub(crate) fn adc_hz(&self) -> Option<f64> {
        self.auxiliary_hz(ADC)
    }

    /// Clock of the USB controller; `None` if it is not 48 MHz.
    pub(crate) fn usb_hz(&self) -> Option<f64> {
        self.auxiliary_hz(USB).filter(|hz| USB_HZ.contains(hz))
    }

    /// Frequency of the generator for USB or ADC, whose sources have the same numbers (2.15.7).
    fn auxiliary_hz(&self, generator: usize) -> Option<f64> {
        let (control, divider) = self.generators[generator];
        let source = match control >> 5 & 0b111 {
            0 => self.pll_usb_hz(),
            1 => self.pll_sys_hz(),
            2 => self.ring_hz(),
            3 => self.crystal_hz(),
            _ => 0.0,
        };
        let hz = source / f64::from((divider >> 8 & 0b11).max(1));
        (control & ENABLE != 0 && hz > 0.0).then_some(hz)
    }

    /// Whether a generator uses a crystal or a PLL that has not settled (2.15.2.2, 2.15.2.5).
    pub(crate) fn uses_unsettled(&self, now_ps: u64) -> bool {
        let plls = [&self.pll_sys, &self.pll_usb];
        let [sys, usb] = plls.map(|pll| !pll.is_locked(now_ps));
        let crystal = !self.crystal.is_stable(now_ps);
        let control = |generator: usize| self.generators[generator].0;
        let takes = |generator: usize, sources: [bool; 4]| {
            let source = sources.get((control(generator) >> 5 & 0b111) as usize);
            source.is_some_and(|&is_unsettled| is_unsettled)
        };
        let needs_crystal =
            control(REF) & 0b11 == 2 || plls.iter().any(|pll| pll.locked_ps.is_some());
        crystal && needs_crystal
            || control(SYS) & 1 == 1 && takes(SYS, [sys, usb, false, crystal])
            || [USB, ADC].into_iter().any(|generator| {
                control(generator) & ENABLE != 0 && takes(generator, [usb, sys, false, crystal])
            })
    }

    /// Frequency of CLK_GPOUT0 at its pin; `None` if it is off.
    pub(crate) fn output_hz(&self) -> Option<f64> {
        let (control, divider) = self.generators[0];
        let source = match control >> 5 & 0xF {
            0 => self.pll_sys_hz(),
            3 => self.pll_usb_hz(),
            5 => self.crystal_hz(),
            6 => self.sys_hz()?,
            10 => self.ref_hz(),
            _ => return None,
        };
        // An odd divisor needs DC50 for an even duty (2.15.3.4), which the LDC requires.
        let odd = divider >> 8 & 1 == 1 && divider >> 8 > 1;
        let is_even = !odd || control >> 12 & 1 == 1;
        (control & ENABLE != 0 && source > 0.0 && is_even).then(|| source / fraction(divider))
    }

    /// Reads a register of one of the five blocks.
    pub(crate) fn read(&mut self, base: u32, offset: u32, now_ps: u64) -> Option<u32> {
        match base {
            base::CLOCKS => self.read_generator(offset),
            base::XOSC => self.read_crystal(offset, now_ps),
            base::PLL_SYS => self.pll_sys.read(offset, now_ps),
            base::PLL_USB => self.pll_usb.read(offset, now_ps),
            base::ROSC => self.read_ring(offset),
            _ => None,
        }
    }

    /// Writes a register of one of the five blocks.
    pub(crate) fn write(&mut self, base: u32, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        let crystal_hz = self.crystal_hz();
        match base {
            base::CLOCKS => self.write_generator(offset, value),
            base::XOSC => self.write_crystal(offset, value, now_ps),
            base::PLL_SYS => self.pll_sys.write(offset, value, now_ps, crystal_hz),
            base::PLL_USB => self.pll_usb.write(offset, value, now_ps, crystal_hz),
            base::ROSC => self.write_ring(offset, value),
            _ => None,
        }
    }

    fn read_generator(&self, offset: u32) -> Option<u32> {
        if offset == 0x78 || offset == 0x7C {
            return Some(0);
        }
        let (control, divider) = *self.generators.get((offset / 12) as usize)?;
        Some(match offset % 12 {
            0 => control,
            4 => divider,
            _ => match (offset / 12) as usize {
                REF => 1 << (control & 0b11),
                SYS => 1 << (control & 1),
                _ => 1,
            },
        })
    }

    fn write_generator(&mut self, offset: u32, value: u32) -> Option<()> {
        if offset == 0x78 {
            // The resuscitation circuit may stay off, as after reset.
            return (value == 0 || value == 0xFF).then_some(());
        }
        let index = (offset / 12) as usize;
        let generator = self.generators.get_mut(index)?;
        match offset % 12 {
            0 => generator.0 = value,
            4 if index != PERI => generator.1 = value,
            _ => return None,
        }
        Some(())
    }

    fn read_crystal(&self, offset: u32, now_ps: u64) -> Option<u32> {
        let stable = self.crystal.is_stable(now_ps);
        Some(match offset {
            0x0 => self.crystal.control,
            0x4 => u32::from(stable) << 31 | u32::from(self.crystal.stable_ps.is_some()) << 12,
            0xC => self.crystal.startup,
            _ => return None,
        })
    }

    fn write_crystal(&mut self, offset: u32, value: u32, now_ps: u64) -> Option<()> {
        match offset {
            0x0 => {
                self.crystal.control = value;
                if value >> 12 & 0xFFF == 0xFAB && self.crystal_hz > 0.0 {
                    let cycles = u64::from(self.crystal.startup & 0x3FFF) * 256;
                    let due = now_ps + periods_ps(cycles, self.crystal_hz);
                    self.crystal.stable_ps.get_or_insert(due);
                } else {
                    self.crystal.stable_ps = None;
                }
            }
            0xC => self.crystal.startup = value,
            _ => return None,
        }
        Some(())
    }

    fn ring_hz(&self) -> f64 {
        RING_HZ * f64::from(RING_DIVIDER) / f64::from(self.ring_divider)
    }

    /// Writes the ROSC divider.
    fn write_ring(&mut self, offset: u32, value: u32) -> Option<()> {
        let divider = value.checked_sub(RING_PASS).filter(|&it| it < 32)?;
        (offset == 0x10).then(|| self.ring_divider = if divider == 0 { 32 } else { divider })
    }

    /// Reads the ROSC random bit and running status.
    fn read_ring(&mut self, offset: u32) -> Option<u32> {
        match offset {
            0x18 => Some(1 << 31 | 1 << 12),
            0x1C => {
                // xorshift64 (Marsaglia 2003).
                self.random ^= self.random << 13;
                self.random ^= self.random >> 7;
                self.random ^= self.random << 17;
                Some((self.random >> 32) as u32 & 1)
            }
            _ => None,
        }
    }
}

fn fraction(divider: u32) -> f64 {
    match divider {
        0 => 65_536.0,
        _ => f64::from(divider) / 256.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write_pll(clocks: &mut Clocks, offset: u32, value: u32) -> Option<()> {
        clocks.write(base::PLL_SYS, offset, value, 0)
    }

    fn running() -> Clocks {
        let mut clocks = Clocks::new(12e6, 1);
        clocks.write_crystal(0xC, 47, 0).unwrap();
        clocks.write_crystal(0x0, 0x00FA_BAA0, 0).unwrap();
        write_pll(&mut clocks, 0x8, 100).unwrap();
        write_pll(&mut clocks, 0xC, 6 << 16 | 1 << 12).unwrap();
        write_pll(&mut clocks, 0x4, 0x8).unwrap();
        write_pll(&mut clocks, 0x4, 0).unwrap();
        clocks.write_generator(0x3C, 1).unwrap();
        clocks
    }

    #[test]
    fn clocks_beyond_what_the_chip_keeps_are_none() {
        let mut clocks = running();
        assert_eq!(clocks.sys_hz(), Some(200e6));
        clocks.write_generator(0x04, 5 << 8).unwrap();
        clocks.write_generator(0x00, ENABLE | 6 << 5).unwrap();
        assert_eq!(clocks.output_hz(), None, "the duty of a fifth is uneven");
        let even = ENABLE | 6 << 5 | 1 << 12;
        clocks.write_generator(0x00, even).unwrap();
        assert_eq!(clocks.output_hz(), Some(40e6));
        write_pll(&mut clocks, 0x8, 101).unwrap();
        assert_eq!(clocks.sys_hz(), None, "above 200 MHz");
        assert_eq!(write_pll(&mut clocks, 0x8, 200), None, "above its VCO");
    }
}
