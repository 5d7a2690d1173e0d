//! Register file: addresses, and one typed value for each writable register.
//!
//! The types contain the fields only. `to_bits` adds the reserved bits, so that they cannot be set
//! wrong; `from_bits` rejects a word whose reserved bits differ from the datasheet's.

use core::fmt;

use crate::{Acquisition, Channel, DriveCode, Sequence};

/// A register of the chip (datasheet Figure 14).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Register {
    /// DATAx_MSB: error flags and conversion result, bits 27 to 16 (7.6.2).
    DataMsb(Channel),
    /// DATAx_LSB: conversion result, bits 15 to 0, latched by reading DATAx_MSB (7.6.3).
    DataLsb(Channel),
    /// RCOUNTx: length of the conversion (7.6.10).
    Rcount(Channel),
    /// OFFSETx: value subtracted from the result (7.6.14).
    Offset(Channel),
    /// SETTLECOUNTx: time for the oscillation to build up (7.6.18).
    SettleCount(Channel),
    /// CLOCK_DIVIDERSx: sensor and reference dividers (7.6.22).
    ClockDividers(Channel),
    /// STATUS (7.6.26).
    Status,
    /// ERROR_CONFIG: events reported in the data word and on INTB (7.6.27).
    ErrorConfig,
    /// CONFIG (7.6.28).
    Config,
    /// MUX_CONFIG: autoscan and deglitch filter (7.6.29).
    MuxConfig,
    /// RESET_DEV (7.6.30).
    ResetDev,
    /// DRIVE_CURRENTx (7.6.31).
    DriveCurrent(Channel),
    /// MANUFACTURER_ID, always 0x5449 (7.6.35).
    ManufacturerId,
    /// DEVICE_ID, always 0x3055 (7.6.36).
    DeviceId,
}

impl Register {
    /// The pointer byte that selects this register.
    ///
    /// ```
    /// use ldc161x::{Channel, Register};
    /// assert_eq!(Register::DriveCurrent(Channel::Two).address(), 0x20);
    /// ```
    pub const fn address(self) -> u8 {
        match self {
            Self::DataMsb(channel) => 2 * channel.number(),
            Self::DataLsb(channel) => 2 * channel.number() + 1,
            Self::Rcount(channel) => 0x08 + channel.number(),
            Self::Offset(channel) => 0x0C + channel.number(),
            Self::SettleCount(channel) => 0x10 + channel.number(),
            Self::ClockDividers(channel) => 0x14 + channel.number(),
            Self::Status => 0x18,
            Self::ErrorConfig => 0x19,
            Self::Config => 0x1A,
            Self::MuxConfig => 0x1B,
            Self::ResetDev => 0x1C,
            Self::DriveCurrent(channel) => 0x1E + channel.number(),
            Self::ManufacturerId => 0x7E,
            Self::DeviceId => 0x7F,
        }
    }

    /// Bits that a read-back must reproduce: all but the reserved bits of CONFIG and, in
    /// DRIVE_CURRENTx, the read-only field INIT_IDRIVEx (bits 10 to 6), which the chip updates by
    /// itself.
    pub(crate) const fn readback_mask(self) -> u16 {
        match self {
            Self::DriveCurrent(_) => !(0x1F << 6),
            // A user read 0x2800 where 0x2801 was written: reserved bits may read as zero.
            Self::Config => !0x013F,
            _ => 0xFFFF,
        }
    }
}

/// MANUFACTURER_ID, "TI" in ASCII (datasheet 7.6.35).
pub const MANUFACTURER_ID: u16 = 0x5449;
/// DEVICE_ID of both the LDC1612 and the LDC1614 (datasheet 7.6.36).
pub const DEVICE_ID: u16 = 0x3055;
/// The bit of RESET_DEV that resets the chip (datasheet 7.6.30).
pub(crate) const RESET: u16 = 1 << 15;

/// RCOUNTx, the length of a conversion in units of 16 reference periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Rcount(u16);

impl Rcount {
    /// Shortest conversion. The datasheet says both "0x0005 and up" (Table 9) and "> 8" (Table 43);
    /// the driver applies the stricter one.
    pub const MIN: Self = Self(9);
    /// Longest conversion, and best resolution.
    pub const MAX: Self = Self(0xFFFF);

