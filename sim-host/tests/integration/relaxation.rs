//! A load that relaxes, against closed forms.

use crate::common::*;
use palpate_sim::Time;
use palpate_sim::mechanics::layer::CreepMode;
use palpate_sim::mechanics::load::{LOAD_MODES, Load};
use palpate_sim::mechanics::press::{Profile, Shake};
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};

const PRESS_M: f64 = 0.9e-3;

/// Amplitude and time constant, s, of each mode.
fn pressed_on(modes: &[(f64, f64)], vibration: Option<Shake>) -> World {
    let mut plant = plant("ultrasoft", 2);
    let mut creep = [CreepMode::default(); LOAD_MODES];
    for (mode, &(amplitude, tau_s)) in creep.iter_mut().zip(modes) {
        *mode = CreepMode { amplitude, tau_s };
    }
    plant.press.vibration = vibration.unwrap_or(plant.press.vibration);
    let setup = Setup {
        load: Load::Viscoelastic {
            n_per_m: plant.sensing.spring_n_per_m,
            creep,
        },
        profile: Profile::at(PRESS_M),
        step: Time::from_us(200),
        ..Setup::default()
    };
    let vibrates = vibration.is_some();
    world(&plant, Switches::none().with("vibration", vibrates), setup)
}

/// Instant compliance of the chain, m/N, and that of the load alone.
fn compliances(world: &World) -> (f64, f64) {
    let truth = world.truth();
    let layers = 1.0 / truth.sensing_spring_n_per_m + 1.0 / truth.actuated_spring_n_per_m;
    let load = 1.0 / truth.load_spring_n_per_m;
    (load + layers, load)
}

/// Standard linear solid under a held press, with S the compliance of all springs and J that of the
/// Kelvin element: F = D/(S + J) + (D/S − D/(S + J)) e^(−t (S + J)/(S τ)).
#[test]
fn the_force_of_a_standard_linear_solid_falls_as_it_should() {
    let (amplitude, tau_s) = (0.5, 0.7);
    let mut world = pressed_on(&[(amplitude, tau_s)], None);
    let (series, _) = compliances(&world);
    let element = amplitude / world.parameters().sensing.spring_n_per_m;
    for _ in 0..40 {
        world.advance(ms(50));
        let relaxed_n = PRESS_M / (series + element);
        let falls_s = tau_s * series / (series + element);
        let left = (-world.now().as_secs_f64() / falls_s).exp();
        let expected_n = relaxed_n + (PRESS_M / series - relaxed_n) * left;
        let off = world.truth().force_n / expected_n - 1.0;
        assert!(off.abs() < 1e-7, "{off}");
    }
}

/// The press shakes by a sine wave of one micrometre. The part of the sensing layer's answer in phase
/// and the one out of phase give the complex W, whose real part is 1 + c_S/c_L + c_S/c_D.
#[test]
fn the_stiffness_at_a_frequency_is_that_of_a_sine_wave() {
    for hertz in [2.0, 5.0, 20.0] {
        let amplitude_m = 1e-6;
        let shake = Shake {
            amplitude_m,
            hertz,
            phase: 0.0,
        };
        let mut world = pressed_on(&[(0.3, 0.02), (0.2, 0.1)], Some(shake));
        world.advance(ms(3_000));
        let samples = 5_000;
        let slice = Time::from_secs_f64(1.0 / f64::from(samples));
        let (mut sine, mut cosine) = (0.0, 0.0);
        for _ in 0..samples {
            world.advance(slice);
            let truth = world.truth();
            let (s, c) = (core::f64::consts::TAU * hertz * world.now().as_secs_f64()).sin_cos();
            sine += 2.0 * truth.sensing_m * s / f64::from(samples) / amplitude_m;
            cosine += 2.0 * truth.sensing_m * c / f64::from(samples) / amplitude_m;
        }
        let real = sine / (sine * sine + cosine * cosine);
        let truth = world.truth();
        let expected = 1.0
            + truth.sensing_spring_n_per_m / world.load_stiffness_n_per_m(hertz)
            + truth.sensing_spring_n_per_m / truth.actuated_spring_n_per_m;
        assert!(
            (real / expected - 1.0).abs() < 1e-4,
            "{hertz} Hz: {real} {expected}"
        );
    }
}

/// Well above and below the frequencies of its modes it is the instant and the relaxed spring.
#[test]
fn the_stiffness_goes_from_the_relaxed_to_the_instant_one() {
    let world = pressed_on(&[(0.3, 0.02), (0.2, 0.1)], None);
    let instant = world.truth().load_spring_n_per_m;
    assert!((world.load_stiffness_n_per_m(1e6) / instant - 1.0).abs() < 1e-9);
    let spring_n_per_m = world.parameters().sensing.spring_n_per_m;
    let relaxed = 1.0 / (1.0 / instant + 0.5 / spring_n_per_m);
    assert!((world.load_stiffness_n_per_m(0.0) / relaxed - 1.0).abs() < 1e-12);
}
