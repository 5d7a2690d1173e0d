//! Conversions, evaluated or packed.

use heapless::Vec;

use crate::code::Contact;

structure! {
    /// One conversion of every active channel of a converter, and the values computed from them.
    /// The header's time is the middle of the first of the conversions.
    pub struct Sample {
        /// Converter: 0 first, 1 second.
        sensor: u8 ["", 0, 1],
        /// Number of conversions of this converter (scans, with several channels) that were lost between
        /// its last record and this one.
        missed: u32 ["1"],
        /// The time before this record is unknown: start, recovery, or conversions were lost.
        gap: bool,
        /// The conversions in order of time.
        channels: Vec<Conversion, 4>,
        /// State of contact.
        contact: Contact,
        /// Contact force; absent without a calibration.
        force_n: Option<f32> ["N", -1e4, 1e4],
        /// Standard uncertainty of the force; absent without a calibration.
        force_sigma_n: Option<f32> ["N", 0, 1e4],
        /// Mean measured current of the coil over the first conversion; absent without a current
        /// measurement.
        current_a: Option<f32> ["A", -100, 100],
        /// RMS ripple about that mean from the bridge's switching, computed from coil and supply; absent
        /// if unknown. Stiffening, crosstalk and heat depend on the square of the current and see
        /// sqrt(current_a^2 + ripple_a^2).
        ripple_a: Option<f32> ["A", 0, 100],
    }
}

structure! {
    /// One conversion of one channel.
    pub struct Conversion {
        /// Number of the channel.
        channel: u8 ["", 0, 3],
        /// Time from the header's time to the middle of this conversion.
        offset_us: u16 ["us"],
        /// Registers DATAx_MSB (upper half) and DATAx_LSB as read: bits 31 to 28 are the error
        /// flags under-range, over-range, watchdog, amplitude; bits 27 to 0 the result.
        word: u32,
        /// Frequency of the sensor, independent of the flags.
        frequency_hz: f64 ["Hz", 0, 1e9],
        /// Standard uncertainty of the frequency from quantisation and noise.
        sigma_hz: f32 ["Hz", 0, 1e9],
        /// Deformation above the sensor's coil, corrected for baseline, cross-talk and drift; absent
        /// without a calibration, and for a channel without a deformation.
        deformation_m: Option<f32> ["m", -0.1, 0.1],
        /// Standard uncertainty of the deformation.
        deformation_sigma_m: Option<f32> ["m", 0, 0.1],
        /// The deformation is beyond the calibrated curve.
        extrapolated: bool,
    }
}

structure! {
    /// Consecutive conversions without a gap between them. The header's time is the middle of the first
    /// one; a scan over several channels counts as one conversion. A run ends early if conversions are
    /// lost.
    pub struct Raw {
        /// Converter: 0 first, 1 second.
        sensor: u8 ["", 0, 1],
        /// Number of conversions (scans) that were lost between the last record of this converter and
        /// this one.
        missed: u32 ["1"],
        /// Active channels: bit n for channel n.
        channels: u8 ["", 1, 15],
        /// Time from one conversion (scan) to the next, by the device's clock.
        period_us: f32 ["us", 1, 1e6],
        /// The words as in `sample`: the active channels from the lowest, scan by scan.
        words: Vec<u32, 32>,
    }
}
