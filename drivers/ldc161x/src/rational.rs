//! Words as ratios of counts: DATA = round(2^28 M / N).
//!
//! The chip counts M sensor periods against N reference periods. Twenty of twenty words that users
//! of LDC1612 boards posted decode this way, with N a little below 32 RCOUNT; a random word decodes
//! this way with a probability of about half a per cent. So words can be checked without a
//! checksum, and averages need no rounding: sum of M over sum of N.
//!
//! This is a hypothesis about the silicon, based on the LDC1612 with one channel and an undivided
//! sensor. It therefore only feeds statistics and never rejects a reading by itself:
//! [`PlausibilityCount`] says whether the hypothesis holds for the chip in use. Words of sensors
//! below 1/37 of the reference frequency are not judged, since too little is known about their N.

use core::num::NonZeroU32;

use crate::{Code28, Rcount};

/// Full scale of a conversion result, 2^28.
const FULL_SCALE: u32 = 1 << 28;

/// Smallest difference between 32 RCOUNT and N: the reference periods that the counter's start-up
/// loses. Posted words lose at least 16 (12 MHz, RCOUNT 1512, 15 words); 10 leaves a margin.
const SMALLEST_DEFICIT: u32 = 10;
/// Largest difference between 32 RCOUNT and N for sensor periods of up to 3.8 reference periods.
/// Posted words lose up to 28 (12 MHz, 14 words); 30 leaves a margin of 2.
const LARGEST_DEFICIT: u32 = 30;
/// Largest difference between 32 RCOUNT and N for slower sensors, (a, b) for a + b p, where p is
/// the sensor period in reference periods. Each of the two gates counts from its first edge to its
/// last, which loses at most 2 p per gate. The variable part of the start-up takes about p / 2 per
/// gate (posted words: 42 reference periods lost at p = 9.15, 28 at 3.77). The constant 11 consists
/// of the start-up's constant part, 8, the rounding of four edges and a margin of 1.
const LARGEST_DEFICIT_PERIODS: (u32, u32) = (11, 5);
/// Largest difference between 32 RCOUNT and N that is searched. It limits the duration of the
/// search and the probability that a random word passes. With a sensor slower than 1/37 of the
/// reference the difference may be larger, so words of such sensors are not judged.
const SEARCH_LIMIT: u32 = 200;

/// Mean difference between 32 RCOUNT and N, (a, b) for a + b p, where p is the sensor period in
/// reference periods. Each of the two gates loses half a sensor period for start-up, half until its
/// first edge, and half after its last edge. Posted words: 20 reference periods lost at p = 3.77,
/// 37 at 9.15.
const MEAN_DEFICIT: (u32, u32) = (8, 3);

/// Mean N of conversions that give `word`, but at least one sensor period.
pub(crate) fn mean_reference_periods(rcount: Rcount, word: NonZeroU32) -> u32 {
    let (constant, periods) = MEAN_DEFICIT;
    let deficit = constant + periods * FULL_SCALE / word;
    let period = FULL_SCALE / word;
    (2 * rcount.reference_periods())
        .saturating_sub(deficit)
        .max(period)
}

/// The values of N that are possible for an RCOUNT and a sensor period.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Window {
    /// Smallest N.
    pub lowest: u32,
    /// Largest N.
    pub highest: u32,
}

impl Window {
    /// The window of a word. The largest N is 32 RCOUNT - 10. The smallest is 32 RCOUNT - 30 or, if
    /// less, 32 RCOUNT - (11 + 5 p), where p = 2^28 / DATA is the sensor period in reference
    /// periods. The smallest N is never more than 200, nor more than half, below 32 RCOUNT.
    ///
    /// ```
    /// use ldc161x::{Code28, Rcount, Window};
    /// let rcount = Rcount::new(1512).unwrap();
    /// let window = Window::of(Code28::new(0x4409E8B).unwrap(), rcount);
    /// assert_eq!((48_384 - window.lowest, 48_384 - window.highest), (30, 10));
    /// ```
    pub const fn of(code: Code28, rcount: Rcount) -> Self {
        let gate = 2 * rcount.reference_periods();
        let (deficit, limit) = (largest_deficit(code), largest_searched(rcount));
        let deficit = if deficit > limit { limit } else { deficit };
        Self {
            lowest: gate - deficit,
            highest: gate - SMALLEST_DEFICIT,
        }
    }

