//! A layer of MSE as a spring that creeps.
//!
//! A Kelvin chain: an instant spring c in series with three Kelvin elements of compliance a/c and
//! time constant τ, so a constant force moves the layer by F/c · [1 + Σ a (1 − e^(−t/τ))]
//! (SOURCES.md 3.4 names three exponentials). All elements share one force, which keeps the balance
//! of the chain linear. The compliances a/c use the drawn spring c: neither field nor temperature
//! changes them (guess).

/// Number of modes of creep.
pub const MODES: usize = 3;

/// One mode of creep.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CreepMode {
    /// Long-term displacement of the mode, as a share of the instant displacement, 0 to 1.
    pub amplitude: f64,
    /// Time constant, s, 1 ms to 10⁶.
    pub tau_s: f64,
}

/// A layer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LayerParameters {
    /// Instant spring at the temperature of calibration and without field, N/m, 10 to 10⁸.
    pub spring_n_per_m: f64,
    /// d ln c / dT, 1/K, ±0.05.
    pub spring_per_kelvin: f64,
    /// Creep modes, from fast to slow.
    pub creep: [CreepMode; MODES],
}

impl LayerParameters {
    /// Spring at a temperature `warmer_k` above that of calibration, N/m.
    #[must_use]
    pub fn spring_at(&self, warmer_k: f64) -> f64 {
        self.spring_n_per_m * libm::exp(self.spring_per_kelvin * warmer_k)
    }

    /// Compliances of the modes, m/N.
    #[must_use]
    pub fn mode_compliances(&self) -> [f64; MODES] {
        self.creep.map(|mode| mode.amplitude / self.spring_n_per_m)
    }

    /// Decay factors of the modes after a time without force.
    #[must_use]
    pub fn decays(&self, duration_s: f64) -> [f64; MODES] {
        decays(&self.creep, duration_s)
    }
}

/// Decay factors of modes after a time without force.
pub(crate) fn decays<const N: usize>(creep: &[CreepMode; N], duration_s: f64) -> [f64; N] {
    creep.map(|mode| {
        if duration_s == 0.0 || mode.amplitude == 0.0 {
            1.0
        } else {
            libm::exp(-duration_s / mode.tau_s)
        }
    })
}

/// Displacement of a layer at the end of a step as a function of the force at that time: a known
/// offset, and a compliance. The integrator is the exponentially fitted midpoint rule,
///
/// z₁ = e z₀ + (1 − e) J (F₀ + F₁)/2,  e = exp(−h/τ),
///
/// exact for free decay and for constant force. It conserves energy exactly with the dissipation of
/// [`dissipated_j`]. For a ramp its error is (h/τ)²/12 of a mode's rate, 3·10⁻⁵ at h = 1 ms and
/// τ = 50 ms.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Response {
    /// Displacement without force, m.
    pub(crate) offset_m: f64,
    /// Compliance, m/N.
    pub(crate) compliance_m_per_n: f64,
}

/// Modes of a layer or a load with their decay factors over a step.
#[derive(Clone, Copy, Debug)]
pub(crate) struct KelvinStep<'a, const N: usize> {
    pub(crate) compliances: &'a [f64; N],
    pub(crate) decays: &'a [f64; N],
    /// Displacements of the modes at the beginning, m.
    pub(crate) modes_m: &'a [f64; N],
    /// Force at the beginning, N.
    pub(crate) force_n: f64,
}

impl<const N: usize> KelvinStep<'_, N> {
    fn each(&self) -> impl Iterator<Item = (f64, f64, f64)> + '_ {
        let modes = self.compliances.iter().zip(self.decays).zip(self.modes_m);
        modes.map(|((&compliance, &decay), &z)| (compliance, decay, z))
    }

    /// Response of the chain, given its spring at the end of the step; an infinite one leaves the
    /// modes alone.
    pub(crate) fn response(&self, spring_n_per_m: f64) -> Response {
        let mut response = Response {
            offset_m: 0.0,
            compliance_m_per_n: 1.0 / spring_n_per_m,
        };
        for (compliance, decay, z) in self.each() {
            let half = 0.5 * (1.0 - decay) * compliance;
            response.offset_m += decay * z + half * self.force_n;
            response.compliance_m_per_n += half;
        }
        response
    }

    /// Displacements of the modes at the end, given the force at the end, m.
    pub(crate) fn modes_after(&self, force_n: f64) -> [f64; N] {
        let mut after = [0.0; N];
        for (mode, (compliance, decay, z)) in after.iter_mut().zip(self.each()) {
            *mode = decay * z + 0.5 * (1.0 - decay) * compliance * (self.force_n + force_n);
        }
        after
    }

    /// Heat of the modes in the step that ends with `after`, J; never negative.
    ///
    /// Heat η (Δz)²/h of a dashpot η = τ_fit/J with τ_fit = (h/2) coth(h/2τ), under the midpoint
    /// rule (symbols as in [`Response`]).
    pub(crate) fn dissipated_j(&self, after: &[f64; N]) -> f64 {
        let mut heat_j = 0.0;
        for ((compliance, decay, z), after) in self.each().zip(after) {
            // A mode without compliance, or a step of zero length, does not move.
            if compliance > 0.0 && decay < 1.0 {
                let moved = after - z;
                heat_j += moved * moved * (1.0 + decay) / (2.0 * (1.0 - decay) * compliance);
            }
        }
        heat_j
    }
}

