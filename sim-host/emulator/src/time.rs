//! Time of the board: converts processor cycles to picoseconds.

pub use ldc161x_sim::Time;

/// Number of bits for fractions of a picosecond.
const FRACTION_BITS: u32 = 24;

/// Virtual time, driven by the processor's clock.
///
/// A cycle need not be a whole number of picoseconds: it has 5000 at 200 MHz, but a fraction with a
/// crystal error. The fraction is carried over, so the error over a minute is below a nanosecond.
#[derive(Clone, Debug)]
pub(crate) struct Clock {
    now_ps: u64,
    fraction: u64,
    hz: f64,
    /// Length of a cycle, in 2^-24 ps.
    period: u64,
}

impl Clock {
    pub(crate) fn new(hz: f64) -> Self {
        Self {
            now_ps: 0,
            fraction: 0,
            hz,
            period: period(hz),
        }
    }

    /// Changes the frequency from now on.
    pub(crate) fn set_frequency(&mut self, hz: f64) {
        self.hz = hz;
        self.period = period(hz);
    }

    /// Frequency of the processor, Hz.
    pub(crate) fn hz(&self) -> f64 {
        self.hz
    }

    #[inline]
    pub(crate) fn now_ps(&self) -> u64 {
        self.now_ps
    }

    pub(crate) fn now(&self) -> Time {
        Time::from_ps(self.now_ps)
    }

    #[inline]
    pub(crate) fn advance(&mut self, cycles: u64) {
        let sum = self.fraction + cycles * self.period;
        self.now_ps += sum >> FRACTION_BITS;
        self.fraction = sum & ((1 << FRACTION_BITS) - 1);
    }

    /// Whole cycles from now until `until_ps` is reached.
    pub(crate) fn cycles_until(&self, until_ps: u64) -> u64 {
        let left = until_ps.saturating_sub(self.now_ps).min(1 << 38);
        ((left << FRACTION_BITS).saturating_sub(self.fraction)).div_ceil(self.period)
    }
}

fn period(hz: f64) -> u64 {
    (1e12 / hz * f64::from(1u32 << FRACTION_BITS)).round() as u64
}

/// Duration of `count` periods of a frequency, ps.
pub(crate) fn periods_ps(count: u64, hz: f64) -> u64 {
    (count as f64 * 1e12 / hz).round() as u64
}