    /// Creates an RCOUNT of 9 to 65,535.
    ///
    /// ```
    /// use ldc161x::Rcount;
    /// assert_eq!(Rcount::new(1512).map(Rcount::get), Some(1512));
    /// assert_eq!(Rcount::new(8), None);
    /// ```
    pub const fn new(count: u16) -> Option<Self> {
        if count >= Self::MIN.0 {
            Some(Self(count))
        } else {
            None
        }
    }

    /// The register's value.
    ///
    /// ```
    /// assert_eq!(ldc161x::Rcount::MIN.get(), 9);
    /// ```
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Reference periods in one conversion, 16 RCOUNT (datasheet Table 39). Equation 7 of the same
    /// datasheet adds 4, a measurement found 11 more: see [`Plan`](crate::Plan) for the value that
    /// the planner uses.
    ///
    /// ```
    /// assert_eq!(ldc161x::Rcount::MAX.reference_periods(), 1_048_560);
    /// ```
    pub const fn reference_periods(self) -> u32 {
        16 * self.0 as u32
    }
}

/// SETTLECOUNTx, the wait before a conversion in units of 16 reference periods.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct SettleCount(u16);

impl SettleCount {
    /// Shortest wait that the datasheet allows: "> 3" (Table 43).
    pub const MIN: Self = Self(4);

    /// Creates a settle count of 4 to 65,535.
    ///
    /// ```
    /// use ldc161x::SettleCount;
    /// assert_eq!(SettleCount::new(10).map(SettleCount::reference_periods), Some(160));
    /// assert_eq!(SettleCount::new(3), None);
    /// ```
    pub const fn new(count: u16) -> Option<Self> {
        if count >= Self::MIN.0 {
            Some(Self(count))
        } else {
            None
        }
    }

    /// The register's value.
    ///
    /// ```
    /// assert_eq!(ldc161x::SettleCount::MIN.get(), 4);
    /// ```
    pub const fn get(self) -> u16 {
        self.0
    }

    /// Reference periods of the wait before a conversion, 16 SETTLECOUNT (datasheet Equation 9).
    ///
    /// ```
    /// assert_eq!(ldc161x::SettleCount::MIN.reference_periods(), 64);
    /// ```
    pub const fn reference_periods(self) -> u32 {
        16 * self.0 as u32
    }
}

/// CLOCK_DIVIDERSx. Its reset value, zero in both fields, is invalid: the register must be written
/// before the first conversion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ClockDividers {
    sensor: u8,
    reference: u16,
}

impl ClockDividers {
    /// Both dividers 1.
    pub const UNDIVIDED: Self = Self {
        sensor: 1,
        reference: 1,
    };

    /// Creates the dividers: `sensor` is FIN_DIVIDER, 1 to 15; `reference` is FREF_DIVIDER, 1 to
    /// 1023.
    ///
    /// ```
    /// use ldc161x::ClockDividers;
    /// assert_eq!(ClockDividers::new(1, 2).map(ClockDividers::to_bits), Some(0x1002));
    /// assert_eq!(ClockDividers::new(0, 1), None);
    /// assert_eq!(ClockDividers::new(1, 1024), None);
    /// ```
    pub const fn new(sensor: u8, reference: u16) -> Option<Self> {
        if sensor >= 1 && sensor <= 15 && reference >= 1 && reference <= 0x3FF {
            Some(Self { sensor, reference })
        } else {
            None
        }
    }

    /// FIN_DIVIDER.
    ///
    /// ```
    /// assert_eq!(ldc161x::ClockDividers::UNDIVIDED.sensor(), 1);
    /// ```
    pub const fn sensor(self) -> u8 {
        self.sensor
    }

    /// FREF_DIVIDER.
    ///
    /// ```
    /// assert_eq!(ldc161x::ClockDividers::UNDIVIDED.reference(), 1);
    /// ```
    pub const fn reference(self) -> u16 {
        self.reference
    }

    /// The register word.
    ///
    /// ```
    /// assert_eq!(ldc161x::ClockDividers::UNDIVIDED.to_bits(), 0x1001);
    /// ```
    pub const fn to_bits(self) -> u16 {
        (self.sensor as u16) << 12 | self.reference
    }

    /// The dividers of a register word; `None` if a divider is zero or a reserved bit is set.
    ///
    /// ```
    /// use ldc161x::ClockDividers;
    /// assert!(ClockDividers::from_bits(0x1001).is_some());
    /// assert!(ClockDividers::from_bits(0x1401).is_none());
    /// ```
    pub const fn from_bits(bits: u16) -> Option<Self> {
        if bits & 0x0C00 != 0 {
            return None;
        }
        Self::new((bits >> 12) as u8, bits & 0x3FF)
    }
}

