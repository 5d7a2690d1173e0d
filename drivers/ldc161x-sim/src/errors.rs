//! The errors of a conversion, in the three layouts in which the chip reports them.

use core::fmt;
use core::ops::{BitOr, BitOrAssign};

/// A set of conversion errors.
///
/// The bits are those of the "2INT" half of ERROR_CONFIG (datasheet table 26); the other two
/// layouts are shifts of these bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash)]
pub struct Errors(u8);

impl Errors {
    /// No errors.
    pub const NONE: Self = Self(0);
    /// ERR_UR: the offset is larger than the result.
    pub const UNDER_RANGE: Self = Self(0x80);
    /// ERR_OR: the sensor is as fast as the reference, or faster.
    pub const OVER_RANGE: Self = Self(0x40);
    /// ERR_WD: the watchdog has aborted a conversion.
    pub const WATCHDOG: Self = Self(0x20);
    /// ERR_AHE: amplitude above 1.8 V at the start of the conversion.
    pub const AMPLITUDE_HIGH: Self = Self(0x10);
    /// ERR_ALE: amplitude below 1.2 V at the start of the conversion.
    pub const AMPLITUDE_LOW: Self = Self(0x08);
    /// ERR_ZC: no edge was counted.
    pub const ZERO_COUNT: Self = Self(0x04);

    /// Whether this set contains all errors of `other`.
    #[must_use]
    pub const fn contains(self, other: Self) -> bool {
        self.0 & other.0 == other.0
    }

    /// Whether the set is empty.
    #[must_use]
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }

    /// The errors of this set that ERROR_CONFIG reports on INTB.
    pub(crate) const fn to_interrupt(self, error_config: u16) -> Self {
        Self(self.0 & error_config as u8)
    }

    /// The errors of this set that ERROR_CONFIG reports in DATAx_MSB, as bits 15:12 of the
    /// register.
    pub(crate) const fn to_data(self, error_config: u16) -> u16 {
        let shown = self.0 & (error_config >> 8) as u8 & 0xF8;
        let amplitude = Self::AMPLITUDE_HIGH.0 | Self::AMPLITUDE_LOW.0;
        let upper = (shown & 0xE0) as u16;
        let either = if shown & amplitude != 0 { 0x1000 } else { 0 };
        (upper << 8) | either
    }

    /// The errors of this set as bits 13:8 of STATUS.
    pub(crate) const fn to_status(self) -> u16 {
        (self.0 as u16) << 6
    }
}

impl BitOr for Errors {
    type Output = Self;
    fn bitor(self, other: Self) -> Self {
        Self(self.0 | other.0)
    }
}

impl BitOrAssign for Errors {
    fn bitor_assign(&mut self, other: Self) {
        *self = *self | other;
    }
}

impl fmt::Display for Errors {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        const NAMES: [(Errors, &str); 6] = [
            (Errors::UNDER_RANGE, "UR"),
            (Errors::OVER_RANGE, "OR"),
            (Errors::WATCHDOG, "WD"),
            (Errors::AMPLITUDE_HIGH, "AHE"),
            (Errors::AMPLITUDE_LOW, "ALE"),
            (Errors::ZERO_COUNT, "ZC"),
        ];
        if self.is_empty() {
            return formatter.write_str("none");
        }
        let mut separator = "";
        for (error, name) in NAMES {
            if self.contains(error) {
                write!(formatter, "{separator}{name}")?;
                separator = "+";
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_error_has_its_bit_in_each_layout() {
        // (error, 2OUT bit, DATAx_MSB bit, 2INT bit, STATUS bit) from datasheet tables 1, 25 and 26
        for (error, out, data, int, status) in [
            (Errors::UNDER_RANGE, Some(15), 15, 7, 13),
            (Errors::OVER_RANGE, Some(14), 14, 6, 12),
            (Errors::WATCHDOG, Some(13), 13, 5, 11),
            (Errors::AMPLITUDE_HIGH, Some(12), 12, 4, 10),
            (Errors::AMPLITUDE_LOW, Some(11), 12, 3, 9),
            (Errors::ZERO_COUNT, None, 0, 2, 8),
        ] {
            assert_eq!(error.to_status(), 1 << status);
            for bit in 0..16 {
                let error_config = 1_u16 << bit;
                let shown = error.to_data(error_config);
                let expected = if Some(bit) == out { 1 << data } else { 0 };
                assert_eq!(shown, expected, "{error} with 2OUT bit {bit}");
                let interrupts = !error.to_interrupt(error_config).is_empty();
                assert_eq!(interrupts, bit == int, "{error} with 2INT bit {bit}");
            }
        }
    }
}
