//! What goes to the bridge.

use crate::hardware::Decay;

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

/// What the bridge is to be told until the next period.
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
}

/// A current below this, in units, has no sign worth following.
const NO_SIGN: i32 = 8;

/// How a mean voltage becomes pulses.
///
/// - both high: the coil is shorted, its current decays slowly;
/// - one high: the supply drives;
/// - both low: the diodes drive against the current, which decays fast and stops at zero.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shaper {
    pub(crate) full: i32,
    pub(crate) decay: Decay,
    /// Supply over supply and two diodes, in 1/256.
    pub(crate) coast_q8: i32,
}

impl Shaper {
    /// Pulses for a signed level; also the level that they amount to.
    #[inline]
    pub(crate) fn shape(&self, level: i32, measured: i32, wanted: i32) -> (i32, Levels) {
        let full = self.full;
        let opposes = (level > 0 && measured < -NO_SIGN) || (level < 0 && measured > NO_SIGN);
        // The way through zero into the other direction is driven.
        let crosses = (level > 0 && wanted > 0) || (level < 0 && wanted < 0);
        let (level, [in1, in2]) = if opposes && !crosses {
            match self.decay {
                Decay::Slow => (0, [full, full]),
                Decay::Fast => {
                    let high = full - ((level.abs() * self.coast_q8) >> 8);
                    (level, [high, high])
                }
            }
        } else if level >= 0 {
            (level, [full, full - level])
        } else {
            (level, [full + level, full])
        };
        // Between 0 and `full`, which came from 16 bits.
        let levels = Levels {
            in1: in1 as u16,
            in2: in2 as u16,
        };
        (level, levels)
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

    fn levels(in1: u16, in2: u16) -> Levels {
        Levels { in1, in2 }
    }

    #[test]
    fn a_voltage_along_the_current_drives_and_shorts() {
        assert_eq!(FAST.shape(100, 500, 500), (100, levels(960, 860)));
        assert_eq!(FAST.shape(-100, -500, -500), (-100, levels(860, 960)));
        assert_eq!(FAST.shape(0, 500, 500), (0, levels(960, 960)));
    }

    #[test]
    fn a_voltage_against_it_coasts_or_shorts() {
        // 100 * 230 / 256 = 89 of 960 low on both.
        assert_eq!(FAST.shape(-100, 500, 100), (-100, levels(871, 871)));
        assert_eq!(FAST.shape(100, -500, 0), (100, levels(871, 871)));
        let slow = Shaper {
            decay: Decay::Slow,
            ..FAST
        };
        assert_eq!(slow.shape(-100, 500, 100), (0, levels(960, 960)));
    }

    #[test]
    fn the_way_through_zero_is_driven() {
        assert_eq!(FAST.shape(-100, 500, -100), (-100, levels(860, 960)));
    }
}
