//! Orders to the storage and its reports.
//!
//! The storage runs in parallel with the procedure, and more slowly: it gets one order at a time and
//! reports the end of each.

use palpate_wire::Command;
use palpate_wire::code::StorageState;
use palpate_wire::command::CalibrationIdentity;

/// Order to the storage. The next one is given after the report of the last.
#[derive(Clone, Debug, PartialEq)]
pub enum StorageOrder {
    /// Inspect the stored set: [`StorageReport::Done`] follows.
    Inspect,
    /// Read the stored set: a [`StorageReport::Item`] for each item, then [`StorageReport::Done`]. A
    /// damaged set is not read at all.
    Load,
    /// Start a save: [`StorageReport::Ready`] follows.
    Begin,
    /// Add the next command of the configuration to the save: [`StorageReport::Ready`] follows.
    Put(Command),
    /// Complete the save, which makes it the stored set. [`StorageReport::Done`] follows.
    Commit,
    /// Erase everything: [`StorageReport::Done`] follows.
    Erase,
}

/// Report of the storage.
#[derive(Clone, Debug, PartialEq)]
pub enum StorageReport {
    /// The order was carried out; the operation continues with its next order.
    Ready,
    /// A command of the configuration being read.
    Item(Command),
    /// The operation has ended.
    Done {
        /// Cause of a failure; the previously stored set then remains.
        failure: Option<StorageFailure>,
        /// Present content of the storage.
        stored: Stored,
    },
}

/// Cause of a failed order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StorageFailure {
    /// The stored set is damaged, or of a later firmware.
    Damaged,
    /// The flash memory cannot be written.
    Flash,
    /// There is no storage.
    Absent,
}

/// Content of the storage.
#[derive(Clone, Debug, PartialEq)]
pub struct Stored {
    /// State: empty, whole or damaged.
    pub state: StorageState,
    /// Generation of the save; 0 for none.
    pub generation: u32,
    /// `configuration_crc` of the stored configuration.
    pub configuration_crc: u32,
    /// Number of items.
    pub items: u16,
    /// Number of items that this firmware does not know.
    pub unknown_items: u16,
    /// Identity of the stored calibration.
    pub identity: Option<CalibrationIdentity>,
}

impl Stored {
    /// Content of the storage before it is known.
    pub const UNAVAILABLE: Self = Self {
        state: StorageState::Unavailable,
        generation: 0,
        configuration_crc: 0,
        items: 0,
        unknown_items: 0,
        identity: None,
    };
}
