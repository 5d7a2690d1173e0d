//! Relaxation of a pressed object, against the test's own sensor in `f64`.

use crate::support::Rig;
use crate::support::calibration::settings;
use crate::support::sensor::{self, Sensor};
use palpate_procedure::Instant;
use palpate_wire::code::State;
use palpate_wire::command::Creep;
use palpate_wire::record::{Estimate, Relaxation};
use palpate_wire::{Command, Record};

/// Returns a rig pressed by a load of `ratio` times c_S that relaxes by `size`, half of it in a second.
fn pressed(ratio: f64, size: f64, calibrated: Option<Creep>) -> Rig {
    let mut rig = Rig::calibrated(Sensor::default(), settings(|_| {}));
    if let Some(creep) = calibrated {
        rig.accepted(Command::SetCreep(creep));
    }
    rig.arm();
    rig.sensor.load_n_per_m = ratio * rig.sensor.sensing_n_per_m;
    rig.sensor.relaxation = sensor::Creep {
        size,
        since_s: rig.now_us as f64 * 1e-6,
        shape: |time_s| time_s / (1.0 + time_s),
    };
    rig.touch(3e-4);
    rig
}

/// Returns the records of the relaxation with their times, s.
fn relaxations(rig: &Rig) -> Vec<(f64, Relaxation)> {
    let records = rig.records.iter();
    let of = |(at, record): &(Instant, Record)| match record {
        Record::Relaxation(relaxation) => Some((at.as_ticks() as f64 * 1e-6, relaxation.clone())),
        _ => None,
    };
    records.filter_map(of).collect()
}

/// Mean of the load's relaxation over the block that ends at this time.
fn truth(rig: &Rig, at_s: f64) -> f64 {
    let times = (0..100).map(|i| at_s - (f64::from(i) + 0.5) * 1e-3);
    times
        .map(|time_s| rig.sensor.relaxation.at(time_s))
        .sum::<f64>()
        / 100.0
}

#[test]
fn a_held_press_reports_how_its_object_relaxes() {
    let calibrated = Creep {
        sensing: 0.01,
        actuated: 0.012,
        uncertainty: 0.002,
    };
    for (ratio, size, creep) in [
        (0.2, 0.1, None),
        (1.0, 0.3, None),
        (5.0, 0.5, None),
        (1.0, 0.0, None),
        (1.0, 0.3, Some(calibrated.clone())),
        (5.0, 0.0, Some(calibrated)),
    ] {
        let mut rig = pressed(ratio, size, creep.clone());
        let creep = creep.unwrap_or(Creep::TYPICAL);
        let touched_s = rig.now_us as f64 * 1e-6;
        let estimate: Estimate = rig.measure();
        let ended_s = rig.now_us as f64 * 1e-6;
        rig.run(6_000);
        let found = relaxations(&rig);
        let [(first_s, _), (second_s, last)] = found.as_slice() else {
            panic!("two records: {found:?}");
        };
        assert!(
            (first_s - ended_s - 0.2).abs() < 5e-3,
            "{first_s} {ended_s}"
        );
        assert!((3.0..3.11).contains(&last.held_s), "{second_s} {last:?}");
        for (at_s, relaxation) in found {
            let before_s = at_s - f64::from(relaxation.held_s);
            let kappa = f64::from(estimate.load_ratio);
            let grown = (truth(&rig, at_s) - truth(&rig, before_s)) / (kappa * ratio);
            // Unlike the sensor that the procedure assumes, the sensor of this test does not creep.
            let older = ((at_s - touched_s) / (before_s - touched_s)).ln();
            let g = 1.5 / kappa;
            let subtracted = (1.0 + g) * f64::from(creep.sensing) - g * f64::from(creep.actuated);
            // Growth of the deformation. The procedure assumes that more of the load has relaxed before the
            // first level, by 0.2 of its compression.
            let deepened = grown * kappa / (2.5 + kappa);
            let off =
                f64::from(relaxation.relaxation) - grown - 0.2 * deepened - subtracted * older;
            // The estimate's c_S/c_L is that of the train, not that of the first level.
            assert!(
                off.abs() < 0.06 * grown + 2e-3,
                "{ratio} {size}: {relaxation:?} {grown}"
            );
            let of_creep = f64::from(creep.uncertainty) * older * (1.0 + g).hypot(g);
            // Part of W that c_S/c_L does not change.
            let fixed = 2.5 / (2.5 + kappa);
            let of_ratio = grown * fixed * f64::from(estimate.load_ratio_standard_error) / kappa;
            let of_before = 0.2 * deepened;
            let expected = of_creep.hypot(of_ratio).hypot(of_before);
            let error = f64::from(relaxation.standard_error) / expected;
            assert!((0.9..1.1).contains(&error), "{relaxation:?} {error}");
            assert_eq!(relaxation.measurement, estimate.measurement);
        }
    }
}

#[test]
fn a_press_that_moves_or_is_lifted_reports_none() {
    let mut rig = pressed(1.0, 0.3, None);
    rig.measure();
    for _ in 0..1_000 {
        // The sensing layer moves by 0.1 mm/s: 0.35 um per conversion, shared by all springs.
        rig.sensor.depth_m += 3.5e-7;
        rig.convert();
    }
    assert_eq!(relaxations(&rig).len(), 0);
    rig.run(500);
    assert_eq!(relaxations(&rig).len(), 1, "steady again");
    rig.lift();
    rig.run(6_000);
    assert_eq!(relaxations(&rig).len(), 1);
}

#[test]
fn another_train_ends_it() {
    let mut rig = pressed(1.0, 0.3, None);
    rig.measure();
    rig.until(State::Release, 1_000);
    rig.accepted(Command::Measure);
    rig.until(State::Ramps, 3_000);
    rig.accepted(Command::Abort);
    rig.run(6_000);
    assert_eq!(relaxations(&rig).len(), 0);
    let estimate = rig.measure();
    rig.run(6_000);
    let found = relaxations(&rig);
    let of: Vec<u32> = found.iter().map(|(_, of)| of.measurement).collect();
    assert_eq!(of, [estimate.measurement; 2]);
}
