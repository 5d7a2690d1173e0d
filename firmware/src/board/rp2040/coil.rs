//! Implements the coil hardware of this board; `palpate_node::coil` manages the drive.

use coil_hbridge::{Averages, Drive, Order, Supervisor, Trace};
use palpate_node::coil::{
    AVERAGED_BLOCKS, CoilCircuit, CoilHardware, EnergyWords, LastPeriod, SlowReadings, TRACE_LENGTH,
};
use rtic_monotonics::rp2040::prelude::*;

use super::{control, safe};
use crate::{Mono, crash};

/// The coil hardware: control interrupt, bridge and ADC.
pub struct PicoCoil;

impl CoilHardware for PicoCoil {
    const CIRCUIT: CoilCircuit = CoilCircuit::REFERENCE;

    fn now_us(&self) -> u64 {
        Mono::now().as_ticks()
    }

    fn bridge_off(&mut self) {
        safe::bridge_off();
    }

    fn run(&mut self, on: bool) {
        control::run(on);
    }

    fn with_drive<T>(&mut self, work: impl FnOnce(&mut Drive) -> T) -> Option<T> {
        control::with_drive(work)
    }

    fn apply(&mut self, order: &Order) {
        control::apply(order);
    }

    fn slow_readings(&self) -> SlowReadings {
        control::slow_readings()
    }

    fn take_supply_at_off(&mut self) -> Option<u16> {
        control::take_supply_at_off()
    }

    fn kept_energy(&self) -> EnergyWords {
        crash::kept_energy()
    }

    fn keep_energy(&mut self, words: EnergyWords) {
        crash::keep_energy(words);
    }

    fn last_period(&self) -> LastPeriod {
        control::last()
    }

    fn averages(&self) -> &Averages<AVERAGED_BLOCKS> {
        &control::AVERAGES
    }

    fn trace(&self) -> &Trace<TRACE_LENGTH> {
        &control::TRACE
    }
}

/// Starts PWM, ADC and drive, with the bridge off. Returns `None` if the circuit's constants are
/// inconsistent: without a drive there is no current.
pub fn start() -> Option<Supervisor> {
    let (supervisor, drive) = PicoCoil::CIRCUIT.drive().ok()?;
    control::start(drive);
    Some(supervisor)
}
