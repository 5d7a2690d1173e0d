//! A drawn touch sensor, calibrated by presses on its own bench.

use std::fmt::Write as _;

use palpate_calibration::touch::{
    ArrayCalibration, Bench, CommonError, DeclaredIndenter, Design, KnownPress,
    Layer as BenchLayer, Scales, Tip, calibrate,
};
use palpate_cli::failure::Failure;
use palpate_sim::random::Stream;
use palpate_sim::stack::LoadError;
use palpate_sim::touch::{
    Demand, Indenter, Layer, Layout, Press, Pressing, Sequence, Surroundings, TouchSensor,
    TouchTruth,
};
use palpate_wire::Command;

/// A layer of a soft silicone: the presses are of 0.02 to 1 N.
const LAYER: Layer = Layer {
    thickness_m: 5e-3,
    shear_modulus_pa: 100e3,
    poisson: 0.5,
};
/// Depths of the bench's presses, m: the readings of deeper ones grow by more than the second order; in
/// shallower ones noise outweighs all other errors.
pub const DEPTHS_M: [f64; 2] = [0.15e-3, 0.4e-3];
/// Calibrated radii of contact, m.
pub const RADII_M: [f64; 2] = [0.8e-3, 6e-3];
/// Distance of the knots of the profile, m.
const SPACING_M: f64 = 2e-3;
const PLACE_TOLERANCE_M: f64 = 0.15e-3;
const GAIN_TOLERANCE: f64 = 0.05;
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
/// Standard errors of the bench.
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
/// Number of presses of a calibration, and how far their disc reaches beyond the claimed one, m.
const HOLES: u32 = 50;
const BEYOND_M: f64 = 2e-3;
/// Relative standard error of the modulus that the bench finds.
const MODULUS: f64 = 0.03;
/// Time of a press's way down, and from its end to the reading, s; a press takes 0.8 to 1.25 times both.
const WAY_DOWN_S: f64 = 0.5;
const HELD_S: f64 = 0.2;
/// Steps of the way down in which the layer's creep is followed.
const WAY_DOWN: u32 = 8;
/// Scans of the untouched sensor: their mean is the zero, their scatter the noise.
const BASELINE: u32 = 64;
/// Placeholder for the tip where only the array's coils matter.
pub(super) const ANY_TIP: Tip = Tip::Pin(1e-3);
/// Stated relative uncertainty of a declared radius.
pub const DECLARED: f64 = 0.05;
/// A pin counts as a contact of this factor times its radius, sqrt(5/3): `palpate_model::touch`.
pub const PIN: f64 = 1.290_994;
/// Standard deviation of a number that is somewhere between 0 and 1.
const UNIFORM: f64 = 0.288_675;

/// Built-in arrays.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Four coils on one converter, with a declared indenter.
    ThreeAroundOne,
    /// Seven coils on two converters.
    Seven,
}

impl Kind {
    /// All kinds with their names.
    pub const NAMED: [(&str, Self); 2] = [
        ("three-around-one", Self::ThreeAroundOne),
        ("seven", Self::Seven),
    ];

    fn layout(self) -> Layout {
        match self {
            Self::ThreeAroundOne => Layout::three_around_one(),
            Self::Seven => Layout::seven(),
        }
    }

    /// Radius of the disc within which presses are claimed, m.
    pub const fn reach_m(self) -> f64 {
        match self {
            Self::ThreeAroundOne => 2.8e-3,
            Self::Seven => 5.6e-3,
        }
    }

    /// Whether the indenter has to be declared.
    pub const fn is_declared(self) -> bool {
        matches!(self, Self::ThreeAroundOne)
    }
}

/// A press of the bench's table.
#[derive(Clone, Debug)]
pub struct TablePress {
    /// The tip that pressed.
    pub tip: Tip,
    /// Place, force, radius and readings, as the bench knows them.
    pub known: KnownPress,
}

/// Where and how deep a press goes, and how it differs from those of the bench.
#[derive(Clone, Copy, Debug)]
pub struct Way<'a> {
    /// Its place, m.
    pub place_m: [f64; 2],
    /// Its depth, m.
    pub depth_m: f64,
    /// Times of the way down and before the reading, over those of the bench.
    pub slower: f64,
    /// Surroundings of the sensor.
    pub around: &'a Surroundings,
}

