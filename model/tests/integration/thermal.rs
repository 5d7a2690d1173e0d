//! The two-node thermal model against Runge-Kutta in `f64`.

use crate::common::rng::Rng;
use palpate_model::thermal::{Copper, Temperatures, TwoNode};
use palpate_model::units::*;

/// C_c, C_p, R_cp, R_pa of the reference plant: J/K and K/W.
const PLANT: [f64; 4] = [0.8, 60.0, 0.5, 8.0];

fn model(p: [f64; 4]) -> TwoNode {
    let [c, d, r, s] = p.map(|p| p as f32);
    TwoNode::new(
        JoulePerKelvin(c),
        JoulePerKelvin(d),
        KelvinPerWatt(r),
        KelvinPerWatt(s),
    )
    .unwrap()
}

/// Fourth-order Runge-Kutta with `steps` steps; `power` may depend on the copper's temperature.
fn integrate(
    [cc, cp, rcp, rpa]: [f64; 4],
    start: [f64; 2],
    power: impl Fn(f64) -> f64,
    ambient: f64,
    duration: f64,
    steps: u32,
) -> [f64; 2] {
    let rate = |[c, p]: [f64; 2]| {
        let flow = (c - p) / rcp;
        [(power(c) - flow) / cc, (flow - (p - ambient) / rpa) / cp]
    };
    let along = |x: [f64; 2], k: [f64; 2], h: f64| [x[0] + k[0] * h, x[1] + k[1] * h];
    let h = duration / f64::from(steps);
    let mut x = start;
    for _ in 0..steps {
        let k1 = rate(x);
        let k2 = rate(along(x, k1, h / 2.0));
        let k3 = rate(along(x, k2, h / 2.0));
        let k4 = rate(along(x, k3, h));
        for i in 0..2 {
            x[i] += h / 6.0 * (k1[i] + 2.0 * k2[i] + 2.0 * k3[i] + k4[i]);
        }
    }
    x
}

fn temperatures([copper, pad]: [f64; 2]) -> Temperatures {
    Temperatures {
        copper: Celsius(copper as f32),
        pad: Celsius(pad as f32),
    }
}

#[test]
fn a_step_is_the_solution_of_the_equations() {
    let mut rng = Rng::new(1);
    let mut worst: f64 = 0.0;
    for _ in 0..300 {
        let p = PLANT.map(|p| f64::from((p * 10f64.powf(rng.between(-1.0, 1.0))) as f32));
        let start = [rng.between(0.0, 80.0), rng.between(0.0, 80.0)].map(|x| f64::from(x as f32));
        let power = f64::from(rng.between(0.0, 50.0) as f32);
        let duration = f64::from(10f64.powf(rng.between(-3.0, 1.0)) as f32);
        let fast = 1.0 / (p[0] * p[2]) + 1.0 / (p[1] * p[2]);
        let steps = (duration * fast * 100.0).clamp(100.0, 1e6) as u32;
        let exact = integrate(p, start, |_| power, 22.0, duration, steps);
        let ours = model(p).after(
            temperatures(start),
            Watt(power as f32),
            Celsius(22.0),
            Second(duration as f32),
        );
        // The largest temperature difference involved, that to the final state included.
        let scale = 100.0 + power * (p[2] + p[3]);
        let error = (f64::from(ours.copper.0) - exact[0]).abs();
        worst = worst.max(error.max((f64::from(ours.pad.0) - exact[1]).abs()) / scale);
    }
    println!("a step is off by {worst:.2e} of the largest difference");
    assert!(worst <= 2.0e-6 && worst > 1e-8);
}

#[test]
fn many_short_steps_are_one_long_one() {
    let plant = model(PLANT);
    let mut stepped = Temperatures::uniform(Celsius(25.0));
    for _ in 0..100_000 {
        stepped = plant.after(stepped, Watt(5.0), Celsius(25.0), Second(1e-3));
    }
    let exact = integrate(PLANT, [25.0; 2], |_| 5.0, 25.0, 100.0, 100_000);
    let error = (f64::from(stepped.copper.0) - exact[0]).abs();
    println!(
        "100,000 steps of 1 ms: off by {error:.4} K of {:.2} K",
        exact[0] - 25.0
    );
    assert!(error < 0.02, "{stepped:?} {exact:?}");
}

#[test]
fn a_planned_pulse_is_bounded_closely_from_above() {
    let mut rng = Rng::new(2);
    let plant = model(PLANT);
    let copper = Copper(Ohm(0.389));
    let (mut tightest, mut widest) = (f64::MAX, 0.0f64);
    for _ in 0..2000 {
        let start = [rng.between(15.0, 60.0), rng.between(15.0, 40.0)];
        let start = start.map(|x| f64::from(x as f32));
        let current = f64::from(rng.between(1.0, 15.0) as f32);
        let duration = f64::from(rng.between(0.01, 2.0) as f32);
        let ambient = f64::from(rng.between(15.0, 35.0) as f32);
        let heat = |t: f64| current * current * f64::from(0.389f32) * (1.0 + 3.93e-3 * (t - 20.0));
        let exact = integrate(PLANT, start, heat, ambient, duration, 4000);
        let bound = plant.after_pulse(
            temperatures(start),
            copper,
            Ampere(current as f32),
            Celsius(ambient as f32),
            Second(duration as f32),
            Celsius(500.0),
        );
        let bound = f64::from(bound.unwrap().copper.0);
        // The tolerance covers the rounding of the temperatures themselves, 4e-6 K.
        assert!(bound >= exact[0] - 2e-5, "{bound} {}", exact[0]);
        let of_heat = exact[0] - integrate(PLANT, start, |_| 0.0, ambient, duration, 4000)[0];
        let span = bound.max(start[0]).max(start[1]) - start[0].min(start[1]).min(ambient);
        if of_heat > 1.0 {
            let excess = (bound - exact[0]) / of_heat;
            tightest = tightest.min(excess);
            widest = widest.max(excess / (0.004 * span));
        }
    }
    println!("excess from {tightest:.1e} of the heat's part up to {widest:.2} of 0.4 % per kelvin");
    assert!(tightest > 0.0 && widest < 1.0 && widest > 0.2);
}

#[test]
fn a_pulse_that_goes_too_far_is_none() {
    let plant = model(PLANT);
    let rest = Temperatures::uniform(Celsius(25.0));
    let pulse = |current: f32, limit: f32| {
        let (copper, ambient) = (Copper(Ohm(0.389)), Celsius(25.0));
        plant.after_pulse(
            rest,
            copper,
            Ampere(current),
            ambient,
            Second(0.5),
            Celsius(limit),
        )
    };
    let end = pulse(10.0, 60.0).unwrap().copper.0;
    assert!(pulse(10.0, end + 0.01).is_some());
    assert!(pulse(10.0, end - 0.01).is_none());
    assert!(pulse(1e4, 60.0).is_none() && pulse(f32::NAN, 60.0).is_none());
}

#[test]
fn impossible_stacks_are_refused() {
    let ok = KelvinPerWatt(1.0);
    assert!(TwoNode::new(JoulePerKelvin(0.0), JoulePerKelvin(1.0), ok, ok).is_err());
    assert!(TwoNode::new(JoulePerKelvin(1.0), JoulePerKelvin(f32::NAN), ok, ok).is_err());
}
