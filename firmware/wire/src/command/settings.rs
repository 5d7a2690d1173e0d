//! Settings: operating parameters of the instrument.

use crate::code::{Drift, Stream};
use crate::schema::Described;
use crate::validation::{Invalid, inconsistent};

structure! {
    /// Operating parameters of the instrument. The limits are those of the protocol; a board refuses
    /// values beyond its own, narrower ones. Its compiled-in limits of current, time and energy hold for
    /// all settings.
    pub struct Settings {
        /// Active channels: bit n for channel n. One alone (1, 2, 4, 8), or channel 0 and those that
        /// follow it (3, 7, 15).
        channels: u8 ["", 1, 15],
        /// Conversions (scans) per second.
        rate_hz: f32 ["Hz", 1, 5000],
        /// Records of conversions to send.
        stream: Stream,
        /// Sends one of this number of samples; the procedure uses all.
        decimation: u16 ["1", 1, 10000],
        /// Period of the `status` record.
        status_period_s: f32 ["s", 0.1, 60],
        /// Standard deviation of the untouched sensor's deformation, vibration included: the scale
        /// of contact detection.
        contact_noise_m: f32 ["m", 1e-10, 1e-3],
        /// Deformation below which a contact has ended.
        release_m: f32 ["m", 1e-9, 1e-2],
        /// Smallest deformation for a measurement.
        least_press_m: f32 ["m", 1e-9, 1e-2],
        /// Largest rate of the deformation at which a press counts as steady.
        steady_m_per_s: f32 ["m/s", 1e-9, 1],
        /// Time for a press to become steady, after which the measurement is refused.
        settling_s: f32 ["s", 0, 60],
        /// Measures at every contact while armed, without `measure`.
        automatic: bool,
        /// Peak of the coil's current.
        peak_current_a: f32 ["A", 0.05, 20],
        /// Current at the end of a falling ramp.
        end_current_a: f32 ["A", 0, 20],
        /// Duration of the rise from the lowest current to the peak, before each ramp.
        rise_s: f32 ["s", 0.001, 10],
        /// Time at the peak current before each ramp.
        hold_s: f32 ["s", 0, 10],
        /// Number of falling ramps.
        ramps: u8 ["1", 1, 64],
        /// Duration of a falling ramp.
        ramp_s: f32 ["s", 0.005, 30],
        /// Drift that the estimate models.
        drift: Drift,
        /// Time constant of an exponential drift. A logarithmic drift counts from the contact, a
        /// saw-tooth drift from ramp to ramp.
        drift_time_s: f32 ["s", 0.001, 10000],
        /// Largest standard error as a fraction of the stiffness; a measurement above it is refused.
        greatest_error: f32 ["1", 0.001, 10],
        /// Number of points of the load curve.
        load_points: u8 ["1", 0, 64],
        /// Highest temperature of the coil.
        greatest_temperature_c: f32 ["degC", 20, 150],
        /// Largest energy into the coil in one measurement.
        greatest_energy_j: f32 ["J", 0.01, 10000],
    }
    also together
}

impl Settings {
    /// Checks that the converter can convert the active channels and no others: one alone, or a scan of
    /// all from channel 0 to the highest (LDC1614 datasheet, table 28). Not part of
    /// [`validate`](crate::Message::validate), so that settings stored by an earlier version stay
    /// readable.
    ///
    /// # Errors
    ///
    /// The field, with the possible values.
    pub fn check_channels(&self) -> Result<(), Invalid> {
        let channels = self.channels;
        if channels.is_power_of_two() || channels.wrapping_add(1).is_power_of_two() {
            return Ok(());
        }
        inconsistent!(
            Settings,
            "channels",
            "has to be one channel (1, 2, 4 or 8), or channel 0 and those that follow it (3, 7 or 15)"
        )
    }
}

fn together(settings: &Settings) -> Result<(), Invalid> {
    if settings.end_current_a >= settings.peak_current_a {
        return inconsistent!(Settings, "end_current_a", "has to be below peak_current_a");
    }
    if settings.release_m > settings.least_press_m {
        return inconsistent!(Settings, "release_m", "may not be above least_press_m");
    }
    Ok(())
}