/// A drawn sensor with its bench.
#[derive(Debug)]
pub struct TouchBench {
    /// Kind of the array.
    pub kind: Kind,
    /// The sensor.
    pub sensor: TouchSensor,
    /// What is known of array and bench beforehand.
    pub design: Design,
    /// The presses.
    pub presses: Vec<TablePress>,
    /// The layer as the bench knows it.
    pub layer: BenchLayer,
    /// Order and times of the conversions of a scan.
    pub sequence: Sequence,
    /// Frequencies of the untouched sensor, Hz.
    rest_hz: Vec<f64>,
}

impl TouchBench {
    /// Draws a sensor, and presses it on its bench at a rate of scans, 1/s.
    ///
    /// # Errors
    /// If the built-in disturbances cannot be read, or two of its coils would lock to one frequency.
    pub fn drawn(kind: Kind, seed: u64, scans_per_s: f64) -> Result<Self, Failure> {
        let sensor = TouchSensor::draw(&kind.layout(), &LAYER, seed).map_err(LoadError::from)?;
        if let [[one, other], ..] = sensor.locked()[..] {
            return Err(Failure::Refused(format!(
                "coils {one} and {other} lock to one frequency"
            )));
        }
        let mut chance = Stream::named(seed, "touch.bench");
        let layer = known_layer(&sensor, &mut chance);
        let sequence = Sequence::of_rate(scans_per_s, 4);
        let (rest_hz, noise) = untouched(&sensor, &sequence, scans_per_s);
        let [least_m, greatest_m] = RADII_M;
        let design = Design {
            coils_m: kind.layout().coils.iter().map(|of| of.centre_m).collect(),
            place_tolerance_m: PLACE_TOLERANCE_M,
            gain_tolerance: GAIN_TOLERANCE,
            noise,
            scales: Scales {
                spacing_m: SPACING_M,
                radii_m: RADII_M,
            },
            reach_m: kind.reach_m(),
            radius_in_use: if kind.is_declared() {
                DECLARED
            } else {
                UNIFORM * (greatest_m / least_m).ln()
            },
            bench: BENCH,
        };
        let mut bench = Self {
            kind,
            sensor,
            design,
            presses: Vec::new(),
            layer,
            sequence,
            rest_hz,
        };
        bench.presses = bench.pressed_all_over(&mut chance);
        Ok(bench)
    }

    /// Readings of one scan of a press, and its truth.
    pub fn read(
        &self,
        mut pressing: Pressing<'_>,
        chance: &mut Stream,
        way: Way<'_>,
    ) -> (Vec<f64>, TouchTruth) {
        let mut some = |of_s: f64| way.slower * of_s * chance.log_between(0.8, 1.25);
        let [down_s, held_s] = [some(WAY_DOWN_S), some(HELD_S)];
        let path = |time_s: f64| Press {
            place_m: way.place_m,
            demand: Demand::Depth(way.depth_m * (time_s / down_s).clamp(0.0, 1.0)),
        };
        for step in 0..=WAY_DOWN {
            let time_s = down_s * f64::from(step) / f64::from(WAY_DOWN);
            pressing.follow(time_s, &path(time_s), way.around);
        }
        let scan = pressing.scan(down_s + held_s, &self.sequence, path, way.around);
        let pairs = self.rest_hz.iter().zip(&scan.coils);
        let readings = pairs.map(|(rest_hz, coil)| (rest_hz / coil.frequency_hz).powi(2) - 1.0);
        (readings.collect(), scan.truth)
    }

