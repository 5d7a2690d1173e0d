//! The undisturbed plant against the closed forms of SOURCES.md section 2.

use crate::common::*;
use palpate_sim::mechanics::{load::Load, press::Profile};
use palpate_sim::stack::Stack;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};

/// A world pressed on a spring of `ratio` sensing springs, without any disturbance.
fn undisturbed(stack: &str, seed: u64, ratio: f64) -> World {
    let plant = plant(stack, seed);
    let load = Load::Spring {
        n_per_m: ratio * plant.sensing.spring_n_per_m,
    };
    let setup = Setup {
        load,
        profile: Profile::at(-0.1e-3).then_move(0.9e-3, 10e-3),
        ..Setup::default()
    };
    let mut world = world(&plant, Switches::none(), setup);
    world.advance(ms(200));
    world
}

/// x_S at a current; the world's stiffening is immediate.
fn sensing_at(world: &mut World, current_a: f64) -> f64 {
    world.set_current(current_a);
    world.advance(ms(1));
    world.truth().sensing_m
}

#[test]
fn equation_1_the_series_stiffness() {
    for stack in Stack::BUILTIN {
        for ratio in [0.2, 1.0, 5.0] {
            let world = undisturbed(stack, 2, ratio);
            let truth = world.truth();
            let series = 1.0 / truth.load_spring_n_per_m
                + 1.0 / truth.sensing_spring_n_per_m
                + 1.0 / truth.actuated_spring_n_per_m;
            assert!((truth.force_n * series / 0.9e-3 - 1.0).abs() < 1e-12);
            let ratio_seen = truth.load_spring_n_per_m / truth.sensing_spring_n_per_m;
            assert!((ratio_seen / ratio - 1.0).abs() < 1e-12);
        }
    }
}

#[test]
fn equation_2_gives_the_load_back() {
    for stack in Stack::BUILTIN {
        for (seed, ratio) in [(1, 0.2), (2, 0.5), (3, 1.0), (4, 2.0), (5, 5.0)] {
            let mut world = undisturbed(stack, seed, ratio);
            let x1 = sensing_at(&mut world, 10.0);
            let (c_s, d1) = {
                let truth = world.truth();
                (truth.sensing_spring_n_per_m, truth.actuated_spring_n_per_m)
            };
            let x2 = sensing_at(&mut world, 2.0);
            let d2 = world.truth().actuated_spring_n_per_m;
            let load =
                c_s * d1 * d2 * (x1 - x2) / (x2 * (d1 * d2 + c_s * d1) - x1 * (d1 * d2 + c_s * d2));
            let error = load / (ratio * c_s) - 1.0;
            assert!(error.abs() < 1e-9, "{stack} {ratio}: {error}");
        }
    }
}

#[test]
fn a_ripple_from_outside_acts_by_its_square() {
    let mut world = undisturbed("ultrasoft", 1, 1.0);
    world.set_current_with_ripple(8.0, 6.0);
    world.advance(ms(1));
    let rippling = world.truth();
    let steady_m = sensing_at(&mut world, 10.0);
    assert_eq!(rippling.current_a, 8.0);
    assert!((rippling.sensing_m / steady_m - 1.0).abs() < 1e-12);
}

#[test]
fn the_actuated_spring_follows_the_law_of_the_stack() {
    let mut world = undisturbed("soft-closed", 4, 1.0);
    let p = world.parameters().clone();
    for current in [0.0, 1.0, 3.0, 7.0, 10.0, -5.0] {
        sensing_at(&mut world, current);
        let field = |current: f64| {
            let (b, half) = (
                p.magnetorheological.field_at_peak_t * current / 10.0,
                p.magnetorheological.field_half_t,
            );
            b * b / (b * b + half * half)
        };
        let share = field(current) / field(10.0);
        let expected =
            p.actuated.spring_n_per_m * (1.0 + p.magnetorheological.stiffening_at_peak * share);
        let actual = world.truth().actuated_spring_n_per_m;
        assert!(
            (actual / expected - 1.0).abs() < 1e-13,
            "{current} A: {actual} {expected}"
        );
    }
}

#[test]
fn a_hardening_load_is_met_on_its_curve() {
    let plant = plant("ultrasoft", 9);
    let (c, k) = (3e3, 4e10);
    let setup = Setup {
        load: Load::Hardening {
            n_per_m: c,
            cubic_n_per_m3: k,
        },
        profile: Profile::at(-0.1e-3).then_move(1.2e-3, 2e-3),
        ..Setup::default()
    };
    let mut world = world(&plant, Switches::none(), setup);
    let mut hardest: f64 = 0.0;
    for step in 0..80 {
        world.advance(ms(10));
        world.set_current(f64::from(step % 10));
        let truth = world.truth();
        let x = truth.load_m;
        let force = c * x + k * x * x * x;
        assert!((truth.force_n - force).abs() <= 1e-12 * force);
        let tangent = c + 3.0 * k * x * x;
        assert!((truth.load_spring_n_per_m / tangent - 1.0).abs() < 1e-12);
        // F_i = c_S x_i and x_L,i = x_0 - x_i (1 + g_i), as an estimator computes them.
        let g = truth.sensing_spring_n_per_m / truth.actuated_spring_n_per_m;
        let seen = truth.press_m + truth.opening_m - truth.sensing_m * (1.0 + g);
        assert!((seen - x).abs() < 1e-15);
        hardest = hardest.max(tangent / c);
    }
    assert!(hardest > 2.0, "it does harden: {hardest}");
}

#[test]
fn the_depth_asked_for_is_the_depth_pressed() {
    let plant = plant("paper", 1);
    for load in [
        Load::Rigid,
        Load::Spring { n_per_m: 2e4 },
        Load::Hardening {
            n_per_m: 2e4,
            cubic_n_per_m3: 1e11,
        },
    ] {
        for switches in [Switches::none(), Switches::only("frame").unwrap()] {
            let setup = Setup {
                load,
                ..Setup::default()
            };
            let mut world = world(&plant, switches, setup);
            let press = world.press_for_depth_m(0.3e-3);
            world.move_press(press, 5e-3);
            world.advance(ms(2_000));
            assert!(
                (world.truth().sensing_m / 0.3e-3 - 1.0).abs() < 1e-12,
                "{load:?}"
            );
        }
    }
}

#[test]
fn the_frequency_is_that_of_the_gap() {
    use palpate_sim::sensing_coil::{CoilDesign, integral::CoilIntegral};
    let world = undisturbed("ultrasoft", 1, 1.0);
    let truth = world.truth();
    let coil = CoilIntegral::new(CoilDesign::REFERENCE, None);
    let inductance = coil.inductance_h(1e-3 - truth.sensing_m);
    let expected = 1.0 / (2.0 * core::f64::consts::PI * (inductance * 330e-12).sqrt());
    let actual = world.frequency_hz(world.now().as_secs_f64()).unwrap();
    assert!(
        (actual / expected - 1.0).abs() < 1e-12,
        "{actual} {expected}"
    );
}
