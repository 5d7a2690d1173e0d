//! Effects that no drawn plant has: a load with a permeable face, friction beside the layer, jumps.

use core::f64::consts::{FRAC_PI_2, PI};

use crate::common::*;
use palpate_sim::Time;
use palpate_sim::mechanics::friction::FrictionParameters;
use palpate_sim::mechanics::load::Load;
use palpate_sim::mechanics::press::{Jumps, Profile};
use palpate_sim::parameters::{ObjectParameters, Parameters};
use palpate_sim::sensing_coil::CoilDesign;
use palpate_sim::sensing_coil::integral::CoilIntegral;
use palpate_sim::sensing_coil::layers::{backed_slab, both_sides, conductor_behind_air, one_side};
use palpate_sim::sensing_coil::tank::{COPPER_M, SensingTank, TankState};
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

fn reference_tank() -> SensingTank {
    SensingTank::new(&middle("ultrasoft").tank)
}

/// Relative contribution to 1/f² of a face at `opening_m` above the pressed sensor: by the library,
/// and by a quadrature of this test with the air between them.
fn added(reflection: f64, opening_m: f64, pressed_m: f64) -> (f64, f64) {
    let at = |tank: &SensingTank| {
        let state = TankState {
            apparent_m: pressed_m,
            opening_m,
            object: 1.0,
            ..TankState::default()
        };
        tank.resonance(&state).frequency_hz
    };
    let bare = reference_tank();
    let facing = reference_tank().facing(reflection);
    let found = (at(&bare) / at(&facing)).powi(2) - 1.0;

    let design = CoilDesign::REFERENCE;
    let radii: Vec<f64> = design.radii_m().collect();
    let gap_m = design.gap_at_rest_m - pressed_m;
    let mu = design.relative_permeability;
    let behind_m = COPPER_M - design.gap_at_rest_m - design.slab_m;
    let inductance = |face: f64| {
        let step = 2.0;
        let sum: f64 = (1..9_000)
            .map(|index| {
                let k = step * f64::from(index);
                let s: f64 = radii.iter().map(|a| a * libm::j1(k * a)).sum();
                let lower = backed_slab(mu, design.slab_m, k, conductor_behind_air(behind_m, k));
                let air = (-2.0 * k * opening_m).exp();
                let upper = backed_slab(mu, design.slab_m, k, face * air);
                s * s * both_sides(one_side(lower, gap_m, k), one_side(upper, gap_m, k))
            })
            .sum();
        design.inductance_in_air_h() + MU_0 * PI * step * sum
    };
    (found, inductance(reflection) / inductance(0.0) - 1.0)
}

#[test]
fn a_face_that_touches_is_exact_and_one_in_the_air_nearly_so() {
    for reflection in [0.98, -0.6] {
        for pressed_m in [0.0, 0.3e-3] {
            let (found, expected) = added(reflection, 0.0, pressed_m);
            println!("{reflection} {pressed_m}: {found}");
            assert!((found / expected - 1.0).abs() < 2e-4, "{found} {expected}");
        }
        for (opening_m, off) in [(0.2e-3, 0.07), (1e-3, 0.21), (3e-3, 0.29)] {
            let (found, expected) = added(reflection, opening_m, 0.0);
            println!("{reflection} {opening_m}: {found} {expected}");
            assert!((found / expected - 1.0).abs() < off, "{found} {expected}");
        }
    }
}

#[test]
fn its_slopes_are_those_of_the_values() {
    let tank = reference_tank().facing(0.98);
    let here = TankState {
        apparent_m: 0.1e-3,
        displacement_m: 0.1e-3,
        warmer_k: 0.0,
        opening_m: 0.2e-3,
        object: 0.9,
    };
    let at = |apparent_m: f64, opening_m: f64, object: f64| {
        let state = TankState {
            apparent_m: here.apparent_m + apparent_m,
            opening_m: here.opening_m + opening_m,
            object: here.object + object,
            ..here
        };
        tank.resonance(&state).frequency_hz
    };
    let slopes = tank.resonance(&here);
    let h = 1e-7;
    for (of_values, of_tank) in [
        (at(h, 0.0, 0.0) - at(-h, 0.0, 0.0), slopes.per_apparent),
        (at(0.0, h, 0.0) - at(0.0, -h, 0.0), slopes.per_opening),
    ] {
        assert!((of_values / (2.0 * h) / of_tank - 1.0).abs() < 1e-6);
    }
    let per_object = (at(0.0, 0.0, 1e-3) - at(0.0, 0.0, -1e-3)) / 2e-3;
    assert!((per_object / slopes.per_object - 1.0).abs() < 1e-6);
}

fn frequency_hz(plant: &Parameters, press_m: f64) -> f64 {
    let setup = Setup {
        profile: Profile::at(press_m),
        ..Setup::default()
    };
    let mut world = world(plant, Switches::none(), setup);
    world.advance(ms(10));
    world.frequency_hz(5e-3).expect("it is past")
}

