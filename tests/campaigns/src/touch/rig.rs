//! A drawn sensor on its own bench: presses, calibration, and the array as the instrument takes it.

use core::f64::consts::TAU;

use palpate_calibration::touch::{
    ArrayCalibration, Bench, CommonError, Design, KnownPress, Layer as BenchLayer, Scales, Tip,
    calibrate,
};
use palpate_cli::failure::Failure;
use palpate_model::touch as model;
use palpate_model::units::Metre;
use palpate_sim::random::Stream;
use palpate_sim::stack::LoadError;
use palpate_sim::touch::{
    Demand, Indenter, Layer, Layout, Press, Pressing, Sequence, Surroundings, TouchParameters,
    TouchSensor,
};

use super::array::array;

/// The layout's layer, of a soft silicone: the presses are of 0.02 to 1 N.
const LAYER: Layer = Layer {
    thickness_m: 5e-3,
    shear_modulus_pa: 100e3,
    poisson: 0.5,
};
/// Depths of the presses, m: the part of a reading beyond the second order grows with the depth, and
/// noise outweighs all else in presses below.
const DEPTHS_M: [f64; 2] = [0.15e-3, 0.4e-3];
/// Radii of contact of the calibration and of the presses that are judged, m: a fit at an end of the
/// calibrated range claims no radius.
const RADII_M: [f64; 2] = [0.8e-3, 6e-3];
const JUDGED_M: [f64; 2] = [1e-3, 5e-3];
/// Radii of the balls, m: larger ones would be plates.
const BALLS_M: [f64; 2] = [1e-3, 20e-3];
/// The bench's tips, m.
const TIPS: [Tip; 10] = [
    Tip::Pin(0.65e-3),
    Tip::Ball(20e-3),
    Tip::Pin(4.4e-3),
    Tip::Ball(8e-3),
    Tip::Pin(1.7e-3),
    Tip::Ball(16e-3),
    Tip::Pin(2.8e-3),
    Tip::Ball(10e-3),
    Tip::Pin(1.1e-3),
    Tip::Ball(12e-3),
];
/// A pin counts with this factor of its radius, sqrt(5/3): `palpate_model::touch`.
const PIN: f64 = 1.290_994;
/// Standard errors of the bench: of each press, and common to all.
const BENCH: Bench = Bench {
    place_m: 0.03e-3,
    force: 3e-3,
    radius: 0.02,
    common: CommonError {
        place_m: 0.02e-3,
        ln_force: 2e-3,
        ln_radius: 0.01,
    },
};
/// Relative standard error of the modulus that the bench finds.
const MODULUS: f64 = 0.03;
/// Presses of a calibration, on a disc that reaches this much beyond the claimed one, m.
const HOLES: u32 = 50;
const BEYOND_M: f64 = 2e-3;
/// Scans of the untouched sensor: their mean is the zero, their scatter the noise.
const BASELINE: u32 = 64;
/// Quantisation falls with the length of a conversion: half of that at 140 scans/s.
pub(super) const SCANS_PER_S: f64 = 80.0;
/// Steps on the way down in which the layer's creep is followed.
const WAY_DOWN: u32 = 8;
/// Time of the way down, and from its end to the reading, s; each press takes 0.8 to 1.25 of both.
const WAY_DOWN_S: f64 = 0.5;
const HELD_S: f64 = 0.2;
/// Stated relative uncertainty of a declared radius.
const DECLARED: f64 = 0.05;
/// Standard deviation of ln a over the calibrated radii.
const ANY_RADIUS: f64 = 0.58;

/// Kinds of array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Kind {
    /// Four coils, and a declared indenter.
    ThreeAroundOne,
    /// Seven coils.
    Seven,
}

impl Kind {
    pub(super) const ALL: [Self; 2] = [Self::ThreeAroundOne, Self::Seven];

    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::ThreeAroundOne => "three-around-one",
            Self::Seven => "seven",
        }
    }

    fn layout(self) -> Layout {
        match self {
            Self::ThreeAroundOne => Layout::three_around_one(),
            Self::Seven => Layout::seven(),
        }
    }

    const fn is_declared(self) -> bool {
        matches!(self, Self::ThreeAroundOne)
    }

    /// Radius of the disc within which presses are claimed, m.
    pub(super) const fn reach_m(self) -> f64 {
        match self {
            Self::ThreeAroundOne => 2.8e-3,
            Self::Seven => 5.6e-3,
        }
    }
}

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
    /// In place of the tip that is declared.
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

/// A sensor with its bench.
pub(super) struct Rig<'a> {
    kind: Kind,
    sensor: &'a TouchSensor,
    chance: Stream,
    sequence: Sequence,
    /// The layer as the bench knows it.
    layer: BenchLayer,
    runs: u64,
    rest_hz: Vec<f64>,
    /// Standard deviation of a reading by its noise.
    noise: f64,
}

