//! Balance of the springs in series.

use super::contact::Closing;
use super::friction::{FrictionParameters, FrictionState};
use super::layer::{KelvinStep, LayerParameters, MODES, Response, creep_rate, decays};
use super::load::{LOAD_MODES, Load};

/// Least allowed stability: the actuated layer's stiffness with the gradient of the attraction,
/// relative to its stiffness without. Below this ratio the layer would snap shut.
/// [`crate::world::World::new`] refuses such a plant, so the balance never has to limit the ratio.
pub const LEAST_STABILITY: f64 = 0.1;

/// Constant properties of the chain.
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    load: Load,
    frame_m_per_n: f64,
    /// γ, relative growth of the attraction per compression of the actuated layer, 1/m.
    attraction_gradient_per_m: f64,
    sensing: LayerParameters,
    actuated: LayerParameters,
    friction: FrictionParameters,
    closing: Closing,
    sensing_modes: [f64; MODES],
    actuated_modes: [f64; MODES],
    load_modes: [f64; LOAD_MODES],
}

/// Conditions of the chain at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChainConditions {
    /// Spring c_S, N/m.
    pub sensing_spring_n_per_m: f64,
    /// Spring c_D, N/m.
    pub actuated_spring_n_per_m: f64,
    /// Attraction k I² at an uncompressed layer, N.
    pub attraction_n: f64,
    /// Pull of the actuating coils on a load in contact, N.
    pub pull_n: f64,
    /// Displacement x_0 of the press, m.
    pub press_m: f64,
    /// Growth of the sensor with temperature, m.
    pub growth_m: f64,
}

/// Forces and displacements of the chain.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ChainState {
    /// F through the sensor, N; never negative.
    pub force_n: f64,
    /// Force in the load's spring and in its frame, N: F less the pull of the actuating coils.
    pub load_force_n: f64,
    /// Friction beside the sensing layer.
    pub friction: FrictionState,
    /// Force c_D e_D in the actuated layer, N: F plus the attraction.
    pub actuated_force_n: f64,
    /// x_L without creep: compression of the load's instant spring, m.
    pub load_m: f64,
    /// x_S, m, with the gap under a tilted contact.
    pub sensing_m: f64,
    /// Displacement of the gap under a tilted contact, m.
    pub gap_m: f64,
    /// x_D, m.
    pub actuated_m: f64,
    /// Distance between load and sensor, m; zero in contact.
    pub opening_m: f64,
    /// Creep of the sensing layer, m.
    pub sensing_creep_m: [f64; MODES],
    /// Creep of the actuated layer, m.
    pub actuated_creep_m: [f64; MODES],
    /// Creep of the load, m.
    pub load_creep_m: [f64; LOAD_MODES],
}

impl ChainState {
    /// Whether load and sensor touch.
    #[must_use]
    pub fn in_contact(&self) -> bool {
        self.force_n > 0.0
    }

    /// Force in the sensing layer alone, N: F less the friction beside it.
    #[must_use]
    pub fn sensing_force_n(&self) -> f64 {
        self.force_n - self.friction.force_n
    }
}

/// Decay factors of all modes over a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Decays {
    pub(crate) sensing: [f64; MODES],
    pub(crate) actuated: [f64; MODES],
    pub(crate) load: [f64; LOAD_MODES],
}

/// Rates of change of the [`ChainConditions`], in their units per second.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Rates {
    pub(crate) sensing_spring: f64,
    pub(crate) actuated_spring: f64,
    pub(crate) attraction: f64,
    pub(crate) pull: f64,
    /// Rate of the press's displacement plus that of the sensor's growth, m/s.
    pub(crate) drive: f64,
    /// Whether load and sensor touch while these rates hold.
    pub(crate) in_contact: bool,
    /// Whether the friction's slider sticks while these rates hold.
    pub(crate) sticks: bool,
    /// Whether the gap under a tilted contact is closed while these rates hold.
    pub(crate) closed: bool,
}

/// The chain other than the sensing layer, at the end of a step.
#[derive(Clone, Copy, Debug)]
struct Rest {
    /// Response of the actuated layer with its attraction.
    actuated: Response,
    /// Response of the load's modes with the frame.
    stand: Response,
    /// Displacement x_0 of the press plus the growth of the sensor, m.
    drive_m: f64,
    pull_n: f64,
}

/// Forces and displacements for a given response of the sensing layer.
#[derive(Clone, Copy, Debug)]
struct Solution {
    force_n: f64,
    load_force_n: f64,
    load_m: f64,
    sensing_m: f64,
    gap_m: f64,
    opening_m: f64,
}

impl Solution {
    /// Displacement of the sensing layer itself, m.
    fn layer_m(&self) -> f64 {
        self.sensing_m - self.gap_m
    }
}

