//! Least variance of any unbiased estimate of a load, given all readings of bench and press.
//!
//! The plant's own equations are differentiated numerically at the drawn sensor. The Fisher
//! information of every conversion and of every reading of the load cell is summed over the trains
//! of the bench, with the spread of the draw as prior knowledge (van Trees' bound, with normal
//! priors of the same variances). Unknowns of a single train are eliminated train by train: the
//! press's position, and amplitude and phase of the stand's vibration, whose frequency is assumed
//! known. The calculation shares nothing with calibration and instrument, which it judges.

use palpate_design::plan::{Information, metres_per_relative_frequency};
use palpate_sim::mechanics::load::Load;
use palpate_sim::parameters::{ParameterError, Parameters};
use palpate_sim::sensing_coil::tank::SensingTank;
use palpate_sim::switches::Switches;
use palpate_sim::world::{Setup, World};
use palpate_simulate::instrument::BenchTask;

use super::rung::Evaluation;
use super::train::{REST_S, Reading, TrainTask, derivative};
use super::unknowns::{self, Unknown};

/// Step of the derivatives, in standard deviations of an unknown. With a third of this step, no
/// bound changes by more than a relative 2e-5.
pub(super) const STEP: f64 = 0.01;
/// Unit of the press's position, m: every reading determines the position better than this.
const PRESS_M: f64 = 1e-4;
/// Prior standard deviations of the terms of the reading's curve, which are powers of the
/// deformation: the bench determines the curve without prior knowledge.
const CURVE: [f64; 4] = [0.2, 0.2, 0.2, 0.2];
/// Indices of a single train's unknowns, after the shared ones: the press's position, then
/// vibration and drift.
const PLACE: usize = 0;
const COSINE: usize = 1;
const SINE: usize = 2;
const STRAIGHT: usize = 3;
const LOGARITHM: usize = 4;
pub(super) const LOCAL: usize = 5;
/// Information from the bench of one sensor.
pub(super) struct BenchInformation<'p> {
    pub(super) plant: &'p Parameters,
    task: &'p BenchTask,
    pub(super) unknowns: &'p [Unknown],
    tank: SensingTank,
    conversion_sigma: f64,
    /// Rms of a component of the stand's vibration, m.
    vibration_m: f64,
    /// Information by evaluation, in the order of [`Evaluation::ALL`].
    pub(super) by_evaluation: [Information; Evaluation::ALL.len()],
}

/// Readings of a train, with their derivatives in every shared unknown and in the press's position.
pub(super) struct Differentiated {
    pub(super) readings: Vec<Reading>,
    /// Derivatives in the unknowns of the sensor and, on a bench spring, in the error of that spring.
    pub(super) shared: Vec<(usize, Vec<(f64, f64)>)>,
    pub(super) place: Vec<(f64, f64)>,
}

impl<'p> BenchInformation<'p> {
    /// Evaluates the bench of a plant. `conversion_sigma` is the relative noise of a frequency,
    /// `vibration_m` the rms of a component of the stand's vibration, m.
    pub(super) fn new(
        plant: &'p Parameters,
        task: &'p BenchTask,
        unknowns: &'p [Unknown],
        (conversion_sigma, vibration_m): (f64, f64),
    ) -> Result<Self, ParameterError> {
        let mut bench = Self {
            plant,
            task,
            unknowns,
            tank: SensingTank::new(&plant.tank),
            conversion_sigma,
            vibration_m,
            by_evaluation: Evaluation::ALL.map(|_| Information::new(0)),
        };
        bench.by_evaluation = Evaluation::ALL.map(|_| Information::new(bench.shared()));
        let mut on_bench = plant.clone();
        on_bench.thermal.ambient_change_k = 0.0;
        on_bench.press.frame_m_per_n = plant.rig.frame_m_per_n;
        bench.read(&on_bench, None, 0.0)?;
        let springs = task.plan.springs_n_per_m.iter().enumerate();
        let loads = core::iter::once(None).chain(springs.map(Some));
        for load in loads {
            for depth in &task.plan.depths {
                bench.read(&on_bench, Some(load), depth * task.plan.depth_m)?;
            }
        }
        bench.know();
        Ok(bench)
    }

    /// Number of unknowns that all trains share: of the sensor, of the springs, of the reading's
    /// curve, and of the load cell's gain.
    pub(super) fn shared(&self) -> usize {
        self.gain() + 1
    }

    fn springs(&self) -> usize {
        self.unknowns.len()
    }

    fn curve(&self) -> usize {
        self.springs() + self.task.plan.springs_n_per_m.len()
    }

    fn gain(&self) -> usize {
        self.curve() + CURVE.len()
    }

    /// Adds the prior knowledge. Unknowns are in units of their deviations, except for the curve
    /// and the gain.
    fn know(&mut self) {
        let gain = self.task.known.load_cell_gain.unwrap_or(0.0).max(1e-9) / 3_f64.sqrt();
        let curve = self.curve();
        for information in &mut self.by_evaluation {
            (0..curve).for_each(|unknown| information.know(unknown, 1.0));
            for (term, deviation) in CURVE.iter().enumerate() {
                information.know(curve + term, deviation * deviation);
            }
            information.know(curve + CURVE.len(), gain * gain);
        }
    }

