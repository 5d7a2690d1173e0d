//! The result of an evaluation as commands to the instrument.

use palpate_wire::Command;
use palpate_wire::code::Stream;
use palpate_wire::command;
use palpate_wire::command::{
    Attraction, DeformationCurve, DeformationKnot, KNOTS_PER_CHUNK, Settings, Springs,
    StiffeningCurve, StiffeningKnot, Tank, TemperatureEffect,
};

use super::claim::Uncertainty;
use super::curve::PressCurve;
use super::{Actuated, Crosstalk, Known};

/// All results of the evaluation.
pub(crate) struct Findings<'a> {
    pub(crate) known: &'a Known,
    pub(crate) temperature_c: f64,
    /// Frequency of the untouched sensor, Hz.
    pub(crate) rest_hz: f64,
    pub(crate) force: &'a PressCurve,
    pub(crate) crosstalk: &'a Crosstalk,
    pub(crate) actuated: &'a Actuated,
    pub(crate) uncertainty: &'a Uncertainty,
    /// Relative error of the signal per relative error of the stiffening.
    pub(crate) stiffening_of_signal: f64,
    /// Shallowest calibrated press, m.
    pub(crate) least_press_m: f64,
    /// Standard uncertainty of the deformation's zero, m.
    pub(crate) zero_uncertainty_m: f64,
}

/// Knots of a curve: the protocol's maximum.
const KNOTS: usize = command::MAX_KNOTS as usize;

impl Findings<'_> {
    pub(crate) fn commands(&self) -> Vec<Command> {
        let settings = Settings {
            least_press_m: self
                .known
                .settings
                .least_press_m
                .max(self.least_press_m as f32),
            stream: Stream::Samples,
            ..self.known.settings.clone()
        };
        let mut commands = vec![
            Command::SetSettings(settings),
            Command::SetTank(Tank {
                sensor: 0,
                channel: 0,
                capacitance_f: self.known.capacitance_f as f32,
                rest_frequency_hz: self.rest_hz,
            }),
        ];
        commands.extend(self.deformation_curve());
        commands.extend([
            Command::SetCrosstalk(command::Crosstalk {
                sensor: 0,
                channel: 0,
                apparent_m_per_a2: self.crosstalk.untouched_m_per_a2 as f32,
                growth_per_m: self.crosstalk.growth_per_m as f32,
                uncertainty: 0.0,
            }),
            Command::SetSprings(Springs {
                sensing_n_per_m: self.known.sensing_n_per_m as f32,
                sensing_uncertainty: self.uncertainty.constant as f32,
                actuated_n_per_m: (self.known.sensing_n_per_m / self.actuated.ratio) as f32,
                actuated_uncertainty: 0.0,
                force_scale_uncertainty: self.uncertainty.scale as f32,
                zero_uncertainty_m: self.zero_uncertainty_m as f32,
                bend: self.uncertainty.bend as f32,
            }),
        ]);
        commands.extend(self.stiffening_curve());
        commands.extend([
            Command::SetCoil(self.known.coil.clone()),
            Command::SetAttraction(Attraction {
                attraction_n_per_a2: self.actuated.attraction_n_per_a2 as f32,
                uncertainty: 0.0,
            }),
            Command::SetTemperatureEffect(TemperatureEffect {
                calibrated_at_c: self.temperature_c as f32,
                springs_uncertainty_per_k: self.known.springs_per_k as f32,
                // The instrument treats an error of the rise as an error of the signal.
                rise_uncertainty_per_k: (self.known.rise_per_k * self.stiffening_of_signal) as f32,
            }),
        ]);
        commands
    }

    fn deformation_curve(&self) -> Vec<Command> {
        let (force, sensing_n_per_m) = (self.force, self.known.sensing_n_per_m);
        let knots: Vec<_> = (0..KNOTS)
            .map(|index| {
                let change = force.greatest_change * index as f64 / (KNOTS - 1) as f64;
                DeformationKnot {
                    inductance_change: change as f32,
                    deformation_m: (force.at(change) / sensing_n_per_m) as f32,
                }
            })
            .collect();
        let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
        chunks
            .map(|(index, knots)| {
                Command::SetDeformationCurve(DeformationCurve {
                    sensor: 0,
                    channel: 0,
                    total: KNOTS as u8,
                    first: (index * KNOTS_PER_CHUNK) as u8,
                    knots: knots.iter().cloned().collect(),
                })
            })
            .collect()
    }

    fn stiffening_curve(&self) -> Vec<Command> {
        let (known, actuated) = (self.known, self.actuated);
        // A little beyond the peak, so that noisy currents stay on the curve.
        let last_a = 1.03 * f64::from(known.settings.peak_current_a);
        // Near zero current, noise may make the rise decrease, by a negligible amount; the protocol
        // requires a curve that rises everywhere.
        let least = actuated.rise(last_a) * 1e-6;
        let mut below = -least;
        let knots: Vec<_> = (0..KNOTS)
            .map(|index| {
                let current_a = last_a * index as f64 / (KNOTS - 1) as f64;
                below = actuated.rise(current_a).max(below + least);
                StiffeningKnot {
                    current_a: current_a as f32,
                    rise: below as f32,
                }
            })
            .collect();
        let chunks = knots.chunks(KNOTS_PER_CHUNK).enumerate();
        chunks
            .map(|(index, knots)| {
                Command::SetStiffeningCurve(StiffeningCurve {
                    total: KNOTS as u8,
                    first: (index * KNOTS_PER_CHUNK) as u8,
                    rise_uncertainty: self.uncertainty.rise as f32,
                    knots: knots.iter().cloned().collect(),
                })
            })
            .collect()
    }
}
