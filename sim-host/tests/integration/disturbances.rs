//! Each disturbance: disabled it has no effect at all, enabled it has the published effect.

use crate::common::*;
use ldc161x_sim::Window;
use palpate_sim::current::LSB_A;
use palpate_sim::mechanics::{load::Load, press::Profile};
use palpate_sim::parameters::Parameters;
use palpate_sim::rig::{BareRig, Rig, RigReading, Specimen};
use palpate_sim::switches::Switches;
use palpate_sim::thermal::CALIBRATION_C;
use palpate_sim::world::{Holder, Setup, World};

fn reading_bits(reading: RigReading) -> [u64; 2] {
    [reading.force_n.to_bits(), reading.stage_m.to_bits()]
}

/// Cycles that the bridge's switching adds to a conversion.
fn pulled(mut world: World) -> f64 {
    world.set_current(4.2);
    world.advance(ms(2));
    world.pulled_cycles(&Window {
        start_s: 0.5e-3,
        length_s: 1e-3,
        free_hz: 3.01e6,
    })
}

/// All visible values of a plant: a measurement on a stand and by hand, the converter's settings,
/// and the calibration rig.
fn everything(plant: &Parameters, switches: Switches) -> Vec<u64> {
    let mut seen = Vec::new();
    for holder in [Holder::Stand, Holder::Hand] {
        let setup = Setup {
            holder,
            ..pressed(plant)
        };
        let world = world(plant, switches, setup);
        let chip = world.chip_settings(40e6);
        seen.extend([
            chip.external_clock.unwrap().relative_error.to_bits(),
            chip.conversions.noise_at_1ms.to_bits(),
            u64::from(chip.conversions.quantised),
            chip.drive.shift_per_code.to_bits(),
        ]);
        seen.push(pulled(world.clone()).to_bits());
        seen.extend(trajectory(world));
    }
    for specimen in [
        Specimen::Block,
        Specimen::Spring {
            nominal_n_per_m: 5e3,
        },
    ] {
        let mut rig = Rig::new(plant, switches, specimen).unwrap();
        for step in 1..10 {
            rig.move_stage(1e-4 * f64::from(step), 1e-3);
            rig.world_mut().advance(ms(400));
            seen.extend(reading_bits(rig.read()));
        }
    }
    let mut bare = BareRig::new(plant, switches);
    seen.extend((0..5).flat_map(|force| reading_bits(bare.press(f64::from(force)))));
    seen
}

#[test]
fn what_is_on_has_an_effect_and_what_is_off_is_a_plant_without_it() {
    for name in Switches::NAMES {
        let mut plant = plant("soft-closed", 5);
        plant.current.supply_v = 5.0; // weak enough to matter at 10 A
        let off = Switches::all().with(name, false);
        let without = everything(&plant, off);
        assert!(without != everything(&plant, Switches::all()), "{name} on");
        let plain = plant.effective(&off);
        assert!(without == everything(&plain, Switches::all()), "{name} off");
    }
}

// ---- sizes, each disturbance alone ----

/// The central plant, with one disturbance.
fn alone(name: &str, change: impl FnOnce(&mut Parameters), load: Option<Load>) -> World {
    let mut plant = middle("ultrasoft");
    change(&mut plant);
    let setup = Setup {
        load: load.unwrap_or(Load::Rigid),
        profile: if load.is_some() {
            Profile::at(0.0).then_move(0.6e-3, 10e-3)
        } else {
            Profile::at(-1e-3)
        },
        ..Setup::default()
    };
    let mut world = world(&plant, Switches::only(name).expect("known"), setup);
    world.advance(ms(100));
    world
}

fn frequency(world: &World) -> f64 {
    world
        .frequency_hz(world.now().as_secs_f64())
        .expect("it is past")
}

const SPRING: Option<Load> = Some(Load::Spring { n_per_m: 6e3 });

fn close(actual: f64, expected: f64, relative: f64) {
    let error = (actual / expected - 1.0).abs();
    assert!(error < relative, "{actual} for {expected}");
}

#[test]
fn crosstalk_is_even_and_grows_with_the_press() {
    for load in [None, SPRING] {
        let mut world = alone(
            "crosstalk",
            |p| p.crosstalk.slope_per_press_depth = 0.3,
            load,
        );
        let depth = world.parameters().press.depth_m;
        for current in [10.0, -10.0, 5.0] {
            world.set_current(current);
            let truth = world.truth();
            let expected =
                8e-6 * (current / 10.0_f64).powi(2) * (1.0 + 0.3 * truth.sensing_m / depth);
            close(truth.sensing_m - truth.apparent_m, expected, 1e-9);
        }
        assert_eq!(world.truth().sensing_m > 0.0, load.is_some());
    }
}