/// Energy stored in the modes, J.
pub(crate) fn stored_j<const N: usize>(compliances: &[f64; N], modes_m: &[f64; N]) -> f64 {
    compliances
        .iter()
        .zip(modes_m)
        .filter(|(compliance, _)| **compliance > 0.0)
        .map(|(compliance, z)| 0.5 * z * z / compliance)
        .sum()
}

/// Rate of modes under a force, m/s.
pub(crate) fn creep_rate<const N: usize>(
    creep: &[CreepMode; N],
    compliances: &[f64; N],
    modes_m: &[f64; N],
    force_n: f64,
) -> f64 {
    let modes = creep.iter().zip(compliances).zip(modes_m);
    modes
        .filter(|((mode, _), _)| mode.amplitude > 0.0)
        .map(|((mode, compliance), z)| (compliance * force_n - z) / mode.tau_s)
        .sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const LAYER: LayerParameters = LayerParameters {
        spring_n_per_m: 6e3,
        spring_per_kelvin: -0.004,
        creep: [
            CreepMode {
                amplitude: 0.05,
                tau_s: 0.05,
            },
            CreepMode {
                amplitude: 0.1,
                tau_s: 10.0,
            },
            CreepMode {
                amplitude: 0.02,
                tau_s: 1000.0,
            },
        ],
    };

    fn displacement(steps: u32, step_s: f64, force: impl Fn(f64) -> f64) -> f64 {
        let compliances = LAYER.mode_compliances();
        let decays = LAYER.decays(step_s);
        let mut modes_m = [0.0; MODES];
        for step in 0..steps {
            let at = |offset: u32| force(f64::from(step + offset) * step_s);
            let step = KelvinStep {
                compliances: &compliances,
                decays: &decays,
                modes_m: &modes_m,
                force_n: at(0),
            };
            modes_m = step.modes_after(at(1));
        }
        force(f64::from(steps) * step_s) / 6e3 + modes_m.iter().sum::<f64>()
    }

    fn creep(time_s: f64) -> f64 {
        LAYER
            .creep
            .iter()
            .map(|m| m.amplitude * (1.0 - (-time_s / m.tau_s).exp()))
            .sum()
    }

    #[test]
    fn creep_under_a_constant_force_is_exact_at_any_step() {
        for (steps, step_s) in [(30_000, 1e-3), (30, 1.0), (1, 30.0)] {
            let x = displacement(steps, step_s, |_| 2.0);
            let expected = 2.0 / 6e3 * (1.0 + creep(30.0));
            assert!((x / expected - 1.0).abs() < 1e-12, "{steps}");
        }
    }

    #[test]
    fn a_ramp_is_met_within_the_stated_error() {
        // displacement under F = r t: r/c [t + sum a (t - tau (1 - e^(-t/tau)))]
        let time_s: f64 = 0.2;
        let modes: f64 = LAYER
            .creep
            .iter()
            .map(|m| m.amplitude * (time_s - m.tau_s * (1.0 - (-time_s / m.tau_s).exp())))
            .sum();
        let x = displacement(200, 1e-3, |t| 10.0 * t);
        let expected = 10.0 / 6e3 * (time_s + modes);
        assert!(
            (x / expected - 1.0).abs() < 3e-5 * 0.05,
            "{}",
            x / expected - 1.0
        );
    }

    #[test]
    fn what_is_dissipated_is_what_is_lost() {
        let compliances = LAYER.mode_compliances();
        let decays = LAYER.decays(0.02);
        let modes_m = [3e-6, -1e-6, 8e-6];
        let step = KelvinStep {
            compliances: &compliances,
            decays: &decays,
            modes_m: &modes_m,
            force_n: 0.7,
        };
        let after = step.modes_after(1.9);
        let moved: f64 = after.iter().zip(modes_m).map(|(a, b)| a - b).sum();
        let work = 0.5 * (0.7 + 1.9) * moved;
        let gained = stored_j(&compliances, &after) - stored_j(&compliances, &modes_m);
        let heat = step.dissipated_j(&after);
        assert!(heat > 0.0);
        assert!(
            (work - gained - heat).abs() < 1e-14 * work.abs().max(heat),
            "{work} {gained} {heat}"
        );
        let response = step.response(6e3);
        let x = response.offset_m + response.compliance_m_per_n * 1.9;
        assert!((x - 1.9 / 6e3 - after.iter().sum::<f64>()).abs() < 1e-18);
    }
}
