//! The plant as a function: from its state at one moment to its state at the next.

use ldc161x_sim::Time;

use super::Setup;
use super::history::HistorySegment;
use crate::current::{Command, effective_current_a};
use crate::magnetorheological::Play;
use crate::mechanics::chain::{Chain, ChainConditions, ChainState, Decays, Rates};
use crate::mechanics::energy::Energy;
use crate::mechanics::press::{Profile, Shake};
use crate::parameters::Parameters;
use crate::sensing_coil::tank::{Resonance, SensingTank, TankState};
use crate::thermal::ThermalState;

/// External inputs of the plant, as functions of time.
#[derive(Clone, Debug)]
pub(super) struct Inputs {
    pub(super) command: Command,
    pub(super) profile: Profile,
    /// Jumps of the press in addition to its profile.
    pub(super) jumps: Profile,
}

impl Inputs {
    /// Time of the next kink of an input after `time`.
    pub(super) fn next_knot(&self, time: Time) -> Time {
        let knots = [
            self.command.next_knot(time),
            self.profile.next_knot(time),
            self.jumps.next_knot(time),
        ];
        knots.into_iter().flatten().min().unwrap_or(Time::MAX)
    }

    /// Displacement of the press without shaking, m.
    fn press_m(&self, time: Time) -> f64 {
        self.profile.position_m(time) + self.jumps.position_m(time)
    }
}

/// Full state: together with the inputs, it determines the future.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct PlantState {
    pub(super) time: Time,
    pub(super) current_a: f64,
    /// Effective current, A: the root mean square of current and ripple, for effects that depend on
    /// the square of the current.
    pub(super) effective_a: f64,
    pub(super) thermal: ThermalState,
    pub(super) play: Play,
    pub(super) stiffening: f64,
    /// ε at the present temperature, under the contact.
    strength: f64,
    /// Velocity of the shaking, m/s.
    shaking_m_per_s: f64,
    resonance: Resonance,
    pub(super) conditions: ChainConditions,
    pub(super) chain: ChainState,
    pub(super) energy: Energy,
    /// Whether contact is just being made, closed or lost: the next step may then start in the other
    /// contact state.
    pub(super) touching: bool,
}

/// One drawn plant with precomputed quantities.
#[derive(Clone, Debug)]
pub(super) struct Plant {
    /// Parameters with the switches applied.
    pub(super) parameters: Parameters,
    pub(super) chain: Chain,
    pub(super) tank: SensingTank,
    pub(super) shake: Shake,
    /// Stiffening under the contact relative to that in the centre.
    place: f64,
    /// Usual step length, with the decay factors of the creep.
    usual: (Time, Decays),
}

impl Plant {
    pub(super) fn new(parameters: Parameters, chain: Chain, shake: Shake, setup: &Setup) -> Self {
        let step = setup.step;
        Self {
            place: parameters.contact.stiffening(&setup.contact),
            tank: SensingTank::new(&parameters.tank).facing(parameters.object.reflection),
            usual: (step, chain.decays(step.as_secs_f64())),
            parameters,
            chain,
            shake,
        }
    }

    pub(super) fn usual_step(&self) -> Time {
        self.usual.0
    }

    fn decays(&self, duration: Time) -> Decays {
        let (usual, decays) = &self.usual;
        if duration == *usual {
            return *decays;
        }
        self.chain.decays(duration.as_secs_f64())
    }

    /// Untouched plant at time zero.
    pub(super) fn at_rest(&self) -> PlantState {
        PlantState {
            thermal: self.parameters.thermal.at_rest(),
            conditions: ChainConditions {
                sensing_spring_n_per_m: self.parameters.sensing.spring_n_per_m,
                actuated_spring_n_per_m: self.parameters.actuated.spring_n_per_m,
                ..ChainConditions::default()
            },
            ..PlantState::default()
        }
    }

