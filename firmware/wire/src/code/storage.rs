//! States of the storage, operations on it, and targets of a restart.

codes! {
    /// State of the stored set.
    pub enum StorageState {
        /// No set is stored.
        Empty = 1 "empty",
        /// Settings and calibration are stored, and every bit is as it was saved.
        Whole = 2 "whole",
        /// The stored set differs from the saved one.
        Damaged = 3 "damaged",
        /// A later firmware has stored a set in another format. It remains until it is erased.
        Newer = 5 "newer",
        /// Unknown: this board has no storage, or the storage did not answer.
        Unavailable = 4 "unavailable",
    }

    /// Operation on the storage.
    pub enum StorageAction {
        /// Inspect the stored set.
        Inspect = 1 "inspect",
        /// Store the active settings and calibration.
        Store = 2 "store",
        /// Apply the stored set.
        Load = 3 "load",
        /// Erase the stored set.
        Erase = 4 "erase",
    }

    /// Target of a restart.
    pub enum RebootTarget {
        /// The firmware.
        Firmware = 1 "firmware",
        /// The processor's boot loader, which receives a new image over USB.
        BootLoader = 2 "boot_loader",
    }
}
