//! Planner: computes register values from a request (clock, sensor, rate, channels), or names the
//! limit that the request breaks.
//!
//! The whole planner is `const`, so that a fixed plan costs no code and an impossible plan does not
//! compile. Frequencies are whole hertz, times whole nanoseconds.

use crate::{
    Acquisition, BusAccess, Channel, ChannelSettings, ClockDividers, Configuration, Deglitch,
    DriveCode, ErrorConfig, LimitError, Model, Noise, Rcount, ReferenceClock, SettleCount,
    drive::{LOWEST_AMPLITUDE_V, LOWEST_CLEAN_AMPLITUDE_V},
};

/// Limits of CLKIN in hertz: 2 to 40 MHz (datasheet 6.5).
const CLKIN_HZ: (u32, u32) = (2_000_000, 40_000_000);
/// Highest reference frequency fREF, Hz, with one channel, for either clock (datasheet Table 43).
const SINGLE_REFERENCE_HZ: u32 = 35_000_000;
/// Highest reference frequency fREF, Hz, with autoscan: external clock, internal clock (datasheet
/// Table 43).
const AUTOSCAN_REFERENCE_HZ: (u32, u32) = (40_000_000, 55_000_000);
/// Limits of the sensor frequency in hertz: 1 kHz to 10 MHz (datasheet 6.5).
const SENSOR_HZ: (u32, u32) = (1_000, 10_000_000);
/// Sensor frequency in hertz from which on the sensor has to be divided (datasheet Table 43,
/// note 2).
const DIVIDE_FROM_HZ: u32 = 8_750_000;
/// Limits of the sensor's parallel resistance: 1 to 100 kiloohm (datasheet 6.5). A lower resistance
/// needs the high-current mode, which is not planned, since sources differ on its figures.
const RP_OHM: (u32, u32) = (1_000, 100_000);
/// Limits of the I2C clock in hertz (datasheet 6.6).
const BUS_HZ: (u32, u32) = (10_000, 400_000);
/// Constant part of the time between two conversions, ns: switching takes 692 ns and 5 reference
/// periods (datasheet Equation 8), together 1.11 us at 12 MHz. An LDC1612 at 12 MHz was measured at
/// 11 periods, 0.92 us.
const SWITCH_NS: u64 = 692;
/// Number of reference periods in the switching time; see [`SWITCH_NS`].
const SWITCH_PERIODS: u64 = 5;
/// Time that a master adds to each transfer, ns. Measured masters add 1 to 10 us; the plan uses the
/// longest.
const MASTER_GAP_NS: u64 = 10_000;
/// Fewest periods of the divided sensor signal in a conversion, at the lowest sensor frequency.
/// Each of the two gates loses up to two and a half of these periods, and the stated uncertainty
/// assumes the mean loss. The stated uncertainty is therefore up to 5 % too small with 4 periods,
/// and up to 2 % with 6.
const LEAST_PERIODS: u64 = 6;

/// The resonator on a channel, over its whole range of use.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Sensor {
    /// Lowest resonance frequency in hertz.
    pub lowest_hz: u32,
    /// Highest resonance frequency in hertz.
    pub highest_hz: u32,
    /// Highest quality factor, RP sqrt(C / L) (datasheet Equation 2).
    pub highest_quality_factor: u16,
    /// Lowest parallel resistance in ohm.
    pub lowest_rp_ohm: u32,
    /// Highest parallel resistance in ohm.
    pub highest_rp_ohm: u32,
}

impl Sensor {
    /// A sensor of which only the frequency range is known: assumes quality factor 50 and 5
    /// kiloohm, which flat coils of 8 to 25 mm diameter reach at 2 to 9 MHz (computed for this
    /// project's own coils: 37 to 49). Calibrate the drive current on the board.
    ///
    /// ```
    /// assert_eq!(ldc161x::Sensor::new(3_000_000, 4_000_000).highest_hz, 4_000_000);
    /// ```
    pub const fn new(lowest_hz: u32, highest_hz: u32) -> Self {
        Self {
            lowest_hz,
            highest_hz,
            highest_quality_factor: 50,
            lowest_rp_ohm: 5_000,
            highest_rp_ohm: 5_000,
        }
    }

