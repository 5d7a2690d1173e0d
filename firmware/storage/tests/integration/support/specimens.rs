//! Typical configurations.

use palpate_wire::Command;
use palpate_wire::code::{Drift, Stream, TipShape};
use palpate_wire::command::*;

/// Settings that differ from the defaults.
pub(crate) fn settings() -> Settings {
    Settings {
        channels: 0b0101,
        rate_hz: 1_250.0,
        stream: Stream::Raw,
        decimation: 300,
        steady_m_per_s: 4e-5,
        automatic: true,
        ramps: 9,
        drift: Drift::Exponential,
        ..defaults()
    }
}

/// Settings of a device without a settings command.
pub(crate) fn defaults() -> Settings {
    Settings {
        channels: 0b0001,
        rate_hz: 1_000.0,
        stream: Stream::Samples,
        decimation: 1,
        status_period_s: 1.0,
        contact_noise_m: 2e-7,
        release_m: 5e-6,
        least_press_m: 50e-6,
        steady_m_per_s: 50e-6,
        settling_s: 3.0,
        automatic: false,
        peak_current_a: 10.0,
        end_current_a: 0.0,
        rise_s: 0.01,
        hold_s: 0.03,
        ramps: 12,
        ramp_s: 0.06,
        drift: Drift::Logarithmic,
        drift_time_s: 0.5,
        greatest_error: 0.5,
        load_points: 8,
        greatest_temperature_c: 80.0,
        greatest_energy_j: 40.0,
    }
}

pub(crate) fn tank(sensor: u8, channel: u8) -> Command {
    Command::SetTank(Tank {
        sensor,
        channel,
        capacitance_f: 1e-10,
        rest_frequency_hz: 3.1e6 + f64::from(channel),
    })
}

/// A curve in full chunks, except for the last.
pub(crate) fn deformation_curve(sensor: u8, channel: u8, total: u8) -> Vec<Command> {
    let knots: Vec<_> = (0..total)
        .map(|index| DeformationKnot {
            inductance_change: 0.013 * f32::from(index),
            deformation_m: 1.1e-5 * f32::from(index) * f32::from(index + 1),
        })
        .collect();
    let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
    chunks
        .map(|(number, knots)| {
            Command::SetDeformationCurve(DeformationCurve {
                sensor,
                channel,
                total,
                first: (number * KNOTS_PER_CHUNK) as u8,
                knots: knots.iter().cloned().collect(),
            })
        })
        .collect()
}

pub(crate) fn stiffening_curve(total: u8) -> Vec<Command> {
    let knots: Vec<_> = (0..total)
        .map(|index| StiffeningKnot {
            current_a: 0.3 * f32::from(index),
            rise: 0.001 * f32::from(index) * f32::from(index),
        })
        .collect();
    let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
    chunks
        .map(|(number, knots)| {
            Command::SetStiffeningCurve(StiffeningCurve {
                total,
                first: (number * KNOTS_PER_CHUNK) as u8,
                rise_uncertainty: 0.02,
                knots: knots.iter().cloned().collect(),
            })
        })
        .collect()
}

pub(crate) fn crosstalk(sensor: u8, channel: u8) -> Command {
    Command::SetCrosstalk(Crosstalk {
        sensor,
        channel,
        apparent_m_per_a2: 1e-9,
        growth_per_m: -20.0,
        uncertainty: 0.05,
    })
}

pub(crate) fn springs(sensing_n_per_m: f32) -> Command {
    Command::SetSprings(Springs {
        sensing_n_per_m,
        sensing_uncertainty: 0.01,
        actuated_n_per_m: 4e3,
        actuated_uncertainty: 0.01,
        force_scale_uncertainty: 0.005,
        zero_uncertainty_m: 1e-7,
        bend: 0.1,
    })
}

pub(crate) fn stiffening() -> Command {
    Command::SetStiffening(Stiffening {
        peak_current_a: 10.0,
        rise_at_peak: 0.1,
        rise_uncertainty: 0.02,
        field_at_peak_t: 0.3,
        field_half_t: 0.5,
    })
}

