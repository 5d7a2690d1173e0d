//! What is stored in flash memory, and what is done with it.

codes! {
    /// What is stored.
    pub enum StorageState {
        /// Nothing.
        Empty = 1 "empty",
        /// Settings and calibration, and every bit of them is as it was stored.
        Whole = 2 "whole",
        /// Something that is not what was stored.
        Damaged = 3 "damaged",
        /// Something that a later firmware has stored in another format. It is kept, unless it is
        /// erased.
        Newer = 5 "newer",
        /// Not known: this board stores nothing, or its storage did not answer.
        Unavailable = 4 "unavailable",
    }

    /// What was done with the storage.
    pub enum StorageAction {
        /// It was looked at.
        Inspect = 1 "inspect",
        /// Settings and calibration in force were stored.
        Store = 2 "store",
        /// What was stored came into force.
        Load = 3 "load",
        /// What was stored was erased.
        Erase = 4 "erase",
    }

    /// How the device is to start anew.
    pub enum RebootTarget {
        /// Into the firmware.
        Firmware = 1 "firmware",
        /// Into the processor's boot loader, which takes a new image over USB.
        BootLoader = 2 "boot_loader",
    }
}
