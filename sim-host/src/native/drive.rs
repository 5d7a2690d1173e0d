//! Circuit and control interrupt of the native board's coil.

use coil_hbridge::Drive;
use ldc161x_sim::Time;
use palpate_node::coil::CoilCircuit;

use crate::electrical::{
    Circuit, CircuitParameters, ControlLoop, Converter, ConverterParameters, Passed, Totals,
};
use crate::world::{SharedWorld, World};

/// Period of the PWM.
const PERIOD: Time = Time::from_us(16);

/// PWM periods per step of the plant: 128 us with constant current. An elastomer with a lag of 5 ms
/// follows a fortieth of a change in this time.
const PERIODS_A_STEP: u32 = 8;

/// Steps between two updates of resistance and temperature: 1 ms.
const STEPS_A_CHANGE: u32 = 8;

/// Supply of the coil where the world's supply has no limit, V: that of the reference board.
const NO_LIMIT_V: f64 = 12.0;

/// Factor on the bridge's current limit in the self-test.
const LIMIT_LOW: f64 = 2.0 / 15.0;

/// Circuit and control interrupt, with the world whose coil they drive.
pub(super) struct CoilDrive {
    pub(super) world: SharedWorld,
    /// The circuit, its measurement and the control interrupt.
    pub(super) control: ControlLoop,
    runs: bool,
    /// End of the last period.
    pub(super) ended: Time,
    reported: Totals,
    steps: u32,
}

impl CoilDrive {
    pub(super) fn new(world: SharedWorld, drive: Drive) -> Self {
        let control = {
            let world = world.borrow();
            let current = &world.parameters().current;
            let converter = ConverterParameters {
                nonlinearity_lsb: current.nonlinearity_lsb,
                nonlinearity_phase: current.nonlinearity_phase,
                noise_lsb: current.noise_lsb,
                ..ConverterParameters::EXACT
            };
            let converter = Converter::new(converter, world.parameters().seed);
            let circuit = Circuit::new(circuit_parameters(&world));
            let hardware = CoilCircuit::REFERENCE.hardware;
            let mut control = ControlLoop::new(circuit, converter, drive, hardware);
            control.slow.gain_error = current.gain_error;
            control.slow.limit_low = LIMIT_LOW;
            control
        };
        let ended = world.borrow().now();
        Self {
            ended,
            world,
            control,
            runs: false,
            reported: Totals::default(),
            steps: 0,
        }
    }

    /// Advances circuit and world.
    pub(super) fn advance_to(&mut self, time: Time) {
        while self.runs && self.ended + PERIOD <= time {
            let left = (time - self.ended).as_ps() / PERIOD.as_ps();
            self.step(PERIODS_A_STEP.min(left as u32));
        }
        if !self.runs {
            self.world.borrow_mut().advance_to(time);
        }
    }

    /// Runs some periods, and passes their mean current to the plant.
    fn step(&mut self, periods: u32) {
        if self.steps.is_multiple_of(STEPS_A_CHANGE) {
            self.control.circuit.parameters = circuit_parameters(&self.world.borrow());
        }
        self.steps = self.steps.wrapping_add(1);
        for _ in 0..periods {
            self.control.period();
        }
        self.ended += PERIOD.times(periods.into());
        let now = self.control.circuit.totals();
        let before = core::mem::replace(&mut self.reported, now);
        let passed = Passed::between(&before, &now);
        let mut world = self.world.borrow_mut();
        // The world's time is still the end of the previous step, so the current acts in this step.
        world.set_current_with_ripple(passed.mean_a, passed.ripple_a);
        world.advance_to(self.ended);
    }

    pub(super) fn run(&mut self, on: bool, now: Time) {
        self.advance_to(now);
        if on && !self.runs {
            // The PWM's periods count from time zero of the world.
            let periods = now.as_ps() / PERIOD.as_ps();
            self.ended = PERIOD.times(periods);
            self.reported = self.control.circuit.totals();
        }
        if !on {
            self.world.borrow_mut().set_current(0.0);
        }
        self.runs = on;
    }
}

/// Parameters of the circuit: the coil's resistance changes with its temperature.
fn circuit_parameters(world: &World) -> CircuitParameters {
    let current = &world.parameters().current;
    let supply_v = if current.supply_v.is_finite() {
        current.supply_v
    } else {
        NO_LIMIT_V
    };
    CircuitParameters {
        supply_ohm: current.supply_ohm,
        ..CircuitParameters::common(world.truth().coil_ohm, current.inductance_h, supply_v)
    }
}
