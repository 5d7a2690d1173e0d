//! Settings: operating parameters of the instrument.

use crate::code::{Drift, Stream};
use crate::schema::Described;
use crate::validation::{Invalid, inconsistent};

structure! {
    /// How the instrument is to be used. The limits are those of the protocol; a board refuses
    /// what is beyond its own, narrower ones, and its compiled-in limits of current, time and
    /// energy hold whatever is set here.
    pub struct Settings {
        /// Active channels: bit n for channel n. One alone (1, 2, 4, 8), or channel 0 and those that
        /// follow it (3, 7, 15).
        channels: u8 ["", 1, 15],
        /// Conversions (scans) per second.
        rate_hz: f32 ["Hz", 1, 5000],
        /// Records of conversions to send.
        stream: Stream,
        /// Every how many samples one is sent; the procedure uses all.
        decimation: u16 ["1", 1, 10000],
        /// From one `status` record to the next.
        status_period_s: f32 ["s", 0.1, 60],
        /// Standard deviation of the untouched sensor's deformation, vibration included: the scale
        /// of contact detection.
        contact_noise_m: f32 ["m", 1e-10, 1e-3],
        /// Deformation below which a contact is over.
        release_m: f32 ["m", 1e-9, 1e-2],
        /// Least deformation for a measurement.
        least_press_m: f32 ["m", 1e-9, 1e-2],
        /// Greatest rate of the deformation at which a press counts as steady.
        steady_m_per_s: f32 ["m/s", 1e-9, 1],
        /// Time for a press to become steady, after which the measurement is refused.
        settling_s: f32 ["s", 0, 60],
        /// Measures at every contact while armed, without `measure`.
        automatic: bool,
        /// Peak of the coil's current.
        peak_current_a: f32 ["A", 0.05, 20],
        /// Current at the end of a falling ramp.
        end_current_a: f32 ["A", 0, 20],
        /// From the least current to the peak, before each ramp.
        rise_s: f32 ["s", 0.001, 10],
        /// Time at the peak current before each ramp.
        hold_s: f32 ["s", 0, 10],
        /// Falling ramps.
        ramps: u8 ["1", 1, 64],
        /// Duration of a falling ramp.
        ramp_s: f32 ["s", 0.005, 30],
        /// Drift that the estimate allows for.
        drift: Drift,
        /// Time constant of an exponential drift. A logarithmic one counts from the contact, a
        /// saw-tooth one from ramp to ramp.
        drift_time_s: f32 ["s", 0.001, 10000],
        /// Greatest standard error as a fraction of the stiffness; a measurement above it is
        /// refused.
        greatest_error: f32 ["1", 0.001, 10],
        /// Points of the load curve.
        load_points: u8 ["1", 0, 64],
        /// Greatest temperature of the coil.
        greatest_temperature_c: f32 ["degC", 20, 150],
        /// Greatest energy into the coil in one measurement.
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
