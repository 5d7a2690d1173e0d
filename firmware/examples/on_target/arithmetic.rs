//! Runs every arithmetic function of the model on a table of inputs; each gives a checksum over the bits
//! of its results.

use palpate_model::calibration_curve::MonotoneCurve;
use palpate_model::contact::{Baseline, Cusum, Detector, Touch, Watch};
use palpate_model::demagnetising::Burst;
use palpate_model::layer::{BondedDisc, apparent_modulus};
use palpate_model::magnetorheological::{Saturating, Stiffening, Tabulated, attraction, deviation};
use palpate_model::math;
use palpate_model::ramp::{
    Basis, DriftModel, Fit, LoadRatio, LoadStiffness, Noise, Ramp, RampSample, Reference, Scatter,
    Term,
};
use palpate_model::springs::{Shares, Springs, two_state_load};
use palpate_model::tank::{relative_frequency_change, relative_inductance_change};
use palpate_model::thermal::{Copper, Temperatures, TwoNode};
use palpate_model::uncertainty::{Calibration, OperatingPoint};
use palpate_model::units::*;

/// Number of inputs of each function.
const INPUTS: u32 = 100;

/// Pseudo-random numbers that are the same on every target, since they come from integer arithmetic.
pub struct Inputs(u32);

impl Inputs {
    /// Returns random bits.
    fn bits(&mut self) -> u32 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 17;
        self.0 ^= self.0 << 5;
        self.0
    }

    /// Returns any number, including zeros, subnormals, infinities and NaN.
    fn any(&mut self) -> f32 {
        let bits = self.bits();
        f32::from_bits(match bits % 16 {
            0 => bits & 0x8000_0000,
            1 => bits & 0x807F_FFFF,
            2 => bits | 0x7F80_0000,
            // Magnitude from 0.5 up to, but not including, 2, with either sign.
            3..=11 => bits & 0x80FF_FFFF | 0x3F00_0000,
            _ => bits,
        })
    }

    /// Returns a number from `low` to `high`.
    fn within(&mut self, low: f32, high: f32) -> f32 {
        let part = f32::from_bits(self.bits() >> 9 | 0x3F80_0000) - 1.0;
        low + (high - low) * part
    }
}

/// Checksum over bits (FNV-1a, with words instead of bytes).
pub struct Sum(pub u32);

impl Sum {
    /// Initial value of the FNV-1a checksum.
    pub const NEW: Self = Self(0x811C_9DC5);

    /// Adds a word.
    pub fn word(&mut self, word: u32) {
        self.0 = (self.0 ^ word).wrapping_mul(0x0100_0193).rotate_left(5);
    }

    /// Adds a number. Every NaN adds the same bits: IEEE 754 does not specify its payload.
    pub fn number(&mut self, number: f32) {
        let canonical = if number.is_nan() { f32::NAN } else { number };
        self.word(canonical.to_bits());
    }

    fn numbers<const N: usize>(&mut self, numbers: [f32; N]) {
        for number in numbers {
            self.number(number);
        }
    }
}

/// A function that is called on inputs and adds its results to a checksum.
pub type Check = fn(&mut Inputs, &mut Sum) -> Option<()>;

/// Returns the checksum of a function over all its inputs. An input that the function refuses changes
/// the checksum as well.
pub fn sum(check: Check) -> u32 {
    let mut inputs = Inputs(0x2545_F491);
    let mut sum = Sum::NEW;
    for _ in 0..INPUTS {
        let accepted = check(&mut inputs, &mut sum).is_some();
        sum.word(accepted.into());
    }
    sum.0
}

/// Number of functions in [`CHECKS`].
pub const COUNT: usize = 39;

