//! A touch sensor: coils under a pressed layer, as a converter reads them.

use core::f64::consts::{PI, TAU};
use std::sync::Arc;

use super::coil::{Moved, Reading, mutual_h};
use super::draw::{TouchCoil, TouchParameters};
use super::grid::Demand;
use super::indenter::Indenter;
use super::layer::Layer;
use super::layout::Layout;
use super::network::{Complex, Network, Tank, frequency_hz};
use super::press::{Contacts, GRID_BITS, Heights, Pressed};
use super::quadrature::panels;
use crate::mechanics::layer::{KelvinStep, MODES};
use crate::random::Stream;
use crate::sensing_coil::CoilDesign;
use crate::sensing_coil::integral::CoilIntegral;
use crate::stack::document::FileError;

/// Noise of a word by whole counts, times RCOUNT (ldc161x-sim, "The counter").
const QUANTISATION: f64 = 0.018;

/// Reflection of a coil's field at steel: (μk − γ)/(μk + γ) with γ² = jωμμ0σ for μ = 100, 10⁷ S/m,
/// 5 MHz and k = 300/m. Eddy currents outweigh the iron.
const STEEL: f64 = -0.75;

/// A sensor.
#[derive(Clone, Debug)]
pub struct TouchSensor {
    parameters: TouchParameters,
    heights: Heights,
    coils: Vec<CoilState>,
}

/// A coil as it is read.
#[derive(Clone, Debug)]
struct CoilState {
    reading: Reading,
    /// Inductance without press, H, with the currents in the other coils.
    at_rest_h: f64,
    /// Change of that inductance by the currents per displacement at each sample of the reading, H/m.
    induced: Vec<Moved>,
    /// See [`Converted::by_frequency`](super::network::Converted).
    by_frequency: f64,
    /// The other converter's coil to which the oscillation locks.
    locked_to: Option<usize>,
}

/// What a sensor is pressed with: where its axis stands, and how far or how hard.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Press {
    /// Place of the indenter's axis, m.
    pub place_m: [f64; 2],
    /// Depth, or force.
    pub demand: Demand,
}

/// What differs from the calibration of a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Surroundings {
    /// Temperature above that of the calibration, K.
    pub warmer_k: f64,
    /// Distance of a steel plate above the coils' turns, m, 2 mm or more.
    pub steel_m: Option<f64>,
    /// Factor of the effect of the elastomer on each coil; coils without an entry have 1.
    pub gains: Vec<f64>,
}

/// When the channels are converted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sequence {
    /// Time from one conversion to the next of a converter, s.
    pub slot_s: f64,
    /// Length of a conversion, s.
    pub conversion_s: f64,
    /// Reference frequency, Hz.
    pub reference_hz: f64,
}

impl Sequence {
    /// Conversions of channels at a rate of scans, 1/s, by one converter with `channels` channels: a
    /// tenth of each slot is for settling and switching. The reference is that of the board, 40 MHz.
    #[must_use]
    pub fn of_rate(scans_per_s: f64, channels: u32) -> Self {
        let slot_s = 1.0 / (scans_per_s * f64::from(channels));
        Self {
            slot_s,
            conversion_s: 0.9 * slot_s,
            reference_hz: 40e6,
        }
    }
}

/// One scan over all coils.
#[derive(Clone, Debug, PartialEq)]
pub struct Scan {
    /// Readings, in the order of the channels.
    pub coils: Vec<CoilReading>,
    /// What was pressed, in the middle of the scan.
    pub truth: TouchTruth,
}

/// One reading of a coil.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CoilReading {
    /// Middle of the conversion, s.
    pub time_s: f64,
    /// Frequency as the converter reports it, Hz.
    pub frequency_hz: f64,
    /// True inductance, H.
    pub inductance_h: f64,
}

/// What is pressed at one time.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TouchTruth {
    /// Time, s.
    pub time_s: f64,
    /// Force, N.
    pub force_n: f64,
    /// Centre of the pressure, m; the indenter's axis without contact.
    pub place_m: [f64; 2],
    /// Depth of the surface under the indenter, m.
    pub depth_m: f64,
    /// Radius of a circle of the contact's area, m.
    pub radius_m: f64,
}

