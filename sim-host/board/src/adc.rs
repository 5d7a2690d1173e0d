//! ADC: one conversion at a time (RP2040 datasheet 4.9).

use crate::time::periods_ps;

/// Cycles of clk_adc for a conversion (4.9.2).
const CONVERSION: u64 = 96;
const REFERENCE_V: f64 = 3.3;
/// Codes that are about eight codes wide (erratum RP2040-E11).
const WIDE_CODES: [f64; 4] = [512.0, 1536.0, 2560.0, 3584.0];
const HALF_WIDTH: f64 = 4.0;

/// The converter.
#[derive(Clone, Debug, Default)]
pub(crate) struct Adc {
    control: u32,
    result: u32,
    ready_ps: u64,
}

impl Adc {
    /// The channel that a write of CS starts to convert, if it does.
    pub(crate) fn write_control(
        &mut self,
        value: u32,
        now_ps: u64,
        clock_hz: Option<f64>,
    ) -> Option<Option<usize>> {
        // Free-running and round-robin conversions are not modelled.
        if value & (1 << 3 | 0x1F << 16) != 0 {
            return None;
        }
        self.control = value & 0x7003;
        let starts = value & 0b101 == 0b101;
        if !starts {
            return Some(None);
        }
        // Without a clock it is never ready.
        self.ready_ps = clock_hz.map_or(u64::MAX, |hz| now_ps + periods_ps(CONVERSION, hz));
        Some(Some((value >> 12 & 0b111) as usize))
    }

    /// The result of the conversion that was started.
    pub(crate) fn convert(&mut self, volts: f64, wide_codes: bool) {
        let ideal = volts / REFERENCE_V * 4096.0;
        let code = WIDE_CODES
            .iter()
            .copied()
            .find(|wide| wide_codes && (ideal - wide).abs() < HALF_WIDTH)
            .unwrap_or(ideal);
        self.result = code.clamp(0.0, 4095.0) as u32;
    }

    pub(crate) fn read(&self, offset: u32, now_ps: u64) -> Option<u32> {
        Some(match offset {
            0x0 => self.control | u32::from(self.control & 1 == 1 && self.ready_ps <= now_ps) << 8,
            0x4 => self.result,
            _ => return None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_conversion_takes_two_microseconds_and_some_codes_are_wide() {
        let mut adc = Adc::default();
        assert_eq!(adc.write_control(1, 0, Some(48e6)), Some(None));
        assert_eq!(
            adc.write_control(0b101 | 2 << 12, 0, Some(48e6)),
            Some(Some(2))
        );
        adc.convert(1.65, true);
        assert_eq!(adc.read(0, 1_999_999).map(|word| word >> 8), Some(0x20));
        assert_eq!(adc.read(0, 2_000_000).map(|word| word >> 8), Some(0x21));
        assert_eq!(adc.read(4, 2_000_000), Some(2048));
        adc.convert(515.0 / 4096.0 * 3.3, true);
        assert_eq!(adc.read(4, 0), Some(512));
    }
}