/// All checked functions, with their names.
pub const CHECKS: [(&str, Check); COUNT] = [
    ("add, subtract, multiply, divide", |from, to| {
        let (a, b) = (from.any(), from.any());
        to.numbers([a + b, a - b, a * b, a / b, -a, a.abs()]);
        to.word(u32::from(a < b) | u32::from(a == b) << 1 | u32::from(a >= b) << 2);
        Some(())
    }),
    ("to and from whole numbers", |from, to| {
        let (number, bits) = (from.any(), from.bits());
        to.word(number as i32 as u32);
        to.word(number as u32);
        to.word(number as u16 as u32);
        to.word((number as u64 >> 7) as u32);
        to.numbers([
            bits as f32,
            bits as i32 as f32,
            (u64::from(bits) << 11) as f32,
        ]);
        Some(())
    }),
    ("f64", |from, to| {
        let (a, b) = (f64::from(from.any()), f64::from(from.any()));
        to.numbers([
            (a + b) as f32,
            (a * b) as f32,
            (a / b) as f32,
            (a - b) as f32,
        ]);
        Some(())
    }),
    ("math: square root, logarithms", |from, to| {
        let x = from.any();
        to.numbers([math::sqrt(x), math::ln(x), math::ln_1p(x)]);
        to.number(math::ln_1p(from.within(-0.9, 3.0)));
        Some(())
    }),
    ("math: exponentials", |from, to| {
        let x = from.within(-90.0, 90.0);
        to.numbers([math::exp(x), math::exp_m1(x), math::exp_m1(x * 1e-3)]);
        Some(())
    }),
    ("math: sine, cosine", |from, to| {
        let x = from.within(-1e3, 1e3);
        to.numbers([math::sin(x), math::cos(x)]);
        Some(())
    }),
    ("math: floor, hypotenuse", |from, to| {
        let (a, b) = (from.any(), from.any());
        to.numbers([math::floor(a), math::hypot(a, b)]);
        Some(())
    }),
    ("units: differences and quotients", |from, to| {
        let (a, b) = (from.any(), from.any());
        to.number((Metre(a) - Metre(b)).0);
        to.number(Metre(a) / Metre(b));
        to.number((NewtonPerMetre(a) * Metre(b)).0);
        to.number((Newton(a) / NewtonPerMetre(b)).0);
        to.number((Celsius(a) - Celsius(b)).0);
        to.number(Metre::positive(a).ok()?.0);
        Some(())
    }),
    ("tank: changes", |from, to| {
        let reference = from.bits() >> 4;
        let change = relative_frequency_change(reference, reference ^ from.bits() >> 16);
        to.number(change);
        to.number(relative_inductance_change(change));
        let change = from.within(-0.3, 0.3);
        to.number(relative_inductance_change(change));
        Some(())
    }),
    ("calibration curve", |from, to| {
        let curve = curve(from)?;
        let x = from.within(-0.05, 0.25);
        let point = curve.at(x);
        to.numbers([
            point.value,
            point.sigma(1e-6),
            curve.domain().0,
            curve.domain().1,
        ]);
        for (x, y) in curve.points() {
            to.numbers([x, y]);
        }
        Some(())
    }),
    ("springs", |from, to| {
        let mut spring = || NewtonPerMetre(from.within(1e2, 1e5));
        let springs = Springs {
            load: spring(),
            sensing: spring(),
            actuated: spring(),
        };
        let shares = springs.shares();
        to.numbers([
            springs.in_series().0,
            shares.load,
            shares.sensing,
            shares.actuated,
        ]);
        to.number(Shares::new(from.within(0.1, 10.0), from.within(0.1, 10.0)).load);
        Some(())
    }),
    ("springs: two states", |from, to| {
        let sensing = NewtonPerMetre(from.within(1e3, 1e4));
        let actuated = [0, 1].map(|_| NewtonPerMetre(from.within(1e3, 1e4)));
        let deformation = [0, 1].map(|_| Metre(from.within(1e-5, 1e-3)));
        to.number(two_state_load(sensing, actuated, deformation).0);
        Some(())
    }),
    ("layer", |from, to| {
        let disc = BondedDisc::new(Metre(from.within(1e-3, 0.1)), Metre(from.within(1e-3, 0.1)));
        let disc = disc.ok()?;
        let modulus = Pascal(from.within(1e4, 1e6));
        to.numbers([disc.shape_factor(), disc.stiffness(modulus).0]);
        to.number(apparent_modulus(modulus, from.within(0.1, 10.0)).0);
        Some(())
    }),
    ("demagnetising", |from, to| {
        let amplitude = Ampere(from.within(1.0, 15.0));
        let burst = Burst::new(
            amplitude,
            Second(from.within(0.01, 0.5)),
            Hertz(from.within(5.0, 100.0)),
        );
        let burst = burst.ok()?;
        to.number(burst.current(Second(from.within(0.0, 2.0))).0);
        to.number(burst.duration(Ampere(from.within(1e-3, 1.0))).0);
        Some(())
    }),
    ("stiffening: law", |from, to| {
        let law = law(from)?;
        let current = Ampere(from.within(-15.0, 15.0));
        let rise = law.rise(current);
        to.numbers([
            rise.value,
            rise.per_ampere,
            law.spring(current).0,
            law.rise_at_peak(),
        ]);
        to.number(law.logarithmic_slope(current));
        to.number(law.reference_ratio(NewtonPerMetre(6e3)));
        let regressor = law.regressor(NewtonPerMetre(6e3), current);
        to.numbers([regressor.deviation, regressor.per_ampere]);
        let pull = attraction(
            Newton(from.within(0.0, 1.0)),
            law.spring(current),
            Metre(3e-4),
        );
        to.number(pull);
        Some(())
    }),
    ("stiffening: curve", |from, to| {
        let curve = curve(from)?;
        let law = Tabulated::new(NewtonPerMetre(from.within(1e3, 1e4)), curve).ok()?;
        let rise = law.rise(Ampere(from.within(-0.2, 0.2)));
        to.numbers([rise.value, rise.per_ampere, law.at_rest().0]);
        Some(())
    }),
    ("stiffening: deviation", |from, to| {
        to.number(deviation(from.within(0.1, 10.0), from.within(0.0, 0.3)));
        Some(())
    }),
    ("thermal: copper", |from, to| {
        let copper = Copper(Ohm(from.within(0.1, 1.0)));
        let temperature = Celsius(from.within(-20.0, 120.0));
        to.number(copper.resistance(temperature).0);
        to.number(copper.heat(Ampere(from.within(0.0, 15.0)), temperature).0);
        Some(())
    }),
    ("thermal: two nodes", |from, to| {
        let stack = stack(from)?;
        let start = Temperatures {
            copper: Celsius(from.within(20.0, 80.0)),
            pad: Celsius(from.within(20.0, 60.0)),
        };
        let power = Watt(from.within(0.0, 50.0));
        let duration = Second(from.within(1e-3, 10.0));
        let after = stack.after(start, power, Celsius(22.0), duration);
        to.numbers([after.copper.0, after.pad.0, stack.copper_capacity().0]);
        Some(())
    }),
    ("thermal: pulse", |from, to| {
        let stack = stack(from)?;
        let start = Temperatures::uniform(Celsius(from.within(10.0, 40.0)));
        let (copper, current) = (Copper(Ohm(0.39)), Ampere(from.within(1.0, 15.0)));
        let (ambient, duration) = (Celsius(22.0), Second(from.within(0.1, 2.0)));
        let after = stack.after_pulse(start, copper, current, ambient, duration, Celsius(80.0))?;
        to.numbers([after.copper.0, after.pad.0]);
        Some(())
    }),
    ("contact: baseline", |from, to| {
        let mut baseline = Baseline::new(from.within(1.0, 1e3));
        for _ in 0..10 {
            let interval = Second(from.within(1e-4, 1e-2));
            let off = baseline.deviation(interval, Metre(from.within(0.0, 1e-6)));
            baseline.learn(interval, off);
            to.numbers([off.from_line.0, off.rise.0, baseline.rate()]);
        }
        to.word(baseline.readings());
        Some(())
    }),
    ("contact: cumulative sum", |from, to| {
        let cusum = Cusum::WATCH;
        let sum = cusum.after(from.within(0.0, 10.0), from.within(-5.0, 5.0));
        to.number(sum);
        to.word(cusum.alarms(sum).into());
        to.number(cusum.average_run_length(from.within(0.0, 3.0)));
        Some(())
    }),
    ("contact: detector", |from, to| {
        let watch = Watch {
            settling: 20,
            memory: 20.0,
            ..Watch::new(Metre(10e-9))
        };
        let mut detector = Detector::new(watch).ok()?;
        for reading in 0..60 {
            let deeper = if reading > 40 { 1e-6 } else { 0.0 };
            let reading = Metre(from.within(-1e-8, 1e-8) + deeper);
            let seen = detector.push(Second(1e-3), reading);
            to.numbers([seen.deformation.0, detector.baseline().rate()]);
            if let Touch::Began { ago } = seen.touch {
                to.number(ago.0);
            }
        }
        Some(())
    }),
    ("ramp: drifts", |from, to| {
        let (tau, time) = (
            Second(from.within(1e-2, 1.0)),
            Second(from.within(0.0, 3.0)),
        );
        for drift in [
            DriftModel::Linear,
            DriftModel::Logarithmic { tau },
            DriftModel::Exponential { tau },
            DriftModel::SawTooth { period: tau },
        ] {
            to.number(drift.at(time));
        }
        Some(())
    }),
    ("ramp: reference, regressor's noise", |from, to| {
        let reference = reference(from)?;
        to.numbers([reference.deformation().0, reference.regressor()]);
        let sample = sample(from, 0);
        let noisy = sample.with_regressor_sigma(&reference, from.within(0.0, 1e-2));
        to.number(noisy.sigma.0);
        let point = sample.load_point(&reference, NewtonPerMetre(6e3));
        to.numbers([
            point.force.0,
            point.displacement.0,
            point.displacement_sigma.0,
        ]);
        Some(())
    }),
    ("ramp: fit of a line", |from, to| {
        let mut ramp = Ramp::new(reference(from)?, Basis::LINEAR);
        fill(&mut ramp, from)?;
        judge(&ramp.fit(Noise::Larger).ok()?, from, to)
    }),
    ("ramp: fit with a drift", |from, to| {
        let tau = Second(from.within(0.01, 0.5));
        let basis = Basis::with_drift(DriftModel::Exponential { tau }).ok()?;
        let mut ramp = Ramp::new(reference(from)?, basis);
        fill(&mut ramp, from)?;
        to.number(ramp.residual_sigma()?.0);
        judge(&ramp.fit(Noise::Stated).ok()?, from, to)
    }),
    ("ramp: fit with all terms", |from, to| {
        let tau = Second(from.within(0.01, 0.5));
        let basis = Basis::new(&[
            Term::Level,
            Term::Slope,
            Term::Quadratic,
            Term::Drift(DriftModel::Logarithmic { tau }),
            Term::Drift(DriftModel::SawTooth {
                period: Second(0.05),
            }),
        ]);
        let mut ramp = Ramp::new(reference(from)?, basis.ok()?);
        fill(&mut ramp, from)?;
        to.number(ramp.residual_sigma()?.0);
        judge(&ramp.fit(Noise::Residual).ok()?, from, to)?;
        judge(&ramp.fit_first(3, Noise::Larger)?.ok()?, from, to)
    }),
    ("ramp: scatter", |from, to| {
        let mut scatter = Scatter::default();
        for _ in 0..5 {
            scatter.add(from.within(0.5, 2.0), from.within(0.01, 0.1));
        }
        to.numbers([scatter.mean(), scatter.chi_square(), scatter.birge_ratio()?]);
        to.word(scatter.count());
        Some(())
    }),
    ("ramp: stiffness of a ratio", |from, to| {
        let ratio = ratio(from);
        stiffness(
            ratio
                .stiffness(NewtonPerMetre(from.within(1e3, 1e4)))
                .ok()?,
            to,
        );
        Some(())
    }),
    ("uncertainty: budget", |from, to| {
        let budget = calibration(from).budget(from.within(0.1, 10.0), &operating_point(from));
        to.numbers([
            budget.force_scale,
            budget.sensing,
            budget.actuated,
            budget.stiffening,
            budget.current,
            budget.zero,
            budget.total(),
        ]);
        Some(())
    }),
    ("uncertainty: wider interval", |from, to| {
        let calibration = calibration(from);
        let wide = calibration.widen(&ratio(from), &operating_point(from));
        to.numbers([wide.value, wide.standard_error, wide.low, wide.high]);
        Some(())
    }),
    ("driver: ratio of counts", |from, to| {
        let ratio = scale()?.rational(code(from));
        to.word(ratio.m);
        to.word(ratio.n);
        to.number(ratio.residual_lsb);
        to.word(ratio.plausible.map_or(2, u32::from));
        Some(())
    }),
    ("driver: frequency", |from, to| {
        let hz = scale()?.frequency_hz(code(from));
        to.word(hz.to_bits() as u32);
        to.word((hz.to_bits() >> 32) as u32);
        Some(())
    }),
    ("driver: relative sigma", |from, to| {
        to.number(scale()?.relative_sigma(code(from)));
        Some(())
    }),
    ("math: coarse", |from, to| {
        to.number(math::coarse::sin_turns(from.within(-10.0, 10.0)));
        to.number(math::coarse::decay(from.within(0.0, 20.0)));
        Some(())
    }),
    ("math: Student's quantile", |from, to| {
        to.number(math::student::quantile_975(from.bits() % 500));
        Some(())
    }),
    ("products of 64 bits", |from, to| {
        let a = u64::from(from.bits()) << 32 | u64::from(from.bits());
        let b = u64::from(from.bits()) << 32 | u64::from(from.bits());
        let product = a.wrapping_mul(b);
        to.word(product as u32);
        to.word((product >> 32) as u32);
        let quotient = a / (b | 1);
        to.word(quotient as u32);
        to.word((a % (b | 1)) as u32);
        Some(())
    }),
    ("copies", |from, to| {
        let mut bytes = [0_u8; 67];
        for byte in &mut bytes {
            *byte = from.bits() as u8;
        }
        let (at, length) = ((from.bits() % 16) as usize, (from.bits() % 48) as usize);
        let mut copy = [0_u8; 67];
        let part = bytes.get(at..at + length)?;
        copy.get_mut(3..3 + length)?.copy_from_slice(part);
        for byte in copy {
            to.word(byte.into());
        }
        Some(())
    }),
];

