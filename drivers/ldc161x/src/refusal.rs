//! Reasons why a request cannot be planned.

use core::fmt;

use crate::{
    Channel, Model, Rcount,
    drive::{HIGHEST_AMPLITUDE_V, LOWEST_AMPLITUDE_V},
};

/// The limit that a request would break.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "snake_case"))]
pub enum LimitError {
    /// The chip has fewer channels than requested.
    NoSuchChannel {
        /// The chip.
        model: Model,
    },
    /// The I2C clock is outside 10 to 400 kHz.
    BusClock {
        /// Requested I2C clock, Hz.
        hz: u32,
    },
    /// CLKIN is outside 2 to 40 MHz.
    Clkin {
        /// Requested CLKIN, Hz.
        hz: u32,
    },
    /// The sensor is outside 1 kHz to 10 MHz, or its lowest frequency is above its highest.
    SensorFrequency {
        /// Channel of the sensor.
        channel: Channel,
        /// Requested lowest frequency, Hz.
        lowest_hz: u32,
        /// Requested highest frequency, Hz.
        highest_hz: u32,
    },
    /// The parallel resistance is outside 1 to 100 kiloohm, or its lowest value is above its
    /// highest.
    ParallelResistance {
        /// Channel of the sensor.
        channel: Channel,
        /// Requested lowest resistance, ohm.
        lowest_rp_ohm: u32,
        /// Requested highest resistance, ohm.
        highest_rp_ohm: u32,
    },
    /// No FIN_DIVIDER brings the counter's input below a quarter of the reference frequency.
    ReferenceTooSlow {
        /// Channel of the sensor.
        channel: Channel,
        /// Highest sensor frequency, in hertz.
        sensor_hz: u32,
        /// Lowest reference frequency, in hertz.
        reference_hz: u32,
    },
    /// The settling time that the quality factor requires exceeds the range of SETTLECOUNT.
    SettleTooLong {
        /// Channel of the sensor.
        channel: Channel,
    },
    /// Even the weakest drive current drives the sensor above 1.8 V.
    AmplitudeTooHigh {
        /// Channel of the sensor.
        channel: Channel,
        /// Requested highest resistance, ohm.
        highest_rp_ohm: u32,
    },
    /// No drive current keeps the amplitude between 0.6 and 1.8 V over the range of resistance.
    ResistanceRange {
        /// Channel of the sensor.
        channel: Channel,
        /// Requested lowest resistance, ohm.
        lowest_rp_ohm: u32,
        /// Requested highest resistance, ohm.
        highest_rp_ohm: u32,
    },
    /// The requested rate is zero.
    RateZero,
    /// Settling, switching and the shortest conversions take longer than the requested frame
    /// period.
    RateTooHigh {
        /// The shortest frame, in nanoseconds.
        frame_period_ns: u64,
        /// The requested frame period, in nanoseconds.
        requested_period_ns: u64,
        /// Highest frame rate per second that can be requested.
        most_per_second: u32,
    },
    /// A conversion contains too few sensor periods for its uncertainty to be stated.
    ConversionTooShort {
        /// The channel with the slowest sensor.
        channel: Channel,
        /// Requested RCOUNT.
        rcount: Rcount,
        /// Least RCOUNT with enough sensor periods.
        least: Rcount,
    },
    /// Frames end sooner than the bus can read them, so results would be overwritten unread.
    BusTooSlow {
        /// Time between frames at the fastest clock, in nanoseconds.
        frame_period_ns: u64,
        /// Time on the bus per frame, in nanoseconds.
        frame_read_ns: u64,
        /// Highest frame rate per second that can be requested.
        most_per_second: u32,
    },
}

