//! Plant, press and coil current together, on a virtual clock.
//!
//! The state advances in steps of at most a millisecond; a step also ends where an input has a
//! kink. Creep, lag and heat advance by rules that are exact or conserve energy over any step, and
//! the balance of forces is solved at the end of the step. Within a step the frequency of the
//! sensing coil is a cubic in time, so a converter may read it at any time.
//!
//! The result does not depend on how the caller divides time: [`World::advance`] by ten times
//! 0.1 ms or once by 1 ms gives the same bits. Only inputs such as [`World::set_current`] end a
//! step early.

mod history;
mod plant;
mod shared;
mod truth;

use std::collections::VecDeque;

use ldc161x_sim::{Conversions, ExternalClock, SensorDrive, Settings, Time, Window};

use self::history::History;
use self::plant::{Inputs, Plant, PlantState};
pub use self::shared::SharedWorld;
pub use self::truth::Truth;
use crate::current::{Command, HARD_LIMIT};
use crate::mechanics::chain::{Chain, ChainState, LEAST_STABILITY};
use crate::mechanics::contact::Contact;
use crate::mechanics::load::Load;
use crate::mechanics::press::{Profile, Shake};
use crate::parameters::{ParameterError, Parameters, within};
use crate::random::Stream;
use crate::sensing_coil::interference::Oscillation;
use crate::switches::Switches;

/// Longest time by which a converter may read ahead of the world's clock.
const FURTHEST_AHEAD: Time = Time::from_ms(1_000);

/// Support of the sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Holder {
    /// A stand, which vibrates.
    #[default]
    Stand,
    /// A hand, which trembles.
    Hand,
}

/// Use of the plant in a simulation.
#[derive(Clone, Debug, PartialEq)]
pub struct Setup {
    /// Object pressed on the sensor.
    pub load: Load,
    /// Where and how it lies on the sensor.
    pub contact: Contact,
    /// Stand or hand.
    pub holder: Holder,
    /// Motion of the press.
    pub profile: Profile,
    /// Longest step, 10 µs to 10 ms. The default is 1 ms.
    pub step: Time,
}

impl Default for Setup {
    /// A rigid object far above the sensor, on a stand.
    fn default() -> Self {
        Self {
            load: Load::Rigid,
            contact: Contact::default(),
            holder: Holder::Stand,
            profile: Profile::at(-1e-3),
            step: Time::from_ms(1),
        }
    }
}

/// A plant with its load, its press and its coil current, at a virtual time.
///
/// ```
/// use ldc161x_sim::Time;
/// use palpate_sim::mechanics::{load::Load, press::Profile};
/// use palpate_sim::parameters::draw;
/// use palpate_sim::stack::{Disturbances, Stack};
/// use palpate_sim::switches::Switches;
/// use palpate_sim::world::{Setup, World};
///
/// let plant = draw(&Stack::builtin("ultrasoft")?, &Disturbances::builtin()?, 1);
/// let setup = Setup {
///     load: Load::Spring { n_per_m: 6e3 },
///     profile: Profile::at(-0.1e-3).then_move(1e-3, 2e-3),
///     ..Setup::default()
/// };
/// let mut world = World::new(&plant, Switches::all(), setup)?;
/// world.advance(Time::from_ms(2_000));
/// let soft = world.truth();
/// world.set_current(10.0);
/// world.advance(Time::from_ms(100));
/// assert!(world.truth().actuated_spring_n_per_m > soft.actuated_spring_n_per_m);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug)]
pub struct World {
    plant: Plant,
    inputs: Inputs,
    now: Time,
    /// The last computed state at or before now, and all later ones.
    states: VecDeque<PlantState>,
    history: History,
    adc_noise: Stream,
    oscillation: Oscillation,
}

impl World {
    /// A world at time zero, without current.
    ///
    /// # Errors
    /// [`ParameterError`] for invalid parameters, or for a plant whose actuated layer its own
    /// attraction would pull flat.
    pub fn new(
        parameters: &Parameters,
        switches: Switches,
        setup: Setup,
    ) -> Result<Self, ParameterError> {
        let effective = parameters.effective(&switches);
        Self::of(effective, setup)
    }

