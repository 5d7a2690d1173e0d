//! Content of the flash memory.

use crate::code::{StorageAction, StorageState};

structure! {
    /// The stored set, and whether it equals the active one. Values that were set and not stored are
    /// lost with the power.
    pub struct Storage {
        /// Operation that was executed.
        action: StorageAction,
        /// The operation succeeded. False: neither the stored nor the active set has changed; `fault`
        /// gives the reason.
        succeeded: bool,
        /// Present state of the stored set.
        state: StorageState,
        /// Number of the save; 0 if nothing is stored. Each `store` that changes something counts one,
        /// from 1, since the storage was last erased.
        generation: u32,
        /// `configuration_crc` of the stored set; 0 if there is none.
        stored_crc: u32,
        /// `configuration_crc` of the active settings and calibration. It differs from the stored one if
        /// a value was set since, or if this firmware does not know all stored items.
        in_force_crc: u32,
        /// Number of stored items: one per setting and per part of a calibration, several for long
        /// curves.
        items: u16 ["1"],
        /// Number of stored items that this firmware does not know, since another version stored them.
        /// They remain.
        unknown_items: u16 ["1"],
        /// Number of stored items that this board refuses: for a converter that is not there, or beyond
        /// the board's limits. They are not active, and the next `store` omits them.
        refused_items: u16 ["1"],
        /// Number of the stored calibration; absent without an identity.
        calibration_id: Option<u32>,
        /// Time of the stored calibration, in seconds since 1970-01-01 UTC.
        calibrated_at_s: Option<u32> ["s"],
        /// Temperature of the stored calibration.
        calibrated_at_c: Option<f32> ["degC", -60, 250],
        /// CRC-32 over the parts of the stored calibration.
        calibration_hash: Option<u32>,
        /// Duration of the operation.
        took_s: f32 ["s", 0, 60],
    }
}
