//! Coil hardware that a board provides.

use coil_hbridge::{Averages, Drive, Hardware, Limits, Order, Refusal, Supervisor, Trace};

use super::kept::EnergyWords;
use crate::board;

/// Number of stored block averages of the measured current: 512 of 256 us last longer than the slowest
/// scan, which has four conversions of 26 ms at 40 MHz.
pub const AVERAGED_BLOCKS: usize = 512;
/// Number of currents in a trace, which one `drive_coil` command records (docs/protocol.md,
/// `current_trace`).
pub const TRACE_LENGTH: usize = 128;

/// Bridge, current measurement and slow readings of a board.
#[derive(Clone, Copy, Debug)]
pub struct CoilCircuit {
    /// PWM and current measurement.
    pub hardware: Hardware,
    /// Hard limits of every command.
    pub limits: Limits,
    /// Number of ADC counts that correspond to the reference voltage, for thermistor and supply.
    pub counts: f32,
    /// Reference voltage of the ADC, V.
    pub reference_v: f32,
    /// Ratio of the coil's supply to the voltage at the ADC.
    pub supply_ratio: f32,
}

impl CoilCircuit {
    /// Circuit of the reference board (docs/firmware.md): a supply divider of 100 and 10 kiloohm, and an
    /// ADC of 12 bits for 3.3 V.
    pub const REFERENCE: Self = Self {
        hardware: board::HARDWARE,
        limits: board::DRIVE_LIMITS,
        counts: 4096.0,
        reference_v: 3.3,
        supply_ratio: 11.0,
    };

    /// Creates the drive for the board's control interrupt, and the supervisor from which a manager is
    /// made once the interrupt owns the drive. The bridge is off.
    ///
    /// # Errors
    ///
    /// Returns an error if the constants of the circuit are inconsistent.
    pub fn drive(&self) -> Result<(Supervisor, Drive), Refusal> {
        Supervisor::new(self.hardware, self.limits)
    }

    /// Returns the period of the PWM in whole microseconds.
    #[must_use]
    pub const fn period_us(&self) -> u32 {
        (self.hardware.period_s * 1e6 + 0.5) as u32
    }

    /// Returns the voltage in the middle of an ADC count, V.
    pub(crate) const fn volts(&self, count: f32) -> f32 {
        (count + 0.5) * (self.reference_v / self.counts)
    }

    /// Converts a reading to the coil's supply, V.
    pub(crate) fn supply_v(&self, reading: u16) -> f32 {
        self.supply_ratio * self.volts(reading.into())
    }
}

/// Last readings of slowly changing quantities, as ADC counts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlowReadings {
    /// Reading of the coil's thermistor.
    pub thermistor: u16,
    /// Reading of the coil's supply.
    pub supply: u16,
}

/// Last period of the control interrupt.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastPeriod {
    /// Number of the period in [`Averages`]; wraps.
    pub number: u32,
    /// End of the period on the board's timer, us: the middle between its two samples plus half a
    /// period.
    pub ended_us: u64,
}

/// Coil hardware of a board.
///
/// The control interrupt owns the [`Drive`]: it calls [`Drive::tick`] once a period, writes the
/// levels, then [`Drive::account`], and pushes the measured current into averages and trace.
pub trait CoilHardware {
    /// The board's circuit.
    const CIRCUIT: CoilCircuit;

    /// Returns the time of the board's timer, us.
    fn now_us(&self) -> u64;

    /// Switches the bridge off at once: the safe state.
    fn bridge_off(&mut self);

    /// Enables or disables the control interrupt; it may be disabled only while the bridge is off.
    fn run(&mut self, on: bool);

    /// Gives `work` access to the drive while the control interrupt cannot run. `work` takes a
    /// microsecond: it reads, or makes a small change. Returns `None` without a drive.
    fn with_drive<T>(&mut self, work: impl FnOnce(&mut Drive) -> T) -> Option<T>;

    /// Applies an order of any length.
    fn apply(&mut self, order: &Order);

    /// Returns the last slow readings.
    fn slow_readings(&self) -> SlowReadings;

    /// Takes the supply reading of the moment at which the bridge went off; `None` on later calls.
    fn take_supply_at_off(&mut self) -> Option<u16>;

    /// Returns the energy words that the previous run left; arbitrary words after a loss of power.
    fn kept_energy(&self) -> EnergyWords;

    /// Stores the energy words for the next run, in memory that no reset clears.
    fn keep_energy(&mut self, words: EnergyWords);

    /// Returns the last period of the control interrupt.
    fn last_period(&self) -> LastPeriod;

    /// Returns the block averages of the measured current.
    fn averages(&self) -> &Averages<AVERAGED_BLOCKS>;

    /// Returns the measured current period by period, if a trace was requested.
    fn trace(&self) -> &Trace<TRACE_LENGTH>;
}
