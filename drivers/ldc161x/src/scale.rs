//! Conversion of a code to a frequency with its uncertainty.

use core::num::NonZeroU32;

use crate::{ClockDividers, Code28, Rational, Rcount, rational::mean_reference_periods};

/// Noise parameters of a channel.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Noise {
    /// White noise of the sensor's frequency: relative standard deviation of its mean over 1 ms.
    /// The noise is inversely proportional to the square root of the conversion time. Quantisation
    /// alone explains the noise that users of LDC1612 boards measure at 12 MHz and 250 samples/s,
    /// within the scatter of their figures. So zero is right for short conversions; long ones need
    /// a figure measured on the board.
    pub white_relative_in_1_ms: f32,
    /// Delay of the comparator's falling edge after the rising one, as a fraction of the sensor's
    /// period, 0 to 1. With a delay, the stated quantisation error is that at the reading's
    /// frequency; with `None`, it is the mean over all phases. No source states the delay; posted
    /// words fit 0.15 to 0.4 equally well.
    pub comparator_duty: Option<f32>,
}

/// Parameters that convert the codes of one channel to frequencies.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Scale {
    /// Frequency of CLKIN or of the internal oscillator, before FREF_DIVIDER, in hertz.
    pub clock_hz: f64,
    /// Dividers of sensor and reference.
    pub dividers: ClockDividers,
    /// OFFSETx.
    pub offset: u16,
    /// RCOUNTx.
    pub rcount: Rcount,
    /// Noise parameters.
    pub noise: Noise,
}

impl Scale {
    /// Creates a scale with both dividers 1, no offset, and no noise except quantisation.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Scale};
    /// let scale = Scale::undivided(12e6, Rcount::new(1512).unwrap());
    /// let f = scale.frequency_hz(Code28::new(0x4409E8B).unwrap());
    /// assert!((f - 3_189_314.4).abs() < 0.1);
    /// ```
    pub const fn undivided(clock_hz: f64, rcount: Rcount) -> Self {
        Self {
            clock_hz,
            dividers: ClockDividers::UNDIVIDED,
            offset: 0,
            rcount,
            noise: Noise {
                white_relative_in_1_ms: 0.0,
                comparator_duty: None,
            },
        }
    }

    /// Reference frequency fREF in hertz: the clock divided by FREF_DIVIDER.
    ///
    /// ```
    /// use ldc161x::{Rcount, Scale};
    /// assert_eq!(Scale::undivided(40e6, Rcount::MIN).reference_hz(), 40e6);
    /// ```
    pub fn reference_hz(&self) -> f64 {
        // A divider of 1, the most common one, needs no division, which takes microseconds on a
        // core without a hardware divider.
        match self.dividers.reference() {
            1 => self.clock_hz,
            divider => self.clock_hz / f64::from(divider),
        }
    }

    /// Length of the conversion in seconds, 16 RCOUNT / fREF. A reading is the mean over this time,
    /// so its time is the middle: half this length before the conversion's end.
    ///
    /// ```
    /// use ldc161x::{Rcount, Scale};
    /// let scale = Scale::undivided(40e6, Rcount::new(2500).unwrap());
    /// assert!((scale.conversion_s() - 1e-3).abs() < 1e-9);
    /// ```
    pub fn conversion_s(&self) -> f64 {
        f64::from(self.rcount.reference_periods()) / self.reference_hz()
    }

    /// Frequency in hertz: f = FIN_DIVIDER fREF (DATA / 2^28 + OFFSET / 2^16), datasheet Equation
    /// 6. `state.rs` applies the same formula to each frame, with a precomputed unit.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Scale};
    /// let scale = Scale { offset: 0x1000, ..Scale::undivided(32e6, Rcount::MIN) };
    /// // 1/16 from the code and 1/16 from the offset
    /// assert_eq!(scale.frequency_hz(Code28::new(1 << 24).unwrap()), 4e6);
    /// ```
    pub fn frequency_hz(&self, code: Code28) -> f64 {
        f64::from(self.with_offset(code)) * self.hz_per_lsb()
    }

    /// The code with OFFSETx added back; it may exceed 28 bits.
    pub(crate) fn with_offset(&self, code: Code28) -> u32 {
        code.get() + (u32::from(self.offset) << 12)
    }

    /// One unit of the code in hertz, for differences of codes.
    ///
    /// ```
    /// use ldc161x::{Rcount, Scale};
    /// let scale = Scale::undivided(40e6, Rcount::MIN);
    /// assert!((scale.hz_per_lsb() - 0.149).abs() < 1e-3);
    /// ```
    pub fn hz_per_lsb(&self) -> f64 {
        let hz = self.reference_hz() / f64::from(1_u32 << 28);
        match self.dividers.sensor() {
            1 => hz,
            divider => f64::from(divider) * hz,
        }
    }

    /// Whether the counter's input is at or above fREF / 4, beyond the limit of the datasheet's
    /// Table 43.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Scale};
    /// let scale = Scale::undivided(12e6, Rcount::MIN);
    /// assert!(scale.above_quarter_reference(Code28::new(0x4409E8B).unwrap()));
    /// ```
    pub fn above_quarter_reference(&self, code: Code28) -> bool {
        self.counted(code).get() >= 1 << 26
    }