    /// Number of values of N in the window.
    ///
    /// ```
    /// let window = ldc161x::Window { lowest: 10, highest: 30 };
    /// assert_eq!(window.count(), 21);
    /// ```
    pub const fn count(self) -> u32 {
        self.highest - self.lowest + 1
    }
}

/// Largest possible difference between 32 RCOUNT and N for a word.
const fn largest_deficit(code: Code28) -> u32 {
    let code = if code.get() == 0 { 1 } else { code.get() };
    let (constant, periods) = LARGEST_DEFICIT_PERIODS;
    let deficit = constant + periods * FULL_SCALE / code;
    if deficit < LARGEST_DEFICIT {
        LARGEST_DEFICIT
    } else {
        deficit
    }
}

/// Largest difference between 32 RCOUNT and N that is searched for an RCOUNT.
const fn largest_searched(rcount: Rcount) -> u32 {
    let half = rcount.reference_periods();
    if half < SEARCH_LIMIT {
        half
    } else {
        SEARCH_LIMIT
    }
}

/// A word decoded as a ratio of counts.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Rational {
    /// Sensor periods counted, both gates together.
    pub m: u32,
    /// Reference periods counted, both gates together.
    pub n: u32,
    /// DATA - 2^28 M / N, in units of the last bit of the word.
    pub residual_lsb: f32,
    /// Whether rounding alone explains the residual: |residual| <= 0.5. `None` if the word is not
    /// judged: its sensor is slower than 1/37 of the reference, so that N may lie outside the
    /// [`Window`], or the word is at an end of its range, where it is a limit and not a result.
    pub plausible: Option<bool>,
    /// Probability that a random word of this size is plausible: about the window's count x N /
    /// 2^28, which is 0.4 % at RCOUNT 1512 and nearly 1 at 65,535. The smaller it is, the more
    /// `plausible` is worth.
    pub false_accept: f32,
}

impl Rational {
    /// The ratio closest to `code`, with N within [`Window::of`].
    ///
    /// Needs no division per candidate: DATA x N modulo 2^28 advances by DATA from one N to the
    /// next, and its distance from the nearest multiple of 2^28 is the residual times N.
    ///
    /// ```
    /// use ldc161x::{Code28, Rational, Rcount};
    /// // a word that a user of a 12 MHz LDC1612 board posted
    /// let word = Code28::new(0x4409E8B).unwrap();
    /// let ratio = Rational::decode(word, Rcount::new(1512).unwrap());
    /// assert_eq!((ratio.m, ratio.n), (12_854, 48_364));
    /// assert!(ratio.plausible == Some(true) && ratio.false_accept < 0.005);
    /// // a sensor of 450 kHz at 40 MHz is not judged
    /// let slow = Rational::decode(Code28::new(3_019_899).unwrap(), Rcount::new(2500).unwrap());
    /// assert_eq!(slow.plausible, None);
    /// ```
    pub fn decode(code: Code28, rcount: Rcount) -> Self {
        let data = code.get();
        let window = Window::of(code, rcount);
        let mut phase = data.wrapping_mul(window.lowest) % FULL_SCALE;
        let (mut nearest, mut distance) = (window.lowest, distance_from_whole(phase));
        for n in window.lowest + 1..=window.highest {
            phase = (phase + data) % FULL_SCALE;
            let here = distance_from_whole(phase);
            if here.unsigned_abs() < distance.unsigned_abs() {
                (nearest, distance) = (n, here);
            }
        }
        let n = nearest;
        let product = u64::from(data) * u64::from(n);
        let m = (product + u64::from(FULL_SCALE / 2)) / u64::from(FULL_SCALE);
        // The word 0, the lower end of the range, corresponds to a sensor too slow to be judged.
        let is_judged =
            code != Code28::OVER_RANGE && largest_deficit(code) <= largest_searched(rcount);
        Self {
            m: m as u32,
            n,
            residual_lsb: distance as f32 / n as f32,
            plausible: is_judged.then_some(2 * u64::from(distance.unsigned_abs()) <= u64::from(n)),
            false_accept: false_accept(window),
        }
    }
}

/// Signed distance of `phase` (0 to 2^28 - 1) from the nearest multiple of 2^28.
const fn distance_from_whole(phase: u32) -> i32 {
    if phase < FULL_SCALE / 2 {
        phase as i32
    } else {
        phase as i32 - FULL_SCALE as i32
    }
}

