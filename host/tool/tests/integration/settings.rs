//! `palpate settings` with the emulated board, whose flash is a file.

use std::fs;
use std::path::Path;
use std::process::Output;

use palpate_wire::Command as Set;
use palpate_wire::code::TipShape;
use palpate_wire::command::{
    Attraction, CalibrationIdentity, Coil, ContactTolerance, Creep, Crosstalk, DeformationCurve,
    DeformationKnot, Springs, Stiffening, Tank, TemperatureCoefficients, TemperatureEffect, Tip,
};
use palpate_wire::configuration_crc;
use serde_json::Value;

use crate::support::{self, emulated};

fn settings(arguments: &[&str], folder: &Path) -> Output {
    emulated(&[&["settings"], arguments].concat(), folder)
}

fn json(arguments: &[&str], folder: &Path) -> Value {
    support::json(&settings(&[arguments, &["--json"]].concat(), folder))
}

/// A curve with more knots than one record can contain.
fn curve() -> Vec<Set> {
    let knots: Vec<_> = (0..10u8)
        .map(|index| DeformationKnot {
            inductance_change: 0.01 * f32::from(index),
            deformation_m: 1e-4 * f32::from(index),
        })
        .collect();
    let chunks = knots.chunks(8).enumerate();
    let chunks = chunks.map(|(index, knots)| {
        Set::SetDeformationCurve(DeformationCurve {
            sensor: 0,
            channel: 0,
            total: 10,
            first: 8 * index as u8,
            knots: knots.iter().cloned().collect(),
        })
    });
    chunks.collect()
}

/// Frequency of the emulated board's untouched sensor, Hz, from `palpate calibrate sensor`.
pub(crate) const REST_HZ: f64 = 3_059_428.413;

/// A calibration with its identity, complete for a measurement of stiffness.
pub(crate) fn calibration() -> Vec<Set> {
    let mut commands = vec![Set::SetTank(Tank {
        sensor: 0,
        channel: 0,
        capacitance_f: 330e-12,
        rest_frequency_hz: REST_HZ,
    })];
    commands.extend(curve());
    commands.extend([
        Set::SetCrosstalk(Crosstalk {
            sensor: 0,
            channel: 0,
            apparent_m_per_a2: 1e-9,
            growth_per_m: 0.0,
            uncertainty: 0.1,
        }),
        Set::SetSprings(Springs {
            sensing_n_per_m: 3210.0,
            sensing_uncertainty: 0.01,
            actuated_n_per_m: 4321.0,
            actuated_uncertainty: 0.01,
            force_scale_uncertainty: 0.005,
            zero_uncertainty_m: 1e-6,
            bend: 0.0,
        }),
        Set::SetStiffening(Stiffening {
            peak_current_a: 10.0,
            rise_at_peak: 0.3,
            rise_uncertainty: 0.02,
            field_at_peak_t: 0.1,
            field_half_t: 0.2,
        }),
        Set::SetCoil(Coil {
            resistance_ohm: 0.39,
            copper_capacity_j_per_k: 0.8,
            pad_capacity_j_per_k: 60.0,
            copper_to_pad_k_per_w: 2.0,
            pad_to_ambient_k_per_w: 10.0,
            current_uncertainty: 0.003,
        }),
        Set::SetAttraction(Attraction {
            attraction_n_per_a2: 1e-4,
            uncertainty: 0.1,
        }),
        Set::SetTemperatureEffect(TemperatureEffect {
            calibrated_at_c: 23.4,
            springs_uncertainty_per_k: 0.001,
            rise_uncertainty_per_k: 0.002,
        }),
        Set::SetTemperatureCoefficients(TemperatureCoefficients {
            springs_per_k: -0.002,
            rise_per_k: 0.003,
        }),
        Set::SetContact(ContactTolerance {
            within_m: 1e-3,
            tilt_rad: 2e-3,
            rise_uncertainty: 4e-3,
            zero_uncertainty_m: 2e-6,
        }),
        Set::SetCreep(Creep::TYPICAL),
    ]);
    let identity = Set::SetCalibrationIdentity(CalibrationIdentity {
        id: 7,
        calibrated_at_s: 1_700_000_000,
        calibrated_at_c: 23.4,
        hash: configuration_crc(&commands),
    });
    let tip = Set::SetTip(Tip {
        shape: TipShape::Ball,
        radius_m: 4e-3,
        radius_uncertainty: 5e-3,
        thickness_m: 12e-3,
        thickness_uncertainty: 0.02,
        poisson_ratio: 0.48,
        poisson_uncertainty: 0.01,
        support_m_per_n: 2e-5,
        support_uncertainty: 0.05,
    });
    // The order is that of the kinds; contact and creep, the last parts so far, come after the tip.
    commands.insert(commands.len() - 2, tip);
    commands.push(identity);
    commands
}

pub(crate) fn lines(commands: &[Set]) -> String {
    let lines = commands
        .iter()
        .map(|command| serde_json::to_string(command).unwrap());
    lines.map(|line| line + "\n").collect()
}

