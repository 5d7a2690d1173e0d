//! Device time on this computer's clock, with its uncertainty.
//!
//! A question leaves before the device answers it, and the answer arrives after its time stamp. So the
//! offset between the clocks lies between two limits, and the overlap of all exchanges narrows it, as in
//! NTP (RFC 5905, section 8). ROS 2 stamps with the system's clock, so the exchanges are timed by that.

/// Largest relative drift between the two clocks: 500 ppm by which Linux slews the system's clock when it
/// follows a time server, and 100 ppm for two crystals.
const DRIFT: f64 = 600e-6;
/// Rate at which stamps follow a better offset: slow enough that the stamps of consecutive records keep
/// their order.
const SLEW: f64 = 0.05;
/// Change of the offset that is applied at once, ns: the system's clock was set.
const STEP_NS: i64 = 20_000_000;

/// Offset of the computer's clock from a device's, within one boot of the device.
#[derive(Clone, Debug, Default)]
pub struct Clock {
    known: Option<Known>,
}

/// All in ns, as integers: a double has steps of 256 ns at the present time.
#[derive(Clone, Debug)]
struct Known {
    boot_id: u32,
    /// Limits of the offset.
    low_ns: i64,
    high_ns: i64,
    /// Device time of the last exchange.
    at_ns: i64,
    /// Offset that the last stamp used, and its device time.
    applied_ns: i64,
    applied_at_ns: i64,
}

impl Known {
    fn middle_ns(&self) -> i64 {
        self.low_ns + (self.high_ns - self.low_ns) / 2
    }

    /// Growth of the uncertainty since the last exchange.
    fn drift_ns(&self, device_ns: i64) -> i64 {
        (DRIFT * device_ns.abs_diff(self.at_ns) as f64) as i64
    }
}

impl Clock {
    /// Takes an exchange: computer time of question and of answer, ns since 1970, and device time of the
    /// answer, us.
    pub fn exchange(&mut self, boot_id: u32, asked_ns: i64, device_us: u64, answered_ns: i64) {
        let at_ns = nanoseconds(device_us);
        let (mut low_ns, mut high_ns) = (asked_ns - at_ns, answered_ns - at_ns);
        let middle_ns = low_ns + (high_ns - low_ns) / 2;
        let before = self.known.take().filter(|of| of.boot_id == boot_id);
        let applied = before.as_ref().map(|of| (of.applied_ns, of.applied_at_ns));
        if let Some(before) = before {
            let drift_ns = before.drift_ns(at_ns);
            let low = low_ns.max(before.low_ns - drift_ns);
            let high = high_ns.min(before.high_ns + drift_ns);
            // If the limits contradict each other, a clock was set, and the new ones hold.
            if low <= high {
                (low_ns, high_ns) = (low, high);
            }
        }
        let (applied_ns, applied_at_ns) = applied.unwrap_or((middle_ns, at_ns));
        self.known = Some(Known {
            boot_id,
            low_ns,
            high_ns,
            at_ns,
            applied_ns,
            applied_at_ns,
        });
    }

    /// Takes the first record of a recording's boot, which is played at this time.
    pub fn play(&mut self, boot_id: u32, device_us: u64, now_ns: i64) {
        if !self.knows(boot_id) {
            self.exchange(boot_id, now_ns, device_us, now_ns);
        }
    }

    /// Whether a stamp is possible for this boot.
    pub fn knows(&self, boot_id: u32) -> bool {
        self.known.as_ref().is_some_and(|of| of.boot_id == boot_id)
    }

