//! Results of conversions: words, flags, readings, frames.

use crate::{Acquisition, Channel, Status};

/// A 28-bit conversion result. Compute differences in integers: an `f32` holds only 24 bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Code28(u32);

impl Code28 {
    /// Result below the range, or of a chip that has not converted (datasheet Table 37, note 3).
    pub const UNDER_RANGE: Self = Self(0);
    /// Result above the range (datasheet Table 37, note 4).
    pub const OVER_RANGE: Self = Self(0x0FFF_FFFF);

    /// Creates a code from a number below 2^28.
    ///
    /// ```
    /// use ldc161x::Code28;
    /// assert!(Code28::new(0x0FFF_FFFF).is_some());
    /// assert!(Code28::new(0x1000_0000).is_none());
    /// ```
    pub const fn new(code: u32) -> Option<Self> {
        if code <= Self::OVER_RANGE.0 {
            Some(Self(code))
        } else {
            None
        }
    }

    /// The code as an integer.
    ///
    /// ```
    /// assert_eq!(ldc161x::Code28::OVER_RANGE.get(), 0x0FFF_FFFF);
    /// ```
    pub const fn get(self) -> u32 {
        self.0
    }

    /// `self - other`, exact.
    ///
    /// ```
    /// use ldc161x::Code28;
    /// let (a, b) = (Code28::new(0x4409E8B).unwrap(), Code28::new(0x4409E8C).unwrap());
    /// assert_eq!(a.difference(b), -1);
    /// ```
    pub const fn difference(self, other: Self) -> i32 {
        self.0 as i32 - other.0 as i32
    }
}

/// The four error flags in a conversion result (datasheet Table 1). They do not suppress the code,
/// which is always kept. Reading the word clears the flags in the chip.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Flags {
    /// ERR_UR: the result would have been negative; OFFSETx is too large.
    pub under_range: bool,
    /// ERR_OR: the sensor is faster than the reference.
    pub over_range: bool,
    /// ERR_WD: the conversion was aborted and the code is meaningless.
    pub watchdog: bool,
    /// ERR_AE: amplitude outside 1.2 to 1.8 V; the drive current does not suit the sensor.
    pub amplitude: bool,
}

impl Flags {
    /// Whether any flag is set.
    ///
    /// ```
    /// assert!(!ldc161x::Flags::default().any());
    /// ```
    pub const fn any(self) -> bool {
        self.under_range || self.over_range || self.watchdog || self.amplitude
    }
}

/// The 32 bits of DATAx_MSB and DATAx_LSB as they were read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Word(u32);

impl Word {
    /// Creates a word from DATAx_MSB and DATAx_LSB.
    ///
    /// ```
    /// use ldc161x::Word;
    /// let word = Word::from_registers(0x1440, 0x9E8B);
    /// assert_eq!(word.code().get(), 0x4409E8B);
    /// assert!(word.flags().amplitude);
    /// ```
    pub const fn from_registers(msb: u16, lsb: u16) -> Self {
        Self((msb as u32) << 16 | lsb as u32)
    }

    /// Creates a word from all 32 bits.
    ///
    /// ```
    /// assert!(ldc161x::Word::from_bits(0x4FFF_FFFF).flags().over_range);
    /// ```
    pub const fn from_bits(bits: u32) -> Self {
        Self(bits)
    }

    /// All 32 bits.
    ///
    /// ```
    /// assert_eq!(ldc161x::Word::from_registers(0x1000, 2).bits(), 0x1000_0002);
    /// ```
    pub const fn bits(self) -> u32 {
        self.0
    }

    /// The conversion result.
    ///
    /// ```
    /// assert_eq!(ldc161x::Word::from_registers(0xF000, 2).code().get(), 2);
    /// ```
    pub const fn code(self) -> Code28 {
        Code28(self.0 & 0x0FFF_FFFF)
    }

    /// The error flags.
    ///
    /// ```
    /// assert!(ldc161x::Word::from_registers(0x8000, 0).flags().under_range);
    /// ```
    pub const fn flags(self) -> Flags {
        Flags {
            under_range: self.0 >> 31 & 1 == 1,
            over_range: self.0 >> 30 & 1 == 1,
            watchdog: self.0 >> 29 & 1 == 1,
            amplitude: self.0 >> 28 & 1 == 1,
        }
    }
}

/// Whether a result is new, as reported by STATUS. A frame that is read at an edge of INTB is
/// always new.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Freshness {
    /// Unknown: STATUS was not read.
    #[default]
    NotAsked,
    /// STATUS showed an unread result.
    New,
    /// STATUS showed no unread result: the result is an old one, with its flags cleared.
    Repeated,
}

/// Verdict on a reading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum Quality {
    /// No objection. Whether the sensor is within its planned range is checked separately, by
    /// [`Sensor::covers`](crate::Sensor::covers).
    Good,
    /// Read after a gap (start, recovery, bus error). An earlier, failed read may have cleared the
    /// flags of this result, and a channel that has not converted since the gap still returns its
    /// old result.
    AfterGap,
    /// Amplitude flag: below 1.2 V the result is noisier, above 1.8 V the ESD clamp shifts it.
    Amplitude,
    /// Watchdog flag: the code is meaningless.
    Watchdog,
    /// Code 0 or the under-range flag: no oscillation, no conversion yet, or OFFSETx too large.
    UnderRange,
    /// Code 2^28 - 1 or the over-range flag: the sensor is faster than the reference.
    OverRange,
    /// The counter's input is at or above a quarter of the reference frequency, outside the
    /// datasheet's limit (Table 43). Posted words of boards that run this way (0.266 of the
    /// reference) are still ratios of counts.
    AboveQuarterReference,
    /// STATUS showed no unread result: this result was read before.
    Repeated,
    /// The two reads of the word returned different codes.
    Differs,
}

