//! What a train heats: the energy that it takes, and the copper at its hottest.

use palpate_sim::thermal::{CALIBRATION_C, ThermalParameters, ThermalState};
use palpate_wire::command::Settings;

/// Surroundings that the firmware assumes where no thermometer reports (firmware/procedure/src/heat.rs).
const WARM_ROOM_C: f64 = 30.0;
/// More than the mean current heats: its ripple (docs/decisions/0040-coil-drive.md).
const RIPPLE: f64 = 1.02;
/// Step of the temperatures, s: a tenth of the shortest rise.
const STEP_S: f64 = 1e-3;

/// A train's heat.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrainHeat {
    /// Energy into the coil, J, with the copper as warm as it becomes: what the firmware allows for.
    pub(crate) energy_j: f64,
    /// Copper at its hottest, degrees Celsius.
    pub(crate) hottest_c: f64,
    /// From the first rise to the end, s.
    pub(crate) lasts_s: f64,
}

impl TrainHeat {
    /// Of a train that begins with everything as warm as a warm room.
    pub(crate) fn of(settings: &Settings, thermal: &ThermalParameters) -> Self {
        let thermal = ThermalParameters {
            ambient_change_k: WARM_ROOM_C - CALIBRATION_C,
            ..*thermal
        };
        let mut state = thermal.at_rest();
        let (mut hottest_k, mut square_a2_s, mut lasts_s) = (state.copper_k, 0.0, 0.0);
        for (from_a, to_a, over_s) in lines(settings) {
            let steps = (over_s / STEP_S).ceil().max(1.0) as u32;
            let step_s = over_s / f64::from(steps);
            let at = |step: u32| from_a + (to_a - from_a) * f64::from(step) / f64::from(steps);
            for step in 0..steps {
                let (a, b) = (at(step), at(step + 1));
                let square_a2 = (a * a + a * b + b * b) / 3.0;
                state = thermal.advance(&state, square_a2, step_s);
                hottest_k = hottest_k.max(state.copper_k);
                square_a2_s += square_a2 * step_s;
            }
            lasts_s += over_s;
        }
        let hottest = ThermalState {
            copper_k: hottest_k,
            ..state
        };
        Self {
            energy_j: RIPPLE * square_a2_s * thermal.coil_resistance_ohm(&hottest),
            hottest_c: CALIBRATION_C + hottest_k,
            lasts_s,
        }
    }
}

/// The straight lines of the current: from and to, A, and how long, s. Hold and fall end with the conversion that is nearest to their
/// planned end, so that the firmware allows for half a conversion more of each.
fn lines(settings: &Settings) -> Vec<(f64, f64, f64)> {
    let [rise_s, hold_s, fall_s] =
        [settings.rise_s, settings.hold_s, settings.ramp_s].map(f64::from);
    let half_s = 0.5 / f64::from(settings.rate_hz);
    let (hold_s, fall_s) = (hold_s + half_s, fall_s + half_s);
    let (peak_a, end_a) = (
        f64::from(settings.peak_current_a),
        f64::from(settings.end_current_a),
    );
    let mut lines = Vec::new();
    for ramp in 0..settings.ramps {
        let from_a = if ramp == 0 { 0.0 } else { end_a };
        lines.extend([
            (from_a, peak_a, rise_s),
            (peak_a, peak_a, hold_s),
            (peak_a, end_a, fall_s),
        ]);
    }
    lines.push((end_a, 0.0, rise_s));
    lines
}
