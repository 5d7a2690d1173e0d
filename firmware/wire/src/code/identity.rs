//! Identity of the device, and cause of its start.

codes! {
    /// Cause of the device's start.
    pub enum ResetCause {
        /// Power was applied, or came back after a sag; the processor does not distinguish them.
        PowerOn = 1 "power_on",
        /// The reset pin was pulled low.
        Pin = 3 "pin",
        /// Requested: by `reboot`, or by the processor's boot loader after it has written a new image.
        Software = 4 "software",
        /// Requested by a debug probe.
        Debugger = 5 "debugger",
        /// The watchdog was not fed. The bridge stays off until it is armed again.
        Watchdog = 6 "watchdog",
        /// The firmware panicked. The bridge stays off until it is armed again.
        Panic = 7 "panic",
        /// The processor took a hard fault, for example by a stack overflow. The bridge stays off until
        /// it is armed again.
        HardFault = 8 "hard_fault",
        /// The firmware reset itself, and its record of the cause is unreadable. The bridge stays off
        /// until it is armed again.
        Unexplained = 9 "unexplained",
    }

    /// Chip that answers at the address of an inductance-to-digital converter.
    pub enum Chip {
        /// No chip answers.
        Absent = 1 "absent",
        /// LDC1612 or LDC1614; their identity registers are the same.
        Ldc161x = 2 "ldc161x",
        /// LDC1312 or LDC1314: 12 bits, not supported.
        Ldc131x = 3 "ldc131x",
        /// A chip with other identity registers.
        Foreign = 4 "foreign",
    }

    /// Board for which the firmware was built.
    pub enum Board {
        /// No hardware: the same tasks run on a computer.
        Native = 1 "native",
        /// Raspberry Pi Pico, RP2040.
        Pico = 2 "pico",
    }
}