impl TouchSensor {
    /// Draws a sensor of a design (see [`TouchParameters::draw`]).
    ///
    /// ```
    /// use palpate_sim::touch::{Demand, Indenter, Layer, Layout, Press, Sequence, Surroundings};
    /// use palpate_sim::touch::TouchSensor;
    ///
    /// let layer = Layer { thickness_m: 5e-3, shear_modulus_pa: 20e3, poisson: 0.5 };
    /// let sensor = TouchSensor::draw(&Layout::three_around_one(), &layer, 7)?;
    /// let mut ball = sensor.pressed_by(&Indenter::Ball { radius_m: 3e-3 }, [0.0; 2], 1);
    /// // one scan at 250 scans/s, 0.2 mm deep, 2 mm beside the first coil
    /// let press = Press { place_m: [2e-3, 0.0], demand: Demand::Depth(0.2e-3) };
    /// let scan = ball.scan(0.0, &Sequence::of_rate(250.0, 4), |_| press, &Surroundings::default());
    /// let at_rest_h = sensor.inductance_at_rest_h(0).unwrap_or(0.0);
    /// assert!(scan.coils[0].inductance_h > at_rest_h && scan.truth.force_n > 0.0);
    /// # Ok::<(), palpate_sim::stack::document::FileError>(())
    /// ```
    ///
    /// # Errors
    /// If the built-in disturbances cannot be read.
    pub fn draw(layout: &Layout, layer: &Layer, seed: u64) -> Result<Self, FileError> {
        Ok(Self::new(TouchParameters::draw(layout, layer, seed)?))
    }

    /// A sensor with these parameters.
    #[must_use]
    pub fn new(parameters: TouchParameters) -> Self {
        let mut coils: Vec<CoilState> = parameters
            .coils
            .iter()
            .map(|coil| {
                let design = &coil.coil.design;
                let integral = CoilIntegral::new(*design, None);
                let air_h = design.inductance_in_air_h();
                let effect_h = integral.inductance_h(design.gap_at_rest_m) - air_h;
                CoilState {
                    reading: Reading::new(design),
                    at_rest_h: air_h + coil.gain * effect_h,
                    by_frequency: 1.0,
                    induced: Vec::new(),
                    locked_to: None,
                }
            })
            .collect();
        let network = network(&parameters, &coils);
        let converted = (0..coils.len()).map(|index| {
            let found = network.converted(index)?;
            let moved = induced(&parameters, &coils, index, &found.currents);
            Some((found, moved, network.locked_to(index)))
        });
        let converted: Vec<_> = converted.collect();
        for (coil, found) in coils.iter_mut().zip(converted) {
            let Some((found, moved, locked_to)) = found else {
                continue;
            };
            coil.at_rest_h = found.inductance_h;
            coil.by_frequency = found.by_frequency;
            coil.induced = moved;
            coil.locked_to = locked_to;
        }
        let slab_m = parameters
            .coils
            .first()
            .map_or(0.0, |coil| coil.coil.design.slab_m);
        let lower_m = parameters.boundary_m;
        let heights = Heights::new(&parameters.layer, lower_m, lower_m + slab_m);
        Self {
            parameters,
            heights,
            coils,
        }
    }

    /// Parameters of the sensor.
    #[must_use]
    pub fn parameters(&self) -> &TouchParameters {
        &self.parameters
    }

    /// Inductance of a coil without press at the temperature of calibration, H.
    #[must_use]
    pub fn inductance_at_rest_h(&self, coil: usize) -> Option<f64> {
        Some(self.coils.get(coil)?.at_rest_h)
    }

    /// Pairs of coils that are converted at the same time and lock to one frequency: a mistake in the
    /// design. What locked coils read is not simulated.
    #[must_use]
    pub fn locked(&self) -> Vec<[usize; 2]> {
        let coils = self.coils.iter().enumerate();
        let pair = |(index, coil): (usize, &CoilState)| Some([index, coil.locked_to?]);
        coils
            .filter_map(pair)
            .filter(|[one, other]| one < other)
            .collect()
    }

