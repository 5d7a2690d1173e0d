//! Balance of forces, displacements, work and heat.

use crate::common::*;
use palpate_sim::mechanics::friction::FrictionParameters;
use palpate_sim::mechanics::{load::Load, press::Profile};
use palpate_sim::stack::Stack;
use palpate_sim::switches::Switches;
use palpate_sim::thermal::CALIBRATION_C;
use palpate_sim::world::{Holder, Setup, World};

/// Presses, heats, ramps and releases, and checks the balance throughout. Returns the worst
/// relative imbalance of displacements, forces and work.
fn exercise(mut world: World) -> [f64; 3] {
    let thermal = world.parameters().thermal;
    let (mut worst, mut most_j) = ([0.0_f64; 3], 0.0);
    for step in 0..400_u32 {
        match step {
            60 => world.set_current(10.0),
            80 => world.ramp_current(-7.0, ms(333)),
            150 => world.move_press(1.1e-3, 3e-3),
            230 => world.set_current(0.0),
            300 => world.move_press(-0.5e-3, 5e-3),
            _ => {}
        }
        world.advance(ms(5));
        let truth = world.truth();
        for (worst, off) in worst.iter_mut().zip(imbalances(&truth, &mut most_j)) {
            assert!(off < 1e-9, "{off} in {truth:#?}");
            *worst = worst.max(off);
        }
        assert!(truth.energy.dissipated_j >= 0.0 && truth.energy.stored_j >= 0.0);
        let stored = thermal.copper_j_per_k
            * (truth.copper_c - CALIBRATION_C - thermal.ambient_change_k)
            + thermal.pad_j_per_k * (truth.pad_c - CALIBRATION_C - thermal.ambient_change_k);
        let off = truth.heat_in_j - truth.heat_out_j - stored;
        assert!(off.abs() <= 1e-9 * (truth.heat_in_j + 1e-3), "{off} J");
    }
    assert!(world.truth().opening_m > 0.0, "it has released");
    worst
}

#[test]
fn all_balances_hold_to_1e_9_in_every_plant() {
    for stack in Stack::BUILTIN {
        for seed in 0..8 {
            let plant = plant(stack, seed);
            for holder in [Holder::Stand, Holder::Hand] {
                let setup = Setup {
                    holder,
                    ..pressed(&plant)
                };
                let worst = exercise(world(&plant, Switches::all(), setup.clone()));
                println!("{stack} {seed} {holder:?}: {worst:?}");
                exercise(world(&plant, Switches::none(), setup));
            }
        }
    }
}

#[test]
fn they_hold_for_loads_that_are_no_springs() {
    let plant = plant("soft-closed", 3);
    for load in [
        Load::Rigid,
        Load::Hardening {
            n_per_m: 5e3,
            cubic_n_per_m3: 4e11,
        },
        Load::Spring { n_per_m: 20.0 },
    ] {
        exercise(world(
            &plant,
            Switches::all(),
            Setup {
                load,
                ..pressed(&plant)
            },
        ));
    }
}

#[test]
fn they_hold_with_friction_and_a_pull_on_the_load() {
    let mut plant = plant("ultrasoft", 4);
    plant.friction = FrictionParameters {
        spring_n_per_m: 3e3,
        stick_n: 5e-3,
        slip_n: 2e-3,
    };
    plant.object.n_per_a2 = 1e-3;
    for load in [
        Load::Spring { n_per_m: 3e3 },
        Load::Hardening {
            n_per_m: 5e3,
            cubic_n_per_m3: 4e11,
        },
    ] {
        let setup = Setup {
            load,
            ..pressed(&plant)
        };
        exercise(world(&plant, Switches::all(), setup));
    }
}

#[test]
fn the_work_of_the_press_is_the_integral_of_its_force() {
    // Independent of the balance of work: the trapezoidal rule over external samples, 0.1 ms apart.
    let plant = plant("ultrasoft", 5);
    let load = Load::Hardening {
        n_per_m: 3e3,
        cubic_n_per_m3: 5e10,
    };
    let mut world = world(
        &plant,
        Switches::all(),
        Setup {
            load,
            ..pressed(&plant)
        },
    );
    let (mut work, mut last) = (0.0, world.truth());
    for _ in 0..4_000 {
        world.advance(palpate_sim::Time::from_us(100));
        let truth = world.truth();
        work += 0.5 * (last.force_n + truth.force_n) * (truth.press_m - last.press_m);
        last = truth;
    }
    let error = work / last.energy.press_j - 1.0;
    assert!(error.abs() < 3e-6, "{error}");
}

#[test]
fn creep_dissipates_what_theory_says() {
    // Under a constant force, a Kelvin element dissipates half of the energy it receives.
    let mut plant = middle("ultrasoft");
    plant.actuated.spring_n_per_m = 1e8;
    for mode in plant
        .sensing
        .creep
        .iter_mut()
        .chain(&mut plant.actuated.creep)
    {
        mode.tau_s = 0.2;
    }
    let soft = Load::Spring { n_per_m: 10.0 };
    let profile = Profile::at(-1e-6).then_move(0.1, 1e3);
    let setup = Setup {
        load: soft,
        profile,
        ..Setup::default()
    };
    let mut world = world(&plant, Switches::only("creep").expect("known"), setup);
    world.advance(ms(8_000));
    let truth = world.truth();
    let expected = 0.5 * truth.force_n * truth.sensing_creep_m;
    let actual = truth.energy.dissipated_j;
    // The force is not quite constant: by the creep, it falls by 3e-4 on the soft load, which is
    // compressed by 0.1 m.
    assert!(
        (actual / expected - 1.0).abs() < 2e-3,
        "{actual} {expected}"
    );
    assert!((truth.sensing_creep_m * 6e3 / truth.force_n - 0.18).abs() < 1e-3);
}
