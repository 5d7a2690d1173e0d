//! The parts of a frame: when each may be read at the latest.
//!
//! A converter alone on its bus has its frame read in one transaction. Where two share the bus, a frame
//! is read in one transaction for each channel, and the converters take turns between them: a whole frame of
//! four channels takes 1 ms, in which the other converter would overwrite its first channel.

use ldc161x::BusAccess;

use super::scheme::Scheme;

/// Parts of a frame at most: one for each channel.
pub const MOST_PARTS: usize = 4;

/// Bits of a register's read within a frame (datasheet figure 12), and those of them after which its
/// value is latched for certain: its first data bit comes next.
const REGISTER_BITS: u32 = 47;
const LATCHED_BITS: u32 = 1 + 9 + 9 + 1 + 9;
/// What is not certain of a register's time against the end of a conversion, in microseconds: 2 of
/// the edge's stamp, and 0.9 of each of three channels that the plan does not know.
const MARGIN_US: i32 = 5;
/// By how much a transaction may take longer than its bits, in microseconds.
const MASTER_US: i32 = 10;
/// To read one register between two frames: 48 bits of 2.5 us, and the master's way to it.
const REGISTER_US: i32 = 130;
/// The least time between two frames in which the task that took the last one gets to begin a
/// transaction of its own. With 11 us it did not for four frames, and lost three.
const TURN_US: i32 = 40;

/// What is read in one transaction.
#[derive(Clone, Copy, Debug, Default)]
struct Part {
    /// After the edge it has to begin so soon, for every word to be latched before its channel's next
    /// conversion ends.
    slack_us: i32,
    /// Its length on the bus.
    length_us: i32,
}

/// The parts of a frame.
#[derive(Clone, Debug)]
pub struct Parts {
    parts: [Part; MOST_PARTS],
    count: usize,
    is_shared: bool,
    period_us: i32,
}

impl Parts {
    /// The parts of a scheme's frame. `with_status`: STATUS is read first.
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

    /// How many there are.
    #[must_use]
    pub const fn count(&self) -> usize {
        self.count
    }

    /// How long after its edge each part of a frame may begin, in microseconds. One that would begin later
    /// need not be read.
    #[must_use]
    pub fn latest_begin_us(&self) -> [u32; MOST_PARTS] {
        self.parts
            .map(|part| (part.slack_us - MASTER_US).max(0).unsigned_abs())
    }

    /// How long after its edge each part may end; without a limit where there is none.
    pub(super) fn latest_end_us(&self) -> [u32; MOST_PARTS] {
        let mut latest_us = [u32::MAX; MOST_PARTS];
        for (latest_us, part) in latest_us.iter_mut().zip(self.iter()) {
            // What is left of the part then takes at least its bits.
            *latest_us = (part.slack_us + part.length_us).max(0).unsigned_abs();
        }
        latest_us
    }

    /// Whether every word is in time, whatever the time between the edges of two converters that share the
    /// bus.
    pub(super) fn fit(&self) -> bool {
        self.spare_us() >= 0 && self.left_us() >= 0
    }

    /// Whether a register can be read between two frames without spoiling one, however late the task
    /// comes to it.
    pub(super) fn has_room(&self) -> bool {
        self.spare_us() >= REGISTER_US && self.left_us() >= TURN_US
    }

    /// By how much sooner than it has to each part begins, at the worst time of the other converter's
    /// edge: it waits for one part of the other's then.
    fn spare_us(&self) -> i32 {
        let mut begin_us = self.wait_us(0);
        let mut spare_us = i32::MAX;
        for part in self.iter() {
            spare_us = spare_us.min(part.slack_us - MASTER_US - begin_us);
            begin_us += part.length_us + MASTER_US + self.wait_us(1);
        }
        spare_us
    }

    /// How long a part of the other converter's frame keeps this one waiting: the first is the longest.
    fn wait_us(&self, index: usize) -> i32 {
        let part = self.parts.get(index).filter(|_| self.is_shared);
        part.map_or(0, |part| part.length_us + MASTER_US)
    }

    /// What the frames leave of a period.
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

/// Bit times of the bus, 2.5 us each, in whole microseconds.
const fn bits_us(bits: u32) -> i32 {
    (bits * 5 / 2) as i32
}
