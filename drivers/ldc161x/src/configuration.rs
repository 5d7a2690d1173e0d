//! The configuration: the requested value of every register.

use crate::{
    Acquisition, Channel, ClockDividers, Config, Deglitch, DriveCode, DriveCurrent, ErrorConfig,
    Model, MuxConfig, Noise, Rcount, Register, Scale, SettleCount,
};

/// Source of the reference clock (CONFIG.REF_CLK_SRC).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum ReferenceClock {
    /// A clock of this frequency on CLKIN: 2 to 40 MHz (datasheet 6.5).
    External {
        /// Frequency in hertz.
        hz: u32,
    },
    /// The internal oscillator: 35 to 55 MHz with -13 ppm/K (datasheet 6.5), so frequencies are not
    /// accurate without calibration.
    Internal,
}

impl ReferenceClock {
    /// Slowest, nominal and fastest frequency in hertz.
    ///
    /// ```
    /// use ldc161x::ReferenceClock;
    /// assert_eq!(ReferenceClock::Internal.range_hz(), (35_000_000, 43_400_000, 55_000_000));
    /// ```
    pub const fn range_hz(self) -> (u32, u32, u32) {
        match self {
            Self::External { hz } => (hz, hz, hz),
            Self::Internal => (35_000_000, 43_400_000, 55_000_000),
        }
    }
}

/// The registers of one channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct ChannelSettings {
    /// RCOUNTx.
    pub rcount: Rcount,
    /// SETTLECOUNTx.
    pub settle_count: SettleCount,
    /// CLOCK_DIVIDERSx.
    pub dividers: ClockDividers,
    /// OFFSETx.
    pub offset: u16,
    /// DRIVE_CURRENTx.IDRIVE.
    pub drive: DriveCode,
}

impl ChannelSettings {
    /// Settings of an unused channel: shortest conversion, weakest drive.
    pub const UNUSED: Self = Self {
        rcount: Rcount::MIN,
        settle_count: SettleCount::MIN,
        dividers: ClockDividers::UNDIVIDED,
        offset: 0,
        drive: match DriveCode::new(0) {
            Some(code) => code,
            None => DriveCode::STRONGEST,
        },
    };
}

/// All settings that the driver writes and compares with the chip's registers.
/// [`Request::plan`](crate::Request::plan) computes them; for an unusual board they may be set by
/// hand.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Configuration {
    /// Channels to convert.
    pub acquisition: Acquisition,
    /// Reference clock.
    pub reference: ReferenceClock,
    /// Settings of channels 0 to 3; those of inactive channels are not written.
    pub channels: [ChannelSettings; 4],
    /// Input filter.
    pub deglitch: Deglitch,
    /// Which errors are reported, and where.
    pub errors: ErrorConfig,
    /// Whether a sensor is activated with its own drive current instead of the strongest.
    /// Activation then takes longer; the datasheet recommends the strongest (Table 41).
    pub low_power_activation: bool,
    /// Noise parameters of the channels.
    pub noise: Noise,
}

/// Number of registers written for each channel.
const PER_CHANNEL: u8 = 5;

impl Configuration {
    /// Whether all channels of this configuration exist on `model`.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let plan = Request::new(Model::Ldc1614, ReferenceClock::External { hz: 40_000_000 },
    /// #     Acquisition::Autoscan(Sequence::ZeroToThree), Sensor::new(3_000_000, 4_000_000))
    /// #     .plan().unwrap();
    /// assert!(!plan.configuration.fits(Model::Ldc1612));
    /// ```
    pub const fn fits(&self, model: Model) -> bool {
        self.acquisition.fits(model)
    }

    /// The settings of one channel.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let plan = Request::new(Model::Ldc1612, ReferenceClock::External { hz: 30_000_000 },
    /// #     Acquisition::Single(Channel::Zero), Sensor::new(3_000_000, 4_000_000))
    /// #     .plan().unwrap();
    /// assert_eq!(plan.configuration.channel(Channel::Zero).dividers.reference(), 1);
    /// ```
    pub const fn channel(&self, channel: Channel) -> &ChannelSettings {
        let [zero, one, two, three] = &self.channels;
        match channel {
            Channel::Zero => zero,
            Channel::One => one,
            Channel::Two => two,
            Channel::Three => three,
        }
    }

