//! Simulated time in picoseconds: fine enough that rounding does not make the chip's clocks drift.

use core::fmt;
use core::ops::{Add, AddAssign, Sub};

/// A point in simulated time, or a duration, in whole picoseconds.
///
/// The largest time is 213 days. All arithmetic saturates: a time never wraps and never panics. A
/// point in time counts from the creation of the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Time(u64);

impl Time {
    /// The creation of the chip, or a duration of zero.
    pub const ZERO: Self = Self(0);
    /// The largest time of the type, later than any test runs.
    pub const MAX: Self = Self(u64::MAX);

    /// Time from picoseconds.
    #[must_use]
    pub const fn from_ps(picoseconds: u64) -> Self {
        Self(picoseconds)
    }

    /// Time from nanoseconds.
    #[must_use]
    pub const fn from_ns(nanoseconds: u64) -> Self {
        Self(nanoseconds.saturating_mul(1_000))
    }

    /// Time from microseconds.
    #[must_use]
    pub const fn from_us(microseconds: u64) -> Self {
        Self(microseconds.saturating_mul(1_000_000))
    }

    /// Time from milliseconds.
    #[must_use]
    pub const fn from_ms(milliseconds: u64) -> Self {
        Self(milliseconds.saturating_mul(1_000_000_000))
    }

    /// Time from seconds, rounded to the nearest picosecond. Negative and NaN give zero.
    #[must_use]
    pub fn from_secs_f64(seconds: f64) -> Self {
        Self(libm::round(seconds * PICOSECONDS) as u64)
    }

    /// The time in picoseconds.
    #[must_use]
    pub const fn as_ps(self) -> u64 {
        self.0
    }

    /// The time in whole nanoseconds, rounded down.
    #[must_use]
    pub const fn as_ns(self) -> u64 {
        self.0 / 1_000
    }

    /// The time in seconds.
    #[must_use]
    pub fn as_secs_f64(self) -> f64 {
        self.0 as f64 / PICOSECONDS
    }

    /// The time multiplied by a whole number.
    #[must_use]
    pub const fn times(self, factor: u64) -> Self {
        Self(self.0.saturating_mul(factor))
    }
}

impl Add for Time {
    type Output = Self;
    fn add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }
}

impl AddAssign for Time {
    fn add_assign(&mut self, other: Self) {
        *self = *self + other;
    }
}

impl Sub for Time {
    type Output = Self;
    fn sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }
}

impl fmt::Display for Time {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(formatter, "{:.9} s", self.as_secs_f64())
    }
}

const PICOSECONDS: f64 = 1e12;

/// A point in time, including a fraction of a picosecond.
///
/// A reference period is seldom a whole number of picoseconds (83 333.3… at 12 MHz). Rounding each
/// conversion would shift the following ones by up to 0.5 ps per conversion; with the fraction
/// included, only the rounding of one `f64` product remains, below 10⁻⁵ ps per conversion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Moment {
    time: Time,
    fraction: f64,
}

impl Moment {
    /// Later than any event.
    pub(crate) const NEVER: Self = Self {
        time: Time::MAX,
        fraction: 0.0,
    };

    pub(crate) const fn at(time: Time) -> Self {
        Self {
            time,
            fraction: 0.0,
        }
    }

    /// The time `seconds` later, but at least one picosecond later: every step of the model takes
    /// time, so that no setting can make it stand still. With NaN it is later than any event.
    pub(crate) fn after(self, seconds: f64) -> Self {
        let picoseconds = seconds * PICOSECONDS + self.fraction;
        if !picoseconds.is_finite() || self.time == Time::MAX {
            return Self::NEVER;
        }
        // The value is above zero: the cast rounds down and saturates.
        let whole = picoseconds.max(1.0) as u64;
        Self {
            time: self.time + Time::from_ps(whole),
            fraction: (picoseconds - whole as f64).max(0.0),
        }
    }

    /// The time rounded down to a whole picosecond.
    pub(crate) const fn time(self) -> Time {
        self.time
    }

    pub(crate) fn seconds(self) -> f64 {
        self.time.as_secs_f64() + self.fraction / PICOSECONDS
    }

    pub(crate) fn seconds_since(self, earlier: Self) -> f64 {
        let whole = (self.time - earlier.time).as_secs_f64();
        whole + (self.fraction - earlier.fraction) / PICOSECONDS
    }

    pub(crate) fn is_never(self) -> bool {
        self.time == Time::MAX
    }

    pub(crate) fn earlier_of(self, other: Self) -> Self {
        if other.time < self.time { other } else { self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ten_minutes_of_twelve_megahertz_periods_end_on_time() {
        // 600 s in steps of 24 203 periods of 12 MHz: 297 483 steps of 2016.91666… us, if added
        // exactly.
        let steps: u64 = 297_483;
        let mut moment = Moment::at(Time::ZERO);
        for _ in 0..steps {
            moment = moment.after(24_203.0 / 12e6);
        }
        // In twelfths of a microsecond, the exact total is a whole number.
        let exact_ps = u128::from(steps) * 24_203 * 1_000_000 / 12;
        let error = moment.time().as_ps().abs_diff(exact_ps as u64);
        assert!(error <= 5, "{error} ps after ten minutes");
    }

    #[test]
    fn a_step_always_takes_time_and_nothing_wraps() {
        let start = Moment::at(Time::from_ms(1));
        assert!(start.after(0.0).time() > start.time());
        assert!(start.after(-1.0).time() > start.time());
        assert!(start.after(f64::NAN).is_never());
        assert!(start.after(f64::INFINITY).is_never());
        assert!(start.after(1e30).is_never());
        assert!(Moment::NEVER.after(1.0).is_never());
        assert_eq!(Time::ZERO - Time::from_ns(1), Time::ZERO);
        assert_eq!(Time::MAX + Time::from_ns(1), Time::MAX);
    }

    #[test]
    fn units_agree() {
        assert_eq!(Time::from_ms(2), Time::from_us(2_000));
        assert_eq!(Time::from_us(2), Time::from_ns(2_000));
        assert_eq!(Time::from_secs_f64(2.5e-6), Time::from_ps(2_500_000));
        assert_eq!(Time::from_secs_f64(-1.0), Time::ZERO);
        assert_eq!(Time::from_ns(7).as_ns(), 7);
    }
}