/// Value of STATUS (datasheet Table 25). Flags stay set until STATUS is read. The read clears them,
/// releases INTB and, according to application note SNOA959, also clears the UNREADCONVx bits.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Status(u16);

impl Status {
    /// Creates a status from a register word. Every word is valid.
    ///
    /// ```
    /// use ldc161x::{Channel, Status};
    /// let status = Status::from_bits(0x4248);
    /// assert!(status.amplitude_low() && status.data_ready());
    /// assert_eq!(status.error_channel(), Some(Channel::One));
    /// assert!(status.unread(Channel::Zero) && !status.unread(Channel::One));
    /// ```
    pub const fn from_bits(bits: u16) -> Self {
        Self(bits)
    }

    /// The register word.
    ///
    /// ```
    /// assert_eq!(ldc161x::Status::from_bits(0x40).to_bits(), 0x40);
    /// ```
    pub const fn to_bits(self) -> u16 {
        self.0
    }

    const fn bit(self, position: u8) -> bool {
        self.0 >> position & 1 == 1
    }

    /// The channel of the first error since the last read of STATUS; later errors on other channels
    /// are lost. `None` if no error is reported.
    ///
    /// ```
    /// assert_eq!(ldc161x::Status::default().error_channel(), None);
    /// ```
    pub const fn error_channel(self) -> Option<Channel> {
        if self.any_error() {
            Channel::from_number((self.0 >> 14) as u8)
        } else {
            None
        }
    }

    /// Whether any error is reported.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 8).any_error());
    /// ```
    pub const fn any_error(self) -> bool {
        self.0 & 0x3F00 != 0
    }

    /// ERR_UR: the result would have been negative (OFFSETx is too large).
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 13).under_range());
    /// ```
    pub const fn under_range(self) -> bool {
        self.bit(13)
    }

    /// ERR_OR: the sensor is faster than the reference.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 12).over_range());
    /// ```
    pub const fn over_range(self) -> bool {
        self.bit(12)
    }

    /// ERR_WD: the conversion was aborted and its data are invalid.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 11).watchdog());
    /// ```
    pub const fn watchdog(self) -> bool {
        self.bit(11)
    }

    /// ERR_AHE: amplitude above 1.8 V; lower the drive current.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 10).amplitude_high());
    /// ```
    pub const fn amplitude_high(self) -> bool {
        self.bit(10)
    }

    /// ERR_ALE: amplitude below 1.2 V; raise the drive current.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 9).amplitude_low());
    /// ```
    pub const fn amplitude_low(self) -> bool {
        self.bit(9)
    }

    /// ERR_ZC: no sensor edge in the whole conversion. Reported in STATUS only.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 8).zero_count());
    /// ```
    pub const fn zero_count(self) -> bool {
        self.bit(8)
    }

    /// DRDY: a conversion, or with autoscan a whole sequence, has ended.
    ///
    /// ```
    /// assert!(ldc161x::Status::from_bits(1 << 6).data_ready());
    /// ```
    pub const fn data_ready(self) -> bool {
        self.bit(6)
    }

    /// UNREADCONVx: a result of `channel` has not been read yet.
    ///
    /// ```
    /// use ldc161x::{Channel, Status};
    /// assert!(Status::from_bits(1).unread(Channel::Three));
    /// ```
    pub const fn unread(self, channel: Channel) -> bool {
        // The order is reversed: the bit of channel 0 is bit 3.
        self.bit(3 - channel.number())
    }
}

