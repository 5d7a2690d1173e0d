//! Heat of a train: its energy, and the greatest temperature of the copper.

use palpate_sim::thermal::{CALIBRATION_C, ThermalParameters, ThermalState};
use palpate_wire::command::Settings;

/// Ambient temperature that the firmware assumes without a thermometer
/// (firmware/procedure/src/heat.rs).
const WARM_ROOM_C: f64 = 30.0;
/// Heat of the current with its ripple, relative to the heat of the mean current
/// (docs/decisions/0040-coil-drive.md).
const RIPPLE: f64 = 1.02;
/// Time step of the computed temperatures, s: a tenth of the shortest rise of the current.
const STEP_S: f64 = 1e-3;

/// Heat of a train.
#[derive(Clone, Copy, Debug)]
pub(crate) struct TrainHeat {
    /// Energy into the coil, J, as the firmware computes it: with the hottest copper's resistance.
    pub(crate) energy_j: f64,
    /// Greatest temperature of the copper, degrees Celsius.
    pub(crate) hottest_c: f64,
    /// Duration from the first rise to the end, s.
    pub(crate) lasts_s: f64,
}

impl TrainHeat {
    /// Computes the heat of a train that starts at the temperature of a warm room.
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

/// Linear segments of the current: start and end in A, and duration in s. Hold and fall end with
/// the conversion closest to their planned end, so the firmware allows half a conversion more for
/// each.
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
