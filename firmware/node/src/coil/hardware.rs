//! What a board gives for its coil.

use coil_hbridge::{Averages, Drive, Hardware, Limits, Order, Trace};

use super::kept::EnergyWords;
use crate::board;

/// Blocks of the measured current that are kept: 512 of 256 us are longer than the slowest
/// conversion of the first channel (26 ms at 40 MHz) and the three that follow it.
pub const AVERAGED_BLOCKS: usize = 512;
/// Currents of a record: those of one `drive_coil` (docs/protocol.md, `current_trace`).
pub const TRACE_LENGTH: usize = 128;

/// Bridge, current measurement and slow readings of a board.
#[derive(Clone, Copy, Debug)]
pub struct CoilCircuit {
    /// PWM and current measurement.
    pub hardware: Hardware,
    /// What no command exceeds.
    pub limits: Limits,
    /// Counts of the converter of thermistor and supply.
    pub counts: f32,
    /// Its reference, V.
    pub reference_v: f32,
    /// The coil's supply over what the converter reads of it.
    pub supply_ratio: f32,
}

impl CoilCircuit {
    /// The reference board (docs/firmware.md): 100 over 10 kiloohm at the supply, 12 bits of 3.3 V.
    pub const REFERENCE: Self = Self {
        hardware: board::HARDWARE,
        limits: board::LIMITS,
        counts: 4096.0,
        reference_v: 3.3,
        supply_ratio: 11.0,
    };

    /// A period of the PWM in whole microseconds.
    #[must_use]
    pub const fn period_us(&self) -> u32 {
        (self.hardware.period_s * 1e6 + 0.5) as u32
    }

    /// The middle of a count of the converter, V.
    pub(crate) const fn volts(&self, count: f32) -> f32 {
        (count + 0.5) * (self.reference_v / self.counts)
    }

    /// The coil's supply, V, by a reading.
    pub(crate) fn supply_v(&self, reading: u16) -> f32 {
        self.supply_ratio * self.volts(reading.into())
    }
}

/// The last readings of what changes slowly, as counts of the converter.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct SlowReadings {
    /// Of the coil's thermistor.
    pub thermistor: u16,
    /// Of the coil's supply.
    pub supply: u16,
}

/// When the last period of the control interrupt ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LastPeriod {
    /// Its number in [`Averages`]; wraps.
    pub number: u32,
    /// Its end on the board's timer, us: the middle between its two samples and half a period.
    pub ended_us: u64,
}

/// The coil's side of a board.
///
/// The control interrupt owns the [`Drive`]: it calls [`Drive::tick`] once a period, writes the
/// levels, then [`Drive::account`], and pushes the measured current into averages and trace.
pub trait CoilHardware {
    /// The board's circuit.
    const CIRCUIT: CoilCircuit;

    /// The board's timer, us.
    fn now_us(&self) -> u64;

    /// Switches the bridge off, now: the safe state.
    fn bridge_off(&mut self);

    /// Lets the control interrupt run, or rest while the bridge is off.
    fn run(&mut self, on: bool);

    /// Lets `work` see the drive while no control interrupt comes: for a microsecond, to read or to
    /// change little. Nothing without a drive.
    fn with_drive<T>(&mut self, work: impl FnOnce(&mut Drive) -> T) -> Option<T>;

    /// Applies an order of any length.
    fn apply(&mut self, order: &Order);

    /// The last slow readings.
    fn slow_readings(&self) -> SlowReadings;

    /// The supply's reading of the moment at which the bridge went off, once.
    fn take_supply_at_off(&mut self) -> Option<u16>;

    /// The energy's words that the run before left; any words after a loss of power.
    fn kept_energy(&self) -> EnergyWords;

    /// Leaves the energy's words for the next run: a reset does not clear them.
    fn keep_energy(&mut self, words: EnergyWords);

    /// The last period of the control interrupt.
    fn last_period(&self) -> LastPeriod;

    /// The measured current, in blocks.
    fn averages(&self) -> &Averages<AVERAGED_BLOCKS>;

    /// The measured current, period by period, when that was asked for.
    fn trace(&self) -> &Trace<TRACE_LENGTH>;
}
