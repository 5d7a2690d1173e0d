//! Time grid of the scans: decides whether a frame belongs to one scan, which scans are missing, and
//! whether the converter still converts as planned.
//!
//! A falling edge of INTB marks the end of a scan. The frame is read after the edge, while the converter
//! continues and overwrites the results channel by channel, channel 0 long before the next edge. A frame
//! belongs to one scan only if each word was latched before its channel's next conversion ended. The end
//! time of the transaction shows this. A late frame is dropped and counted as missed.

use ldc161x::Frame;

use super::parts::{MOST_PARTS, Parts};
use super::setpoint::Scheme;

/// Number of fractional bits of the learnt period: its unit is 2^-16 us.
const FRACTION: u32 = 16;
const MICROSECOND: i64 = 1 << FRACTION;
/// Allowed difference between an edge interval and the period, in units of 2^-16 us. A stamp is
/// truncated to whole microseconds, and its interrupt may wait for a bus interrupt. Two seconds at 1 kHz
/// show no larger difference (sim-host/emulator/tests/integration/acquisition.rs). A conversion that is
/// longer by less than this shifts a time stamp by less than two microseconds.
const TOLERANCE: i64 = 2 * MICROSECOND;
/// Uncertainty of the planned period per channel, in units of 2^-16 us: the converter takes 0 to 0.9 us
/// between two conversions, the latter by datasheet equation 8.
const UNPLANNED: i64 = MICROSECOND;
/// Number of intervals over which the period is learnt. Interval n has the weight 1/n, rounded up to a
/// power of two, and every interval after this number has the weight of interval 64. One crystal drives
/// timer and converter, so the period is constant and only its value is unknown.
const LEARNT_OVER: u32 = 64;
/// Number of intervals after which the period counts as known.
const KNOWN: u32 = 8;
/// Uncertainty of the period once it is known, in units of 2^-16 us: the sum of [`KNOWN`] intervals is
/// known within a microsecond.
const LEFT: i64 = MICROSECOND / KNOWN as i64;
/// Number of equal intervals off the grid, in a row, after which the converter's registers are verified:
/// a conversion that the chip's watchdog aborts causes only one.
const CHECK_AFTER: u8 = 2;
/// Number of equal intervals off the grid, in a row, after which the converter counts as failed although
/// its registers are intact: its clock must be wrong.
const GIVE_UP_AFTER: u8 = 8;

/// Times of reading a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fetch {
    /// Time of the INTB edge that started the read.
    pub edge_us: u64,
    /// Time from the edge to the end of each part's transaction.
    pub ended_us: [u32; MOST_PARTS],
    /// Number of falling edges that the hardware has counted, including this one.
    pub edges: u16,
}

/// Classification of a frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// All words belong to one scan.
    Scan {
        /// Number of missing scans between the previous scan and this one.
        missed: u32,
        /// The time between the previous scan and this one is unknown or differs from the plan.
        gap: bool,
    },
    /// The frame was read too late or not at all, and may mix two scans.
    Late,
    /// No scan ended at the edge, which followed the last one sooner than any scan can. The words are
    /// old or belong to an unfinished scan.
    Early,
}

/// A scan with its time.
#[derive(Clone, Copy, Debug)]
pub struct Sampled {
    /// Words of the scan.
    pub frame: Frame,
    /// Time of the middle of the scan's first conversion.
    pub time_us: u64,
    /// Time from the middle of the first conversion to the middle of each.
    pub offsets_us: [u16; 4],
    /// Duration of a conversion.
    pub window_us: u16,
    /// Number of scans lost since the previous one.
    pub missed: u32,
    /// The time between the previous scan and this one is unknown.
    pub gap: bool,
    /// Generation of the setpoint with which the scan was converted; see
    /// [`ConverterState::is_current`](crate::converter::ConverterState::is_current).
    pub generation: u32,
}

/// Grid of the scans, learnt from the edges.
#[derive(Debug)]
pub struct Grid {
    /// Scan period, in units of 2^-16 us.
    period: i64,
    /// Number of intervals from which the period was learnt.
    learnt: u32,
    unplanned: i64,
    /// Generation of the setpoint.
    generation: u32,
    /// Latest end of each part of a frame after its edge, for the frame to belong to one scan.
    latest_end_us: [u32; MOST_PARTS],
    has_room: bool,
    /// Time of the last edge, and the hardware's count of edges at it.
    last_edge: Option<(u64, u16)>,
    /// Edge of the last scan that was passed on.
    last_us: Option<u64>,
    /// The last frame was read in time: INTB was released before the next scan ended.
    in_time: bool,
    /// The time between the last scan and the next one is unknown.
    gap: bool,
    /// Length of the last interval off the grid; `strange` counts how often it came in a row.
    strange_us: u64,
    strange: u8,
}

impl Grid {
    /// Creates the grid of a plan, with the planned period; no interval has been learnt yet.
    /// `with_status`: STATUS is read first in each frame. `generation`: generation of the setpoint.
    pub fn new(scheme: &Scheme, with_status: bool, generation: u32) -> Self {
        let parts = Parts::new(scheme, with_status);
        Self {
            period: (scheme.period_us * MICROSECOND as f32) as i64,
            learnt: 0,
            unplanned: UNPLANNED * i64::from(scheme.channels),
            generation,
            latest_end_us: parts.latest_end_us(),
            has_room: parts.has_room(),
            last_edge: None,
            last_us: None,
            in_time: false,
            gap: true,
            strange_us: 0,
            strange: 0,
        }
    }

