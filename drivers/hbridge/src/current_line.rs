//! A straight line of the current, with a start time.

use crate::fault::Refusal;
use crate::limits::Limits;

/// A straight line of the coil's current: the common type of all current plans, up to the
/// [`Supervisor`](crate::Supervisor).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLine {
    /// Start time on the clock that [`Supervisor::follow`](crate::Supervisor::follow) reads, us.
    /// Until then the current changes in a straight line to `from_a`. If the time has passed
    /// already, the line starts at once from the present current.
    pub start_us: u64,
    /// Current at the start, A; the sign is the polarity.
    pub from_a: f32,
    /// Current at the end, A; it is kept until the next line.
    pub to_a: f32,
    /// Duration, s; 0 for a step.
    pub over_s: f32,
}

impl CurrentLine {
    /// Creates a line that starts at once from the present current.
    ///
    /// ```
    /// use coil_hbridge::CurrentLine;
    /// // down to 2 A in 60 ms
    /// let fall = CurrentLine::at_once(2.0, 60e-3);
    /// assert_eq!(fall.ahead_s(1_000_000), 0.0);
    /// // the same fall, but from 8 A, starting 5 ms from now
    /// let fall = CurrentLine { start_us: 1_005_000, from_a: 8.0, ..fall };
    /// assert!((fall.ahead_s(1_000_000) - 5e-3).abs() < 1e-6);
    /// ```
    #[must_use]
    pub const fn at_once(to_a: f32, over_s: f32) -> Self {
        Self {
            start_us: 0,
            from_a: to_a,
            to_a,
            over_s,
        }
    }

    /// Time until the start, s.
    #[must_use]
    pub fn ahead_s(&self, now_us: u64) -> f32 {
        self.start_us.saturating_sub(now_us) as f32 * 1e-6
    }

    /// Refuses currents and durations beyond the limits. NaN is refused too, since no range
    /// contains it.
    pub(crate) fn check(&self, limits: &Limits, now_us: u64) -> Result<(), Refusal> {
        let currents = -limits.setpoint_a..=limits.setpoint_a;
        for current_a in [self.from_a, self.to_a] {
            if !currents.contains(&current_a) {
                return Err(Refusal::Current(current_a));
            }
        }
        let durations = 0.0..=limits.on_time_s;
        for duration_s in [self.over_s, self.ahead_s(now_us) + self.over_s] {
            if !durations.contains(&duration_s) {
                return Err(Refusal::Duration(duration_s));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::limits::EXAMPLE as LIMITS;

    #[test]
    fn it_takes_numbers_within_the_limits_only() {
        let line = CurrentLine::at_once(10.0, 20.0);
        assert_eq!(line.check(&LIMITS, 0), Ok(()));
        for bad_a in [f32::NAN, f32::INFINITY, 10.1, -10.1] {
            let [to, from] = [
                CurrentLine {
                    to_a: bad_a,
                    ..line
                },
                CurrentLine {
                    from_a: bad_a,
                    ..line
                },
            ];
            for line in [to, from] {
                let refused = line.check(&LIMITS, 0);
                assert!(matches!(refused, Err(Refusal::Current(_))), "{line:?}");
            }
        }
        for bad_s in [f32::NAN, f32::INFINITY, -1e-3, 20.1] {
            let refused = CurrentLine::at_once(1.0, bad_s).check(&LIMITS, 0);
            assert!(matches!(refused, Err(Refusal::Duration(_))), "{bad_s}");
        }
    }

    #[test]
    fn the_time_until_it_begins_counts() {
        let line = CurrentLine {
            start_us: 11_000_000,
            ..CurrentLine::at_once(1.0, 19.5)
        };
        assert_eq!(line.check(&LIMITS, 10_600_000), Ok(()));
        assert_eq!(
            line.check(&LIMITS, 10_000_000),
            Err(Refusal::Duration(20.5))
        );
    }
}