    /// Computer time of a device time, ns since 1970; `None` before the first exchange of this boot.
    pub fn stamp_ns(&mut self, boot_id: u32, device_us: u64) -> Option<i64> {
        let known = self.known.as_mut().filter(|of| of.boot_id == boot_id)?;
        let at_ns = nanoseconds(device_us);
        let wrong_ns = known.middle_ns() - known.applied_ns;
        if wrong_ns.abs() > STEP_NS {
            known.applied_ns += wrong_ns;
        } else {
            let passed_ns = (at_ns - known.applied_at_ns).max(0);
            let most_ns = (SLEW * passed_ns as f64) as i64;
            known.applied_ns += wrong_ns.clamp(-most_ns, most_ns);
        }
        known.applied_at_ns = known.applied_at_ns.max(at_ns);
        Some(at_ns + known.applied_ns)
    }

    /// Largest error of a stamp at this device time, s.
    pub fn within_s(&self, device_us: u64) -> Option<f64> {
        self.known.as_ref().map(|known| {
            let half_ns = (known.high_ns - known.low_ns) / 2;
            let behind_ns = (known.middle_ns() - known.applied_ns).abs();
            1e-9 * (half_ns + behind_ns + known.drift_ns(nanoseconds(device_us))) as f64
        })
    }
}

fn nanoseconds(device_us: u64) -> i64 {
    i64::try_from(device_us.saturating_mul(1000)).unwrap_or(i64::MAX)
}

#[cfg(test)]
mod tests {
    use super::*;

    const START_NS: i64 = 1_700_000_000_000_000_000;

    /// The device's clock is 100 ppm fast. Exchanges take 1 ms to 20 ms, and the answer is stamped
    /// anywhere within them, as over a bad link.
    #[test]
    fn stamps_lie_within_their_uncertainty_and_in_order() {
        let mut clock = Clock::default();
        let mut before_ns = i64::MIN;
        let mut random = 7_u64;
        let mut uniform = || {
            random = random
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (random >> 33) as f64 / f64::from(1_u32 << 31)
        };
        let device_us = |true_ns: i64| ((true_ns - START_NS) as f64 * 1.000_1e-3) as u64;
        let mut worst_s = 0_f64;
        for ms in 0..60_000_i64 {
            let now_ns = START_NS + ms * 1_000_000;
            if ms % 1000 == 0 {
                let length_ns = 1e6 + 19e6 * uniform();
                let asked_ns = now_ns - (length_ns * uniform()) as i64;
                clock.exchange(3, asked_ns, device_us(now_ns), asked_ns + length_ns as i64);
            }
            let stamp_ns = clock.stamp_ns(3, device_us(now_ns)).unwrap();
            let within_s = clock.within_s(device_us(now_ns)).unwrap();
            let error_s = (stamp_ns - now_ns) as f64 * 1e-9;
            assert!(
                error_s.abs() <= within_s + 2e-6,
                "{ms}: {error_s} {within_s}"
            );
            assert!(stamp_ns > before_ns, "{ms}");
            before_ns = stamp_ns;
            if ms > 10_000 {
                worst_s = worst_s.max(within_s);
            }
        }
        assert!(worst_s < 10e-3, "{worst_s}");
    }

    #[test]
    fn a_restart_begins_anew() {
        let mut clock = Clock::default();
        clock.exchange(3, START_NS, 5_000_000, START_NS + 1_000_000);
        assert!(clock.stamp_ns(4, 0).is_none());
        clock.exchange(4, START_NS + 9_000_000, 100, START_NS + 9_000_000);
        let stamp_ns = clock.stamp_ns(4, 100).unwrap();
        assert_eq!(stamp_ns, START_NS + 9_000_000);
    }

    #[test]
    fn a_system_clock_that_is_set_is_followed_at_once() {
        let mut clock = Clock::default();
        clock.exchange(3, START_NS, 0, START_NS + 1_000_000);
        let hour_ns = 3_600_000_000_000;
        clock.exchange(
            3,
            START_NS + hour_ns,
            1_000_000,
            START_NS + hour_ns + 1_000_000,
        );
        let stamp_ns = clock.stamp_ns(3, 1_000_000).unwrap();
        assert_eq!(stamp_ns, START_NS + hour_ns + 500_000);
    }
}