/// Draws a sensor.
pub(super) fn draw(kind: Kind, seed: u64) -> Result<TouchSensor, Failure> {
    let drawn = TouchParameters::draw(&kind.layout(), &LAYER, seed).map_err(LoadError::from)?;
    let sensor = TouchSensor::new(drawn);
    if let [[one, other], ..] = sensor.locked()[..] {
        return Err(Failure::Refused(format!(
            "coils {one} and {other} lock to one frequency"
        )));
    }
    Ok(sensor)
}

impl<'a> Rig<'a> {
    pub(super) fn new(kind: Kind, sensor: &'a TouchSensor) -> Self {
        let p = sensor.parameters();
        let mut chance = Stream::named(p.seed, "campaign.touch");
        // The bench presses as slowly, so that it finds the modulus of a layer that crept as far.
        let middle_s = HELD_S + 0.5 * WAY_DOWN_S;
        let crept = p
            .creep
            .iter()
            .map(|mode| mode.amplitude * (1.0 - (-middle_s / mode.tau_s).exp()));
        let relaxed_pa = p.layer.shear_modulus_pa / (1.0 + crept.sum::<f64>());
        let layer = BenchLayer {
            thickness_m: LAYER.thickness_m,
            shear_modulus_pa: relaxed_pa * (MODULUS * chance.normal()).exp(),
        };
        let mut rig = Self {
            kind,
            sensor,
            chance,
            sequence: Sequence::of_rate(SCANS_PER_S, 4),
            layer,
            runs: 0,
            rest_hz: Vec::new(),
            noise: 0.0,
        };
        rig.rest();
        rig
    }

    /// Readings of the untouched sensor: its frequencies, and the noise of a reading.
    fn rest(&mut self) {
        let pin = Indenter::Pin { radius_m: 1e-3 };
        let mut lifted = self.sensor.pressed_by(&pin, [0.0; 2], 0);
        let press = Press {
            place_m: [0.0; 2],
            demand: Demand::Depth(-1e-3),
        };
        let none = Surroundings::default();
        let scans: Vec<_> = (0..BASELINE)
            .map(|scan| {
                lifted.scan(
                    f64::from(scan) / SCANS_PER_S,
                    &self.sequence,
                    |_| press,
                    &none,
                )
            })
            .collect();
        let count = f64::from(BASELINE);
        let mut square = 0.0;
        for coil in 0..self.sensor.parameters().coils.len() {
            let all = scans.iter().map(|scan| scan.coils[coil].frequency_hz);
            let mean_hz = all.clone().sum::<f64>() / count;
            square += all.map(|hz| (hz / mean_hz - 1.0).powi(2)).sum::<f64>() / (count - 1.0);
            self.rest_hz.push(mean_hz);
        }
        // A reading is twice the relative frequency.
        let coils = self.rest_hz.len() as f64;
        self.noise = 2.0 * (square / coils * (1.0 + 1.0 / count)).sqrt();
    }

    /// Calibrates the sensor.
    pub(super) fn calibrated(&mut self) -> Result<(ArrayCalibration, model::Array), String> {
        let reach_m = self.kind.reach_m();
        let known = self.known_presses(reach_m + BEYOND_M);
        let layout = self.kind.layout();
        let design = Design {
            coils_m: layout.coils.iter().map(|coil| coil.centre_m).collect(),
            place_tolerance_m: 0.15e-3,
            gain_tolerance: 0.05,
            noise: self.noise,
            scales: Scales {
                spacing_m: 2e-3,
                radii_m: RADII_M,
            },
            reach_m,
            radius_in_use: if self.kind.is_declared() {
                DECLARED
            } else {
                ANY_RADIUS
            },
            bench: BENCH,
        };
        let calibration = calibrate(&design, &known).map_err(|error| error.to_string())?;
        let array = array(&calibration, self.noise, reach_m).ok_or("not an array")?;
        Ok((calibration, array))
    }

    /// Presses of the bench on a lattice of holes, with its errors.
    fn known_presses(&mut self, outer_m: f64) -> Vec<KnownPress> {
        const GOLDEN_RAD: f64 = 2.399_963;
        let sensor = self.sensor;
        let tool = |tip: &Tip| (*tip, sensor.pressed_by(&indenter(*tip), [0.0; 2], 0));
        let tools: Vec<_> = TIPS.iter().map(tool).collect();
        let common = BENCH.common;
        let off_m = [0; 2].map(|_| common.place_m * self.chance.normal());
        let [force, radius] =
            [common.ln_force, common.ln_radius].map(|of| (of * self.chance.normal()).exp());
        let mut known = Vec::new();
        for (hole, (tip, tool)) in (0..HOLES).map(f64::from).zip(tools.iter().cycle()) {
            let r_m = outer_m * ((hole + 0.5) / f64::from(HOLES)).sqrt();
            let (sin, cos) = (GOLDEN_RAD * hole).sin_cos();
            let place_m = [r_m * cos, r_m * sin];
            let at_m = [0, 1].map(|i| place_m[i] + off_m[i] + BENCH.place_m * self.chance.normal());
            let pressed = loop {
                let depth_m = self.depth_m();
                let pressed = self.pressed((*tip, tool), at_m, depth_m, &Manner::default());
                if (RADII_M[0]..RADII_M[1]).contains(&pressed.radius_m) {
                    break pressed;
                }
            };
            let force_n = pressed.force_n * force * (BENCH.force * self.chance.normal()).exp();
            let size = radius * (BENCH.radius * self.chance.normal()).exp();
            known.push(KnownPress {
                place_m,
                force_n,
                radius_m: size * tip.contact_radius_m(&self.layer, force_n),
                readings: pressed.readings,
            });
        }
        known
    }

