//! Balance of forces, displacements, work and heat.

use crate::common::*;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::friction::FrictionParameters;
use palpate_sim::mechanics::indented::{Indented, Material, Tip};
use palpate_sim::mechanics::load::Load;
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
        Load::Indented(Indented::new(
            Tip::Ball,
            8e-3,
            Material {
                young_pa: 0.75e6,
                poisson_ratio: 0.48,
                thickness_m: Some(6e-3),
            },
        )),
        viscoelastic(4e3),
    ] {
        let setup = Setup {
            load,
            ..pressed(&plant)
        };
        exercise(world(&plant, Switches::all(), setup));
    }
}

#[test]
fn they_hold_beside_the_centre_and_tilted() {
    for (stack, seed) in [("ultrasoft", 4), ("soft-closed", 2)] {
        let mut plant = plant(stack, seed);
        for (place_m, tilt_rad, friction) in [
            (2e-3, 0.0, 0.0),
            (0.0, 2e-3, 0.0),
            (1e-3, 0.02, 0.0),
            (1e-3, 5e-3, 1.0),
        ] {
            plant.friction = FrictionParameters {
                spring_n_per_m: friction * 3e3,
                stick_n: 5e-3,
                slip_n: 2e-3,
            };
            plant.object.n_per_a2 = friction * 1e-3;
            for load in [
                Load::Spring { n_per_m: 3e3 },
                Load::Hardening {
                    n_per_m: 5e3,
                    cubic_n_per_m3: 4e11,
                },
                Load::Rigid,
            ] {
                let setup = Setup {
                    load,
                    contact: Contact { place_m, tilt_rad },
                    ..pressed(&plant)
                };
                let worst = exercise(world(&plant, Switches::all(), setup));
                println!("{stack} {place_m} {tilt_rad} {load:?}: {worst:?}");
            }
        }
    }
}