    /// State at `to`. If `to` is the state's own time, this is the immediate effect of a jump of
    /// the inputs: the balance is solved again, while creep, lag and temperatures stay.
    pub(super) fn step(&self, inputs: &Inputs, from: &PlantState, to: Time) -> PlantState {
        let duration = to - from.time;
        let duration_s = duration.as_secs_f64();
        let p = &self.parameters;

        let resistance_ohm = p.thermal.coil_resistance_ohm(&from.thermal);
        let limit_a = p.current.limit_a(resistance_ohm);
        let current_a = inputs.command.at(to).clamp(-limit_a, limit_a);
        let effective_a = match inputs.command.ripple_a {
            Some(ripple_a) => effective_current_a(current_a, ripple_a),
            None => p.current.effective_a(current_a, resistance_ohm),
        };
        let (i0, i1) = (from.effective_a, effective_a);
        let square_a2 = (i0 * i0 + i0 * i1 + i1 * i1) / 3.0;
        let thermal = p.thermal.advance(&from.thermal, square_a2, duration_s);

        let (play, stiffening) = self.stiffen(from, effective_a, duration_s);
        let strength = self.place * p.magnetorheological.strength(thermal.pad_k);
        let (shaken_m, shaking_m_per_s) = self.shake.at(to.as_secs_f64());
        let softened = p.actuated.spring_at(thermal.pad_k);
        let conditions = ChainConditions {
            sensing_spring_n_per_m: p.sensing.spring_at(thermal.pad_k),
            actuated_spring_n_per_m: softened * (1.0 + strength * stiffening),
            attraction_n: p.attraction.n_per_a2 * effective_a * effective_a,
            pull_n: p.object.n_per_a2 * effective_a * effective_a,
            press_m: inputs.press_m(to) + shaken_m,
            growth_m: p.thermal.growth_m_per_k * thermal.pad_k,
        };
        let decays = self.decays(duration);
        let chain = self.chain.balance(&from.chain, &decays, &conditions);
        let (before, after) = ((&from.chain, &from.conditions), (&chain, &conditions));
        let energy = from.energy.after(&self.chain, &decays, before, after);
        let resonance = self.tank.resonance(&TankState {
            apparent_m: self.apparent_m(chain.sensing_m, effective_a),
            displacement_m: chain.sensing_m,
            warmer_k: thermal.pad_k,
            opening_m: chain.opening_m,
            object: self.object_part(effective_a),
        });
        PlantState {
            time: to,
            current_a,
            effective_a,
            thermal,
            play,
            stiffening,
            strength,
            shaking_m_per_s,
            resonance,
            conditions,
            chain,
            energy,
            touching: false,
        }
    }

    fn saturation(&self, current_a: f64) -> f64 {
        let relative = current_a / self.parameters.current.peak_a;
        self.parameters.magnetorheological.saturation(relative)
    }

    fn stiffen(&self, from: &PlantState, current_a: f64, duration_s: f64) -> (Play, f64) {
        let law = &self.parameters.magnetorheological;
        let (before, after) = (
            self.saturation(from.effective_a),
            self.saturation(current_a),
        );
        let turned = from.effective_a * current_a < 0.0;
        // A current that changes its sign passes zero field.
        let play = if turned {
            from.play.follow(0.0)
        } else {
            from.play
        }
        .follow(after);
        let targets = (law.target(before, from.play), law.target(after, play));
        (play, law.relax(from.stiffening, targets, duration_s))
    }

    /// Apparent displacement of the sensing layer, m: the true one less the crosstalk X (I/I_peak)²
    /// (1 + g x_S/depth).
    pub(super) fn apparent_m(&self, sensing_m: f64, current_a: f64) -> f64 {
        let (flat_m, slope) = self.crosstalk(current_a);
        sensing_m - flat_m * (1.0 + slope * sensing_m)
    }

    /// Remaining share of the reflection of the load's face: 1 − s (I/I_peak)².
    fn object_part(&self, current_a: f64) -> f64 {
        let relative = current_a / self.parameters.current.peak_a;
        1.0 - self.parameters.object.lost_at_peak * relative * relative
    }

    /// X (I/I_peak)², m, and g/depth, 1/m.
    fn crosstalk(&self, current_a: f64) -> (f64, f64) {
        let crosstalk = &self.parameters.crosstalk;
        let relative = current_a / self.parameters.current.peak_a;
        (
            crosstalk.at_peak_m * relative * relative,
            crosstalk.slope_per_press_depth / self.parameters.press.depth_m,
        )
    }

    /// Frequency of the tank over a step, as a cubic through its values and rates at both ends.
    pub(super) fn segment(
        &self,
        inputs: &Inputs,
        from: &PlantState,
        to: &PlantState,
    ) -> HistorySegment {
        let slopes = Slopes::over(inputs, (from, to), &self.chain);
        HistorySegment::new(
            (from.time, to.time),
            (from.current_a, to.current_a),
            (
                from.resonance.frequency_hz,
                self.frequency_rate(from, &slopes),
            ),
            (to.resonance.frequency_hz, self.frequency_rate(to, &slopes)),
        )
    }