/// One conversion of one channel: word, frequency and uncertainty together.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Reading {
    /// The channel.
    pub channel: Channel,
    /// Flags and code as read.
    pub word: Word,
    /// Frequency of the sensor in hertz (see [`Scale`](crate::Scale)), computed whatever the flags
    /// are. It is an `f64`, because an `f32` has steps of 0.25 Hz at 3 MHz, as large as the noise
    /// of a long conversion.
    pub frequency_hz: f64,
    /// Standard uncertainty of `frequency_hz` in hertz from quantisation and white noise, without
    /// the error of the reference clock.
    pub sigma_hz: f32,
    /// Whether the counter's input was at or above a quarter of the reference frequency, beyond the
    /// limit of the datasheet's Table 43.
    pub above_quarter_reference: bool,
    /// Whether the result is new.
    pub freshness: Freshness,
    /// Whether both reads returned the same code; `None` unless every word is read twice.
    pub agrees: Option<bool>,
    /// Whether the frame follows a gap.
    pub after_gap: bool,
}

impl Reading {
    /// Placeholder for an unused entry of a frame.
    const NONE: Self = Self {
        channel: Channel::Zero,
        word: Word(0),
        frequency_hz: 0.0,
        sigma_hz: 0.0,
        above_quarter_reference: false,
        freshness: Freshness::NotAsked,
        agrees: None,
        after_gap: false,
    };

    /// The verdict on this reading; if there are several objections, the gravest.
    ///
    /// ```
    /// use ldc161x::{Quality, Reading, Word};
    /// let reading = Reading { word: Word::from_registers(0x2440, 1), ..Reading::default() };
    /// assert_eq!(reading.quality(), Quality::Watchdog);
    /// ```
    pub fn quality(&self) -> Quality {
        let (flags, code) = (self.word.flags(), self.word.code());
        if self.agrees == Some(false) {
            Quality::Differs
        } else if flags.watchdog {
            Quality::Watchdog
        } else if flags.under_range || code == Code28::UNDER_RANGE {
            Quality::UnderRange
        } else if flags.over_range || code == Code28::OVER_RANGE {
            Quality::OverRange
        } else if self.above_quarter_reference {
            Quality::AboveQuarterReference
        } else if flags.amplitude {
            Quality::Amplitude
        } else if self.freshness == Freshness::Repeated {
            Quality::Repeated
        } else if self.after_gap {
            Quality::AfterGap
        } else {
            Quality::Good
        }
    }

    /// Whether the quality is [`Quality::Good`]. The reading of a sensor far outside its planned
    /// range may be good: its frequency is true below the limit of the deglitch filter, although
    /// settle count and drive current were planned for another range
    /// ([`Sensor::covers`](crate::Sensor::covers)).
    ///
    /// ```
    /// use ldc161x::{Reading, Word};
    /// let reading = Reading { word: Word::from_registers(0x0340, 1), ..Reading::default() };
    /// assert!(reading.is_good());
    /// ```
    pub fn is_good(&self) -> bool {
        self.quality() == Quality::Good
    }
}

/// Events between the previous frame and this one.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Marks {
    /// Conversions may be missing before this frame, because of a start, a recovery or a bus error.
    pub gap: bool,
    /// The drive current has changed, which shifts the code (datasheet 8.1.5.4).
    pub drive_step: bool,
}

/// One result for every active channel.
///
/// With autoscan, the channels are converted one after the other, never at the same instant.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Frame {
    /// Number of the frame since the driver was created; wraps.
    pub number: u32,
    /// Events between the previous frame and this one.
    pub marks: Marks,
    /// The value of STATUS, if STATUS was read.
    pub status: Option<Status>,
    readings: [Reading; 4],
    count: u8,
}

impl Frame {
    pub(crate) fn new(number: u32, marks: Marks, status: Option<Status>) -> Self {
        Self {
            number,
            marks,
            status,
            readings: [Reading::NONE; 4],
            count: 0,
        }
    }

    /// Adds a reading. The chip has four channels: a fifth reading is dropped.
    pub(crate) fn push(&mut self, reading: Reading) {
        if let Some(slot) = self.readings.get_mut(usize::from(self.count)) {
            *slot = reading;
            self.count += 1;
        }
    }

    /// The readings in the order of conversion.
    ///
    /// ```
    /// assert!(ldc161x::Frame::default().readings().is_empty());
    /// ```
    pub fn readings(&self) -> &[Reading] {
        self.readings.get(..usize::from(self.count)).unwrap_or(&[])
    }

    /// The reading of one channel.
    ///
    /// ```
    /// assert!(ldc161x::Frame::default().of(ldc161x::Channel::Zero).is_none());
    /// ```
    pub fn of(&self, channel: Channel) -> Option<&Reading> {
        self.readings()
            .iter()
            .find(|reading| reading.channel == channel)
    }

    /// Whether the frame holds one reading for each channel of `acquisition`.
    ///
    /// ```
    /// use ldc161x::{Acquisition, Channel, Frame};
    /// assert!(!Frame::default().covers(Acquisition::Single(Channel::Zero)));
    /// ```
    pub fn covers(&self, acquisition: Acquisition) -> bool {
        acquisition
            .channels()
            .eq(self.readings().iter().map(|reading| reading.channel))
    }
}
