//! Effect of the bridge's edges on the oscillation of the sensing coil.
//!
//! The bridge switches some 62 500 times a second, so one of its harmonics always lies within half
//! of that from the resonance near 3 MHz. This harmonic induces a small voltage in the tank through
//! the mutual inductance of the coils. An oscillator under injection follows Adler's equation
//! (Adler 1946; Razavi 2004): the phase φ of the oscillation relative to the interferer follows
//!
//! dφ/dt = Δ − Λ sin φ,  Λ = (ω₀/2Q) V_tank/V_osc = ω₀ e/(2 V_osc)
//!
//! with Δ the difference between free oscillation and interferer, and e the induced voltage in
//! series with the coil, which the resonance raises to V_tank = Q e. For |Δ| up to Λ the oscillation
//! locks; beyond, its mean frequency is off by Δ − √(Δ² − Λ²), and its phase oscillates by Λ/Δ.
//!
//! Only the nearest harmonic is modelled. Its neighbours are a whole switching frequency further
//! off, where they shift the frequency by Λ²/2Δ: below 10⁻² Hz for any Λ/2π below 25 Hz.

use core::f64::consts::{PI, TAU};

/// Amplitude of the oscillation, V: the converter's specified minimum (datasheet SNOSCY9A, 8.1.5),
/// since an interferer shifts a weak oscillation most.
pub const OSCILLATION_V: f64 = 1.2;

/// Coupling of the bridge to the sensing coil.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct InterferenceParameters {
    /// Voltage induced in the sensing coil for a voltage across the drive coil, near the resonance,
    /// V/V, 0 to 1: mutual over own inductance (see [`mutual`](super::mutual)).
    pub volt_per_volt: f64,
    /// Duration of a bridge edge, s, 0 to 10⁻⁵.
    pub edge_s: f64,
}

/// The bridge as an interferer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bridge {
    /// Supply, V.
    pub supply_v: f64,
    /// Duty cycle, 0 to 1.
    pub duty: f64,
    /// Period, s.
    pub period_s: f64,
}

impl InterferenceParameters {
    /// Harmonic of the bridge that is nearest to a frequency.
    #[must_use]
    pub fn nearest(&self, bridge: &Bridge, free_hz: f64) -> Interferer {
        let harmonic = libm::round(free_hz * bridge.period_s).max(1.0);
        let frequency_hz = harmonic / bridge.period_s;
        // Pulses with finite edges have a sinc factor; its envelope is used, since its zeros are
        // not reliable.
        let edge = (1.0 / (PI * frequency_hz * self.edge_s)).min(1.0);
        let pulse_v =
            2.0 * bridge.supply_v / (PI * harmonic) * libm::sin(PI * harmonic * bridge.duty) * edge;
        Interferer {
            frequency_hz,
            lock_hz: frequency_hz * self.volt_per_volt * pulse_v / (2.0 * OSCILLATION_V),
        }
    }
}

/// A voltage in the tank near its resonance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Interferer {
    /// Frequency, Hz.
    pub frequency_hz: f64,
    /// Λ/2π, Hz: half the width of the lock range. Its sign is that of the voltage.
    pub lock_hz: f64,
}

/// Phase of the oscillation up to the last conversion.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Oscillation {
    at_s: f64,
    /// Phase, as a fraction of a cycle.
    phase: f64,
}

impl Oscillation {
    /// Advances by a conversion, and returns the cycles that the interferer has added. Before the
    /// first conversion the oscillation is free.
    pub fn follow(
        &mut self,
        interferer: Option<&Interferer>,
        (start_s, length_s): (f64, f64),
        free_hz: f64,
    ) -> f64 {
        let phase = self.phase + free_hz * (start_s - self.at_s);
        let pulled = interferer.map_or(0.0, |interferer| {
            let against = phase - interferer.frequency_hz * start_s;
            let detuning_hz = free_hz - interferer.frequency_hz;
            interferer.pull(against, detuning_hz, length_s)
        });
        *self = Self {
            at_s: start_s + length_s,
            phase: fraction(phase + free_hz * length_s + pulled),
        };
        pulled
    }
}

