//! Commands that describe [`Sensor`] to the procedure.

use palpate_procedure::configuration::DEFAULT_SETTINGS;
use palpate_wire::Command;
use palpate_wire::code::TipShape;
use palpate_wire::command::{
    Attraction, Coil, ContactTolerance, Crosstalk, DeformationCurve, DeformationKnot,
    NUMBERS_PER_CHUNK, Settings, Springs, Stiffening, TemperatureCoefficients, TemperatureEffect,
    Tip, TouchArray,
};

use super::sensor::{CHANGE_PER_M, PEAK_A, Sensor};

/// Largest deformation on the calibrated curve, m.
pub(crate) const DEEPEST_M: f32 = 1e-3;

/// Returns the default settings, changed by `change`.
pub(crate) fn settings(change: impl FnOnce(&mut Settings)) -> Settings {
    let mut settings = DEFAULT_SETTINGS;
    change(&mut settings);
    settings
}

/// Returns the curve, a straight line.
pub(crate) fn curve() -> DeformationCurve {
    let deformations_m = [-2e-4, 0.0, 2e-4, 4e-4, 7e-4, DEEPEST_M];
    DeformationCurve {
        sensor: 0,
        channel: 0,
        total: deformations_m.len() as u8,
        first: 0,
        knots: deformations_m
            .iter()
            .map(|&deformation_m| DeformationKnot {
                inductance_change: (CHANGE_PER_M * f64::from(deformation_m)) as f32,
                deformation_m,
            })
            .collect(),
    }
}

pub(crate) fn springs(sensor: &Sensor) -> Springs {
    Springs {
        sensing_n_per_m: sensor.sensing_n_per_m as f32,
        sensing_uncertainty: 0.0,
        actuated_n_per_m: sensor.actuated_n_per_m as f32,
        actuated_uncertainty: 0.0,
        force_scale_uncertainty: 0.0,
        zero_uncertainty_m: 0.0,
        bend: 0.0,
    }
}

pub(crate) fn stiffening(sensor: &Sensor) -> Stiffening {
    Stiffening {
        peak_current_a: PEAK_A as f32,
        rise_at_peak: sensor.rise as f32,
        rise_uncertainty: 0.0,
        field_at_peak_t: 0.0,
        field_half_t: 1.0,
    }
}

/// The paper's coil: 0.389 ohm, and the heat capacity of some grams of copper and rubber.
pub(crate) const COIL: Coil = Coil {
    resistance_ohm: 0.389,
    copper_capacity_j_per_k: 0.8,
    pad_capacity_j_per_k: 60.0,
    copper_to_pad_k_per_w: 0.5,
    pad_to_ambient_k_per_w: 8.0,
    current_uncertainty: 0.0,
};

pub(crate) fn attraction(sensor: &Sensor) -> Attraction {
    Attraction {
        attraction_n_per_a2: sensor.attraction_n_per_a2 as f32,
        uncertainty: 0.0,
    }
}

pub(crate) fn crosstalk(sensor: &Sensor) -> Crosstalk {
    Crosstalk {
        sensor: 0,
        channel: 0,
        apparent_m_per_a2: sensor.crosstalk_m_per_a2 as f32,
        growth_per_m: sensor.crosstalk_growth_per_m as f32,
        uncertainty: 0.0,
    }
}

pub(crate) fn temperature_effect(
    calibrated_at_c: f32,
    springs_uncertainty_per_k: f32,
    rise_uncertainty_per_k: f32,
) -> Command {
    Command::SetTemperatureEffect(TemperatureEffect {
        calibrated_at_c,
        springs_uncertainty_per_k,
        rise_uncertainty_per_k,
    })
}

pub(crate) fn temperature_coefficients(springs_per_k: f32, rise_per_k: f32) -> Command {
    Command::SetTemperatureCoefficients(TemperatureCoefficients {
        springs_per_k,
        rise_per_k,
    })
}

pub(crate) fn tip() -> Command {
    Command::SetTip(Tip {
        shape: TipShape::Ball,
        radius_m: 4e-3,
        radius_uncertainty: 5e-3,
        thickness_m: 12e-3,
        thickness_uncertainty: 0.02,
        poisson_ratio: 0.48,
        poisson_uncertainty: 0.01,
        support_m_per_n: 2e-5,
        support_uncertainty: 0.05,
    })
}

pub(crate) fn contact(rise_uncertainty: f32, zero_uncertainty_m: f32) -> Command {
    Command::SetContact(ContactTolerance {
        within_m: 1e-3,
        tilt_rad: 2e-3,
        rise_uncertainty,
        zero_uncertainty_m,
    })
}

/// Numbers of an array: one coil in the centre and three around it at 6 mm, on channels 0 to 3, with a
/// made-up profile, which reads 4 % per newton, and a pin of 2 mm declared.
pub(crate) fn array_numbers() -> Vec<f32> {
    let mut numbers = vec![15.0, 1.0, 2e-3, 0.0, 0.05];
    numbers.extend([0.0, 0.0, 4e-3, 2e-3, 1e-3, 1e-5, 2e-3, 0.01]);
    numbers.extend([2e-3, 1e-3, 5e-3, 2.0]);
    numbers.extend([0.05, 0.03, 5e-3, -4e-3, -2e-3, -5e-4, 0.0, 0.0, 0.0]);
    numbers.extend([-0.01, -3e-3, 2e-3, 1e-3, 0.0]);
    numbers.extend([2e-3, 5e-4, -5e-4, 0.0, 0.0]);
    numbers.extend([
        2e-3, 1e-3, 1e-4, 0.0, -1e-3, -5e-4, 0.0, 0.0, 2e-4, 1e-4, 0.0, 0.0,
    ]);
    for [x, y] in [[0.0, 0.0], [0.0, 6e-3], [5.2e-3, -3e-3], [-5.2e-3, -3e-3]] {
        numbers.extend([x, y, 1.0, 1e-5]);
    }
    numbers
}

/// Returns the commands that set an array.
pub(crate) fn array(numbers: &[f32]) -> Vec<Command> {
    let chunks = numbers.chunks(NUMBERS_PER_CHUNK).enumerate();
    let command = |(index, chunk): (usize, &[f32])| {
        Command::SetTouchArray(TouchArray {
            total: numbers.len() as u8,
            first: (NUMBERS_PER_CHUNK * index) as u8,
            numbers: chunk.iter().copied().collect(),
        })
    };
    chunks.map(command).collect()
}

/// Returns the calibration that a measurement needs.
pub(crate) fn calibration(sensor: &Sensor) -> [Command; 6] {
    [
        Command::SetDeformationCurve(curve()),
        Command::SetSprings(springs(sensor)),
        Command::SetStiffening(stiffening(sensor)),
        Command::SetCoil(COIL),
        Command::SetAttraction(attraction(sensor)),
        Command::SetCrosstalk(crosstalk(sensor)),
    ]
}