    /// Whether a frequency in hertz lies in the range for which this sensor was planned.
    ///
    /// ```
    /// let sensor = ldc161x::Sensor::new(3_000_000, 4_000_000);
    /// assert!(sensor.covers(3.2e6) && !sensor.covers(2.9e6));
    /// ```
    pub fn covers(&self, frequency_hz: f64) -> bool {
        (f64::from(self.lowest_hz)..=f64::from(self.highest_hz)).contains(&frequency_hz)
    }
}

/// Requested frame rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Rate {
    /// At least this many frames per second, with conversions as long as the rate allows, since
    /// long conversions have the best resolution.
    PerSecond(u32),
    /// The highest rate at which the bus can read each frame and then one more register for
    /// [`check_canary`](crate::Ldc161x::check_canary).
    AsTheBusAllows,
    /// Conversions with this RCOUNT on every channel.
    Conversion(Rcount),
}

/// A request, from which a configuration is planned.
///
/// ```
/// use ldc161x::{Acquisition, Channel, Model, Plan, Rate, ReferenceClock, Request, Sensor};
///
/// const PLAN: Plan = match Request::new(
///     Model::Ldc1614,
///     ReferenceClock::External { hz: 30_000_000 },
///     Acquisition::Single(Channel::Zero),
///     Sensor::new(2_900_000, 3_800_000),
/// )
/// .rate(Rate::PerSecond(1_000))
/// .plan()
/// {
///     Ok(plan) => plan,
///     Err(_) => panic!("the sensor does not suit this clock"),
/// };
/// assert_eq!(PLAN.configuration.channel(Channel::Zero).rcount.get(), 1_873);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Request {
    /// Chip model.
    pub model: Model,
    /// Reference clock.
    pub reference: ReferenceClock,
    /// Channels to convert.
    pub acquisition: Acquisition,
    /// Sensors of channels 0 to 3.
    pub sensors: [Sensor; 4],
    /// Frame rate.
    pub rate: Rate,
    /// I2C clock in hertz.
    pub bus_hz: u32,
    /// How registers are read.
    pub access: BusAccess,
    /// Whether STATUS is read with each frame. This works on all chips, and is required on a chip
    /// whose INTB is released only by a read of STATUS. Determine which chip it is with
    /// [`probe_interrupt_release`](crate::Ldc161x::probe_interrupt_release).
    pub status_reads: bool,
    /// Whether every word is read twice; see [`set_read_twice`](crate::Ldc161x::set_read_twice).
    pub read_twice: bool,
    /// Noise parameters of the channels.
    pub noise: Noise,
}

impl Request {
    /// A request with the same sensor on every channel, at the highest rate that a bus of 400 kHz
    /// allows, with STATUS read in each frame.
    ///
    /// ```
    /// # use ldc161x::*;
    /// let request = Request::new(
    ///     Model::Ldc1612,
    ///     ReferenceClock::Internal,
    ///     Acquisition::Autoscan(Sequence::ZeroToOne),
    ///     Sensor::new(3_000_000, 4_000_000),
    /// );
    /// assert_eq!(request.bus_hz, 400_000);
    /// ```
    pub const fn new(
        model: Model,
        reference: ReferenceClock,
        acquisition: Acquisition,
        sensor: Sensor,
    ) -> Self {
        Self {
            model,
            reference,
            acquisition,
            sensors: [sensor; 4],
            rate: Rate::AsTheBusAllows,
            bus_hz: 400_000,
            access: BusAccess::FramePerTransaction,
            status_reads: true,
            read_twice: false,
            noise: Noise {
                white_relative_in_1_ms: 0.0,
                comparator_duty: None,
            },
        }
    }

    /// Sets the frame rate.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let request = Request::new(Model::Ldc1612, ReferenceClock::Internal,
    /// #     Acquisition::Single(Channel::Zero), Sensor::new(3_000_000, 4_000_000));
    /// assert_eq!(request.rate(Rate::PerSecond(500)).rate, Rate::PerSecond(500));
    /// ```
    pub const fn rate(mut self, rate: Rate) -> Self {
        self.rate = rate;
        self
    }

