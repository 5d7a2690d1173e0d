//! Coil of the native board: the driver's own control law around the simulated circuit.

use core::cell::RefCell;
use std::rc::Rc;

use coil_hbridge::{Averages, Drive, Order, Trace};
use ldc161x_sim::Time;
use palpate_node::coil::{
    AVERAGED_BLOCKS, CoilCircuit, CoilHardware, EnergyWords, LastPeriod, SlowReadings, TRACE_LENGTH,
};

use super::drive::CoilDrive;
use super::wiring::{Wiring, micros};
use crate::electrical::thermistor_v;

/// Ratio of the coil's supply to the voltage at its converter input.
const SUPPLY_RATIO: f64 = 11.0;
/// Time from the end of the window over which a period's two samples average to the end of the
/// period: a quarter of the period.
const AFTER_WINDOW: Time = Time::from_us(4);

/// Coil hardware of the native board.
#[derive(Clone)]
pub(super) struct NativeCoil<'a> {
    wiring: &'a Wiring,
    averages: Rc<Averages<AVERAGED_BLOCKS>>,
    trace: Rc<Trace<TRACE_LENGTH>>,
}

impl<'a> NativeCoil<'a> {
    pub(super) fn new(wiring: &'a Wiring) -> Self {
        let drive = wiring.drive.borrow();
        Self {
            wiring,
            averages: drive.control.averages().clone(),
            trace: drive.control.trace().clone(),
        }
    }

    fn drive(&self) -> &RefCell<CoilDrive> {
        &self.wiring.drive
    }
}

impl CoilHardware for NativeCoil<'_> {
    const CIRCUIT: CoilCircuit = CoilCircuit::REFERENCE;

    fn now_us(&self) -> u64 {
        micros(self.wiring.now())
    }

    fn bridge_off(&mut self) {
        self.drive().borrow_mut().control.bridge_off();
    }

    fn run(&mut self, on: bool) {
        let now = self.wiring.now();
        self.drive().borrow_mut().run(on, now);
    }

    fn with_drive<T>(&mut self, work: impl FnOnce(&mut Drive) -> T) -> Option<T> {
        let now = self.wiring.now();
        let mut of = self.drive().borrow_mut();
        of.advance_to(now);
        Some(work(&mut of.control.drive))
    }

    fn apply(&mut self, order: &Order) {
        self.with_drive(|drive| drive.apply(order));
    }

    fn slow_readings(&self) -> SlowReadings {
        let mut of = self.drive().borrow_mut();
        let volts = thermistor_v(of.world.borrow().truth().pad_c);
        let supply_v = f64::from(of.control.supply_v());
        SlowReadings {
            thermistor: of.control.converter.code(volts),
            supply: of.control.converter.code(supply_v / SUPPLY_RATIO),
        }
    }

    fn take_supply_at_off(&mut self) -> Option<u16> {
        let mut of = self.drive().borrow_mut();
        let supply_v = f64::from(of.control.take_supply_at_off_v()?);
        Some(of.control.converter.code(supply_v / SUPPLY_RATIO))
    }

    fn kept_energy(&self) -> EnergyWords {
        self.wiring.kept_energy.get()
    }

    fn keep_energy(&mut self, words: EnergyWords) {
        self.wiring.kept_energy.set(words);
    }

    fn last_period(&self) -> LastPeriod {
        let now = self.wiring.now();
        let mut of = self.drive().borrow_mut();
        of.advance_to(now);
        LastPeriod {
            number: self.averages.now(),
            ended_us: micros(of.ended).saturating_sub(micros(AFTER_WINDOW)),
        }
    }

    fn averages(&self) -> &Averages<AVERAGED_BLOCKS> {
        &self.averages
    }

    fn trace(&self) -> &Trace<TRACE_LENGTH> {
        &self.trace
    }
}