/// ERROR_CONFIG: where each event is reported.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ErrorConfig {
    /// UR_ERR2OUT: under-range in the data word.
    pub under_range_to_data: bool,
    /// OR_ERR2OUT: over-range in the data word.
    pub over_range_to_data: bool,
    /// WD_ERR2OUT: watchdog in the data word.
    pub watchdog_to_data: bool,
    /// AH_ERR2OUT: amplitude too high in the data word.
    pub amplitude_high_to_data: bool,
    /// AL_ERR2OUT: amplitude too low in the data word.
    pub amplitude_low_to_data: bool,
    /// UR_ERR2INT: under-range on INTB and in STATUS.
    pub under_range_to_interrupt: bool,
    /// OR_ERR2INT: over-range on INTB and in STATUS.
    pub over_range_to_interrupt: bool,
    /// WD_ERR2INT: watchdog on INTB and in STATUS.
    pub watchdog_to_interrupt: bool,
    /// AH_ERR2INT: amplitude too high on INTB and in STATUS.
    pub amplitude_high_to_interrupt: bool,
    /// AL_ERR2INT: amplitude too low on INTB and in STATUS.
    pub amplitude_low_to_interrupt: bool,
    /// ZC_ERR2INT: zero count on INTB and in STATUS.
    pub zero_count_to_interrupt: bool,
    /// DRDY_2INT: data ready on INTB and in STATUS.
    pub data_ready_to_interrupt: bool,
}

impl ErrorConfig {
    /// Every error is reported in the data word, and only data ready on INTB: each edge of INTB
    /// means one finished frame.
    pub const DATA_READY: Self = Self {
        under_range_to_data: true,
        over_range_to_data: true,
        watchdog_to_data: true,
        amplitude_high_to_data: true,
        amplitude_low_to_data: true,
        under_range_to_interrupt: false,
        over_range_to_interrupt: false,
        watchdog_to_interrupt: false,
        amplitude_high_to_interrupt: false,
        amplitude_low_to_interrupt: false,
        zero_count_to_interrupt: false,
        data_ready_to_interrupt: true,
    };

    /// Every event is reported wherever possible: [`Status`] then also distinguishes a high
    /// amplitude from a low one, and reports a zero count.
    pub const EVERYTHING: Self = Self {
        under_range_to_interrupt: true,
        over_range_to_interrupt: true,
        watchdog_to_interrupt: true,
        amplitude_high_to_interrupt: true,
        amplitude_low_to_interrupt: true,
        zero_count_to_interrupt: true,
        ..Self::DATA_READY
    };

    /// The register word.
    ///
    /// ```
    /// assert_eq!(ldc161x::ErrorConfig::DATA_READY.to_bits(), 0xF801);
    /// ```
    pub const fn to_bits(self) -> u16 {
        (self.under_range_to_data as u16) << 15
            | (self.over_range_to_data as u16) << 14
            | (self.watchdog_to_data as u16) << 13
            | (self.amplitude_high_to_data as u16) << 12
            | (self.amplitude_low_to_data as u16) << 11
            | (self.under_range_to_interrupt as u16) << 7
            | (self.over_range_to_interrupt as u16) << 6
            | (self.watchdog_to_interrupt as u16) << 5
            | (self.amplitude_high_to_interrupt as u16) << 4
            | (self.amplitude_low_to_interrupt as u16) << 3
            | (self.zero_count_to_interrupt as u16) << 2
            | self.data_ready_to_interrupt as u16
    }

    /// The settings of a register word; `None` if a reserved bit is set.
    ///
    /// ```
    /// use ldc161x::ErrorConfig;
    /// assert_eq!(ErrorConfig::from_bits(0xF8FD), Some(ErrorConfig::EVERYTHING));
    /// assert_eq!(ErrorConfig::from_bits(0x0400), None);
    /// ```
    pub const fn from_bits(bits: u16) -> Option<Self> {
        if bits & 0x0702 != 0 {
            return None;
        }
        Some(Self {
            under_range_to_data: bits >> 15 & 1 == 1,
            over_range_to_data: bits >> 14 & 1 == 1,
            watchdog_to_data: bits >> 13 & 1 == 1,
            amplitude_high_to_data: bits >> 12 & 1 == 1,
            amplitude_low_to_data: bits >> 11 & 1 == 1,
            under_range_to_interrupt: bits >> 7 & 1 == 1,
            over_range_to_interrupt: bits >> 6 & 1 == 1,
            watchdog_to_interrupt: bits >> 5 & 1 == 1,
            amplitude_high_to_interrupt: bits >> 4 & 1 == 1,
            amplitude_low_to_interrupt: bits >> 3 & 1 == 1,
            zero_count_to_interrupt: bits >> 2 & 1 == 1,
            data_ready_to_interrupt: bits & 1 == 1,
        })
    }
}

