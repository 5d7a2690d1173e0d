//! Train of falling ramps: times and currents of its segments.
//!
//! Every ramp starts with a rise to the peak and a hold there. So all ramps start from the same magnetic
//! state, with the same lag and memory of the elastomer. Only the falls are evaluated: a rising current
//! stiffens less, because of the elastomer's memory.

use coil_hbridge::CurrentLine;
use palpate_model::units::Ampere;
use palpate_wire::command::Settings;

use crate::time::{Duration, Instant, after, between, in_seconds, span};

/// Current profile of a train.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct TrainProfile {
    pub(crate) peak: Ampere,
    pub(crate) end: Ampere,
    pub(crate) rise: Duration,
    pub(crate) hold: Duration,
    pub(crate) fall: Duration,
    pub(crate) ramps: u8,
    /// Half the time from one conversion to the next.
    half_conversion: Duration,
}

impl TrainProfile {
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

    /// Returns the profile with the longest segments that can occur without lost conversions. Hold and
    /// fall end with the conversion nearest to their planned end. A hold starts independently of the
    /// conversions. It ends only after one conversion has detected the end of the rise, and another has
    /// sent the fall [ahead](LEAD).
    pub(crate) fn longest(&self) -> Self {
        let half = self.half_conversion.as_ticks();
        let whole = (2 * half).max(1);
        let ahead = LEAD.as_ticks().div_ceil(whole) * whole;
        let longer =
            |span: Duration, least: u64| Duration::from_ticks((span.as_ticks() + half).max(least));
        Self {
            hold: longer(self.hold, 2 * whole + ahead),
            fall: longer(self.fall, whole),
            ..*self
        }
    }

    /// Returns the lines of current from rest, each with its final current and its duration.
    pub(crate) fn lines(&self) -> impl Iterator<Item = (Ampere, Duration)> + '_ {
        let ramp = [
            (self.peak, self.rise),
            (self.peak, self.hold),
            (self.end, self.fall),
        ];
        let ramps = core::iter::repeat_n(ramp, self.ramps.into()).flatten();
        ramps.chain([(Ampere(0.0), self.rise)])
    }

    /// Returns the time from one ramp to the next.
    pub(crate) fn period(&self) -> Duration {
        let ticks = self.rise.as_ticks() + self.hold.as_ticks() + self.fall.as_ticks();
        Duration::from_ticks(ticks)
    }

    /// Returns the total time with current, including the final ramp-down.
    pub(crate) fn duration(&self) -> Duration {
        let ramps = self.period().as_ticks() * u64::from(self.ramps);
        Duration::from_ticks(ramps + self.rise.as_ticks())
    }

    /// Returns the mean square of the current over the train, in A^2.
    pub(crate) fn mean_square_a2(&self) -> f32 {
        let (peak, end) = (self.peak.0, self.end.0);
        // Mean square of a straight line between two currents: (a^2 + a b + b^2)/3. The first rise and
        // the final ramp-down start or end at zero, and are counted like the others.
        let line = (peak * peak + peak * end + end * end) / 3.0;
        let seconds = |span: Duration| in_seconds(span).0;
        let squares =
            (seconds(self.rise) + seconds(self.fall)) * line + seconds(self.hold) * peak * peak;
        squares / seconds(self.period()).max(1e-6)
    }
}

/// Segment of the train.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TrainSegment {
    Rise,
    Hold,
    Fall,
    /// Ramp-down to zero after the last ramp.
    Down,
    Done,
}

/// Present fall of the train, or the last one if the segment is no fall.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fall {
    ramp: u8,
    since: Instant,
    until: Instant,
}

/// Train in progress.
///
/// Each segment is sent before it starts, so its start time does not depend on how long sending takes: a
/// busy processor needs most of a millisecond. The start matters: if an elastomer lags the current by
/// five milliseconds, a fall that starts half a millisecond later after its conversions than in the
/// calibration changes the estimate of a hard load by two per cent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Train {
    profile: TrainProfile,
    segment: TrainSegment,
    /// Start of the segment, which may be in the future.
    since: Instant,
    /// Number of completed ramps.
    completed: u8,
    fall: Option<Fall>,
    /// Time at which the last conversion ended.
    converted: Option<Instant>,
    /// Time between the ends of two conversions.
    interval: Duration,
}

/// Least time from the end of a conversion to the start of a segment that is sent after it. On the
/// emulated board the procedure receives a conversion 0.56 ms after its end, and a line sent at once
/// starts 0.25 to 0.55 ms later.
const LEAD: Duration = Duration::from_ticks(1_500);

/// Time from the start of the train to its first rise. Before sending the rise, the procedure forecasts
/// the coil's temperature for more than a millisecond.
const FIRST_LEAD: Duration = Duration::from_ticks(5_000);

/// Time by which a segment starts before the end of a conversion, so that the next conversion is
/// entirely within it: times are reported within 2 us, and the bridge starts a line with one of its
/// periods, 16 us.
const MARGIN: Duration = Duration::from_ticks(20);

impl Train {
    /// Starts with the first rise.
    pub(crate) fn start(profile: TrainProfile, now: Instant) -> (Self, CurrentLine) {
        let since = after(now, FIRST_LEAD);
        let train = Self {
            profile,
            segment: TrainSegment::Rise,
            since,
            completed: 0,
            fall: None,
            converted: None,
            interval: Duration::from_ticks(profile.half_conversion.as_ticks() * 2),
        };
        let rise = CurrentLine {
            start_us: since.as_ticks(),
            from_a: 0.0,
            to_a: profile.peak.0,
            over_s: in_seconds(profile.rise).0,
        };
        (train, rise)
    }

    pub(crate) const fn profile(&self) -> &TrainProfile {
        &self.profile
    }

