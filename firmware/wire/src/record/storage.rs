//! Content of the flash memory.

use crate::code::{StorageAction, StorageState};

structure! {
    /// What is stored, and whether it is what is in force. What was set and not stored is lost with
    /// the power.
    pub struct Storage {
        /// What was done.
        action: StorageAction,
        /// It was done. False: nothing has changed, neither what is stored nor what is in force;
        /// `fault` says why.
        succeeded: bool,
        /// What is stored now.
        state: StorageState,
        /// Number of the save; 0 if nothing is stored. Each `store` that changes something counts
        /// one, from 1, since the storage was last erased.
        generation: u32,
        /// `configuration_crc` of what is stored; 0 if nothing is.
        stored_crc: u32,
        /// The same of settings and calibration in force. It differs from the stored one if
        /// something was set since, or if this firmware does not know all that is stored.
        in_force_crc: u32,
        /// Items that are stored: one for each setting and each part of a calibration, long curves
        /// in several.
        items: u16 ["1"],
        /// Of these, items that this firmware does not know: another version stored them. They are
        /// kept.
        unknown_items: u16 ["1"],
        /// Of these, items that this board refuses: of a converter that is not there, or beyond the
        /// board's limits. They are not in force, and the next `store` leaves them out.
        refused_items: u16 ["1"],
        /// Which calibration is stored; absent where it has no identity.
        calibration_id: Option<u32>,
        /// When it was made, in seconds since 1970-01-01 UTC.
        calibrated_at_s: Option<u32> ["s"],
        /// Temperature at which it was made.
        calibrated_at_c: Option<f32> ["degC", -60, 250],
        /// CRC-32 over its parts.
        calibration_hash: Option<u32>,
        /// How long it took.
        took_s: f32 ["s", 0, 60],
    }
}
