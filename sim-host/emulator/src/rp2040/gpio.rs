//! Pins: IO_BANK0, PADS_BANK0 and the GPIO registers of SIO (RP2040 datasheet 2.19, 2.3.1.7).

/// Number of pins in the bank.
pub(crate) const PINS: usize = 30;

/// Functions of a pin (2.19.2).
pub(crate) mod function {
    pub(crate) const I2C: u32 = 3;
    pub(crate) const PWM: u32 = 4;
    pub(crate) const SIO: u32 = 5;
    pub(crate) const CLOCK: u32 = 8;
    pub(crate) const NONE: u32 = 31;
}

/// PADS_BANK0: pulls, input and output drivers (2.19.6.3).
mod pad {
    pub(super) const PULL_DOWN: u32 = 1 << 2;
    pub(super) const PULL_UP: u32 = 1 << 3;
    pub(super) const INPUT: u32 = 1 << 6;
    pub(super) const NO_OUTPUT: u32 = 1 << 7;
}

const EDGE_LOW: u32 = 0b0100;
const EDGE_HIGH: u32 = 0b1000;

#[derive(Clone, Debug)]
pub(crate) struct Gpio {
    control: [u32; PINS],
    pads: [u32; PINS],
    out: u32,
    enabled: u32,
    /// Levels driven from outside, one bit per pin; `driven` marks the driven pins.
    outside: u32,
    driven: u32,
    /// Levels of the pins at the last edge detection.
    seen: u32,
    edges: [u32; 4],
    interrupts: [u32; 4],
    forced: [u32; 4],
}

impl Gpio {
    pub(crate) fn new() -> Self {
        Self {
            control: [function::NONE; PINS],
            pads: [0x56; PINS],
            out: 0,
            enabled: 0,
            outside: 0,
            driven: 0,
            seen: 0,
            edges: [0; 4],
            interrupts: [0; 4],
            forced: [0; 4],
        }
    }

    /// Resets all pins; external drives stay.
    pub(crate) fn reset(&mut self) {
        *self = Self {
            outside: self.outside,
            driven: self.driven,
            ..Self::new()
        };
        self.seen = self.levels();
    }

    pub(crate) fn reset_io(&mut self) {
        self.control = [function::NONE; PINS];
        self.edges = [0; 4];
        self.interrupts = [0; 4];
        self.forced = [0; 4];
        self.seen = self.levels();
    }

    pub(crate) fn reset_pads(&mut self) {
        self.pads = [0x56; PINS];
    }

    /// Drives a pin from outside.
    pub(crate) fn drive(&mut self, pin: usize, high: bool) {
        self.driven |= 1 << pin;
        self.outside = self.outside & !(1 << pin) | u32::from(high) << pin;
        self.follow();
    }

    pub(crate) fn function(&self, pin: usize) -> u32 {
        self.control
            .get(pin)
            .map_or(function::NONE, |word| word & 0x1F)
    }

    fn pad(&self, pin: usize) -> u32 {
        self.pads.get(pin).copied().unwrap_or(0)
    }

    /// Whether SIO drives a pin.
    fn is_output(&self, pin: usize) -> bool {
        let is_on = self.enabled >> pin & 1 == 1 && self.pad(pin) & pad::NO_OUTPUT == 0;
        is_on && self.function(pin) == function::SIO
    }

    /// Level of a pin, driven by SIO, from outside, or by a pull.
    pub(crate) fn level(&self, pin: usize) -> bool {
        let bit = 1 << pin;
        if self.is_output(pin) {
            return self.out & bit != 0;
        }
        if self.driven & bit != 0 {
            return self.outside & bit != 0;
        }
        self.pad(pin) & (pad::PULL_UP | pad::PULL_DOWN) == pad::PULL_UP
    }

    /// Whether SIO pulls a pin low.
    pub(crate) fn pulls_low(&self, pin: usize) -> bool {
        self.is_output(pin) && self.out >> pin & 1 == 0
    }

    /// Whether a pin's level reaches the chip. Otherwise the chip reads zero; that is a guess.
    pub(crate) fn is_input(&self, pin: usize) -> bool {
        self.pad(pin) & pad::INPUT != 0
    }

    /// Whether a pad is set up for an analogue voltage: both drivers off, no pull (4.9).
    pub(crate) fn is_analogue(&self, pin: usize) -> bool {
        let of_interest = pad::INPUT | pad::NO_OUTPUT | pad::PULL_UP | pad::PULL_DOWN;
        self.pad(pin) & of_interest == pad::NO_OUTPUT
    }

