//! Balance of mechanical work.

use super::chain::{Chain, ChainConditions, ChainState, Decays};
use super::layer::stored_j;

/// Work done on the springs since the start, by source, and the energy stored and dissipated, J.
///
/// Work in = stored + dissipated, to rounding: [`Energy::imbalance_j`]. Each term is a sum over steps of
/// the mean force times the change of displacement, which the integrator conserves exactly. In the press's
/// work, the load's instant spring and a closing gap count by the change of their potential energy, which
/// is exact where they are nonlinear.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Work of the press.
    pub press_j: f64,
    /// Work of thermal growth.
    pub growth_j: f64,
    /// Work of the attraction between the halves of the actuated layer.
    pub attraction_j: f64,
    /// Work of the actuating coils' pull on the load.
    pub pull_j: f64,
    /// Work of field and heat when they change loaded springs (see `changed_spring_j`).
    pub springs_j: f64,
    /// Heat from creep and friction.
    pub dissipated_j: f64,
    /// Energy stored in all springs.
    pub stored_j: f64,
}

impl Energy {
    /// Work done by all sources, J.
    #[must_use]
    pub fn work_j(&self) -> f64 {
        self.press_j + self.growth_j + self.attraction_j + self.pull_j + self.springs_j
    }

    /// Work done less the stored and dissipated energy, J; zero except for rounding.
    #[must_use]
    pub fn imbalance_j(&self) -> f64 {
        self.work_j() - self.stored_j - self.dissipated_j
    }

    /// Sum of the magnitudes of all terms, J: the scale of an imbalance.
    #[must_use]
    pub fn turnover_j(&self) -> f64 {
        let works = [
            self.press_j,
            self.growth_j,
            self.attraction_j,
            self.pull_j,
            self.springs_j,
        ];
        works.map(f64::abs).iter().sum::<f64>() + self.dissipated_j + self.stored_j
    }

    /// Energy balance after a step of the chain.
    pub(crate) fn after(
        &self,
        chain: &Chain,
        decays: &Decays,
        (from, before): (&ChainState, &ChainConditions),
        (to, after): (&ChainState, &ChainConditions),
    ) -> Self {
        let force_n = 0.5 * (from.load_force_n + to.load_force_n);
        let pull_n = 0.5 * (from.force_n + to.force_n) - force_n;
        let friction_n = 0.5 * (from.friction.force_n + to.friction.force_n);
        let layers = |state: &ChainState| state.sensing_m - state.gap_m + state.actuated_m;
        let layers_m = layers(to) - layers(from);
        let gap_work =
            chain.closing().stored_j(to.force_n) - chain.closing().stored_j(from.force_n);
        let load_work = chain.load().energy_j(to.load_m) - chain.load().energy_j(from.load_m);
        // A gap opens or closes without force.
        let pressed = (after.press_m - before.press_m) + (to.opening_m - from.opening_m);
        let moved = pressed - (to.load_m - from.load_m) - (to.gap_m - from.gap_m);
        let attraction_n = 0.5
            * (chain.attraction_n(before, from.actuated_m)
                + chain.attraction_n(after, to.actuated_m));
        Self {
            press_j: self.press_j + force_n * moved + load_work + gap_work,
            growth_j: self.growth_j + force_n * (after.growth_m - before.growth_m),
            attraction_j: self.attraction_j + attraction_n * (to.actuated_m - from.actuated_m),
            pull_j: self.pull_j + pull_n * layers_m,
            springs_j: self.springs_j
                + changed_spring_j(
                    (from.sensing_force_n(), before.sensing_spring_n_per_m),
                    (to.sensing_force_n(), after.sensing_spring_n_per_m),
                )
                + changed_spring_j(
                    (from.actuated_force_n, before.actuated_spring_n_per_m),
                    (to.actuated_force_n, after.actuated_spring_n_per_m),
                ),
            dissipated_j: self.dissipated_j
                + chain
                    .sensing_step(from, decays)
                    .dissipated_j(&to.sensing_creep_m)
                + chain
                    .actuated_step(from, decays)
                    .dissipated_j(&to.actuated_creep_m)
                + chain.load_step(from, decays).dissipated_j(&to.load_creep_m)
                + friction_n * (to.friction.slider_m - from.friction.slider_m),
            stored_j: chain_stored_j(chain, to, after),
        }
    }
}

/// Work of changing a loaded spring c, J: ½ e₀ e₁ Δc, e = force/c. Each pair is (force, spring).
fn changed_spring_j((force_0, spring_0): (f64, f64), (force_1, spring_1): (f64, f64)) -> f64 {
    0.5 * (force_0 / spring_0) * (force_1 / spring_1) * (spring_1 - spring_0)
}

/// Energy stored in all springs of the chain, J.
fn chain_stored_j(chain: &Chain, state: &ChainState, now: &ChainConditions) -> f64 {
    let square = |force_n: f64| 0.5 * force_n * force_n;
    chain.load().energy_j(state.load_m)
        + square(state.load_force_n) * chain.frame_m_per_n()
        + square(state.sensing_force_n()) / now.sensing_spring_n_per_m
        + square(state.actuated_force_n) / now.actuated_spring_n_per_m
        + chain.friction().stored_j(&state.friction)
        + chain.closing().stored_j(state.force_n)
        + stored_j(chain.sensing_modes(), &state.sensing_creep_m)
        + stored_j(chain.actuated_modes(), &state.actuated_creep_m)
        + stored_j(chain.load_modes(), &state.load_creep_m)
}