fn curve(from: &mut Inputs) -> Option<MonotoneCurve<8>> {
    let mut at = (0.0, 0.0);
    let points = [0; 5].map(|_| {
        let here = at;
        at.0 += from.within(0.01, 0.1);
        at.1 += from.within(1e-5, 2e-4);
        here
    });
    MonotoneCurve::new(&points).ok()
}

fn law(from: &mut Inputs) -> Option<Saturating> {
    let at_rest = NewtonPerMetre(from.within(1e3, 1e4));
    let law = Saturating::new(at_rest, from.within(0.01, 0.3), Ampere(10.0)).ok()?;
    law.saturating(Tesla(from.within(0.0, 0.1)), Tesla(0.25))
        .ok()
}

fn stack(from: &mut Inputs) -> Option<TwoNode> {
    TwoNode::new(
        JoulePerKelvin(from.within(0.3, 3.0)),
        JoulePerKelvin(from.within(20.0, 100.0)),
        KelvinPerWatt(from.within(0.2, 2.0)),
        KelvinPerWatt(from.within(2.0, 20.0)),
    )
    .ok()
}

fn reference(from: &mut Inputs) -> Option<Reference> {
    Reference::new(Metre(from.within(1e-4, 5e-4)), from.within(0.5, 3.0)).ok()
}

