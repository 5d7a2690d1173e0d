//! Parts of a frame: the latest time at which each may be read.
//!
//! If a converter is alone on its bus, one transaction reads its frame. If two share the bus, one
//! transaction per channel reads it, and the converters take turns: a whole frame of four channels takes
//! 1 ms, in which the other converter would overwrite its first channel.

use ldc161x::BusAccess;

use super::setpoint::Scheme;

/// Maximum number of parts of a frame: one per channel.
pub const MOST_PARTS: usize = 4;

/// Number of clock bits that reading one register within a frame takes (datasheet figure 12).
const REGISTER_BITS: u32 = 47;
/// Number of those bits after which the register's value is certainly latched: its first data bit
/// follows.
const LATCHED_BITS: u32 = 1 + 9 + 9 + 1 + 9;
/// Uncertainty of a register's read time relative to the end of a conversion, in microseconds: 2 for the
/// stamp of the edge, and 0.9 for the time before each of three channels, which the plan does not know.
const MARGIN_US: i32 = 5;
/// Time that a transaction takes in addition to its bits on the bus, in microseconds.
const MASTER_US: i32 = 10;
/// Time to read one register between two frames, in microseconds: 48 bits of 2.5 us, and [`MASTER_US`].
const REGISTER_US: i32 = 130;
/// Least free time in a scan period, in microseconds, for the task that took the last frame to
/// start a transaction of its own before the next frame. With 11 us a task waited for its turn
/// during four frames, and three frames were lost.
const TURN_US: i32 = 40;

/// Registers read in one transaction.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// Latest time to start reading the part, in microseconds after the edge of INTB: every word is then
    /// still latched before its channel's next conversion overwrites it.
    slack_us: i32,
    /// Duration of the part's bits on the bus, in microseconds.
    length_us: i32,
}

/// All parts of a frame.
#[derive(Clone, Debug)]
pub struct Parts {
    parts: [Part; MOST_PARTS],
    count: usize,
    is_shared: bool,
    period_us: i32,
}

impl Parts {
    /// Creates the parts of a scheme's frame. `with_status`: STATUS is read first.
    #[must_use]
    pub fn new(scheme: &Scheme, with_status: bool) -> Self {
        let channels = u32::from(scheme.channels);
        let is_shared = scheme.setpoint.shares_bus;
        let (count, of_part) = if is_shared {
            (scheme.channels.into(), 1)
        } else {
            (1, channels)
        };
        let mut parts = [Part::default(); MOST_PARTS];
        let mut ages = scheme.ages_us.iter();
        let mut status = u32::from(with_status);
        for part in parts.iter_mut().take(count) {
            let registers = status + 2 * of_part;
            part.length_us = bits_us(BusAccess::FramePerTransaction.bit_times(registers));
            part.slack_us = i32::MAX;
            for (index, age_us) in (0..of_part).zip(&mut ages) {
                let next_end_us = (scheme.period_us - age_us) as i32;
                let latched_us = bits_us((status + 2 * index) * REGISTER_BITS + LATCHED_BITS);
                part.slack_us = part.slack_us.min(next_end_us - latched_us - MARGIN_US);
            }
            status = 0;
        }
        Self {
            parts,
            count,
            is_shared,
            period_us: scheme.period_us as i32,
        }
    }

    /// Number of parts.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// Returns the latest start of each part of a frame after its edge, in microseconds. A part that
    /// would start later need not be read.
    #[must_use]
    pub fn latest_begin_us(&self) -> [u32; MOST_PARTS] {
        self.parts
            .map(|part| (part.slack_us - MASTER_US).max(0).unsigned_abs())
    }

    /// Returns the latest end of each part after its edge; `u32::MAX` for parts that do not exist.
    pub(super) fn latest_end_us(&self) -> [u32; MOST_PARTS] {
        let mut latest_us = [u32::MAX; MOST_PARTS];
        for (latest_us, part) in latest_us.iter_mut().zip(self.iter()) {
            // A part that ends by this time has started by its latest start, since it takes at least the
            // time of its bits.
            *latest_us = (part.slack_us + part.length_us).max(0).unsigned_abs();
        }
        latest_us
    }

    /// Returns whether every word is read in time, for any time between the edges of two converters on
    /// one bus.
    pub(super) fn fit(&self) -> bool {
        self.spare_us() >= 0 && self.left_us() >= 0
    }

    /// Returns whether reading a register between two frames never makes a frame late, however late the
    /// task starts the read.
    pub(super) fn has_room(&self) -> bool {
        self.spare_us() >= REGISTER_US && self.left_us() >= TURN_US
    }

    /// Returns the least time between a part's start and its latest start, in microseconds, for the
    /// worst time of the other converter's edge: each part then waits for one part of the other
    /// converter's frame.
    fn spare_us(&self) -> i32 {
        let mut begin_us = self.wait_us(0);
        let mut spare_us = i32::MAX;
        for part in self.iter() {
            spare_us = spare_us.min(part.slack_us - MASTER_US - begin_us);
            begin_us += part.length_us + MASTER_US + self.wait_us(1);
        }
        spare_us
    }

    /// Returns the time for which a part waits for part `index` of the other converter's frame; the
    /// first part of a frame is the longest.
    fn wait_us(&self, index: usize) -> i32 {
        let part = self.parts.get(index).filter(|_| self.is_shared);
        part.map_or(0, |part| part.length_us + MASTER_US)
    }

    /// Returns the part of a scan period in which no frame is read, in microseconds.
    fn left_us(&self) -> i32 {
        let frames_us: i32 = if self.is_shared {
            2 * (0..self.count)
                .map(|index| self.wait_us(index))
                .sum::<i32>()
        } else {
            self.iter().map(|part| part.length_us).sum()
        };
        self.period_us - frames_us
    }

    fn iter(&self) -> impl Iterator<Item = &Part> {
        self.parts.iter().take(self.count)
    }
}

/// Returns the duration of a number of bits on the bus, 2.5 us each, in whole microseconds.
const fn bits_us(bits: u32) -> i32 {
    (bits * 5 / 2) as i32
}
