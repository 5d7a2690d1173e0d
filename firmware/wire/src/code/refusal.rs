//! Reasons why a measurement gives no estimate.
//!
//! The tool shows the first sentence of each reason's comment to the user, with value and limit
//! (`host/cli/src/describe.rs`), and the protocol's table has the whole comment.

codes! {
    /// Reason why a measurement gave no estimate. The record `refusal` carries a value and a limit;
    /// their meaning follows. Number 2 is reserved.
    pub enum RefusalReason {
        /// A calibration is missing. Value: kind of the record that would carry it.
        NotCalibrated = 1 "not_calibrated",
        /// The contact was lost. Value: time since the start, s.
        ContactLost = 3 "contact_lost",
        /// The press did not become steady. Value and limit: drift, m/s.
        Unsteady = 4 "unsteady",
        /// Pressed too little. Value and limit: deformation, m.
        PressedTooLittle = 5 "pressed_too_little",
        /// Pressed beyond the calibration. Value and limit: deformation, m.
        PressedTooFar = 6 "pressed_too_far",
        /// Too few samples. Value: samples taken; limit: samples needed.
        TooFewSamples = 7 "too_few_samples",
        /// Conversions were lost. Value and limit: number.
        ConversionsLost = 8 "conversions_lost",
        /// The converter flagged conversions. Value and limit: number.
        Flagged = 9 "flagged",
        /// Two effects cannot be distinguished: the current did not change, or drift has the shape
        /// of the signal. Value: index of the term.
        IllConditioned = 10 "ill_conditioned",
        /// The sums exceed the range of numbers, or the estimate exceeds that of the protocol.
        NotFinite = 11 "not_finite",
        /// The deformation does not follow the current significantly. Value: slope in standard errors;
        /// limit: the least that is needed.
        SignalTooSmall = 12 "signal_too_small",
        /// The deformation follows the current in the wrong direction. Value: slope in standard
        /// errors.
        SignalReversed = 13 "signal_reversed",
        /// The whole interval lies at negative stiffness. Value: greatest c_S/c_L in it.
        NegativeStiffness = 14 "negative_stiffness",
        /// The samples do not fit the calibrated stiffening. Value: standard error of c_S/c_L from the
        /// misfit; limit: that from all other causes.
        Misfit = 15 "misfit",
        /// The standard error is greater than the settings allow. Value and limit: standard error
        /// as a fraction of the stiffness.
        TooUncertain = 16 "too_uncertain",
        /// The current did not follow its setpoint. Value: current, A; limit: setpoint, A.
        CurrentOffTarget = 17 "current_off_target",
        /// The supply cannot drive the peak current. Value and limit: current, A.
        PeakNotReached = 18 "peak_not_reached",
        /// The coil is too hot, or would become so. Value and limit: temperature, degrees Celsius.
        CoilTooHot = 19 "coil_too_hot",
        /// The pulse would exceed the energy that the settings allow for one measurement, or that
        /// the coil's drive has left. Value and limit: energy, J. In the second case both include the
        /// energy that the coil has not dissipated yet; `wait_s` is the time until it has.
        TooMuchEnergy = 20 "too_much_energy",
        /// The user aborted it.
        Aborted = 21 "aborted",
        /// A fault ended it. Value: number of the fault.
        Faulted = 22 "faulted",
        /// It took too long. Value and limit: time, s.
        TimedOut = 23 "timed_out",
        /// Before the touch the sensor was not at the rest position of its calibration: an object lay
        /// on it, or the rest position has moved. Value: its reading, as a deformation, m; limit: the
        /// greatest reading of an untouched sensor.
        RestMoved = 24 "rest_moved",
        /// The ramps bend as with an object that relaxes within them: press a spring to tell. A stand that
        /// shakes in step and less cross-talk than calibrated bend them alike; a lag, play or saturation
        /// of the stiffening bends them the other way (`misfit`). Value and limit: as for `misfit`.
        Relaxes = 25 "relaxes",
        /// The contact is off the centre by more than the calibration's contact tolerance states. The
        /// centre is the origin of the places of an array of coils. Value: distance, m; limit: the
        /// tolerance.
        OffCentre = 26 "off_centre",
    }
}