    pub(crate) const fn segment(&self) -> TrainSegment {
        self.segment
    }

    pub(crate) const fn completed(&self) -> u8 {
        self.completed
    }

    fn lasts(&self) -> Duration {
        match self.segment {
            TrainSegment::Rise | TrainSegment::Down => self.profile.rise,
            TrainSegment::Hold => self.profile.hold,
            TrainSegment::Fall => self.profile.fall,
            TrainSegment::Done => Duration::from_ticks(0),
        }
    }

    fn ends(&self) -> Instant {
        after(self.since, self.lasts())
    }

    /// Returns how much earlier than planned the segment may end. A rise to the peak and a ramp-down to
    /// zero always complete.
    fn early(&self) -> Duration {
        let is_last = self.completed.saturating_add(1) >= self.profile.ramps;
        match self.segment {
            TrainSegment::Hold => self.profile.half_conversion.min(self.lasts()),
            TrainSegment::Fall if !is_last => self.profile.half_conversion.min(self.lasts()),
            _ => Duration::from_ticks(0),
        }
    }

    /// Records the end of a conversion.
    pub(crate) fn convert(&mut self, middle: Instant, window: Duration) {
        let end = after(middle, Duration::from_ticks(window.as_ticks() / 2));
        let usual = self.profile.half_conversion.as_ticks() * 2;
        if let Some(last) = self.converted.replace(end) {
            let passed = between(last, end);
            // The time across a gap is not an interval between two conversions.
            if passed.as_ticks() < usual + usual / 2 {
                self.interval = passed;
            }
        }
    }

    /// Returns the end of the first conversion that leaves enough time to send a segment.
    fn next_begin(&self, now: Instant) -> Instant {
        let Some(end) = self.converted else {
            return now;
        };
        let interval = self.interval.as_ticks().max(1);
        let ahead = LEAD.as_ticks().div_ceil(interval) * interval;
        after(
            end,
            Duration::from_ticks(ahead.saturating_sub(MARGIN.as_ticks())),
        )
        .max(now)
    }

    /// Advances to the next segment at the end of the conversion nearest to the end of the present
    /// segment, and returns the line to drive.
    ///
    /// Conversions then have the same positions and lags behind the current on every fall, independent
    /// of other events. With the first conversion at or after the end, its last microsecond would
    /// decide: 10 conversions of 0.9993 ms take just less than 10 ms.
    pub(crate) fn advance(&mut self, now: Instant) -> Option<CurrentLine> {
        let ends = self.ends();
        // Rise and ramp-down end by themselves at their final current, so the next segment need not be
        // sent ahead.
        let at = match self.segment {
            TrainSegment::Hold | TrainSegment::Fall => self.next_begin(now),
            TrainSegment::Rise | TrainSegment::Down | TrainSegment::Done => now,
        };
        if self.segment == TrainSegment::Done || after(at, self.early()) < ends {
            return None;
        }
        let TrainProfile {
            peak,
            end,
            rise,
            fall,
            ramps,
            ..
        } = self.profile;
        let from = self.setpoint(at).unwrap_or(peak);
        let (segment, to, over) = match self.segment {
            TrainSegment::Rise => {
                // No line is sent here: the hold starts at the end of the rise.
                (self.segment, self.since) = (TrainSegment::Hold, ends);
                return None;
            }
            TrainSegment::Hold => {
                self.fall = Some(Fall {
                    ramp: self.completed,
                    since: at,
                    until: after(at, fall),
                });
                (TrainSegment::Fall, end, fall)
            }
            TrainSegment::Fall => {
                if let Some(fall) = &mut self.fall {
                    fall.until = fall.until.min(at);
                }
                self.completed = self.completed.saturating_add(1);
                if self.completed < ramps {
                    (TrainSegment::Rise, peak, rise)
                } else {
                    (TrainSegment::Down, Ampere(0.0), rise)
                }
            }
            TrainSegment::Down | TrainSegment::Done => {
                self.segment = TrainSegment::Done;
                return None;
            }
        };
        (self.segment, self.since) = (segment, at);
        Some(CurrentLine {
            start_us: at.as_ticks(),
            from_a: from.0,
            to_a: to.0,
            over_s: in_seconds(over).0,
        })
    }

    /// Returns the ramp, from 0, whose fall contains the whole conversion.
    pub(crate) fn ramp_of(&self, middle: Instant, window: Duration) -> Option<u8> {
        let half = Duration::from_ticks(window.as_ticks() / 2);
        let Fall { ramp, since, until } = self.fall?;
        let within = between(since, middle) >= half && after(middle, half) <= until;
        within.then_some(ramp)
    }

    /// Returns whether the segment had started at a moment.
    pub(crate) fn has_begun(&self, at: Instant) -> bool {
        at >= self.since
    }

    /// Returns the setpoint at a moment of the present segment; `None` before it.
    pub(crate) fn setpoint(&self, at: Instant) -> Option<Ampere> {
        if !self.has_begun(at) {
            return None;
        }
        let part = |lasts: Duration| {
            let lasts = in_seconds(lasts).0;
            let gone = in_seconds(between(self.since, at)).0;
            if gone < lasts { gone / lasts } else { 1.0 }
        };
        let TrainProfile {
            peak,
            end,
            rise,
            fall,
            ..
        } = self.profile;
        Some(match self.segment {
            TrainSegment::Rise => {
                let from = if self.completed == 0 {
                    Ampere(0.0)
                } else {
                    end
                };
                from + (peak - from) * part(rise)
            }
            TrainSegment::Hold => peak,
            TrainSegment::Fall => peak + (end - peak) * part(fall),
            TrainSegment::Down => end * (1.0 - part(rise)),
            TrainSegment::Done => Ampere(0.0),
        })
    }
}
