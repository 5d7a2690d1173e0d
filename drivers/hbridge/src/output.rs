//! What goes to the bridge.

use crate::hardware::Decay;
use crate::line::FixedPointLine;

/// Compare values of the PWM's two outputs: how much of a period each is high. The pulses are
/// centred on the count's zero, where samples of a phase-correct PWM are taken.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Levels {
    /// Of IN1.
    pub in1: u16,
    /// Of IN2.
    pub in2: u16,
}

/// The bridge's inputs until the next period.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Output {
    /// Level of nSLEEP. When it is low both inputs have to be low as well.
    pub awake: bool,
    /// From the next period on.
    pub levels: Levels,
    /// The hardware's limit is to be reduced, where it can be (self-test only).
    pub limit_low: bool,
}

impl Output {
    /// Everything off: the current dies through the diodes.
    pub const OFF: Self = Self {
        awake: false,
        levels: Levels { in1: 0, in2: 0 },
        limit_low: false,
    };

    /// Awake, without voltage yet.
    pub(crate) const WAKING: Self = Self {
        awake: true,
        ..Self::OFF
    };
}

/// A current below this, in units, has no sign worth following.
const NO_SIGN: i32 = 8;

/// How a mean voltage becomes pulses.
///
/// - both high: the coil is shorted, its current decays slowly;
/// - one high: the supply drives;
/// - both low: the diodes drive against the current, which decays fast and stops at zero.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(crate) struct Shaper {
    pub(crate) full: i32,
    /// Supply over supply and two diodes, in 1/256.
    pub(crate) coast_q8: i32,
    pub(crate) decay: Decay,
}

impl Shaper {
    /// Pulses for a signed level; also the level that they amount to.
    #[inline]
    pub(crate) fn shape(&self, level: i32, measured: i32, line: &FixedPointLine) -> (i32, Levels) {
        // Signs that differ.
        if level ^ measured < 0
            && let Some(opposed) = self.oppose(level, measured, line.setpoint().at_q4)
        {
            return opposed;
        }
        // The level where it is negative, otherwise 0.
        let negative = level & (level >> 31);
        let full = self.full;
        (level, levels([full + negative, full - (level - negative)]))
    }

    /// The same for a level against the current, if it is one that is not driven.
    #[inline(never)]
    fn oppose(&self, level: i32, measured: i32, setpoint: i32) -> Option<(i32, Levels)> {
        let opposes = (level > 0 && measured < -NO_SIGN) || (level < 0 && measured > NO_SIGN);
        // The way through zero into the other direction is driven.
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

/// Between 0 and the full level, which came from 16 bits.
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
        // 100 * 230 / 256 = 89 of 960 low on both.
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