impl Interferer {
    /// Cycles that the interferer adds within `length_s` to an oscillation that starts at `phase`
    /// relative to it, in cycles, and is `detuning_hz` above it.
    ///
    /// Exact solution of Adler's equation. With φ/2 as the direction of a vector it is linear: v' =
    /// M v, M² = (Λ² − Δ²)/4, so v rotates or stretches in closed form.
    #[must_use]
    pub fn pull(&self, phase: f64, detuning_hz: f64, length_s: f64) -> f64 {
        let (delta, lock) = (TAU * detuning_hz, TAU * self.lock_hz);
        let square = delta * delta - lock * lock;
        let beats = square > 0.0;
        let rate = libm::sqrt(square.abs());
        // One beat of the unlocked oscillation is one turn of the phase.
        let whole = if beats {
            libm::floor(rate * length_s / TAU)
        } else {
            0.0
        };
        let left_s = if beats {
            length_s - whole * TAU / rate
        } else {
            length_s
        };
        let half = 0.5 * rate * left_s;
        // cos or cosh of `half`, and sin or sinh divided by half the rate.
        let (even, odd) = if half < 1e-9 {
            (1.0, left_s)
        } else if beats {
            (libm::cos(half), 2.0 * libm::sin(half) / rate)
        } else {
            // Division of both components by exp(half)/2 keeps the direction of v.
            let small = libm::exp(-2.0 * half);
            (1.0 + small, 2.0 * (1.0 - small) / rate)
        };
        let (sine, cosine) = (
            libm::sin(PI * fraction(phase)),
            libm::cos(PI * fraction(phase)),
        );
        let next_cosine = even * cosine + 0.5 * odd * (lock * cosine - delta * sine);
        let next_sine = even * sine + 0.5 * odd * (delta * cosine - lock * sine);
        let turned = libm::atan2(
            cosine * next_sine - sine * next_cosine,
            cosine * next_cosine + sine * next_sine,
        ) / PI;
        // Beating turns the phase one way only, here by up to a cycle. `atan2` covers ±1 cycle: a
        // turn that rounding carries past a cycle appears as almost a cycle backward.
        let turned = if beats && turned * delta.signum() < -0.5 {
            turned + 2.0 * delta.signum()
        } else {
            turned
        };
        let free = detuning_hz * length_s;
        turned + whole * delta.signum() - free
    }
}

/// Fractional part of a phase, cycles.
fn fraction(cycles: f64) -> f64 {
    cycles - libm::floor(cycles)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Adler's equation by the Runge-Kutta method.
    fn integrated(interferer: &Interferer, phase: f64, detuning_hz: f64, length_s: f64) -> f64 {
        let (delta, lock) = (TAU * detuning_hz, TAU * interferer.lock_hz);
        let rate = |angle: f64| delta - lock * angle.sin();
        let steps = 4_000;
        let h = length_s / f64::from(steps);
        let start = TAU * phase;
        let mut angle = start;
        for _ in 0..steps {
            let a = rate(angle);
            let b = rate(angle + 0.5 * h * a);
            let c = rate(angle + 0.5 * h * b);
            let d = rate(angle + h * c);
            angle += h / 6.0 * (a + 2.0 * b + 2.0 * c + d);
        }
        (angle - start) / TAU - detuning_hz * length_s
    }

    #[test]
    fn the_closed_form_is_the_integral() {
        for lock_hz in [15.0, -200.0, 3_000.0] {
            let interferer = Interferer {
                frequency_hz: 3e6,
                lock_hz,
            };
            for detuning_hz in [0.0, 1.0, -14.9, 15.0, 199.0, -201.0, 2_999.0, 9e3, -3e4] {
                for phase in [0.0, 0.13, 0.5, 0.77, 0.999] {
                    for length_s in [1e-6, 2.4e-4, 1e-3] {
                        let found = interferer.pull(phase, detuning_hz, length_s);
                        let exact = integrated(&interferer, phase, detuning_hz, length_s);
                        assert!(
                            (found - exact).abs() < 1e-6,
                            "{lock_hz} {detuning_hz} {phase} {length_s}: {found} {exact}"
                        );
                    }
                }
            }
        }
    }

    #[test]
    fn within_the_range_it_locks_and_beyond_it_pulls() {
        let interferer = Interferer {
            frequency_hz: 3e6,
            lock_hz: 100.0,
        };
        let mean_hz = |detuning_hz: f64| {
            let mut oscillation = Oscillation::default();
            let windows = (0..5_000).map(|index| (1e-3 * f64::from(index), 1e-3));
            let pulled: f64 = windows
                .map(|window| oscillation.follow(Some(&interferer), window, 3e6 + detuning_hz))
                .sum();
            detuning_hz + pulled / 5.0
        };
        assert!(mean_hz(80.0).abs() < 0.2, "locked: {}", mean_hz(80.0));
        let beat_hz = (300.0_f64.powi(2) - 100.0_f64.powi(2)).sqrt();
        assert!((mean_hz(300.0) - beat_hz).abs() < 0.2);
        assert!((mean_hz(-300.0) + beat_hz).abs() < 0.2);
    }

    #[test]
    fn harmonics_are_those_of_a_trapezoid() {
        let parameters = InterferenceParameters {
            volt_per_volt: 1e-4,
            edge_s: 0.25e-6,
        };
        let bridge = Bridge {
            supply_v: 12.0,
            duty: 0.31,
            period_s: 16e-6,
        };
        let found = parameters.nearest(&bridge, 2.99e6);
        assert_eq!(found.frequency_hz, 3e6);
        // Fourier integral of the pulse with zero edge time, by a sum.
        let steps = 200_000;
        let sum: f64 = (0..steps)
            .map(|step| (f64::from(step) + 0.5) / f64::from(steps) - 0.5)
            .filter(|at: &f64| at.abs() < 0.155)
            .map(|at| 2.0 * 12.0 * (TAU * 48.0 * at).cos() / f64::from(steps))
            .sum();
        let edge = 1.0 / (PI * 3e6 * 0.25e-6);
        let expected = 3e6 * 1e-4 * sum * edge / 2.4;
        assert!((found.lock_hz / expected - 1.0).abs() < 1e-3);
    }
}