#[test]
fn attraction_compresses_the_actuated_layer() {
    let mut world = alone("attraction", |_| {}, None);
    world.set_current(10.0);
    let truth = world.truth();
    let (k, gradient) = (0.30e-3 * 100.0, 200.0);
    let c_d = truth.actuated_spring_n_per_m;
    close(c_d, 4.4e3, 1e-12);
    close(
        truth.actuated_m,
        k / c_d / (1.0 - k * gradient / c_d),
        1e-12,
    );
    close(
        truth.attraction_n,
        k * (1.0 + gradient * truth.actuated_m),
        1e-12,
    );
}

#[test]
fn the_coils_heat_themselves() {
    let mut world = alone("heating", |_| {}, None);
    world.set_current(10.0);
    world.advance(ms(20));
    let truth = world.truth();
    // Adiabatic, except for the share that 0.02 s have in the time constant of 0.4 s.
    close(truth.copper_c - CALIBRATION_C, 38.9 / 0.8 * 0.02, 0.03);
    close(truth.heat_in_j, 38.9 * 0.02, 1e-9);
}

#[test]
fn ambient_and_its_effects_are_as_large_as_drawn() {
    let warm = |p: &mut Parameters| {
        p.thermal.ambient_change_k = 4.0;
        p.sensing.spring_per_kelvin = -0.004;
        p.actuated.spring_per_kelvin = -0.004;
        p.magnetorheological.stiffening_per_kelvin = 0.005;
        p.tank.capacitance_per_kelvin = 30e-6;
    };
    let truth = alone("ambient_change", warm, None).truth();
    assert_eq!([truth.ambient_c, truth.pad_c, truth.copper_c], [29.0; 3]);

    let growth = alone("growth", warm, SPRING).truth();
    let without = alone("ambient_change", warm, SPRING).truth();
    close(growth.growth_m, 4.0 * 0.9e-6, 1e-9);
    // Force of the thermal growth on the springs in series.
    close(
        (growth.force_n - without.force_n) * (2.0 / 6e3 + 1.0 / 4e3),
        growth.growth_m,
        1e-9,
    );

    let truth = alone("spring_temperature", warm, None).truth();
    close(
        truth.sensing_spring_n_per_m,
        6e3 * (-0.016_f64).exp(),
        1e-12,
    );
    close(
        truth.actuated_spring_n_per_m,
        4e3 * (-0.016_f64).exp(),
        1e-12,
    );

    let mut world = alone("stiffening_temperature", warm, None);
    world.set_current(10.0);
    close(
        world.truth().actuated_spring_n_per_m,
        4e3 * (1.0 + 0.1 * (0.02_f64).exp()),
        1e-12,
    );

    let truth = alone("copper_temperature", warm, None).truth();
    close(truth.coil_ohm, 0.389 * (1.0 + 3.9e-3 * 4.0), 1e-12);

    let ratio = frequency(&alone("capacitance_temperature", warm, None))
        / frequency(&alone("ambient_change", warm, None));
    close(ratio - 1.0, -0.5 * 30e-6 * 4.0, 1e-3);
}

#[test]
fn creep_adds_its_amplitudes_in_time() {
    let mut world = alone("creep", |_| {}, SPRING);
    world.advance(ms(400_000));
    let truth = world.truth();
    // The force changes little, so each mode adds its share of the instant displacement.
    let instant = truth.force_n / truth.sensing_spring_n_per_m;
    let modes = world.parameters().sensing.creep;
    let expected: f64 = modes
        .iter()
        .map(|m| m.amplitude * (1.0 - (-400.0 / m.tau_s).exp()))
        .sum();
    close(truth.sensing_creep_m / instant, expected, 0.03);
    assert!((0.1..0.18).contains(&expected));
}

#[test]
fn memory_keeps_a_third_of_its_share() {
    let mut world = alone("memory", |_| {}, None);
    world.set_current(7.0);
    let rising = world.truth().actuated_spring_n_per_m;
    world.set_current(10.0);
    close(world.truth().actuated_spring_n_per_m, 4.4e3, 1e-12);
    world.set_current(7.0);
    assert!(world.truth().actuated_spring_n_per_m > rising + 0.5 * 400.0 * 0.125 * 0.25);
    world.set_current(0.0);
    close(
        world.truth().actuated_spring_n_per_m,
        4e3 * (1.0 + 0.1 * 0.125 / 3.0),
        1e-12,
    );
}

#[test]
fn the_lag_is_one_over_e_after_its_time() {
    let mut world = alone("lag", |p| p.magnetorheological.lag_s = 5e-3, None);
    world.set_current(10.0);
    assert_eq!(world.truth().actuated_spring_n_per_m, 4e3);
    world.advance(ms(5));
    close(world.truth().stiffening, 1.0 - (-1.0_f64).exp(), 1e-12);
}

