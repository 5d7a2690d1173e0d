//! Codes of the procedure: its states, and the choices that commands set.

codes! {
    /// What the instrument is used for.
    pub enum Mode {
        /// Deformation, force and contact; the coil is never driven.
        SensingOnly = 1 "sensing_only",
        /// Stiffness as well.
        Stiffness = 2 "stiffness",
    }

    /// State of the procedure.
    pub enum State {
        /// Checking converter, bus, bridge and current measurement.
        SelfTest = 1 "self_test",
        /// Learning what the untouched sensor reads.
        Baseline = 2 "baseline",
        /// Waiting for a contact.
        Watching = 3 "watching",
        /// Something touches.
        Contact = 4 "contact",
        /// Waiting until the press is steady.
        Settling = 5 "settling",
        /// Raising the current and holding its peak.
        Peak = 6 "peak",
        /// Driving the train of falling ramps.
        Ramps = 7 "ramps",
        /// Evaluating; ends in an estimate or a refusal.
        Estimating = 8 "estimating",
        /// Waiting until the object is released.
        Release = 9 "release",
        /// Stopped by a fault, with the bridge off.
        Fault = 10 "fault",
        /// Driving a current that the PC commands directly.
        Manual = 11 "manual",
    }

    /// Whether something touches the sensor.
    pub enum Contact {
        /// The baseline is being learnt: not known.
        Settling = 1 "settling",
        /// Nothing touches.
        Clear = 2 "clear",
        /// Something touches, found with this sample.
        Began = 3 "began",
        /// Something touches.
        Held = 4 "held",
        /// The object was released, found with this sample.
        Ended = 5 "ended",
    }

    /// Slow change of the deformation that the estimate allows for.
    pub enum Drift {
        /// None.
        None = 1 "none",
        /// Proportional to time.
        Linear = 2 "linear",
        /// ln(1 + t/tau), creep over decades of time, and a straight line beside it.
        Logarithmic = 3 "logarithmic",
        /// 1 - exp(-t/tau), one mode of creep, and a straight line beside it.
        Exponential = 4 "exponential",
        /// Starting anew with every ramp, heat of the coil, and a straight line beside it.
        SawTooth = 5 "saw_tooth",
    }

    /// Which records of conversions the device sends.
    pub enum Stream {
        /// None.
        Off = 1 "off",
        /// `sample`, evaluated.
        Samples = 2 "samples",
        /// `raw`, packed, for rates that the transport cannot carry otherwise.
        Raw = 3 "raw",
    }

    /// A part of the calibration; its number is the kind of the record that carries it.
    pub enum Part {
        /// A channel's resonator.
        Tank = 0x11 "tank",
        /// A channel's deformation against its inductance.
        DeformationCurve = 0x12 "deformation_curve",
        /// Effect of the coil's current on a channel.
        Crosstalk = 0x13 "crosstalk",
        /// The sensor's springs.
        Springs = 0x14 "springs",
        /// Magnetorheological effect as a law.
        Stiffening = 0x15 "stiffening",
        /// Magnetorheological effect as a curve.
        StiffeningCurve = 0x16 "stiffening_curve",
        /// The coil's data.
        Coil = 0x17 "coil",
        /// Attraction of the actuated layer's halves.
        Attraction = 0x18 "attraction",
        /// Uncertainty added by a temperature other than the calibration's.
        TemperatureEffect = 0x19 "temperature_effect",
        /// Corrections of the measured current.
        CurrentCorrection = 0x1A "current_correction",
        /// Which calibration it is.
        CalibrationIdentity = 0x1B "calibration_identity",
        /// How springs and magnetorheological effect change with the temperature.
        TemperatureCoefficients = 0x1C "temperature_coefficients",
    }
}
