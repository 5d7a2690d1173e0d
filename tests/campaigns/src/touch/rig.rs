//! Presses of a drawn sensor that are judged, and its array as the instrument takes it.

use core::f64::consts::TAU;

use palpate_calibration::touch::{ArrayCalibration, Tip};
use palpate_model::touch as model;
use palpate_model::units::Metre;
use palpate_sim::random::Stream;
use palpate_sim::touch::{Indenter, Pressing, Surroundings};
use palpate_simulate::touch::bench::{
    DECLARED, PIN, TouchBench, Way, counted_radius_m, depth_m, exponent, indenter,
};

use super::array::array;

/// Radii of contact of the presses that are judged, m: a fit at an end of the calibrated range claims no
/// radius.
const JUDGED_M: [f64; 2] = [1e-3, 5e-3];
/// Radii of the balls, m: larger ones would be plates.
const BALLS_M: [f64; 2] = [1e-3, 20e-3];

/// A press as it is read, with the truth.
pub(super) struct Pressed {
    pub(super) place_m: [f64; 2],
    pub(super) force_n: f64,
    /// Radius of contact that the estimate stands for.
    pub(super) radius_m: f64,
    pub(super) readings: Vec<f64>,
    /// What is declared of it.
    pub(super) indenter: model::Indenter,
}

impl Pressed {
    pub(super) fn estimate(&self, array: &model::Array) -> model::Verdict {
        let readings: Vec<f32> = self.readings.iter().map(|of| *of as f32).collect();
        array.estimate(&readings, &self.indenter, None)
    }
}

/// How a press differs from those of the calibration.
#[derive(Clone, Debug)]
pub(super) struct Manner {
    pub(super) around: Surroundings,
    /// Times of the way down and before the reading, over the usual ones.
    pub(super) slower: f64,
    /// Traction along the surface over the pressure.
    pub(super) drag: [f64; 2],
    /// Tip that presses in place of the declared one.
    pub(super) instead: Option<Indenter>,
}

impl Default for Manner {
    fn default() -> Self {
        Self {
            around: Surroundings::default(),
            slower: 1.0,
            drag: [0.0; 2],
            instead: None,
        }
    }
}

/// Presses a sensor after its calibration.
pub(super) struct Rig<'a> {
    bench: &'a TouchBench,
    chance: Stream,
    runs: u64,
}

impl<'a> Rig<'a> {
    pub(super) fn new(bench: &'a TouchBench) -> Self {
        Self {
            bench,
            chance: Stream::named(bench.sensor.parameters().seed, "campaign.touch"),
            // Numbers of runs that the bench does not use.
            runs: 1_000_000,
        }
    }

    /// Calibrates the sensor.
    pub(super) fn calibrated(&self) -> Result<(ArrayCalibration, model::Array), String> {
        let calibration = self.bench.calibrated().map_err(|error| error.to_string())?;
        let design = &self.bench.design;
        let array = array(&calibration, design.noise, design.reach_m).ok_or("not an array")?;
        Ok((calibration, array))
    }

    /// A random press inside.
    pub(super) fn anywhere(&mut self, manner: &Manner) -> Pressed {
        let r_m = self.bench.kind.reach_m() * self.chance.uniform().sqrt();
        let (sin, cos) = self.chance.between(0.0, TAU).sin_cos();
        self.press([r_m * cos, r_m * sin], manner)
    }

    /// A press by a random ball or pin whose radius of contact is to be judged.
    fn press(&mut self, place_m: [f64; 2], manner: &Manner) -> Pressed {
        let [least_m, greatest_m] = JUDGED_M;
        loop {
            let depth_m = depth_m(&mut self.chance);
            let radius_m = self.chance.log_between(least_m, greatest_m);
            let tip = if self.chance.uniform() < 0.5 {
                Tip::Pin(radius_m / PIN)
            } else {
                // The radius that gives this contact on a half-space.
                Tip::Ball(radius_m * radius_m / depth_m)
            };
            if matches!(tip, Tip::Ball(of_m) if !(BALLS_M[0]..BALLS_M[1]).contains(&of_m)) {
                continue;
            }
            let presser = manner.instead.unwrap_or_else(|| indenter(tip));
            let tool = self.bench.sensor.pressed_by(&presser, manner.drag, 0);
            let way = Way {
                place_m,
                depth_m,
                slower: manner.slower,
                around: &manner.around,
            };
            let pressed = self.pressed(tip, &tool, way);
            if manner.instead.is_some() || (least_m..greatest_m).contains(&pressed.radius_m) {
                return pressed;
            }
        }
    }

    fn pressed(&mut self, tip: Tip, tool: &Pressing<'_>, way: Way<'_>) -> Pressed {
        self.runs += 1;
        let (readings, truth) = (self.bench).read(tool.again(self.runs), &mut self.chance, way);
        Pressed {
            place_m: truth.place_m,
            force_n: truth.force_n,
            radius_m: counted_radius_m(tip, &truth),
            readings,
            indenter: self.declared(tip),
        }
    }

    /// What is declared of a tip: a ball's radius of contact is that at 1 N.
    fn declared(&mut self, tip: Tip) -> model::Indenter {
        if !self.bench.kind.is_declared() {
            return model::Indenter::Unknown;
        }
        let off = (DECLARED * self.chance.normal()).exp();
        let at_one_newton_m = tip.contact_radius_m(&self.bench.layer, 1.0);
        model::Indenter::Declared {
            at_one_newton: Metre((off * at_one_newton_m) as f32),
            exponent: exponent(tip) as f32,
            uncertainty: DECLARED as f32,
        }
    }
}
