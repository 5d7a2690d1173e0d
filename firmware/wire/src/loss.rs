//! Account of received and missing frames.
//!
//! The device numbers every frame that it produces, sent or not. So for every boot
//!
//! produced = received + missing, missing = dropped by the device + lost or damaged in transit,
//!
//! exactly, counted from the first received frame to the last. A damaged frame shows as a missing number
//! and must not be counted again.

use crate::Header;

/// Number of last frames for which the account knows whether each was received, so that a late frame is
/// distinguished from a repeated one.
const WINDOW: u32 = 128;

/// Classification of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Arrival {
    /// The first frame of a new boot: the device has restarted, unless it is the very first frame. The
    /// number of frames after the last received one of the previous boot is unknown.
    FirstOfBoot,
    /// The frame after the last one.
    Next,
    /// A frame later than the next one: the frames between are missing so far.
    AfterGap {
        /// Number of missing frames.
        missing: u32,
    },
    /// A frame that was missing.
    Late,
    /// A frame that was received before; not counted again.
    Duplicate,
    /// A frame too old, or from before the first one, so that the account cannot tell whether it was
    /// received; not counted.
    Stale,
}

/// Account of one boot of the device.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tally {
    boot_id: u32,
    /// Number of the first received frame; `next` is the number after that of the last one. Both are
    /// extended beyond 32 bits.
    first: u64,
    next: u64,
    received: u64,
    duplicates: u64,
    stale: u64,
    /// Dropped count in the last frame; `dropped` is its rise since the first frame.
    dropped_at_last: u32,
    dropped: u64,
    /// Bit n: frame `next - 1 - n` was received.
    window: u128,
}

impl Tally {
    fn new(header: &Header) -> Self {
        let first = u64::from(header.sequence);
        Self {
            boot_id: header.boot_id,
            first,
            next: first + 1,
            received: 1,
            duplicates: 0,
            stale: 0,
            dropped_at_last: header.dropped,
            dropped: 0,
            window: 1,
        }
    }

    fn take(&mut self, header: &Header) -> Arrival {
        // The number of the expected frame is the lower 32 bits of `next`.
        let expected = self.next as u32;
        let ahead = header.sequence.wrapping_sub(expected);
        if ahead <= u32::MAX / 2 {
            return self.take_ahead(ahead, header.dropped);
        }
        // Distance of the frame behind the expected one: 1 for the last received frame, 2 for the frame
        // before it.
        let behind = expected.wrapping_sub(header.sequence);
        let after_first = self.next - self.first;
        if behind > WINDOW || u64::from(behind) > after_first {
            self.stale += 1;
            return Arrival::Stale;
        }
        let bit = 1_u128 << (behind - 1);
        if self.window & bit != 0 {
            self.duplicates += 1;
            return Arrival::Duplicate;
        }
        self.window |= bit;
        self.received += 1;
        Arrival::Late
    }

    fn take_ahead(&mut self, missing: u32, dropped: u32) -> Arrival {
        self.window = self.window.checked_shl(missing).unwrap_or(0);
        self.window = self.window.checked_shl(1).unwrap_or(0) | 1;
        self.next += u64::from(missing) + 1;
        self.received += 1;
        self.dropped += u64::from(dropped.wrapping_sub(self.dropped_at_last));
        self.dropped_at_last = dropped;
        match missing {
            0 => Arrival::Next,
            missing => Arrival::AfterGap { missing },
        }
    }

    /// Returns the boot id.
    pub const fn boot_id(&self) -> u32 {
        self.boot_id
    }

    /// Returns the number of frames that the device had produced before the first received one: 0 if the
    /// receiver was connected from the start.
    pub const fn before_first(&self) -> u64 {
        self.first
    }

    /// Returns the number of frames produced from the first received one to the last.
    pub const fn produced(&self) -> u64 {
        self.next - self.first
    }

    /// Returns the number of received frames, each counted once.
    pub const fn received(&self) -> u64 {
        self.received
    }

    /// Returns the number of frames that were produced and not received.
    pub const fn missing(&self) -> u64 {
        self.produced() - self.received
    }

    /// Returns the number of missing frames that the device reports as dropped.
    pub const fn dropped_by_device(&self) -> u64 {
        self.dropped
    }

    /// Returns the number of missing frames that were lost or damaged in transit. `None` if the device
    /// reports more dropped frames than are missing, which no working device does.
    pub const fn lost_on_the_way(&self) -> Option<u64> {
        self.missing().checked_sub(self.dropped)
    }

    /// Returns the number of repeated frames.
    pub const fn duplicates(&self) -> u64 {
        self.duplicates
    }

    /// Returns the number of frames too late to be distinguished from repeated ones.
    pub const fn stale(&self) -> u64 {
        self.stale
    }
}

/// Keeps the account of a stream of records.
///
/// Pass the header of every undamaged frame, also of one that was not decoded
/// ([`FrameError::header`](crate::FrameError::header)).
///
/// ```
/// use palpate_wire::Header;
/// use palpate_wire::loss::{Account, Arrival};
/// let mut account = Account::new();
/// let header = |boot_id, sequence, dropped| Header { boot_id, sequence, time_us: 0, dropped };
/// account.take(&header(7, u32::MAX, 0));
/// assert_eq!(account.take(&header(7, 0, 0)), Arrival::Next);
/// // The device dropped 1 and 2; 3 was damaged on the way.
/// assert_eq!(account.take(&header(7, 4, 2)), Arrival::AfterGap { missing: 3 });
/// let tally = account.current().unwrap();
/// assert_eq!((tally.produced(), tally.received(), tally.missing()), (6, 3, 3));
/// assert_eq!((tally.dropped_by_device(), tally.lost_on_the_way()), (2, Some(1)));
/// // It restarts: nothing is missing.
/// assert_eq!(account.take(&header(8, 0, 0)), Arrival::FirstOfBoot);
/// assert_eq!(account.current().unwrap().missing(), 0);
/// ```
#[derive(Clone, Debug, Default)]
pub struct Account {
    current: Option<Tally>,
    previous: Option<Tally>,
    boots: u32,
}

impl Account {
    /// Creates an account without frames.
    pub const fn new() -> Self {
        Self {
            current: None,
            previous: None,
            boots: 0,
        }
    }

    /// Adds a frame.
    pub fn take(&mut self, header: &Header) -> Arrival {
        for tally in [&mut self.current, &mut self.previous] {
            if let Some(tally) = tally
                && tally.boot_id == header.boot_id
            {
                return tally.take(header);
            }
        }
        self.previous = self.current.take();
        self.current = Some(Tally::new(header));
        self.boots = self.boots.wrapping_add(1);
        Arrival::FirstOfBoot
    }

    /// Returns the tally of the last seen boot.
    pub const fn current(&self) -> Option<&Tally> {
        self.current.as_ref()
    }

    /// Returns the tally of the previous boot. Its late frames are still added.
    pub const fn previous(&self) -> Option<&Tally> {
        self.previous.as_ref()
    }

    /// Returns the number of boots seen.
    pub const fn boots(&self) -> u32 {
        self.boots
    }
}