/// CONFIG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Config {
    /// ACTIVE_CHAN: the channel converted when autoscan is off.
    pub active_channel: Channel,
    /// SLEEP_MODE_EN: the chip sleeps, so its registers may be written.
    pub sleep: bool,
    /// RP_OVERRIDE_EN: the sensor is driven with the programmed current.
    pub fixed_drive: bool,
    /// SENSOR_ACTIVATE_SEL: the sensor is activated with the programmed current instead of the
    /// strongest one.
    pub low_power_activation: bool,
    /// AUTO_AMP_DIS: the drive current is not corrected between conversions.
    pub amplitude_correction_off: bool,
    /// REF_CLK_SRC: the reference is CLKIN instead of the internal oscillator.
    pub external_reference: bool,
    /// INTB_DIS: INTB stays high.
    pub interrupt_off: bool,
    /// HIGH_CURRENT_DRV: channel 0 is driven with more than 1.5 mA; allowed with autoscan off only.
    pub high_current_drive: bool,
}

impl Config {
    /// The value after reset, 0x2801.
    pub const RESET: Self = Self {
        active_channel: Channel::Zero,
        sleep: true,
        fixed_drive: false,
        low_power_activation: true,
        amplitude_correction_off: false,
        external_reference: false,
        interrupt_off: false,
        high_current_drive: false,
    };

    /// The register word.
    ///
    /// ```
    /// assert_eq!(ldc161x::Config::RESET.to_bits(), 0x2801);
    /// ```
    pub const fn to_bits(self) -> u16 {
        (self.active_channel.number() as u16) << 14
            | (self.sleep as u16) << 13
            | (self.fixed_drive as u16) << 12
            | (self.low_power_activation as u16) << 11
            | (self.amplitude_correction_off as u16) << 10
            | (self.external_reference as u16) << 9
            | (self.interrupt_off as u16) << 7
            | (self.high_current_drive as u16) << 6
            | 0b00_0001
    }

    /// The settings of a register word; `None` if a reserved bit differs.
    ///
    /// ```
    /// use ldc161x::Config;
    /// assert_eq!(Config::from_bits(0x2801), Some(Config::RESET));
    /// assert_eq!(Config::from_bits(0x2800), None);
    /// ```
    pub const fn from_bits(bits: u16) -> Option<Self> {
        if bits & 0x013F != 0b00_0001 {
            return None;
        }
        let Some(active_channel) = Channel::from_number((bits >> 14) as u8) else {
            return None;
        };
        Some(Self {
            active_channel,
            sleep: bits >> 13 & 1 == 1,
            fixed_drive: bits >> 12 & 1 == 1,
            low_power_activation: bits >> 11 & 1 == 1,
            amplitude_correction_off: bits >> 10 & 1 == 1,
            external_reference: bits >> 9 & 1 == 1,
            interrupt_off: bits >> 7 & 1 == 1,
            high_current_drive: bits >> 6 & 1 == 1,
        })
    }
}

/// MUX_CONFIG.DEGLITCH: bandwidth of the input filter. Choose the lowest one above the highest
/// sensor frequency.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Deglitch {
    /// 1 MHz, code 001.
    Mhz1,
    /// 3.3 MHz, code 100.
    Mhz3_3,
    /// 10 MHz, code 101.
    Mhz10,
    /// 33 MHz, code 111. Table 45 of the datasheet prints 011; Table 28 and the reset value say
    /// 111.
    Mhz33,
}

impl Deglitch {
    /// The lowest bandwidth above `highest_sensor_hz`.
    ///
    /// ```
    /// use ldc161x::Deglitch;
    /// // the datasheet's own example, 8.1.7
    /// assert_eq!(Deglitch::above(2_800_000), Deglitch::Mhz3_3);
    /// ```
    pub const fn above(highest_sensor_hz: u32) -> Self {
        if highest_sensor_hz < 1_000_000 {
            Self::Mhz1
        } else if highest_sensor_hz < 3_300_000 {
            Self::Mhz3_3
        } else if highest_sensor_hz < 10_000_000 {
            Self::Mhz10
        } else {
            Self::Mhz33
        }
    }

    const fn to_bits(self) -> u16 {
        match self {
            Self::Mhz1 => 0b001,
            Self::Mhz3_3 => 0b100,
            Self::Mhz10 => 0b101,
            Self::Mhz33 => 0b111,
        }
    }

    const fn from_bits(bits: u16) -> Option<Self> {
        match bits & 0b111 {
            0b001 => Some(Self::Mhz1),
            0b100 => Some(Self::Mhz3_3),
            0b101 => Some(Self::Mhz10),
            0b111 => Some(Self::Mhz33),
            _ => None,
        }
    }
}

