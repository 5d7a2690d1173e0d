//! One whole evaluation, from codes to results with intervals, on inputs made of integers: it must
//! give the same bits on every machine. Needs `core` only, so that a target without `std` can run
//! it unchanged.

use palpate_model::calibration_curve::MonotoneCurve;
use palpate_model::contact::{Detector, Watch};
use palpate_model::magnetorheological::{Saturating, Stiffening, Tabulated, attraction, deviation};
use palpate_model::math::exp_m1;
use palpate_model::ramp::{
    Basis, DriftModel, LoadRatio, LoadStiffness, Noise, Ramp, RampSample, Reference, Scatter, Term,
};
use palpate_model::springs::two_state_load;
use palpate_model::tank::{relative_frequency_change, relative_inductance_change};
use palpate_model::thermal::{Copper, Temperatures, TwoNode};
use palpate_model::touch::{
    Array, Coefficients, Coil, CommonError, Indenter, Profile, ReadingError, Region,
};
use palpate_model::uncertainty::{Calibration, OperatingPoint};
use palpate_model::units::*;

/// Number of readings in the ramp.
pub const READINGS: u32 = 400;

/// Bits of all results that could differ between machines.
pub type Bits = [u32; 34];

struct Noise32(u32);

impl Noise32 {
    /// Random whole numbers from -2^11 to 2^11 with a nearly normal distribution.
    fn next(&mut self) -> i32 {
        let mut sum = 0;
        for _ in 0..4 {
            self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            sum += (self.0 >> 22) as i32 - 512;
        }
        sum
    }
}

/// Runs the evaluation. `None` if some part refuses, which must not happen. `one` is 1; the
/// compiler does not know that, so it cannot compute results in advance.
pub fn run(one: f32) -> Option<Bits> {
    let mut noise = Noise32(one as u32);
    let sensing = NewtonPerMetre(6e3 * one);
    let points = [
        (0.0, 0.0),
        (0.02, 60e-6),
        (0.05, 140e-6),
        (0.1, 250e-6),
        (0.2, 400e-6),
    ];
    let curve = MonotoneCurve::<8>::new(&points.map(|(x, y)| (x * one, y * one))).ok()?;
    let law = Saturating::new(NewtonPerMetre(4e3 * one), 0.1 * one, Ampere(10.0 * one)).ok()?;
    let law = law.saturating(Tesla(0.022 * one), Tesla(0.25 * one)).ok()?;
    let reference = Reference::new(Metre(0.3e-3 * one), law.reference_ratio(sensing)).ok()?;
    let tau = Second(0.05 * one);
    let basis = Basis::new(&[
        Term::Level,
        Term::Slope,
        Term::Quadratic,
        Term::Drift(DriftModel::Logarithmic { tau }),
        Term::Drift(DriftModel::SawTooth {
            period: Second(0.125),
        }),
    ]);
    let mut curved = Ramp::new(reference, basis.ok()?);
    let drift = DriftModel::Exponential { tau };
    let mut straight = Ramp::new(reference, Basis::with_drift(drift).ok()?);
    // The rise of the stiffness, with a lag of 2 ms.
    let (lag, mut late) = (Second(2e-3 * one), 0.1);
    let mut detector = Detector::new(Watch::new(Metre(10e-9 * one))).ok()?;
    let mut last = 0.0;

    for i in 0..READINGS {
        let current = Ampere(10.0 * (1.0 - (i % 50) as f32 / 49.0));
        let rise = law.rise(current).value;
        let h = deviation(law.reference_ratio(sensing), rise);
        // A converter code for roughly this deformation, from a straight line and noise.
        let depth = 0.3e-3 * 3.5 / (3.5 + h);
        let code = 230_000_000 - ((depth * 3e10) as i32 + noise.next()) as u32;
        let change = relative_inductance_change(relative_frequency_change(230_000_000, code));
        let read = curve.at(change);
        last = read.value;
        let sample = RampSample {
            time: Second(i as f32 / 400.0),
            deformation: Metre(read.value) - Metre(0.3e-3),
            regressor: h + attraction(Newton(1e-3), law.spring(current), Metre(read.value)),
            sigma: Metre(read.sigma(1e-6)),
        };
        straight.push(&sample).ok()?;
        late -= exp_m1(-(Second(2.5e-3) / lag)) * (rise - late);
        let lagging = deviation(law.reference_ratio(sensing), late);
        curved
            .push(&RampSample {
                regressor: lagging,
                ..sample
            })
            .ok()?;
        detector.push(Second(1e-3), Metre(noise.next() as f32 * 1e-11));
    }

    let straight = straight.fit(Noise::Larger).ok()?;
    let curved = curved.fit(Noise::Residual).ok()?;
    let (of_line, of_curve) = (straight.load_ratio().ok()?, curved.load_ratio().ok()?);
    let calibration = Calibration {
        stiffening: 0.02,
        actuated: 0.01,
        sensing: 0.01,
        ..Calibration::default()
    };
    let at = OperatingPoint {
        actuated_ratio: reference.regressor(),
        rise: law.rise_at_peak(),
        logarithmic_slope: law.logarithmic_slope(Ampere(10.0)),
        deformation: reference.deformation(),
    };
    let claim = calibration.widen(&of_line, &at);
    let point = curved.load_point_within(-0.05, sensing, straight.total_displacement());
    let stack = TwoNode::new(
        JoulePerKelvin(0.8 * one),
        JoulePerKelvin(60.0),
        KelvinPerWatt(0.5),
        KelvinPerWatt(8.0),
    );
    let rest = Temperatures::uniform(Celsius(25.0));
    let (coil, long) = (Copper(Ohm(0.389)), Second(0.8));
    let hot =
        stack
            .ok()?
            .after_pulse(rest, coil, Ampere(8.0), Celsius(25.0), long, Celsius(80.0))?;
    let table = Tabulated::new(NewtonPerMetre(4e3 * one), curve).ok()?;
    let rise = table.rise(Ampere(-0.07 * one));
    let mut scatter = Scatter::default();
    for kappa in [one / 3.0, 0.3, 0.4] {
        scatter.add(kappa, 0.01 * one);
    }
    let states = [Metre(0.31e-3 * one), Metre(0.3e-3 * one)];
    let plain = two_state_load(
        sensing,
        [law.spring(Ampere(9.0 * one)), table.at_rest()],
        states,
    );
    let LoadStiffness::Within { high, .. } = claim.stiffness(sensing).ok()? else {
        return None;
    };
    let ends = |ratio: &LoadRatio| [ratio.value, ratio.standard_error, ratio.low, ratio.high];
    let [a, b, c, d] = ends(&of_line);
    let [e, f, g, h] = ends(&of_curve);
    let [_, i, j, k] = ends(&claim);
    let values: [f32; 26] = [
        a,
        b,
        c,
        d,
        e,
        f,
        g,
        h,
        i,
        j,
        k,
        straight.reduced_chi_square()?,
        straight.coefficient(2)?.value,
        curved.coefficient(3)?.value,
        point.displacement.0,
        point.displacement_sigma.0,
        point.force.0,
        point.force_sigma.0,
        hot.copper.0,
        hot.pad.0,
        detector.baseline().rate(),
        last,
        rise.per_ampere,
        scatter.birge_ratio()?,
        plain.0,
        high.0,
    ];
    let mut bits = [0; 34];
    let all = values.into_iter().chain(touch(one)?);
    for (to, value) in bits.iter_mut().zip(all) {
        *to = value.to_bits();
    }
    Some(bits)
}

