//! What is connected to the chip's inputs: the oscillating coils.

use core::f64::consts::PI;

/// The resonators on channels 0 to 3, as functions of time.
///
/// The model asks for moments of the conversion that has just ended, so at most one conversion (and
/// its settling) back from the present, and never for the future. It may ask for the same moment
/// more than once and in any order within a conversion.
///
/// Implemented for closures `Fn(channel, time_s) -> frequency_hz`, for arrays of fixed frequencies
/// and for arrays of [`Tank`]s; a channel beyond the end of an array does not oscillate.
pub trait Sensors {
    /// Free-running frequency of the resonator, Hz, 1 kHz to 10 MHz in use. Zero, negative or NaN:
    /// it does not oscillate.
    fn frequency_hz(&self, channel: usize, time_s: f64) -> f64;

    /// Parallel loss resistance RP at the resonance, ohm, 1 kΩ to 90 kΩ in use (datasheet 8.1.2).
    fn parallel_resistance_ohm(&self, channel: usize, time_s: f64) -> f64 {
        let _ = (channel, time_s);
        3_000.0
    }

    /// Quality factor; it sets how long the oscillation takes to settle (datasheet equations 10, 11).
    fn quality_factor(&self, channel: usize, time_s: f64) -> f64 {
        let _ = (channel, time_s);
        25.0
    }

    /// Cycles by which something from outside pulls the oscillation on (or back) during a
    /// conversion, beyond those of its own mean frequency: an interferer near the resonance, whose
    /// beat is too fast for the few moments at which [`frequency_hz`](Self::frequency_hz) is asked.
    /// Asked once for each conversion, in the order of time.
    fn pulled_cycles(&self, channel: usize, window: &Window) -> f64 {
        let _ = (channel, window);
        0.0
    }
}

/// A conversion's window, as [`Sensors::pulled_cycles`] receives it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Window {
    /// Its beginning, s.
    pub start_s: f64,
    /// Its length, s.
    pub length_s: f64,
    /// Mean frequency of the oscillation if nothing pulls it, Hz.
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

/// A coil, its capacitor and its losses, all constant.
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
    /// Capacitance C with the board's and the pin's, farad.
    pub capacitance_f: f64,
    /// Parallel loss resistance RP at the resonance, ohm.
    pub parallel_resistance_ohm: f64,
}

impl Tank {
    /// 1 / (2π √(LC)), Hz (datasheet equation 1 without its terms in 1/Q² and in the comparator's
    /// delay, both below 2·10⁻³ at Q > 25 and constant).
    #[must_use]
    pub fn frequency_hz(&self) -> f64 {
        1.0 / (2.0 * PI * libm::sqrt(self.inductance_h * self.capacitance_f))
    }

    /// RP √(C/L) (datasheet equation 11).
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
