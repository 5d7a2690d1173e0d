//! ADC (RP2040 datasheet 4.9): conversions without end over several inputs in turn, into the FIFO,
//! from which DMA takes them.

use crate::time::periods_ps;

/// Cycles of clk_adc for a conversion (4.9.2).
const CONVERSION: u64 = 96;
const ENABLE: u32 = 1;
const TEMPERATURE: u32 = 1 << 1;
const START_MANY: u32 = 1 << 3;
/// FCS: the FIFO on, with a request to DMA.
const FIFO_TO_DMA: u32 = 1 | 1 << 3;

/// The converter.
#[derive(Clone, Debug, Default)]
pub(crate) struct Adc {
    control: u32,
    fifo: u32,
    /// When conversions without end began, and how many have been sampled since.
    began_ps: u64,
    clock_hz: f64,
    sampled: u64,
    /// The conversion under way: when its result is there, and which.
    converting: Option<(u64, u16)>,
}

/// A conversion: which input, when its voltage is sampled, and when its result is there.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct AdcConversion {
    pub(crate) input: usize,
    pub(crate) sampled_ps: u64,
    pub(crate) done_ps: u64,
}

impl Adc {
    pub(crate) fn write(
        &mut self,
        offset: u32,
        value: u32,
        now_ps: u64,
        clock_hz: Option<f64>,
    ) -> Option<()> {
        match offset {
            0x0 => {
                let known = ENABLE | TEMPERATURE | START_MANY | 0x1F << 16;
                // Single conversions, and a first input other than 0, are not modelled; nor is a
                // change while it converts.
                if value & !known != 0 || self.runs() && value != self.control {
                    return None;
                }
                self.control = value;
                if self.runs() {
                    self.began_ps = now_ps;
                    self.clock_hz = clock_hz?;
                    self.sampled = 0;
                }
            }
            // Results shifted to eight bits, and interrupts, are not modelled.
            0x8 if value & !FIFO_TO_DMA == 0 => self.fifo = value,
            0x10 if value == 0 => {}
            _ => return None,
        }
        Some(())
    }

    pub(crate) fn read(&self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x0 => self.control | 1 << 8,
            0x8 => self.fifo,
            0x10 => 0,
            _ => return None,
        })
    }

    /// Whether it converts without end.
    pub(crate) fn runs(&self) -> bool {
        self.control & (ENABLE | START_MANY) == ENABLE | START_MANY
    }

    /// Whether results go to DMA.
    pub(crate) fn feeds_dma(&self) -> bool {
        self.fifo & FIFO_TO_DMA == FIFO_TO_DMA
    }

    /// The next conversion to be sampled.
    pub(crate) fn next(&self) -> Option<AdcConversion> {
        if !self.runs() {
            return None;
        }
        let mask = self.control >> 16 & 0x1F;
        let inputs = u64::from(mask.count_ones());
        let input = match inputs {
            0 => 0,
            _ => {
                let turn = self.sampled % inputs;
                (0..5)
                    .filter(|input| mask >> input & 1 == 1)
                    .nth(turn as usize)?
            }
        };
        let at_ps = |count| self.began_ps + periods_ps(CONVERSION * count, self.clock_hz);
        Some(AdcConversion {
            input,
            sampled_ps: at_ps(self.sampled),
            done_ps: at_ps(self.sampled + 1),
        })
    }

    /// Takes the code of the next conversion and goes on to the one after it.
    pub(crate) fn sample(&mut self, conversion: AdcConversion, code: u16) {
        self.converting = Some((conversion.done_ps, code));
        self.skip(1);
    }

    /// The result of the conversion under way, if it is there by a time.
    pub(crate) fn take_result(&mut self, now_ps: u64) -> Option<u16> {
        let (_, code) = self.converting.take_if(|(done_ps, _)| *done_ps <= now_ps)?;
        Some(code)
    }

    /// Leaves out conversions.
    pub(crate) fn skip(&mut self, conversions: u64) {
        self.sampled += conversions;
    }

    /// How many conversions will have been sampled by then.
    pub(crate) fn sampled_by(&self, now_ps: u64) -> u64 {
        if !self.runs() {
            return 0;
        }
        let passed_s = now_ps.saturating_sub(self.began_ps) as f64 * 1e-12;
        let count = passed_s * self.clock_hz / CONVERSION as f64;
        (count as u64).saturating_sub(self.sampled)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn inputs_take_turns_every_two_microseconds() {
        let mut adc = Adc::default();
        adc.write(0, ENABLE | TEMPERATURE, 0, Some(48e6)).unwrap();
        assert_eq!(adc.next(), None);
        let many = ENABLE | TEMPERATURE | START_MANY | 0b10111 << 16;
        adc.write(0, many, 5_000_000, Some(48e6)).unwrap();
        let mut inputs = Vec::new();
        for count in 0..8 {
            let conversion = adc.next().unwrap();
            assert_eq!(conversion.sampled_ps, 5_000_000 + 2_000_000 * count);
            inputs.push(conversion.input);
            adc.skip(1);
        }
        assert_eq!(inputs, [0, 1, 2, 4, 0, 1, 2, 4]);
        assert_eq!(adc.sampled_by(5_000_000 + 30_000_000), 7);
    }
}
