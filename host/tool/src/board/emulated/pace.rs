//! Virtual time at the pace of real time.

use std::time::{Duration, Instant};

use palpate_sim::Time;

/// Lag of virtual behind real time above which a warning follows. A PC's own pauses are shorter.
const BEHIND: Duration = Duration::from_secs(1);

/// Synchronisation of virtual with real time.
pub(crate) struct Pace {
    /// Real time at virtual time zero, shifted by all lags.
    began: Instant,
    /// Real time lost so far by lags beyond [`BEHIND`].
    lost: Duration,
    warned: bool,
}

impl Pace {
    pub(crate) fn new() -> Self {
        Self {
            began: Instant::now(),
            lost: Duration::ZERO,
            warned: false,
        }
    }

    /// Returns the lead of virtual over real time. Does not catch up after a lag, since the board
    /// would then run too fast.
    pub(crate) fn ahead(&mut self, now: Time) -> Duration {
        self.ahead_at(Instant::now(), now)
    }

    fn ahead_at(&mut self, real: Instant, now: Time) -> Duration {
        let due = self.began + Duration::from_secs_f64(now.as_secs_f64());
        let behind = real.saturating_duration_since(due);
        if behind > BEHIND {
            self.lost += behind;
            self.began += behind;
        }
        due.saturating_duration_since(real)
    }

    /// Returns a warning, once, if the emulation is slower than real time.
    pub(crate) fn warning(&mut self) -> Option<String> {
        if self.warned || self.lost.is_zero() {
            return None;
        }
        self.warned = true;
        Some(
            "palpate: this computer emulates the board slower than real time: its clock lags; build \
             with --release, or give it a core of its own"
                .to_owned(),
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_lost_is_not_caught_up() {
        let mut pace = Pace::new();
        let at = |ms: u64| pace.began + Duration::from_millis(ms);
        let (early, late, later) = (at(10), at(5_000), at(5_010));
        assert_eq!(
            pace.ahead_at(early, Time::from_ms(30)),
            Duration::from_millis(20)
        );
        assert_eq!(pace.warning(), None);
        assert_eq!(pace.ahead_at(late, Time::from_ms(100)), Duration::ZERO);
        assert!(pace.warning().is_some() && pace.warning().is_none());
        let ahead = pace.ahead_at(later, Time::from_ms(130));
        assert_eq!(ahead, Duration::from_millis(20));
    }
}