impl Chain {
    /// A chain at rest.
    pub(crate) fn new(
        load: Load,
        frame_m_per_n: f64,
        attraction_gradient_per_m: f64,
        sensing: LayerParameters,
        actuated: LayerParameters,
        friction: FrictionParameters,
        closing: Closing,
    ) -> Self {
        Self {
            load,
            frame_m_per_n,
            attraction_gradient_per_m,
            sensing,
            actuated,
            friction,
            closing,
            sensing_modes: sensing.mode_compliances(),
            actuated_modes: actuated.mode_compliances(),
            load_modes: load.mode_compliances(),
        }
    }

    /// The load.
    #[must_use]
    pub fn load(&self) -> &Load {
        &self.load
    }

    /// Friction beside the sensing layer.
    #[must_use]
    pub fn friction(&self) -> &FrictionParameters {
        &self.friction
    }

    /// Gap under a tilted contact.
    pub(crate) fn closing(&self) -> &Closing {
        &self.closing
    }

    /// Whether the contact is closed: the whole face touches.
    pub(crate) fn is_closed(&self, state: &ChainState) -> bool {
        self.closing.is_closed(state.force_n)
    }

    /// Compliance of the frame under the load, m/N.
    #[must_use]
    pub fn frame_m_per_n(&self) -> f64 {
        self.frame_m_per_n
    }

    pub(crate) fn decays(&self, duration_s: f64) -> Decays {
        Decays {
            sensing: self.sensing.decays(duration_s),
            actuated: self.actuated.decays(duration_s),
            load: decays(&self.load.creep(), duration_s),
        }
    }

    pub(crate) fn sensing_modes(&self) -> &[f64; MODES] {
        &self.sensing_modes
    }

    pub(crate) fn actuated_modes(&self) -> &[f64; MODES] {
        &self.actuated_modes
    }

    pub(crate) fn load_modes(&self) -> &[f64; LOAD_MODES] {
        &self.load_modes
    }

    /// Attraction between the halves of the actuated layer, N.
    #[must_use]
    pub fn attraction_n(&self, conditions: &ChainConditions, actuated_m: f64) -> f64 {
        conditions.attraction_n * (1.0 + self.attraction_gradient_per_m * actuated_m)
    }

    /// Stiffness of the actuated layer with the attraction's gradient, relative to without it.
    #[must_use]
    pub fn stability(&self, attraction_n: f64, compliance_m_per_n: f64) -> f64 {
        1.0 - attraction_n * self.attraction_gradient_per_m * compliance_m_per_n
    }

