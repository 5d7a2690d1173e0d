//! The train of falling ramps: when the current goes where.
//!
//! Every ramp begins with a rise to the peak and a hold there, so that all of them start from the
//! same magnetic state, and lag and memory of the elastomer are the same on all. Only the falls
//! are evaluated: a rising current stiffens less, by the elastomer's memory.

use palpate_model::units::Ampere;
use palpate_wire::command::Settings;

use crate::time::{Duration, Instant, after, between, in_seconds, span};

/// The course that the current is to take.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Course {
    pub(crate) peak: Ampere,
    pub(crate) end: Ampere,
    pub(crate) rise: Duration,
    pub(crate) hold: Duration,
    pub(crate) fall: Duration,
    pub(crate) ramps: u8,
    /// Half the time from one conversion to the next.
    half_conversion: Duration,
}

impl Course {
    pub(crate) fn new(settings: &Settings) -> Self {
        Self {
            peak: Ampere(settings.peak_current_a),
            end: Ampere(settings.end_current_a),
            rise: span(settings.rise_s),
            hold: span(settings.hold_s),
            fall: span(settings.ramp_s),
            ramps: settings.ramps,
            half_conversion: span(0.5 / settings.rate_hz),
        }
    }

    /// From one ramp to the next.
    pub(crate) fn period(&self) -> Duration {
        let ticks = self.rise.as_ticks() + self.hold.as_ticks() + self.fall.as_ticks();
        Duration::from_ticks(ticks)
    }

    /// Time with current in all, the way down at its end included.
    pub(crate) fn duration(&self) -> Duration {
        let ramps = self.period().as_ticks() * u64::from(self.ramps);
        Duration::from_ticks(ramps + self.rise.as_ticks())
    }

    /// Mean square of the current over the train, in A^2.
    pub(crate) fn mean_square_a2(&self) -> f32 {
        let (peak, end) = (self.peak.0, self.end.0);
        // Of a straight line between two currents: (a^2 + a b + b^2)/3. The first rise and the
        // last way down are from and to zero, and are counted as the others.
        let line = (peak * peak + peak * end + end * end) / 3.0;
        let seconds = |span: Duration| in_seconds(span).0;
        let squares =
            (seconds(self.rise) + seconds(self.fall)) * line + seconds(self.hold) * peak * peak;
        squares / seconds(self.period()).max(1e-6)
    }
}

/// Where on its course the train is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Leg {
    Rise,
    Hold,
    Fall,
    /// The way to zero after the last ramp.
    Down,
    Done,
}

/// The train under way.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Train {
    course: Course,
    leg: Leg,
    /// When the leg began.
    since: Instant,
    /// Ramps that have been completed.
    completed: u8,
}

/// A current to be set.
pub(crate) type Line = (Ampere, Duration);

impl Train {
    /// Begins with the first rise.
    pub(crate) fn start(course: Course, now: Instant) -> (Self, Line) {
        let train = Self {
            course,
            leg: Leg::Rise,
            since: now,
            completed: 0,
        };
        (train, (course.peak, course.rise))
    }

    pub(crate) const fn course(&self) -> &Course {
        &self.course
    }

    pub(crate) const fn leg(&self) -> Leg {
        self.leg
    }

    pub(crate) const fn completed(&self) -> u8 {
        self.completed
    }

    fn lasts(&self) -> Duration {
        match self.leg {
            Leg::Rise | Leg::Down => self.course.rise,
            Leg::Hold => self.course.hold,
            Leg::Fall => self.course.fall,
            Leg::Done => Duration::from_ticks(0),
        }
    }

    fn ends(&self) -> Instant {
        after(self.since, self.lasts())
    }

    /// How much earlier than planned the leg under way may end. What rises to the peak, and what
    /// goes down to zero, gets there.
    fn early(&self) -> Duration {
        let is_last = self.completed.saturating_add(1) >= self.course.ramps;
        match self.leg {
            Leg::Hold => self.course.half_conversion.min(self.lasts()),
            Leg::Fall if !is_last => self.course.half_conversion.min(self.lasts()),
            _ => Duration::from_ticks(0),
        }
    }

    /// Goes on to the next leg with the conversion that is nearest to the end of the one under way,
    /// and tells the current to set.
    ///
    /// Conversions then lie at the same places on every fall, whatever else happens meanwhile, and
    /// what lags behind the current does so alike on all. The first one at or after the end would
    /// be a conversion later or not by the accident of its last microsecond, as 10 conversions of
    /// 0.9993 ms are just less than 10 ms.
    pub(crate) fn advance(&mut self, now: Instant) -> Option<Line> {
        let ends = self.ends();
        if self.leg == Leg::Done || after(now, self.early()) < ends {
            return None;
        }
        let Course {
            peak,
            end,
            rise,
            fall,
            ramps,
            ..
        } = self.course;
        let (leg, line) = match self.leg {
            Leg::Rise => {
                // Nothing is set here, so the hold begins when the rise has ended.
                (self.leg, self.since) = (Leg::Hold, ends);
                return None;
            }
            Leg::Hold => (Leg::Fall, Some((end, fall))),
            Leg::Fall => {
                self.completed = self.completed.saturating_add(1);
                if self.completed < ramps {
                    (Leg::Rise, Some((peak, rise)))
                } else {
                    (Leg::Down, Some((Ampere(0.0), rise)))
                }
            }
            Leg::Down | Leg::Done => (Leg::Done, None),
        };
        self.leg = leg;
        self.since = now;
        line
    }

    /// Whether a conversion lay within the fall under way as a whole.
    pub(crate) fn falls_through(&self, middle: Instant, window: Duration) -> bool {
        let half = Duration::from_ticks(window.as_ticks() / 2);
        self.leg == Leg::Fall
            && between(self.since, middle) >= half
            && after(middle, half) <= self.ends()
    }

    /// Whether the leg under way had begun at a moment.
    pub(crate) fn has_begun(&self, at: Instant) -> bool {
        at >= self.since
    }

    /// The current that was wanted at a moment of the leg under way; `None` before it.
    pub(crate) fn wanted(&self, at: Instant) -> Option<Ampere> {
        if !self.has_begun(at) {
            return None;
        }
        let part = |lasts: Duration| {
            let lasts = in_seconds(lasts).0;
            let gone = in_seconds(between(self.since, at)).0;
            if gone < lasts { gone / lasts } else { 1.0 }
        };
        let Course {
            peak,
            end,
            rise,
            fall,
            ..
        } = self.course;
        Some(match self.leg {
            Leg::Rise => {
                let from = if self.completed == 0 {
                    Ampere(0.0)
                } else {
                    end
                };
                from + (peak - from) * part(rise)
            }
            Leg::Hold => peak,
            Leg::Fall => peak + (end - peak) * part(fall),
            Leg::Down => end * (1.0 - part(rise)),
            Leg::Done => Ampere(0.0),
        })
    }
}