impl fmt::Display for Deglitch {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Mhz1 => "1 MHz",
            Self::Mhz3_3 => "3.3 MHz",
            Self::Mhz10 => "10 MHz",
            Self::Mhz33 => "33 MHz",
        })
    }
}

/// MUX_CONFIG.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct MuxConfig {
    /// The sequence of autoscan, or `None` for a single channel.
    pub autoscan: Option<Sequence>,
    /// Bandwidth of the input filter, for all channels.
    pub deglitch: Deglitch,
}

impl MuxConfig {
    /// The value after reset, 0x020F.
    pub const RESET: Self = Self {
        autoscan: None,
        deglitch: Deglitch::Mhz33,
    };

    /// MUX_CONFIG for an acquisition whose highest sensor frequency is `highest_sensor_hz`.
    ///
    /// ```
    /// use ldc161x::{Acquisition, MuxConfig, Sequence};
    /// let mux = MuxConfig::of(Acquisition::Autoscan(Sequence::ZeroToThree), 4_000_000);
    /// assert_eq!(mux.to_bits(), 0xC20D);
    /// ```
    pub const fn of(acquisition: Acquisition, highest_sensor_hz: u32) -> Self {
        Self {
            autoscan: match acquisition {
                Acquisition::Single(_) => None,
                Acquisition::Autoscan(sequence) => Some(sequence),
            },
            deglitch: Deglitch::above(highest_sensor_hz),
        }
    }

    /// The register word.
    ///
    /// ```
    /// assert_eq!(ldc161x::MuxConfig::RESET.to_bits(), 0x020F);
    /// ```
    pub const fn to_bits(self) -> u16 {
        let scan = match self.autoscan {
            None => 0,
            Some(Sequence::ZeroToOne) => 0b100,
            Some(Sequence::ZeroToTwo) => 0b101,
            Some(Sequence::ZeroToThree) => 0b110,
        };
        scan << 13 | 0b00_0100_0001 << 3 | self.deglitch.to_bits()
    }

    /// The settings of a register word; `None` for a reserved bit or code.
    ///
    /// ```
    /// use ldc161x::MuxConfig;
    /// assert_eq!(MuxConfig::from_bits(0x020F), Some(MuxConfig::RESET));
    /// assert_eq!(MuxConfig::from_bits(0x000F), None);
    /// ```
    pub const fn from_bits(bits: u16) -> Option<Self> {
        if bits >> 3 & 0x3FF != 0b00_0100_0001 {
            return None;
        }
        let Some(deglitch) = Deglitch::from_bits(bits) else {
            return None;
        };
        let autoscan = match bits >> 13 {
            0b100 | 0b111 => Some(Sequence::ZeroToOne),
            0b101 => Some(Sequence::ZeroToTwo),
            0b110 => Some(Sequence::ZeroToThree),
            _ => None,
        };
        Some(Self { autoscan, deglitch })
    }
}

/// DRIVE_CURRENTx as read: the programmed drive code, and the code that the chip's calibration
/// found.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct DriveCurrent {
    /// IDRIVEx: the code in use while RP_OVERRIDE_EN is set in CONFIG.
    pub drive: DriveCode,
    /// INIT_IDRIVEx: the code that the chip's amplitude calibration found.
    pub calibrated: DriveCode,
}

impl DriveCurrent {
    /// Creates both drive codes from a register word.
    ///
    /// ```
    /// use ldc161x::{DriveCode, DriveCurrent};
    /// let read = DriveCurrent::from_bits(0x8C40);
    /// assert_eq!(read.drive.code(), 17);
    /// assert_eq!(read.calibrated.code(), 17);
    /// ```
    pub const fn from_bits(bits: u16) -> Self {
        Self {
            drive: DriveCode::from_field(bits >> 11),
            calibrated: DriveCode::from_field(bits >> 6),
        }
    }

    /// The word that programs `drive`; the read-only field is written as zero (Table 30).
    ///
    /// ```
    /// use ldc161x::{DriveCode, DriveCurrent};
    /// assert_eq!(DriveCurrent::to_program(DriveCode::STRONGEST), 0xF800);
    /// ```
    pub const fn to_program(drive: DriveCode) -> u16 {
        (drive.code() as u16) << 11
    }
}