fn sample(from: &mut Inputs, index: u16) -> RampSample {
    let regressor = -0.002 * f32::from(index % 50);
    RampSample {
        time: Second(f32::from(index) * 1e-3),
        deformation: Metre(-1e-4 * regressor + from.within(-3e-8, 3e-8)),
        regressor,
        sigma: Metre(from.within(1e-8, 3e-8)),
    }
}

fn fill(ramp: &mut Ramp, from: &mut Inputs) -> Option<()> {
    for index in 0..60 {
        ramp.push(&sample(from, index)).ok()?;
    }
    Some(())
}

/// Adds all results of a fit to the checksum.
fn judge(fit: &Fit, from: &mut Inputs, to: &mut Sum) -> Option<()> {
    to.word(fit.degrees_of_freedom());
    to.numbers([fit.chi_square(), fit.centre()]);
    to.number(fit.reduced_chi_square()?);
    for index in 0..fit.basis().terms().len() {
        let coefficient = fit.coefficient(index)?;
        to.numbers([coefficient.value, coefficient.standard_error]);
    }
    let sensing = NewtonPerMetre(6e3);
    let h = from.within(-0.1, 0.0);
    let total = fit.total_displacement();
    let points = [
        fit.load_point(h, sensing),
        fit.load_point_within(h, sensing, total),
    ];
    for point in points {
        to.numbers([
            point.force.0,
            point.displacement.0,
            point.displacement_sigma.0,
        ]);
    }
    for ratio in [fit.load_ratio(), fit.load_ratio_at(h)] {
        let ratio = ratio.ok()?;
        to.numbers([ratio.value, ratio.standard_error, ratio.low, ratio.high]);
    }
    stiffness(fit.load_stiffness(sensing).ok()?, to);
    Some(())
}