    /// A world of parameters as given, without switches.
    pub(crate) fn of(parameters: Parameters, setup: Setup) -> Result<Self, ParameterError> {
        parameters.check()?;
        check_setup(&setup)?;
        let chain = Chain::new(
            setup.load,
            parameters.press.frame_m_per_n,
            parameters.attraction.gradient_per_m,
            parameters.sensing,
            parameters.actuated,
            parameters.friction,
            parameters
                .contact
                .closing(&setup.contact, parameters.sensing.spring_n_per_m),
        );
        check_stability(&parameters, &chain)?;
        let shake = match setup.holder {
            Holder::Stand => parameters.press.vibration,
            Holder::Hand => parameters.press.tremor,
        };
        Ok(Self::start(parameters, chain, shake, setup))
    }

    fn start(parameters: Parameters, chain: Chain, shake: Shake, setup: Setup) -> Self {
        let adc_noise = Stream::named(parameters.seed, "adc_noise.samples");
        let plant = Plant::new(parameters, chain, shake, &setup);
        let inputs = Inputs {
            command: Command::constant(0.0),
            profile: setup.profile,
            jumps: plant.parameters.press.jumps.path(plant.parameters.seed),
        };
        let first = plant.step(&inputs, &plant.at_rest(), Time::ZERO);
        Self {
            plant,
            inputs,
            now: Time::ZERO,
            states: VecDeque::from([first]),
            history: History::default(),
            adc_noise,
            oscillation: Oscillation::default(),
        }
    }

    /// Current virtual time.
    #[must_use]
    pub fn now(&self) -> Time {
        self.now
    }

    /// Advances by a duration.
    pub fn advance(&mut self, duration: Time) {
        self.advance_to(self.now + duration);
    }

    /// Advances to `time`; a past time changes nothing.
    pub fn advance_to(&mut self, time: Time) {
        self.now = self.now.max(time);
        self.extend_to(self.now);
        while self.states.get(1).is_some_and(|next| next.time <= self.now) {
            self.states.pop_front();
        }
        self.history.forget_before(self.now);
    }

    // ---- inputs ----

    /// Sets the coil's current, A, at once. It is limited to the hardware limit, which is 1.5 times
    /// the stack's peak current, and to the current that the supply can drive. NaN and infinite
    /// values count as zero.
    pub fn set_current(&mut self, current_a: f64) {
        self.hold(Command::constant(sound(current_a)));
    }

    /// Sets the coil's current, as [`Self::set_current`], with the ripple of an external circuit, A
    /// rms, in place of the computed ripple. The given ripple acts whether the world's own ripple
    /// is enabled or not.
    pub fn set_current_with_ripple(&mut self, mean_a: f64, ripple_a: f64) {
        self.hold(Command::rippling(sound(mean_a), sound(ripple_a)));
    }

    fn hold(&mut self, command: Command) {
        if !self.inputs.command.rests_as(self.now, &command) {
            self.interrupt(|inputs, _| inputs.command = command);
        }
    }

    /// Ramps the coil's current linearly from its present value to `current_a`, A.
    pub fn ramp_current(&mut self, current_a: f64, duration: Time) {
        self.follow_current(&[(duration, current_a)]);
    }

    /// Moves the coil's current from its present value through these points, in straight lines:
    /// times from now on, in order, and currents, A.
    pub fn follow_current(&mut self, points: &[(Time, f64)]) {
        self.interrupt(|inputs, now| {
            let from = (now, inputs.command.at(now));
            let then = points
                .iter()
                .map(|&(after, current_a)| (now + after, sound(current_a)));
            inputs.command = Command::path(core::iter::once(from).chain(then).collect());
        });
    }