#[test]
fn a_weak_supply_limits_the_current() {
    let mut world = alone("supply", |p| p.current.supply_v = 6.0, None);
    world.set_current(12.0);
    world.advance(ms(1));
    close(world.truth().current_a, 6.0 / (0.389 + 0.175), 1e-9);
    close(world.measured_current_a(), 6.0 / (0.389 + 0.175), 1e-9);
    let mut strong = alone("lag", |_| {}, None);
    strong.set_current(99.0);
    assert_eq!(strong.truth().current_a, 15.0, "the hardware's limit");
}

#[test]
fn the_frame_is_in_series_with_the_load() {
    let truth = alone("frame", |p| p.press.frame_m_per_n = 1.0 / 20e3, SPRING).truth();
    close(
        truth.load_spring_n_per_m,
        1.0 / (1.0 / 6e3 + 1.0 / 20e3),
        1e-12,
    );
    close(truth.frame_m, truth.force_n / 20e3, 1e-12);
    assert_eq!(alone("creep", |_| {}, SPRING).truth().frame_m, 0.0);
}

#[test]
fn shaking_has_its_amplitude_and_frequency() {
    for (name, holder, amplitude, hertz) in [
        ("vibration", Holder::Stand, 0.25e-6, 62.5),
        ("tremor", Holder::Hand, 5e-6, 8.5),
    ] {
        let plant = middle("ultrasoft");
        let setup = Setup {
            holder,
            profile: Profile::at(0.5e-3),
            ..pressed(&plant)
        };
        let mut world = world(&plant, Switches::only(name).unwrap(), setup);
        let (mut most, mut crossings, mut last) = (0.0_f64, 0, 0.0);
        for _ in 0..20_000 {
            world.advance(palpate_sim::Time::from_us(100));
            let off = world.truth().press_m - 0.5e-3;
            most = most.max(off.abs());
            crossings += i32::from(off > 0.0 && last <= 0.0);
            last = off;
        }
        close(most, amplitude, 1e-3);
        assert!(
            (f64::from(crossings) - 2.0 * hertz).abs() <= 1.0,
            "{crossings}"
        );
    }
}

#[test]
fn the_measured_current_is_wrong_by_its_errors() {
    let error_a = |name: &str, current: f64| {
        let mut world = alone(name, |p| p.current.gain_error = 0.02, None);
        world.set_current(current);
        world.measured_current_a() - current
    };
    close(error_a("current_gain", 8.0), 0.16, 1e-9);
    let worst = (-20..=20)
        .map(|current| error_a("adc_nonlinearity", f64::from(current) / 2.0).abs())
        .fold(0.0, f64::max);
    assert!(worst > 7.0 * LSB_A && worst <= 8.0 * LSB_A, "{worst}");
    let mut world = alone("adc_noise", |_| {}, None);
    let squares: f64 = (0..5_000).map(|_| world.measured_current_a().powi(2)).sum();
    close((squares / 5_000.0).sqrt(), 2.0 * LSB_A, 0.05);
    let (from, to) = (ms(90), ms(91));
    let squares: f64 = (0..5_000)
        .map(|_| world.reported_mean_current_a(from, to, 25).powi(2))
        .sum();
    close((squares / 5_000.0).sqrt(), 0.4 * LSB_A, 0.05);
}

#[test]
fn the_converter_is_set_up_with_its_errors() {
    let plant = plant("ultrasoft", 1);
    let settings = |switches| world(&plant, switches, Setup::default()).chip_settings(30e6);
    let all = settings(Switches::all());
    let clock = all.external_clock.unwrap();
    assert_eq!(clock.frequency_hz, 30e6);
    assert_eq!(clock.relative_error, plant.ldc.reference_clock_error);
    assert!(clock.relative_error != 0.0 && clock.relative_error.abs() <= 50e-6);
    assert_eq!(all.conversions.noise_at_1ms, 1e-6);
    assert!(all.conversions.quantised && all.drive.shift_per_code != 0.0);
    let none = settings(Switches::none());
    assert_eq!(none.external_clock.unwrap().relative_error, 0.0);
    assert_eq!(none.conversions.noise_at_1ms, 0.0);
    assert!(!none.conversions.quantised && none.drive.shift_per_code == 0.0);
}

#[test]
fn the_coil_bends_and_sees_copper() {
    let flat = alone("lag", |_| {}, SPRING);
    let x = flat.truth().sensing_m;
    let bent = alone(
        "coil_bending",
        |p| p.tank.curvature_per_m = 20.0 / x,
        SPRING,
    );
    close(
        frequency(&bent) / frequency(&flat) - 1.0,
        0.5 * (1.0 - 0.9974),
        0.01,
    );
    // The slab between copper and coil screens a little: a loss of 6 % in air becomes about 3 %.
    let copper = alone("copper_image", |_| {}, None);
    let lost = 1.0 - (frequency(&alone("lag", |_| {}, None)) / frequency(&copper)).powi(2);
    println!("{lost}");
    assert!((0.02..0.08).contains(&lost), "{lost}");
}
