//! The device's clock relative to this computer's.
//!
//! A command leaves before the device answers it, and a record arrives after its time stamp, so
//! each answer lies between two times of this computer's clock. The shortest round trip gives the
//! best offset, as in NTP (RFC 5905, section 8).

use std::time::Duration;

/// Largest relative drift between the clocks of device and computer: two crystals of 30 ppm each,
/// and the effect of temperature on both.
const DRIFT: f64 = 100e-6;

/// Offset of the device's clock from this computer's, within one boot of the device.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct DeviceClock {
    boot_id: u32,
    offset: Option<Offset>,
}

/// Offset by the best exchange so far.
#[derive(Clone, Copy, Debug)]
struct Offset {
    /// Time of the computer's clock less time of the device's clock, s.
    offset_s: f64,
    /// Uncertainty of `offset_s`, s.
    within_s: f64,
    /// Computer time of the exchange, s.
    at_s: f64,
}

impl DeviceClock {
    /// Adds an exchange: send time of the command, time stamp of the answer, arrival time of the
    /// answer.
    pub(super) fn enter(&mut self, boot_id: u32, left: Duration, stamp_us: u64, came: Duration) {
        if boot_id != self.boot_id {
            *self = Self {
                boot_id,
                offset: None,
            };
        }
        let (left_s, came_s) = (left.as_secs_f64(), came.as_secs_f64());
        let found = Offset {
            offset_s: 0.5 * (left_s + came_s) - stamp_us as f64 * 1e-6,
            within_s: 0.5 * (came_s - left_s),
            at_s: came_s,
        };
        let is_better = self
            .offset
            .is_none_or(|before| found.within_s < before.within_s + DRIFT * (came_s - before.at_s));
        if is_better {
            self.offset = Some(found);
        }
    }

    /// Boot of this clock; 0 before the first answer.
    pub(crate) const fn boot_id(&self) -> u32 {
        self.boot_id
    }

    /// Time of the computer's clock less time of the device's clock, and the uncertainty of this
    /// offset, both s. `None` before the first answer.
    pub(crate) fn offset_s(&self) -> Option<(f64, f64)> {
        self.offset.map(|of| (of.offset_s, of.within_s))
    }

    /// Device time at a computer time, s.
    pub(crate) fn device_s(&self, at: Duration) -> Option<f64> {
        self.offset.map(|of| at.as_secs_f64() - of.offset_s)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_shortest_way_there_and_back_counts() {
        let ms = Duration::from_millis;
        let mut clock = DeviceClock::default();
        assert!(clock.device_s(ms(1)).is_none());
        clock.enter(7, ms(1_000), 500_000, ms(1_010));
        clock.enter(7, ms(1_020), 520_900, ms(1_022));
        clock.enter(7, ms(1_030), 521_000, ms(1_060));
        let (offset_s, within_s) = clock.offset_s().unwrap();
        assert!((offset_s - 0.500_1).abs() < 1e-9 && (within_s - 1e-3).abs() < 1e-9);
        assert!((clock.device_s(ms(2_000)).unwrap() - 1.499_9).abs() < 1e-9);
    }

    #[test]
    fn after_a_start_the_clock_is_another() {
        let ms = Duration::from_millis;
        let mut clock = DeviceClock::default();
        clock.enter(7, ms(1_000), 500_000, ms(1_001));
        clock.enter(8, ms(2_000), 1_000, ms(2_100));
        assert!(clock.device_s(ms(2_050)).unwrap() < 0.01);
    }

    #[test]
    fn an_old_exchange_gives_way_to_a_longer_one() {
        let ms = Duration::from_millis;
        let mut clock = DeviceClock::default();
        clock.enter(7, ms(1_000), 500_000, ms(1_001));
        // In twenty seconds the clocks may drift apart by 2 ms, so the longer exchange counts.
        clock.enter(7, ms(21_000), 20_501_800, ms(21_002));
        assert!((clock.offset_s().unwrap().0 - 0.499_2).abs() < 1e-9);
    }
}