fn false_accept(window: Window) -> f32 {
    let middle = (window.lowest + window.highest) as f32 / 2.0;
    (window.count() as f32 * middle / FULL_SCALE as f32).min(1.0)
}

/// Exact average of words: the sum of M over the sum of N, without intermediate rounding.
///
/// The mean of words would include the rounding of each word and weight all of them equally. The
/// ratio of sums is the result of one long conversion that consists of all the gates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct RatioOfSums {
    m: u64,
    n: u64,
    words: u32,
}

impl RatioOfSums {
    /// Adds one word's counts.
    ///
    /// ```
    /// use ldc161x::{Code28, Rational, RatioOfSums, Rcount};
    /// let rcount = Rcount::new(1512).unwrap();
    /// let mut sums = RatioOfSums::default();
    /// for word in [0x4409E8B, 0x4409E8B] {
    ///     sums.add(&Rational::decode(Code28::new(word).unwrap(), rcount));
    /// }
    /// assert_eq!(sums.ratio(), Some(12_854.0 / 48_364.0));
    /// assert_eq!(sums.words(), 2);
    /// ```
    pub const fn add(&mut self, word: &Rational) {
        self.m += word.m as u64;
        self.n += word.n as u64;
        self.words = self.words.saturating_add(1);
    }

    /// The mean of f_in / f_ref, DATA / 2^28; `None` before the first word.
    ///
    /// ```
    /// assert_eq!(ldc161x::RatioOfSums::default().ratio(), None);
    /// ```
    pub fn ratio(&self) -> Option<f64> {
        (self.n > 0).then(|| self.m as f64 / self.n as f64)
    }

    /// Number of words added.
    ///
    /// ```
    /// assert_eq!(ldc161x::RatioOfSums::default().words(), 0);
    /// ```
    pub const fn words(&self) -> u32 {
        self.words
    }
}

/// Whether the words of one chip support the hypothesis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Hypothesis {
    /// Too few words, or conversions so long that most random words would be plausible too.
    Undecided,
    /// The words are plausible far more often than random words: an implausible word is a corrupt
    /// word.
    Holds,
    /// The words are plausible no more often than random words: verdicts are meaningless on this
    /// chip.
    Fails,
}

/// Counts plausible words, and compares their number with that expected of random words. Words that
/// are not judged do not count.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct PlausibilityCount {
    /// Number of words judged.
    pub words: u32,
    /// Number of words found plausible.
    pub plausible: u32,
    /// Expected number of plausible words if all words were random.
    pub expected_by_chance: f32,
}

impl PlausibilityCount {
    /// Adds the verdict on one word.
    ///
    /// ```
    /// use ldc161x::{Code28, Hypothesis, PlausibilityCount, Rational, Rcount};
    /// let mut count = PlausibilityCount::default();
    /// for word in [0x43C923B, 0x4354E00, 0x44336D2, 0xB3D3D64] {
    ///     let rcount = Rcount::new(3049).unwrap();
    ///     count.add(&Rational::decode(Code28::new(word).unwrap(), rcount));
    /// }
    /// assert_eq!(count.plausible, 4);
    /// assert_eq!(count.hypothesis(), Hypothesis::Holds);
    /// ```
    pub fn add(&mut self, word: &Rational) {
        let Some(plausible) = word.plausible else {
            return;
        };
        self.words = self.words.saturating_add(1);
        self.plausible = self.plausible.saturating_add(u32::from(plausible));
        self.expected_by_chance += word.false_accept;
    }

    /// Whether the words of this chip are ratios of counts.
    ///
    /// `Holds` if at least nine in ten words are plausible and fewer than half would be by chance;
    /// `Fails` if there are at least eight words and fewer than half of them are plausible,
    /// whatever the number expected by chance.
    ///
    /// ```
    /// use ldc161x::{Hypothesis, PlausibilityCount};
    /// let random = PlausibilityCount { words: 100, plausible: 1, expected_by_chance: 0.4 };
    /// assert_eq!(random.hypothesis(), Hypothesis::Fails);
    /// ```
    pub fn hypothesis(&self) -> Hypothesis {
        let (words, plausible) = (self.words as f32, self.plausible as f32);
        if self.words >= 4 && plausible >= 0.9 * words && self.expected_by_chance < 0.5 * words {
            Hypothesis::Holds
        } else if self.words >= 8 && plausible < 0.5 * words {
            Hypothesis::Fails
        } else {
            Hypothesis::Undecided
        }
    }
}