    /// Sets the sensor of one channel, for example of a reference coil.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let request = Request::new(Model::Ldc1612, ReferenceClock::Internal,
    /// #     Acquisition::Single(Channel::Zero), Sensor::new(3_000_000, 4_000_000));
    /// let reference_coil = Sensor::new(2_000_000, 2_100_000);
    /// assert_eq!(request.sensor(Channel::One, reference_coil).sensors[1], reference_coil);
    /// ```
    pub const fn sensor(mut self, channel: Channel, sensor: Sensor) -> Self {
        let [zero, one, two, three] = &mut self.sensors;
        *match channel {
            Channel::Zero => zero,
            Channel::One => one,
            Channel::Two => two,
            Channel::Three => three,
        } = sensor;
        self
    }

    /// Register values that fulfil the request within every limit of the datasheet.
    ///
    /// # Errors
    ///
    /// The first limit that the request breaks, with the limiting and the requested figures.
    ///
    /// ```
    /// # use ldc161x::*;
    /// let refusal = Request::new(
    ///     Model::Ldc1612,
    ///     ReferenceClock::External { hz: 12_000_000 },
    ///     Acquisition::Single(Channel::Zero),
    ///     Sensor::new(9_000_000, 11_000_000),
    /// )
    /// .plan();
    /// assert!(matches!(refusal, Err(LimitError::SensorFrequency { .. })));
    /// ```
    pub const fn plan(&self) -> Result<Plan, LimitError> {
        if let Err(refusal) = self.check_board() {
            return Err(refusal);
        }
        let reference_divider = match self.reference_divider() {
            Ok(divider) => divider,
            Err(refusal) => return Err(refusal),
        };
        let mut channels = [ChannelSettings::UNUSED; 4];
        let mut advice = Advice::NONE;
        let mut highest_hz = 0;
        let (mut least, mut slowest) = (Rcount::MIN, Channel::Zero);
        let mut position = 0;
        while let Some(channel) = self.acquisition.channel_at(position) {
            let sensor = &self.sensors[channel.number() as usize & 3];
            if let Err(refusal) = check_sensor(channel, sensor) {
                return Err(refusal);
            }
            let dividers = match self.dividers(channel, sensor, reference_divider) {
                Ok(dividers) => dividers,
                Err(refusal) => return Err(refusal),
            };
            let settle_count = match self.settle_count(channel, sensor, reference_divider) {
                Ok(count) => count,
                Err(refusal) => return Err(refusal),
            };
            let drive = match drive_code(channel, sensor) {
                Ok(drive) => drive,
                Err(refusal) => return Err(refusal),
            };
            advice = advice.with(sensor, drive, self.reference);
            if sensor.highest_hz > highest_hz {
                highest_hz = sensor.highest_hz;
            }
            let rcount = least_rcount(sensor, dividers, self.reference.range_hz().2);
            if rcount.get() > least.get() {
                (least, slowest) = (rcount, channel);
            }
            channels[channel.number() as usize & 3] = ChannelSettings {
                rcount: Rcount::MIN,
                settle_count,
                dividers,
                offset: 0,
                drive,
            };
            position += 1;
        }
        let mut configuration = Configuration {
            acquisition: self.acquisition,
            reference: self.reference,
            channels,
            deglitch: Deglitch::above(highest_hz),
            errors: ErrorConfig::DATA_READY,
            low_power_activation: false,
            noise: self.noise,
        };
        set_rcount(&mut configuration, least);
        let rcount = match self.rcount(&configuration, slowest) {
            Ok(rcount) => rcount,
            Err(refusal) => return Err(refusal),
        };
        let most_per_second = self.most_per_second(&configuration);
        set_rcount(&mut configuration, rcount);
        let plan = Plan {
            configuration,
            frame_read_ns: self.frame_read_ns(),
            frame_period_ns: frame_period_ns(&configuration, self.reference.range_hz().1),
            advice,
        };
        // The time between frames is shortest at the fastest clock.
        let shortest_ns = frame_period_ns(&configuration, self.reference.range_hz().2);
        if shortest_ns < plan.frame_read_ns {
            return Err(LimitError::BusTooSlow {
                frame_period_ns: shortest_ns,
                frame_read_ns: plan.frame_read_ns,
                most_per_second,
            });
        }
        Ok(plan)
    }