    /// Presses on a lattice of holes, known with the errors of the bench.
    fn pressed_all_over(&self, chance: &mut Stream) -> Vec<TablePress> {
        const GOLDEN_RAD: f64 = 2.399_963;
        let tool = |tip: &Tip| (*tip, self.sensor.pressed_by(&indenter(*tip), [0.0; 2], 0));
        let tools: Vec<_> = TIPS.iter().map(tool).collect();
        let common = BENCH.common;
        let off_m = [0; 2].map(|_| common.place_m * chance.normal());
        let [force, radius] =
            [common.ln_force, common.ln_radius].map(|of| (of * chance.normal()).exp());
        let outer_m = self.kind.reach_m() + BEYOND_M;
        let around = Surroundings::default();
        let [least_m, greatest_m] = RADII_M;
        let mut all = Vec::new();
        let mut runs = 0..;
        for (hole, (tip, tool)) in (0..HOLES).map(f64::from).zip(tools.iter().cycle()) {
            let r_m = outer_m * ((hole + 0.5) / f64::from(HOLES)).sqrt();
            let (sin, cos) = (GOLDEN_RAD * hole).sin_cos();
            let place_m = [r_m * cos, r_m * sin];
            let at_m = [0, 1].map(|i| place_m[i] + off_m[i] + BENCH.place_m * chance.normal());
            let (readings, truth) = loop {
                let way = Way {
                    place_m: at_m,
                    depth_m: depth_m(chance),
                    slower: 1.0,
                    around: &around,
                };
                let run = runs.next().unwrap_or_default();
                let (readings, truth) = self.read(tool.again(run), chance, way);
                if (least_m..greatest_m).contains(&counted_radius_m(*tip, &truth)) {
                    break (readings, truth);
                }
            };
            let force_n = truth.force_n * force * (BENCH.force * chance.normal()).exp();
            let size = radius * (BENCH.radius * chance.normal()).exp();
            all.push(TablePress {
                tip: *tip,
                known: KnownPress {
                    place_m,
                    force_n,
                    radius_m: size * tip.contact_radius_m(&self.layer, force_n),
                    readings,
                },
            });
        }
        all
    }

    /// Calibrates the sensor.
    ///
    /// # Errors
    /// If the presses do not determine the profile.
    pub fn calibrated(&self) -> Result<ArrayCalibration, Failure> {
        let known: Vec<_> = self.presses.iter().map(|of| of.known.clone()).collect();
        calibrate(&self.design, &known).map_err(Failure::refused)
    }

    /// Bits of the channels that the coils have, from the lowest.
    pub fn channels(&self) -> u8 {
        ((1_u32 << self.design.coils_m.len()) - 1) as u8
    }

    /// The commands that set the array on a board, for touches by this tip.
    pub fn commands(&self, calibration: &ArrayCalibration, tip: Tip) -> Vec<Command> {
        let indenter = self.kind.is_declared().then(|| DeclaredIndenter {
            radius_m: tip.contact_radius_m(&self.layer, 1.0),
            exponent: exponent(tip),
            uncertainty: DECLARED,
        });
        calibration.commands(self.channels(), indenter)
    }

    /// The design as `palpate calibrate-touch` takes it, without a declared indenter.
    pub fn design_file(&self) -> String {
        let Design { scales, bench, .. } = &self.design;
        let mm = |of_m: f64| 1e3 * of_m;
        let coils: Vec<_> = self.design.coils_m.iter().map(|of| of.map(mm)).collect();
        let channels: Vec<_> = (0..coils.len()).collect();
        format!(
            "channels = {channels:?}\ncoils_mm = {coils:?}\nplace_tolerance_mm = {}\ngain_tolerance = {}\nnoise = {:e}\n\
             spacing_mm = {}\nradii_mm = {:?}\nreach_mm = {}\nlayer_mm = {}\nshear_modulus_kpa = {}\n\n[bench]\n\
             place_mm = {}\nforce = {}\nradius = {}\ncommon_place_mm = {}\ncommon_force = {}\ncommon_radius = {}\n",
            mm(self.design.place_tolerance_m),
            self.design.gain_tolerance,
            self.design.noise,
            mm(scales.spacing_m),
            scales.radii_m.map(mm),
            mm(self.design.reach_m),
            mm(self.layer.thickness_m),
            1e-3 * self.layer.shear_modulus_pa,
            mm(bench.place_m),
            bench.force,
            bench.radius,
            mm(bench.common.place_m),
            bench.common.ln_force,
            bench.common.ln_radius,
        )
    }

