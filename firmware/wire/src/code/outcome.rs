//! Results of a command.

codes! {
    /// Result of a command. Numbers 21, 23, 24 and 26 are reserved.
    pub enum Outcome {
        /// Accepted and started.
        Accepted = 0 "accepted",
        /// The device does not know this command.
        UnknownCommand = 1 "unknown_command",
        /// The payload is unreadable.
        Malformed = 2 "malformed",
        /// The command is addressed to another boot of the device: it was sent before a reset. Read
        /// `hello` and decide again.
        OtherBoot = 3 "other_boot",
        /// A field is infinite or not a number.
        NotFinite = 4 "not_finite",
        /// A field is beyond its limits, or beyond the narrower ones of this board.
        OutOfRange = 5 "out_of_range",
        /// A field has a number that the device does not know.
        UnknownCode = 6 "unknown_code",
        /// The values of a list do not increase as required.
        NotIncreasing = 7 "not_increasing",
        /// Fields contradict each other.
        Inconsistent = 8 "inconsistent",
        /// A chunk does not continue the started curve. Send the curve from its first knot.
        OutOfSequence = 9 "out_of_sequence",
        /// The curve is not monotonic.
        NotMonotone = 10 "not_monotone",
        /// There is no such sensor or channel on this board.
        NoSuchChannel = 11 "no_such_channel",
        /// This part of the calibration was never set.
        NotSet = 12 "not_set",
        /// A calibration that the command needs is missing.
        NotCalibrated = 13 "not_calibrated",
        /// The device must be armed first.
        NotArmed = 14 "not_armed",
        /// A measurement is running, another command already waits for the end of the coil's test,
        /// or the flash memory is being read or written.
        Busy = 15 "busy",
        /// The device is armed, and this may not be changed while it is.
        Armed = 16 "armed",
        /// A fault is latched; clear it first.
        Faulted = 17 "faulted",
        /// The fault to be cleared is not the latched one.
        OtherFault = 18 "other_fault",
        /// The fault's cause persists.
        FaultPersists = 19 "fault_persists",
        /// There is no bridge, no coil or no current measurement.
        NoCoil = 20 "no_coil",
        /// No object touches the sensor.
        NoContact = 22 "no_contact",
        /// The device is in sensing-only mode.
        SensingOnly = 25 "sensing_only",
        /// The command waited for the end of the coil's test and was dropped before it started: by
        /// `abort`, `disarm` or `sensing_only`, or because the test was stopped.
        Aborted = 27 "aborted",
        /// No set is stored, or no readable one.
        NothingStored = 28 "nothing_stored",
        /// This board has no storage, or the storage did not answer.
        NoStorage = 29 "no_storage",
        /// The active calibration is not the one with this hash. Send it again.
        OtherCalibration = 30 "other_calibration",
    }
}
