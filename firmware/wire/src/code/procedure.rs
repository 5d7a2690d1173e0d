//! Codes of the procedure: its states, and the choices that commands set.

codes! {
    /// Use of the instrument.
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
        /// Learning the reading of the untouched sensor.
        Baseline = 2 "baseline",
        /// Waiting for a contact.
        Watching = 3 "watching",
        /// An object touches.
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
        /// Driving a current commanded directly by the PC.
        Manual = 11 "manual",
    }

    /// Contact of an object with the sensor.
    pub enum Contact {
        /// Unknown: the baseline is being learnt.
        Settling = 1 "settling",
        /// No object touches.
        Clear = 2 "clear",
        /// An object touches, detected with this sample.
        Began = 3 "began",
        /// An object touches.
        Held = 4 "held",
        /// The object was released, detected with this sample.
        Ended = 5 "ended",
    }

    /// Slow change of the deformation that the estimate models.
    pub enum Drift {
        /// None.
        None = 1 "none",
        /// Proportional to time.
        Linear = 2 "linear",
        /// ln(1 + t/tau), creep over decades of time, plus a straight line.
        Logarithmic = 3 "logarithmic",
        /// 1 - exp(-t/tau), one mode of creep, plus a straight line.
        Exponential = 4 "exponential",
        /// Restarting with every ramp, heat of the coil, plus a straight line.
        SawTooth = 5 "saw_tooth",
    }

    /// Records of conversions that the device sends.
    pub enum Stream {
        /// None.
        Off = 1 "off",
        /// `sample`, evaluated.
        Samples = 2 "samples",
        /// `raw`, packed, for rates that the transport cannot carry otherwise.
        Raw = 3 "raw",
    }

    /// Shape of the tip on the sensor.
    pub enum TipShape {
        /// None is declared: no modulus follows from a stiffness.
        None = 1 "none",
        /// Cylinder with a flat face.
        FlatPin = 2 "flat_pin",
        /// Sphere.
        Ball = 3 "ball",
    }

    /// Part of the calibration; its number is the kind of the record that carries it.
    pub enum Part {
        /// A channel's resonator.
        Tank = 0x11 "tank",
        /// Deformation of a channel as a function of its inductance.
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
        /// Attraction between the halves of the actuated layer.
        Attraction = 0x18 "attraction",
        /// Uncertainty added by a temperature other than the calibration's.
        TemperatureEffect = 0x19 "temperature_effect",
        /// Corrections of the measured current.
        CurrentCorrection = 0x1A "current_correction",
        /// Identity of the calibration.
        CalibrationIdentity = 0x1B "calibration_identity",
        /// Change of springs and magnetorheological effect with temperature.
        TemperatureCoefficients = 0x1C "temperature_coefficients",
        /// Tip and object, as declared.
        Tip = 0x23 "tip",
        /// Contacts for which intervals hold.
        Contact = 0x28 "contact",
        /// Array of coils for place, force and radius of a press.
        TouchArray = 0x29 "touch_array",
        /// Creep of the sensor's layers.
        Creep = 0x2B "creep",
    }

    /// What the readings of an array of coils say.
    pub enum TouchVerdict {
        /// The reading of the untouched sensor is being learnt.
        Settling = 1 "settling",
        /// No reading is clearly above its noise.
        Clear = 2 "clear",
        /// A press: place, force and radius.
        Inside = 3 "inside",
        /// A press: place and force hold for every radius that was possible beforehand.
        RadiusNotDetermined = 4 "radius_not_determined",
        /// The press lies outside of the calibrated disc.
        BeyondArray = 5 "beyond_array",
        /// No single press gives these readings: two contacts, an edge, a tilted face, a changed gain, or
        /// another indenter than declared.
        DoesNotFit = 6 "does_not_fit",
        /// The readings do not determine place and force.
        NotConverged = 7 "not_converged",
        /// A reading is flagged.
        NotReadable = 8 "not_readable",
        /// A reading is clearly below that of the untouched sensor and none is above: a press beyond the
        /// array, or the sensor was pressed while its untouched reading was learnt. `set_settings` lets it
        /// learn anew.
        BelowRest = 9 "below_rest",
    }
}
