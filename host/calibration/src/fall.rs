//! The falls of the current, as seen from its readings.

use palpate_wire::command::Settings;

/// How steeply the current falls on the ramps.
#[derive(Clone, Copy, Debug)]
pub struct Fall {
    slope_a_per_s: f64,
}

impl Fall {
    /// The falls of a train with these settings.
    pub fn of(settings: &Settings) -> Self {
        let drop_a = f64::from(settings.peak_current_a - settings.end_current_a);
        Self {
            slope_a_per_s: drop_a / f64::from(settings.ramp_s),
        }
    }

    /// Whether the current fell all along between two readings, each (time in s, current in A): it
    /// did if it lost more than half of what the ramp takes.
    pub fn between(&self, from: (f64, f64), to: (f64, f64)) -> bool {
        from.1 - to.1 > 0.5 * self.slope_a_per_s * (to.0 - from.0)
    }
}