    /// A random press inside.
    pub(super) fn anywhere(&mut self, manner: &Manner) -> Pressed {
        let place_m = self.place_m();
        self.press(place_m, manner)
    }

    pub(super) fn place_m(&mut self) -> [f64; 2] {
        let r_m = self.kind.reach_m() * self.chance.uniform().sqrt();
        let (sin, cos) = self.chance.between(0.0, TAU).sin_cos();
        [r_m * cos, r_m * sin]
    }

    fn depth_m(&mut self) -> f64 {
        let [shallow_m, deep_m] = DEPTHS_M;
        self.chance.log_between(shallow_m, deep_m)
    }

    /// A press by a random ball or pin whose radius of contact is to be judged.
    fn press(&mut self, place_m: [f64; 2], manner: &Manner) -> Pressed {
        let [least_m, greatest_m] = JUDGED_M;
        loop {
            let depth_m = self.depth_m();
            let radius_m = self.chance.log_between(least_m, greatest_m);
            let tip = if self.chance.uniform() < 0.5 {
                Tip::Pin(radius_m / PIN)
            } else {
                // On a half-space.
                Tip::Ball(radius_m * radius_m / depth_m)
            };
            if matches!(tip, Tip::Ball(of_m) if !(BALLS_M[0]..BALLS_M[1]).contains(&of_m)) {
                continue;
            }
            let presser = manner.instead.unwrap_or_else(|| indenter(tip));
            let tool = self.sensor.pressed_by(&presser, manner.drag, 0);
            let pressed = self.pressed((tip, &tool), place_m, depth_m, manner);
            if manner.instead.is_some() || (least_m..greatest_m).contains(&pressed.radius_m) {
                return pressed;
            }
        }
    }

    fn pressed(
        &mut self,
        (tip, tool): (Tip, &Pressing<'_>),
        place_m: [f64; 2],
        depth_m: f64,
        manner: &Manner,
    ) -> Pressed {
        self.runs += 1;
        let mut pressing = tool.again(self.runs);
        let around = &manner.around;
        let down_s = manner.slower * WAY_DOWN_S * self.chance.log_between(0.8, 1.25);
        let held_s = manner.slower * HELD_S * self.chance.log_between(0.8, 1.25);
        let path = |time_s: f64| Press {
            place_m,
            demand: Demand::Depth(depth_m * (time_s / down_s).clamp(0.0, 1.0)),
        };
        for step in 0..=WAY_DOWN {
            let time_s = down_s * f64::from(step) / f64::from(WAY_DOWN);
            pressing.follow(time_s, &path(time_s), around);
        }
        let scan = pressing.scan(down_s + held_s, &self.sequence, path, around);
        let pairs = self.rest_hz.iter().zip(&scan.coils);
        let readings = pairs.map(|(rest_hz, coil)| (rest_hz / coil.frequency_hz).powi(2) - 1.0);
        let (truth, is_pin) = (scan.truth, matches!(tip, Tip::Pin(_)));
        Pressed {
            place_m: truth.place_m,
            force_n: truth.force_n,
            radius_m: if is_pin { PIN } else { 1.0 } * truth.radius_m,
            readings: readings.collect(),
            indenter: self.declared(tip),
        }
    }

    /// What is declared of a tip. A ball's radius of contact is that at 1 N; by Hertz it grows with the
    /// cube root of the force.
    fn declared(&mut self, tip: Tip) -> model::Indenter {
        if !self.kind.is_declared() {
            return model::Indenter::Unknown;
        }
        let off = (DECLARED * self.chance.normal()).exp();
        let exponent = match tip {
            Tip::Pin(_) => 0.0,
            Tip::Ball(_) => 1.0 / 3.0,
        };
        model::Indenter::Declared {
            at_one_newton: Metre((off * tip.contact_radius_m(&self.layer, 1.0)) as f32),
            exponent,
            uncertainty: DECLARED as f32,
        }
    }
}

fn indenter(tip: Tip) -> Indenter {
    match tip {
        Tip::Pin(radius_m) => Indenter::Pin { radius_m },
        Tip::Ball(radius_m) => Indenter::Ball { radius_m },
    }
}
