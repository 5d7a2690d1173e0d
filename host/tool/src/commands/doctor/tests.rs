//! Acceptance of emulated boards with a planted defect.

use std::path::Path;

use clap::Parser;
use palpate_sim::parameters::Parameters;

use super::measured::{Drift, Held, Measured};
use super::{Line, Promise, Verdict, lines};
use crate::board::configuration;
use crate::board::link::{self, Link};

#[derive(Parser)]
struct Named {
    #[command(flatten)]
    link: link::Arguments,
}

/// Lines of an emulated board whose sensor differs from its design.
fn lines_of(change: impl FnOnce(&mut Parameters)) -> Vec<Line> {
    let folder = tempfile::tempdir().unwrap();
    let flash = folder.path().join("board.flash");
    let named = ["palpate", "--board", "emulated", "--state"].map(Path::new);
    let named = Named::parse_from(named.into_iter().chain([flash.as_path()]));
    let mut model = named.link.emulated.load().unwrap();
    change(&mut model.plant);
    let mut link = Link::of_model(&model).unwrap();
    let promise = Promise::of("ultrasoft", None).unwrap();
    let settings = configuration::settings(&mut link).unwrap();
    let measured = Measured::of(&mut link, &promise, &settings, 0.2).unwrap();
    let lines = lines::of(&measured, &promise);
    for line in &lines {
        println!(
            "{} {:?} {:?} {:?}",
            line.quantity, line.measured, line.expected, line.verdict
        );
    }
    lines
}

/// Quantities that are off.
fn off(lines: &[Line]) -> Vec<&str> {
    let off = lines.iter().filter(|line| line.verdict == Verdict::Off);
    off.map(|line| line.quantity.as_str()).collect()
}

#[test]
#[ignore = "long: `cargo xtask ci` runs it"]
fn each_planted_defect_is_off_in_its_own_line() {
    let sound = lines_of(|_| ());
    assert!(sound.iter().all(|line| line.verdict == Verdict::AsExpected));

    let capacitor = lines_of(|plant| plant.tank.capacitance_f = 470e-12);
    assert_eq!(off(&capacitor), ["frequency of the untouched sensor"]);
    let action = capacitor
        .iter()
        .find_map(|line| line.action.clone())
        .unwrap();
    let found_pf = action
        .split(" pF")
        .next()
        .and_then(|text| text.rsplit(' ').next());
    let found_pf: f64 = found_pf.unwrap().parse().unwrap();
    assert!((found_pf - 470.0).abs() < 20.0, "{action}");

    let shorted = lines_of(|plant| {
        plant.thermal.resistance_ohm *= 0.5;
        plant.current.inductance_h *= 0.4;
    });
    let shorted = off(&shorted);
    assert!(
        shorted.contains(&"resistance of coil and circuit"),
        "{shorted:?}"
    );
    assert!(shorted.contains(&"inductance of the coil"), "{shorted:?}");

    let missing = lines_of(|plant| plant.thermal.resistance_ohm = 100.0);
    assert_eq!(off(&missing), ["the coil's self-test passes"]);
    let action = missing.iter().find_map(|line| line.action.clone()).unwrap();
    assert!(action.contains("coil_open"), "{action}");
}

/// Readings of a sound board.
fn sound(promise: &Promise) -> Measured {
    let ([least_hz, greatest_hz], _) = promise.frequency_hz();
    let hz = 0.5 * (least_hz + greatest_hz);
    Measured {
        supply_v: vec![12.0; 8],
        temperature_c: Some(22.0),
        frequencies_hz: vec![(hz, 5.0), (hz + 4.0, 5.0), (hz - 3.0, 5.0)],
        resting_a: vec![0.001, -0.002, 0.001],
        held: Some(Held {
            to_a: 3.0,
            currents_a: vec![3.0, 3.005, 2.998],
            ripple_a: None,
        }),
        drift: Some(Drift {
            time_s: 600.0,
            from_hz: hz,
            to_hz: hz + 20.0,
        }),
        ..Measured::default()
    }
}

#[test]
fn each_reading_that_is_off_is_its_own_line() {
    let promise = Promise::of("ultrasoft", None).unwrap();
    let names = |spoil: &dyn Fn(&mut Measured)| -> Vec<String> {
        let mut measured = sound(&promise);
        spoil(&mut measured);
        off(&lines::of(&measured, &promise))
            .into_iter()
            .map(str::to_owned)
            .collect()
    };
    assert_eq!(names(&|_| ()), [""; 0]);
    // A ripple of 0.5 V from peak to peak.
    let noisy = names(&|of| of.supply_v = [11.75, 12.25].repeat(20));
    assert_eq!(noisy, ["noise of the supply at rest"]);
    assert_eq!(
        names(&|of| of.supply_v = vec![15.0; 8]),
        ["supply of the coil at rest"]
    );
    assert_eq!(names(&|of| of.lost = 3), ["conversions lost"]);
    assert_eq!(
        names(&|of| of.flagged = 1),
        ["conversions with an error flag, share"]
    );
    let scattered = names(&|of| {
        of.frequencies_hz
            .iter_mut()
            .for_each(|(hz, _)| *hz += 1e3 * (*hz % 7.0))
    });
    assert_eq!(scattered, ["noise of the frequency, relative"]);
    let drifted = names(&|of| of.drift.as_mut().unwrap().to_hz += 3e4);
    assert_eq!(drifted, ["drift of the frequency in 600 s, relative"]);
    let loose = names(&|of| of.held.as_mut().unwrap().currents_a = vec![3.0, 2.9, 3.1]);
    assert_eq!(loose, ["noise of the held current"]);
    let failed = names(&|of| of.coil = Some(Err("the self-test ended with coil_open".to_owned())));
    assert_eq!(failed, ["the coil's self-test passes"]);
}

#[test]
fn what_was_not_measured_is_not_as_expected() {
    let promise = Promise::of("ultrasoft", None).unwrap();
    let lines = lines::of(&Measured::default(), &promise);
    let measured = lines
        .iter()
        .filter(|line| line.verdict != Verdict::NotMeasured);
    assert_eq!(
        measured
            .map(|line| line.quantity.as_str())
            .collect::<Vec<_>>(),
        ["conversions lost"]
    );
    assert!(
        lines
            .iter()
            .all(|line| line.measured.is_some() || line.action.is_some())
    );
}