    /// Adds a train of the bench on the block, on a spring, or without contact.
    fn read(
        &mut self,
        plant: &Parameters,
        load: Option<Option<(usize, &f64)>>,
        depth_m: f64,
    ) -> Result<(), ParameterError> {
        let pressed = load.map(|spring| {
            spring.map_or(Load::Rigid, |(_, n_per_m)| Load::Spring {
                n_per_m: *n_per_m,
            })
        });
        let train = self.train(plant, pressed, depth_m)?;
        let mut of = self.differentiated(plant, &train)?;
        if let Some(Some((spring, n_per_m))) = load {
            let deviation = self.task.known.spring_tolerance / 3_f64.sqrt();
            let off = |steps: f64| {
                let n_per_m = n_per_m * (1.0 + steps * STEP * deviation);
                TrainTask {
                    load: Some(Load::Spring { n_per_m }),
                    ..train.clone()
                }
                .readings(plant)
            };
            of.shared.push((
                self.springs() + spring,
                derivative(&off(-1.0)?, &off(1.0)?, 2.0 * STEP),
            ));
        }
        let locals = if pressed.is_some() { LOCAL } else { 0 };
        let marginals = Evaluation::ALL.map(|evaluation| {
            let mut information = Information::new(self.shared() + locals);
            self.add(&mut information, &of, evaluation, true);
            if locals > 0 {
                self.know_locals(&mut information);
            }
            information.marginal(self.shared())
        });
        for (information, marginal) in self.by_evaluation.iter_mut().zip(marginals) {
            information.add(&marginal);
        }
        Ok(())
    }

    /// A train on a load, with the press at the position that presses the sensing layer by
    /// `depth_m`, m.
    pub(super) fn train(
        &self,
        plant: &Parameters,
        load: Option<Load>,
        depth_m: f64,
    ) -> Result<TrainTask<'p>, ParameterError> {
        let setup = Setup {
            load: load.unwrap_or(Load::Rigid),
            ..Setup::default()
        };
        Ok(TrainTask {
            settings: &self.task.plan.settings,
            load,
            travel_m: World::new(plant, Switches::all(), setup)?.press_for_depth_m(depth_m),
        })
    }

    pub(super) fn differentiated(
        &self,
        plant: &Parameters,
        train: &TrainTask<'_>,
    ) -> Result<Differentiated, ParameterError> {
        let by = |unknown: &Unknown| {
            let moved = |steps: f64| train.readings(&unknown.moved(plant, steps * STEP));
            Ok(derivative(&moved(-1.0)?, &moved(1.0)?, 2.0 * STEP))
        };
        // A press in use is not on a bench: its frame is part of its load.
        let is_there =
            |unknown: &&Unknown| unknown.name != unknowns::FRAME || plant.press.frame_m_per_n > 0.0;
        let numbered = self.unknowns.iter().enumerate();
        let numbered = numbered.filter(|(_, unknown)| is_there(unknown));
        let shared: Result<Vec<_>, ParameterError> = numbered
            .map(|(index, unknown)| Ok((index, by(unknown)?)))
            .collect();
        let placed = |steps: f64| {
            let travel_m = train.travel_m + steps * STEP * PRESS_M;
            TrainTask {
                travel_m,
                ..train.clone()
            }
            .readings(plant)
        };
        Ok(Differentiated {
            readings: train.readings(plant)?,
            shared: shared?,
            place: derivative(&placed(-1.0)?, &placed(1.0)?, 2.0 * STEP),
        })
    }

    /// Adds the readings of a train, with those of the load cell if there is one.
    pub(super) fn add(
        &self,
        information: &mut Information,
        of: &Differentiated,
        evaluation: Evaluation,
        load_cell: bool,
    ) {
        let local = self.shared();
        let noise_n = self.plant.rig.load_cell_noise_n;
        let omega = core::f64::consts::TAU * self.plant.press.vibration.hertz;
        let columns = information.unknowns();
        for (index, reading) in of.readings.iter().enumerate() {
            if evaluation != Evaluation::Whole && !reading.in_fall {
                continue;
            }
            let (mut deformation, mut force) = (vec![0.0; columns], vec![0.0; columns]);
            let mut set = |unknown: usize, (of_deformation, of_force): (f64, f64)| {
                if let (Some(one), Some(other)) =
                    (deformation.get_mut(unknown), force.get_mut(unknown))
                {
                    (*one, *other) = (of_deformation, of_force);
                }
            };
            for (unknown, derivatives) in &of.shared {
                set(
                    *unknown,
                    derivatives.get(index).copied().unwrap_or_default(),
                );
            }
            let part = reading.deformation_m / self.task.plan.depth_m;
            for term in 0..CURVE.len() {
                set(
                    self.curve() + term,
                    (reading.deformation_m * part.powi(term as i32), 0.0),
                );
            }
            set(self.gain(), (0.0, reading.force_n));
            let (by_place, by_force) = of.place.get(index).copied().unwrap_or_default();
            let (sine, cosine) = (omega * reading.time_s).sin_cos();
            let shaken = self.vibration_m / PRESS_M;
            let drifts = if evaluation == Evaluation::FallsWithDrift {
                1.0
            } else {
                0.0
            };
            for (place, share) in [
                (PLACE, 1.0),
                (COSINE, cosine * shaken),
                (SINE, sine * shaken),
                (STRAIGHT, drifts * reading.time_s),
                (LOGARITHM, drifts * (reading.time_s / REST_S).ln_1p()),
            ] {
                set(local + place, (by_place * share, by_force * share));
            }
            let noise_m = self.conversion_sigma
                * metres_per_relative_frequency(&self.tank, reading.deformation_m);
            information.read(&deformation, noise_m * noise_m);
            if load_cell && noise_n > 0.0 {
                information.read(&force, noise_n * noise_n);
            }
        }
    }

    pub(super) fn know_locals(&self, information: &mut Information) {
        for place in 0..LOCAL {
            information.know(self.shared() + place, 1.0);
        }
    }
}