#[test]
fn an_object_raises_the_inductance_as_it_comes_near() {
    let bare = middle("ultrasoft");
    let mut ferrite = bare.clone();
    ferrite.object.reflection = 0.98;
    let mut conductor = bare.clone();
    conductor.object.reflection = -0.6;
    let away = frequency_hz(&bare, -3e-3);
    let mut last = away;
    for opening_m in [3e-3, 1e-3, 0.2e-3, 0.0] {
        assert_eq!(frequency_hz(&bare, -opening_m), away, "air is not seen");
        let near = frequency_hz(&ferrite, -opening_m);
        assert!(near < last, "{opening_m}: {near} {last}");
        assert!(frequency_hz(&conductor, -opening_m) > away);
        last = near;
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

#[test]
fn nothing_is_pulled_that_does_not_touch_or_cannot_give_way() {
    let (mut plant, _) = plain();
    plant.object.n_per_a2 = 4e-5;
    plant.magnetorheological.stiffening_at_peak = 0.0;
    for (load, press_m) in [
        (Load::Spring { n_per_m: 5e3 }, -1e-4),
        (Load::Rigid, 0.5e-3),
    ] {
        let setup = Setup {
            load,
            profile: Profile::at(press_m),
            ..Setup::default()
        };
        let mut world = world(&plant, Switches::none(), setup);
        let before = world.truth();
        world.set_current(10.0);
        assert!(
            (world.truth().force_n - before.force_n).abs() < 1e-12,
            "{load:?}"
        );
    }
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
        // A slip shows at the end of a step, and each one later than the previous one.
        let late_m = found - expected;
        let steps = (index + 1) as f64 * speed * 1e-3;
        assert!(
            (0.0..=1.001 * steps).contains(&late_m),
            "{index}: {late_m} {steps}"
        );
    }
}

#[test]
fn friction_holds_what_is_released() {
    // Pressed and released to zero force: the layer stays where friction holds it, in either
    // direction.
    let (mut plant, load) = plain();
    plant.friction = FRICTION;
    let setup = Setup {
        load: Load::Spring { n_per_m: load },
        profile: Profile::at(0.0)
            .then_move(0.5e-3, 1e-3)
            .then_move(-0.1e-3, 1e-3),
        ..Setup::default()
    };
    let mut world = world(&plant, Switches::none(), setup);
    world.advance(ms(2_000));
    let truth = world.truth();
    assert!(truth.force_n == 0.0 && truth.friction_n != 0.0);
    let layer_n = plant.sensing.spring_n_per_m * truth.sensing_m;
    assert!((layer_n + truth.friction_n).abs() < 1e-12);
}

#[test]
fn jumps_come_at_random_times_between_two_positions() {
    let jumps = Jumps {
        size_m: 3e-6,
        interval_s: 0.5,
    };
    let path = jumps.path(7);
    assert_ne!(path, jumps.path(8));
    let mut waits_s = Vec::new();
    let (mut since_s, mut here_m) = (0.0, 0.0);
    for step in 0..600_000_u64 {
        let at = Time::from_ms(step);
        let now_m = path.position_m(at);
        assert!(now_m == 0.0 || now_m == jumps.size_m, "{now_m}");
        if now_m != here_m {
            waits_s.push(at.as_secs_f64() - since_s);
            (since_s, here_m) = (at.as_secs_f64(), now_m);
        }
    }
    // Exponentially distributed: the standard deviation equals the mean, and 1200 values give both
    // to 3 %.
    let count = waits_s.len() as f64;
    let mean = waits_s.iter().sum::<f64>() / count;
    let spread = (waits_s
        .iter()
        .map(|wait| (wait - mean).powi(2))
        .sum::<f64>()
        / count)
        .sqrt();
    assert!((mean / 0.5 - 1.0).abs() < 0.1, "{mean}");
    assert!((spread / mean - 1.0).abs() < 0.1, "{spread}");
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

/// Frequencies in the middle of the steps of a falling current, with steps of `step`, Hz.
fn falling_hz(plant: &Parameters, step: Time) -> Vec<f64> {
    let setup = Setup {
        step,
        ..pressed(plant)
    };
    let mut world = world(plant, Switches::none(), setup);
    world.advance(ms(500));
    world.set_current(10.0);
    world.advance(ms(100));
    world.ramp_current(0.0, ms(60));
    world.advance(ms(50));
    let times = (0..40).map(|index| 0.605 + 1e-3 * f64::from(index) + 0.23e-3);
    times
        .map(|at_s| world.frequency_hz(at_s).expect("past"))
        .collect()
}

#[test]
fn frequencies_within_a_step_are_those_of_shorter_steps() {
    // Rates of sticking friction, of the pull and of a saturating face, checked against much
    // shorter steps.
    let sticky = FrictionParameters {
        stick_n: 10.0,
        slip_n: 10.0,
        ..FRICTION
    };
    let object = |lost_at_peak: f64, n_per_a2: f64| ObjectParameters {
        reflection: if lost_at_peak > 0.0 { 0.98 } else { 0.0 },
        lost_at_peak,
        n_per_a2,
    };
    for (friction, object) in [
        (FrictionParameters::default(), object(0.0, 1e-3)),
        (FrictionParameters::default(), object(0.3, 0.0)),
        (sticky, object(0.3, 1e-3)),
    ] {
        let mut plant = Parameters {
            friction,
            object,
            ..middle("ultrasoft")
        };
        // The rate of the stiffening is the mean over a step.
        plant.magnetorheological.stiffening_at_peak = 0.0;
        let coarse = falling_hz(&plant, ms(5));
        let fine = falling_hz(&plant, Time::from_us(50));
        let errors = coarse
            .iter()
            .zip(&fine)
            .map(|(coarse, fine)| (coarse / fine - 1.0).abs());
        let worst = errors.fold(0.0, f64::max);
        let moved = (fine[0] / fine[39] - 1.0).abs();
        println!("{friction:?} {object:?}: {worst:e} of {moved:e}");
        assert!(worst < 1e-4 * moved, "{worst} {moved}");
    }
}