fn ratio(from: &mut Inputs) -> LoadRatio {
    let (value, half) = (from.within(0.1, 5.0), from.within(0.01, 1.0));
    LoadRatio {
        value,
        standard_error: half / 2.0,
        low: value - half,
        high: value + half,
    }
}

fn stiffness(of: LoadStiffness, to: &mut Sum) {
    to.number(of.low().0);
    to.number(of.high().map_or(0.0, |high| high.0));
    to.number(of.value().map_or(0.0, |value| value.0));
    to.word(of.contains(NewtonPerMetre(6e3)).into());
}

fn calibration(from: &mut Inputs) -> Calibration {
    let mut part = || from.within(0.0, 0.05);
    Calibration {
        force_scale: part(),
        sensing: part(),
        actuated: part(),
        stiffening: part(),
        current: part(),
        ..Calibration::default()
    }
}

fn operating_point(from: &mut Inputs) -> OperatingPoint {
    OperatingPoint {
        actuated_ratio: from.within(0.5, 3.0),
        rise: from.within(0.02, 0.2),
        logarithmic_slope: from.within(1.0, 2.0),
        deformation: Metre(from.within(1e-4, 5e-4)),
    }
}

/// Returns the driver's scale from codes to frequencies for one channel at 1 kHz.
fn scale() -> Option<ldc161x::Scale> {
    use ldc161x::{Acquisition, Channel, Model, Rate, ReferenceClock, Request, Sensor};
    let clock = ReferenceClock::External { hz: 30_000_000 };
    let acquisition = Acquisition::Single(Channel::Zero);
    let sensor = Sensor {
        highest_quality_factor: 50,
        lowest_rp_ohm: 3_000,
        highest_rp_ohm: 3_000,
        ..Sensor::new(2_000_000, 5_000_000)
    };
    let plan = Request::new(Model::Ldc1614, clock, acquisition, sensor)
        .rate(Rate::PerSecond(1_000))
        .plan();
    Some(plan.ok()?.configuration.scale(Channel::Zero))
}

fn code(from: &mut Inputs) -> ldc161x::Code28 {
    let bits = from.bits() >> 4;
    ldc161x::Word::from_registers((bits >> 16) as u16, bits as u16).code()
}
