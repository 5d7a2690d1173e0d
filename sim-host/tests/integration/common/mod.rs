//! Shared code of the tests.

use core::cell::RefCell;

use coil_hbridge::Limits;
use embedded_hal::i2c::I2c;
use ldc161x_sim::{Bus, Chip, Settings};
use palpate_sim::Time;
use palpate_sim::electrical::{
    Circuit, CircuitParameters, Converter, ConverterParameters, Regulated, reference_hardware,
    reference_limits,
};
use palpate_sim::mechanics::{layer::CreepMode, load::Load, press::Profile};
use palpate_sim::parameters::{Parameters, central, draw};
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, SharedWorld, Truth, World};

pub(crate) fn ms(milliseconds: u64) -> Time {
    Time::from_ms(milliseconds)
}

/// A drawn plant.
pub(crate) fn plant(stack: &str, seed: u64) -> Parameters {
    let (stack, disturbances) = files(stack);
    draw(&stack, &disturbances, seed)
}

/// The plant at the centre of all ranges.
pub(crate) fn middle(stack: &str) -> Parameters {
    let (stack, disturbances) = files(stack);
    central(&stack, &disturbances)
}

fn files(stack: &str) -> (Stack, Disturbances) {
    (
        Stack::builtin(stack).expect("it comes with the crate"),
        Disturbances::builtin().expect("it comes with the crate"),
    )
}

pub(crate) fn world(plant: &Parameters, switches: Switches, setup: Setup) -> World {
    World::new(plant, switches, setup).expect("it is a plant")
}

/// A spring as stiff as the sensing layer, pressed by 0.8 mm in 0.2 s and held.
pub(crate) fn pressed(plant: &Parameters) -> Setup {
    Setup {
        load: Load::Spring {
            n_per_m: plant.sensing.spring_n_per_m,
        },
        profile: Profile::at(-0.2e-3).then_move(0.8e-3, 5e-3),
        ..Setup::default()
    }
}

/// A load that relaxes with time constants of 20 ms to 200 s.
pub(crate) fn viscoelastic(n_per_m: f64) -> Load {
    let taus_s = [0.02, 0.2, 2.0, 20.0, 200.0];
    let creep = taus_s.map(|tau_s| CreepMode {
        amplitude: 0.1,
        tau_s,
    });
    Load::Viscoelastic { n_per_m, creep }
}

/// All values of a truth, as bits.
pub(crate) fn bits(truth: &Truth) -> Vec<u64> {
    let energy = &truth.energy;
    [
        truth.time.as_secs_f64(),
        truth.force_n,
        truth.actuated_force_n,
        truth.attraction_n,
        truth.sensing_m,
        truth.apparent_m,
        truth.actuated_m,
        truth.load_m,
        truth.load_creep_m,
        truth.frame_m,
        truth.opening_m,
        truth.press_m,
        truth.growth_m,
        truth.sensing_creep_m,
        truth.actuated_creep_m,
        truth.sensing_spring_n_per_m,
        truth.actuated_spring_n_per_m,
        truth.stiffening,
        truth.load_spring_n_per_m,
        truth.current_a,
        truth.coil_ohm,
        truth.copper_c,
        truth.pad_c,
        truth.ambient_c,
        truth.heat_in_j,
        truth.heat_out_j,
        energy.press_j,
        energy.growth_j,
        energy.attraction_j,
        energy.springs_j,
        energy.dissipated_j,
        energy.stored_j,
    ]
    .map(f64::to_bits)
    .to_vec()
}

/// A short measurement: press, hold, peak, four falling ramps, release. Returns the bits of truth,
/// frequency and measured current every 7 ms.
pub(crate) fn trajectory(mut world: World) -> Vec<u64> {
    let mut seen = Vec::new();
    for step in 0..160_u64 {
        match step {
            60 => world.set_current(10.0),
            70 | 80 | 90 => {
                world.set_current(10.0);
                world.ramp_current(0.0, ms(60));
            }
            100 => world.set_current(-6.0),
            120 => world.set_current(0.0),
            130 => world.move_press(-0.2e-3, 4e-3),
            _ => {}
        }
        world.advance(ms(7));
        seen.extend(bits(&world.truth()));
        let at_s = world.now().as_secs_f64() - 2.3e-3;
        seen.push(world.frequency_hz(at_s).expect("it is past").to_bits());
        seen.push(world.measured_current_a().to_bits());
    }
    seen
}

/// Relative imbalances of displacements, forces and work; work relative to the largest turnover so
/// far, since a released spring returns all of its energy.
pub(crate) fn imbalances(truth: &Truth, most_j: &mut f64) -> [f64; 3] {
    let length_m = truth.press_m.abs() + truth.sensing_m.abs() + truth.opening_m + 1e-9;
    let force_n = truth.actuated_force_n.abs() + 1e-6;
    let [sensing, actuated] = truth.force_imbalance_n().map(f64::abs);
    *most_j = most_j.max(truth.energy.turnover_j());
    [
        truth.displacement_imbalance_m().abs() / length_m,
        sensing.max(actuated) / force_n,
        truth.energy.imbalance_j().abs() / (*most_j + 1e-12),
    ]
}

/// The coil's driver on the reference board with this circuit.
pub(crate) fn regulated(
    circuit: CircuitParameters,
    converter: ConverterParameters,
    seed: u64,
    limits: Limits,
) -> Regulated {
    Regulated::new(
        Circuit::new(circuit),
        Converter::new(converter, seed),
        reference_hardware(),
        limits,
    )
    .expect("the driver takes the reference board")
}

/// The coil's driver with the usual converter and limits, after its self-test.
pub(crate) fn tested(circuit: CircuitParameters) -> Regulated {
    let mut drive = regulated(circuit, ConverterParameters::RP2040, 1, reference_limits());
    drive.test().expect("a sound coil passes");
    drive
}

pub(crate) type SharedChip = RefCell<Chip<SharedWorld>>;

/// A chip that converts channel 0 of this world for 1 ms at a time, with 30 MHz at CLKIN.
pub(crate) fn converting(world: &SharedWorld, settings: Settings) -> SharedChip {
    let chip = RefCell::new(Chip::new(settings, world.clone()));
    let mut bus = Bus::new(&chip, 400_000);
    for (register, value) in [
        (0x08_u8, 1875_u16),
        (0x10, 100),
        (0x14, 0x1001),
        (0x1E, 0x7800), // code 15: 146 uA, 1.4 V at the coil's 7 kohm
        (0x19, 0xF8FD),
        (0x1B, 0x020D),
        (0x1A, 0x1601),
    ] {
        let [high, low] = value.to_be_bytes();
        bus.write(0x2A, &[register, high, low])
            .expect("the chip answers");
    }
    chip
}