    /// A new press by an indenter on a layer at rest. `drag` is the tangential traction at the contact
    /// as shares of the pressure along x and y: an indenter that is pushed sideways. `run` numbers
    /// presses of a sensor: each has its own noise.
    ///
    /// This computes the contacts of the indenter, in milliseconds to half a second (see the module).
    #[must_use]
    pub fn pressed_by(&self, indenter: &Indenter, drag: [f64; 2], run: u64) -> Pressing<'_> {
        let layer = &self.parameters.layer;
        let contacts = Contacts::new(layer, &self.heights, indenter, drag, GRID_BITS);
        self.pressing(Arc::new(contacts), run)
    }

    fn pressing(&self, contacts: Arc<Contacts>, run: u64) -> Pressing<'_> {
        Pressing {
            sensor: self,
            contacts,
            noise: Stream::named(self.parameters.seed, &format!("touch.noise.{run}")),
            time_s: None,
            force_n: 0.0,
            modes_n: [0.0; MODES],
        }
    }

    /// Inductance of a coil, H, with the layer as `pressed` at `place_m`.
    fn inductance_h(
        &self,
        index: usize,
        pressed: &Pressed,
        place_m: [f64; 2],
        around: &Surroundings,
    ) -> Option<f64> {
        let (coil, state) = (self.parameters.coils.get(index)?, self.coils.get(index)?);
        let [x_m, y_m] = coil.coil.centre_m;
        let [press_x_m, press_y_m] = place_m;
        let grown_m = self.parameters.growth_m_per_k * around.warmer_k;
        let moved = state.reading.samples().map(|sample| {
            let mut moved =
                pressed.moved(x_m + sample.x_m - press_x_m, y_m + sample.y_m - press_y_m);
            moved.lower_m -= grown_m;
            moved.upper_m -= grown_m;
            moved
        });
        let moved: Vec<Moved> = moved.collect();
        let gain = around.gains.get(index).copied().unwrap_or(1.0) * coil.gain;
        let own_h = gain * state.reading.change_h(moved.iter().copied());
        let induced_h: f64 = state
            .induced
            .iter()
            .zip(&moved)
            .map(|(per, moved)| per.lower_m * moved.lower_m + per.upper_m * moved.upper_m)
            .sum();
        let steel_h = around.steel_m.map_or(0.0, |steel_m| {
            reflected_h(&coil.coil.design, STEEL, steel_m)
        });
        Some(state.at_rest_h + state.by_frequency * (own_h + induced_h + steel_h))
    }

    /// Frequency of a coil's tank, Hz.
    fn frequency_hz(&self, index: usize, inductance_h: f64, around: &Surroundings) -> f64 {
        let p = &self.parameters;
        let capacitance_f = p.coils.get(index).map_or(0.0, |coil| coil.capacitance_f)
            * (1.0 + p.capacitance_per_kelvin * around.warmer_k);
        frequency_hz(inductance_h, capacitance_f)
    }
}

/// Mutual inductances of coils with the effect of the elastomer that each has.
fn network(p: &TouchParameters, coils: &[CoilState]) -> Network {
    let tank = |(coil, state): (&TouchCoil, &CoilState)| Tank {
        inductance_h: state.at_rest_h,
        capacitance_f: coil.capacitance_f,
    };
    let mutual = |one: &TouchCoil, other: &TouchCoil| {
        let [x_m, y_m] = one.coil.seen_from(&other.coil);
        mutual_h(&one.coil.design, libm::hypot(x_m, y_m))
    };
    let row = |one| p.coils.iter().map(|other| mutual(one, other)).collect();
    Network {
        tanks: p.coils.iter().zip(coils).map(tank).collect(),
        mutual_h: p.coils.iter().map(row).collect(),
    }
}

/// Change of the inductance of a coil by currents in the others, per displacement at its samples, H/m.
fn induced(
    p: &TouchParameters,
    coils: &[CoilState],
    index: usize,
    currents: &[Complex],
) -> Vec<Moved> {
    let Some((own, state)) = p.coils.get(index).zip(coils.get(index)) else {
        return Vec::new();
    };
    let others = p.coils.iter().zip(coils).zip(currents).enumerate();
    let others = others.filter(|(other, _)| *other != index);
    let placed: Vec<_> = others
        .map(|(_, ((other, other_state), current))| {
            let from_m = other.coil.seen_from(&own.coil);
            (from_m, &other_state.reading, *current)
        })
        .collect();
    state.reading.induced(&placed)
}