    const fn check_board(&self) -> Result<(), LimitError> {
        if !self.acquisition.fits(self.model) {
            return Err(LimitError::NoSuchChannel { model: self.model });
        }
        if self.bus_hz < BUS_HZ.0 || self.bus_hz > BUS_HZ.1 {
            return Err(LimitError::BusClock { hz: self.bus_hz });
        }
        if let ReferenceClock::External { hz } = self.reference
            && (hz < CLKIN_HZ.0 || hz > CLKIN_HZ.1)
        {
            return Err(LimitError::Clkin { hz });
        }
        Ok(())
    }

    /// The smallest FREF_DIVIDER with which the reference stays within its limit at the fastest
    /// clock, and each settling time within the range of SETTLECOUNT.
    const fn reference_divider(&self) -> Result<u16, LimitError> {
        let limit = match (self.acquisition, self.reference) {
            (Acquisition::Single(_), _) => SINGLE_REFERENCE_HZ,
            (Acquisition::Autoscan(_), ReferenceClock::External { .. }) => AUTOSCAN_REFERENCE_HZ.0,
            (Acquisition::Autoscan(_), ReferenceClock::Internal) => AUTOSCAN_REFERENCE_HZ.1,
        };
        let (slowest, _, fastest) = self.reference.range_hz();
        let smallest = at_least_one(fastest.div_ceil(limit) as u64) as u32;
        // SETTLECOUNT has 16 bits: a slow sensor with a high quality factor needs a slower
        // reference.
        let mut divider = smallest;
        let mut slowest_to_settle = Channel::Zero;
        let mut position = 0;
        while let Some(channel) = self.acquisition.channel_at(position) {
            let sensor = &self.sensors[channel.number() as usize & 3];
            let least = settle_periods(sensor, fastest).div_ceil(u16::MAX as u64);
            if least > divider as u64 {
                divider = if least > 1_023 { 1_024 } else { least as u32 };
                slowest_to_settle = channel;
            }
            position += 1;
        }
        if divider > 1_023 || slowest < divider {
            return Err(LimitError::SettleTooLong {
                channel: slowest_to_settle,
            });
        }
        Ok(divider as u16)
    }

    /// The smallest FIN_DIVIDER with which the counter's input stays below a quarter of the slowest
    /// reference.
    const fn dividers(
        &self,
        channel: Channel,
        sensor: &Sensor,
        reference_divider: u16,
    ) -> Result<ClockDividers, LimitError> {
        let (slowest, _, _) = self.reference.range_hz();
        let mut divider = if sensor.highest_hz >= DIVIDE_FROM_HZ {
            2
        } else {
            1
        };
        while divider <= 15 {
            let input_four_times = 4 * sensor.highest_hz as u64 * reference_divider as u64;
            if input_four_times < slowest as u64 * divider as u64
                && let Some(dividers) = ClockDividers::new(divider, reference_divider)
            {
                return Ok(dividers);
            }
            divider += 1;
        }
        Err(LimitError::ReferenceTooSlow {
            channel,
            sensor_hz: sensor.highest_hz,
            reference_hz: (slowest as u64 / at_least_one(reference_divider as u64)) as u32,
        })
    }

    /// SETTLECOUNT >= Q fREF / (16 f), rounded up (datasheet Equation 10), at least 4. Q is the
    /// highest quality factor, f the lowest sensor frequency.
    const fn settle_count(
        &self,
        channel: Channel,
        sensor: &Sensor,
        reference_divider: u16,
    ) -> Result<SettleCount, LimitError> {
        let (_, _, fastest) = self.reference.range_hz();
        let count =
            settle_periods(sensor, fastest).div_ceil(at_least_one(reference_divider as u64));
        let count = if count < SettleCount::MIN.get() as u64 {
            SettleCount::MIN.get() as u64
        } else {
            count
        };
        if count <= u16::MAX as u64
            && let Some(settle_count) = SettleCount::new(count as u16)
        {
            return Ok(settle_count);
        }
        Err(LimitError::SettleTooLong { channel })
    }

