//! Drive current and amplitude of the oscillation (datasheet 8.1.5).

use core::f64::consts::PI;

/// Nominal sensor current of the 32 codes of IDRIVEx, µA (datasheet table 42).
const DRIVE_CURRENTS_UA: [u16; 32] = [
    16, 18, 20, 23, 28, 32, 40, 46, 52, 59, 72, 82, 95, 110, 127, 146, 169, 195, 212, 244, 297,
    342, 424, 489, 551, 635, 763, 880, 1017, 1173, 1355, 1563,
];

/// Peak amplitude above which the chip reports ERR_AHE, V (datasheet table 25).
pub(crate) const AMPLITUDE_HIGH_V: f64 = 1.8;
/// Peak amplitude below which the chip reports ERR_ALE, V (datasheet table 25).
pub(crate) const AMPLITUDE_LOW_V: f64 = 1.2;

const LARGEST_CODE: u8 = 31;

/// Nominal current of an IDRIVEx code, A. Codes beyond 31 count as 31.
pub(crate) fn drive_current_a(code: u8) -> f64 {
    let microamperes = DRIVE_CURRENTS_UA
        .get(usize::from(code.min(LARGEST_CODE)))
        .copied()
        .unwrap_or(0);
    f64::from(microamperes) * 1e-6
}

/// Settled peak amplitude of the oscillation, V: 4 RP I / π (datasheet equation 12, SNOA950).
pub(crate) fn amplitude_v(parallel_resistance_ohm: f64, current_a: f64) -> f64 {
    4.0 * parallel_resistance_ohm * current_a / PI
}

/// Drive code that the automatic calibration selects: the highest code with an amplitude below 1.8
/// V. SNOA950 recommends this code for manual selection; that the chip selects it too is a guess.
pub(crate) fn calibrated_code(parallel_resistance_ohm: f64) -> u8 {
    (0..=LARGEST_CODE)
        .rev()
        .find(|&code| {
            amplitude_v(parallel_resistance_ohm, drive_current_a(code)) < AMPLITUDE_HIGH_V
        })
        .unwrap_or(0)
}

/// Drive code after one amplitude correction: one step towards an amplitude of 1.2 V to 1.8 V
/// (datasheet 8.1.5.4; the size of the step is a guess).
pub(crate) fn corrected_code(code: u8, amplitude_v: f64) -> u8 {
    if amplitude_v > AMPLITUDE_HIGH_V {
        code.saturating_sub(1)
    } else if amplitude_v < AMPLITUDE_LOW_V {
        code.saturating_add(1).min(LARGEST_CODE)
    } else {
        code
    }
}

/// Build-up of a sensor's oscillation since its activation.
///
/// The envelope of a parallel resonator driven at its resonance approaches its final value with the
/// time constant Q/(π f).
#[derive(Clone, Copy, Debug)]
pub(crate) struct BuildUp {
    /// Final amplitude with the drive current of conversions, V.
    pub(crate) settled_v: f64,
    /// Final amplitude with the drive current during activation, V: the largest current in
    /// full-current mode, `settled_v` in low-power mode (datasheet 8.1.4.2).
    pub(crate) driven_v: f64,
    /// Time constant of the envelope, s.
    pub(crate) time_constant_s: f64,
}

impl BuildUp {
    pub(crate) fn time_constant_s(quality_factor: f64, frequency_hz: f64) -> f64 {
        quality_factor / (PI * frequency_hz)
    }

    /// Amplitude after an activation of `settle_s`, followed by `later_s` of conversions, V. During
    /// activation the chip limits the amplitude to the settled one.
    pub(crate) fn amplitude_v(&self, settle_s: f64, later_s: f64) -> f64 {
        let risen_v = self.driven_v * (1.0 - self.left_after(settle_s));
        let missing_v = (self.settled_v - risen_v).max(0.0);
        self.settled_v - missing_v * self.left_after(later_s)
    }

    fn left_after(&self, time_s: f64) -> f64 {
        let decay = time_s / self.time_constant_s;
        // e⁻⁴⁰ is below the resolution of the amplitude. A NaN time constant (no oscillation) also
        // gives 0.
        if decay < 40.0 { libm::exp(-decay) } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_of_currents_agrees_with_the_table_of_resistances() {
        // For each current, table 42 lists the RP for 1.2 V and for 1.8 V; equation 12 must relate
        // them. Checked at both ends and in the middle, within the table's rounding of the current.
        for (code, least_kohm, largest_kohm) in [
            (0, 60.0, 90.0),
            (9, 16.1, 23.6),
            (15, 6.46, 9.69),
            (16, 5.58, 8.35),
            (19, 3.86, 5.35),
            (25, 1.48, 2.19),
            (31, 0.60, 0.90),
        ] {
            let low = amplitude_v(least_kohm * 1e3, drive_current_a(code));
            let high = amplitude_v(largest_kohm * 1e3, drive_current_a(code));
            assert!((low - 1.2).abs() < 0.03, "code {code}: {low} V");
            assert!((high - 1.8).abs() < 0.14, "code {code}: {high} V");
        }
    }

    #[test]
    fn the_calibration_takes_the_highest_code_below_the_limit() {
        for parallel_resistance_ohm in [600.0, 1e3, 3e3, 10e3, 85e3] {
            let code = calibrated_code(parallel_resistance_ohm);
            assert!(amplitude_v(parallel_resistance_ohm, drive_current_a(code)) < 1.8);
            if code < 31 {
                assert!(amplitude_v(parallel_resistance_ohm, drive_current_a(code + 1)) >= 1.8);
            }
        }
        assert_eq!(calibrated_code(1e6), 0, "no code is low enough");
    }

    #[test]
    fn the_datasheet_settling_rule_leaves_four_percent() {
        // Equation 10 requires a settling of Q/f, which is π time constants: 1 - e^-π = 0.957.
        let time_constant_s = BuildUp::time_constant_s(25.0, 3e6);
        let rise = BuildUp {
            settled_v: 1.5,
            driven_v: 1.5,
            time_constant_s,
        };
        let reached = rise.amplitude_v(25.0 / 3e6, 0.0) / 1.5;
        assert!((reached - 0.9568).abs() < 1e-3, "{reached}");
        assert!((rise.amplitude_v(1.0, 0.0) - 1.5).abs() < 1e-12);
    }
}
