//! The press: the overall displacement x_0 as a function of time.

use core::f64::consts::TAU;

use ldc161x_sim::Time;

use crate::random::Stream;

/// A piecewise linear path. The displacement is zero where load and sensor just touch, cold and
/// without current; it is negative while they are apart.
///
/// ```
/// use ldc161x_sim::Time;
/// use palpate_sim::mechanics::press::Profile;
///
/// // from 0.2 mm above the sensor 1 mm down at 2 mm/s, held for 10 s, and back
/// let profile = Profile::at(-0.2e-3)
///     .then_hold(0.1)
///     .then_move(0.8e-3, 2e-3)
///     .then_hold(10.0)
///     .then_move(-0.2e-3, 2e-3);
/// assert_eq!(profile.position_m(Time::ZERO), -0.2e-3);
/// assert!((profile.position_m(Time::from_ms(350)) - 0.3e-3).abs() < 1e-12);
/// assert_eq!(profile.position_m(Time::from_ms(5_000)), 0.8e-3);
/// assert_eq!(profile.end(), Time::from_ms(11_100));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Profile {
    knots: Vec<(Time, f64)>,
}

impl Profile {
    /// A press that is at `position_m` at time zero.
    #[must_use]
    pub fn at(position_m: f64) -> Self {
        Self {
            knots: vec![(Time::ZERO, position_m)],
        }
    }

    fn last(&self) -> (Time, f64) {
        self.knots.last().copied().unwrap_or((Time::ZERO, 0.0))
    }

    /// Stays for `duration_s`.
    #[must_use]
    pub fn then_hold(mut self, duration_s: f64) -> Self {
        let (time, position_m) = self.last();
        self.knots
            .push((time + Time::from_secs_f64(duration_s), position_m));
        self
    }

    /// Moves to `position_m` at `speed_m_per_s`; jumps if the speed is zero or below.
    #[must_use]
    pub fn then_move(mut self, position_m: f64, speed_m_per_s: f64) -> Self {
        let (time, from_m) = self.last();
        let duration_s = if speed_m_per_s > 0.0 {
            (position_m - from_m).abs() / speed_m_per_s
        } else {
            0.0
        };
        // A jump takes the shortest representable time.
        let duration = Time::from_secs_f64(duration_s).max(Time::from_ps(1));
        self.knots.push((time + duration, position_m));
        self
    }

    /// The path up to `time`, ready to be continued.
    #[must_use]
    pub(crate) fn until(mut self, time: Time) -> Self {
        let position_m = self.position_m(time);
        self.knots.retain(|(knot, _)| *knot < time);
        self.knots.push((time, position_m));
        self
    }

    /// End of the last piece.
    #[must_use]
    pub fn end(&self) -> Time {
        self.last().0
    }

    /// Displacement, m; constant before the first knot and after the last.
    #[must_use]
    pub fn position_m(&self, time: Time) -> f64 {
        let after = self.knots.partition_point(|(knot, _)| *knot <= time);
        let next = self.knots.get(after);
        let previous = after.checked_sub(1).and_then(|index| self.knots.get(index));
        match (previous, next) {
            (Some(&(from, from_m)), Some(&(to, to_m))) => {
                let share = (time - from).as_secs_f64() / (to - from).as_secs_f64();
                from_m + share * (to_m - from_m)
            }
            (Some(&(_, position_m)), None) | (None, Some(&(_, position_m))) => position_m,
            (None, None) => 0.0,
        }
    }

    /// The first knot after a time.
    pub(crate) fn next_knot(&self, time: Time) -> Option<Time> {
        let after = self.knots.partition_point(|(knot, _)| *knot <= time);
        self.knots.get(after).map(|(knot, _)| *knot)
    }
}

/// Jumps to and fro between two positions at random times, such as those of a layer that snaps
/// between two shapes, or of a support that slips and returns. The times between jumps are
/// exponentially distributed.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Jumps {
    /// Distance between the two positions, m, 0 to 10⁻³.
    pub size_m: f64,
    /// Mean time between jumps, s, 0.01 to 1000.
    pub interval_s: f64,
}

/// Duration of the jumps from time zero, s: longer than any press or bench run.
const JUMPING_S: f64 = 600.0;

impl Jumps {
    /// Displacement of the jumps as a path from time zero on, for a seed.
    #[must_use]
    pub fn path(&self, seed: u64) -> Profile {
        let mut path = Profile::at(0.0);
        if self.size_m <= 0.0 || self.interval_s <= 0.0 {
            return path;
        }
        let mut times = Stream::named(seed, "jumps.times");
        while path.end().as_secs_f64() < JUMPING_S {
            let wait_s = -self.interval_s * libm::log(1.0 - times.uniform());
            let (_, here_m) = path.last();
            let there_m = if here_m > 0.0 { 0.0 } else { self.size_m };
            path = path.then_hold(wait_s).then_move(there_m, 0.0);
        }
        path
    }
}

/// Sinusoidal shaking of the press, from the disturbances' `[press]`.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Shake {
    /// Amplitude, m, 0 to 10⁻³.
    pub amplitude_m: f64,
    /// Frequency, Hz, 0.1 to 200.
    pub hertz: f64,
    /// Phase at time zero, rad.
    pub phase: f64,
}

impl Shake {
    /// Displacement, m, and velocity, m/s.
    #[must_use]
    pub fn at(&self, time_s: f64) -> (f64, f64) {
        if self.amplitude_m == 0.0 {
            return (0.0, 0.0);
        }
        // Whole cycles are dropped first, which keeps the angle's precision over hours.
        let cycles = self.hertz * time_s;
        let (sin, cos) = libm::sincos(TAU * (cycles - libm::floor(cycles)) + self.phase);
        (
            self.amplitude_m * sin,
            self.amplitude_m * TAU * self.hertz * cos,
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_path_can_be_cut_and_continued() {
        let path = Profile::at(0.0).then_move(1e-3, 1e-3).then_hold(9.0);
        let cut = path.clone().until(Time::from_ms(500)).then_move(0.0, 1e-3);
        assert_eq!(
            cut.position_m(Time::from_ms(250)),
            path.position_m(Time::from_ms(250))
        );
        assert_eq!(cut.position_m(Time::from_ms(500)), 0.5e-3);
        assert!((cut.position_m(Time::from_ms(750)) - 0.25e-3).abs() < 1e-15);
        assert_eq!(cut.position_m(Time::from_ms(2_000)), 0.0);
        assert_eq!(
            cut.next_knot(Time::from_ms(500)),
            Some(Time::from_ms(1_000))
        );
        assert_eq!(cut.next_knot(Time::from_ms(1_000)), None);
    }

    #[test]
    fn senseless_speeds_jump() {
        for speed in [0.0, f64::NAN] {
            let path = Profile::at(0.0).then_move(1e-3, speed);
            assert_eq!(path.position_m(Time::from_ps(1)), 1e-3, "{speed}");
        }
    }

    #[test]
    fn a_shake_is_a_sine_with_its_slope() {
        let shake = Shake {
            amplitude_m: 5e-6,
            hertz: 8.0,
            phase: 1.0,
        };
        let (x, v) = shake.at(1000.03);
        let expected = 5e-6 * (TAU * 8.0 * 0.03 + 1.0).sin();
        assert!((x - expected).abs() < 1e-15);
        let h = 1e-6;
        let slope = (shake.at(1000.03 + h).0 - shake.at(1000.03 - h).0) / (2.0 * h);
        assert!((slope / v - 1.0).abs() < 1e-6);
    }
}
