//! The train of falling ramps: when the current goes where.
//!
//! Every ramp begins with a rise to the peak and a hold there, so that all of them start from the
//! same magnetic state, and lag and memory of the elastomer are the same on all. Only the falls
//! are evaluated: a rising current stiffens less, by the elastomer's memory.

use coil_hbridge::CurrentLine;
use palpate_model::units::Ampere;
use palpate_wire::command::Settings;

use crate::time::{Duration, Instant, after, between, in_seconds, span};

/// The profile of the current over a train.
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

    /// The longest that it may become, conversions lost apart. Hold and fall end with the conversion
    /// that is nearest to their planned end; a hold, which begins without a conversion, not before
    /// one has found that the rise is over, and another has sent the fall [ahead](LEAD).
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

    /// The straight lines of the current from rest, each with its end and how long it takes.
    pub(crate) fn lines(&self) -> impl Iterator<Item = (Ampere, Duration)> + '_ {
        let ramp = [
            (self.peak, self.rise),
            (self.peak, self.hold),
            (self.end, self.fall),
        ];
        let ramps = core::iter::repeat_n(ramp, self.ramps.into()).flatten();
        ramps.chain([(Ampere(0.0), self.rise)])
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

/// The segment of the profile in which the train is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TrainSegment {
    Rise,
    Hold,
    Fall,
    /// The way to zero after the last ramp.
    Down,
    Done,
}

/// A fall, the one under way or the last.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Fall {
    ramp: u8,
    since: Instant,
    until: Instant,
}

/// The train under way.
///
/// Each segment is sent before it begins, so its start time does not depend on how long sending takes:
/// a busy processor needs most of a millisecond. With an elastomer that follows the current five
/// milliseconds late, a fall that begins half a millisecond later against its conversions than the
/// calibration's did changes the estimate of a hard load by two per cent.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Train {
    profile: TrainProfile,
    segment: TrainSegment,
    /// When the segment begins or began.
    since: Instant,
    /// Ramps that have been completed.
    completed: u8,
    fall: Option<Fall>,
    /// End of the last conversion.
    converted: Option<Instant>,
    /// From one conversion's end to the next.
    interval: Duration,
}

/// From the end of a conversion to the start of a segment that it decides, at least. On the emulated
/// board the procedure has a conversion 0.56 ms after its end, and a line that was sent at once began
/// 0.25 to 0.55 ms after that.
const LEAD: Duration = Duration::from_ticks(1_500);

/// From the start of the train to its first rise. Before it sends the rise, the procedure computes what the
/// coil's temperature would become, for more than a millisecond.
const FIRST_LEAD: Duration = Duration::from_ticks(5_000);

/// A segment begins by so much before the end of a conversion, so that the next lies within it as a
/// whole: times are reported within 2 us, and the bridge begins a line with a period of its own, 16 us.
const MARGIN: Duration = Duration::from_ticks(20);

impl Train {
    /// Begins with the first rise.
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

    /// How much earlier than planned the segment under way may end. What rises to the peak, and what
    /// goes down to zero, gets there.
    fn early(&self) -> Duration {
        let is_last = self.completed.saturating_add(1) >= self.profile.ramps;
        match self.segment {
            TrainSegment::Hold => self.profile.half_conversion.min(self.lasts()),
            TrainSegment::Fall if !is_last => self.profile.half_conversion.min(self.lasts()),
            _ => Duration::from_ticks(0),
        }
    }

    /// Takes a conversion.
    pub(crate) fn convert(&mut self, middle: Instant, window: Duration) {
        let end = after(middle, Duration::from_ticks(window.as_ticks() / 2));
        let usual = self.profile.half_conversion.as_ticks() * 2;
        if let Some(last) = self.converted.replace(end) {
            let passed = between(last, end);
            // Not across a gap.
            if passed.as_ticks() < usual + usual / 2 {
                self.interval = passed;
            }
        }
    }

    /// The end of the first conversion that leaves enough time to send a segment.
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

    /// Goes on to the next segment at the end of the conversion that is nearest to the end of the one
    /// under way, and returns the line to drive.
    ///
    /// Conversions then lie at the same places on every fall, whatever else happens meanwhile, and
    /// what lags behind the current does so alike on all. The first one at or after the end would
    /// be a conversion later or not by the accident of its last microsecond, as 10 conversions of
    /// 0.9993 ms are just less than 10 ms.
    pub(crate) fn advance(&mut self, now: Instant) -> Option<CurrentLine> {
        let ends = self.ends();
        // The rise and the way to zero end by themselves: the next segment need not be sent ahead.
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
                // Nothing is set here, so the hold begins when the rise has ended.
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

    /// The ramp in whose fall a conversion lay as a whole, from 0.
    pub(crate) fn ramp_of(&self, middle: Instant, window: Duration) -> Option<u8> {
        let half = Duration::from_ticks(window.as_ticks() / 2);
        let Fall { ramp, since, until } = self.fall?;
        let within = between(since, middle) >= half && after(middle, half) <= until;
        within.then_some(ramp)
    }

    /// Whether the segment under way had begun at a moment.
    pub(crate) fn has_begun(&self, at: Instant) -> bool {
        at >= self.since
    }

    /// The setpoint at a moment of the segment under way; `None` before it.
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