    /// The word as a ratio of counts, with OFFSETx added back.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Scale};
    /// let scale = Scale::undivided(12e6, Rcount::new(3049).unwrap());
    /// let ratio = scale.rational(Code28::new(0x43C923B).unwrap());
    /// assert_eq!((ratio.m, ratio.n), (25_829, 97_546));
    /// ```
    pub fn rational(&self, code: Code28) -> Rational {
        Rational::decode(self.counted(code), self.rcount)
    }

    /// The code as counted, before OFFSETx was subtracted; at most full scale.
    fn counted(&self, code: Code28) -> Code28 {
        Code28::new(self.with_offset(code)).unwrap_or(Code28::OVER_RANGE)
    }

    /// Relative standard uncertainty of one conversion, from quantisation, rounding of the word and
    /// white noise.
    ///
    /// Quantisation: the counter measures sensor periods between two edges, once from rising edges
    /// and once from falling ones, each to a whole reference period, and adds the two counts. Each
    /// of the four edges is detected late, by a time that is uniform between 0 and one reference
    /// period. The first edges of the two gates are a fixed time apart, and so are the last, so
    /// their errors are correlated: the sum of the errors of two edges x reference periods apart
    /// has the variance V(x) = 1/3 - h (1 - h), where h is the fractional part of x. If a sensor
    /// period has p reference periods and the falling edge follows the rising one after the
    /// fraction d of a period, then x is d p or (1 - d) p, depending on which edge comes first in
    /// the gate, and
    ///
    /// sigma_f / f = sqrt(2 ((1 - d) V(d p) + d V((1 - d) p))) / N,
    ///
    /// where N is on average 32 RCOUNT - 8 - 3 p, since each gate starts at an edge and ends at
    /// one. The fewer periods a conversion contains, the smaller is the fraction of it that is
    /// counted.
    ///
    /// The result lies between 0.0128 / RCOUNT and 0.0255 / RCOUNT; its mean square over all phases
    /// is (0.018 / RCOUNT)^2 = 1 / (12 (fREF tC)^2), where tC is the conversion time, as in
    /// application note SNOA944. If d is not known, the root of this mean is stated; at a single
    /// frequency it may be wrong by up to a factor of 1.41. For a counter of half periods in one
    /// gate, which always has 0.0128 / RCOUNT, the stated value is an upper bound. The uncertainty
    /// applies to an unknown frequency, or to one that changes by more than 1 / (16 RCOUNT): at a
    /// constant frequency the count may be the same for ever.
    ///
    /// Rounding: the word is a whole number, so sigma_f / f = 1 / (sqrt(12) DATA). Rounding exceeds
    /// quantisation if p^2 is above 2^28 divided by the number of periods counted.
    ///
    /// The count is the mean frequency between the first and the last edge counted, which lie up to
    /// two periods within the conversion. A frequency that changes by the fraction r per second
    /// adds an error of about a third of r / f; at 3 MHz that is negligible.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Scale};
    /// let scale = Scale::undivided(40e6, Rcount::new(2500).unwrap());
    /// let sigma = scale.relative_sigma(Code28::new(20_132_660).unwrap()); // 3 MHz
    /// assert!((sigma * 2500.0 - 0.018).abs() < 0.0001);
    /// ```
    pub fn relative_sigma(&self, code: Code28) -> f32 {
        let word = NonZeroU32::new(self.counted(code).get()).unwrap_or(NonZeroU32::MIN);
        let n = mean_reference_periods(self.rcount, word) as f32;
        let count_variance = match self.noise.comparator_duty {
            None => MEAN_VARIANCE,
            Some(duty) => edge_variance((1_u32 << 28) as f32 / word.get() as f32, duty),
        };
        // All variances are in squared reference periods, which saves divisions: they are slow on a
        // core without floating point.
        let last_bit = n / word.get() as f32;
        let mut variance = count_variance + ROUNDING_VARIANCE * last_bit * last_bit;
        let white = self.noise.white_relative_in_1_ms;
        if white != 0.0 {
            variance += white * white * 1e-3 / self.conversion_s() as f32 * n * n;
        }
        libm::sqrtf(variance) / n
    }

    /// Standard uncertainty of [`frequency_hz`](Self::frequency_hz) in hertz.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Scale};
    /// let scale = Scale::undivided(12e6, Rcount::new(1512).unwrap());
    /// let sigma = scale.sigma_hz(Code28::new(0x4409E8B).unwrap());
    /// assert!((sigma - 38.0).abs() < 0.5);
    /// ```
    pub fn sigma_hz(&self, code: Code28) -> f32 {
        self.relative_sigma(code) * self.frequency_hz(code) as f32
    }
}

/// Variance of N in squared reference periods: the mean over all phases.
const MEAN_VARIANCE: f32 = 1.0 / 3.0;
/// Variance of the word due to its rounding, in squared units of its last bit.
const ROUNDING_VARIANCE: f32 = 1.0 / 12.0;

/// Variance of N in squared reference periods; `period` is the sensor period in reference periods.
/// See [`Scale::relative_sigma`].
fn edge_variance(period: f32, duty: f32) -> f32 {
    let pair = |distance: f32| {
        let h = distance - libm::floorf(distance);
        1.0 / 3.0 - h * (1.0 - h)
    };
    2.0 * ((1.0 - duty) * pair(duty * period) + duty * pair((1.0 - duty) * period))
}