    pub(crate) fn sensing_step<'a>(
        &'a self,
        from: &'a ChainState,
        decays: &'a Decays,
    ) -> KelvinStep<'a, MODES> {
        KelvinStep {
            compliances: &self.sensing_modes,
            decays: &decays.sensing,
            modes_m: &from.sensing_creep_m,
            force_n: from.sensing_force_n(),
        }
    }

    pub(crate) fn actuated_step<'a>(
        &'a self,
        from: &'a ChainState,
        decays: &'a Decays,
    ) -> KelvinStep<'a, MODES> {
        KelvinStep {
            compliances: &self.actuated_modes,
            decays: &decays.actuated,
            modes_m: &from.actuated_creep_m,
            force_n: from.actuated_force_n,
        }
    }

    pub(crate) fn load_step<'a>(
        &'a self,
        from: &'a ChainState,
        decays: &'a Decays,
    ) -> KelvinStep<'a, LOAD_MODES> {
        KelvinStep {
            compliances: &self.load_modes,
            decays: &decays.load,
            modes_m: &from.load_creep_m,
            force_n: from.load_force_n,
        }
    }

    /// The balance at the end of a step, under the conditions at its end. The forces balance to
    /// rounding: only a hardening load has no closed-form solution, and a tilted contact is solved
    /// once for each of its stages.
    pub(crate) fn balance(
        &self,
        from: &ChainState,
        decays: &Decays,
        end: &ChainConditions,
    ) -> ChainState {
        let sensing_step = self.sensing_step(from, decays);
        let actuated_step = self.actuated_step(from, decays);
        let load_step = self.load_step(from, decays);
        let mut stand = load_step.response(f64::INFINITY);
        stand.compliance_m_per_n += self.frame_m_per_n;
        let sensing = sensing_step.response(end.sensing_spring_n_per_m);
        let actuated = actuated_step.response(end.actuated_spring_n_per_m);

        // x_D = ((F + A) S + b) / stability, attraction A, compliance S, offset b: A grows with x_D
        let stability = self.stability(end.attraction_n, actuated.compliance_m_per_n);
        let actuated_compliance = actuated.compliance_m_per_n / stability;
        let actuated_rest =
            (end.attraction_n * actuated.compliance_m_per_n + actuated.offset_m) / stability;

        let rest = Rest {
            actuated: Response {
                offset_m: actuated_rest,
                compliance_m_per_n: actuated_compliance,
            },
            stand,
            drive_m: end.press_m + end.growth_m,
            pull_n: end.pull_n,
        };
        let stuck = self.friction.stuck(&sensing, &from.friction);
        let mut solved = self.solve(&stuck, &rest);
        let mut friction = self.friction.stays(&from.friction, solved.layer_m());
        if let Some(left_n) = self.friction.slips(friction.force_n) {
            solved = self.solve(&FrictionParameters::moving(&sensing, left_n), &rest);
            friction = self.friction.moved(left_n, solved.layer_m());
        }
        let force_n = solved.force_n;
        let actuated_m = actuated_compliance * force_n + actuated_rest;
        let actuated_force_n = force_n + self.attraction_n(end, actuated_m);
        ChainState {
            force_n,
            load_force_n: solved.load_force_n,
            friction,
            actuated_force_n,
            load_m: solved.load_m,
            sensing_m: solved.sensing_m,
            gap_m: solved.gap_m,
            actuated_m,
            opening_m: solved.opening_m,
            sensing_creep_m: sensing_step.modes_after(force_n - friction.force_n),
            actuated_creep_m: actuated_step.modes_after(actuated_force_n),
            load_creep_m: load_step.modes_after(solved.load_force_n),
        }
    }

    /// The balance for this response of the sensing layer. The force rises with the press, so the
    /// contact is closed exactly if the force with an open gap would close it.
    fn solve(&self, sensing: &Response, rest: &Rest) -> Solution {
        if self.closing == Closing::default() {
            return self.solve_stage(sensing, rest, true);
        }
        let open = self.solve_stage(sensing, rest, false);
        if self.closing.is_closed(open.force_n) {
            self.solve_stage(sensing, rest, true)
        } else {
            open
        }
    }

    /// The balance while the contact is closed or not. A load pulled by P carries F − P, so
    /// x_L + frame (F − P) + (S + A) F = slack becomes a series of springs under slack − (S + A) P.
    fn solve_stage(&self, layer: &Response, rest: &Rest, closed: bool) -> Solution {
        let (gap_m, gap_m_per_n) = self.closing.branch(closed);
        let sensing = Response {
            offset_m: layer.offset_m + gap_m,
            compliance_m_per_n: layer.compliance_m_per_n + gap_m_per_n,
        };
        let layers = sensing.compliance_m_per_n + rest.actuated.compliance_m_per_n;
        let series = rest.stand.compliance_m_per_n
            + sensing.compliance_m_per_n
            + rest.actuated.compliance_m_per_n;
        let slack = rest.drive_m - sensing.offset_m - rest.actuated.offset_m - rest.stand.offset_m;
        let pull_n = if slack > 0.0 { rest.pull_n } else { 0.0 };
        let shared_m = slack.max(0.0) - layers * pull_n;
        // If the pull exceeds the force, the load is stretched, by the same law as in compression.
        let (load_m, load_force_n) = self.load.in_series(shared_m.abs(), series);
        let load_force_n = load_force_n.copysign(shared_m);
        let force_n = load_force_n + pull_n;
        Solution {
            force_n,
            load_force_n,
            load_m: load_m.copysign(shared_m),
            sensing_m: sensing.offset_m + sensing.compliance_m_per_n * force_n,
            gap_m: gap_m + gap_m_per_n * force_n,
            opening_m: (-slack).max(0.0),
        }
    }

    /// Rate of the sensing layer's displacement, m/s, from the differentiated balance.
    pub(crate) fn sensing_rate(
        &self,
        state: &ChainState,
        now: &ChainConditions,
        rates: &Rates,
    ) -> f64 {
        let (c_s, c_d) = (now.sensing_spring_n_per_m, now.actuated_spring_n_per_m);
        let sensing_creep = creep_rate(
            &self.sensing.creep,
            &self.sensing_modes,
            &state.sensing_creep_m,
            state.sensing_force_n(),
        );
        let part = if rates.sticks {
            self.friction.part_left(1.0 / c_s)
        } else {
            1.0
        };
        if !rates.in_contact {
            return part * sensing_creep;
        }
        let actuated_creep = creep_rate(
            &self.actuated.creep,
            &self.actuated_modes,
            &state.actuated_creep_m,
            state.actuated_force_n,
        );
        let load_creep = creep_rate(
            &self.load.creep(),
            &self.load_modes,
            &state.load_creep_m,
            state.load_force_n,
        );
        let stability = self.stability(now.attraction_n, 1.0 / c_d);
        let softening_s = state.sensing_force_n() * rates.sensing_spring / (c_s * c_s);
        let sensing_rest = part * (sensing_creep - softening_s);
        let growing = rates.attraction * (1.0 + self.attraction_gradient_per_m * state.actuated_m);
        let softening = state.actuated_force_n * rates.actuated_spring / (c_d * c_d);
        let actuated_rest = (actuated_creep + growing / c_d - softening) / stability;

        let load = self.load.compliance_m_per_n(state.load_m);
        let stand = load + self.frame_m_per_n;
        let (_, gap) = self.closing.branch(rates.closed);
        let series = stand + gap + part / c_s + 1.0 / (c_d * stability);
        let drive = rates.drive + stand * rates.pull;
        let force_rate = (drive - sensing_rest - actuated_rest - load_creep) / series;
        part * force_rate / c_s + gap * force_rate + sensing_rest
    }
}