    /// The RCOUNT of all channels: the longest conversion with which the frame still meets the
    /// requested rate. `shortest` has the least RCOUNT, set by channel `slowest`.
    const fn rcount(
        &self,
        shortest: &Configuration,
        slowest: Channel,
    ) -> Result<Rcount, LimitError> {
        match self.rate {
            Rate::Conversion(rcount) => {
                let least = shortest.channel(slowest).rcount;
                if rcount.get() < least.get() {
                    return Err(LimitError::ConversionTooShort {
                        channel: slowest,
                        rcount,
                        least,
                    });
                }
                Ok(rcount)
            }
            Rate::PerSecond(0) => Err(LimitError::RateZero),
            Rate::PerSecond(rate) => {
                // A frame takes longest at the slowest clock, and must meet the rate even then.
                let (slowest_hz, _, _) = self.reference.range_hz();
                let requested_period_ns = 1_000_000_000 / rate as u64;
                let frame_period_ns = frame_period_ns(shortest, slowest_hz);
                if frame_period_ns > requested_period_ns {
                    return Err(LimitError::RateTooHigh {
                        frame_period_ns,
                        requested_period_ns,
                        most_per_second: self.most_per_second(shortest),
                    });
                }
                Ok(rcount_within(shortest, requested_period_ns, slowest_hz))
            }
            Rate::AsTheBusAllows => {
                let besides_ns = self.read_ns(1);
                Ok(self.rcount_beyond(shortest, self.frame_read_ns() + besides_ns))
            }
        }
    }

    /// Highest frame rate per second that can be requested; 0 if the bus is too slow to read the
    /// frames even with the longest conversions.
    const fn most_per_second(&self, shortest: &Configuration) -> u32 {
        let mut configuration = *shortest;
        let rcount = self.rcount_beyond(shortest, self.frame_read_ns());
        set_rcount(&mut configuration, rcount);
        if frame_period_ns(&configuration, self.reference.range_hz().2) < self.frame_read_ns() {
            return 0;
        }
        let longest_ns = frame_period_ns(&configuration, self.reference.range_hz().0);
        (1_000_000_000 / at_least_one(longest_ns)) as u32
    }

    /// Least RCOUNT with which a frame takes at least `period_ns` at the fastest clock.
    const fn rcount_beyond(&self, shortest: &Configuration, period_ns: u64) -> Rcount {
        let (_, _, fastest_hz) = self.reference.range_hz();
        let mut configuration = *shortest;
        let mut rcount = rcount_within(shortest, period_ns, fastest_hz);
        set_rcount(&mut configuration, rcount);
        // Runs at most twice: apart from rounding, the loop starts at the largest RCOUNT within the
        // period.
        while frame_period_ns(&configuration, fastest_hz) < period_ns && rcount.get() < u16::MAX {
            rcount = match Rcount::new(rcount.get() + 1) {
                Some(next) => next,
                None => Rcount::MAX,
            };
            set_rcount(&mut configuration, rcount);
        }
        rcount
    }

    /// Time on the bus for one frame in nanoseconds, including the master's own delay.
    const fn frame_read_ns(&self) -> u64 {
        let words = self.acquisition.channel_count() as u32 * (1 + self.read_twice as u32);
        self.read_ns(2 * words + self.status_reads as u32)
    }

    /// Time on the bus for a number of registers in nanoseconds, including the master's own delay.
    const fn read_ns(&self, registers: u32) -> u64 {
        let bits = self.access.bit_times(registers) as u64;
        (bits * 1_000_000_000).div_ceil(at_least_one(self.bus_hz as u64)) + MASTER_GAP_NS
    }
}

/// Gives every channel this RCOUNT.
const fn set_rcount(configuration: &mut Configuration, rcount: Rcount) {
    let mut position = 0;
    while let Some(channel) = configuration.acquisition.channel_at(position) {
        configuration.channel_mut(channel).rcount = rcount;
        position += 1;
    }
}

/// RCOUNT and FREF_DIVIDER, which are equal on all channels.
const fn common(configuration: &Configuration) -> (Rcount, u16) {
    match configuration.acquisition.channel_at(0) {
        Some(first) => {
            let settings = configuration.channel(first);
            (settings.rcount, settings.dividers.reference())
        }
        None => (Rcount::MIN, 1),
    }
}

