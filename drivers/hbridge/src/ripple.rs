//! PWM ripple, invisible to mid-pulse sampling.

/// The PWM ripple of the current, computed from supply and circuit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ripple {
    /// Supply voltage without load, V.
    pub(crate) open_v: f32,
    /// Resistance of the supply, ohm: it is in the circuit only while the supply drives.
    pub(crate) source_ohm: f32,
    /// Resistance of coil and bridge, ohm.
    pub(crate) resistance_ohm: f32,
    pub(crate) inductance_h: f32,
    pub(crate) period_s: f32,
}

impl Ripple {
    /// Mean square of the ripple about a mean current, A². The mean square of the whole current is
    /// `mean_a² + square_a2`; use it for an effect proportional to the square of the current.
    ///
    /// A coil that is driven for the fraction d = R I/V of a period and shorted for the remaining
    /// time has a triangular ripple of R I (1 − d) T/L, peak to peak, about its mean; its variance
    /// is a twelfth of the peak-to-peak value's square. V is the supply voltage less the drop in
    /// the supply's own resistance while the supply drives. Since the resistance bends the
    /// triangle, the result is off by up to 10 % for R T/L below one half.
    #[must_use]
    pub fn square_a2(&self, mean_a: f32) -> f32 {
        let drop_v = mean_a.abs() * self.resistance_ohm;
        let driven_v = self.open_v - mean_a.abs() * self.source_ohm;
        // Negated, so that the ripple is zero if a value is NaN.
        if !(drop_v > 0.0 && drop_v < driven_v) {
            return 0.0;
        }
        let shorted = 1.0 - drop_v / driven_v;
        let peak_to_peak_a = drop_v * shorted * self.period_s / self.inductance_h;
        peak_to_peak_a * peak_to_peak_a / 12.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_hand_counted_triangle() {
        let ripple = Ripple {
            open_v: 12.0,
            source_ohm: 0.0,
            resistance_ohm: 0.6,
            inductance_h: 20e-6,
            period_s: 16e-6,
        };
        // 10 A need the supply half of the time: 6 V for 8 us on 20 uH are 2.4 A; 2.4²/12 = 0.48.
        assert!((ripple.square_a2(10.0) - 0.48).abs() < 1e-6);
        assert!((ripple.square_a2(-10.0) - 0.48).abs() < 1e-6);
        for none in [0.0, 20.0, 1e9, f32::NAN, f32::INFINITY] {
            assert_eq!(ripple.square_a2(none), 0.0);
        }
        // A supply of 0.2 ohm leaves 10 V, and the coil takes 5 V: 5 V for 8 us are 2 A; 2²/12 A².
        let behind_resistance = Ripple {
            source_ohm: 0.2,
            resistance_ohm: 0.5,
            ..ripple
        };
        assert!((behind_resistance.square_a2(10.0) - 1.0 / 3.0).abs() < 1e-6);
    }
}
