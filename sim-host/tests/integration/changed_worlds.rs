//! Effects that no drawn plant has: a load with a permeable face, friction beside the layer, jumps.

use core::f64::consts::{FRAC_PI_2, PI};

use crate::common::*;
use palpate_sim::mechanics::contact::{Contact, ContactParameters};
use palpate_sim::mechanics::friction::FrictionParameters;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::{Jumps, Profile};
use palpate_sim::parameters::Parameters;
use palpate_sim::sensing_coil::CoilDesign;
use palpate_sim::sensing_coil::integral::CoilIntegral;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};

const MU_0: f64 = 4e-7 * PI;

/// Mutual inductance of coaxial circles at a distance, H: Maxwell's formula, with K and E by the
/// arithmetic-geometric mean.
fn coaxial_h(a_m: f64, b_m: f64, distance_m: f64) -> f64 {
    let square = 4.0 * a_m * b_m / ((a_m + b_m).powi(2) + distance_m * distance_m);
    let (mut a, mut b, mut c) = (1.0, (1.0 - square).sqrt(), square.sqrt());
    let (mut weight, mut sum) = (0.5, 0.5 * square);
    while c.abs() > 1e-12 {
        (a, b, c) = (0.5 * (a + b), (a * b).sqrt(), 0.5 * (a - b));
        weight *= 2.0;
        sum += weight * c * c;
    }
    let first = FRAC_PI_2 / a;
    let second = first * (1.0 - sum);
    let k = square.sqrt();
    MU_0 * (a_m * b_m).sqrt() * ((2.0 / k - k) * first - 2.0 / k * second)
}

#[test]
fn a_face_mirrors_the_coil() {
    // Without MSE, the face at the slab's far side makes an image of the coil at twice that
    // distance.
    let design = CoilDesign {
        relative_permeability: 1.0,
        ..CoilDesign::REFERENCE
    };
    let radii: Vec<f64> = design.radii_m().collect();
    for reflection in [0.98, -0.6] {
        let coil = CoilIntegral::new(design, None).facing(reflection);
        for gap_m in [0.3e-3, 0.7e-3, 1e-3] {
            let twice_m = 2.0 * (gap_m + design.slab_m);
            let images = radii
                .iter()
                .flat_map(|&a| radii.iter().map(move |&b| (a, b)));
            let image_h: f64 = images.map(|(a, b)| coaxial_h(a, b, twice_m)).sum();
            let added_h = coil.inductance_h(gap_m) - design.inductance_in_air_h();
            let error = added_h / (reflection * image_h) - 1.0;
            assert!(error.abs() < 1e-8, "{reflection} {gap_m}: {error}");
        }
    }
}

/// A plant without any disturbance, on a stand that does not vibrate.
fn plain() -> (Parameters, f64) {
    (middle("ultrasoft"), 5e3)
}

fn pressed_world(plant: &Parameters, load_n_per_m: f64, press_m: f64, speed: f64) -> World {
    let setup = Setup {
        load: Load::Spring {
            n_per_m: load_n_per_m,
        },
        profile: Profile::at(0.0).then_move(press_m, speed),
        ..Setup::default()
    };
    world(plant, Switches::none(), setup)
}

#[test]
fn the_coils_pull_the_object_by_their_share_of_the_springs() {
    let (mut plant, load) = plain();
    plant.object.n_per_a2 = 4e-5;
    plant.magnetorheological.stiffening_at_peak = 0.0;
    let mut world = pressed_world(&plant, load, 0.8e-3, 5e-3);
    world.advance(ms(300));
    let before = world.truth();
    world.set_current(10.0);
    let after = world.truth();
    let pull_n = after.pull_n;
    assert!((pull_n - 4e-5 * 100.0).abs() < 2e-4 * pull_n, "{pull_n}");
    // The pull stretches the load and compresses the layers, in proportion to their compliances.
    let (load, layers) = (
        1.0 / load,
        1.0 / plant.sensing.spring_n_per_m + 1.0 / plant.actuated.spring_n_per_m,
    );
    let expected_n = pull_n * load / (load + layers);
    let gained_n = after.force_n - before.force_n;
    assert!(
        (gained_n / expected_n - 1.0).abs() < 1e-9,
        "{gained_n} {expected_n}"
    );
    let drawn_m = after.load_m - before.load_m;
    let expected_m = -gained_n * layers;
    assert!(
        (drawn_m / expected_m - 1.0).abs() < 1e-9,
        "{drawn_m} {expected_m}"
    );
}

const FRICTION: FrictionParameters = FrictionParameters {
    spring_n_per_m: 3e3,
    stick_n: 5e-3,
    slip_n: 2e-3,
};

