//! Measurement chain of the current: amplifier, reference, converter.

use core::f64::consts::TAU;

use crate::random::Stream;

/// Codes that are about eight times as wide as the others (erratum RP2040-E11).
const WIDE_CODES: [f64; 4] = [512.0, 1536.0, 2560.0, 3584.0];
const HALF_WIDTH: f64 = 4.0;
/// Number of codes of the converter.
const CODES: f64 = 4096.0;

/// Errors of one measurement chain from voltage to code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ConverterParameters {
    /// Nominal reference, V.
    pub reference_v: f64,
    /// Relative error of the reference, which drifts over weeks.
    pub reference_error: f64,
    /// Amplitude of the integral non-linearity, codes: a sine over the range, whose shape is a
    /// guess.
    pub nonlinearity_lsb: f64,
    /// Phase of the non-linearity's sine in mid-range, rad.
    pub nonlinearity_phase: f64,
    /// Noise of one sample, codes rms; white.
    pub noise_lsb: f64,
    /// Whether four codes are eight times as wide as the others.
    pub wide_codes: bool,
}

impl ConverterParameters {
    /// A converter whose only error is quantisation.
    pub const EXACT: Self = Self {
        reference_v: 3.3,
        reference_error: 0.0,
        nonlinearity_lsb: 0.0,
        nonlinearity_phase: 0.0,
        noise_lsb: 0.0,
        wide_codes: false,
    };

    /// Errors of the RP2040's converter, as published: 8 codes of non-linearity, wide codes, 2
    /// codes of noise.
    pub const RP2040: Self = Self {
        nonlinearity_lsb: 8.0,
        noise_lsb: 2.0,
        wide_codes: true,
        ..Self::EXACT
    };
}

/// An analog-to-digital converter with its noise.
#[derive(Clone, Debug)]
pub struct Converter {
    /// Errors of the chain; the reference may drift at any time.
    pub parameters: ConverterParameters,
    noise: Stream,
}

impl Converter {
    /// A converter with its own noise stream.
    #[must_use]
    pub fn new(parameters: ConverterParameters, seed: u64) -> Self {
        Self {
            parameters,
            noise: Stream::named(seed, "electrical.converter"),
        }
    }

    /// Code of a voltage.
    pub fn code(&mut self, volts: f64) -> u16 {
        let p = &self.parameters;
        let turns = volts / (p.reference_v * (1.0 + p.reference_error));
        let bow = if p.nonlinearity_lsb > 0.0 {
            p.nonlinearity_lsb * libm::sin(TAU * (turns - 0.5) + p.nonlinearity_phase)
        } else {
            0.0
        };
        let noise = if p.noise_lsb > 0.0 {
            p.noise_lsb * self.noise.normal()
        } else {
            0.0
        };
        let ideal = turns * CODES + bow + noise;
        let code = WIDE_CODES
            .into_iter()
            .find(|wide| p.wide_codes && (ideal - wide).abs() < HALF_WIDTH)
            .unwrap_or(ideal);
        // Within 12 bits after the clamp; NaN becomes 0.
        code.clamp(0.0, CODES - 1.0) as u16
    }
}

/// Voltage of a thermistor with 10 kiloohm at 25 degrees Celsius and a B constant of 3950 K, V. The
/// thermistor is connected to ground, with 10 kiloohm to 3.3 V.
#[must_use]
pub fn thermistor_v(celsius: f64) -> f64 {
    let ohm = 10e3 * libm::exp(3950.0 * (1.0 / (celsius + 273.15) - 1.0 / 298.15));
    3.3 * ohm / (ohm + 10e3)
}

/// An RC low-pass filter in front of a slow input.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Filter {
    /// Time constant, s.
    pub tau_s: f64,
    /// Present output.
    pub value: f64,
}

impl Filter {
    /// Filters the mean of the input over a duration.
    pub fn push(&mut self, mean: f64, duration_s: f64) {
        self.value += (mean - self.value) * -libm::expm1(-duration_s / self.tau_s);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_exact_converter_cuts_off() {
        let mut converter = Converter::new(ConverterParameters::EXACT, 1);
        assert_eq!(converter.code(1.65), 2048);
        assert_eq!(converter.code(1.65 + 0.9 * 3.3 / 4096.0), 2048);
        assert_eq!((converter.code(-1.0), converter.code(9.0)), (0, 4095));
    }

    #[test]
    fn wide_codes_are_wide_and_references_drift() {
        let mut converter = Converter::new(
            ConverterParameters {
                wide_codes: true,
                ..ConverterParameters::EXACT
            },
            1,
        );
        for code in [508.5, 512.0, 515.5] {
            assert_eq!(converter.code(code / 4096.0 * 3.3), 512);
        }
        assert_eq!(converter.code(517.5 / 4096.0 * 3.3), 517);
        converter.parameters.reference_error = 0.01;
        assert_eq!(converter.code(3.3 * 1.01 * 3_000.5 / 4096.0), 3_000);
    }

    #[test]
    fn a_filter_forgets_by_its_time() {
        let mut filter = Filter {
            tau_s: 1e-3,
            value: 0.0,
        };
        filter.push(1.0, 1e-3);
        assert!((filter.value - (1.0 - (-1.0_f64).exp())).abs() < 1e-12);
    }
}