    /// Moves the press from its present position to `position_m` (see [`Profile`]) at a speed, and
    /// replaces the rest of its profile.
    pub fn move_press(&mut self, position_m: f64, speed_m_per_s: f64) {
        let position_m = sound(position_m);
        self.interrupt(|inputs, now| {
            let moved = inputs.profile.clone().until(now);
            inputs.profile = moved.then_move(position_m, speed_m_per_s);
        });
    }

    /// Sets the ambient temperature to `change_k` above that of calibration, K, limited to ±50. The
    /// change acts whether the world's own change is enabled or not.
    pub fn set_ambient(&mut self, change_k: f64) {
        let change_k = sound(change_k).clamp(-50.0, 50.0);
        self.interrupt(|_, _| {});
        self.plant.parameters.thermal.ambient_change_k = change_k;
    }

    /// Ends the present step now, changes the inputs, and solves the balance again.
    fn interrupt(&mut self, change: impl FnOnce(&mut Inputs, Time)) {
        let before = self.state();
        if let Some(base) = self.states.front() {
            self.history.rewind(base.time);
            if base.time < before.time {
                let segment = self.plant.segment(&self.inputs, base, &before);
                self.history.push(segment);
            }
        }
        change(&mut self.inputs, self.now);
        let after = self.plant.step(&self.inputs, &before, self.now);
        self.states.clear();
        self.states.push_back(after);
    }

    // ---- steps ----

    /// Adds steps until the last one ends at `time` or later.
    fn extend_to(&mut self, time: Time) {
        while let Some(last) = self.states.back().filter(|last| last.time < time) {
            let next = self.next_state(last);
            let segment = self.plant.segment(&self.inputs, last, &next);
            self.history.push(segment);
            self.states.push_back(next);
        }
    }

    /// State after the next step. A step in which contact is made, closed or lost ends at that time, so no
    /// step has a kink inside.
    fn next_state(&self, last: &PlantState) -> PlantState {
        let end = (last.time + self.plant.usual_step()).min(self.inputs.next_knot(last.time));
        let next = self.plant.step(&self.inputs, last, end);
        let side_of = |chain: &ChainState| (chain.in_contact(), self.plant.chain.is_closed(chain));
        let side = side_of(&last.chain);
        if last.touching || side_of(&next.chain) == side {
            return next;
        }
        let (mut same, mut other) = (last.time, end);
        while (other - same) > Time::from_ps(1) {
            let middle = Time::from_ps(same.as_ps() + (other - same).as_ps() / 2);
            let there = self.plant.step(&self.inputs, last, middle);
            if side_of(&there.chain) == side {
                same = middle;
            } else {
                other = middle;
            }
        }
        if same == last.time {
            return next;
        }
        let mut touching = self.plant.step(&self.inputs, last, same);
        touching.touching = true;
        touching
    }

    fn state(&self) -> PlantState {
        match self.states.front() {
            Some(base) if base.time < self.now => self.plant.step(&self.inputs, base, self.now),
            Some(base) => *base,
            // There is always a state; the plant at rest avoids a panic.
            None => self.plant.at_rest(),
        }
    }

    // ---- measurements of an instrument ----

    /// Frequency of the sensing coil at a past time, Hz; `None` if it has not been computed yet.
    /// Times longer ago than 0.6 s return the oldest known frequency.
    #[must_use]
    pub fn frequency_hz(&self, time_s: f64) -> Option<f64> {
        self.history.frequency_hz(time_s)
    }

    /// Frequency as [`Self::frequency_hz`], also for times up to a second ahead, assuming that no
    /// input changes.
    pub fn frequency_ahead_hz(&mut self, time_s: f64) -> Option<f64> {
        // One picosecond more, for the rounding of the time.
        let time = Time::from_secs_f64(time_s) + Time::from_ps(1);
        self.extend_to(time.min(self.now + FURTHEST_AHEAD));
        self.history.frequency_hz(time_s)
    }