    /// Returns whether reading a register between two frames never makes a frame late, however late the
    /// task starts the read.
    pub const fn has_room(&self) -> bool {
        self.has_room
    }

    /// Returns whether the scan period has changed repeatedly, so that the converter's registers must be
    /// verified.
    pub const fn needs_verify(&self) -> bool {
        self.strange == CHECK_AFTER
    }

    /// Returns whether the scan period stays changed although the registers are intact.
    pub const fn is_off(&self) -> bool {
        self.strange >= GIVE_UP_AFTER
    }

    /// Marks the time before the next edge as unknown, after a failed transfer.
    pub const fn interrupt(&mut self) {
        self.last_edge = None;
        self.last_us = None;
        self.in_time = false;
        self.gap = true;
    }

    /// Handles a frame whose edge time is unknown.
    pub const fn skip(&mut self) {
        self.in_time = false;
    }

    /// Returns the frame with its time if it belongs to one scan.
    pub fn sampled(&mut self, scheme: &Scheme, frame: Frame, fetch: &Fetch) -> Option<Sampled> {
        let Finding::Scan { missed, gap } = self.take(fetch) else {
            self.gap |= frame.marks.gap;
            return None;
        };
        Some(Sampled {
            frame,
            time_us: fetch.edge_us.saturating_sub(scheme.before_edge_us.into()),
            offsets_us: scheme.offsets_us,
            window_us: scheme.window_us,
            missed,
            gap: gap || frame.marks.gap,
            generation: self.generation,
        })
    }

    /// Classifies the next frame.
    pub fn take(&mut self, fetch: &Fetch) -> Finding {
        let last_edge = self.last_edge.replace((fetch.edge_us, fetch.edges));
        let was_in_time = core::mem::take(&mut self.in_time);
        // The converter makes an edge at the end of every scan unless INTB is still low. So after a
        // frame that was read in time, the next edge marks the end of the next scan.
        let mut follows = false;
        let mut is_early = false;
        if let Some((last_us, last_edges)) = last_edge {
            follows = was_in_time && fetch.edges.wrapping_sub(last_edges) == 1;
            let interval_us = fetch.edge_us.saturating_sub(last_us);
            if !self.is_on_grid(interval_us, follows) {
                self.gap = true;
                is_early = interval_us << FRACTION < self.period as u64;
            }
        }
        if is_early && !self.is_after_whole_periods(fetch.edge_us) {
            return Finding::Early;
        }
        let mut ends = fetch.ended_us.iter().zip(&self.latest_end_us);
        if ends.any(|(ended_us, latest_us)| ended_us > latest_us) {
            return Finding::Late;
        }
        self.in_time = true;
        let missed = match self.last_us.replace(fetch.edge_us) {
            Some(last_us) if !follows => {
                let interval_us = fetch.edge_us.saturating_sub(last_us);
                self.periods(interval_us).saturating_sub(1)
            }
            _ => 0,
        };
        Finding::Scan {
            missed,
            gap: core::mem::take(&mut self.gap) || missed > 0,
        }
    }

    /// Returns whether a whole number of periods has passed since the last scan that was passed on.
    fn is_after_whole_periods(&self, edge_us: u64) -> bool {
        let Some(last_us) = self.last_us else {
            return false;
        };
        let interval_us = edge_us.saturating_sub(last_us);
        let periods = i64::from(self.periods(interval_us));
        periods > 0 && self.is_within(self.beyond(interval_us, periods), periods)
    }

    /// Returns by how much an interval is longer than a number of periods, in units of 2^-16 us.
    const fn beyond(&self, interval_us: u64, periods: i64) -> i64 {
        // No bit is lost in an interval below 2^47 us, four years.
        ((interval_us << FRACTION) as i64).saturating_sub(self.period.saturating_mul(periods))
    }

    /// Returns whether `beyond`, the difference of an interval from `periods` periods, is within the
    /// uncertainty of their sum.
    const fn is_within(&self, beyond: i64, periods: i64) -> bool {
        let unknown = if self.learnt < KNOWN {
            self.unplanned
        } else {
            LEFT
        };
        beyond.abs() <= TOLERANCE.saturating_add(unknown.saturating_mul(periods))
    }

    /// Returns whether an interval between two edges is one period, or several if the edges do not
    /// `follow` one another. Learns from intervals of one period.
    fn is_on_grid(&mut self, interval_us: u64, follows: bool) -> bool {
        let periods = if follows {
            1
        } else {
            self.periods(interval_us).max(1)
        };
        let periods = i64::from(periods);
        let more = self.beyond(interval_us, periods);
        if self.is_within(more, periods) {
            if periods == 1 {
                self.learnt = (self.learnt + 1).min(LEARNT_OVER);
                self.period += more >> self.learnt.ilog2();
            }
            self.strange = 0;
            return true;
        }
        let same = interval_us.abs_diff(self.strange_us) <= (TOLERANCE >> FRACTION) as u64;
        self.strange = if same {
            self.strange.saturating_add(1)
        } else {
            1
        };
        self.strange_us = interval_us;
        false
    }

    /// Returns the number of periods in an interval, rounded to the nearest.
    fn periods(&self, interval_us: u64) -> u32 {
        let period = self.period.max(1);
        let interval = (interval_us << FRACTION) as i64;
        u32::try_from(interval.saturating_add(period / 2) / period).unwrap_or(u32::MAX)
    }
}