/// Inductance by a wide plate of this reflection at a distance from the coil, H, as if there were no
/// slab in between.
fn reflected_h(design: &CoilDesign, reflection: f64, distance_m: f64) -> f64 {
    let sum: f64 = panels(8, 16, 0.0, 18.0 / distance_m)
        .iter()
        .map(|&(k, weight)| {
            let turns: f64 = design.radii_m().map(|a_m| a_m * libm::j1(k * a_m)).sum();
            weight * turns * turns * libm::exp(-2.0 * k * distance_m)
        })
        .sum();
    4e-7 * PI * PI * reflection * sum
}

/// A press that goes on: the layer creeps, so that its force depends on how fast it was pressed.
///
/// The layer is a Kelvin chain over the contact's elastic force, exact for a constant contact and for
/// one that grows (Lee and Radok 1960); in unloading its rim is approximate. The dent that creep
/// leaves moves with the indenter: material does not remember a contact that slid on.
#[derive(Clone, Debug)]
pub struct Pressing<'a> {
    sensor: &'a TouchSensor,
    contacts: Arc<Contacts>,
    noise: Stream,
    time_s: Option<f64>,
    /// Force at `time_s`, N.
    force_n: f64,
    /// Displacements of the creep's modes, as elastic forces, N.
    modes_n: [f64; MODES],
}