/// Largest RCOUNT with which a frame at `clock_hz` takes at most `period_ns`. With the RCOUNT of
/// `shortest`, the frame must fit within that time.
const fn rcount_within(shortest: &Configuration, period_ns: u64, clock_hz: u32) -> Rcount {
    let (least, divider) = common(shortest);
    let least_ns = frame_period_ns(shortest, clock_hz);
    let channels = at_least_one(shortest.acquisition.channel_count() as u64);
    let spare_ns = period_ns.saturating_sub(least_ns) / channels;
    let spare = spare_ns * clock_hz as u64 / at_least_one(16 * divider as u64 * 1_000_000_000);
    let count = spare + least.get() as u64;
    if count > u16::MAX as u64 {
        return Rcount::MAX;
    }
    let mut rcount = match Rcount::new(count as u16) {
        Some(rcount) => rcount,
        None => least,
    };
    // Because the computed RCOUNT is rounded down, one more may fit.
    if let Some(next) = Rcount::new(rcount.get().saturating_add(1)) {
        let mut configuration = *shortest;
        set_rcount(&mut configuration, next);
        if frame_period_ns(&configuration, clock_hz) <= period_ns {
            rcount = next;
        }
    }
    rcount
}

/// Least RCOUNT with which a conversion contains [`LEAST_PERIODS`] of the sensor's lowest
/// frequency. Its highest possible value is 41,250: a sensor of 1 kHz, divided by 2 because of its
/// highest frequency, at the 55 MHz of the internal oscillator.
const fn least_rcount(sensor: &Sensor, dividers: ClockDividers, clock_hz: u32) -> Rcount {
    let counted = LEAST_PERIODS * dividers.sensor() as u64 * clock_hz as u64;
    let lowest = 16 * dividers.reference() as u64 * sensor.lowest_hz as u64;
    let count = counted.div_ceil(at_least_one(lowest));
    if count > u16::MAX as u64 {
        return Rcount::MAX;
    }
    match Rcount::new(count as u16) {
        Some(rcount) => rcount,
        None => Rcount::MIN,
    }
}

/// Returns the divisor, or 1 for 0, so that the compiler can omit the check for zero: a division
/// that could panic would link the panic machinery into the program. The divisor is never 0, since
/// clocks, bus and sensors are checked before.
const fn at_least_one(divisor: u64) -> u64 {
    if divisor == 0 { 1 } else { divisor }
}

/// Settling time of a sensor in units of 16 periods of the undivided clock: SETTLECOUNT times
/// FREF_DIVIDER.
const fn settle_periods(sensor: &Sensor, clock_hz: u32) -> u64 {
    let numerator = sensor.highest_quality_factor as u64 * clock_hz as u64;
    let lowest_hz = at_least_one(sensor.lowest_hz as u64);
    numerator.div_ceil(16 * lowest_hz)
}

const fn check_sensor(channel: Channel, sensor: &Sensor) -> Result<(), LimitError> {
    let Sensor {
        lowest_hz,
        highest_hz,
        ..
    } = *sensor;
    if lowest_hz < SENSOR_HZ.0 || highest_hz > SENSOR_HZ.1 || lowest_hz > highest_hz {
        return Err(LimitError::SensorFrequency {
            channel,
            lowest_hz,
            highest_hz,
        });
    }
    let Sensor {
        lowest_rp_ohm,
        highest_rp_ohm,
        ..
    } = *sensor;
    if lowest_rp_ohm < RP_OHM.0 || highest_rp_ohm > RP_OHM.1 || lowest_rp_ohm > highest_rp_ohm {
        return Err(LimitError::ParallelResistance {
            channel,
            lowest_rp_ohm,
            highest_rp_ohm,
        });
    }
    Ok(())
}

/// The strongest drive code with an amplitude below the clamp at the highest parallel resistance;
/// an error if it does not keep the sensor oscillating at the lowest resistance.
const fn drive_code(channel: Channel, sensor: &Sensor) -> Result<DriveCode, LimitError> {
    let Some(drive) = DriveCode::strongest_below_clamp(sensor.highest_rp_ohm) else {
        return Err(LimitError::AmplitudeTooHigh {
            channel,
            highest_rp_ohm: sensor.highest_rp_ohm,
        });
    };
    if drive.amplitude_v(sensor.lowest_rp_ohm) < LOWEST_AMPLITUDE_V {
        return Err(LimitError::ResistanceRange {
            channel,
            lowest_rp_ohm: sensor.lowest_rp_ohm,
            highest_rp_ohm: sensor.highest_rp_ohm,
        });
    }
    Ok(drive)
}