#[test]
fn what_was_exported_and_erased_is_there_again_after_an_import() {
    let folder = tempfile::tempdir().unwrap();
    let folder = folder.path();
    let commands = calibration();
    fs::write(folder.join("made.jsonl"), lines(&commands)).unwrap();
    let imported = json(&["import", "made.jsonl", "--store"], folder);
    let crc = configuration_crc(&commands);
    assert_eq!(imported["configuration_crc"], crc);
    assert_eq!(imported["stored"], true);
    // Settings that were never set are not in the file; once they have been set, they are.
    let set = json(&["set", "rate_hz=500", "drift=linear", "--store"], folder);
    assert_eq!(set["settings"]["drift"], "linear");
    let exported = json(&["export", "first.jsonl"], folder);
    let first = fs::read_to_string(folder.join("first.jsonl")).unwrap();
    assert!(first.ends_with(&lines(&commands)), "{first}");
    assert!(first.starts_with("{\"set_settings\":"), "{first}");

    let erased = json(&["erase", "--yes"], folder);
    assert_eq!(erased["state"], "empty");
    let bare = json(&["get"], folder);
    assert_eq!(bare["storage"]["in_force_crc"], 0);
    assert_eq!(bare["settings"]["rate_hz"], 1000.0);
    let again = json(&["import", "first.jsonl", "--store"], folder);
    assert_eq!(again["configuration_crc"], exported["configuration_crc"]);
    json(&["export", "second.jsonl"], folder);
    assert_eq!(
        fs::read_to_string(folder.join("second.jsonl")).unwrap(),
        first
    );
    // A refused import names the parts that the file lacks, and restores the stored configuration.
    fs::write(folder.join("curve.jsonl"), lines(&curve())).unwrap();
    let refused = settings(&["import", "curve.jsonl", "--store"], folder);
    let said = String::from_utf8_lossy(&refused.stderr);
    assert_eq!(refused.status.code(), Some(1), "{said}");
    assert!(
        said.contains("set_settings, set_tank, set_crosstalk"),
        "{said}"
    );
    let kept = json(&["get"], folder);
    assert_eq!(kept["storage"]["stored_crc"], exported["configuration_crc"]);
}

#[test]
fn all_settings_are_shown_with_unit_and_range() {
    let folder = tempfile::tempdir().unwrap();
    let shown = settings(&["get"], folder.path());
    let text = String::from_utf8_lossy(&shown.stdout);
    let rate = text.lines().find(|line| line.contains("rate_hz")).unwrap();
    for part in ["1000.0", "Hz", "1 to 5000"] {
        assert!(rate.contains(part), "{rate}");
    }
    assert!(text.contains("Stored: nothing"), "{text}");
}

#[test]
fn a_value_out_of_range_is_bad_input_and_one_that_the_board_cannot_do_a_refusal() {
    let folder = tempfile::tempdir().unwrap();
    let beyond = settings(&["set", "rate_hz=9000"], folder.path());
    let said = String::from_utf8_lossy(&beyond.stderr);
    assert_eq!(beyond.status.code(), Some(2), "{said}");
    assert!(said.contains("allowed are 1 to 5000 Hz"), "{said}");
    // The protocol allows 15 A, but this board only 12 A.
    let narrower = settings(&["set", "peak_current_a=15"], folder.path());
    let said = String::from_utf8_lossy(&narrower.stderr);
    assert_eq!(narrower.status.code(), Some(1), "{said}");
    assert!(
        said.contains("out_of_range") && said.contains("Not changed: peak_current_a"),
        "{said}"
    );
    // The rate exceeds the limit of converter and bus.
    let faster = settings(&["set", "rate_hz=4000"], folder.path());
    let said = String::from_utf8_lossy(&faster.stderr);
    assert_eq!(faster.status.code(), Some(1), "{said}");
    assert!(
        said.contains("rate_hz is 4000 Hz; allowed are 32 to 269"),
        "{said}"
    );
    let unconfirmed = settings(&["erase"], folder.path());
    assert_eq!(unconfirmed.status.code(), Some(2));
}

/// Messages about a change lost with the command, a fault with its value, and an empty file.
#[test]
fn what_becomes_of_a_change_is_said() {
    let folder = tempfile::tempdir().unwrap();
    let said = |arguments: &[&str]| {
        let output = settings(arguments, folder.path());
        let said = String::from_utf8_lossy(&[output.stdout, output.stderr].concat()).into_owned();
        (output.status.code(), said)
    };
    let (code, lost) = said(&["set", "rate_hz=500"]);
    assert_eq!(code, Some(0), "{lost}");
    assert!(lost.contains("Lost at the end of this command"), "{lost}");
    let (code, kept) = said(&["set", "rate_hz=500", "--store"]);
    assert_eq!(code, Some(0), "{kept}");
    assert!(!kept.contains("Lost"), "{kept}");
    // The second channel has no coil, so it does not oscillate.
    let (code, silent) = said(&["set", "channels=3", "--store"]);
    assert_eq!(code, Some(1), "{silent}");
    assert!(silent.contains("sensor_not_oscillating, 1. "), "{silent}");
    fs::write(folder.path().join("empty.jsonl"), "").unwrap();
    let (code, empty) = said(&["import", "empty.jsonl"]);
    assert_eq!(code, Some(2), "{empty}");
    assert!(
        empty.contains("empty.jsonl, line 1: it has no command"),
        "{empty}"
    );
}
