//! The oscillating coils at the chip's inputs.

use core::f64::consts::PI;

/// The resonators on channels 0 to 3, as functions of time.
///
/// The model only queries times within the conversion that has just ended, including its settling,
/// and never the future. Within a conversion it may query the same time more than once, and times
/// in any order.
///
/// Implemented for closures `Fn(channel, time_s) -> frequency_hz`, for arrays of fixed frequencies
/// and for arrays of [`Tank`]s; a channel beyond the end of an array does not oscillate.
pub trait Sensors {
    /// Resonance frequency without the chip's influence, Hz, 1 kHz to 10 MHz in use. Zero, negative
    /// or NaN means that the sensor does not oscillate.
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64;

    /// Parallel loss resistance RP at the resonance, ohm, 1 kΩ to 90 kΩ in use (datasheet 8.1.2).
    fn parallel_resistance_ohm(&self, channel: usize, time_s: f64) -> f64 {
        let _ = (channel, time_s);
        3_000.0
    }

    /// Quality factor; it determines how long the oscillation takes to settle (datasheet
    /// equations 10, 11).
    fn quality_factor(&self, channel: usize, time_s: f64) -> f64 {
        let _ = (channel, time_s);
        25.0
    }

    /// Number of cycles by which an external disturbance advances (or delays) the oscillation
    /// during a conversion, compared with its mean frequency. Models an interferer near the
    /// resonance, whose beat is too fast for the few queries of
    /// [`frequency_hz`](Self::frequency_hz). Called once for each conversion, in order of time.
    fn pulled_cycles(&self, channel: usize, window: &Window) -> f64 {
        let _ = (channel, window);
        0.0
    }
}

/// The time window of a conversion, as given to [`Sensors::pulled_cycles`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Start of the window, s.
    pub start_s: f64,
    /// Length of the window, s.
    pub length_s: f64,
    /// Mean frequency of the oscillation in the window without pulling, Hz.
    pub free_hz: f64,
}

impl<F: Fn(usize, f64) -> f64> Sensors for F {
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64 {
        self(channel, time_s)
    }
}

impl<const N: usize> Sensors for [f64; N] {
    fn frequency_hz(&self, channel: usize, _time_s: f64) -> f64 {
        self.get(channel).copied().unwrap_or(0.0)
    }
}

/// An LC resonator: a coil, its capacitor and its losses, all constant.
///
/// ```
/// use ldc161x_sim::{Sensors, Tank};
///
/// // the coil of the datasheet's test conditions: 19.4 uH, 330 pF, 5.7 kohm at 2 MHz
/// let coil = Tank { inductance_h: 19.4e-6, capacitance_f: 330e-12, parallel_resistance_ohm: 5.7e3 };
/// assert!((coil.frequency_hz() - 1.99e6).abs() < 0.01e6);
/// assert!((coil.quality_factor() - 23.5).abs() < 0.1);
/// assert_eq!([coil; 2].frequency_hz(2, 0.0), 0.0);
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tank {
    /// Inductance L, henry.
    pub inductance_h: f64,
    /// Capacitance C, including that of the board and of the chip's pins, farad.
    pub capacitance_f: f64,
    /// Parallel loss resistance RP at the resonance, ohm.
    pub parallel_resistance_ohm: f64,
}

impl Tank {
    /// Resonance frequency 1 / (2π √(LC)), Hz: datasheet equation 1 without its terms for 1/Q² and
    /// for the comparator's delay, which are constant and below 2·10⁻³ at Q > 25.
    #[must_use]
    pub fn frequency_hz(&self) -> f64 {
        1.0 / (2.0 * PI * libm::sqrt(self.inductance_h * self.capacitance_f))
    }

    /// Quality factor RP √(C/L) (datasheet equation 11).
    #[must_use]
    pub fn quality_factor(&self) -> f64 {
        self.parallel_resistance_ohm * libm::sqrt(self.capacitance_f / self.inductance_h)
    }
}

impl<const N: usize> Sensors for [Tank; N] {
    fn frequency_hz(&self, channel: usize, _time_s: f64) -> f64 {
        self.get(channel).map_or(0.0, Tank::frequency_hz)
    }

    fn parallel_resistance_ohm(&self, channel: usize, _time_s: f64) -> f64 {
        self.get(channel)
            .map_or(0.0, |tank| tank.parallel_resistance_ohm)
    }

    fn quality_factor(&self, channel: usize, _time_s: f64) -> f64 {
        self.get(channel).map_or(0.0, Tank::quality_factor)
    }
}