/// Time between frames in nanoseconds at `clock_hz`: with autoscan, settling, conversion and
/// switching of every channel; with one channel, conversion and switching only.
const fn frame_period_ns(configuration: &Configuration, clock_hz: u32) -> u64 {
    let mut total_ns = 0;
    let mut position = 0;
    while let Some(channel) = configuration.acquisition.channel_at(position) {
        let settings = configuration.channel(channel);
        let settling = match configuration.acquisition {
            Acquisition::Single(_) => 0,
            Acquisition::Autoscan(_) => settings.settle_count.reference_periods() as u64,
        };
        let periods = settling + settings.rcount.reference_periods() as u64 + SWITCH_PERIODS;
        let clock_periods = periods * settings.dividers.reference() as u64;
        total_ns +=
            (clock_periods * 1_000_000_000).div_ceil(at_least_one(clock_hz as u64)) + SWITCH_NS;
        position += 1;
    }
    total_ns
}

/// Properties of a plan that its user should know.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Advice {
    /// The sensor's frequency may be a third, a fifth or a seventh of the clock's, where a weakly
    /// driven oscillator can lock to the clock (application note SNOA945).
    pub injection_lock: bool,
    /// At its lowest resistance the sensor's amplitude is below 1.2 V: the sensor works, but with
    /// more noise and with the amplitude flag set.
    pub low_amplitude: bool,
    /// The internal oscillator's frequency is unknown within 35 to 55 MHz: measured frequencies are
    /// not absolute without calibration.
    pub uncalibrated_clock: bool,
}

impl Advice {
    const NONE: Self = Self {
        injection_lock: false,
        low_amplitude: false,
        uncalibrated_clock: false,
    };

    const fn with(mut self, sensor: &Sensor, drive: DriveCode, reference: ReferenceClock) -> Self {
        let (slowest, _, fastest) = reference.range_hz();
        let mut odd = 3;
        while odd <= 7 {
            if sensor.lowest_hz <= fastest / odd && slowest / odd <= sensor.highest_hz {
                self.injection_lock = true;
            }
            odd += 2;
        }
        if drive.amplitude_v(sensor.lowest_rp_ohm) < LOWEST_CLEAN_AMPLITUDE_V {
            self.low_amplitude = true;
        }
        if let ReferenceClock::Internal = reference {
            self.uncalibrated_clock = true;
        }
        self
    }
}

/// A configuration that respects every limit, with its timing.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Plan {
    /// Register values.
    pub configuration: Configuration,
    /// Time between frames in nanoseconds at the nominal clock, with the switching time of Equation
    /// 8. Sources differ about the true switching time: measure the time between frames at INTB.
    pub frame_period_ns: u64,
    /// Time on the bus for each frame in nanoseconds, including 10 us for the master's own delay.
    pub frame_read_ns: u64,
    /// Properties that the user should know.
    pub advice: Advice,
}

impl Plan {
    /// Frames per second at the nominal clock.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let plan = Request::new(Model::Ldc1612, ReferenceClock::External { hz: 30_000_000 },
    /// #     Acquisition::Single(Channel::Zero), Sensor::new(3_000_000, 4_000_000))
    /// #     .rate(Rate::PerSecond(500)).plan().unwrap();
    /// assert!((plan.frames_per_second() - 500.0).abs() < 0.5);
    /// ```
    pub fn frames_per_second(&self) -> f32 {
        1e9 / self.frame_period_ns as f32
    }

    /// Fraction of the time for which frames occupy the bus, 0 to 1.
    ///
    /// ```
    /// # use ldc161x::*;
    /// # let plan = Request::new(Model::Ldc1612, ReferenceClock::External { hz: 30_000_000 },
    /// #     Acquisition::Single(Channel::Zero), Sensor::new(3_000_000, 4_000_000))
    /// #     .plan().unwrap();
    /// // a frame of three registers, and one register before the next
    /// assert!((plan.bus_load() - 0.74).abs() < 0.01);
    /// ```
    pub fn bus_load(&self) -> f32 {
        self.frame_read_ns as f32 / self.frame_period_ns as f32
    }
}