/// A press on seven coils, with whole numbers as coefficients and readings.
pub fn array(one: f32) -> Option<Array> {
    let table = |of: [i16; 9]| of.map(|value| f32::from(value) * 1e-5 * one);
    let [a, b, c, d, e, ..] = table([-150, -40, 30, 5, -2, 0, 0, 0, 0]);
    let profile = Profile::new(Coefficients {
        spacing: Metre(2e-3),
        least_radius: Metre(1e-3),
        greatest_radius: Metre(5e-3),
        base: table([2_200, 1_700, 400, -220, -240, -120, -60, -30, -15]),
        linear: [a, b, c, d, e],
        quadratic: [b, a, d, c, e],
        bent: [[90e-5, 60e-5, 5e-5, 0.0], [a, b, c, 0.0], [b, c, 0.0, 0.0]],
        greatest_force: Newton(2.0),
    });
    let coil = |x: f32, y: f32| Coil {
        x: Metre(x * one),
        y: Metre(y),
        gain: 1.0 + x,
        noise: 1e-5,
    };
    let coils = [
        coil(0.0, 0.0),
        coil(6e-3, 0.0),
        coil(3e-3, 5.196e-3),
        coil(-3e-3, 5.196e-3),
        coil(-6e-3, 0.0),
        coil(-3e-3, -5.196e-3),
        coil(3e-3, -5.196e-3),
    ];
    let errors = ReadingError {
        relative: 0.01,
        of_largest: 5e-3,
    };
    let region = Region::Disc {
        centre: [Metre(0.0); 2],
        radius: Metre(7e-3),
    };
    Array::new(
        &coils,
        profile.ok()?,
        (errors, CommonError::default()),
        region,
    )
    .ok()
}

/// Readings of the press.
pub const READ: [f32; 7] = [
    0.01279, 0.00412, 0.00094, -0.00171, -0.00171, -0.00178, -0.00033,
];

fn touch(one: f32) -> Option<[f32; 8]> {
    let array = array(one)?;
    let verdict = array.estimate(&READ, &Indenter::Unknown, None);
    let press = *verdict.claimed()?;
    let ball = Indenter::Declared {
        at_one_newton: Metre(2e-3 * one),
        exponent: 1.0 / 3.0,
        uncertainty: 0.1,
    };
    let again = array.estimate(&READ, &ball, Some(&press));
    let (again, ellipse) = (again.claimed()?, press.ellipse());
    Some([
        press.x.0,
        press.y.0,
        press.force.0,
        press.radius.0,
        press.chi_square,
        ellipse.major.0,
        ellipse.angle_rad,
        again.force.0,
    ])
}