    /// Rate of the frequency at a node, Hz/s, within a step that starts or ends there.
    fn frequency_rate(&self, state: &PlantState, slopes: &Slopes) -> f64 {
        let sensing = self.sensing_rate(state, slopes);
        let (flat_m, slope) = self.crosstalk(state.effective_a);
        let flat_rate =
            2.0 * self.parameters.crosstalk.at_peak_m * state.effective_a * slopes.current
                / (self.parameters.current.peak_a * self.parameters.current.peak_a);
        let apparent =
            sensing * (1.0 - flat_m * slope) - flat_rate * (1.0 + slope * state.chain.sensing_m);
        state.resonance.per_apparent * apparent
            + state.resonance.per_displacement * sensing
            + state.resonance.per_kelvin * slopes.pad
            + state.resonance.per_opening * slopes.opening
            + state.resonance.per_object * self.object_rate(state, slopes)
    }

    /// Rate of [`Self::object_part`], per second.
    fn object_rate(&self, state: &PlantState, slopes: &Slopes) -> f64 {
        let peak_a = self.parameters.current.peak_a;
        -2.0 * self.parameters.object.lost_at_peak * state.effective_a * slopes.current
            / (peak_a * peak_a)
    }

    /// Rate of the sensing layer's displacement at a node, m/s.
    fn sensing_rate(&self, state: &PlantState, slopes: &Slopes) -> f64 {
        let law = &self.parameters.magnetorheological;
        let stiffening = if law.lag_s > 0.0 {
            let target = law.target(self.saturation(state.effective_a), state.play);
            (target - state.stiffening) / law.lag_s
        } else {
            slopes.stiffening
        };
        let warming = self.parameters.actuated.spring_per_kelvin * slopes.pad;
        let hardening = state.strength * stiffening / (1.0 + state.strength * state.stiffening);
        let k = self.parameters.attraction.n_per_a2;
        let rates = Rates {
            sensing_spring: slopes.sensing_spring,
            actuated_spring: state.conditions.actuated_spring_n_per_m * (hardening + warming),
            attraction: 2.0 * k * state.effective_a * slopes.current,
            pull: 2.0 * self.parameters.object.n_per_a2 * state.effective_a * slopes.current,
            drive: slopes.press + state.shaking_m_per_s + slopes.growth,
            in_contact: slopes.in_contact,
            sticks: slopes.sticks,
            closed: slopes.closed,
        };
        self.chain
            .sensing_rate(&state.chain, &state.conditions, &rates)
    }
}

/// Mean rates over a step, per second, of quantities that are linear or nearly so within it.
#[derive(Clone, Copy, Debug)]
struct Slopes {
    current: f64,
    stiffening: f64,
    press: f64,
    growth: f64,
    opening: f64,
    pad: f64,
    sensing_spring: f64,
    /// Whether load and sensor touch: a step that starts where contact is made or lost takes the
    /// contact state of its end.
    in_contact: bool,
    /// Whether the friction's slider sticks in the step.
    sticks: bool,
    /// Whether a tilted contact is closed in the step.
    closed: bool,
}

impl Slopes {
    fn over(inputs: &Inputs, (from, to): (&PlantState, &PlantState), chain: &Chain) -> Self {
        let duration_s = (to.time - from.time).as_secs_f64();
        let slope = |before: f64, after: f64| (after - before) / duration_s;
        let (before, after) = (&from.conditions, &to.conditions);
        Self {
            current: slope(from.effective_a, to.effective_a),
            stiffening: slope(from.stiffening, to.stiffening),
            // Profile and jumps only: shaking has its own velocity.
            press: slope(inputs.press_m(from.time), inputs.press_m(to.time)),
            growth: slope(before.growth_m, after.growth_m),
            opening: slope(from.chain.opening_m, to.chain.opening_m),
            pad: slope(from.thermal.pad_k, to.thermal.pad_k),
            sensing_spring: slope(before.sensing_spring_n_per_m, after.sensing_spring_n_per_m),
            in_contact: to.chain.in_contact(),
            sticks: !to.chain.friction.slipped,
            closed: chain.is_closed(&to.chain),
        }
    }
}