impl LimitError {
    /// The limit that is broken, with its source.
    ///
    /// ```
    /// let refusal = ldc161x::LimitError::Clkin { hz: 50_000_000 };
    /// assert_eq!(refusal.limit(), "CLKIN 2 to 40 MHz (datasheet 6.5)");
    /// ```
    pub const fn limit(&self) -> &'static str {
        match self {
            Self::NoSuchChannel { .. } => "channels of the chip (datasheet Table 36)",
            Self::BusClock { .. } => "I2C clock 10 to 400 kHz (datasheet 6.6)",
            Self::Clkin { .. } => "CLKIN 2 to 40 MHz (datasheet 6.5)",
            Self::SensorFrequency { .. } => "sensor 1 kHz to 10 MHz (datasheet 6.5)",
            Self::ParallelResistance { .. } => {
                "parallel resistance 1 to 100 kiloohm (datasheet 6.5)"
            }
            Self::ReferenceTooSlow { .. } => {
                "input below a quarter of the reference (datasheet Table 43)"
            }
            Self::SettleTooLong { .. } => "SETTLECOUNT up to 65535 (datasheet Equation 10)",
            Self::AmplitudeTooHigh { .. } => "amplitude up to 1.8 V (datasheet 8.1.5)",
            Self::ResistanceRange { .. } => "amplitude from 0.6 to 1.8 V (datasheet 8.1.5)",
            Self::RateZero => "rate above zero",
            Self::RateTooHigh { .. } => {
                "settling and switching time (datasheet Equations 8 to 10), and six periods of the \
                 sensor in a conversion"
            }
            Self::ConversionTooShort { .. } => "six periods of the sensor in a conversion",
            Self::BusTooSlow { .. } => "time on the bus (datasheet Figure 58)",
        }
    }

    /// The remedy: how to change the request.
    ///
    /// ```
    /// assert!(ldc161x::LimitError::RateZero.remedy().starts_with("ask"));
    /// ```
    pub const fn remedy(&self) -> &'static str {
        match self {
            Self::NoSuchChannel { .. } => "use an LDC1614 or fewer channels",
            Self::BusClock { .. } => "set the bus to 400 kHz",
            Self::Clkin { .. } => "supply a clock of 2 to 40 MHz, or use the internal oscillator",
            Self::SensorFrequency { .. } => "change the coil or its capacitor",
            Self::ParallelResistance { .. } => {
                "below 1 kiloohm use a less lossy coil; above 90 put 100 kiloohm in parallel"
            }
            Self::ReferenceTooSlow { .. } => "supply a faster clock or use a slower sensor",
            Self::SettleTooLong { .. } => "use a sensor of lower quality or higher frequency",
            Self::AmplitudeTooHigh { .. } => "put 100 kiloohm in parallel with the sensor",
            Self::ResistanceRange { .. } => {
                "put a resistor in parallel with the sensor to narrow the range"
            }
            Self::RateZero => "ask for at least one frame a second",
            Self::RateTooHigh { .. } => {
                "ask for fewer frames or channels, or use a faster sensor or one of lower quality"
            }
            Self::ConversionTooShort { .. } => "set a larger RCOUNT, or use a faster sensor",
            Self::BusTooSlow { .. } => {
                "ask for fewer frames or channels, or read a frame in one transaction at 400 kHz"
            }
        }
    }
}

impl fmt::Display for LimitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::NoSuchChannel { model } => {
                write!(f, "the chip has {} channels", model.channel_count())?;
            }
            Self::BusClock { hz } => write!(f, "the bus runs at {hz} Hz")?,
            Self::Clkin { hz } => write!(f, "CLKIN is {hz} Hz")?,
            Self::SensorFrequency {
                channel,
                lowest_hz,
                highest_hz,
            } => {
                write!(
                    f,
                    "channel {channel}: the sensor covers {lowest_hz} to {highest_hz} Hz"
                )?;
            }
            Self::ParallelResistance {
                channel,
                lowest_rp_ohm,
                highest_rp_ohm,
            } => write!(
                f,
                "channel {channel}: the parallel resistance covers {lowest_rp_ohm} to \
                 {highest_rp_ohm} ohm"
            )?,
            Self::ReferenceTooSlow {
                channel,
                sensor_hz,
                reference_hz,
            } => write!(
                f,
                "channel {channel}: no divider brings {sensor_hz} Hz below a quarter of \
                 {reference_hz} Hz"
            )?,
            Self::SettleTooLong { channel } => {
                write!(f, "channel {channel}: the sensor settles too slowly")?;
            }
            Self::AmplitudeTooHigh {
                channel,
                highest_rp_ohm,
            } => write!(
                f,
                "channel {channel}: {highest_rp_ohm} ohm gives more than {} mV even at 16 uA",
                amplitude_limits_mv().1
            )?,
            Self::ResistanceRange {
                channel,
                lowest_rp_ohm,
                highest_rp_ohm,
            } => write!(
                f,
                "channel {channel}: a drive that stays below {} mV at {highest_rp_ohm} ohm gives \
                 less than {} mV at {lowest_rp_ohm} ohm",
                amplitude_limits_mv().1,
                amplitude_limits_mv().0
            )?,
            Self::RateZero => write!(f, "a rate of zero")?,
            Self::RateTooHigh {
                frame_period_ns,
                requested_period_ns,
                most_per_second,
            } => write!(
                f,
                "a frame takes at least {frame_period_ns} ns and may take {requested_period_ns} ns; \
                 {most_per_second} frames a second are possible"
            )?,
            Self::ConversionTooShort {
                channel,
                rcount,
                least,
            } => write!(
                f,
                "channel {channel}: RCOUNT is {}, and the sensor needs {}",
                rcount.get(),
                least.get()
            )?,
            Self::BusTooSlow {
                frame_period_ns,
                frame_read_ns,
                most_per_second,
            } => write!(
                f,
                "a frame ends every {frame_period_ns} ns and takes {frame_read_ns} ns on the bus; \
                 {most_per_second} frames a second are possible"
            )?,
        }
        write!(f, ". Limit: {}. Remedy: {}.", self.limit(), self.remedy())
    }
}

impl core::error::Error for LimitError {}

/// Amplitude limits in millivolt, for the texts of [`LimitError`].
const fn amplitude_limits_mv() -> (u32, u32) {
    (
        (LOWEST_AMPLITUDE_V * 1e3 + 0.5) as u32,
        (HIGHEST_AMPLITUDE_V * 1e3 + 0.5) as u32,
    )
}