    /// Cycles that the bridge's switching adds to the oscillation during a conversion (see
    /// [`crate::sensing_coil::interference`]), while the bridge drives the mean current of that
    /// time. Windows must come in order of time.
    pub fn pulled_cycles(&mut self, window: &Window) -> f64 {
        let span = (window.start_s, window.length_s);
        let [from, to] =
            [window.start_s, window.start_s + window.length_s].map(Time::from_secs_f64);
        let current_a = self.history.mean_current_a(from, to).unwrap_or(0.0);
        let parameters = &self.plant.parameters;
        let interferer = (current_a != 0.0).then(|| {
            let coil_ohm = self.states.front().map_or_else(
                || parameters.thermal.resistance_ohm,
                |state| parameters.thermal.coil_resistance_ohm(&state.thermal),
            );
            let bridge = parameters.current.bridge(current_a, coil_ohm);
            parameters.interference.nearest(&bridge, window.free_hz)
        });
        self.oscillation
            .follow(interferer.as_ref(), span, window.free_hz)
    }

    /// Quality factor and parallel resistance, ohm, of the tank at a frequency.
    #[must_use]
    pub fn losses(&self, frequency_hz: f64) -> (f64, f64) {
        let tank = &self.plant.tank;
        (
            tank.quality_factor(frequency_hz),
            tank.parallel_resistance_ohm(frequency_hz),
        )
    }

    /// Coil current as the instrument measures it now, from one sample of the ADC, A.
    pub fn measured_current_a(&mut self) -> f64 {
        let current_a = self.state().current_a;
        let chain = &self.plant.parameters.current;
        chain.reported_a(current_a, 1, &mut self.adc_noise)
    }

    /// Mean current over a past window as the instrument measures it, from `samples` samples, A.
    /// The window may reach back 0.6 s; an empty one gives the present current.
    pub fn reported_mean_current_a(&mut self, from: Time, to: Time, samples: u32) -> f64 {
        let mean_a = self.mean_current_a(from, to);
        let chain = &self.plant.parameters.current;
        chain.reported_a(mean_a, samples, &mut self.adc_noise)
    }

    /// Ripple of a mean current under the present coil and supply, A rms.
    #[must_use]
    pub fn ripple_a(&self, mean_a: f64) -> f64 {
        let chain = &self.plant.parameters.current;
        chain.ripple_a(mean_a, self.truth().coil_ohm)
    }

    /// Settings of a converter in this world, with its clock input at `clkin_hz`.
    #[must_use]
    pub fn chip_settings(&self, clkin_hz: f64) -> Settings {
        let Parameters { seed, ldc, .. } = &self.plant.parameters;
        let drive = if ldc.drive_shift {
            SensorDrive::default()
        } else {
            Settings::ideal().drive
        };
        Settings {
            // PCG's streams and the chip's own generator are unrelated, so they may share the seed.
            seed: *seed,
            temperature_c: self.truth().ambient_c,
            external_clock: Some(ExternalClock {
                relative_error: ldc.reference_clock_error,
                ..ExternalClock::exact(clkin_hz)
            }),
            conversions: Conversions {
                quantised: ldc.quantised,
                noise_at_1ms: ldc.white_noise_relative,
                ..Conversions::default()
            },
            drive,
            ..Settings::default()
        }
    }

    // ---- ground truth ----

    /// True state at the current time.
    #[must_use]
    pub fn truth(&self) -> Truth {
        Truth::of(&self.plant, &self.state())
    }

    /// True mean current over a past window, A.
    #[must_use]
    pub fn mean_current_a(&self, from: Time, to: Time) -> f64 {
        self.history
            .mean_current_a(from, to.min(self.now))
            .unwrap_or_else(|| self.state().current_a)
    }

    /// Parameters with the switches applied.
    #[must_use]
    pub fn parameters(&self) -> &Parameters {
        &self.plant.parameters
    }

    /// The load.
    #[must_use]
    pub fn load(&self) -> &Load {
        self.plant.chain.load()
    }

