//! ADC (RP2040 datasheet 4.9): continuous round-robin conversions into the FIFO, which DMA reads.

use std::collections::VecDeque;

use crate::time::periods_ps;

/// Duration of a conversion in cycles of clk_adc (4.9.2).
const CONVERSION: u64 = 96;
const ENABLE: u32 = 1;
const TEMPERATURE: u32 = 1 << 1;
const START_MANY: u32 = 1 << 3;
/// Bits of FCS: results go into the FIFO, the FIFO requests DMA transfers, the FIFO is empty, the
/// FIFO is full.
const FIFO_ENABLE: u32 = 1;
const ASK_DMA: u32 = 1 << 3;
const EMPTY: u32 = 1 << 8;
const FULL: u32 = 1 << 9;
/// Flags of FCS: the FIFO was read while empty, the FIFO was written while full. Writing a one
/// clears a flag.
const UNDER: u32 = 1 << 10;
const OVER: u32 = 1 << 11;
const THRESHOLD: u32 = 0xF << 24;
/// Depth of the FIFO (4.9.2.4).
const FIFO_DEPTH: usize = 4;

#[derive(Clone, Debug, Default)]
pub(crate) struct Adc {
    control: u32,
    /// Settings of FCS; `fifo_flags` has its two sticky flags.
    fifo_control: u32,
    fifo_flags: u32,
    fifo: VecDeque<u16>,
    /// Start of the continuous conversions; `clock_hz` is the ADC's clock, `sampled` the number of
    /// conversions sampled since the start.
    began_ps: u64,
    clock_hz: f64,
    sampled: u64,
    /// Conversion in progress: the time at which its result is ready, and the result.
    converting: Option<(u64, u16)>,
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
                // Single conversions, and a first input other than 0, are not modelled, nor is a
                // change during a conversion.
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
            // Results shifted to eight bits, and error flags in them, are not modelled.
            0x8 if value & 0b0110 == 0 => {
                self.fifo_control = value & (FIFO_ENABLE | ASK_DMA | THRESHOLD);
                self.fifo_flags &= !value;
            }
            0x10 if value == 0 => {}
            _ => return None,
        }
        Some(())
    }

    pub(crate) fn read(&mut self, offset: u32) -> Option<u32> {
        Some(match offset {
            0x0 => self.control | 1 << 8,
            0x8 => {
                let level = self.fifo.len();
                let flag = |holds: bool, flag: u32| if holds { flag } else { 0 };
                self.fifo_control
                    | self.fifo_flags
                    | flag(level == 0, EMPTY)
                    | flag(level == FIFO_DEPTH, FULL)
                    | (level as u32) << 16
            }
            0xC => self.take_from_fifo().into(),
            0x10 => 0,
            _ => return None,
        })
    }

    /// Whether conversions run continuously.
    pub(crate) fn runs(&self) -> bool {
        self.control & (ENABLE | START_MANY) == ENABLE | START_MANY
    }

    fn threshold(&self) -> usize {
        ((self.fifo_control & THRESHOLD) >> 24) as usize
    }

    /// Whether DMA is requested: while the FIFO has at least as many results as the threshold. A
    /// threshold of zero therefore always requests (4.9.2.5).
    pub(crate) fn asks_dma(&self) -> bool {
        self.fifo_control & ASK_DMA != 0 && self.fifo.len() >= self.threshold()
    }

    /// Whether every result goes to DMA at once, and to no other reader.
    pub(crate) fn feeds_dma(&self) -> bool {
        let is_on = FIFO_ENABLE | ASK_DMA;
        self.fifo_control & is_on == is_on && self.threshold() == 1
    }

    /// Puts a result into the FIFO, if it is enabled; a full FIFO loses the result.
    pub(crate) fn put_into_fifo(&mut self, code: u16) {
        if self.fifo_control & FIFO_ENABLE == 0 {
            return;
        }
        if self.fifo.len() < FIFO_DEPTH {
            self.fifo.push_back(code);
        } else {
            self.fifo_flags |= OVER;
        }
    }

    /// Takes the oldest result from the FIFO. The datasheet does not give the result of an empty
    /// FIFO; 0 here.
    pub(crate) fn take_from_fifo(&mut self) -> u16 {
        self.fifo.pop_front().unwrap_or_else(|| {
            self.fifo_flags |= UNDER;
            0
        })
    }

    /// Time at which the next conversion is sampled.
    pub(crate) fn next_ps(&self) -> Option<u64> {
        self.runs().then(|| self.sampled_ps(self.sampled))
    }

    fn sampled_ps(&self, conversion: u64) -> u64 {
        self.began_ps + periods_ps(CONVERSION * conversion, self.clock_hz)
    }

    /// Input of the next conversion.
    pub(crate) fn next_input(&self) -> usize {
        let mask = self.control >> 16 & 0x1F;
        let turn = self.sampled.checked_rem(mask.count_ones().into());
        let mut inputs = (0..5).filter(|input| mask >> input & 1 == 1);
        inputs.nth(turn.unwrap_or(0) as usize).unwrap_or(0)
    }

    /// Stores the code of the next conversion and advances to the one after it. The result is ready
    /// when that one is sampled.
    pub(crate) fn sample(&mut self, code: u16) {
        self.skip(1);
        self.converting = Some((self.sampled_ps(self.sampled), code));
    }

    /// Result of the conversion in progress, if it is complete by a time.
    pub(crate) fn take_result(&mut self, now_ps: u64) -> Option<u16> {
        let (_, code) = self.converting.take_if(|(done_ps, _)| *done_ps <= now_ps)?;
        Some(code)
    }

    pub(crate) fn skip(&mut self, conversions: u64) {
        self.sampled += conversions;
    }

    /// Number of conversions sampled by a time.
    pub(crate) fn sampled_by(&self, now_ps: u64) -> u64 {
        if !self.runs() {
            return 0;
        }
        let passed_s = now_ps.saturating_sub(self.began_ps) as f64 * 1e-12;
        let count = passed_s * self.clock_hz / CONVERSION as f64;
        (count as u64).saturating_sub(self.sampled)
    }
}