impl Pressing<'_> {
    /// A new press by the same indenter on a layer at rest; takes no time.
    #[must_use]
    pub fn again(&self, run: u64) -> Self {
        self.sensor.pressing(Arc::clone(&self.contacts), run)
    }

    /// Greatest depth that this indenter is computed for, m, a fifth of the layer's thickness or less;
    /// deeper presses count as this one.
    #[must_use]
    pub fn deepest_m(&self) -> f64 {
        self.contacts.deepest_m()
    }

    /// The next scan, which begins at `start_s`. `path` returns the press at a time; times rise.
    pub fn scan(
        &mut self,
        start_s: f64,
        sequence: &Sequence,
        path: impl Fn(f64) -> Press,
        around: &Surroundings,
    ) -> Scan {
        let count = self.sensor.coils.len();
        let channels = count.min(4);
        let middle_s = start_s + 0.5 * sequence.slot_s * channels as f64;
        let mut truth = None;
        let mut coils = vec![CoilReading::default(); count];
        for channel in 0..channels {
            let time_s = start_s + sequence.slot_s * (channel as f64 + 0.5);
            if truth.is_none() && time_s >= middle_s {
                truth = Some(self.state(middle_s, &path, around).0);
            }
            let (_, pressed) = self.state(time_s, &path, around);
            let axis_m = path(time_s).place_m;
            // Both converters convert at the same time.
            for (index, reading) in coils.iter_mut().enumerate().skip(channel).step_by(4) {
                let inductance_h = self.sensor.inductance_h(index, &pressed, axis_m, around);
                let inductance_h = inductance_h.unwrap_or(0.0);
                let true_hz = self.sensor.frequency_hz(index, inductance_h, around);
                *reading = CoilReading {
                    time_s,
                    frequency_hz: true_hz * self.converted(sequence),
                    inductance_h,
                };
            }
        }
        Scan {
            coils,
            truth: truth.unwrap_or_default(),
        }
    }

    /// Lets the layer creep under a press up to a time, without reading the coils, which takes most of a
    /// scan's time. Between two calls the force changes evenly.
    pub fn follow(&mut self, time_s: f64, press: &Press, around: &Surroundings) -> TouchTruth {
        self.state(time_s, |_| *press, around).0
    }

    /// Inductances of all coils at one time, H, without a converter, and the truth.
    pub fn inductances_h(
        &mut self,
        time_s: f64,
        press: &Press,
        around: &Surroundings,
    ) -> (Vec<f64>, TouchTruth) {
        let (truth, pressed) = self.state(time_s, |_| *press, around);
        let coils = 0..self.sensor.coils.len();
        let inductances_h = coils.filter_map(|index| {
            self.sensor
                .inductance_h(index, &pressed, press.place_m, around)
        });
        (inductances_h.collect(), truth)
    }

    /// True frequencies of all coils at one time, Hz.
    pub(super) fn frequencies_hz(
        &mut self,
        time_s: f64,
        press: &Press,
        around: &Surroundings,
    ) -> Vec<f64> {
        let (inductances_h, _) = self.inductances_h(time_s, press, around);
        let coils = inductances_h.iter().enumerate();
        coils
            .map(|(index, &inductance_h)| self.sensor.frequency_hz(index, inductance_h, around))
            .collect()
    }

    /// Factor of a reported frequency: clock and noise.
    fn converted(&mut self, sequence: &Sequence) -> f64 {
        let p = &self.sensor.parameters;
        if p.white_noise_relative == 0.0 {
            return 1.0 - p.reference_clock_error;
        }
        let white = p.white_noise_relative * libm::sqrt(1e-3 / sequence.conversion_s);
        let rcount = sequence.conversion_s * sequence.reference_hz / 16.0;
        let relative = libm::hypot(white, QUANTISATION / rcount);
        1.0 - p.reference_clock_error + relative * self.noise.normal()
    }

    /// Advances the layer to a time.
    fn state(
        &mut self,
        time_s: f64,
        path: impl Fn(f64) -> Press,
        around: &Surroundings,
    ) -> (TouchTruth, Pressed) {
        let p = &self.sensor.parameters;
        let press = path(time_s);
        let softer = libm::exp(p.modulus_per_kelvin * around.warmer_k);
        let passed_s = self
            .time_s
            .map_or(0.0, |before_s| (time_s - before_s).max(0.0));
        let compliances = p.creep.map(|mode| mode.amplitude);
        let decays = p.creep.map(|mode| libm::exp(-passed_s / mode.tau_s));
        let step = KelvinStep {
            compliances: &compliances,
            decays: &decays,
            modes_m: &self.modes_n,
            force_n: self.force_n,
        };
        let response = step.response(1.0);
        let force_n = match press.demand {
            Demand::Force(force_n) => force_n.max(0.0),
            Demand::Depth(depth_m) => {
                let [amplitude_m, hz, phase] = p.vibration;
                let shaken_m = amplitude_m * libm::sin(TAU * hz * time_s + phase);
                let elastic_n = softer * self.contacts.force_n(depth_m + shaken_m);
                ((elastic_n - response.offset_m) / response.compliance_m_per_n).max(0.0)
            }
        };
        let elastic_n = response.offset_m + response.compliance_m_per_n * force_n;
        self.modes_n = step.modes_after(force_n);
        self.force_n = force_n;
        self.time_s = Some(time_s);
        let pressed = self
            .contacts
            .pressed(self.contacts.depth_m(elastic_n / softer));
        let ([x_m, y_m], [from_x_m, from_y_m]) = (press.place_m, pressed.centre_m);
        let touches = force_n > 0.0;
        let truth = TouchTruth {
            time_s,
            force_n,
            place_m: if touches {
                [x_m + from_x_m, y_m + from_y_m]
            } else {
                press.place_m
            },
            depth_m: pressed.depth_m,
            radius_m: if touches { pressed.radius_m } else { 0.0 },
        };
        (truth, pressed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mechanics::layer::CreepMode;

    const LAYER: Layer = Layer {
        thickness_m: 5e-3,
        shear_modulus_pa: 20e3,
        poisson: 0.5,
    };

    fn ideal(layout: &Layout) -> TouchSensor {
        TouchSensor::new(TouchParameters::ideal(layout, &LAYER))
    }

    fn at(place_m: [f64; 2], depth_m: f64) -> Press {
        Press {
            place_m,
            demand: Demand::Depth(depth_m),
        }
    }

    fn still() -> Surroundings {
        Surroundings::default()
    }

    const BALL: Indenter = Indenter::Ball { radius_m: 3e-3 };

    /// Changes of the inductances of a sensor by a press, H.
    fn changes_h(sensor: &TouchSensor, contacts: &Arc<Contacts>, press: &Press) -> Vec<f64> {
        let (found, _) =
            sensor
                .pressing(Arc::clone(contacts), 0)
                .inductances_h(0.0, press, &still());
        let rest = |index| sensor.inductance_at_rest_h(index).unwrap();
        (0..found.len()).map(|i| found[i] - rest(i)).collect()
    }

    fn contacts(sensor: &TouchSensor) -> Arc<Contacts> {
        Arc::new(Contacts::new(&LAYER, &sensor.heights, &BALL, [0.0; 2], 6))
    }

    #[test]
    fn readings_have_the_symmetry_of_the_layout() {
        let mut layout = Layout::three_around_one();
        let sensor = ideal(&layout);
        let table = contacts(&sensor);
        let centre = changes_h(&sensor, &table, &at([0.0; 2], 0.4e-3));
        assert!(centre[0] > 0.0);
        for index in 2..4 {
            assert!(
                (centre[index] - centre[1]).abs() < 1e-3 * centre[0],
                "{index}"
            );
        }
        // A coil alone reads the same when coil and press are moved together.
        layout.coils.truncate(1);
        let beside = changes_h(&ideal(&layout), &table, &at([1e-3, 2e-3], 0.4e-3));
        layout.coils[0].centre_m = [6e-3, 0.0];
        let moved = changes_h(&ideal(&layout), &table, &at([7e-3, 2e-3], 0.4e-3));
        assert!((moved[0] / beside[0] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn the_grid_reads_as_the_integral_equation_over_the_array() {
        let sensor = ideal(&Layout::three_around_one());
        let round = contacts(&sensor);
        let grid = Arc::new(Contacts::on_grid(
            &LAYER,
            &sensor.heights,
            &BALL,
            [0.0; 2],
            7,
        ));
        let largest = changes_h(&sensor, &round, &at([0.0; 2], 0.5e-3))[0];
        for place_m in [[0.0; 2], [3e-3, 1e-3], [-2e-3, 5e-3]] {
            let press = at(place_m, 0.5e-3);
            let one = changes_h(&sensor, &round, &press);
            let other = changes_h(&sensor, &grid, &press);
            for (one, other) in one.iter().zip(&other) {
                println!(
                    "{place_m:?}: {one:e} {other:e} {:e}",
                    (one - other) / largest
                );
                assert!((one - other).abs() < 0.01 * largest, "{place_m:?}");
            }
        }
    }

    #[test]
    fn a_coil_under_the_layer_reads_less() {
        let mut layout = Layout::three_around_one();
        layout.coils.truncate(1);
        layout.coils[0].design.outer_diameter_m = 13.5e-3;
        layout.coils[0].design.gap_at_rest_m = 0.6e-3;
        let press = at([1e-3, 0.0], 0.3e-3);
        let read = |layout: &Layout| {
            let mut parameters = TouchParameters::draw(layout, &LAYER, 9).unwrap();
            parameters.vibration = [0.0; 3];
            let sensor = TouchSensor::new(parameters);
            let layer = sensor.parameters.layer;
            let table = Contacts::new(&layer, &sensor.heights, &BALL, [0.0; 2], 6);
            (changes_h(&sensor, &Arc::new(table), &press)[0], sensor)
        };
        let (on_surface_h, _) = read(&layout);
        layout.boundary_m = 3e-3;
        layout.coils[0].design.gap_at_rest_m = 3.6e-3;
        let (below_h, sensor) = read(&layout);
        // The slab ends at the surface of the drawn layer, whatever its thickness.
        assert_eq!(sensor.heights.upper_m, sensor.parameters.layer.thickness_m);
        let ratio = below_h / on_surface_h;
        println!("{on_surface_h:e} {below_h:e} {ratio}");
        assert!((0.04..0.055).contains(&ratio), "{ratio}");
    }

    #[test]
    fn a_held_layer_relaxes_and_a_fast_press_is_harder() {
        let mut parameters = TouchParameters::ideal(&Layout::three_around_one(), &LAYER);
        parameters.coils.truncate(1);
        let amplitudes = [(0.1, 0.2), (0.05, 20.0), (0.05, 400.0)];
        parameters.creep = amplitudes.map(|(amplitude, tau_s)| CreepMode { amplitude, tau_s });
        let sensor = TouchSensor::new(parameters);
        let table = contacts(&sensor);
        let elastic_n = table.force_n(0.3e-3);
        let force_n = |rise_s: f64, held_s: f64| {
            let mut pressing = sensor.pressing(table.clone(), 0);
            let mut state = |time_s: f64| {
                let depth_m = 0.3e-3 * (time_s / rise_s).min(1.0);
                pressing
                    .state(time_s, |_| at([0.0; 2], depth_m), &still())
                    .0
            };
            for step in 0..=100 {
                state(rise_s * 0.01 * f64::from(step));
            }
            for step in 1..=200 {
                state(rise_s + 0.005 * held_s * f64::from(step));
            }
            state(rise_s + held_s).force_n
        };
        let [slow, fast, long] = [force_n(2.0, 0.0), force_n(0.02, 0.0), force_n(0.02, 1e4)];
        assert!(
            slow < 0.97 * fast && fast < elastic_n,
            "{slow} {fast} {elastic_n}"
        );
        assert!(
            (long * 1.2 / elastic_n - 1.0).abs() < 1e-4,
            "{long} {elastic_n}"
        );
        // Under a constant force the depth is that of the force times 1 + the creep.
        let mut pressing = sensor.pressing(table.clone(), 0);
        let press = Press {
            place_m: [0.0; 2],
            demand: Demand::Force(0.1),
        };
        for step in 0..100 {
            pressing.state(0.1 * f64::from(step) - 1.0, |_| press, &still());
        }
        let (truth, _) = pressing.state(1e5, |_| press, &still());
        assert_eq!(truth.force_n, 0.1);
        assert!((truth.depth_m / table.depth_m(0.12) - 1.0).abs() < 1e-3);
    }

    #[test]
    fn a_drawn_sensor_is_its_seed_and_has_the_noise_of_the_converter() {
        let mut layout = Layout::seven();
        layout.coils.truncate(5);
        let draw = |seed| TouchParameters::draw(&layout, &LAYER, seed).unwrap();
        assert_eq!(draw(3), draw(3));
        assert_ne!(draw(3), draw(4));
        let sensor = TouchSensor::draw(&layout, &LAYER, 3).unwrap();
        let sequence = Sequence::of_rate(250.0, 4);
        let mut pressing = sensor.pressed_by(&BALL, [0.0; 2], 1);
        let scans: Vec<Scan> = (0..100)
            .map(|scan| {
                let lifted = |_| at([0.0; 2], -1e-3);
                pressing.scan(4e-3 * f64::from(scan), &sequence, lifted, &still())
            })
            .collect();
        // 0.018/RCOUNT with 0.9 ms at 40 MHz is 8e-6; white noise of 1e-6 at 1 ms adds little.
        let relative: Vec<f64> = scans
            .iter()
            .map(|scan| scan.coils[2].frequency_hz / scans[0].coils[2].frequency_hz - 1.0)
            .collect();
        let mean = relative.iter().sum::<f64>() / 100.0;
        let sigma = (relative.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / 99.0).sqrt();
        assert!((sigma / 8.07e-6 - 1.0).abs() < 0.2, "{sigma}");
        let times: Vec<f64> = scans[1].coils.iter().map(|coil| coil.time_s).collect();
        assert_eq!(
            times[4], times[0],
            "the second converter runs beside the first"
        );
        assert!((times[3] - times[0] - 3e-3).abs() < 1e-12);
        assert!((scans[1].truth.time_s - 6e-3).abs() < 1e-12);
        assert_eq!(scans[1].truth.force_n, 0.0);
    }

    #[test]
    fn surroundings_change_what_they_should() {
        let mut parameters = TouchParameters::draw(&Layout::three_around_one(), &LAYER, 5).unwrap();
        parameters.vibration = [0.0; 3];
        let sensor = TouchSensor::new(parameters);
        let table = contacts(&sensor);
        let read = |around: &Surroundings, depth_m: f64| {
            let mut pressing = sensor.pressing(table.clone(), 0);
            let press = at([2e-3, 0.0], depth_m);
            pressing.inductances_h(0.0, &press, around).0
        };
        let plain = [read(&still(), -1e-3), read(&still(), 0.3e-3)];
        let steel = Surroundings {
            steel_m: Some(15e-3),
            ..still()
        };
        let [near, far] =
            [15e-3, 30e-3].map(|d| reflected_h(&Layout::seven().coils[0].design, STEEL, d));
        assert!(near < 4.0 * far && far < 0.0);
        for (index, with_h) in read(&steel, 0.3e-3).iter().enumerate() {
            let factor = sensor.coils[index].by_frequency;
            assert!((with_h - plain[1][index] - factor * near).abs() < 1e-15);
        }
        let gains = Surroundings {
            gains: vec![1.03],
            ..still()
        };
        let changed = read(&gains, 0.3e-3)[0] - plain[0][0];
        let ratio = changed / (plain[1][0] - plain[0][0]);
        assert!((ratio - 1.03).abs() < 3e-3, "{ratio}");
        let warmer = Surroundings {
            warmer_k: 10.0,
            ..still()
        };
        // The gap grows, so every coil reads less.
        let warm = read(&warmer, -1e-3);
        assert!(warm.iter().zip(&plain[0]).all(|(warm, plain)| warm < plain));
    }
}
