//! What the procedure wants of the storage, and what the storage says.
//!
//! The storage works beside the procedure and slower: it gets one order at a time and reports each.

use palpate_wire::Command;
use palpate_wire::code::StorageState;
use palpate_wire::command::CalibrationIdentity;

/// An order. The next one is given after the report of the last.
#[derive(Clone, Debug, PartialEq)]
pub enum StorageOrder {
    /// Look at what is stored: [`StorageReport::Done`] follows.
    Inspect,
    /// Read what is stored: a [`StorageReport::Item`] for each item, then [`StorageReport::Done`].
    /// What does not check out is not read at all.
    Load,
    /// A save begins: [`StorageReport::Ready`] follows.
    Begin,
    /// The next command of the configuration that is being saved: [`StorageReport::Ready`] follows.
    Put(Command),
    /// All of it was put: it is stored from now on. [`StorageReport::Done`] follows.
    Commit,
    /// Erase everything: [`StorageReport::Done`] follows.
    Erase,
}

/// What the storage says.
#[derive(Clone, Debug, PartialEq)]
pub enum StorageReport {
    /// The order was carried out; the next may come.
    Ready,
    /// A command of the configuration that is being read.
    Item(Command),
    /// It is over.
    Done {
        /// Why it could not be done; then what was stored before is still stored.
        failure: Option<StorageFailure>,
        /// What is stored now.
        stored: Stored,
    },
}

/// Why an order was not carried out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StorageFailure {
    /// What is stored is damaged, or of a later firmware.
    Damaged,
    /// The flash memory does not take what is written.
    Flash,
    /// There is no storage.
    Absent,
}

/// What is stored.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// Whether there is anything, and whether it checks out.
    pub state: StorageState,
    /// Number of the save; 0 for none.
    pub generation: u32,
    /// The configuration's `configuration_crc`.
    pub configuration_crc: u32,
    /// Items.
    pub items: u16,
    /// Items that this firmware does not know.
    pub unknown_items: u16,
    /// Which calibration it is.
    pub identity: Option<CalibrationIdentity>,
}

impl Stored {
    /// Nothing is known of what is stored.
    pub const UNAVAILABLE: Self = Self {
        state: StorageState::Unavailable,
        generation: 0,
        configuration_crc: 0,
        items: 0,
        unknown_items: 0,
        identity: None,
    };
}