pub(crate) fn coil() -> Command {
    Command::SetCoil(Coil {
        resistance_ohm: 0.389,
        copper_capacity_j_per_k: 0.8,
        pad_capacity_j_per_k: 60.0,
        copper_to_pad_k_per_w: 0.5,
        pad_to_ambient_k_per_w: 8.0,
        current_uncertainty: 0.01,
    })
}

fn of_the_coil() -> Vec<Command> {
    vec![
        coil(),
        Command::SetAttraction(Attraction {
            attraction_n_per_a2: 1e-3,
            uncertainty: 0.1,
        }),
        Command::SetTemperatureEffect(TemperatureEffect {
            calibrated_at_c: 25.0,
            springs_uncertainty_per_k: 1e-3,
            rise_uncertainty_per_k: 2e-3,
        }),
        Command::SetCurrentCorrection(CurrentCorrection {
            greatest_a: 12.0,
            changes_a: (0..MAX_POINTS).map(|point| 0.01 * point as f32).collect(),
        }),
        identity(7),
    ]
}

pub(crate) fn identity(id: u32) -> Command {
    Command::SetCalibrationIdentity(CalibrationIdentity {
        id,
        calibrated_at_s: 1_780_000_000,
        calibrated_at_c: 23.5,
        hash: 0x1234_5678,
    })
}

/// Configuration of a calibrated instrument with one channel: every kind of part, and a law for the
/// magnetorheological effect. The fixture contains it, so it must not change.
pub(crate) fn typical() -> Vec<Command> {
    let mut commands = vec![Command::SetSettings(settings()), tank(0, 0)];
    commands.extend(deformation_curve(0, 0, 32));
    commands.extend([crosstalk(0, 0), springs(6e3), stiffening()]);
    commands.extend(of_the_coil());
    commands
}

/// Largest configuration: two converters of four channels, and the longest curves.
pub(crate) fn fullest() -> Vec<Command> {
    let channels = || (0..8).map(|index| (index / 4, index % 4));
    let mut commands = vec![Command::SetSettings(settings())];
    commands.extend(channels().map(|(sensor, channel)| tank(sensor, channel)));
    for (sensor, channel) in channels() {
        commands.extend(deformation_curve(sensor, channel, MAX_KNOTS));
    }
    commands.extend(channels().map(|(sensor, channel)| crosstalk(sensor, channel)));
    commands.push(springs(6e3));
    commands.extend(stiffening_curve(MAX_KNOTS));
    let mut of_the_coil = of_the_coil();
    let identity = of_the_coil.pop();
    commands.extend(of_the_coil);
    commands.push(Command::SetTemperatureCoefficients(
        TemperatureCoefficients {
            springs_per_k: -2e-3,
            rise_per_k: 4e-3,
        },
    ));
    commands.push(Command::SetTip(Tip {
        shape: TipShape::Ball,
        radius_m: 4e-3,
        radius_uncertainty: 5e-3,
        thickness_m: 12e-3,
        thickness_uncertainty: 0.02,
        poisson_ratio: 0.48,
        poisson_uncertainty: 0.01,
        support_m_per_n: 2e-5,
        support_uncertainty: 0.05,
    }));
    commands.push(Command::SetContact(ContactTolerance {
        within_m: 1e-3,
        tilt_rad: 2e-3,
        rise_uncertainty: 4e-3,
        zero_uncertainty_m: 2e-6,
    }));
    commands.extend((0..5_u8).map(|chunk| {
        let first = NUMBERS_PER_CHUNK as u8 * chunk;
        Command::SetTouchArray(TouchArray {
            total: 80,
            first,
            numbers: (first..80).take(NUMBERS_PER_CHUNK).map(f32::from).collect(),
        })
    }));
    commands.push(Command::SetCreep(Creep::TYPICAL));
    commands.extend(identity);
    commands
}

/// A few parts, for tests that save very often.
pub(crate) fn small(sensing_n_per_m: f32) -> Vec<Command> {
    vec![tank(0, 1), springs(sensing_n_per_m)]
}
