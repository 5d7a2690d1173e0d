//! Outputs to the bridge.

use crate::hardware::Decay;
use crate::line::FixedPointLine;

/// Compare values of the PWM's two outputs: each is proportional to the fraction of a period for
/// which the output is high. The pulses are centred on the count's zero, where samples of a
/// phase-correct PWM are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Levels {
    /// Compare value of IN1.
    pub in1: u16,
    /// Compare value of IN2.
    pub in2: u16,
}

/// The bridge's inputs until the next period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Output {
    /// Level of nSLEEP. If it is low, both inputs have to be low as well.
    pub awake: bool,
    /// Compare values that take effect with the next period.
    pub levels: Levels,
    /// Whether to reduce the hardware's current limit, if the board can do that (self-test only).
    pub limit_low: bool,
}

impl Output {
    /// Everything off: the current decays through the diodes.
    pub const OFF: Self = Self {
        awake: false,
        levels: Levels { in1: 0, in2: 0 },
        limit_low: false,
    };

    /// The bridge is awake, and no voltage is applied.
    pub(crate) const WAKING: Self = Self {
        awake: true,
        ..Self::OFF
    };
}

/// A measured current below this, in units, counts as having no sign.
const NO_SIGN: i32 = 8;

/// Converts a signed level (mean voltage) to pulses at the two outputs.
///
/// - both high: the coil is shorted, and its current decays slowly;
/// - one high: the supply drives the current;
/// - both low: the diodes apply the supply against the current, which decays fast and stops at
///   zero.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Shaper {
    pub(crate) full: i32,
    /// Ratio of the supply voltage to the supply voltage plus two diode voltages, in 1/256.
    pub(crate) coast_q8: i32,
    pub(crate) decay: Decay,
}

impl Shaper {
    /// Returns the pulses for a signed level, and the level that they achieve.
    #[inline]
    pub(crate) fn shape(&self, level: i32, measured: i32, line: &FixedPointLine) -> (i32, Levels) {
        // The signs of level and current differ.
        if level ^ measured < 0
            && let Some(opposed) = self.oppose(level, measured, line.setpoint().at_q4)
        {
            return opposed;
        }
        // `level` if it is negative, otherwise 0.
        let negative = level & (level >> 31);
        let full = self.full;
        (level, levels([full + negative, full - (level - negative)]))
    }

    /// Returns the pulses for a level against the current, and the level achieved; `None` if the
    /// supply has to drive that level.
    #[inline(never)]
    fn oppose(&self, level: i32, measured: i32, setpoint: i32) -> Option<(i32, Levels)> {
        let opposes = (level > 0 && measured < -NO_SIGN) || (level < 0 && measured > NO_SIGN);
        // The setpoint is on the other side of zero: only the supply can drive the current there.
        let crosses = (level > 0 && setpoint > 0) || (level < 0 && setpoint < 0);
        if !opposes || crosses {
            return None;
        }
        let full = self.full;
        Some(match self.decay {
            Decay::Slow => (0, levels([full, full])),
            Decay::Fast => {
                let high = full - ((level.abs() * self.coast_q8) >> 8);
                (level, levels([high, high]))
            }
        })
    }
}

/// Converts two values between 0 and the full level; the full level fits in 16 bits.
#[inline]
const fn levels([in1, in2]: [i32; 2]) -> Levels {
    Levels {
        in1: in1 as u16,
        in2: in2 as u16,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FAST: Shaper = Shaper {
        full: 960,
        decay: Decay::Fast,
        coast_q8: 230,
    };

    fn shape(shaper: &Shaper, level: i32, measured: i32, setpoint: i32) -> (i32, Levels) {
        let mut line = FixedPointLine::default();
        line.go(setpoint, 0);
        shaper.shape(level, measured, &line)
    }

    fn levels(in1: u16, in2: u16) -> Levels {
        Levels { in1, in2 }
    }

    #[test]
    fn a_voltage_along_the_current_drives_and_shorts() {
        assert_eq!(shape(&FAST, 100, 500, 500), (100, levels(960, 860)));
        assert_eq!(shape(&FAST, -100, -500, -500), (-100, levels(860, 960)));
        assert_eq!(shape(&FAST, 0, 500, 500), (0, levels(960, 960)));
    }

    #[test]
    fn a_voltage_against_it_coasts_or_shorts() {
        // Both inputs are low for 100 * 230 / 256 = 89 of 960 levels.
        assert_eq!(shape(&FAST, -100, 500, 100), (-100, levels(871, 871)));
        assert_eq!(shape(&FAST, 100, -500, 0), (100, levels(871, 871)));
        let slow = Shaper {
            decay: Decay::Slow,
            ..FAST
        };
        assert_eq!(shape(&slow, -100, 500, 100), (0, levels(960, 960)));
    }

    #[test]
    fn the_way_through_zero_is_driven() {
        assert_eq!(shape(&FAST, -100, 500, -100), (-100, levels(860, 960)));
    }
}
