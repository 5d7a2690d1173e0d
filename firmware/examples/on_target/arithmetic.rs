//! Arithmetic that the recorded presses do not reach, on a table of inputs: numbers of any kind, and
//! functions that run before the procedure or with other settings. Each gives a checksum over the bits of
//! its results.

use palpate_model::calibration_curve::MonotoneCurve;
use palpate_model::magnetorheological::{Stiffening, Tabulated};
use palpate_model::math;
use palpate_model::ramp::DriftModel;
use palpate_model::units::{Ampere, NewtonPerMetre, Second};

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

/// All checked functions, with their names.
pub const CHECKS: [(&str, Check); 9] = [
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
    ("math", |from, to| {
        let (a, b) = (from.any(), from.any());
        to.numbers([math::sqrt(a), math::ln(a), math::ln_1p(a)]);
        to.numbers([math::floor(a), math::hypot(a, b)]);
        to.number(math::ln_1p(from.within(-0.9, 3.0)));
        let x = from.within(-90.0, 90.0);
        to.numbers([math::exp(x), math::exp_m1(x), math::exp_m1(x * 1e-3)]);
        Some(())
    }),
    ("driver: frequency, relative sigma", |from, to| {
        let (scale, code) = (scale()?, code(from));
        let hz = scale.frequency_hz(code);
        to.word(hz.to_bits() as u32);
        to.word((hz.to_bits() >> 32) as u32);
        to.number(scale.relative_sigma(code));
        Some(())
    }),
    ("stiffening: curve", |from, to| {
        let curve = curve(from)?;
        let law = Tabulated::new(NewtonPerMetre(from.within(1e3, 1e4)), curve).ok()?;
        let rise = law.rise(Ampere(from.within(-0.2, 0.2)));
        to.numbers([rise.value, rise.per_ampere, law.at_rest().0]);
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
