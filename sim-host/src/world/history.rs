//! Recent frequency and current, which the converter reads.

use std::collections::VecDeque;

use ldc161x_sim::Time;

/// Time span of the history, s: longer than the longest conversion, 16 · 65 535 periods of a
/// reference of 2 MHz.
const KEPT: Time = Time::from_ms(600);

/// Frequency and current over one step.
#[derive(Clone, Copy, Debug)]
pub(super) struct HistorySegment {
    start: Time,
    end: Time,
    start_s: f64,
    duration_s: f64,
    /// Coefficients of the cubic that gives the frequency, Hz, for an elapsed share of the step.
    frequency: [f64; 4],
    current_a: (f64, f64),
}

impl HistorySegment {
    /// A cubic through frequency, Hz, and rate, Hz/s, at both ends (Hermite), and a linear current.
    pub(super) fn new(
        (start, end): (Time, Time),
        current_a: (f64, f64),
        first: (f64, f64),
        last: (f64, f64),
    ) -> Self {
        let duration_s = (end - start).as_secs_f64();
        let (rate_0, rate_1) = (first.1 * duration_s, last.1 * duration_s);
        let rise = last.0 - first.0;
        Self {
            start,
            end,
            start_s: start.as_secs_f64(),
            duration_s,
            frequency: [
                first.0,
                rate_0,
                3.0 * rise - 2.0 * rate_0 - rate_1,
                rate_0 + rate_1 - 2.0 * rise,
            ],
            current_a,
        }
    }

    fn frequency_hz(&self, time_s: f64) -> f64 {
        let share = ((time_s - self.start_s) / self.duration_s).clamp(0.0, 1.0);
        let [c0, c1, c2, c3] = self.frequency;
        c0 + share * (c1 + share * (c2 + share * c3))
    }

    /// Integral of the current over the part of the step between two times, A s.
    fn charge(&self, from: Time, to: Time) -> f64 {
        let (from, to) = (from.max(self.start), to.min(self.end));
        if to <= from {
            return 0.0;
        }
        let at = |time: Time| {
            let share = (time - self.start).as_secs_f64() / self.duration_s;
            self.current_a.0 + share * (self.current_a.1 - self.current_a.0)
        };
        0.5 * (at(from) + at(to)) * (to - from).as_secs_f64()
    }
}

/// Consecutive segments without gaps.
#[derive(Clone, Debug, Default)]
pub(super) struct History {
    segments: VecDeque<HistorySegment>,
}

impl History {
    pub(super) fn push(&mut self, segment: HistorySegment) {
        self.segments.push_back(segment);
    }

    /// Drops all segments that start at `time` or later.
    pub(super) fn rewind(&mut self, time: Time) {
        while self.segments.back().is_some_and(|last| last.start >= time) {
            self.segments.pop_back();
        }
    }

    /// Drops segments that are too old to be read.
    pub(super) fn forget_before(&mut self, now: Time) {
        while self
            .segments
            .front()
            .is_some_and(|first| first.end + KEPT < now)
        {
            self.segments.pop_front();
        }
    }

    /// Frequency at a time, Hz; `None` after the last segment. Times before the first segment
    /// return the oldest known frequency.
    pub(super) fn frequency_hz(&self, time_s: f64) -> Option<f64> {
        let last = self.segments.back()?;
        if time_s > last.end.as_secs_f64() {
            return None;
        }
        // A query is nearly always for the last few steps.
        let recent = self.segments.iter().rev();
        let found = recent.take(8).find(|segment| segment.start_s <= time_s);
        let segment = found.or_else(|| {
            let after = self
                .segments
                .partition_point(|segment| segment.start_s <= time_s);
            self.segments.get(after.saturating_sub(1))
        })?;
        Some(segment.frequency_hz(time_s))
    }

    /// Mean current between two times, A; `None` for an empty interval.
    pub(super) fn mean_current_a(&self, from: Time, to: Time) -> Option<f64> {
        let first = self.segments.front()?;
        let last = self.segments.back()?;
        let (from, to) = (from.max(first.start), to.min(last.end));
        if to <= from {
            return None;
        }
        let after = self.segments.partition_point(|segment| segment.end <= from);
        let charge: f64 = self
            .segments
            .iter()
            .skip(after)
            .take_while(|segment| segment.start < to)
            .map(|segment| segment.charge(from, to))
            .sum();
        Some(charge / (to - from).as_secs_f64())
    }
}
