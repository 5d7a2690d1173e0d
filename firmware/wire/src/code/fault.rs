//! Fault codes, and locations of a fault.

codes! {
    /// Fault of the instrument or of a part of it. The record `fault` carries a value and a limit;
    /// their meaning follows.
    pub enum FaultCode {
        /// No converter answers at its address. Check supply, wiring and the address pin.
        SensorAbsent = 1 "sensor_absent",
        /// The converter's identity registers are wrong. Value: device identity. Check the part.
        SensorIdentity = 2 "sensor_identity",
        /// The converter lost its registers. Value: address of the first one. Check its supply.
        SensorReset = 3 "sensor_reset",
        /// A register reads back differently. Value: its address. Check the bus.
        SensorRegister = 4 "sensor_register",
        /// No conversion arrives. Value: time without one, s; limit: time allowed, s. Check coil,
        /// clock and interrupt line.
        SensorSilent = 5 "sensor_silent",
        /// The interrupt line does not change. Value: its level. Check wiring.
        InterruptStuck = 6 "interrupt_stuck",
        /// The bus's data line is held low. Check wiring and supply.
        BusDataStuck = 7 "bus_data_stuck",
        /// The bus's clock line is held low. Check wiring and supply.
        BusClockStuck = 8 "bus_clock_stuck",
        /// A transfer was not acknowledged. Value: failures in a row.
        BusNotAcknowledged = 9 "bus_not_acknowledged",
        /// A transfer took too long. Value and limit: time, s.
        BusTimeout = 10 "bus_timeout",
        /// The amplitude of a sensor stays out of range. Value: channel. Check coil and what is
        /// near it.
        SensorAmplitude = 11 "sensor_amplitude",
        /// A sensor does not oscillate. Value: channel. Check coil and capacitor.
        SensorNotOscillating = 12 "sensor_not_oscillating",
        /// A sensor is too fast for the reference clock. Value: channel. Check its capacitor.
        SensorOverRange = 13 "sensor_over_range",
        /// The bridge reports a fault: overcurrent, overtemperature or undervoltage.
        Bridge = 14 "bridge",
        /// Too much current. Value and limit: current, A. Check the coil for a short.
        OverCurrent = 15 "over_current",
        /// No current flows through the coil. Check the coil's wires and the supply.
        CurrentMissing = 16 "current_missing",
        /// Current flows with the bridge off. Value: current, A. Disconnect the supply; check
        /// bridge and current amplifier.
        CurrentUnwanted = 17 "current_unwanted",
        /// The coil is too hot. Value and limit: temperature, degrees Celsius. Let it cool.
        CoilTooHot = 18 "coil_too_hot",
        /// The thermometer of the coil is open or shorted. Value and limit: voltage, V. Check its
        /// wires.
        Thermometer = 19 "thermometer",
        /// The supply of the coil is too low. Value and limit: voltage, V.
        SupplyLow = 20 "supply_low",
        /// The supply of the coil is too high. Value and limit: voltage, V.
        SupplyHigh = 21 "supply_high",
        /// Too much energy went into the coil. Value and limit: energy, J.
        TooMuchEnergy = 22 "too_much_energy",
        /// The device restarted after a watchdog reset.
        Watchdog = 23 "watchdog",
        /// The device restarted after a panic; the record `crash` gives the location.
        Panic = 24 "panic",
        /// The device restarted after a hard fault; the record `crash` gives the location.
        HardFault = 25 "hard_fault",
        /// Settings or calibration were corrupted in memory. Value: kind of the record that holds the
        /// part. Set it again.
        ConfigurationDamaged = 26 "configuration_damaged",
        /// The stored configuration is damaged: flash memory was corrupted or is worn out. None of it
        /// is active. Value: number of the `state` in the record `storage`. Set everything again and
        /// `store` it, or `erase`.
        StorageDamaged = 27 "storage_damaged",
        /// A task missed its deadline. Value and limit: time, s.
        Overrun = 28 "overrun",
        /// A clock does not run or has a wrong frequency. Value and limit: frequency, Hz.
        Clock = 29 "clock",
        /// No coil is connected, or a wire is broken. Check the coil's wires.
        CoilOpen = 30 "coil_open",
        /// The coil has too little resistance or inductance. Look for a short.
        CoilShort = 31 "coil_short",
        /// The load at the bridge has too much resistance or inductance. Check the coil.
        CoilUnknown = 32 "coil_unknown",
        /// The current amplifier has an offset, is reversed or is frozen. Check its supply, reference
        /// and inputs.
        CurrentSense = 33 "current_sense",
        /// The bridge's own current limit does not act. Set it up.
        NoHardwareLimit = 34 "no_hardware_limit",
        /// The current does not reach its setpoint. Check the supply.
        CurrentOffTarget = 35 "current_off_target",
        /// The coil was on for too long. Limit: time, s.
        OnTime = 36 "on_time",
        /// The PC that commanded a current stopped sending. Value and limit: time, s. Check the link;
        /// command the current again.
        HostSilent = 37 "host_silent",
        /// The device crashed several times in a row and keeps its outputs off. Value: number of
        /// crashes. Read the records `crash`; after ten seconds without one, `reboot`. The stored
        /// configuration is not active until then: `erase` it if it may be the cause.
        CrashStreak = 38 "crash_streak",
        /// The device reset itself, and the record of the cause is unreadable.
        CrashUnreadable = 39 "crash_unreadable",
        /// Flash memory does not accept writes. The previous configuration is still stored. Try again;
        /// if the fault remains, the memory is worn out.
        StorageFailed = 40 "storage_failed",
    }

    /// Location of a fault. Number 10 is reserved.
    pub enum Location {
        /// The processor and its firmware.
        Processor = 1 "processor",
        /// The bus to the converters.
        Bus = 2 "bus",
        /// The first converter.
        Sensor = 3 "sensor",
        /// The second converter.
        SecondSensor = 4 "second_sensor",
        /// The H-bridge.
        Bridge = 5 "bridge",
        /// The coil and its current.
        Coil = 6 "coil",
        /// The coil's thermometer.
        Thermometer = 7 "thermometer",
        /// The coil's supply.
        Supply = 8 "supply",
        /// The clocks.
        Clock = 9 "clock",
        /// Settings and calibration.
        Configuration = 11 "configuration",
        /// The link to the PC.
        Link = 12 "link",
        /// The flash memory that keeps settings and calibration.
        Storage = 13 "storage",
    }
}
