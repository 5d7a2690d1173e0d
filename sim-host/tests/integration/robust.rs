//! Any drawn plant under any inputs: no panic, no NaN, balanced forces, plausible values.

use crate::common::*;
use palpate_sim::Time;
use palpate_sim::mechanics::contact::Contact;
use palpate_sim::mechanics::layer::CreepMode;
use palpate_sim::mechanics::load::{LOAD_MODES, Load};
use palpate_sim::mechanics::press::Profile;
use palpate_sim::stack::Stack;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Holder, Setup, World};
use proptest::prelude::*;

/// One action of an instrument, a hand or a test.
#[derive(Clone, Debug)]
enum Act {
    Current(f64),
    Ramp(f64, u64),
    Press(f64, f64),
    Wait(u64),
    Look(f64),
    Tell,
}

fn act() -> impl Strategy<Value = Act> {
    let odd = prop_oneof![Just(f64::NAN), Just(f64::INFINITY), Just(-1e300)];
    prop_oneof![
        4 => (-20.0..20.0).prop_map(Act::Current),
        4 => (-20.0..20.0, 0..200_000_u64).prop_map(|(to, us)| Act::Ramp(to, us)),
        4 => (-0.5e-3..1.5e-3, 1e-4..50e-3).prop_map(|(to, speed)| Act::Press(to, speed)),
        8 => (0..60_000_u64).prop_map(Act::Wait),
        4 => (-0.1..0.1).prop_map(Act::Look),
        1 => Just(Act::Tell),
        1 => odd.clone().prop_map(Act::Current),
        1 => odd.prop_map(|speed| Act::Press(1e-3, speed)),
    ]
}

fn load() -> impl Strategy<Value = Load> {
    let spring = (0.0..8.0_f64).prop_map(|log| 10_f64.powf(log));
    let mode = (0.0..10.0, -3.0..6.0_f64).prop_map(|(amplitude, log)| CreepMode {
        amplitude,
        tau_s: 10_f64.powf(log),
    });
    let relaxing = (spring.clone(), prop::array::uniform5(mode));
    prop_oneof![
        4 => relaxing.prop_map(|(n_per_m, creep)| Load::Viscoelastic { n_per_m, creep }),
        1 => Just(Load::Rigid),
        4 => spring.clone().prop_map(|n_per_m| Load::Spring { n_per_m }),
        4 => (spring, 0.0..18.0_f64).prop_map(|(n_per_m, log)| Load::Hardening {
            n_per_m,
            cubic_n_per_m3: 10_f64.powf(log),
        }),
    ]
}

fn switches() -> impl Strategy<Value = Switches> {
    any::<u64>().prop_map(|bits| {
        let names = Switches::NAMES.into_iter().enumerate();
        names.fold(Switches::none(), |switches, (bit, name)| {
            switches.with(name, bits >> bit & 1 == 1)
        })
    })
}

fn perform(world: &mut World, act: &Act) {
    match *act {
        Act::Current(current) => world.set_current(current),
        Act::Ramp(to, us) => world.ramp_current(to, Time::from_us(us)),
        Act::Press(to, speed) => world.move_press(to, speed),
        Act::Wait(us) => world.advance(Time::from_us(us)),
        Act::Look(ahead_s) => {
            let at_s = world.now().as_secs_f64() + ahead_s;
            let frequency = world.frequency_ahead_hz(at_s.max(0.0)).expect("it is near");
            assert!((2.0e6..4.0e6).contains(&frequency), "{frequency} Hz");
        }
        Act::Tell => {
            let measured_a = world.measured_current_a();
            assert!(
                (measured_a - world.truth().current_a).abs() < 0.6,
                "{measured_a} A"
            );
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn nothing_upsets_a_plant(
        stack in 0..3_usize,
        seed: u64,
        switches in switches(),
        load in load(),
        by_hand: bool,
        step_us in 10..10_000_u64,
        (place_m, tilt_rad) in (0.0..5e-3, prop_oneof![Just(0.0), 0.0..0.05]),
        acts in prop::collection::vec(act(), 1..40),
    ) {
        let plant = plant(Stack::BUILTIN[stack], seed);
        prop_assert!(plant.check().is_ok());
        let setup = Setup {
            load,
            contact: Contact { place_m, tilt_rad },
            holder: if by_hand { Holder::Hand } else { Holder::Stand },
            profile: Profile::at(-0.1e-3).then_move(0.4e-3, 5e-3),
            step: Time::from_us(step_us),
        };
        let mut world = world(&plant, switches, setup);
        let mut most_j = 0.0;
        for act in acts {
            perform(&mut world, &act);
            assert_sound(&world, &mut most_j);
        }
    }
}

fn assert_sound(world: &World, most_j: &mut f64) {
    let truth = world.truth();
    for bits in bits(&truth) {
        let value = f64::from_bits(bits);
        // A rigid load on a rigid frame is infinitely stiff.
        assert!(!value.is_nan(), "{truth:#?}");
    }
    assert!(truth.force_n >= 0.0 && truth.opening_m >= 0.0);
    assert!(truth.force_n == 0.0 || truth.opening_m == 0.0);
    for off in imbalances(&truth, most_j) {
        assert!(off < 1e-9, "{off} in {truth:#?}");
    }
    assert!((10.0..150.0).contains(&truth.copper_c), "{truth:#?}");
    assert!(truth.current_a.abs() <= 15.0);
}

#[test]
fn parameters_that_make_no_plant_are_refused() {
    let good = plant("ultrasoft", 1);
    let refused = |change: &dyn Fn(&mut palpate_sim::parameters::Parameters)| {
        let mut bad = good.clone();
        change(&mut bad);
        World::new(&bad, Switches::all(), Setup::default())
            .unwrap_err()
            .to_string()
    };
    for bad in [-6e3, 0.0, f64::NAN, f64::INFINITY] {
        let message = refused(&|p| p.sensing.spring_n_per_m = bad);
        assert!(
            message.contains("spring_n_per_m") && message.contains("1e1 to 1e8"),
            "{message}"
        );
    }
    let message = refused(&|p| p.magnetorheological.lag_s = -1.0);
    assert!(
        message.starts_with("lag_s is -1e0; allowed are 0e0 to 1e0"),
        "{message}"
    );
    let message = refused(&|p| p.attraction.n_per_a2 = 0.1);
    assert!(message.contains("stability"), "{message}");
    refused(&|p| p.tank.coil.turns = 0);
    refused(&|p| p.press.vibration.phase = f64::NAN);
    for step in [Time::ZERO, Time::from_ms(11)] {
        let setup = Setup {
            step,
            ..Setup::default()
        };
        assert!(World::new(&good, Switches::all(), setup).is_err());
    }
    for load in [
        Load::Spring { n_per_m: f64::NAN },
        Load::Hardening {
            n_per_m: 1e3,
            cubic_n_per_m3: -1.0,
        },
        Load::Viscoelastic {
            n_per_m: 1e3,
            creep: [CreepMode {
                amplitude: 0.1,
                tau_s: 0.0,
            }; LOAD_MODES],
        },
    ] {
        let setup = Setup {
            load,
            ..Setup::default()
        };
        assert!(World::new(&good, Switches::all(), setup).is_err());
    }
}
