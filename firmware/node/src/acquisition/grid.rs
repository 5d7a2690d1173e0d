//! The grid of the scans: whether a frame is of one of them, what is missing, and whether the
//! converter still converts as planned.
//!
//! A falling edge of INTB ends a scan. The frame is read after it, while the converter goes on and
//! overwrites the results one channel after the other: that of channel 0 long before the next edge.
//! A frame is of one scan only if each word was latched before its channel's next conversion ended.
//! The time at which the transaction ended says so. One that is late is dropped and counted as missed.

use ldc161x::Frame;

use super::parts::{MOST_PARTS, Parts};
use super::scheme::Scheme;

/// Bits of a microsecond's fraction in the learnt period.
const FRACTION: u32 = 16;
const MICROSECOND: i64 = 1 << FRACTION;
/// By how much an interval between two edges may differ from the period, in parts of a microsecond.
/// A stamp is cut to whole microseconds, and its interrupt may wait for the bus's own; two seconds at
/// 1 kHz have no interval beyond this (sim-host/emulator/tests/integration/acquisition.rs). A conversion that is longer by less than this moves a time
/// stamp by less than two microseconds.
const TOLERANCE: i64 = 2 * MICROSECOND;
/// What the plan does not know of an interval, per channel: the converter's time between two
/// conversions, 0 to 0.9 us (datasheet equation 8 against none).
const UNPLANNED: i64 = MICROSECOND;
/// Intervals over which the period is learnt, each with the weight of its number's reciprocal, rounded
/// up to a power of two; later ones weigh as the last of these. The board's crystal drives timer and
/// converter, so that the period is constant and only its value is not known.
const LEARNT_OVER: u32 = 64;
/// Intervals after which the period is known, and so much of a microsecond is left: the sum of as many
/// is known within one.
const KNOWN: u32 = 8;
const LEFT: i64 = MICROSECOND / KNOWN as i64;
/// Equal intervals beside the grid after which the converter's registers are compared: a conversion
/// that the chip's watchdog aborts makes a single one.
const CHECK_AFTER: u8 = 2;
/// The same after which the converter is given up, with its registers as they were written: its
/// clock is off.
const GIVE_UP_AFTER: u8 = 8;

/// When a frame was read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fetch {
    /// The edge of INTB that called for it.
    pub edge_us: u64,
    /// From the edge to the end of each part's transaction.
    pub ended_us: [u32; MOST_PARTS],
    /// Falling edges that the hardware has counted up to this one.
    pub edges: u16,
}

/// What a frame is found to be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Finding {
    /// All of it is of one scan.
    Scan {
        /// Scans that are missing before it.
        missed: u32,
        /// What went before it is unknown, or took another time than planned.
        gap: bool,
    },
    /// It was read too late, or not at all, and may be of two scans.
    Late,
    /// No scan ended at its edge: it came sooner after the last one than any scan can. Its words are
    /// those of before, or of a scan that is not over.
    Early,
}

/// A scan with its time.
#[derive(Clone, Copy, Debug)]
pub struct Sampled {
    /// The words.
    pub frame: Frame,
    /// Middle of its first conversion.
    pub time_us: u64,
    /// From there to the middle of each conversion.
    pub offsets_us: [u16; 4],
    /// How long a conversion takes.
    pub window_us: u16,
    /// Scans that were lost between the last one and this.
    pub missed: u32,
    /// What went before is unknown.
    pub gap: bool,
    /// Generation of the setpoint that it was converted by; see
    /// [`ConverterState::is_current`](crate::converter::ConverterState::is_current).
    pub generation: u32,
}

/// The grid of the scans, as it is learnt.
#[derive(Debug)]
pub struct Grid {
    /// From one scan to the next, in parts of a microsecond.
    period: i64,
    /// Intervals that it is learnt from.
    learnt: u32,
    unplanned: i64,
    /// Generation of the setpoint.
    generation: u32,
    /// How long after its edge each part of a frame may end for the frame to be of one scan.
    latest_end_us: [u32; MOST_PARTS],
    has_room: bool,
    /// Time and number of the last edge.
    last_edge: Option<(u64, u16)>,
    /// Edge of the last scan that was passed on.
    last_us: Option<u64>,
    /// The last frame was read in time: INTB was released before the next scan ended.
    in_time: bool,
    /// What goes before the next scan is not known.
    gap: bool,
    /// The last interval beside the grid, and how often it has come in a row.
    strange_us: u64,
    strange: u8,
}

impl Grid {
    /// The grid of a plan, of which only the planned period is known. `with_status`: STATUS is read
    /// first in each frame. `generation`: that of the setpoint.
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

    /// Whether a register can be read between two frames without spoiling one, however late the task
    /// comes to it.
    pub const fn has_room(&self) -> bool {
        self.has_room
    }

    /// The time between two scans has changed, and stays so: the converter's registers have to be
    /// compared with what was written.
    pub const fn is_suspect(&self) -> bool {
        self.strange == CHECK_AFTER
    }

    /// It stays so though the registers are intact.
    pub const fn is_off(&self) -> bool {
        self.strange >= GIVE_UP_AFTER
    }

    /// What goes before the next edge is unknown: a transfer failed.
    pub const fn interrupt(&mut self) {
        self.last_edge = None;
        self.last_us = None;
        self.in_time = false;
        self.gap = true;
    }

    /// A frame was read of which the edge's time is not known.
    pub const fn skip(&mut self) {
        self.in_time = false;
    }

    /// A frame with its time, if it is of one scan.
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

    /// Takes the next frame.
    pub fn take(&mut self, fetch: &Fetch) -> Finding {
        let last_edge = self.last_edge.replace((fetch.edge_us, fetch.edges));
        let was_in_time = core::mem::take(&mut self.in_time);
        // The converter makes an edge at the end of every scan unless INTB is low still: after a
        // frame that was read in time the next edge is that of the next scan.
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

    /// Whether whole periods have passed since the last scan that was passed on: what came between was
    /// no scan.
    fn is_after_whole_periods(&self, edge_us: u64) -> bool {
        let Some(last_us) = self.last_us else {
            return false;
        };
        let interval_us = edge_us.saturating_sub(last_us);
        let periods = i64::from(self.periods(interval_us));
        periods > 0 && self.is_within(self.beyond(interval_us, periods), periods)
    }

    /// By how much an interval is longer than some periods, in parts of a microsecond.
    const fn beyond(&self, interval_us: u64, periods: i64) -> i64 {
        // Less than the age of the universe: no bit is lost.
        ((interval_us << FRACTION) as i64).saturating_sub(self.period.saturating_mul(periods))
    }

    /// Whether that may be, by what is known of the period.
    const fn is_within(&self, beyond: i64, periods: i64) -> bool {
        let unknown = if self.learnt < KNOWN {
            self.unplanned
        } else {
            LEFT
        };
        beyond.abs() <= TOLERANCE.saturating_add(unknown.saturating_mul(periods))
    }

    /// Whether an interval between two edges is a period, or several where the edges do not
    /// `follow` one another; learns from one that is.
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

    /// How many periods an interval is, to the nearest.
    fn periods(&self, interval_us: u64) -> u32 {
        let period = self.period.max(1);
        let interval = (interval_us << FRACTION) as i64;
        u32::try_from(interval.saturating_add(period / 2) / period).unwrap_or(u32::MAX)
    }
}
