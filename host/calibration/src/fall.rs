//! Detection of the falling ramps from the current readings.

use palpate_wire::command::Settings;

/// Slope of the current on the falling ramps.
#[derive(Clone, Copy, Debug)]
pub struct Fall {
    slope_a_per_s: f64,
}

impl Fall {
    /// Creates it from the settings of the train.
    pub fn of(settings: &Settings) -> Self {
        let drop_a = f64::from(settings.peak_current_a - settings.end_current_a);
        Self {
            slope_a_per_s: drop_a / f64::from(settings.ramp_s),
        }
    }

    /// Whether the current fell throughout between two readings, each (time in s, current in A). It
    /// did if it dropped by more than half of the ramp's change.
    pub fn between(&self, from: (f64, f64), to: (f64, f64)) -> bool {
        from.1 - to.1 > 0.5 * self.slope_a_per_s * (to.0 - from.0)
    }
}