    /// Stiffness c_L of the load with its frame for small changes at a frequency, N/m: the
    /// reciprocal of their storage compliance, 1/(J′(f) + φ).
    ///
    /// The storage compliance is what an instrument sees to first order: a train of currents changes
    /// the sensing layer's deformation by −x g/W with the complex W = 1 + c_S (J* + φ) + c_S/c_D, and
    /// the line that is fitted takes the part in phase, Re(1/W), which equals 1/Re W except for the
    /// square of the phase. Compliances in series add, so φ is added for the frame.
    #[must_use]
    pub fn load_stiffness_n_per_m(&self, hertz: f64) -> f64 {
        let (load, chain) = (self.load(), self.state().chain);
        let load_m_per_n = load.storage_compliance_m_per_n(chain.load_m, hertz);
        1.0 / (load_m_per_n + self.plant.chain.frame_m_per_n())
    }

    /// Planned displacement of the press now, without shaking and jumps, m.
    #[must_use]
    pub fn planned_press_m(&self) -> f64 {
        self.inputs.profile.position_m(self.now)
    }

    /// Displacement of the press that compresses the sensing layer by `depth_m`, without creep,
    /// growth, attraction and current, m.
    #[must_use]
    pub fn press_for_depth_m(&self, depth_m: f64) -> f64 {
        let parameters = self.parameters();
        let force_n = parameters.sensing.spring_n_per_m * depth_m;
        let series = parameters.press.frame_m_per_n + 1.0 / parameters.actuated.spring_n_per_m;
        self.load().displacement_m(force_n) + depth_m + force_n * series
    }
}

/// Zero for NaN and infinite values.
fn sound(value: f64) -> f64 {
    if value.is_finite() { value } else { 0.0 }
}

fn check_setup(setup: &Setup) -> Result<(), ParameterError> {
    within("step in s", setup.step.as_secs_f64(), 1e-5, 1e-2)?;
    within("contact place_m", setup.contact.place_m, 0.0, 0.01)?;
    within("contact tilt_rad", setup.contact.tilt_rad, 0.0, 0.2)?;
    match setup.load {
        Load::Spring { n_per_m } => within("load n_per_m", n_per_m, 1.0, 1e10),
        Load::Hardening {
            n_per_m,
            cubic_n_per_m3,
        } => {
            within("load n_per_m", n_per_m, 1.0, 1e10)?;
            within("load cubic_n_per_m3", cubic_n_per_m3, 0.0, 1e20)
        }
        Load::Indented(object) => {
            within("load radius_m", object.radius_m, 1e-5, 0.1)?;
            let material = &object.material;
            within("load young_pa", material.young_pa, 1e3, 1e10)?;
            within("load poisson_ratio", material.poisson_ratio, 0.0, 0.5)?;
            within(
                "load thickness_m",
                material.thickness_m.unwrap_or(1.0),
                1e-4,
                1.0,
            )
        }
        Load::Viscoelastic { n_per_m, creep } => {
            within("load n_per_m", n_per_m, 1.0, 1e10)?;
            creep.iter().try_for_each(|mode| {
                within("load amplitude", mode.amplitude, 0.0, 10.0)?;
                // A mode without amplitude may leave its time constant at zero.
                let least_s = if mode.amplitude > 0.0 { 1e-3 } else { 0.0 };
                within("load tau_s", mode.tau_s, least_s, 1e6)
            })
        }
        Load::Rigid => Ok(()),
    }
}

/// Refuses a plant that the largest current would pull flat after full creep and softening.
fn check_stability(parameters: &Parameters, chain: &Chain) -> Result<(), ParameterError> {
    let current_a = HARD_LIMIT * parameters.current.peak_a;
    let attraction_n = parameters.attraction.n_per_a2 * current_a * current_a;
    let crept: f64 = parameters
        .actuated
        .creep
        .iter()
        .map(|mode| mode.amplitude)
        .sum();
    let compliance = (1.0 + crept) / parameters.actuated.spring_n_per_m;
    let stability = chain.stability(attraction_n, compliance);
    within(
        "stability of the actuated layer",
        stability,
        LEAST_STABILITY,
        1.0,
    )
}