    /// The presses as `palpate calibrate-touch` takes them.
    pub fn table(&self) -> String {
        let mut text = "x_mm,y_mm,force_n,tip,tip_radius_mm".to_owned();
        // Writing to a `String` cannot fail.
        for coil in 0..self.design.coils_m.len() {
            let _ = write!(text, ",reading_{coil}");
        }
        for TablePress { tip, known } in &self.presses {
            let [x_mm, y_mm] = known.place_m.map(|of| 1e3 * of);
            let (name, radius_m) = match tip {
                Tip::Pin(radius_m) => ("pin", radius_m),
                Tip::Ball(radius_m) => ("ball", radius_m),
            };
            let _ = write!(
                text,
                "\n{x_mm:.4},{y_mm:.4},{:.6},{name},{}",
                known.force_n,
                1e3 * radius_m
            );
            for reading in &known.readings {
                let _ = write!(text, ",{reading:.8}");
            }
        }
        text + "\n"
    }
}

/// The layer as the bench finds it, by presses as slow as the others, so that it has crept as far.
fn known_layer(sensor: &TouchSensor, chance: &mut Stream) -> BenchLayer {
    let parameters = sensor.parameters();
    let middle_s = HELD_S + 0.5 * WAY_DOWN_S;
    let crept = parameters
        .creep
        .iter()
        .map(|mode| mode.amplitude * (1.0 - (-middle_s / mode.tau_s).exp()));
    let relaxed_pa = parameters.layer.shear_modulus_pa / (1.0 + crept.sum::<f64>());
    BenchLayer {
        thickness_m: LAYER.thickness_m,
        shear_modulus_pa: relaxed_pa * (MODULUS * chance.normal()).exp(),
    }
}

/// Frequencies of the untouched sensor, Hz, and the standard deviation of a reading by its noise, as
/// relative change of inductance.
fn untouched(sensor: &TouchSensor, sequence: &Sequence, scans_per_s: f64) -> (Vec<f64>, f64) {
    let mut lifted = sensor.pressed_by(&Indenter::Pin { radius_m: 1e-3 }, [0.0; 2], 0);
    let scans: Vec<_> = (0..BASELINE)
        .map(|scan| {
            let start_s = f64::from(scan) / scans_per_s;
            lifted.scan(start_s, sequence, |_| LIFTED, &Surroundings::default())
        })
        .collect();
    let count = f64::from(BASELINE);
    let (mut rest_hz, mut square) = (Vec::new(), 0.0);
    for coil in 0..sensor.parameters().coils.len() {
        let all = scans.iter().filter_map(|scan| scan.coils.get(coil));
        let all = all.map(|reading| reading.frequency_hz);
        let mean_hz = all.clone().sum::<f64>() / count;
        square += all.map(|hz| (hz / mean_hz - 1.0).powi(2)).sum::<f64>() / (count - 1.0);
        rest_hz.push(mean_hz);
    }
    // A reading is twice the relative frequency, and its zero a mean as well.
    let coils = rest_hz.len() as f64;
    let noise = 2.0 * (square / coils * (1.0 + 1.0 / count)).sqrt();
    (rest_hz, noise)
}

/// An indenter above the layer.
pub(super) const LIFTED: Press = Press {
    place_m: [0.0; 2],
    demand: Demand::Depth(-1e-3),
};

/// A random depth, m.
pub fn depth_m(chance: &mut Stream) -> f64 {
    let [shallow_m, deep_m] = DEPTHS_M;
    chance.log_between(shallow_m, deep_m)
}

/// Radius of contact that an estimate stands for, m: a pin counts with more than its own.
pub fn counted_radius_m(tip: Tip, truth: &TouchTruth) -> f64 {
    match tip {
        Tip::Pin(_) => PIN * truth.radius_m,
        Tip::Ball(_) => truth.radius_m,
    }
}

/// Exponent of the force in the radius of contact: by Hertz a third for a ball.
pub const fn exponent(tip: Tip) -> f64 {
    match tip {
        Tip::Pin(_) => 0.0,
        Tip::Ball(_) => 1.0 / 3.0,
    }
}

/// A tip as an indenter.
pub fn indenter(tip: Tip) -> Indenter {
    match tip {
        Tip::Pin(radius_m) => Indenter::Pin { radius_m },
        Tip::Ball(radius_m) => Indenter::Ball { radius_m },
    }
}
