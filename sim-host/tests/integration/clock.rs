//! Virtual time: determinism, steps, and the frequency between their ends.

use crate::common::*;
use palpate_sim::Time;
use palpate_sim::mechanics::press::Profile;
use palpate_sim::parameters::Parameters;
use palpate_sim::stack::Stack;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Holder, Setup, World};

fn disturbed(plant: &Parameters) -> World {
    world(plant, Switches::all(), pressed(plant))
}

#[test]
fn the_same_seed_gives_the_same_bits_twice_and_in_two_threads() {
    let run = || {
        Stack::BUILTIN
            .into_iter()
            .flat_map(|stack| trajectory(disturbed(&plant(stack, 11))))
            .collect::<Vec<u64>>()
    };
    let here = run();
    assert_eq!(here, run());
    let others = [std::thread::spawn(run), std::thread::spawn(run)];
    for other in others {
        assert_eq!(here, other.join().expect("it runs"));
    }
    assert_ne!(here, trajectory(disturbed(&plant("paper", 12))));
}

#[test]
fn the_draws_are_frozen() {
    // Recorded once; a change here changes every plant that was ever reported by its seed.
    let plant = plant("ultrasoft", 1);
    let drawn = [
        plant.sensing.spring_n_per_m,
        plant.actuated.creep[1].tau_s,
        plant.magnetorheological.memory,
        plant.thermal.ambient_change_k,
        plant.rig.frame_m_per_n,
    ];
    assert_eq!(drawn, DRAWN);
}

const DRAWN: [f64; 5] = [
    5581.197929623699,
    18.912975673142306,
    0.11194915680574508,
    -2.6370237305583055,
    7.500959685719329e-7,
];

/// One run with time cut into pieces of different lengths, sampled every 5 ms.
fn cut(pieces: &[u64]) -> Vec<u64> {
    assert_eq!(pieces.iter().sum::<u64>(), 5_000);
    let plant = plant("ultrasoft", 4);
    let mut world = disturbed(&plant);
    let mut seen = Vec::new();
    for step in 0..100 {
        if step == 50 {
            world.set_current(9.0);
        }
        if step == 70 {
            world.ramp_current(0.0, Time::from_us(87_654));
        }
        for piece in pieces {
            world.advance(Time::from_us(*piece));
            // Reading must change nothing.
            let _ = (
                world.truth(),
                world.frequency_ahead_hz(world.now().as_secs_f64() + 2e-3),
            );
        }
        seen.extend(bits(&world.truth()));
        let at_s = world.now().as_secs_f64();
        seen.push(world.frequency_hz(at_s).unwrap().to_bits());
    }
    seen
}

#[test]
fn how_time_is_cut_does_not_matter() {
    let whole = cut(&[5_000]);
    assert_eq!(whole, cut(&[1_000; 5]));
    assert_eq!(whole, cut(&[17, 1_983, 900, 2_099, 1]));
}

/// Greatest relative difference of the frequency between the usual step and a twentieth of it,
/// after contact.
fn step_error(setup: &Setup, plant: &Parameters, act: impl Fn(&mut World, u64)) -> f64 {
    let fine = Setup {
        step: Time::from_us(50),
        ..setup.clone()
    };
    let mut coarse = world(plant, Switches::all(), setup.clone());
    let mut fine = world(plant, Switches::all(), fine);
    let mut worst: f64 = 0.0;
    for step in 0..400 {
        for world in [&mut coarse, &mut fine] {
            act(world, step);
            world.advance(ms(3));
        }
        for back in 0..10 {
            let at_s = coarse.now().as_secs_f64() - 0.271e-3 * f64::from(back);
            let [a, b] = [&coarse, &fine].map(|world| world.frequency_hz(at_s).unwrap());
            worst = worst.max((a / b - 1.0).abs());
        }
    }
    worst
}

#[test]
fn a_step_of_a_millisecond_is_fine_enough() {
    for stack in Stack::BUILTIN {
        for (seed, holder) in [(1, Holder::Stand), (2, Holder::Hand), (3, Holder::Stand)] {
            let mut plant = plant(stack, seed);
            plant.press.vibration.hertz = 120.0;
            plant.press.vibration.amplitude_m = 0.5e-6;
            let setup = Setup {
                holder,
                ..pressed(&plant)
            };
            let ramps = step_error(&setup, &plant, |world, step| {
                if step % 30 == 0 && step > 90 {
                    world.set_current(10.0);
                    world.ramp_current(0.0, ms(60));
                }
            });
            let stairs = step_error(&setup, &plant, |world, step| {
                if step > 90 {
                    world.set_current(10.0 - 0.05 * ((step % 20) as f64) * 10.0);
                }
            });
            println!("{stack} {holder:?}: ramps {ramps:e}, stairs {stairs:e}");
            assert!(ramps < 3e-7 && stairs < 3e-7);
        }
    }
}

#[test]
fn contact_is_made_and_lost_at_the_right_time() {
    let plant = plant("ultrasoft", 2);
    let profile = Profile::at(-1e-3)
        .then_move(1e-3, 7.3e-3)
        .then_move(-1e-3, 7.3e-3);
    let setup = Setup {
        profile,
        ..pressed(&plant)
    };
    let mut world = world(&plant, Switches::none(), setup);
    let touch = 1e-3 / 7.3e-3;
    world.advance_to(Time::from_secs_f64(touch - 1e-9));
    assert_eq!(world.truth().force_n, 0.0);
    world.advance(Time::from_ns(2));
    assert!(world.truth().force_n > 0.0);
    world.advance_to(Time::from_secs_f64(3.0 * touch - 1e-9));
    assert!(world.truth().force_n > 0.0);
    world.advance(Time::from_ns(2));
    assert_eq!(world.truth().force_n, 0.0);
}
