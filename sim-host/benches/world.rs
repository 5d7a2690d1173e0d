//! Simulated seconds per second: the plant alone, and with a converter at about 1 kHz. Time of a touch
//! sensor, of its first press by an indenter, and of a scan.
#![allow(missing_docs, reason = "divan's macro makes public items")]

use core::cell::RefCell;

use divan::{Bencher, counter::ItemsCount};
use embedded_hal::i2c::{I2c, Operation};
use ldc161x_sim::{Bus, Chip, Time};
use palpate_sim::device::Device;
use palpate_sim::mechanics::{load::Load, press::Profile};
use palpate_sim::native::{NativeBoard, Wiring};
use palpate_sim::parameters::draw;
use palpate_sim::stack::{Disturbances, Stack};
use palpate_sim::switches::Switches;
use palpate_sim::touch::{
    Demand, Indenter, Layer, Layout, Press, Sequence, Surroundings, TouchSensor,
};
use palpate_sim::world::{Setup, SharedWorld, World};

fn main() {
    divan::main();
}

/// A world in contact, with all disturbances.
fn pressed() -> World {
    let stack = Stack::builtin("ultrasoft").expect("it comes with the crate");
    let disturbances = Disturbances::builtin().expect("it comes with the crate");
    let setup = Setup {
        load: Load::Spring { n_per_m: 6e3 },
        profile: Profile::at(-0.1e-3).then_move(1e-3, 5e-3),
        ..Setup::default()
    };
    let plant = draw(&stack, &disturbances, 1);
    let mut world = World::new(&plant, Switches::all(), setup).expect("it is a plant");
    world.advance(Time::from_ms(1_000));
    world
}

/// Current, A, of a saw-tooth of falling ramps of 50 ms each, to be set every millisecond.
fn current_a(milliseconds: u64) -> f64 {
    10.0 * (1.0 - (milliseconds % 50) as f64 / 50.0)
}

/// The plant alone; the unit of throughput is a simulated second.
#[divan::bench]
fn plant_alone(bencher: Bencher<'_, '_>) {
    let mut world = pressed();
    bencher.counter(ItemsCount::new(1_u32)).bench_local(|| {
        for millisecond in 0..1_000 {
            world.set_current(current_a(millisecond));
            world.advance(Time::from_ms(1));
        }
        world.truth()
    });
}

/// Builds a world whose coil curve is cached, as a campaign does for every plant.
#[divan::bench]
fn new_world(bencher: Bencher<'_, '_>) {
    let stack = Stack::builtin("ultrasoft").expect("it comes with the crate");
    let disturbances = Disturbances::builtin().expect("it comes with the crate");
    let mut seed = 0;
    bencher.bench_local(|| {
        seed += 1;
        World::new(
            &draw(&stack, &disturbances, seed),
            Switches::all(),
            Setup::default(),
        )
    });
}

/// Builds the curve of a new coil.
#[divan::bench]
fn new_coil() -> palpate_sim::sensing_coil::curve::CoilCurve {
    palpate_sim::sensing_coil::curve::CoilCurve::new(
        &palpate_sim::sensing_coil::CoilDesign::REFERENCE,
        Some(5e-3),
    )
}

/// A converter at about 1 kHz: conversions of 16 · 1875 periods of 30 MHz.
fn converting(world: &SharedWorld) -> RefCell<Chip<SharedWorld>> {
    let settings = world.borrow().chip_settings(30e6);
    let chip = RefCell::new(Chip::new(settings, world.clone()));
    let start = world.borrow().now();
    chip.borrow_mut().advance_to(start);
    for (register, value) in [
        (0x08_u8, 1875_u16),
        (0x10, 100),
        (0x14, 0x1001),
        (0x1E, 0x7800),
        (0x19, 0xF8FD),
        (0x1B, 0x020D),
        (0x1A, 0x1601),
    ] {
        let [high, low] = value.to_be_bytes();
        let written = Bus::new(&chip, 400_000).write(0x2A, &[register, high, low]);
        written.expect("it answers");
    }
    chip
}

