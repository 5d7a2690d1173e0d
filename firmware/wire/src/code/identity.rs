//! What the device is and how it came to run.

codes! {
    /// Why the device started.
    pub enum ResetCause {
        /// Power was applied, or came back after a sag; the processor does not distinguish them.
        PowerOn = 1 "power_on",
        /// The reset pin was pulled.
        Pin = 3 "pin",
        /// It was asked for: by `reboot`, or by the processor's boot loader after it has written a
        /// new image.
        Software = 4 "software",
        /// A debug probe asked for it.
        Debugger = 5 "debugger",
        /// The watchdog was not fed. The bridge stays off until it is armed again.
        Watchdog = 6 "watchdog",
        /// The firmware panicked. The bridge stays off until it is armed again.
        Panic = 7 "panic",
        /// The processor took a hard fault, a stack overflow among others. The bridge stays off
        /// until it is armed again.
        HardFault = 8 "hard_fault",
        /// The firmware reset itself, and what it kept of the reason cannot be read. The bridge
        /// stays off until it is armed again.
        Unexplained = 9 "unexplained",
    }

    /// What answers at the address of an inductance-to-digital converter.
    pub enum Chip {
        /// Nothing does.
        Absent = 1 "absent",
        /// LDC1612 or LDC1614; their identity registers are the same.
        Ldc161x = 2 "ldc161x",
        /// LDC1312 or LDC1314: 12 bits, not supported.
        Ldc131x = 3 "ldc131x",
        /// Something with other identity registers.
        Foreign = 4 "foreign",
    }

    /// The board that the firmware was built for.
    pub enum Board {
        /// No hardware: the same tasks on a computer.
        Native = 1 "native",
        /// Raspberry Pi Pico, RP2040.
        Pico = 2 "pico",
    }
}