    /// Levels as the chip reads them.
    fn levels(&self) -> u32 {
        (0..PINS)
            .filter(|&pin| self.is_input(pin) && self.level(pin))
            .fold(0, |levels, pin| levels | 1 << pin)
    }

    /// Latches the edges since the last call.
    pub(crate) fn follow(&mut self) {
        let levels = self.levels();
        let changed = levels ^ self.seen;
        self.seen = levels;
        for pin in (0..PINS).filter(|pin| changed >> pin & 1 == 1) {
            let edge = if levels >> pin & 1 == 1 {
                EDGE_HIGH
            } else {
                EDGE_LOW
            };
            self.edges[pin / 8] |= edge << (pin % 8 * 4);
        }
    }

    fn raw(&self, word: usize) -> u32 {
        (0..8).fold(self.edges[word], |raw, index| {
            let pin = word * 8 + index;
            let level = if pin < PINS && self.seen >> pin & 1 == 1 {
                0b10
            } else {
                0b01
            };
            raw | level << (index * 4)
        })
    }

    fn status(&self, word: usize) -> u32 {
        self.raw(word) & self.interrupts[word] | self.forced[word]
    }

    /// Interrupt line to the first core.
    pub(crate) fn line(&self) -> bool {
        (0..4)
            .any(|word| (self.interrupts[word] | self.forced[word] != 0) && self.status(word) != 0)
    }

    pub(crate) fn read_bank(&self, offset: u32) -> Option<u32> {
        let word = (offset >> 2 & 0b11) as usize;
        Some(match offset {
            0x000..=0x0EC if offset % 8 == 4 => *self.control.get(offset as usize / 8)?,
            0x000..=0x0EC => (self.levels() >> (offset / 8) & 1) << 17,
            0x0F0..=0x0FC => self.raw(word),
            0x100..=0x10C => self.interrupts[word],
            0x110..=0x11C => self.forced[word],
            0x120..=0x12C => self.status(word),
            _ => return None,
        })
    }

    pub(crate) fn write_bank(&mut self, offset: u32, value: u32) -> Option<()> {
        let word = (offset >> 2 & 0b11) as usize;
        match offset {
            0x000..=0x0EC if offset % 8 == 4 => {
                // Overrides of output, output enable, input and interrupt are not modelled.
                if value & !0x1F != 0 {
                    return None;
                }
                *self.control.get_mut(offset as usize / 8)? = value;
            }
            0x0F0..=0x0FC => self.edges[word] &= !value,
            0x100..=0x10C => self.interrupts[word] = value,
            0x110..=0x11C => self.forced[word] = value,
            _ => return None,
        }
        self.follow();
        Some(())
    }

    pub(crate) fn read_pads(&self, offset: u32) -> Option<u32> {
        self.pads
            .get((offset as usize).checked_sub(4)? / 4)
            .copied()
    }

    pub(crate) fn write_pads(&mut self, offset: u32, value: u32) -> Option<()> {
        *self.pads.get_mut((offset as usize).checked_sub(4)? / 4)? = value & 0xFF;
        self.follow();
        Some(())
    }

    pub(crate) fn read_sio(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x04 => self.levels(),
            0x10 => self.out,
            0x20 => self.enabled,
            _ => return None,
        })
    }

    pub(crate) fn write_sio(&mut self, offset: u32, value: u32) -> Option<()> {
        match offset {
            0x10 => self.out = value,
            0x14 => self.out |= value,
            0x18 => self.out &= !value,
            0x1C => self.out ^= value,
            0x20 => self.enabled = value,
            0x24 => self.enabled |= value,
            0x28 => self.enabled &= !value,
            0x2C => self.enabled ^= value,
            _ => return None,
        }
        self.follow();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_pad_can_keep_a_level_from_the_chip_and_an_output_from_the_pin() {
        let mut gpio = Gpio::new();
        let pad_of = |pin: u32| 4 + 4 * pin;
        gpio.write_pads(pad_of(7), 0).unwrap();
        gpio.drive(7, true);
        gpio.write_bank(0xF0, u32::MAX).unwrap();
        assert_eq!(gpio.read_sio(0x04), Some(0), "without its input");
        gpio.drive(7, false);
        assert_eq!(gpio.read_bank(0xF0).unwrap() & EDGE_LOW << 28, 0);
        gpio.write_sio(0x14, 1 << 8).unwrap();
        gpio.write_sio(0x24, 1 << 8).unwrap();
        assert!(!gpio.level(8), "without its function");
        gpio.write_bank(8 * 8 + 4, function::SIO).unwrap();
        assert!(gpio.level(8));
        gpio.write_pads(pad_of(8), pad::INPUT | pad::NO_OUTPUT)
            .unwrap();
        assert!(!gpio.level(8), "without its output");
    }
}
