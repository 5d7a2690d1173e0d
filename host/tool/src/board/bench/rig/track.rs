//! Readings of a gauge by the board's clock.

use std::collections::VecDeque;

/// Readings of a gauge in order of time.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    /// Board time, s, and value.
    readings: Vec<(f64, f64)>,
    clock: GaugeClock,
}

/// Longest time between two readings for which values between them are interpolated, s: a slow
/// amplifier sends ten readings a second.
const LONGEST_S: f64 = 0.25;

impl Track {
    /// Adds a reading that arrived at `now_s`, with the gauge's own time if it has one, both s.
    pub(super) fn enter(&mut self, now_s: f64, own_s: Option<f64>, value: f64) {
        let time_s = match own_s {
            Some(own_s) => self.clock.board_s(now_s, own_s),
            None => now_s,
        };
        // Two readings in one packet have equal times and stay in order.
        let after = self.readings.partition_point(|(at_s, _)| *at_s <= time_s);
        self.readings.insert(after, (time_s, value));
    }

    /// Returns the value at a time, s, interpolated between two readings; `None` where one is
    /// missing.
    pub(super) fn at(&self, time_s: f64) -> Option<f64> {
        let later = self.readings.partition_point(|(at_s, _)| *at_s < time_s);
        let (to_s, to) = *self.readings.get(later)?;
        if to_s == time_s {
            return Some(to);
        }
        let (from_s, from) = *self.readings.get(later.checked_sub(1)?)?;
        let part = (time_s - from_s) / (to_s - from_s);
        (to_s - from_s <= LONGEST_S).then_some(from + part * (to - from))
    }

    /// Returns time, s, and value of the last reading.
    pub(super) fn last(&self) -> Option<(f64, f64)> {
        self.readings.last().copied()
    }

    /// Returns the mean of the readings since a time, s.
    pub(super) fn mean_since(&self, from_s: f64) -> Option<f64> {
        let since = self.readings.iter().filter(|(at_s, _)| *at_s >= from_s);
        let (sum, count) = since.fold((0.0, 0.0), |(sum, count), (_, value)| {
            (sum + value, count + 1.0)
        });
        (count > 0.0).then(|| sum / count)
    }

    /// Removes all readings, since the board's clock may change.
    pub(super) fn clear(&mut self) {
        *self = Self::default();
    }
}

/// Offset of a gauge's own clock from the board's: a median, since most lines arrive with about
/// equal delay after their time stamp, but some much later when the computer was busy.
#[derive(Clone, Debug, Default)]
struct GaugeClock {
    /// Board time at arrival less the gauge's time, s, of the last readings.
    offsets_s: VecDeque<f64>,
}

impl GaugeClock {
    /// Number of readings whose offsets are kept for the median.
    const KEPT: usize = 101;

    fn board_s(&mut self, now_s: f64, own_s: f64) -> f64 {
        self.offsets_s.push_back(now_s - own_s);
        if self.offsets_s.len() > Self::KEPT {
            self.offsets_s.pop_front();
        }
        let mut sorted: Vec<f64> = self.offsets_s.iter().copied().collect();
        sorted.sort_by(f64::total_cmp);
        own_s + sorted.get(sorted.len() / 2).copied().unwrap_or_default()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn between_two_readings_there_is_a_straight_line_and_beyond_them_nothing() {
        let mut track = Track::default();
        for (time_s, value) in [(1.0, 1.0), (1.1, 3.0), (2.0, 4.0)] {
            track.enter(time_s, None, value);
        }
        assert!((track.at(1.05).unwrap() - 2.0).abs() < 1e-9);
        assert_eq!(track.at(1.1), Some(3.0));
        assert_eq!(track.at(0.9), None);
        assert_eq!(track.at(2.1), None);
        // Between 1.1 s and 2 s the gauge sent no reading for longer than `LONGEST_S`.
        assert_eq!(track.at(1.5), None);
    }

    #[test]
    fn a_line_that_comes_late_keeps_the_time_of_its_stamp() {
        let mut track = Track::default();
        for step in 0..50 {
            let own_s = f64::from(step) * 0.01;
            // One reading in ten arrives 80 ms late.
            let late_s = if step % 10 == 9 { 0.08 } else { 0.001 };
            track.enter(100.0 + own_s + late_s, Some(own_s), own_s);
        }
        for step in 20..45 {
            let own_s = f64::from(step) * 0.01;
            let value = track.at(100.001 + own_s).unwrap();
            assert!((value - own_s).abs() < 1e-9, "{value} {own_s}");
        }
    }
}