#[divan::bench]
fn plant_and_chip(bencher: Bencher<'_, '_>) {
    let world = SharedWorld::new(pressed());
    let chip = converting(&world);
    bencher.counter(ItemsCount::new(1_u32)).bench_local(|| {
        let mut chip = chip.borrow_mut();
        for millisecond in 0..1_000 {
            let mut world = world.borrow_mut();
            world.set_current(current_a(millisecond));
            world.advance(Time::from_ms(1));
            let now = world.now();
            drop(world);
            chip.advance_to(now);
        }
        chip.conversions(0)
    });
}

#[divan::bench]
fn plant_and_chip_read_over_the_bus(bencher: Bencher<'_, '_>) {
    let world = SharedWorld::new(pressed());
    let chip = converting(&world);
    let mut bus = Bus::new(&chip, 400_000);
    bencher.counter(ItemsCount::new(1_u32)).bench_local(|| {
        let (mut high, mut low) = ([0; 2], [0; 2]);
        for millisecond in 0..1_000 {
            world.borrow_mut().set_current(current_a(millisecond));
            world.borrow_mut().advance(Time::from_ms(1));
            let now = world.borrow().now();
            chip.borrow_mut().advance_to(now);
            bus.transaction(
                0x2A,
                &mut [
                    Operation::Write(&[0x00]),
                    Operation::Read(&mut high),
                    Operation::Write(&[0x01]),
                    Operation::Read(&mut low),
                ],
            )
            .expect("it answers");
        }
        (high, low)
    });
}

/// The whole board: plant, converter, bus, driver and procedure, with every record kept, during
/// five simulated seconds of watching at 1 kHz.
#[divan::bench]
fn whole_board(bencher: Bencher<'_, '_>) {
    bencher
        .counter(ItemsCount::new(5_u32))
        .with_inputs(|| Wiring::new(pressed()))
        .bench_local_refs(|hardware| {
            let mut board = NativeBoard::new(hardware);
            let end = board.now() + Time::from_ms(5_000);
            board.run_until(end).expect("the chip answers");
            board.take_records().len()
        });
}

fn touch_sensor() -> TouchSensor {
    let layer = Layer {
        thickness_m: 5e-3,
        shear_modulus_pa: 20e3,
        poisson: 0.5,
    };
    TouchSensor::draw(&Layout::seven(), &layer, 1).expect("the disturbances come with the crate")
}

const BALL: Indenter = Indenter::Ball { radius_m: 3e-3 };
const TILTED: Indenter = Indenter::Tilted {
    radius_m: 6e-3,
    tilt_rad: 0.05,
    toward_rad: 0.3,
};

/// Draws a sensor of seven coils.
#[divan::bench]
fn touch_draw() -> TouchSensor {
    touch_sensor()
}

/// The first press by an indenter.
#[divan::bench(args = [BALL, TILTED])]
fn touch_first_press(bencher: Bencher<'_, '_>, indenter: &Indenter) {
    let sensor = touch_sensor();
    bencher.bench_local(|| sensor.pressed_by(indenter, [0.0; 2], 1).deepest_m());
}

/// A scan of seven coils.
#[divan::bench]
fn touch_scan(bencher: Bencher<'_, '_>) {
    let sensor = touch_sensor();
    let mut pressing = sensor.pressed_by(&BALL, [0.0; 2], 1);
    let sequence = Sequence::of_rate(140.0, 4);
    let press = Press {
        place_m: [2e-3, 1e-3],
        demand: Demand::Depth(0.3e-3),
    };
    let mut time_s = 0.0;
    bencher.bench_local(|| {
        time_s += 1.0 / 140.0;
        pressing.scan(time_s, &sequence, |_| press, &Surroundings::default())
    });
}