    /// The settings of one channel, mutable.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let mut configuration = Request::new(Model::Ldc1612,
    /// #     ReferenceClock::External { hz: 30_000_000 }, Acquisition::Single(Channel::Zero),
    /// #     Sensor::new(3_000_000, 4_000_000)).plan().unwrap().configuration;
    /// configuration.channel_mut(Channel::Zero).drive = DriveCode::new(20).unwrap();
    /// ```
    pub const fn channel_mut(&mut self, channel: Channel) -> &mut ChannelSettings {
        let [zero, one, two, three] = &mut self.channels;
        match channel {
            Channel::Zero => zero,
            Channel::One => one,
            Channel::Two => two,
            Channel::Three => three,
        }
    }

    /// Conversion of one channel's codes to frequencies, for the nominal clock.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let plan = Request::new(Model::Ldc1612, ReferenceClock::External { hz: 30_000_000 },
    /// #     Acquisition::Single(Channel::Zero), Sensor::new(3_000_000, 4_000_000))
    /// #     .plan().unwrap();
    /// assert_eq!(plan.configuration.scale(Channel::Zero).clock_hz, 30e6);
    /// ```
    pub fn scale(&self, channel: Channel) -> Scale {
        let settings = self.channel(channel);
        Scale {
            clock_hz: f64::from(self.reference.range_hz().1),
            dividers: settings.dividers,
            offset: settings.offset,
            rcount: settings.rcount,
            noise: self.noise,
        }
    }

    /// Value of CONFIG while converting, or asleep if `sleep` is set.
    pub(crate) const fn config(&self, sleep: bool) -> Config {
        Config {
            active_channel: match self.acquisition {
                Acquisition::Single(channel) => channel,
                Acquisition::Autoscan(_) => Channel::Zero,
            },
            sleep,
            fixed_drive: true,
            low_power_activation: self.low_power_activation,
            amplitude_correction_off: true,
            external_reference: matches!(self.reference, ReferenceClock::External { .. }),
            interrupt_off: false,
            high_current_drive: false,
        }
    }

    /// Value of CONFIG that makes the chip find its drive current itself (datasheet 8.1.5.2).
    pub(crate) const fn calibrating_config(&self, sleep: bool) -> Config {
        Config {
            fixed_drive: false,
            amplitude_correction_off: false,
            ..self.config(sleep)
        }
    }

    /// Number of registers that [`register`](Self::register) lists.
    pub(crate) const fn register_count(&self) -> u8 {
        PER_CHANNEL * self.acquisition.channel_count() + 2
    }

    /// Register number `index` and its value, in the order of writing while the chip sleeps. CONFIG
    /// is not in this list, since it is written last.
    pub(crate) const fn register(&self, index: u8) -> Option<(Register, u16)> {
        let per_channels = PER_CHANNEL * self.acquisition.channel_count();
        if index == per_channels {
            return Some((Register::ErrorConfig, self.errors.to_bits()));
        }
        if index == per_channels + 1 {
            let mut mux = MuxConfig::of(self.acquisition, 0);
            mux.deglitch = self.deglitch;
            return Some((Register::MuxConfig, mux.to_bits()));
        }
        let Some(channel) = self.acquisition.channel_at(index / PER_CHANNEL) else {
            return None;
        };
        let settings = self.channel(channel);
        Some(match index % PER_CHANNEL {
            0 => (Register::Rcount(channel), settings.rcount.get()),
            1 => (Register::Offset(channel), settings.offset),
            2 => (Register::SettleCount(channel), settings.settle_count.get()),
            3 => (
                Register::ClockDividers(channel),
                settings.dividers.to_bits(),
            ),
            _ => (
                Register::DriveCurrent(channel),
                DriveCurrent::to_program(settings.drive),
            ),
        })
    }

    /// Microseconds from leaving sleep to the end of the first whole frame at the slowest clock: a
    /// wake-up of 16384 / fINT, then settling, converting and switching for each channel.
    pub(crate) fn first_frame_us(&self) -> u32 {
        // 16384 periods of the slowest internal oscillator, 35 MHz (datasheet 7.4.2).
        const WAKE_UP_US: u32 = 469;
        let (slowest_hz, _, _) = self.reference.range_hz();
        let mut total = u64::from(WAKE_UP_US);
        for channel in self.acquisition.channels() {
            let settings = self.channel(channel);
            // Switching takes 692 ns and 5 reference periods by the datasheet (32.7 periods at 40
            // MHz), 11 periods as measured. 32 periods and the 2 us below cover both.
            let periods = u64::from(settings.settle_count.reference_periods())
                + u64::from(settings.rcount.reference_periods())
                + 32;
            let clock_periods = periods * u64::from(settings.dividers.reference());
            total += clock_periods * 1_000_000 / u64::from(slowest_hz.max(1)) + 2;
        }
        u32::try_from(total).unwrap_or(u32::MAX)
    }
}