#[test]
fn a_slow_press_sticks_and_slips_where_the_springs_say() {
    let (mut plant, load) = plain();
    plant.friction = FRICTION;
    let c_s = plant.sensing.spring_n_per_m;
    let others = 1.0 / load + 1.0 / plant.actuated.spring_n_per_m;
    let FrictionParameters {
        spring_n_per_m: k,
        stick_n,
        slip_n,
    } = FRICTION;
    // Expected slips, from springs in series: the press's position at which the slider breaks
    // loose.
    let (mut slider_m, mut expected_m) = (0.0, Vec::new());
    for _ in 0..12 {
        let loose_m = slider_m + stick_n / k;
        let press_m = (c_s * loose_m + stick_n) * others + loose_m;
        let rest_m = (press_m - slip_n * others) / (1.0 + c_s * others);
        slider_m = rest_m - slip_n / k;
        expected_m.push(press_m);
    }
    let travel_m = expected_m[11] * 1.02;
    let speed = 20e-6;
    let mut world = pressed_world(&plant, load, travel_m, speed);
    let mut found_m = Vec::new();
    let mut last = world.truth();
    while world.now().as_secs_f64() * speed < travel_m {
        world.advance(ms(1));
        let truth = world.truth();
        assert!(truth.friction_n <= stick_n);
        if truth.friction_n < last.friction_n {
            assert!(truth.sensing_m - last.sensing_m > 0.1e-6, "the layer jumps");
            assert_eq!(truth.friction_n, slip_n);
            found_m.push(truth.press_m);
        }
        last = truth;
    }
    assert_eq!(found_m.len(), expected_m.len());
    for (index, (found, expected)) in found_m.iter().zip(&expected_m).enumerate() {
        // A slip takes effect at the end of a step, so the delays of successive slips add up.
        let late_m = found - expected;
        let steps = (index + 1) as f64 * speed * 1e-3;
        assert!(
            (0.0..=1.001 * steps).contains(&late_m),
            "{index}: {late_m} {steps}"
        );
    }
}

#[test]
fn a_jump_is_shared_by_the_springs() {
    let (mut plant, load) = plain();
    plant.press.jumps = Jumps {
        size_m: 3e-6,
        interval_s: 0.2,
    };
    let mut world = pressed_world(&plant, load, 0.5e-3, 5e-3);
    world.advance(ms(200));
    let springs = [
        load,
        plant.sensing.spring_n_per_m,
        plant.actuated.spring_n_per_m,
    ];
    let series: f64 = springs.iter().map(|spring| 1.0 / spring).sum();
    let expected_m = 3e-6 / series / plant.sensing.spring_n_per_m;
    let mut jumps = 0;
    let mut last = world.truth();
    for _ in 0..2_000 {
        world.advance(ms(1));
        let truth = world.truth();
        let moved_m = truth.sensing_m - last.sensing_m;
        if moved_m != 0.0 {
            assert!(
                (moved_m.abs() / expected_m - 1.0).abs() < 1e-9,
                "{moved_m} {expected_m}"
            );
            jumps += 1;
        }
        last = truth;
    }
    assert!((4..20).contains(&jumps), "{jumps}");
}

#[test]
fn a_tilted_press_has_a_kink_and_keeps_a_shift_of_the_zero() {
    let (mut plant, load) = plain();
    let (a, share, tilt_rad) = (3e-3, 0.4, 5e-3);
    plant.contact = ContactParameters {
        lost_per_m2: 0.0,
        radius_m: a,
        tilted_share: share,
    };
    let (c_s, c_d) = (plant.sensing.spring_n_per_m, plant.actuated.spring_n_per_m);
    let (stage_m, others) = (2.0 * a * tilt_rad, 1.0 / load + 1.0 / c_d);
    // Springs in series, by hand: force and deformation at a displacement of the press.
    let expected = |press_m: f64| {
        let first = press_m / (others + 1.0 / (share * c_s));
        if first <= share * c_s * stage_m {
            return (first, first / (share * c_s));
        }
        let shifted_m = (1.0 - share) * stage_m;
        let force_n = (press_m - shifted_m) / (others + 1.0 / c_s);
        (force_n, force_n / c_s + shifted_m)
    };
    let setup = Setup {
        load: Load::Spring { n_per_m: load },
        contact: Contact {
            place_m: 0.0,
            tilt_rad,
        },
        profile: Profile::at(0.0).then_move(0.5e-3, 1e-3),
        ..Setup::default()
    };
    let mut world = world(&plant, Switches::none(), setup);
    let mut closed = [0, 0];
    for _ in 0..490 {
        world.advance(ms(1));
        let truth = world.truth();
        let (force_n, sensing_m) = expected(truth.press_m);
        assert!((truth.force_n / force_n - 1.0).abs() < 1e-9, "{truth:?}");
        assert!(
            (truth.sensing_m / sensing_m - 1.0).abs() < 1e-9,
            "{truth:?}"
        );
        closed[usize::from(truth.sensing_m > stage_m)] += 1;
        // A quarter into a step the frequency shows the rates at its ends.
        let end_s = world.now().as_secs_f64();
        let [from, quarter, to] =
            [1e-3, 0.75e-3, 0.0].map(|before_s| world.frequency_hz(end_s - before_s).unwrap());
        let bent = (quarter - from) / (to - from) - 0.25;
        let kink = from == to || (truth.sensing_m - stage_m).abs() < 1e-6;
        assert!(kink || bent.abs() < 1e-3, "{bent} {truth:?}");
    }
    assert!(closed.iter().all(|count| *count > 20), "{closed:?}");
}

#[test]
fn beside_the_centre_the_layer_stiffens_by_another_amount() {
    let (mut plant, load) = plain();
    plant.contact.lost_per_m2 = 1e4;
    let spring = |place_m: f64| {
        let setup = Setup {
            load: Load::Spring { n_per_m: load },
            contact: Contact {
                place_m,
                tilt_rad: 0.0,
            },
            profile: Profile::at(0.0).then_move(0.5e-3, 5e-3),
            ..Setup::default()
        };
        let mut world = world(&plant, Switches::none(), setup);
        world.advance(ms(200));
        world.set_current(10.0);
        world.advance(ms(50));
        world.truth().actuated_spring_n_per_m / plant.actuated.spring_n_per_m - 1.0
    };
    let lost = 1.0 - spring(2e-3) / spring(0.0);
    assert!((lost - 0.04).abs() < 1e-9, "{lost}");
}
