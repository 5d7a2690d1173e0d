//! Presses that the calibration did not see.

use palpate_sim::touch::{Indenter, Surroundings};

use super::judge::{Outcome, judged};
use super::rig::{Manner, Rig};

/// Presses of each sensor in each world.
const PRESSES: u32 = 5;

/// The worlds, by name.
pub(super) fn all() -> Vec<(&'static str, Manner)> {
    let instead = |indenter| Manner {
        instead: Some(indenter),
        ..Manner::default()
    };
    let around = |around| Manner {
        around,
        ..Manner::default()
    };
    let still = Surroundings::default;
    vec![
        (
            "two balls of 5 mm, 6 mm apart",
            instead(Indenter::TwoBalls {
                radius_m: 5e-3,
                apart_m: 6e-3,
                toward_rad: 0.5,
            }),
        ),
        (
            "a sharp bar of 8 by 2 mm",
            instead(Indenter::Bar {
                length_m: 8e-3,
                width_m: 2e-3,
                toward_rad: 0.5,
            }),
        ),
        (
            "a plate of 3 mm radius, tilted by 0.02",
            instead(Indenter::Tilted {
                radius_m: 3e-3,
                tilt_rad: 0.02,
                toward_rad: 0.5,
            }),
        ),
        (
            "a steel plate at 15 mm",
            around(Surroundings {
                steel_m: Some(15e-3),
                ..still()
            }),
        ),
        (
            "the first coil's gain 3 % off",
            around(Surroundings {
                gains: vec![1.03],
                ..still()
            }),
        ),
        (
            "10 K warmer",
            around(Surroundings {
                warmer_k: 10.0,
                ..still()
            }),
        ),
        (
            "twice as fast",
            Manner {
                slower: 0.5,
                ..Manner::default()
            },
        ),
        (
            "sheared by 0.3 of the pressure",
            Manner {
                drag: [0.3, 0.0],
                ..Manner::default()
            },
        ),
    ]
}

/// Presses of a calibrated sensor in every world.
pub(super) fn of_sensor(rig: &mut Rig<'_>) -> Vec<Vec<Outcome>> {
    let calibrated = rig.calibrated();
    let mut press = |manner: &Manner| {
        let (calibration, array) = calibrated.as_ref().map_err(Clone::clone)?;
        let pressed = rig.anywhere(manner);
        judged(&pressed.estimate(array), &pressed, calibration)
    };
    let worlds = all();
    let of_world = |(_, manner): &(_, Manner)| (0..PRESSES).map(|_| press(manner)).collect();
    worlds.iter().map(of_world).collect()
}

/// A row for each world: claimed, refused, covered and far.
pub(super) fn rows(kind: &str, sensors: &[Vec<Vec<Outcome>>]) -> String {
    let worlds = all();
    let row = |(index, (name, _)): (usize, &(&str, Manner))| {
        let outcomes: Vec<_> = sensors
            .iter()
            .filter_map(|of| of.get(index))
            .flatten()
            .collect();
        let claimed = outcomes.iter().filter_map(|of| of.as_ref().ok());
        let count = claimed.clone().count();
        let covered = claimed.clone().filter(|of| of.is_covered()).count();
        let far = claimed.filter(|of| of.is_far()).count();
        let refused = outcomes.len() - count;
        format!("| {name} | `{kind}` | {refused} | {count} | {covered} | {far} |\n")
    };
    worlds.iter().enumerate().map(row).collect()
}
