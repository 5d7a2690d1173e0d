//! Chip model, I2C address and channels.

use core::fmt;

/// The two members of the family. They answer with the same identity (datasheet 7.6.36), so
/// the caller has to say which one is on the board.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Model {
    /// Two channels, WSON-12.
    Ldc1612,
    /// Four channels, WQFN-16.
    Ldc1614,
}

impl Model {
    /// Number of sensor channels.
    ///
    /// ```
    /// assert_eq!(ldc161x::Model::Ldc1614.channel_count(), 4);
    /// ```
    pub const fn channel_count(self) -> u8 {
        match self {
            Self::Ldc1612 => 2,
            Self::Ldc1614 => 4,
        }
    }

    /// Whether this chip has `channel`.
    ///
    /// ```
    /// use ldc161x::{Channel, Model};
    /// assert!(!Model::Ldc1612.has(Channel::Two));
    /// ```
    pub const fn has(self, channel: Channel) -> bool {
        channel.number() < self.channel_count()
    }
}

/// I2C address, set by the level of the ADDR pin (datasheet 7.5.1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Address {
    /// ADDR low: 0x2A.
    #[default]
    AddrLow,
    /// ADDR high: 0x2B.
    AddrHigh,
}

impl Address {
    /// The seven address bits.
    ///
    /// ```
    /// assert_eq!(ldc161x::Address::AddrHigh.bits(), 0x2B);
    /// ```
    pub const fn bits(self) -> u8 {
        match self {
            Self::AddrLow => 0x2A,
            Self::AddrHigh => 0x2B,
        }
    }
}

/// A sensor channel. Channels 2 and 3 exist on the LDC1614 only.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Channel {
    /// IN0A and IN0B.
    #[default]
    Zero,
    /// IN1A and IN1B.
    One,
    /// IN2A and IN2B (LDC1614).
    Two,
    /// IN3A and IN3B (LDC1614).
    Three,
}

impl Channel {
    /// All channels in the order in which autoscan visits them.
    pub const ALL: [Self; 4] = [Self::Zero, Self::One, Self::Two, Self::Three];

    /// Channel number, 0 to 3, as in the register names.
    ///
    /// ```
    /// assert_eq!(ldc161x::Channel::Three.number(), 3);
    /// ```
    pub const fn number(self) -> u8 {
        self as u8
    }

    /// The channel with a number from 0 to 3.
    ///
    /// ```
    /// use ldc161x::Channel;
    /// assert_eq!(Channel::from_number(1), Some(Channel::One));
    /// assert_eq!(Channel::from_number(4), None);
    /// ```
    pub const fn from_number(number: u8) -> Option<Self> {
        match number {
            0 => Some(Self::Zero),
            1 => Some(Self::One),
            2 => Some(Self::Two),
            3 => Some(Self::Three),
            _ => None,
        }
    }
}

impl fmt::Display for Channel {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.number())
    }
}

/// The channels that autoscan visits, starting at channel 0 (MUX_CONFIG.RR_SEQUENCE, datasheet
/// Table 28).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Sequence {
    /// Channels 0 and 1.
    ZeroToOne,
    /// Channels 0, 1 and 2 (LDC1614).
    ZeroToTwo,
    /// Channels 0, 1, 2 and 3 (LDC1614).
    ZeroToThree,
}

impl Sequence {
    /// Number of channels in one autoscan cycle.
    ///
    /// ```
    /// assert_eq!(ldc161x::Sequence::ZeroToTwo.channel_count(), 3);
    /// ```
    pub const fn channel_count(self) -> u8 {
        match self {
            Self::ZeroToOne => 2,
            Self::ZeroToTwo => 3,
            Self::ZeroToThree => 4,
        }
    }
}

/// The channels that the converter measures (datasheet 7.3.1, Table 36).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Acquisition {
    /// One channel, converted continuously; its sensor oscillates all the time.
    Single(Channel),
    /// Several channels in turn; each sensor is activated anew for its conversion.
    Autoscan(Sequence),
}

impl Acquisition {
    /// Number of conversions in one frame.
    ///
    /// ```
    /// use ldc161x::{Acquisition, Channel};
    /// assert_eq!(Acquisition::Single(Channel::Three).channel_count(), 1);
    /// ```
    pub const fn channel_count(self) -> u8 {
        match self {
            Self::Single(_) => 1,
            Self::Autoscan(sequence) => sequence.channel_count(),
        }
    }

    /// The channel at `position` of a frame, counted from 0.
    ///
    /// ```
    /// use ldc161x::{Acquisition, Channel, Sequence};
    /// let scan = Acquisition::Autoscan(Sequence::ZeroToOne);
    /// assert_eq!(scan.channel_at(1), Some(Channel::One));
    /// assert_eq!(scan.channel_at(2), None);
    /// ```
    pub const fn channel_at(self, position: u8) -> Option<Channel> {
        if position >= self.channel_count() {
            return None;
        }
        match self {
            Self::Single(channel) => Some(channel),
            Self::Autoscan(_) => Channel::from_number(position),
        }
    }

    /// The channels of one frame, in order.
    ///
    /// ```
    /// use ldc161x::{Acquisition, Channel};
    /// assert!(Acquisition::Single(Channel::Two).channels().eq([Channel::Two]));
    /// ```
    pub fn channels(self) -> impl Iterator<Item = Channel> {
        (0..self.channel_count()).filter_map(move |position| self.channel_at(position))
    }

    /// Whether every channel exists on `model`.
    ///
    /// ```
    /// use ldc161x::{Acquisition, Model, Sequence};
    /// assert!(!Acquisition::Autoscan(Sequence::ZeroToThree).fits(Model::Ldc1612));
    /// ```
    pub const fn fits(self, model: Model) -> bool {
        match self {
            Self::Single(channel) => model.has(channel),
            Self::Autoscan(sequence) => sequence.channel_count() <= model.channel_count(),
        }
    }
}
